"""Brett Beauregard's PID_v1 for Arduino: its words, its law (`SUM` of `firmware.parallel`), and the sketch around it.

The words are what its constructor, SetOutputLimits and SetSampleTime are given; the law is that of PID_v1.cpp, 1.2.1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.pid.design_values import Timer
from heatertune.plc.exported import TextSettings
from heatertune.plc.firmware.firmware_pid import FirmwarePid, controller_of, gain_fields, texts_of
from heatertune.plc.firmware.firmware_text import (
    PwmWindow,
    blank_matches,
    calls_open_point,
    commented,
    decimal,
    number_of,
    sensor_line,
    setpoint_of,
    settings_of,
    window_of,
)
from heatertune.plc.firmware.parallel import (
    COLD,
    NOBODY,
    PARALLEL,
    SUM,
    ParallelParameters,
    ParallelState,
    again,
    clamp,
    compute_call,
    narrowed_to,
    scan_result,
    step,
)
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, demand_whole_lines, wrong
from heatertune.plc.words import Certificate, WordField, Words, check_limits

__all__ = ["ArduinoPid"]

#: output of full power, the library's own upper limit
FULL: Final = 255.0
#: POn, as PID_v1.h numbers them
ON_MEASUREMENT: Final = 0
ON_ERROR: Final = 1

GAINS: Final = gain_fields(("Kp", "Ki", "Kd"), "constructor", "LREAL", (
    "proportional gain, output per °C", "integral gain Kp/TN, per second", "derivative gain Kp·TV, seconds"))
SETTINGS: Final = (
    WordField(name="POn", address="constructor", format="BYTE", low=0, high=1, comment="1 P_ON_E, 0 P_ON_M"),
    WordField(name="OutMax", address="SetOutputLimits", format="LREAL", low=0.001, high=65535.0,
              comment="upper limit of the output; the lower one is 0"),
    WordField(name="Full", address="sketch", format="LREAL", low=0.001, high=65535.0, comment="output at full power"),
    WordField(name="SampleTime", address="SetSampleTime", format="UINT", low=1, high=32767, comment="ms"),
)
FIELDS: Final = (*GAINS, *SETTINGS)


def _check(v: Mapping[str, Number]) -> None:
    """Refuse an upper limit above full power."""
    check_limits(v, "OutMax", "Full")


def _oddities(v: Mapping[str, Number]) -> Iterator[str]:
    if v["POn"] == ON_MEASUREMENT:
        yield "P is on the measurement (P_ON_M): that is no standard form."
    if v["OutMax"] < v["Full"]:
        yield f"The output is limited to {v['OutMax']:g} of {v['Full']:g}."


#: SampleTime before SetSampleTime is called, and how long the last call is taken to be ago when the object is made [ms]
FIRST_MS: Final = 100.0


class ArduinoPidAssumptions(NamedTuple):
    """The points that depend on board and sketch, see DIFFERENCES.md."""

    narrow: Annotated[bool, OpenPoint(
        name="double", means={"64bit": False, "32bit": True},
        reason="precision of double on the board: double (ARM, ESP32) or single (AVR)",
    )] = False
    late: Annotated[bool, calls_open_point(
        "Compute() waits for at least SampleTime: it is called on time, or every tenth call comes after twice "
        "SampleTime")] = False


def _parameters(values: Mapping[str, float], assume: ArduinoPidAssumptions) -> ParallelParameters:
    """Return the gains as the library keeps them: for 100 ms by the constructor, then by SetSampleTime's ratio."""
    narrow = assume.narrow
    kp, ki, kd = (narrowed_to(narrow, float(values[name])) for name in ("Kp", "Ki", "Kd"))
    first = narrowed_to(narrow, FIRST_MS / 1000.0)
    ratio = narrowed_to(narrow, values["SampleTime"] / FIRST_MS)
    high = narrowed_to(narrow, float(values["OutMax"]))
    return ParallelParameters(
        law=SUM, narrow=narrow, kp=kp, ki=narrowed_to(narrow, narrowed_to(narrow, ki * first) * ratio),
        kd=narrowed_to(narrow, narrowed_to(narrow, kd / first) / ratio), low=0.0, high=high, least=0.0, most=high,
        full=float(values["Full"]), interval=float(values["SampleTime"]), late=assume.late,
        on_measurement=values["POn"] == ON_MEASUREMENT)


