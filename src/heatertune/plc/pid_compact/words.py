"""The parameters of both blocks: one set of words, whose tags in the instance DB differ."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.ramp import Number
from heatertune.plc.words import FORMATS, WordField, Words, check_limits, round_to_word

__all__ = ["COMPACT", "COOL", "COUNTS", "PARAMETERS", "TEMP", "BlockTags", "consistent", "design_of", "fields_of",
           "interval_s", "oddities", "real_field", "set_of", "values_of"]

#: of an analog input of the S7-1200/1500, and of the scaling of Input_PER
COUNTS: Final = 27648
_LARGEST: Final = FORMATS["REAL"][1]
#: longest times that the manual allows [s]
_LONGEST: Final = 100000.0
#: lag in cycles above which the derivative has no standard form: its share of the past is 1 in digits
_MOST_LAG: Final = 1e6
#: digits of a REAL that a person writes for an interval
_DIGITS: Final = 7

#: words that the block saves and loads together, in the order of its table
PARAMETERS: Final = ("Gain", "Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting", "Cycle")

#: what the words of cooling's set begin with, and its structure's name
COOL: Final = "Cool"


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockTags:
    """The names of a block: where its instance DB holds the words, and what the export is called.

    Attributes:
        block: name of the instruction.
        instance: of the technology object whose instance DB it is.
        files: the first part of the exported files' names.
        set: structure within Retain.CtrlParams and CtrlParamsBackUp, with its dot.
        output: structure of limits and minimum times within Config, with its dot.
        upper, lower: names of the limits there.
        inverts: whether Config.InvertControl turns the action round.
        cools: whether it cools besides, with the words of `heatertune.plc.pid_temp.words`.
        cooler: name of the output that cools.
        power, pulses: names of the outputs.
        pages: of the function manual.
    """

    block: str
    instance: str
    files: str
    set: str = ""
    output: str = ""
    upper: str
    lower: str
    inverts: bool
    power: str
    pulses: str
    pages: str
    cools: bool = False
    cooler: str = "OutputCool"

    @property
    def parameters(self) -> tuple[str, ...]:
        """The words that the block saves and loads together."""
        return (*PARAMETERS, *(f"{COOL}{name}" for name in PARAMETERS if self.cools))

    def active(self, word: str) -> str:
        """Return the tag of a parameter that the block computes with."""
        return f"Retain.CtrlParams.{self._placed(word)}"

    def saved(self, word: str) -> str:
        """Return the tag that LoadBackUp loads a parameter from."""
        return f"CtrlParamsBackUp.{self._placed(word)}"

    def _placed(self, word: str) -> str:
        return f"{COOL}.{word.removeprefix(COOL)}" if word.startswith(COOL) else f"{self.set}{word}"

    def config(self, name: str) -> str:
        """Return the tag of a limit or minimum time."""
        return f"Config.{self.output}{name}"


COMPACT: Final = BlockTags(
    block="PID_Compact", instance="PID_Compact_1", files="pid_compact", upper="OutputUpperLimit",
    lower="OutputLowerLimit", inverts=True, power="Output", pulses="Output_PWM", pages="pp. 246-274")
TEMP: Final = BlockTags(
    block="PID_Temp", instance="PID_Temp_1", files="pid_temp", set="Heat.", output="Output.Heat.",
    upper="PidUpperLimit", lower="PidLowerLimit", inverts=False, power="OutputHeat", pulses="OutputHeat_PWM",
    pages="pp. 391-444")


def fields_of(tags: BlockTags) -> tuple[WordField, ...]:
    """Return the words of a block, in the order in which they are typed in."""
    inverted = WordField(name="InvertControl", address="Config.InvertControl", format="BOOL", low=0, high=1,
                         comment="1: the output falls where the reading is low (a cooler)")
    real = real_field
    return (
        *set_of(tags),
        real("OutputUpperLimit", tags.config(tags.upper), -100.0, 100.0, "upper limit of the output, %"),
        real("OutputLowerLimit", tags.config(tags.lower), -100.0, 100.0, "lower limit of the output, %"),
        *((inverted,) if tags.inverts else ()),
        WordField(name="IntegralResetMode", address="IntegralResetMode", format="INT", low=0, high=4,
                  comment="I part when automatic begins: 0 smooth, 1 none, 2 held, 3 preset, 4 as by a setpoint step"),
    )


def set_of(tags: BlockTags, prefix: str = "", what: str = "") -> tuple[WordField, ...]:
    """Return a set of parameters, whose words begin and whose comments end so."""
    def real(name: str, low: float, high: float, comment: str) -> WordField:
        return real_field(prefix + name, tags.active(prefix + name), low, high, comment + what)

    return (
        real("Gain", 0.0, _LARGEST, "proportional gain, % per °C"),
        real("Ti", 0.0, _LONGEST, "integral action time, s; 0: off"),
        real("Td", 0.0, _LONGEST, "derivative action time, s; 0: off"),
        real("TdFiltRatio", 0.0, _LARGEST, "lag of the derivative as a part of Td"),
        real("PWeighting", 0.0, 1.0, "weight of the setpoint in the P part"),
        real("DWeighting", 0.0, 1.0, "weight of the setpoint in the D part"),
        real("Cycle", 0.0010000000474974513, _LONGEST, "sampling time of the PID algorithm, s"),
    )


def real_field(name: str, address: str, low: float, high: float, comment: str) -> WordField:
    """Return a word in single precision.

    Args:
        name: of the word.
        address: its tag.
        low: its least value.
        high: its largest one.
        comment: its meaning.
    """
    return WordField(name=name, address=address, format="REAL", low=low, high=high, comment=comment)


def values_of(tags: BlockTags, design: PidDesign) -> dict[str, Number]:
    """Return the words of a design; the derivative is of the reading alone, its lag that of the design's filter.

    Raises:
        NotRepresentable: a number beyond single precision or the range of its word, or that would be rounded to zero;
            a cooler in a block that only heats.
    """
    fields = {field.name: field for field in fields_of(tags)}
    gain, tn, tv = design.gain_pct_per_degC, design.integral_time_s, design.derivative_time_s
    if gain < 0.0 and not tags.inverts:
        raise NotRepresentable("word Gain", gain, "not negative: PID_Temp is not inverted",
                               "target pid-compact with InvertControl would fit")
    cycles = design.derivative_filter / (1.0 - design.derivative_filter)
    near = "a time up to 100000 s would fit"
    words: dict[str, Number] = {
        "Gain": round_to_word(fields["Gain"], abs(gain), "a K nearer to 1 %/°C would fit"),
        "Ti": 0.0 if math.isinf(tn) else round_to_word(fields["Ti"], tn, near),
        "Td": round_to_word(fields["Td"], tv, near),
        "TdFiltRatio": round_to_word(fields["TdFiltRatio"], cycles * design.sample_time_s / tv, "a longer TV would fit")
        if tv > 0.0 else round_to_word(fields["TdFiltRatio"], 0.2),
        "PWeighting": 1.0, "DWeighting": 0.0, "Cycle": round_to_word(fields["Cycle"], design.sample_time_s, near),
        "OutputUpperLimit": 100.0, "OutputLowerLimit": 0.0, "IntegralResetMode": 1,
    }
    return words | ({"InvertControl": int(gain < 0.0)} if tags.inverts else {})


def design_of(words: Words) -> PidDesign | None:
    """Return the design that these words run, with the default of each switch; None without a gain.

    Weights of the setpoint, limits and what I begins with are no part of it.

    Raises:
        OutOfRange: a lag of the derivative so long that nothing is left of it.
    """
    v, ta = words.values, words.sample_time_s
    if v["Gain"] == 0.0:
        return None
    tn, tv = v["Ti"] or math.inf, float(v["Td"])
    lag = v["TdFiltRatio"] * tv
    if lag > _MOST_LAG * ta:
        raise OutOfRange("word TdFiltRatio", v["TdFiltRatio"], f"<= {_MOST_LAG * ta / tv:g}: a lag of {_MOST_LAG:g} "
                         "cycles is no derivative")
    return PidDesign(
        gain_pct_per_degC=float(-v["Gain"] if v.get("InvertControl") else v["Gain"]), integral_time_s=tn,
        derivative_time_s=tv, sample_time_s=ta, structure=structure_of(tn, tv),
        derivative_filter=lag / (lag + ta) if tv > 0.0 else 0.5,
        method=f"as the words of {'PID_Compact' if 'InvertControl' in v else 'PID_Temp'} realise it")


def consistent(words: Words) -> None:
    """Refuse words that contradict one another.

    Raises:
        OutOfRange: limits that are upside down, or leave no power at all.
    """
    check_limits(words.values, "OutputLowerLimit", "OutputUpperLimit", equal=False)


def interval_s(values: Mapping[str, Number]) -> float:
    """Return Cycle as a person writes it [s]."""
    return float(f"{values['Cycle']:.{_DIGITS}g}")


def oddities(words: Words) -> tuple[str, ...]:
    """Return warnings about a block's parameters, one sentence each."""
    v = words.values
    checks = [
        (v["Gain"] == 0.0, "Gain is 0: nothing acts."),
        (v["Ti"] == 0.0, "Ti is 0: there is no integral part."),
        (v["PWeighting"] != 1.0, f"PWeighting is {v['PWeighting']:g}: a setpoint step moves P less than the reading."),
        (v["PWeighting"] != 1.0 and v["IntegralResetMode"] == 1,
         "IntegralResetMode is 1 with PWeighting below 1: near the setpoint automatic begins the wrong way."),
        (v["IntegralResetMode"] in (0, 3), f"IntegralResetMode is {v['IntegralResetMode']}: automatic begins with 0 %, "
         "and only the I part leads on from there."),
        (v.get("InvertControl", 0) != 0, "InvertControl is 1: the output falls where the temperature is low, as for a "
         "cooler."),
        ((v["OutputLowerLimit"], v["OutputUpperLimit"]) != (0.0, 100.0),
         f"The output is limited to {v['OutputLowerLimit']:g}…{v['OutputUpperLimit']:g} %, not to 0…100 %."),
    ]
    return tuple(sentence for is_odd, sentence in checks if is_odd)
