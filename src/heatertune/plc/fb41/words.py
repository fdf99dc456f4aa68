"""The parameters of CONT_C's instance data block.

Names and defaults: the block's parameter table; offsets: the sums of its types, in its order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from heatertune.errors import NotRepresentable
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.cpu.s7_300.machine import quotient, real
from heatertune.plc.fb41.step import ContCParameters
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import FORMATS, Scaling, WordField, Words, check_limits

__all__ = ["FIELDS", "consistent", "design_of", "parameters_of", "reading_periphery", "values_of"]

_MOST: Final = FORMATS["REAL"][1]
_LONGEST: Final = int(FORMATS["TIME"][1])


def _bit(name: str, address: str, comment: str, low: int = 0) -> WordField:
    return WordField(name=name, address=address, format="BOOL", low=low, high=1, comment=comment)


def _time(name: str, address: str, comment: str, low: int = 0, high: int = _LONGEST) -> WordField:
    return WordField(name=name, address=address, format="TIME", low=low, high=high, comment=comment)


def _real(name: str, address: str, comment: str, low: float = -_MOST) -> WordField:
    return WordField(name=name, address=address, format="REAL", low=low, high=_MOST, comment=comment)


FIELDS: Final[tuple[WordField, ...]] = (
    _bit("MAN_ON", "DBX0.1", "1: manual, LMN is MAN"),
    _bit("PVPER_ON", "DBX0.2", "1: the reading is PV_PER, 0: PV_IN"),
    _bit("P_SEL", "DBX0.3", "1: P part on"),
    _bit("I_SEL", "DBX0.4", "1: I part on"),
    _bit("INT_HOLD", "DBX0.5", "1: I part held"),
    _bit("I_ITL_ON", "DBX0.6", "1: I part is I_ITLVAL"),
    _bit("D_SEL", "DBX0.7", "1: D part on"),
    _time("CYCLE", "DBD2", "call interval TA", low=1, high=60000),
    _real("MAN", "DBD16", "manual value, %"),
    _real("GAIN", "DBD20", "proportional gain, % per unit of PV"),
    _time("TI", "DBD24", "reset time"),
    _time("TD", "DBD28", "derivative time"),
    _time("TM_LAG", "DBD32", "lag of the D part"),
    _real("DEADB_W", "DBD36", "dead band, unit of PV", low=0.0),
    _real("LMN_HLM", "DBD40", "upper limit of LMN, %"),
    _real("LMN_LLM", "DBD44", "lower limit of LMN, %"),
    _real("PV_FAC", "DBD48", "unit of PV per %"),
    _real("PV_OFF", "DBD52", "PV at 0 %"),
    _real("LMN_FAC", "DBD56", "factor of LMN"),
    _real("LMN_OFF", "DBD60", "offset of LMN"),
    _real("I_ITLVAL", "DBD64", "initial value of the I part, %"),
    _real("DISV", "DBD68", "disturbance variable, %"),
)

#: what `encode` does not compute; times: the block's own defaults for parts that are off [ms]
_PLAIN: Final[dict[str, int | float]] = {
    "MAN_ON": 0, "PVPER_ON": 1, "P_SEL": 1, "INT_HOLD": 0, "I_ITL_ON": 0, "MAN": 0.0, "DEADB_W": 0.0, "LMN_HLM": 100.0,
    "LMN_LLM": 0.0, "LMN_FAC": 1.0, "LMN_OFF": 0.0, "I_ITLVAL": 0.0, "DISV": 0.0,
}
_TI_OFF: Final = 20000
_TD_OFF: Final = 10000
_TM_LAG_OFF: Final = 2000


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:
    """Return the words of a design, PV in °C.

    The block integrates by trapezoids, the design by rectangles: GAIN, TI = TN + TA/2 and TD are chosen so that the
    linear law is the same. TM_LAG gives the D part the design's filter.

    Raises:
        NotRepresentable: a time the block would raise or a TIME cannot hold.
    """
    cycle = round(1000.0 * design.sample_time_s)
    i_sel, d_sel = math.isfinite(design.integral_time_s), design.derivative_time_s > 0.0
    ti = _whole("TI", 1000.0 * design.integral_time_s + cycle / 2.0, cycle // 2 + 1) if i_sel else _TI_OFF
    raised = ti / (ti - cycle / 2.0) if i_sel else 1.0
    td = _whole("TD", 1000.0 * design.derivative_time_s / raised, cycle) if d_sel else _TD_OFF
    past = design.derivative_filter
    lag = _whole("TM_LAG", cycle / 2.0 * (1.0 + past) / (1.0 - past), 1) if d_sel else _TM_LAG_OFF
    factor = single(scaling.span_degC / 100.0)
    return _PLAIN | {
        "I_SEL": int(i_sel), "D_SEL": int(d_sel), "CYCLE": cycle, "TI": ti, "TD": td,
        "TM_LAG": max(lag, (cycle + 1) // 2), "PV_FAC": factor, "PV_OFF": scaling.low_degC,
        "GAIN": design.gain_pct_per_degC * raised / (factor * 100.0 / scaling.span_degC),
    }


def design_of(words: Words) -> PidDesign | None:
    """Return the design that these words run, in the rectangles of the standard form; None without a P part.

    Dead band, limits and disturbance variable are no part of it. Where CYCLE is not the call interval, all times
    stretch by their ratio.

    Raises:
        OutOfRange: words whose product leaves the range of numbers.
    """
    v = reading_periphery(words.values, words.scaling)
    half = v["CYCLE"] / 2.0
    ti, td, lag = max(v["TI"], half), max(v["TD"], v["CYCLE"]), max(v["TM_LAG"], half)
    share = (ti - half) / ti if v["I_SEL"] else 1.0
    gain = v["GAIN"] * v["PV_FAC"] * v["LMN_FAC"] * 100.0 / words.scaling.span_degC * share
    if not v["P_SEL"] or gain == 0.0:
        return None
    stretch = words.sample_time_s / v["CYCLE"]
    tn = stretch * (ti - half) if v["I_SEL"] else math.inf
    tv = stretch * td / share if v["D_SEL"] else 0.0
    return PidDesign(
        gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=words.sample_time_s,
        structure=structure_of(tn, tv), derivative_filter=(lag - half) / (lag + half) if v["D_SEL"] else 0.0,
        method="as the words of FB41 realise it",
    )


def consistent(words: Words) -> None:
    """Refuse words that contradict one another.

    Raises:
        OutOfRange: limits that are upside down.
    """
    check_limits(words.values, "LMN_LLM", "LMN_HLM", equal=False)


def _whole(name: str, exact_ms: float, least: int) -> int:
    word = math.floor(exact_ms + 0.5)
    if word < least:
        faster = "a faster TA would fit" if name == "TD" else "a longer time would fit"
        raise NotRepresentable(f"word {name}", exact_ms, f"{least}..{_LONGEST} ms, or the block raises it", faster)
    if word > _LONGEST:
        raise NotRepresentable(f"word {name}", exact_ms, f"{least}..{_LONGEST} ms", f"{_LONGEST / 1000:g} s would fit")
    return word


def reading_periphery(v: Mapping[str, Number], scaling: Scaling) -> Mapping[str, Number]:
    """Return words that make of PV_PER what the program before the block makes of it where PV_IN is read: °C."""
    return v if v["PVPER_ON"] else {**v, "PVPER_ON": 1, "PV_FAC": single(scaling.span_degC / 100.0),
                                    "PV_OFF": single(scaling.low_degC)}


def parameters_of(v: Mapping[str, Number]) -> ContCParameters:
    """Return the words as the block computes with them: TIME in ms becomes REAL in s."""
    seconds = {name: quotient(real(v[name])[0], 1000.0)[0] for name in ("CYCLE", "TI", "TD", "TM_LAG")}
    return ContCParameters(
        cycle=seconds["CYCLE"], gain=v["GAIN"], ti=seconds["TI"], td=seconds["TD"], tm_lag=seconds["TM_LAG"],
        dead_band=v["DEADB_W"], upper=v["LMN_HLM"], lower=v["LMN_LLM"], pv_factor=v["PV_FAC"], pv_offset=v["PV_OFF"],
        lmn_factor=v["LMN_FAC"], lmn_offset=v["LMN_OFF"], initial=v["I_ITLVAL"], disturbance=v["DISV"],
        manual=v["MAN"], man_on=bool(v["MAN_ON"]), p_sel=bool(v["P_SEL"]), i_sel=bool(v["I_SEL"]),
        int_hold=bool(v["INT_HOLD"]), i_itl_on=bool(v["I_ITL_ON"]), d_sel=bool(v["D_SEL"]),
    )