def _scan(
    p: ParallelParameters, s: ParallelState, inputs: Mapping[str, float]
) -> tuple[ParallelState, float, float, int]:
    """Compute one pass of loop(): where named, Mode 0 with Output by hand, and Elapsed, ms since the last."""
    if not inputs.get("Mode", 1):
        by_hand = narrowed_to(p.narrow, float(inputs.get("Output", s.output)))
        return scan_result(p, again(s, True, by_hand, s.waited + inputs.get("Elapsed", p.interval), NOBODY))
    if s.begins:  # SetMode(AUTOMATIC), at once
        total = clamp(s.output, p.low, p.high)
        before = narrowed_to(p.narrow, float(inputs["Input"]))
        s = ParallelState(False, s.calls, total, 0.0, 0.0, before, 0.0, 0.0, s.output, s.waited, mode=s.mode)
    setpoint, reading = (narrowed_to(p.narrow, float(inputs[name])) for name in ("Setpoint", "Input"))
    if "Elapsed" not in inputs:
        return step(p, s, setpoint, reading, True)
    waited = s.waited + inputs["Elapsed"]
    if waited < p.interval:
        return scan_result(p, again(s, False, s.output, waited, s.mode))
    return scan_result(p, compute_call(p, s, setpoint, reading, p.interval))


_COMMENT: Final = re.compile(r"/\*.*?(?:\*/|\Z)|//[^\n]*", re.DOTALL)
_ARGUMENTS: Final = r"\s*\(((?:[^()]|\([^()]*\))*)\)"
_PID: Final = re.compile(rf"\bPID\s+(?P<own>\w+){_ARGUMENTS}|(?P<made>\w+)\s*=\s*new\s+PID{_ARGUMENTS}")
_SETS: Final = re.compile(rf"Set(OutputLimits|SampleTime|Tunings|ControllerDirection)\b({_ARGUMENTS})?")
#: functions of the library that change no word
_OTHERS: Final = ("Compute", "SetMode", "GetMode", "GetDirection", "GetKp", "GetKi", "GetKd")
_ASSIGNED: Final = re.compile(r"\b(\w+)\s*(?:[-+*/]=|=(?!=))\s*([^;,\n]*)|#\s*define\s+(\w+)\s+([^\n]*)")
_FUNCTION: Final = re.compile(r"\bvoid\s+(\w+)\s*\(\s*\)\s*\{")
_MODES: Final = {"P_ON_E": ON_ERROR, "P_ON_M": ON_MEASUREMENT}
_DIRECT: Final = "DIRECT"
#: names by which sketches call the output at full power: that of heatertune's, and the library's example
_FULLS: Final = ("full", "windowsize", "window_size")
#: upper limits that are taken as full power where no such name is there, and what windows of time [ms] are multiples of
_SCALES: Final = (1.0, 100.0, FULL, 1023.0, 4095.0, 65535.0)
_SECOND_MS: Final = 1000.0
_ANALOG: Final = re.compile(r"\banalogWrite\b")
#: the converter's counts as they are, or in another scale; `_ASSIGNED` ends at a comma
_COUNTS: Final = re.compile(r"(?:\(\s*\w+\s*\)\s*)?(?:map\s*\(\s*)?analogRead\s*\([^()]*\)\s*")
_FAHRENHEIT: Final = re.compile(r"Fahrenheit|(?:To|Temp|get)F\b|\*\s*(?:9\.?0*\s*/\s*5|1\.8)\D")


