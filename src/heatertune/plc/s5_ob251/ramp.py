"""FB33, which leads W along a ramp: statements on the words of DB31, which its caller has opened."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.plc.ramp import Ramp, for_coolers

__all__ = ["ramp_statements"]

_SWAPPED: Final = {"+F": "-F", ">F": "<F", ">=F": "<=F", "DOWN": "RISE", "LOW": "TOP"}


def ramp_statements(ramp: Ramp, at: Mapping[str, str]) -> list[str]:
    """Return the statements, each `label:operation`.

    Args:
        ramp: step in units of W.
        at: name of a word of DB31 → its operand: asked, w, x, countdown, lowest.
    """
    body = [] if ramp.calls == 1 else _count(ramp.calls, "BEC" if ramp.hold is None else "JC =HELD", at["countdown"])
    return [*body, *_moves(ramp, at)]


def _count(calls: int, leave: str, countdown: str) -> list[str]:
    return [
        f"L  {countdown}", "L  KF +1", "-F", f"T  {countdown}", "L  KF +0", ">F", leave,
        f"L  KF +{calls}", f"T  {countdown}",
    ]


def _moves(ramp: Ramp, at: Mapping[str, str]) -> list[str]:
    """Return the statements that move W by a step, or by what is left where that is less, and hold it at X."""
    step, w, x, asked, lowest = int(ramp.step), at["w"], at["x"], at["asked"], at["lowest"]
    up = [
        f"L  {w}", f"L  {asked}", ">F", "JC =DOWN",
        f"L  {w}", f"L  KF +{step}", "+F", f"L  {asked}", ">F", "JC =END", "TAK", "JU =END",
    ]
    if ramp.hold is None:
        return [*up, f"DOWN:L  {w}", *_down(step, asked), f"END:T  {w}", "BE"]
    hold = abs(ramp.hold)
    heaters = [
        *up,
        f"DOWN:L  {x}", f"L  KF +{hold}", "-F", f"L  {asked}", "<F", "JC =LOW", "TAK", f"LOW:T  {lowest}",
        f"L  {w}", ">=F", "JC =HELD",
        f"L  {w}", *_down(step, lowest), f"END:T  {w}",
        f"HELD:L  {x}", f"L  KF +{hold}", "+F", f"L  {w}", ">=F", "BEC", "TAK", f"T  {w}", "BE",
    ]
    return [for_coolers(statement, _SWAPPED) for statement in heaters] if ramp.cools else heaters


def _down(step: int, lowest: str) -> list[str]:
    return [f"L  KF +{step}", "-F", f"L  {lowest}", "<F", "JC =END", "TAK"]
