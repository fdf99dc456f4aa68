"""ESPHome's PID climate: its words, its law (`SUM_BY_TIME` of `firmware.parallel`), and the YAML around it.

The words are control_parameters and the interval of the sensor that calls it; the law is that of 2026.6.5.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.pid.design_values import Timer
from heatertune.plc.exported import TextSettings
from heatertune.plc.firmware.firmware_pid import FirmwarePid, controller_of, gain_fields, texts_of
from heatertune.plc.firmware.firmware_text import (
    calls_open_point,
    commented,
    decimal,
    number_of,
    sensor_line,
    setpoint_of,
    window_of,
)
from heatertune.plc.firmware.parallel import (
    COLD,
    NOBODY,
    PARALLEL,
    SUM_BY_TIME,
    ParallelParameters,
    ParallelState,
    again,
    compute_call,
    narrowed_to,
    scan_result,
    step,
)
from heatertune.plc.ramp import Boost, Number
from heatertune.plc.readback import ReadBack, WordCollector, demand_whole_lines, lines_of, wrong
from heatertune.plc.single_precision import single
from heatertune.plc.words import Certificate, WordField, Words, check_limits

__all__ = ["EspHome"]

GAINS: Final = gain_fields(("kp", "ki", "kd"), "control_parameters", "REAL", (
    "proportional gain, level 0…1 per °C", "integral gain kp/TN, per second", "derivative gain kp·TV, seconds"))
SETTINGS: Final = (
    WordField(name="min_integral", address="control_parameters", format="REAL", low=-1.0, high=1.0,
              comment="lower limit of the integral part"),
    WordField(name="max_integral", address="control_parameters", format="REAL", low=-1.0, high=1.0,
              comment="upper limit of the integral part"),
    WordField(name="derivative_averaging_samples", address="control_parameters", format="BYTE", low=1,
              high=8, comment="changes of the reading whose mean the derivative part takes"),
    WordField(name="update_interval", address="sensor", format="UINT", low=1, high=65535,
              comment="ms; each reading calls the PID"),
)
FIELDS: Final = (*GAINS, *SETTINGS)


def _check(v: Mapping[str, Number]) -> None:
    """Refuse limits that are upside down."""
    check_limits(v, "min_integral", "max_integral")


def _oddities(v: Mapping[str, Number]) -> Iterator[str]:
    if v["min_integral"] < 0.0:
        yield f"min_integral is {v['min_integral']:g}: below 0 I only delays the heater."
    if v["max_integral"] < 1.0:
        yield f"max_integral is {v['max_integral']:g}: the integral part cannot give full power."
    if v["derivative_averaging_samples"] > 1:
        yield f"The derivative part is the mean of {v['derivative_averaging_samples']} changes."


def _lag(v: Mapping[str, Number]) -> float:
    """Return the weight of a filter with the mean delay that a mean over n changes has."""
    samples = v["derivative_averaging_samples"]
    return (samples - 1) / (samples + 1)


class EspHomeAssumptions(NamedTuple):
    """The points that depend on the sensor, see DIFFERENCES.md."""

    late: Annotated[bool, calls_open_point(
        "each sensor reading calls the PID: one per update_interval, or every tenth reading is lost")] = False


def _parameters(values: Mapping[str, float], assume: EspHomeAssumptions) -> ParallelParameters:
    """Return the words as the component keeps them."""
    return ParallelParameters(
        law=SUM_BY_TIME, narrow=True, kp=float(values["kp"]), ki=float(values["ki"]), kd=float(values["kd"]), low=0.0,
        high=1.0, least=float(values["min_integral"]), most=float(values["max_integral"]), full=1.0,
        interval=single(values["update_interval"] / 1000.0), late=assume.late,
        samples=int(values["derivative_averaging_samples"]))


def _scan(
    p: ParallelParameters, s: ParallelState, inputs: Mapping[str, float]
) -> tuple[ParallelState, float, float, int]:
    """Compute one reading; where named, mode 0 puts the heater off and ms since the reading before are as told."""
    setpoint, reading = (float(inputs[name]) for name in ("target_temperature", "current_temperature"))
    if "elapsed_ms" in inputs:
        waited = s.waited + inputs["elapsed_ms"]
        broken = setpoint != setpoint or reading != reading  # noqa: PLR0124 - only what is no number is not itself
        interval = narrowed_to(True, single(waited) / 1000.0)
        off = again(s, s.begins, 0.0, waited, min(s.mode, NOBODY))
        after = off if broken else compute_call(p, s, setpoint, reading, interval)
    else:
        after = step(p, s, setpoint, reading, True)[0]
    if inputs.get("mode", 1):
        return scan_result(p, after)
    anew = after if math.isinf(p.within) else after._replace(integral=0.0, mode=NOBODY)  # as the lambda of a boost does
    return scan_result(p, anew._replace(output=0.0))


#: what the logger writes before a line, colours included
_LOGGED: Final = re.compile(r"^(?:\x1b\[[\d;]*m)?(?:\[[^\]]*\])*(?:\x1b\[[\d;]*m)?:?\s*")
_ENTRY: Final = re.compile(r"([A-Za-z_]+):\s*([\"']?)([^\s,#\"']+)\2\s*(?:#.*)?")
#: entries between braces in one line
_FLOW: Final = re.compile(r"\{\s*\w+:")
_DUMPED: Final = re.compile(r"kp: ([^\s,]+), ki: ([^\s,]+), kd: ([^\s,]+)(?:, output samples: (\S+))?")
_RULE: Final = re.compile(r"Rule '")
_TIMES: Final = {"ms": 1.0, "s": 1000.0, "sec": 1000.0, "min": 60000.0}
_TIME: Final = re.compile(r"([\d.]+)\s*([a-z]+)")
_BY_NAME: Final = {field.name: field for field in FIELDS}
#: what the schema takes where nothing is written
_USUAL: Final[dict[str, Number]] = {
    "ki": 0.0, "kd": 0.0, "min_integral": -1.0, "max_integral": 1.0, "derivative_averaging_samples": 1}
#: what is not held here → the only value that changes nothing
_OTHERS: Final = {"output_averaging_samples": 1.0, "starting_integral_term": 0.0}
_REFUSED: Final = ("deadband_parameters", "cool_output", "threshold_high", "threshold_low", "max_power", "min_power")


def from_text(text: str, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text; what the schema has a default for need not be there.

    Raises:
        InputError: no kp, a word there with two values or no number, no interval; a dead band, a cooler, or another
            part that is not proven here.
    """
    demand_whole_lines(text, source)
    reader = _YamlReader(source, None if sample_time_s is None else round(1000.0 * sample_time_s))
    for line, content in lines_of(text):
        plain = _LOGGED.sub("", content)
        for part in re.split("[{},]", plain) if _FLOW.search(plain) else (plain,):
            reader.take(line, part.strip())
    return reader.read()