class _LibraryCall(NamedTuple):
    """A call of the library in a sketch."""

    line: int
    arguments: str
    is_certain: bool


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a sketch, or in lines of one.

    Raises:
        InputError: no constructor of PID_v1 or several; a gain that is no number, has several values or is out of its
            range; REVERSE; a lower limit other than 0; gains that the sketch changes later; an output whose full
            power is not constants.
    """
    plain = blank_matches(_COMMENT, text.replace("\r\n", "\n").replace("\r", "\n"))
    demand_whole_lines(plain, source)
    constructors = list(_PID.finditer(plain))
    if len(constructors) != 1:
        what = "no constructor of PID_v1" if not constructors else f"{len(constructors)} constructors of PID_v1"
        raise InputError(f"{source}: {what}; expected the lines of one object, such as PID heater(&Input, &Output, "
                         "&Setpoint, 2.0, 5.0, 1.0, P_ON_E, DIRECT);")
    constants, line, calls = _sketch_constants(plain), _line(plain, constructors[0].start()), _calls(plain, source)
    _demand_known_functions(plain, constructors[0]["own"] or constructors[0]["made"], source)
    for call in calls["ControllerDirection"]:
        _demand_direct(call.arguments, call.line, source)
    arguments = constructors[0][2] or constructors[0][4] or ""
    gains, mode = _gains(arguments, line, calls["Tunings"], constants, source)
    collected = WordCollector(source, FIELDS)
    for field, (where, value) in zip(GAINS, gains, strict=True):
        collected.put(field.name, _number(value, constants), where, _shown(value, constants))
    collected.put("POn", _MODES[mode], line, mode)
    high = FULL
    for call in calls["OutputLimits"]:
        ends = [_number(part, constants) for part in call.arguments.split(",")]
        if len(ends) != 2 or ends[0] != 0.0 or ends[1] is None:
            raise wrong(source, call.line, "SetOutputLimits", call.arguments, "0 and a number: a heater has no power "
                        "below 0")
        collected.put("OutMax", ends[1], call.line, call.arguments)
        high = float(ends[1])
    for call in calls["SampleTime"]:
        time = _number(call.arguments, constants)
        whole = int(time) if isinstance(time, float) and time.is_integer() else time
        collected.put("SampleTime", whole, call.line, call.arguments)
    assumed = list(collected.assume({"OutMax": FULL, "SampleTime": round(FIRST_MS)}))
    if _FUNCTION.search(plain):  # a whole sketch: then the library's own defaults are in force
        assumed.clear()
    full, is_stated = _full(plain, constants, high, source)
    collected.put("Full", full, 0, f"{full}")
    assumed += [] if is_stated else [f"output {high:g} = full power"]
    assumed += _other_unit(arguments.partition(",")[0].strip(" &"), constants)
    return ReadBack(collected.values(), assumed=tuple(assumed))


def _demand_known_functions(plain: str, own: str, source: str) -> None:
    """Refuse a function of the object that is none of the library's: it may set what is read here."""
    for match in re.finditer(rf"\b{own}\s*(?:\.|->)\s*(\w*)", plain):
        if match[1] not in _OTHERS and not _SETS.match(match[1]):
            raise wrong(source, _line(plain, match.start()), f"{own}.{match[1]}", match[0], "a function of PID_v1")


def _other_unit(reading: str, constants: Mapping[str, str]) -> list[str]:
    """Return that the reading is taken to be in °C, where the sketch has counts of the converter, or °F."""
    names = constants.get(reading, "").split(" and ")
    for value in (part for name in names for part in constants.get(name, name).split(" and ")):
        if _COUNTS.fullmatch(value) or _FAHRENHEIT.search(value):
            unit, factor = ("counts", "the counts per °C") if _COUNTS.fullmatch(value) else ("°F", "1.8")
            return [f"{reading} in °C, not {unit} as {value[:40]} has (else multiply each gain by {factor})"]
    return []


