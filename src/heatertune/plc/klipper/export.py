"""Words → the lines of a heater's section, and G-code that tries them; the same words always give the same bytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.plc.cpu.letters import in_ascii
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.klipper.words import FIELDS, PLACES, REPORT_S
from heatertune.plc.printer_heater import PLACEHOLDER, UNKNOWN
from heatertune.plc.words import Certificate, Words

__all__ = ["entries", "export_words", "heater_of"]

_PWM_S: Final = 0.1


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the two files."""
    return {"klipper_heater.cfg": _config(words, certificate), "klipper_try.gcode": _trial(words, certificate)}


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, dict[str, str]]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.TypedWord`."""
    return entry_texts(_values(words))


def _values(words: Words) -> dict[str, str]:
    return {field.name: f"{words.values[field.name]:.{PLACES}f}" for field in FIELDS}


def heater_of(known: Mapping[str, str]) -> tuple[str, str]:
    """Return the heater's section of printer.cfg, and its name in G-code, for what is known of the open points."""
    heater = known.get("heater", UNKNOWN)
    if heater == "heater_generic":
        return f"{heater} {PLACEHOLDER}", PLACEHOLDER
    return (PLACEHOLDER, PLACEHOLDER) if heater == UNKNOWN else (heater, heater)


def _config(words: Words, certificate: Certificate) -> str:
    section, name = heater_of(certificate.switches)
    missing = (f"; put your heater's name in the place of {PLACEHOLDER}, which Klipper refuses"
               if name == PLACEHOLDER else "")
    whose = ("your [extruder], [heater_bed] or [heater_generic ...]; design with --switch heater=extruder, heater_bed "
             "or heater_generic, and the files name it" if section == PLACEHOLDER else f"your [{section}]")
    pwm = _PWM_S if certificate.actuator is None else certificate.actuator.pwm_period_s
    lines = [
        "heater of a printer: Klipper or Kalico, control: pid", *certificate.head,
        f"a report each {REPORT_S:g} s: a thermistor on a pin of the controller board",
        "remains to be done by hand:",
        f"  1. put these lines in place of the same ones in {whose}{missing}",
        "  2. if a block SAVE_CONFIG below in printer.cfg has gains of this heater, change them there: they count",
        "  3. RESTART, then try them with klipper_try.gcode, the printer in sight",
        "  4. leave verify_heater, min_temp and max_temp as they protect your heater: the proof knows nothing of them",
    ]
    pairs = {"control": "pid", **_values(words), "pwm_cycle_time": f"{pwm:.{PLACES}f}"}
    body = "".join(f"{name}: {value}\n" for name, value in pairs.items())
    return in_ascii("".join(f"# {line}\n" for line in lines)) + f"[{section}]\n{body}"


def _trial(words: Words, certificate: Certificate) -> str:
    target = certificate.setpoint_degC
    section, name = heater_of(certificate.switches)
    sensor = f'"{section}"' if " " in section else section
    gains = _values(words)
    lines = ["; tries the gains: heats, waits, cools with the part's fan, waits, and switches off; nothing is extruded",
             *(f"; {in_ascii(line)}" for line in certificate.head),
             "; with Kalico this tries the gains before they are in printer.cfg:",
             f"; SET_HEATER_PID HEATER={name} KP={gains['pid_Kp']} KI={gains['pid_Ki']} KD={gains['pid_Kd']}"]
    if target is None:
        return "\n".join([*lines, "; no setpoint was proven: enter yours",
                          f"; SET_HEATER_TEMPERATURE HEATER={name} TARGET="]) + "\n"
    lines += [
        "M107 ; the part's fan off",
        f"SET_HEATER_TEMPERATURE HEATER={name} TARGET={target:.10g} ; the proven setpoint",
        f"TEMPERATURE_WAIT SENSOR={sensor} MINIMUM={target - 1.0:.10g}", "G4 P120000 ; overshoot and settling",
        "M106 S255 ; a load: the part's fan", "G4 P60000", "M107", "G4 P60000", "TURN_OFF_HEATERS",
    ]
    return "\n".join(lines) + "\n"
