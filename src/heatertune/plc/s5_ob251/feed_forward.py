"""Z, the disturbance variable of OB251 (DW24, scaled as YA: 2047 units are full power), and the program that writes it.

Z is added to the output as it is, K does not multiply it; it acts where bit 5 of STEU is 0 (manual, table 11-10).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from heatertune.plc.feed_forward import FeedForward, FeedForwardHooks
from heatertune.plc.ramp import Number
from heatertune.plc.s5_ob251.blocks import HEAT
from heatertune.plc.s5_ob251.step import FULL_SCALE, NO_Z, Ob251Assumptions, Ob251Parameters
from heatertune.plc.words import Certificate

__all__ = ["FEED"]

_DB: Final = 30
_BLOCK: Final = 32


def _listened(values: Mapping[str, Number]) -> dict[str, Number]:
    return {**values, "STEU": int(values["STEU"]) & ~NO_Z}


def _given(parameters: tuple[Ob251Parameters, Ob251Assumptions], value: Number) -> tuple[Any, Ob251Assumptions]:
    return parameters[0]._replace(z=int(value)), parameters[1]


def _listing(line: FeedForward, certificate: Certificate) -> dict[str, str]:
    head = [
        f"FB{_BLOCK}: writes Z (DW 24 of DB{_DB}): {line.pct_per_unit:+.4g} % of full power per unit of {line.column}",
        f"Z = {line.at_low:+d} at {line.low:g}, {line.at_high:+d} at {line.high:g}; about 0 at {line.calm:g}",
        f"JU FB{_BLOCK} in FB{HEAT} of program_listing.txt after T DW 22; its last statement clears bit 5 of STEU",
        *certificate.head,
    ]
    body = _contact(line) if line.switched else _analog(line)
    lines = [f"C  DB {_DB}", *body, "RU D 11.5", "BE"]
    split = [statement.partition(":") if ":" in statement else ("", "", statement) for statement in lines]
    return {"feed_forward_listing.txt": "\n".join([
        *(f"// {text}" for text in head), f"FB {_BLOCK}", "NAME :FEED",
        *(f"{label:5s}:{operation}" for label, _, operation in split)]) + "\n"}


def _contact(line: FeedForward) -> list[str]:
    return ["A  I 1.0", "JC =ON", f"L  KF {line.at_low:+d}", "JU =END", f"ON:L  KF {line.at_high:+d}", "END:T  DW 24"]


def _analog(line: FeedForward) -> list[str]:
    """Return the call of the reading block: bipolar, so its lower end lies as far below 0 as its upper end above."""
    below = 2 * int(line.at_low) - int(line.at_high)
    return ["JU FB 250", "NAME:RLG:AE", "BG:KF +128", "KNKT:KY 2,6", f"OGR:KF {line.at_high:+d}",
            f"UGR:KF {below:+d}", "EINZ:F 199.0", "XA:DW 24", "FB:F 199.1", "BU:F 199.2", "TBIT:F 199.3"]


FEED: Final = FeedForwardHooks(
    word="Z", per_pct=FULL_SCALE / 100.0, most=FULL_SCALE, whole=True, listened=_listened, set_disturbance=_given,
    listing=_listing)
