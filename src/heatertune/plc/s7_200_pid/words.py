"""The words of a PID loop: encode, decode, check (System Manual C79000-G7076-C233-01, Table 9-19)."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc.controller import Scaling, WordField, Words, check_fields
from heatertune.plc.s7_200.words import FIELDS as PROGRAM_FIELDS
from heatertune.plc.s7_200.words import check_cycle, ticks_of, whole_cycle
from heatertune.plc.single import single

__all__ = ["FIELDS", "NO_INTEGRAL", "TABLE", "check_words", "decode", "encode"]

#: where the loop table begins in V memory
TABLE: Final = 100

#: Ti [min] that stands for infinity, which cannot be typed in: the largest single
NO_INTEGRAL: Final = 3.4028234663852886e38
_SMALLEST: Final = 1.1754943508222875e-38
_MINUTE: Final = 60.0

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="KC", address=f"VD{TABLE + 12}", format="REAL", low=-NO_INTEGRAL, high=NO_INTEGRAL,
              comment="gain, share of full power per share of the range"),
    WordField(name="TS", address=f"VD{TABLE + 16}", format="REAL", low=_SMALLEST, high=NO_INTEGRAL,
              comment="sampling interval, s"),
    WordField(name="TI", address=f"VD{TABLE + 20}", format="REAL", low=_SMALLEST, high=NO_INTEGRAL,
              comment="integral-action time, min; 3.4e38: none"),
    WordField(name="TD", address=f"VD{TABLE + 24}", format="REAL", low=0.0, high=NO_INTEGRAL,
              comment="derivative-action time, min"),
    *(field for field in PROGRAM_FIELDS if field.name in ("TICK", "TICKS")),
)


def encode(design: PidDesign, scaling: Scaling) -> Words:
    """Return the words nearest to the design, each rounded once to single precision; TA is the PWM cycle.

    Raises:
        NotRepresentable: an interval the timer cannot do, a number beyond single precision.
    """
    cycle = whole_cycle(design.sample_time_s)
    ts = single(cycle / 1000.0)
    minutes = ts / design.sample_time_s / _MINUTE  # Ti and Td act by their ratio to the Ts that is stored
    values = {
        "KC": single(design.gain_pct_per_degC * scaling.span_degC / 100.0),
        "TS": ts,
        "TI": min(single(design.integral_time_s * minutes), NO_INTEGRAL),
        "TD": single(design.derivative_time_s * minutes),
        **ticks_of(cycle),
    }
    for field in FIELDS:
        value = values[field.name]
        if not field.low <= value <= field.high:
            raise NotRepresentable(f"word {field.name}", value, field.rule, "an ordinary heater's would fit")
    return Words(target="s7-200-pid", values=values, scaling=scaling, sample_time_s=cycle / 1000.0)


def decode(words: Words) -> PidDesign:
    """Return the design that these words run: the times as the program's interrupt makes them.

    Raises:
        OutOfRange: a word out of its range, or a gain of 0, which leaves no proportional part.
    """
    check_words(words)
    v, ta = words.values, words.sample_time_s
    if v["KC"] == 0.0:
        raise OutOfRange("word KC", 0.0, "not 0: the standard form needs a P part")
    tn = math.inf if v["TI"] == NO_INTEGRAL else _MINUTE * v["TI"] * ta / v["TS"]
    tv = _MINUTE * v["TD"] * ta / v["TS"]
    return PidDesign(
        gain_pct_per_degC=v["KC"] * 100.0 / words.scaling.span_degC, integral_time_s=tn, derivative_time_s=tv,
        sample_time_s=ta, structure=structure_of(tn, tv), method="as the PID instruction realises it",
        derivative_filter=0.0,
    )


def check_words(words: Words) -> None:
    """Raise OutOfRange for the first word that is missing, unknown, of the wrong kind or range, or makes no cycle."""
    check_fields(FIELDS, words)
    check_cycle(words)