def _calls(plain: str, source: str) -> dict[str, list[_LibraryCall]]:
    """Return name → its calls; certain is one in setup(), or outside of all functions."""
    calls: dict[str, list[_LibraryCall]] = {
        name: [] for name in ("OutputLimits", "SampleTime", "Tunings", "ControllerDirection")}
    begins = [(match.start(), match[1]) for match in _FUNCTION.finditer(plain)]
    for match in _SETS.finditer(plain):
        line = _line(plain, match.start())
        if match[2] is None:
            raise wrong(source, line, f"Set{match[1]}", plain[match.start():].partition("\n")[0][:40],
                        "a call with its brackets in the text")
        at, name = next(((at, name) for at, name in reversed(begins) if at < match.start()), (-1, "setup"))
        is_certain = name == "setup" and _is_unconditional(plain[max(at, 0):match.start()], depth=int(at >= 0))
        calls[match[1]].append(_LibraryCall(line, match[3].strip(), is_certain))
    return calls


def _is_unconditional(before: str, depth: int) -> bool:
    """Return whether a statement is reached whatever happens, by what stands before it in its function."""
    own = re.split(r"[;{}]", before)[-1]
    return before.count("{") - before.count("}") <= depth and not re.search(r"\b(?:if|else|for|while|case)\b|\?", own)


def _gains(
    arguments: str, line: int, tunings: Sequence[_LibraryCall], constants: Mapping[str, str], source: str,
) -> tuple[list[tuple[int, str]], str]:
    """Return the three gains with their lines, and the mode of P, of the constructor or of SetTunings after it."""
    gains, modes = _parts(arguments, line, source)
    placed = [(line, gain) for gain in gains]
    mode = modes[0] if len(modes) == 2 else "P_ON_E"
    changes = 0
    for call in tunings:
        parts = [part.strip() for part in call.arguments.split(",")]
        if len(parts) not in (3, 4) or (len(parts) == 4 and parts[3] not in _MODES):
            raise wrong(source, call.line, "SetTunings", call.arguments, "three gains, and P_ON_E or P_ON_M or neither")
        before = [_number(gain, constants) for _, gain in placed]
        if [_number(part, constants) for part in parts[:3]] == before and parts[3:] in ([], [mode]):
            continue
        if not call.is_certain or changes:
            raise wrong(source, call.line, "SetTunings", call.arguments, "the gains in force alone: leave the other "
                        "SetTunings out, or write the gains into the constructor")
        changes += 1
        placed, mode = [(call.line, part) for part in parts[:3]], parts[3] if parts[3:] else mode
    return placed, mode


def _parts(arguments: str, line: int, source: str) -> tuple[list[str], list[str]]:
    """Return the three gains and the modes of a constructor."""
    parts = [part.strip() for part in arguments.split(",")]
    modes = parts[6:]
    if len(parts) not in (7, 8) or (len(modes) == 2 and modes[0] not in _MODES):
        raise wrong(source, line, "PID", arguments, "three pointers, three gains, P_ON_E or P_ON_M (or none), DIRECT")
    _demand_direct(modes[-1], line, source)
    return parts[3:6], modes


def _demand_direct(direction: str, line: int, source: str) -> None:
    if direction != _DIRECT:
        raise wrong(source, line, "direction", direction, "DIRECT: REVERSE is of a cooler, whose output falls where it "
                    "is too cold")


def _full(plain: str, constants: Mapping[str, str], high: float, source: str) -> tuple[float, bool]:
    """Return the output at full power, and whether the text says so."""
    names = [name for name in constants if name.lower() in _FULLS]
    full_output = _number(names[0], constants) if names else None
    if full_output is not None:
        return float(full_output), True
    if names:
        raise InputError(f"{source}: {_shown(names[0], constants)}; expected one number, the output at full power")
    if _ANALOG.search(plain) and high <= FULL:
        return FULL, True
    if high in _SCALES or high % _SECOND_MS == 0.0:
        return high, False
    raise InputError(f"{source}: SetOutputLimits up to {high:g}; expected 1, 100, 255 or a window in ms, or a line "
                     f"such as const double Full = {high:g}; with the output at full power")


