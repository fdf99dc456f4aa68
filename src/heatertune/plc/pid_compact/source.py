"""The export as SCL: a function that gives an instance DB its words, and one that calls the instruction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from heatertune.plc.pid_compact.words import COUNTS, BlockTags
from heatertune.plc.pwm import Actuator
from heatertune.plc.single_precision import single
from heatertune.plc.words import Scaling, Words

__all__ = ["BROKEN_HIGH", "BROKEN_LOW", "CALL", "LOAD", "LOOKED_AT", "ROLLBACK", "assignments", "call", "literal",
           "load", "made_by", "rollback", "tick_s"]

LOAD: Final = "HeaterWords"
CALL: Final = "HeaterCall"
ROLLBACK: Final = "HeaterRollback"

#: analog values of the S7-1200/1500 from which on a reading is none: overflow, and underflow of 4 to 20 mA
BROKEN_HIGH: Final = 32512
BROKEN_LOW: Final = -4865
#: numbers in this range are written without an exponent
_LOWEST_PLAIN: Final = 1e-4
_PLAIN: Final = 1e6
#: how far beyond the sensor's range a reading is no error, as a part of it: more than an input's over-range of 18 %
_BEYOND: Final = 0.2
#: control zone that is switched off
_OFF: Final = "3.402822E38"
#: structure of the cooler's output
_COOLER: Final = "Config.Output.Cool."
#: a finer clock than an organization block has
_LEAST_MS: Final = 1.0

Assignment = tuple[str, str, str]

#: tags beside the words that a text read back is held against, in capitals
LOOKED_AT: Final = frozenset(tag.upper() for tag in (
    "OverwriteInitialOutputValue", "ActivateRecoverMode", "SetSubstituteOutput", "SubstituteOutput",
    *(f"Config.InputScaling.{end}Point{side}" for end in ("Lower", "Upper") for side in ("In", "Out")),
    *(f"Config.{what}{end}Limit" for what in ("Input", "Setpoint") for end in ("Lower", "Upper")),
    "Config.Output.Heat.PidLowerLimit", "Config.Output.Cool.PidUpperLimit",
    *(f"Config.Output.{side}.{kind}{end}Scaling" for side in ("Heat", "Cool") for kind in ("", "Pwm")
      for end in ("Lower", "Upper"))))


def literal(value: float) -> str:
    """Return a REAL with nine digits, so that none is another's."""
    text = f"{value:.9g}"
    if value == 0.0 or _LOWEST_PLAIN <= abs(value) < _PLAIN:
        return text if "." in text else f"{text}.0"
    digits, _, exponent = f"{value:.8e}".partition("e")
    digits = digits.rstrip("0")
    return f"{digits}0E{int(exponent)}" if digits.endswith(".") else f"{digits}E{int(exponent)}"


def made_by(tags: BlockTags, words: Words, actuator: Actuator | None) -> str | None:
    """Return why the block's own output of pulses is not the switch of the proof; None: it is."""
    if actuator is None:
        return "no switch is known of the proof"
    period, cycle, tick = actuator.pwm_period_s, words.sample_time_s, 1000.0 * actuator.resolution_s
    clock = actuator.ticks(cycle) is not None and tick >= _LEAST_MS and abs(tick - round(tick)) <= 1e-6
    other = abs(period - cycle) > 1e-9
    problems = (
        (actuator.block != "pid-compact", "another rule was proven"),
        (not clock, "no organization block has its clock"),
        (other and tags.inverts, f"its period is not Cycle, {cycle:g} s"),
        (other and period > cycle, f"its period is above Cycle, {cycle:g} s"),
        (words.values["OutputLowerLimit"] < 0.0 and not tags.cools, "it knows no output below 0 %"),
        (max(actuator.minimum_on_s, actuator.minimum_off_s, *actuator.cooling_minimum_s) >= period,
         "its shortest times fill the period"),
    )
    return next((why for holds, why in problems if holds), None)


def assignments(tags: BlockTags, words: Words, actuator: Actuator | None) -> Iterator[Assignment]:
    """Yield tag, value and meaning of all that is configured beside the parameters."""
    v = words.values
    lower, upper = literal(0.0 if tags.cools else v["OutputLowerLimit"]), literal(v["OutputUpperLimit"])
    yield tags.config(tags.upper), upper, "%"
    yield tags.config(tags.lower), lower, "%"
    if tags.inverts:
        yield "Config.InvertControl", "TRUE" if v["InvertControl"] else "FALSE", "TRUE: a cooler"
    else:
        if not tags.cools:
            yield "Config.ActivateCooling", "FALSE", "OutputCool stays 0"
        yield tags.active("DeadZone"), "0.0", "off"
        yield tags.active("ControlZone"), _OFF, "off"
        yield from ((tags.config(f"{kind}{end}Scaling"), at, "%") for kind in ("", "Pwm")
                    for end, at in (("Upper", upper), ("Lower", lower)))
    if tags.cools:
        yield from _cooling(tags, words)
    yield "IntegralResetMode", str(v["IntegralResetMode"]), "I part when automatic begins"
    yield "OverwriteInitialOutputValue", "0.0", "%, of IntegralResetMode 3"
    yield from _safe(v["OutputLowerLimit"], v["OutputUpperLimit"])
    yield from _input(words.scaling)
    yield from _clock(tags, words, actuator)


