"""The words of a PID loop (System Manual C79000-G7076-C233-01, Table 9-19)."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.cpu.s7_200.io_and_cycle import TICK_FIELDS, ticks_of, whole_cycle
from heatertune.plc.inputs import FOUR_TO_TWENTY, Range
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import Scaling, WordField, Words

__all__ = ["FIELDS", "FULL", "NO_INTEGRAL", "RANGES", "SETPOINT", "TABLE", "UNREAD", "design_of", "values_of"]

#: analog input word at the end of the range
FULL: Final = 32000
#: an EM 231 for temperatures: 0.1 °C per digit; all channels are new every 405 ms, which one conversion and its being
#: handed over may take each, or 810 ms with eight channels (A5E00066097-02, tables A-27, A-34; A5E01151572-01)
_DEGREES: Final = Range(high_degC=0.1 * FULL, counts=FULL, delay_s=0.81)
#: an EM 231 or EM 235 knows 0 to 20 mA: 4 mA is the word 6400
RANGES: Final = {FOUR_TO_TWENTY: Range(from_zero=True), "thermocouple": _DEGREES, "rtd": _DEGREES}
#: range → why there is none
UNREAD: Final = {"rtd-climatic": "an EM 231 gives 0.1 °C per digit, and has no climatic range: use rtd"}

#: where the loop table begins in V memory
TABLE: Final = 100
#: where the setpoint stands as a share of the range, written by the operator's panel
SETPOINT: Final = f"VD{TABLE + 4}"

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
    *TICK_FIELDS,
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:
    """Return the words of a design; TA is the PWM cycle."""
    cycle = whole_cycle(design.sample_time_s)
    ts = single(cycle / 1000.0)
    minutes = ts / design.sample_time_s / _MINUTE  # Ti and Td act by their ratio to the Ts that is stored
    return {
        "KC": design.gain_pct_per_degC * scaling.span_degC / 100.0,
        "TS": ts,
        "TI": min(single(design.integral_time_s * minutes), NO_INTEGRAL),
        "TD": design.derivative_time_s * minutes,
        **ticks_of(cycle),
    }


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run: the times as the program's interrupt makes them.

    Raises:
        OutOfRange: a gain of 0, which leaves no proportional part.
    """
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
