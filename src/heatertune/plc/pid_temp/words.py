"""The parameters of PID_Temp: those of PID_Compact under other tags; and, where it cools, a set of its own for that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.pid.design_values import PidDesign
from heatertune.plc.pid_compact.words import (
    COOL,
    PARAMETERS,
    TEMP,
    consistent,
    design_of,
    fields_of,
    interval_s,
    oddities,
    real_field,
    set_of,
)
from heatertune.plc.pid_compact.words import values_of as values_in
from heatertune.plc.pid_temp.step import cooling_words
from heatertune.plc.ramp import Number
from heatertune.plc.words import FORMATS, Scaling, WordField, Words, round_to_word

__all__ = [
    "COOLING_FIELDS", "FIELDS", "TEMP", "TEMP_COOLING", "consistent", "cooling_consistent", "cooling_design_of",
    "cooling_gain_of", "cooling_oddities", "cooling_values_of", "design_of", "interval_s", "oddities", "values_of",
    "with_cooling_gain",
]

FIELDS: Final[tuple[WordField, ...]] = fields_of(TEMP)

TEMP_COOLING: Final = replace(TEMP, cools=True)
_METHOD: Final = WordField(
    name="AdvancedCooling", address="Config.AdvancedCooling", format="BOOL", low=0, high=1,
    comment="cooling's parameters: 0 heating's and CoolFactor, 1 those of its own set")
_LARGEST: Final = FORMATS["REAL"][1]
_FACTOR: Final = real_field("CoolFactor", "Config.CoolFactor", 0.0, _LARGEST,
                            "gain of the heater over the gain of the cooler")
#: as heating alone, but for the limits, and cooling's besides
COOLING_FIELDS: Final[tuple[WordField, ...]] = (
    *set_of(TEMP), _METHOD, _FACTOR, *set_of(TEMP_COOLING, COOL, ", cooling"),
    real_field("OutputUpperLimit", "Config.Output.Heat.PidUpperLimit", 0.0, 100.0, "upper limit of the output, %"),
    real_field("OutputLowerLimit", "Config.Output.Cool.PidLowerLimit", -100.0, 0.0,
               "lower limit of the output, %: what is below 0 cools"),
    FIELDS[-1],
)


def values_of(design: PidDesign, scaling: Scaling) -> Mapping[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design; raise NotRepresentable for a cooler's, or as PID_Compact's."""
    return values_in(TEMP, design)


def cooling_values_of(design: PidDesign, scaling: Scaling) -> Mapping[str, Number]:
    """Return the words of a design for a cooler as strong as the heater, see `cooled`; errors as `values_of`."""
    heating = values_of(design, scaling)
    own = {f"{COOL}{name}": heating[name] for name in PARAMETERS}
    values = {**heating, "AdvancedCooling": 0, "CoolFactor": 1.0, **own, "OutputLowerLimit": -100.0}
    return {field.name: values[field.name] for field in COOLING_FIELDS}


def with_cooling_gain(words: Words, cooling_gain: float) -> Words:
    """Return words for a cooler whose full power is so many times the heater's, by both methods alike.

    Raises:
        NotRepresentable: a factor or gain beyond single precision.
    """
    fields = {field.name: field for field in COOLING_FIELDS}
    near = "a cooling gain nearer to 1 would fit"
    factor = round_to_word(_FACTOR, 1.0 / cooling_gain, near)
    gain = round_to_word(fields["CoolGain"], words.values["Gain"] * factor, near)
    return replace(words, values={**words.values, "CoolFactor": factor, "CoolGain": gain})


def cooling_gain_of(words: Words) -> float:
    """Return what full cooling is of full heating power, as CoolFactor says.

    Raises:
        OutOfRange: with two sets it says nothing, nor does a factor of 0.
    """
    factor = words.values["CoolFactor"]
    for name, silent in (("AdvancedCooling", words.values["AdvancedCooling"] != 0), ("CoolFactor", factor == 0.0)):
        if silent:
            raise OutOfRange(f"word {name}", words.values[name], "such that CoolFactor says how strong the cooler is; "
                             "say it: --cooling-gain")
    return float(f"{1.0 / factor:.7g}")


def cooling_design_of(words: Words) -> PidDesign | None:
    """Return the design of cooling's set; None without a gain. Errors as `design_of`."""
    return design_of(replace(words, values=cooling_words(words.values)))


def cooling_consistent(words: Words) -> None:
    """Refuse words that contradict one another.

    Raises:
        OutOfRange: no power to one side, another sampling time of cooling, or a lag of its derivative as in
            `design_of`.
    """
    v = words.values
    for name in ("OutputUpperLimit", "OutputLowerLimit"):
        if v[name] == 0.0:
            raise OutOfRange(f"word {name}", v[name], "not 0: then the block does not both heat and cool")
    if v["CoolCycle"] != v["Cycle"]:
        raise OutOfRange("word CoolCycle", v["CoolCycle"], f"Cycle = {v['Cycle']:g}: no proof here changes TA in a run")
    cooling_design_of(words)


def cooling_oddities(words: Words) -> tuple[str, ...]:
    """Return the oddities of the words of a block that also cools, one sentence each."""
    v = words.values
    set_ = "CoolGain" if v["AdvancedCooling"] else "CoolFactor"
    checks = [
        (v[set_] == 0.0, f"{set_} is 0: cooling has no gain."),
        (v["AdvancedCooling"] and v["CoolTi"] == 0.0 and v["Ti"] != 0.0,
         "CoolTi is 0: what the I part is in heating is deleted where cooling's set acts."),
        (v["OutputLowerLimit"] != -100.0, f"Cooling is limited to {-v['OutputLowerLimit']:g} %."),
    ]
    heating = replace(words, values={**v, "OutputLowerLimit": 0.0})
    return (*oddities(heating), *(sentence for is_odd, sentence in checks if is_odd))

