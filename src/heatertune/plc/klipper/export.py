"""Words → the lines of a heater's section, and G-code that tries them; the same words always give the same bytes.

The words in printer.cfg, in its block SAVE_CONFIG, or in what PID_CALIBRATE prints.

What the heater's section and the G-code that tries it set in the host.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.statements import in_ascii
from heatertune.plc.exported import TextSettings
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.klipper.step import KlipperAssumptions
from heatertune.plc.klipper.words import FIELDS, PLACES, REPORT_S, USUAL
from heatertune.plc.printer_heater import KLIPPER_HEATER, PLACEHOLDER, UNKNOWN, several
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, wrong
from heatertune.plc.words import Certificate, Words

__all__ = ["entries", "export_words", "from_text", "heater_of", "loaders"]


_SAVED: Final = "#*#"
_HEAD: Final = re.compile(r"\[\s*([^\]]*?)\s*\]")
_LINE: Final = re.compile(r"([A-Za-z_]\w*)\s*[:=]\s*(.*?)")
#: PID_CALIBRATE's own line; the unknown temperature before the colon is Kalico's
_PRINTED: Final = re.compile(r"pid_Kp\s*=\s*(\S+)\s+pid_Ki\s*=\s*(\S+)\s+pid_Kd\s*=\s*(\S+)", re.IGNORECASE)
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_FIELDS: Final = {field.name.lower(): field for field in FIELDS}
_GAINS: Final = ("pid_Kp", "pid_Ki", "pid_Kd")


class _Line(NamedTuple):
    number: int
    section: str
    name: str
    value: str
    saved: bool


def from_text(text: str, _sample_time_s: float | None, source: str, heater: str = UNKNOWN) -> ReadBack:
    """Return the words of one heater in a text, and what else stands there.

    The block SAVE_CONFIG counts before the lines above it, as in the firmware.

    Args:
        text: of printer.cfg, or what PID_CALIBRATE prints.
        source: its name, for error messages.
        heater: which one's gains are read, a setting of `KLIPPER_HEATER`; unknown: those of the only heater.

    Raises:
        InputError: a line that is none, a gain that is missing, there with two values, no number of three decimals or
            out of its range; another control than pid; several heaters, and which one is unknown; none of this kind.
    """
    collected, printed = WordCollector(source, FIELDS), False
    for number, line in lines_of(text):
        found = _PRINTED.search(line)
        if found is not None and not line.startswith("#"):
            printed = True
            for name, value in zip(_GAINS, found.groups(), strict=True):
                collected.put(name, _number(value), number, value)
    if printed:
        return ReadBack(_with_usual(collected, set()), _told(set()))
    lines = list(_lines(text, source))
    section = _section(lines, source, heater)
    return _of_section(lines, section, collected, source)


def _lines(text: str, source: str) -> Iterator[_Line]:
    """Yield the options of all sections, without comments."""
    section, saved = "", False
    for number, line in lines_of(text):
        is_saved = line.startswith(_SAVED)
        if is_saved and not saved:
            section, saved = "", True
        code = re.split(r"[#;]", line[len(_SAVED):] if is_saved else line, maxsplit=1)[0].strip()
        head = _HEAD.fullmatch(code)
        if head is not None:
            section = " ".join(head[1].split())
            continue
        option = _LINE.fullmatch(code)
        if option is not None:
            yield _Line(number, section, option[1].lower(), option[2], is_saved)
        elif code and not is_saved and code.split()[0].lower() in _FIELDS:
            raise wrong(source, number, code.split()[0], code, "name: value")


def _section(lines: list[_Line], source: str, heater: str) -> str:
    """Return the section of the heater that is read."""
    sections = list(dict.fromkeys(line.section for line in lines if line.name in _FIELDS))
    with_gain = {line.section for line in lines if line.name == "pid_kp"}
    having = [one for one in sections if one in with_gain] or sections
    if not having:
        raise InputError(f"{source}: no gains are there; expected pid_Kp, pid_Ki and pid_Kd of a heater's section, or "
                         "what PID_CALIBRATE prints")
    kinds = [one.split(" ")[0] for one in having]
    of_it = [one for one, kind in zip(having, kinds, strict=True) if heater in (UNKNOWN, kind)]
    if len(of_it) == 1:
        return of_it[0]
    heads = " and ".join(f"[{one}]" for one in having)
    if heater != UNKNOWN:
        raise InputError(f"{source}: gains of {heads}; expected those of one [{heater}]")
    raise several(source, heads, [kind for kind in KLIPPER_HEATER.summary if kinds.count(kind) == 1])


def _of_section(lines: list[_Line], section: str, collected: WordCollector, source: str) -> ReadBack:
    own = [line for line in lines if line.section == section]
    saved = {line.name for line in own if line.saved}
    over, there = [], set()
    for line in own:
        if line.saved < (line.name in saved):
            over.append(f"{line.name}: {line.value} (line {line.number}; SAVE_CONFIG has another)")
            continue
        if line.name == "control" and line.value.lower() != "pid":
            raise wrong(source, line.number, "control", line.value, "pid")
        field = _FIELDS.get(line.name)
        if field is None:
            if line.name != "control":
                over.append(f"{line.name}: {line.value} (line {line.number})")
            continue
        collected.put(field.name, _number(line.value), line.number, line.value)
        there.add(field.name)
    others = dict.fromkeys(line.section for line in lines if line.section != section)
    over += [f"[{one}]" if one else "lines before the first section" for one in others]
    return ReadBack(_with_usual(collected, there), (*over, *_told(there)))


def _with_usual(collected: WordCollector, there: set[str]) -> dict[str, int | float]:
    for name, value in USUAL.items():
        if name not in there:
            collected.put(name, value, 0, f"{value:.{PLACES}f}")
    return collected.values()


def _told(there: set[str]) -> tuple[str, ...]:
    return tuple(f"{name}, which is not set: {value:.{PLACES}f} as in the firmware" for name, value in USUAL.items()
                 if name not in there)


def _number(text: str) -> float | None:
    return float(text) if _NUMBER.fullmatch(text) else None


_CONFIG: Final = "klipper_heater.cfg"
_TRIAL: Final = "klipper_try.gcode"
_PERIOD: Final = re.compile(r"^pwm_cycle_time\s*[:=]\s*(\S+)", re.MULTILINE)
_TRIED: Final = re.compile(r"SET_HEATER_PID HEATER=\w+ KP=(\S+) KI=(\S+) KD=(\S+)")
_TARGET: Final = re.compile(r"^SET_HEATER_TEMPERATURE HEATER=\w+ TARGET=(\S+)", re.MULTILINE)


def loaders(files: Mapping[str, str | bytes], assume: KlipperAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads each file."""
    return {_CONFIG: lambda: _section_exported(str(files[_CONFIG])),
            _TRIAL: lambda: _trial_exported(str(files[_TRIAL]))}


def _section_exported(text: str) -> TextSettings:
    period = _PERIOD.search(text)
    if period is None:
        raise InputError("pwm_cycle_time is missing")
    return TextSettings(from_text(text, None, _CONFIG).values, period_s=float(period[1]))


def _trial_exported(text: str) -> TextSettings:
    """Return the gains that are tried, and at which setpoint, where one was proven."""
    tried, target = _TRIED.search(text), _TARGET.search(text)
    if tried is None:
        raise InputError("SET_HEATER_PID is missing")
    gains = dict(zip(("pid_Kp", "pid_Ki", "pid_Kd"), map(float, tried.groups()), strict=True))
    return TextSettings(gains, setpoint_degC=None if target is None else float(target[1]))


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
    whose = ("your [extruder], [heater_bed] or [heater_generic ...]; design with --assume heater=extruder, heater_bed "
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
