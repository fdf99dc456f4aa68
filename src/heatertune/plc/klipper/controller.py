"""The PID of Klipper and Kalico: its words, its law, the lines of printer.cfg and the G-code that tries them.

With T the reading, e the setpoint minus T, t the 0.3 s of a report and s the smoothing time:

    D = ΔT/t                                where a report is no shorter than s, else
    D = (D·(s − t) + ΔT)/s
    I = I + e·t                             held in 0…max_power/Ki, kept where the output is not at a limit
    duty = Kp·e + Ki·I − Kd·D               held in 0…max_power

The duty is sent where it is at least a band away from the last one sent, or where that one, not being 0, is to be
refreshed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.pid.design_values import Timer
from heatertune.plc.core import Sensor, StepFunctions, count
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.exported import TextSettings
from heatertune.plc.firmware.firmware_pid import FirmwarePid, controller_of, texts_of
from heatertune.plc.firmware.firmware_text import PLACEHOLDER, UNKNOWN, commented, heater_open_point, several
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, demand_whole_lines, lines_of, wrong
from heatertune.plc.words import Certificate, WordField, Words

__all__ = ["COLD", "Klipper", "KlipperAssumptions", "heater_of", "loop_of", "step"]

#: between two reports of a thermistor (klippy/extras/adc_temperature.py) [s]
REPORT_S: Final = 0.3
#: of the PWM where the section does not say [s]
PWM_S: Final = 0.1
#: gains are of an output of 0…255, as those of the firmwares before it
GAIN_BASE: Final = 255.0
#: decimals with which PID_CALIBRATE and SAVE_CONFIG write
PLACES: Final = 3
#: the firmware's own where the section does not say
USUAL: Final = {"max_power": 1.0, "smooth_time": 1.0}

_LEAST: Final = 10.0 ** -PLACES


def _word(name: str, low: float, high: float, comment: str) -> WordField:
    return WordField(name=name, address=name, format="LREAL", low=low, high=high, places=PLACES, comment=comment)


GAINS: Final = (
    _word("pid_Kp", 0.0, 1e6, "gain: 255 is full power per °C"),
    _word("pid_Ki", 0.0, 1e6, "integral gain, per s: pid_Kp/TN"),
    _word("pid_Kd", 0.0, 1e6, "derivative gain, s: pid_Kp·TV"),
)
SETTINGS: Final = (
    _word("max_power", _LEAST, 1.0, "largest power, 1 is full"),
    _word("smooth_time", _LEAST, 1000.0, "smooths the derivative, s"),
)
FIELDS: Final = (*GAINS, *SETTINGS)


def _oddities(v: Mapping[str, Number]) -> Iterator[str]:
    if v["max_power"] < 1.0:
        yield f"max_power is {v['max_power']:g}: the heater never gets all of its power."
    if v["smooth_time"] < REPORT_S:
        yield "smooth_time is shorter than a report: the derivative is not smoothed."


#: which source: what a change is held against, and how long a command holds
KLIPPER: Final = 0
KALICO: Final = 1
OLDER: Final = 2

_BAND: Final = 0.05  # smaller changes of the duty are not sent
#: a command is sent again with the first report that comes 2.399 s (4.05 s) or more after it
_REPORTS: Final = 8
_REPORTS_OLDER: Final = 14


HEATER: Final = heater_open_point(
    ("extruder", "heater_bed", "heater_generic"),
    "the section of printer.cfg; if it is unknown, the exported files name no heater")


class KlipperAssumptions(NamedTuple):
    """The points in which the sources differ, see DIFFERENCES.md."""

    source: Annotated[int, OpenPoint(
        name="firmware", means={"klipper": KLIPPER, "kalico": KALICO, "older": OLDER},
        reason="version of the source: a change is not sent if it is below 5 % of max_power (klipper) or of full power "
               "(kalico, older); a command is repeated after 2.4 s (klipper, kalico) or 4.2 s (older)",
    )] = KLIPPER
    heater: Annotated[int, HEATER] = 0


class KlipperLoop(NamedTuple):
    """What words and source make."""

    kp: float
    ki: float
    kd: float
    most: float  # of the duty
    most_integral: float
    smooth: float
    band: float
    reports: int


class KlipperState(NamedTuple):
    """What the host keeps from report to report."""

    begun: bool = False
    before: float = 0.0  # the reading of the last report
    slope: float = 0.0
    integral: float = 0.0
    duty: float = 0.0  # that was sent last
    since: int = 0  # reports since then


COLD: Final = KlipperState()


def loop_of(values: Mapping[str, Number], assume: KlipperAssumptions) -> KlipperLoop:
    """Return what the host makes of the words when it starts."""
    ki, most = values["pid_Ki"] / GAIN_BASE, float(values["max_power"])
    return KlipperLoop(
        kp=values["pid_Kp"] / GAIN_BASE, ki=ki, kd=values["pid_Kd"] / GAIN_BASE, most=most,
        most_integral=most / ki if ki else 0.0, smooth=float(values["smooth_time"]),
        band=most * _BAND if assume.source == KLIPPER else _BAND,
        reports=_REPORTS_OLDER if assume.source == OLDER else _REPORTS,
    )


def _measure(sensor: Sensor, temperature_degC: float) -> float:
    """Return the reading [°C]."""
    return sensor.low + sensor.span * count(sensor, temperature_degC) / sensor.counts


def step(
    loop: KlipperLoop, state: KlipperState, setpoint: float, reading: float, _begins: bool
) -> tuple[KlipperState, float, float, int]:
    """Take one report, see `heatertune.plc.core.StepFunctions`.

    Args:
        loop: what words and source make.
        state: before the report.
        setpoint: [°C]; 0 or less: the heater is off.
        reading: [°C].
        _begins: not looked at: the PWM is behind the duty.
    """
    change = reading - (state.before if state.begun else reading)
    slope = (change / REPORT_S if loop.smooth <= REPORT_S
             else (state.slope * (loop.smooth - REPORT_S) + change) / loop.smooth)
    error = setpoint - reading
    integral = _clamp(state.integral + error * REPORT_S, loop.most_integral)
    demand = loop.kp * error + loop.ki * integral - loop.kd * slope
    duty = _clamp(demand, loop.most)
    if demand != duty:
        integral = state.integral
    flags = (1 if demand > duty else 0) + (2 if duty == 0.0 else 0)
    if setpoint <= 0.0:
        duty = 0.0
    may_wait = state.since < loop.reports or state.duty == 0.0
    if may_wait and abs(duty - state.duty) < loop.band:
        after = KlipperState(True, reading, slope, integral, state.duty, min(state.since + 1, loop.reports))
        flags += 4
    else:
        after = KlipperState(True, reading, slope, integral, duty, 1)
    return after, 100.0 * after.duty, after.duty, flags


def _clamp(value: float, most: float) -> float:
    """Return a value within 0…most; what is no number becomes the most, as in the original."""
    below = value if value < most else most
    return below if below > 0.0 else 0.0


_SAVED: Final = "#*#"
_HEAD: Final = re.compile(r"\[\s*([^\]]*?)\s*\]")
_LINE: Final = re.compile(r"([A-Za-z_]\w*)\s*[:=]\s*(.*?)")
#: PID_CALIBRATE's own line; the unknown temperature before the colon is Kalico's
_PRINTED: Final = re.compile(  # by PID_CALIBRATE, or as Kalico's SET_HEATER_PID
    r"\b(?:pid_)?Kp\s*=\s*(\S+)\s+(?:pid_)?Ki\s*=\s*(\S+)\s+(?:pid_)?Kd\s*=\s*(\S+)", re.IGNORECASE)
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_BY_NAME: Final = {field.name.lower(): field for field in FIELDS}


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
        heater: which one's gains are read, a setting of `HEATER`; unknown: those of the only heater.

    Raises:
        InputError: a line that is none, a gain that is missing, there with two values, no number of three decimals or
            out of its range; another control than pid; several heaters, and which one is unknown; none of this kind.
    """
    demand_whole_lines(text, source)
    collected, printed = WordCollector(source, FIELDS), False
    for number, line in lines_of(text):
        match = _PRINTED.search(line)
        if match is not None and not line.startswith("#"):
            printed = True
            for field, value in zip(GAINS, match.groups(), strict=True):
                collected.put(field.name, _number(value), number, value)
    if printed:
        return _with_defaults(collected, ())
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
        elif code and not is_saved and code.split()[0].lower() in _BY_NAME:
            raise wrong(source, number, code.split()[0], code, "name: value")