def _cooling(tags: BlockTags, words: Words) -> Iterator[Assignment]:
    v = words.values
    yield "Config.ActivateCooling", "TRUE", "what is below 0 goes to OutputCool"
    yield "Config.AdvancedCooling", "TRUE" if v["AdvancedCooling"] else "FALSE", "FALSE: heating's set and CoolFactor"
    yield "Config.CoolFactor", literal(v["CoolFactor"]), "gain of the heater over the gain of the cooler"
    yield f"{_COOLER}PidUpperLimit", "0.0", "%"
    yield f"{_COOLER}PidLowerLimit", literal(v["OutputLowerLimit"]), "%"
    yield tags.active("CoolDeadZone"), "0.0", "off"
    yield tags.active("CoolControlZone"), _OFF, "off"
    yield from ((f"{_COOLER}{kind}{end}Scaling", at, "%") for kind in ("", "Pwm")
                for end, at in (("Upper", literal(-v["OutputLowerLimit"])), ("Lower", "0.0")))


def _safe(lower: float, upper: float) -> Iterator[Assignment]:
    yield "ActivateRecoverMode", "TRUE", "an error that passes does not end automatic"
    yield "SetSubstituteOutput", "TRUE", "while there is an error the output is SubstituteOutput"
    yield "SubstituteOutput", literal(min(max(0.0, lower), upper)), "%"


def _input(scaling: Scaling) -> Iterator[Assignment]:
    low, high = single(scaling.low_degC), single(scaling.high_degC)
    beyond = _BEYOND * scaling.span_degC
    yield "Config.InputPerOn", "TRUE", "the reading is Input_PER"
    yield "Config.InputScaling.LowerPointIn", "0.0", "analog value"
    yield "Config.InputScaling.UpperPointIn", literal(COUNTS), "analog value"
    yield "Config.InputScaling.LowerPointOut", literal(low), "degC"
    yield "Config.InputScaling.UpperPointOut", literal(high), "degC"
    yield "Config.InputLowerLimit", literal(single(low - beyond)), "degC"
    yield "Config.InputUpperLimit", literal(single(high + beyond)), "degC"
    yield "Config.SetpointLowerLimit", literal(low), "degC"
    yield "Config.SetpointUpperLimit", literal(high), "degC"


def _clock(tags: BlockTags, words: Words, actuator: Actuator | None) -> Iterator[Assignment]:
    """Yield the interval of the calls, and the PWM that was proven where the block makes it."""
    if actuator is not None:
        yield "CycleTime.StartEstimation", "FALSE", "the interval of the calls is told, not measured"
        yield "CycleTime.EnEstimation", "FALSE", "the interval of the calls is told, not measured"
        yield "CycleTime.EnMonitoring", "TRUE", "error 0800h where it is another"
        yield "CycleTime.Value", literal(single(tick_s(tags, words, actuator))), "s, of the cyclic interrupt OB"
    if actuator is None or made_by(tags, words, actuator) is not None:
        return
    if not tags.inverts:
        own = abs(actuator.pwm_period_s - words.sample_time_s) > 1e-9
        period = literal(single(actuator.pwm_period_s)) if own else "0.0"
        yield tags.config("Select"), "1", "OutputHeat and OutputHeat_PWM"
        yield tags.config("PwmPeriode"), period, "s; 0: Cycle"
    yield tags.config("MinimumOnTime"), literal(single(actuator.minimum_on_s)), "s"
    yield tags.config("MinimumOffTime"), literal(single(actuator.minimum_off_s)), "s"
    if tags.cools:
        yield f"{_COOLER}Select", "1", "OutputCool and OutputCool_PWM"
        yield f"{_COOLER}PwmPeriode", period, "s; 0: Cycle"
        for name, time in zip(("MinimumOnTime", "MinimumOffTime"), actuator.cooling_minimum_s, strict=True):
            yield f"{_COOLER}{name}", literal(single(time)), "s"


def tick_s(tags: BlockTags, words: Words, actuator: Actuator) -> float:
    """Return the interval of the cyclic interrupt OB [s]: a step of the PWM, or Cycle where the block makes none."""
    return actuator.resolution_s if made_by(tags, words, actuator) is None else words.sample_time_s


def load(tags: BlockTags, words: Words, actuator: Actuator | None) -> str:
    """Return the function that gives the instance DB its words; it saves those of before, where they are others."""
    at = f'"{tags.instance}".'
    values = {name: literal(words.values[name]) for name in tags.parameters}
    same = " AND\n    ".join(f"{at}{tags.active(name)} = {value}" for name, value in values.items())
    saved = "".join(f"  {at}{tags.saved(name)} := {at}{tags.active(name)};\n" for name in tags.parameters)
    new = "".join(f"{at}{tags.active(name)} := {value};\n" for name, value in values.items())
    rest = "".join(f"{at}{tag} := {value}; (* {meaning} *)\n" for tag, value, meaning in assignments(
        tags, words, actuator))
    return _function(LOAD, "", f"IF NOT ({same}) THEN\n{saved}END_IF;\n{new}{rest}")


def call(tags: BlockTags) -> str:
    """Return the function that the cyclic interrupt OB calls; a broken sensor resets the instruction."""
    inputs = "VAR_INPUT\n  Setpoint : REAL; (* degC *)\n  Reading : INT; (* analog input *)\nEND_VAR\n"
    return _function(CALL, inputs, (
        f'"{tags.instance}"(Setpoint := #Setpoint, Input_PER := #Reading,\n'
        f"  Reset := (#Reading >= {BROKEN_HIGH}) OR (#Reading <= {BROKEN_LOW}));\n"))


def rollback(tags: BlockTags) -> str:
    """Return the function that loads the parameters of before."""
    return _function(ROLLBACK, "", f'"{tags.instance}".LoadBackUp := TRUE;\n')


def _function(name: str, declared: str, body: str) -> str:
    optimized = "{ S7_Optimized_Access := 'TRUE' }"
    return f'FUNCTION "{name}" : Void\n{optimized}\nVERSION : 0.1\n{declared}BEGIN\n{body}END_FUNCTION\n'
