"""Words → lines for Configuration.h, and G-code that sets the gains of a firmware that runs."""

from __future__ import annotations

from collections.abc import Mapping

from heatertune.plc.marlin.words import FIELDS, GAINS
from heatertune.plc.parallel.words import decimal
from heatertune.plc.typed import entry_texts
from heatertune.plc.words import Certificate, Words

__all__ = ["entries", "export_words"]

_FORMAT = {field.name: field.format for field in FIELDS}


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return both files; the same words and certificate give the same bytes."""
    built = [f"#define {name} {_text(words, name)}" for name in ("PID_MAX", "PID_FUNCTIONAL_RANGE", "PID_K1")]
    loops = f"ADC_LOOPS = {words.whole['ADC_LOOPS']}"
    defaults = [f"#define DEFAULT_{field.name} {_text(words, field.name)}" for field in GAINS]
    head = _head(words, certificate)
    header = [*[f"// {line}" for line in head], "//", "// Configuration.h of a single hot end; no lists per hot end",
              *defaults, *built, f"// {loops}: PID_dT of the build is 16 of these by the timer's frequency"]
    gains = " ".join(f"{field.address[-1]}{_text(words, field.name)}" for field in GAINS)
    code = [*[f"; {line}" for line in head], ";",
            "; the firmware has to be built with these, no G-code sets them:",
            *[f"; {line}" for line in built], f"; {loops}", ";",
            "; before: send M503 and keep what it prints; M501 goes back to what was saved last",
            f"M301 {gains}", "M503 S0", "; when it has worked: M500 saves it"]
    return {"marlin_pid.h": "\n".join(header) + "\n", "marlin_pid.gcode": "\n".join(code) + "\n"}


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, dict[str, str]]:
    """Return each word as the exported files have it, see `heatertune.plc.typed.TypedWord`."""
    return entry_texts({field.name: _text(words, field.name) for field in FIELDS})


def _text(words: Words, name: str) -> str:
    value = words.values[name]
    return decimal(value, _FORMAT[name]) if _FORMAT[name] == "REAL" else str(value)


def _head(words: Words, certificate: Certificate) -> tuple[str, ...]:
    scale, values = words.scaling, words.values
    powers: Mapping[str, float] = {name: 100.0 * values[name] / 255.0 for name in ("Kp", "PID_MAX")}
    return (
        "heater controller for Marlin's PID of a hot end",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s (PID_dT of a 1000 Hz "
        f"timer); Kp is {powers['Kp']:.4g} % per degC; at most {powers['PID_MAX']:.4g} %",
        *certificate.head,
        "pulses: the firmware's own, 127 steps of the timer",
    )
