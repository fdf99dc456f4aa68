"""Words → a whole sketch: PID_v1's constructor line, and a loop that switches the heater in windows of time.

The words in a sketch: PID_v1's constructor, SetOutputLimits and SetSampleTime, with numbers or its constants.

What the sketch sets: PID_v1's words, its own boost and window of time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.arduino_pid.step import ArduinoPidAssumptions
from heatertune.plc.arduino_pid.words import FIELDS, FULL, ON_ERROR, ON_MEASUREMENT
from heatertune.plc.exported import TextSettings
from heatertune.plc.parallel.window import PwmWindow, settings_of, window_of
from heatertune.plc.parallel.words import blank_matches, decimal, number_of
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, wrong
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "from_text", "loaders"]


_COMMENT: Final = re.compile(r"/\*.*?(?:\*/|\Z)|//[^\n]*", re.DOTALL)
_PID: Final = re.compile(r"\bPID\s+(\w+)\s*\(([^()]*)\)")
_LIMITS: Final = re.compile(r"\.\s*SetOutputLimits\s*\(([^()]*)\)")
_SAMPLE: Final = re.compile(r"\.\s*SetSampleTime\s*\(([^()]*)\)")
_TUNINGS: Final = re.compile(r"\.\s*SetTunings\s*\(([^()]*)\)")
_CONSTANT: Final = re.compile(r"\b(\w+)\s*=\s*([^;,(){}]+?)\s*(?=[;,])|#\s*define\s+(\w+)\s+(\S+)")
_MODES: Final = {"P_ON_E": ON_ERROR, "P_ON_M": ON_MEASUREMENT}
#: names by which sketches call the output at full power: that of heatertune's, and the library's example
_FULLS: Final = ("Full", "WindowSize")
_FIRST_MS: Final = 100


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a sketch.

    Raises:
        InputError: no constructor of PID_v1 or several; a gain that is no number or out of its range; REVERSE; a
            lower limit other than 0; gains that the sketch changes later.
    """
    plain = blank_matches(_COMMENT, text.replace("\r\n", "\n").replace("\r", "\n"))
    made = list(_PID.finditer(plain))
    if len(made) != 1:
        what = "no constructor of PID_v1" if not made else f"{len(made)} constructors of PID_v1"
        raise InputError(f"{source}: {what}; expected one line such as PID heater(&Input, &Output, &Setpoint, 2.0, "
                         "5.0, 1.0, P_ON_E, DIRECT);")
    known = {match[1] or match[3]: match[2] or match[4] for match in _CONSTANT.finditer(plain)}
    collected, over = WordCollector(source, FIELDS), list[str]()
    line = _line(plain, made[0])
    gains, modes = _parts(made[0][2], line, source)
    for name, value in zip(("Kp", "Ki", "Kd"), gains, strict=True):
        collected.put(name, _number(value, known), line, value)
    collected.put("POn", _MODES.get(modes[0], ON_ERROR), line, modes[0])
    high = _limits(plain, known, source, collected)
    full = next((_number(name, known) for name in _FULLS if name in known), None)
    if full is None:
        over.append(f"the output at full power is not stated: the upper limit {high:g} is used")
    collected.put("Full", high if full is None else full, line, f"{full}")
    times = list(_SAMPLE.finditer(plain))
    for match in times:
        given = _number(match[1], known)
        whole = int(given) if isinstance(given, float) and given.is_integer() else given
        collected.put("SampleTime", whole, _line(plain, match), match[1])
    if not times:
        collected.put("SampleTime", _FIRST_MS, line, str(_FIRST_MS))
    for match in _TUNINGS.finditer(plain):
        raise wrong(source, _line(plain, match), "SetTunings", match[1], "gains in the constructor alone")
    return ReadBack(collected.values(), tuple(over))


def _parts(arguments: str, line: int, source: str) -> tuple[list[str], list[str]]:
    """Return the three gains and the modes of a constructor."""
    parts = [part.strip() for part in arguments.split(",")]
    modes = parts[6:]
    if len(parts) not in (7, 8) or modes[-1] != "DIRECT" or (len(modes) == 2 and modes[0] not in _MODES):
        raise wrong(source, line, "PID", arguments, "three pointers, three gains, P_ON_E or P_ON_M (or none), DIRECT")
    return parts[3:6], modes