def _sketch_constants(plain: str) -> dict[str, str]:
    """Return name → what it is set to; all that it is set to, where that is several things."""
    values: dict[str, dict[str, None]] = {}
    for match in _ASSIGNED.finditer(plain):
        values.setdefault(match[1] or match[3], {})[(match[2] or match[4] or "").strip()] = None
    return {name: " and ".join(all_) for name, all_ in values.items()}


def _number(text: str, constants: Mapping[str, str]) -> Number | None:
    """Return a number, or the constant of that name."""
    return number_of(constants.get(text.strip(), text))


def _shown(text: str, constants: Mapping[str, str]) -> str:
    return f"{text} = {constants[text]}"[:60] if text in constants else text


def _line(text: str, at: int) -> int:
    return text.count("\n", 0, at) + 1


_FILE: Final = "arduino_pid.ino"
_NUMBER: Final = re.compile(r"^(?:const (?:unsigned long|double)|double) (\w+) = ([^;]+);", re.MULTILINE)


def _settings(text: str) -> TextSettings:
    values = from_text(text, None, _FILE).values
    numbers = {name: float(number) for name, number in _NUMBER.findall(text)}
    if numbers.get("SAMPLE_MS", values["SampleTime"]) != values["SampleTime"]:
        raise InputError(f"SAMPLE_MS is {numbers['SAMPLE_MS']:g}; SampleTime is {values['SampleTime']}")
    return settings_of(values, numbers, numbers["Setpoint"], ("BOOST_WITHIN", "BOOST_AGAIN"), text)


_LOOP = """
double Setpoint = {setpoint};  // degC
double Input = 0.0;            // degC
double Output = 0.0;
PID heaterPid(&Input, &Output, &Setpoint, {kp}, {ki}, {kd}, {pon}, DIRECT);

unsigned long windowBegan = 0;
unsigned long onMs = 0;
bool heating = false;          // whether there is a reading
{boost_state}
// TODO: return your sensor's temperature in degC, NAN where it is broken
double readTemperature() {{
  return NAN;
}}

unsigned long pulse(double output) {{
  if (!(output > 0.0)) return 0;  // what is no number is off, too
  const double wanted = output / Full * WINDOW_MS;
  unsigned long on = STEP_MS * (unsigned long)(wanted / STEP_MS + 0.5);
  if (wanted < LEAST_ON_MS || on < LEAST_ON_MS) return 0;
  if (wanted > WINDOW_MS - LEAST_OFF_MS || on > WINDOW_MS - LEAST_OFF_MS) return WINDOW_MS;
  return on;
}}

void setup() {{
  pinMode(HEATER_PIN, OUTPUT);
  digitalWrite(HEATER_PIN, LOW);
  heaterPid.SetOutputLimits(0.0, {outmax});
  heaterPid.SetSampleTime({sample});
}}

void loop() {{
  const unsigned long now = millis();
  const double reading = readTemperature();
  if (isnan(reading)) {{            // a broken sensor: off, and from cold when it is back
    heaterPid.SetMode(MANUAL);
    Output = 0.0;
    heating = false;
    digitalWrite(HEATER_PIN, LOW);
    return;
  }}
  Input = reading;
{who}  heaterPid.Compute();
  if (!heating || now - windowBegan >= WINDOW_MS) {{
    windowBegan = heating ? windowBegan + WINDOW_MS : now;
    onMs = pulse({asked});
  }}
  heating = true;
  digitalWrite(HEATER_PIN, now - windowBegan < onMs ? HIGH : LOW);
}}
"""

_AUTOMATIC = """\
  if (!heating) heaterPid.SetMode(AUTOMATIC);
"""

_STATE = """\
bool boosting = true;
unsigned long decided = 0;
"""