class _YamlReader:
    """The words of a text so far."""

    def __init__(self, source: str, interval_ms: int | None) -> None:
        self._source, self._interval = source, interval_ms
        self._collected, self._after_rule = WordCollector(source, FIELDS), False

    def take(self, line: int, content: str) -> None:
        """Take a line without what the logger writes before it."""
        if _RULE.match(content):  # one of the autotuner's other rules: not in force
            self._after_rule = True
        elif match := _DUMPED.fullmatch(content):
            if not self._after_rule:
                for field, text in zip(GAINS, match.groups(), strict=False):
                    self._put(line, field.name, text)
                self._refuse_other(line, "output_averaging_samples", match[4] or "1")
            self._after_rule = False
        elif match := _ENTRY.fullmatch(content.removeprefix("- ")):
            self._entry(line, match[1], match[3])
        elif content.removesuffix(":") in _REFUSED:
            self._refuse_other(line, content.removesuffix(":"), "")

    def _entry(self, line: int, name: str, text: str) -> None:
        if name in _OTHERS or name in _REFUSED:
            self._refuse_other(line, name, text)
        elif name == "update_interval":
            if self._interval is None:
                self._collected.put(name, _ms(text), line, text)
        elif name in _BY_NAME:
            self._put(line, name, text)

    def _put(self, line: int, name: str, text: str) -> None:
        number = number_of(text)
        value: Number | None = number
        if number is not None:
            whole = _BY_NAME[name].format != "REAL"
            value = (int(number) if number.is_integer() else None) if whole else single(number)
        self._collected.put(name, value, line, text)

    def _refuse_other(self, line: int, name: str, value: str) -> None:
        """Refuse what is not held here, but for the value that changes nothing."""
        if name in _REFUSED or number_of(value) != _OTHERS[name]:
            only = f"{_OTHERS[name]:g}" if name in _OTHERS else "nothing of it"
            raise wrong(self._source, line, name, value, f"{only}: no other is proven here")

    def read(self) -> ReadBack:
        """Return the words, with the schema's defaults where nothing is written."""
        if "kp" not in self._collected:
            raise InputError(f"{self._source}: kp is missing; expected control_parameters of ESPHome's PID climate")
        if self._interval is not None:
            self._collected.put("update_interval", self._interval, 0, str(self._interval))
        if "update_interval" not in self._collected:
            raise InputError(f"--called-every is needed: {self._source} has no update_interval of the sensor")
        assumed = self._collected.assume(_USUAL)
        return ReadBack(self._collected.values(), assumed=assumed)


def _ms(text: str) -> int | None:
    """Return a time in whole ms, None where it is none."""
    match = _TIME.fullmatch(text)
    number = number_of(match[1]) if match else None
    if match is None or number is None or match[2] not in _TIMES:
        return None
    exact = number * _TIMES[match[2]]
    return round(exact) if abs(exact - round(exact)) < 1e-6 else None


_FILE: Final = "esphome_pid.yaml"
_SETPOINT: Final = re.compile(r"^ +default_target_temperature: ([\d.+-]+)°C$", re.MULTILINE)
_PERIOD: Final = re.compile(r"^ +period: (\d+)ms$", re.MULTILINE)
_EXPORTED_BOOST: Final = re.compile(r"away > \(boosting \? ([\d.]+)f : ([\d.]+)f\)")
_THROUGH: Final = re.compile(r"^ +heat_output: heater_level$", re.MULTILINE)