def _section(lines: list[_Line], source: str, heater: str) -> str:
    """Return the section of the heater that is read."""
    sections = list(dict.fromkeys(line.section for line in lines if line.name in _BY_NAME))
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
    raise several(source, heads, [kind for kind in HEATER.summary if kinds.count(kind) == 1])


def _of_section(lines: list[_Line], section: str, collected: WordCollector, source: str) -> ReadBack:
    own = [line for line in lines if line.section == section]
    saved = {line.name for line in own if line.saved}
    over = []
    for line in own:
        if line.saved < (line.name in saved):
            over.append(f"{line.name}: {line.value} (line {line.number}; SAVE_CONFIG has another)")
            continue
        if line.name == "control" and line.value.lower() != "pid":
            raise wrong(source, line.number, "control", line.value, "pid")
        field = _BY_NAME.get(line.name)
        if field is None:
            if line.name != "control":
                over.append(f"{line.name}: {line.value} (line {line.number})")
            continue
        collected.put(field.name, _number(line.value), line.number, line.value)
    others = dict.fromkeys(line.section for line in lines if line.section != section)
    over += [f"[{one}]" if one else "lines before the first section" for one in others]
    return _with_defaults(collected, over)


def _with_defaults(collected: WordCollector, over: Iterable[str]) -> ReadBack:
    assumed = collected.assume(USUAL)
    return ReadBack(collected.values(), tuple(over), assumed=assumed)


