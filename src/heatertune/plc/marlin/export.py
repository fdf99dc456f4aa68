"""Words → lines for Configuration.h, and G-code that sets the gains of a firmware that runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.plc.cpu.letters import in_ascii
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.marlin.words import FIELDS, GAINS
from heatertune.plc.parallel.words import decimal
from heatertune.plc.printer_heater import UNKNOWN
from heatertune.plc.words import Certificate, Words

__all__ = ["entries", "export_words"]

_BUILT_WITH: Final = {"hotend": "PIDTEMP, of a single hot end; no lists per hot end", "bed": "PIDTEMPBED"}
_OF: Final = {UNKNOWN: "", "hotend": " of a hot end", "bed": " of the bed"}
_WHICH: Final = ("gains of which heater? take the lines of yours without the sign of a comment, or design with "
                 "--switch heater=hotend or heater=bed")

_FORMAT = {field.name: field.format for field in FIELDS}


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return both files; the same words and certificate give the same bytes."""
    heater = certificate.switches.get("heater", UNKNOWN)
    limit = "MAX_BED_POWER" if heater == "bed" else "PID_MAX"
    names = {limit: "PID_MAX", "PID_FUNCTIONAL_RANGE": "PID_FUNCTIONAL_RANGE", "PID_K1": "PID_K1"}
    built = [f"#define {name} {_text(words, word)}" for name, word in names.items()]
    loops = f"ADC_LOOPS = {words.whole['ADC_LOOPS']}"
    head = _head(words, certificate, heater)
    header = [*[f"// {line}" for line in head], "//", *_defaults(words, heater), *built,
              f"// {loops}: PID_dT of the build is 16 of these by the timer's frequency"]
    code = [*[f"; {line}" for line in head], ";",
            "; the firmware has to be built with these, no G-code sets them:",
            *[f"; {line}" for line in built], f"; {loops}", ";",
            "; before: send M503 and keep what it prints; M501 goes back to what was saved last",
            *_commands(words, heater), "M503 S0", "; when it has worked: M500 saves it"]
    return {"marlin_pid.h": "\n".join(header) + "\n", "marlin_pid.gcode": "\n".join(code) + "\n"}


def _defaults(words: Words, heater: str) -> list[str]:
    """Return the gains as lines of Configuration.h: of the heater, or as comments of both while it is unknown."""
    of = {kind: [f"#define DEFAULT_{kind}{field.name} {_text(words, field.name)}" for field in GAINS]
          for kind in ("", "bed")}
    if heater != UNKNOWN:
        return [f"// Configuration.h, with {_BUILT_WITH[heater]}", *of["bed" if heater == "bed" else ""]]
    return [f"// {_WHICH}", "// of a single hot end (PIDTEMP):", *(f"// {line}" for line in of[""]),
            "// of a bed (PIDTEMPBED; MAX_BED_POWER in the place of PID_MAX):", *(f"// {line}" for line in of["bed"])]


def _commands(words: Words, heater: str) -> list[str]:
    """Return the G-code that sets the gains of the heater; comments of both while it is unknown."""
    gains = " ".join(f"{field.address[-1]}{_text(words, field.name)}" for field in GAINS)
    if heater != UNKNOWN:
        return [f"{'M304' if heater == 'bed' else 'M301'} {gains}"]
    return [f"; {_WHICH}", f"; M301 {gains}", "; or, for a bed:", f"; M304 {gains}"]


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, dict[str, str]]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.TypedWord`."""
    return entry_texts({field.name: _text(words, field.name) for field in FIELDS})


def _text(words: Words, name: str) -> str:
    value = words.values[name]
    return decimal(value, _FORMAT[name]) if _FORMAT[name] == "REAL" else str(value)


def _head(words: Words, certificate: Certificate, heater: str) -> tuple[str, ...]:
    scale, values = words.scaling, words.values
    powers: Mapping[str, float] = {name: 100.0 * values[name] / 255.0 for name in ("Kp", "PID_MAX")}
    return (
        f"heater controller for Marlin's PID{_OF[heater]}",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s (PID_dT of a 1000 Hz "
        f"timer); Kp is {powers['Kp']:.4g} % per degC; at most {powers['PID_MAX']:.4g} %",
        *map(in_ascii, certificate.head),
        "pulses: the firmware's own, 127 steps of the timer",
    )