def _settings(text: str) -> TextSettings:
    setpoint, period, boost = _SETPOINT.search(text), _PERIOD.search(text), _EXPORTED_BOOST.search(text)
    if setpoint is None or period is None:
        raise InputError("default_target_temperature or period is missing")
    if (boost is None) == (_THROUGH.search(text) is not None):
        raise InputError("the boost is not between climate and slow_pwm")
    distances = None if boost is None else Boost(
        within_degC=single(float(boost[1])), again_degC=single(float(boost[2])))
    return TextSettings(from_text(text, None, _FILE).values, distances, float(setpoint[1]), int(period[1]) / 1000.0)


_LEAST_PERIOD_MS = 100

_YAML = """
sensor:
  - platform: template  # TODO: your sensor, in degC; each of its values calls the PID, so no filter may lose one
    id: heater_temperature
    update_interval: {update_interval}ms
    lambda: "return NAN;"

climate:
  - platform: pid
    name: "Heater"
    id: heater_climate
    sensor: heater_temperature
    default_target_temperature: {setpoint}°C
    heat_output: {output}
    control_parameters:
{parameters}
output:
  - platform: slow_pwm
    id: heater_output
    pin: GPIO5  # TODO: yours
    period: {period}ms
{boost}"""

_BOOST = """\
  - platform: template
    id: heater_level
    type: float
    write_action:
      - lambda: |-
          // far from the setpoint: full power, and no integral part; while it is off nothing is summed up, either
          static bool boosting = true;
          const bool off = id(heater_climate).mode == climate::CLIMATE_MODE_OFF;
          const float away = id(heater_climate).target_temperature - id(heater_climate).current_temperature;
          if (!std::isnan(away)) boosting = off || (away > (boosting ? {within}f : {again}f) && !std::isinf(away));
          if (off || boosting) id(heater_climate).reset_integral_term();
          id(heater_output).set_level(boosting && !off && !std::isnan(away) ? 1.0f : state);
"""


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the file; the same words and certificate give the same bytes."""
    window, texts = window_of(words, certificate), texts_of(words, FIELDS)
    short = f"; slow_pwm has no period below {_LEAST_PERIOD_MS} ms" if window.period_ms < _LEAST_PERIOD_MS else ""
    least = ("; slow_pwm knows no shortest pulse or pause: the switch behind it has to"
             if window.least_on_ms or window.least_off_ms else "")
    head = commented(
        "#", "heater controller for ESPHome's PID climate", sensor_line(words, "; level 1 is full power"),
        *certificate.head,
        f"slow_pwm: {window.summary}{short}{least}; pulses end with a round of the loop, about 16 ms",
        "remains to be done by hand: sensor and pin; a part of your own file, not a whole one")
    parameters = "".join(f"      {name}: {text}\n" for name, text in texts.items() if name != "update_interval")
    return {_FILE: head + _YAML.format(
        update_interval=texts["update_interval"], setpoint=setpoint_of(words, certificate), parameters=parameters,
        period=max(window.period_ms, _LEAST_PERIOD_MS),
        output="heater_output" if words.boost is None else "heater_level", boost=_boost(words))}


def _boost(words: Words) -> str:
    if words.boost is None:
        return ""
    within, again = (decimal(each, "REAL") for each in (words.boost.within_degC, words.boost.again_degC))
    return _BOOST.format(within=within, again=again)


EspHome = controller_of(FirmwarePid(
    name="esphome", title="ESPHome 2026.6.5, PID climate (components/pid/pid_controller.cpp)", main_file=_FILE,
    can=(
        "P, PI, PD and PID in single precision by the measured interval, D on the reading",
        "limits of the integral part, mean of up to 8 changes in the derivative part",
        "exported as YAML: climate with control_parameters, slow_pwm output, and a boost between",
    ),
    cannot=(
        "the integral part goes on while the output is at a limit; its own limits end it",
        "no dead band, no averaged output, no starting integral term, no cool_output",
        "no setpoint ramp in the file; slow_pwm knows no shortest pulse",
        "a change of the mode keeps the integral part: it goes on summing while the climate is off",
    ),
    inputs={"target_temperature": "REAL", "current_temperature": "REAL", "mode": "BOOL", "elapsed_ms": "UINT"},
    counts=4095,  # of the 12-bit converter behind the sensor that is assumed
    timer=Timer(shortest_s=0.1, longest_s=65.5, step_s=0.1),
    gains=GAINS, settings=SETTINGS, full=1.0, interval=("update_interval", 0.001),
    # the integral part is limited to what the heater can give
    usual={"min_integral": 0.0, "max_integral": 1.0, "derivative_averaging_samples": 1},
    method="as ESPHome's words realise it", lag=_lag, oddities=_oddities, check=_check,
    law=PARALLEL, cold=COLD, assumptions=EspHomeAssumptions, parameters=_parameters,
    export=_export, text=from_text, settings_in={_FILE: _settings},
    further={"tick_s": 0.1, "has_boost": True, "scan_all": staticmethod(_scan)},
))