def _limits(plain: str, known: dict[str, str], source: str, collected: WordCollector) -> float:
    """Take the upper limit and return it."""
    high, found = FULL, list(_LIMITS.finditer(plain))
    for match in found:
        ends = [_number(part.strip(), known) for part in match[1].split(",")]
        line = _line(plain, match)
        if len(ends) != 2 or ends[0] != 0.0 or ends[1] is None:
            raise wrong(source, line, "SetOutputLimits", match[1], "0 and a number: a heater has no power below 0")
        collected.put("OutMax", ends[1], line, match[1])
        high = float(ends[1])
    if not found:
        collected.put("OutMax", high, 0, str(high))
    return high


def _number(text: str, known: dict[str, str]) -> Number | None:
    """Return a number, or the constant of that name."""
    return number_of(known.get(text.strip(), text))


def _line(text: str, match: re.Match[str]) -> int:
    return text.count("\n", 0, match.start()) + 1


_FILE: Final = "arduino_pid.ino"
_NUMBER: Final = re.compile(r"^(?:const (?:unsigned long|double)|double) (\w+) = ([^;]+);", re.MULTILINE)


def loaders(files: Mapping[str, str | bytes], assume: ArduinoPidAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads the sketch."""
    return {_FILE: lambda: _settings(str(files[_FILE]))}


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


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the sketch; the same words and certificate give the same bytes."""
    window = window_of(words, certificate)
    text = {name: decimal(words.values[name], "LREAL") for name in ("Kp", "Ki", "Kd", "OutMax", "Full")}
    setpoint = words.scaling.low_degC if certificate.setpoint_degC is None else certificate.setpoint_degC
    head = "\n".join(f"// {line}" for line in _head(words, certificate, window))
    body = _LOOP.format(
        setpoint=decimal(setpoint, "LREAL"), kp=text["Kp"], ki=text["Ki"], kd=text["Kd"], outmax=text["OutMax"],
        pon="P_ON_E" if words.values["POn"] == ON_ERROR else "P_ON_M", sample=words.whole["SampleTime"],
        boost_state=_STATE if words.boost else "", who=_BOOST if words.boost else _AUTOMATIC,
        asked=f"boosting ? {text['OutMax']} : Output" if words.boost else "Output")
    return {"arduino_pid.ino": f"{head}\n\n#include <PID_v1.h>\n\n{_constants(words, text['Full'], window)}{body}"}


def _constants(words: Words, full: str, window: PwmWindow) -> str:
    numbers = {"WINDOW_MS": window.period_ms, "STEP_MS": window.step_ms, "LEAST_ON_MS": window.least_on_ms,
               "LEAST_OFF_MS": window.least_off_ms}
    times = "".join(f"const unsigned long {name} = {number};\n" for name, number in numbers.items())
    if words.boost is not None:
        times += (f"const unsigned long SAMPLE_MS = {words.whole['SampleTime']};\n"
                  f"const double BOOST_WITHIN = {decimal(words.boost.within_degC, 'LREAL')};  // degC\n"
                  f"const double BOOST_AGAIN = {decimal(words.boost.again_degC, 'LREAL')};\n")
    return f"const int HEATER_PIN = 5;  // TODO: yours\nconst double Full = {full};\n{times}"


def _head(words: Words, certificate: Certificate, window: PwmWindow) -> tuple[str, ...]:
    scale = words.scaling
    return (
        "heater controller for Arduino, library PID by Brett Beauregard, 1.2.1 (PID_v1.h)",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s; {len(FIELDS)} words",
        *certificate.head,
        window.summary,
        "remains to be done by hand: HEATER_PIN and readTemperature(); loop() must come round well within STEP_MS,",
        "  for Compute() and pulses are late by up to one round; nothing that waits (delay) belongs in it",
    )