_BOOST = """\
  if (!heating) boosting = true;
  if (!heating || now - decided >= SAMPLE_MS) {  // far from the setpoint: full power, and the PID by hand at 0
    decided = heating ? decided + SAMPLE_MS : now;
    const double away = Setpoint - Input;
    boosting = away > (boosting ? BOOST_WITHIN : BOOST_AGAIN) && !isinf(away);
    heaterPid.SetMode(boosting ? MANUAL : AUTOMATIC);
    if (boosting) Output = 0.0;
  }
"""


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the sketch; the same words and certificate give the same bytes."""
    window, texts = window_of(words, certificate), texts_of(words, FIELDS)
    head = commented(
        "//", "heater controller for Arduino, library PID by Brett Beauregard, 1.2.1 (PID_v1.h)",
        sensor_line(words, f"; {len(FIELDS)} words"), *certificate.head, window.summary,
        "remains to be done by hand: HEATER_PIN and readTemperature(); loop() must come round well within STEP_MS,",
        "  for Compute() and pulses are late by up to one round; nothing that waits (delay) belongs in it")
    body = _LOOP.format(
        setpoint=setpoint_of(words, certificate), kp=texts["Kp"], ki=texts["Ki"], kd=texts["Kd"],
        outmax=texts["OutMax"], sample=texts["SampleTime"],
        pon="P_ON_E" if words.values["POn"] == ON_ERROR else "P_ON_M",
        boost_state=_STATE if words.boost else "", who=_BOOST if words.boost else _AUTOMATIC,
        asked=f"boosting ? {texts['OutMax']} : Output" if words.boost else "Output")
    return {_FILE: f"{head}\n#include <PID_v1.h>\n\n{_constants(words, texts, window)}{body}"}


def _constants(words: Words, texts: Mapping[str, str], window: PwmWindow) -> str:
    numbers = {"WINDOW_MS": window.period_ms, "STEP_MS": window.step_ms, "LEAST_ON_MS": window.least_on_ms,
               "LEAST_OFF_MS": window.least_off_ms}
    times = "".join(f"const unsigned long {name} = {number};\n" for name, number in numbers.items())
    if words.boost is not None:
        times += (f"const unsigned long SAMPLE_MS = {texts['SampleTime']};\n"
                  f"const double BOOST_WITHIN = {decimal(words.boost.within_degC, 'LREAL')};  // degC\n"
                  f"const double BOOST_AGAIN = {decimal(words.boost.again_degC, 'LREAL')};\n")
    return f"const int HEATER_PIN = 5;  // TODO: yours\nconst double Full = {texts['Full']};\n{times}"


ArduinoPid = controller_of(FirmwarePid(
    name="arduino-pid", title="Arduino, library PID by Brett Beauregard 1.2.1 (PID_v1.cpp)", main_file=_FILE,
    can=(
        "P, PI, PD and PID, D on the reading; P on the error, or on the measurement where words are read",
        "exported as a whole sketch: constructor, boost, window of time for a relay; a broken sensor is off",
    ),
    cannot=(
        "no derivative filter: noise and steps of the reading reach the output times Kd/SampleTime",
        "the integral part goes on while the output is at a limit; it ends at that limit itself",
        "no coolers (REVERSE), no lower limit but 0, no gains that the sketch changes later",
        "no setpoint ramp in the sketch; pulses that make up for others are left to a switch behind it",
    ),
    inputs={"Setpoint": "REAL", "Input": "REAL", "Mode": "BOOL", "Output": "REAL", "Elapsed": "UINT"},
    counts=4095,  # of the 12-bit converter behind the sensor that is assumed
    timer=Timer(shortest_s=0.001, longest_s=32.767, step_s=0.001),  # SampleTime is an int of ms, of 16 bits on an AVR
    gains=GAINS, settings=SETTINGS, full=FULL, usual={"POn": ON_ERROR, "OutMax": FULL, "Full": FULL},
    interval=("SampleTime", 0.001), method="as the words of PID_v1 realise it", oddities=_oddities, check=_check,
    full_word="Full", measurement=("POn", ON_MEASUREMENT), law=PARALLEL, cold=COLD._replace(waited=FIRST_MS),
    assumptions=ArduinoPidAssumptions, parameters=_parameters,
    export=_export, text=from_text, settings_in={_FILE: _settings},
    further={"tick_s": 0.01, "has_boost": True, "most_power": ("OutMax", FULL), "scan_all": staticmethod(_scan),
             "keyed_entries": None},
))
