"""DISV, the disturbance variable of CONT_C in percent of LMN, and the function that writes it.

LMN = P + I + D + DISV: it is added as it is, before the limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from heatertune.plc.cpu.s7_300 import awl
from heatertune.plc.cpu.s7_300.hardware import FULL_SCALE
from heatertune.plc.fb41.step import ContCAssumptions, ContCParameters
from heatertune.plc.feed_forward import FeedForward, FeedForwardHooks
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import FORMATS, Certificate

__all__ = ["FEED"]

_DISV: Final = "DB41.DBD   68"


def _listened(values: Mapping[str, Number]) -> Mapping[str, Number]:
    return values


def _given(parameters: tuple[ContCParameters, ContCAssumptions], value: Number) -> tuple[Any, ContCAssumptions]:
    return parameters[0]._replace(disturbance=single(value)), parameters[1]


def _listing(line: FeedForward, certificate: Certificate) -> dict[str, str]:
    head = [
        f"FC 41 writes DISV of DB 41: {line.pct_per_unit:+.4g} % of full power per unit of {line.column}",
        f"DISV = {line.at_low:.6g} % at {line.low:g}, {line.at_high:.6g} % at {line.high:g}; about 0 at {line.calm:g}",
        "in OB 35 write CALL FC 41 before CALL FB 41, whose own parameter DISV stays empty", *certificate.head,
        "STL source, international mnemonics; not tried in STEP 7",
    ]
    body = _contact(line) if line.switched else _analog(line)
    return {"feed_forward.awl": awl.text([
        *(f"// {text}" for text in head), "FUNCTION FC 41 : VOID", "TITLE =disturbance variable of the controller",
        "VERSION : 0.1", "BEGIN", "NETWORK", "TITLE =tie this to your input", *body, f"      T     {_DISV};",
        "END_FUNCTION"])}


def _contact(line: FeedForward) -> list[str]:
    return ["      A     I      1.0;", "      JC    shut;", f"      L     {awl.real(line.at_low)};", "      JU    end;",
            f"shut: L     {awl.real(line.at_high)};", "end:  NOP   0;"]


def _analog(line: FeedForward) -> list[str]:
    factor = single((line.at_high - line.at_low) / FULL_SCALE)
    return ["      L     PIW  258;", "      ITD   ;", "      DTR   ;", f"      L     {awl.real(factor)};",
            "      *R    ;", f"      L     {awl.real(line.at_low)};", "      +R    ;"]


FEED: Final = FeedForwardHooks(
    word="DISV", per_pct=1.0, most=FORMATS["REAL"][1], whole=False, listened=_listened, set_disturbance=_given,
    listing=_listing)