def _number(text: str) -> float | None:
    return float(text) if _NUMBER.fullmatch(text) else None


_CONFIG: Final = "klipper_heater.cfg"
_TRIAL: Final = "klipper_try.gcode"
_PERIOD: Final = re.compile(r"^pwm_cycle_time\s*[:=]\s*(\S+)", re.MULTILINE)
_TRIED: Final = re.compile(r"SET_HEATER_PID HEATER=\w+ KP=(\S+) KI=(\S+) KD=(\S+)")
_TARGET: Final = re.compile(r"^SET_HEATER_TEMPERATURE HEATER=\w+ TARGET=(\S+)", re.MULTILINE)


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
    gains = {field.name: float(value) for field, value in zip(GAINS, tried.groups(), strict=True)}
    return TextSettings(gains, setpoint_degC=None if target is None else float(target[1]))


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the two files."""
    return {_CONFIG: _config(words, certificate), _TRIAL: _trial(words, certificate)}


def heater_of(stated: Mapping[str, str]) -> tuple[str, str]:
    """Return the heater's section of printer.cfg, and its name in G-code, for what is known of the open points."""
    heater = stated.get("heater", UNKNOWN)
    if heater == "heater_generic":
        return f"{heater} {PLACEHOLDER}", PLACEHOLDER
    return (PLACEHOLDER, PLACEHOLDER) if heater == UNKNOWN else (heater, heater)


def _config(words: Words, certificate: Certificate) -> str:
    section, name = heater_of(certificate.switches)
    missing = (f"; put your heater's name in the place of {PLACEHOLDER}, which Klipper refuses"
               if name == PLACEHOLDER else "")
    whose = ("your [extruder], [heater_bed] or [heater_generic ...]; design with --assume heater=extruder, heater_bed "
             "or heater_generic, and the files name it" if section == PLACEHOLDER else f"your [{section}]")
    pwm = PWM_S if certificate.actuator is None else certificate.actuator.pwm_period_s
    lines = [
        "heater of a printer: Klipper or Kalico, control: pid", *certificate.head,
        f"a report each {REPORT_S:g} s: a thermistor on a pin of the controller board", "remains to be done by hand:",
        f"  1. put these lines in place of the same ones in {whose}{missing}",
        "  2. if a block SAVE_CONFIG below in printer.cfg has gains of this heater, change them there: they count",
        "  3. RESTART, then try them with klipper_try.gcode, the printer in sight",
        "  4. leave verify_heater, min_temp and max_temp as they protect your heater: the proof knows nothing of them",
    ]
    pairs = {"control": "pid", **texts_of(words, FIELDS), "pwm_cycle_time": f"{pwm:.{PLACES}f}"}
    body = "".join(f"{name}: {value}\n" for name, value in pairs.items())
    return in_ascii(commented("#", *lines)) + f"[{section}]\n{body}"


def _trial(words: Words, certificate: Certificate) -> str:
    target = certificate.setpoint_degC
    section, name = heater_of(certificate.switches)
    sensor = f'"{section}"' if " " in section else section
    gains = texts_of(words, FIELDS)
    lines = ["; tries the gains: heats, waits, cools with the part's fan, waits, and switches off; nothing is extruded",
             *(f"; {in_ascii(line)}" for line in certificate.head),
             "; with Kalico this tries the gains before they are in printer.cfg:",
             f"; SET_HEATER_PID HEATER={name} KP={gains['pid_Kp']} KI={gains['pid_Ki']} KD={gains['pid_Kd']}"]
    if target is None:
        return "\n".join([*lines, "; no setpoint was proven: enter yours",
                          f"; SET_HEATER_TEMPERATURE HEATER={name} TARGET="]) + "\n"
    lines += [
        "M107 ; the part's fan off", f"SET_HEATER_TEMPERATURE HEATER={name} TARGET={target:.10g} ; the proven setpoint",
        f"TEMPERATURE_WAIT SENSOR={sensor} MINIMUM={target - 1.0:.10g}", "G4 P120000 ; overshoot and settling",
        "M106 S255 ; a load: the part's fan", "G4 P60000", "M107", "G4 P60000", "TURN_OFF_HEATERS",
    ]
    return "\n".join(lines) + "\n"


Klipper = controller_of(FirmwarePid(
    name="klipper", title="Klipper and Kalico, control: pid of a heater (klippy/extras/heaters.py)", main_file=_CONFIG,
    can=(
        "P, PI and PID in double precision, a smoothed derivative of the reading; gains with three decimals",
        "a report each 0.3 s; power changes below 5 % that are not sent; the switch a report later, PWM of 0.1 s",
        "exported as lines of the heater's section, and as G-code to try them",
    ),
    cannot=(
        "control: pid_v, mpc and dual_loop_pid of Kalico are not run", "no sensor that reports at another interval",
        "no setpoint ramp: the firmware has none",
        "a change below 5 % waits for the next refresh, up to 2.4 s; a heater that is off never gets less than 5 %",
    ),
    inputs={"target": "LREAL", "temperature": "LREAL"},
    # 0.1 °C of 0…300 °C: a thermistor of 100 kΩ behind 4.7 kΩ, eight samples of twelve bits summed, at 300 °C
    counts=3000, timer=Timer(shortest_s=REPORT_S, longest_s=REPORT_S, step_s=REPORT_S),
    gains=GAINS, settings=SETTINGS, full=GAIN_BASE, usual=USUAL, method="as Klipper realises it",
    lag=lambda values: max(0.0, 1.0 - REPORT_S / values["smooth_time"]), oddities=_oddities,
    law=StepFunctions(step=step, measure=_measure, flags=("max_power", "no power", "not sent")), cold=COLD,
    assumptions=KlipperAssumptions, parameters=loop_of,
    export=_export, text=from_text, settings_in={_CONFIG: _section_exported, _TRIAL: _trial_exported},
    further={
        # a duty takes effect a report after the last of eight samples of 1 ms each
        "delay_s": REPORT_S + 0.008, "tick_s": 1e-5, "pwm_period_s": PWM_S, "most_power": ("max_power", 1.0),
        "text_of_heater": staticmethod(from_text),
    },
))
