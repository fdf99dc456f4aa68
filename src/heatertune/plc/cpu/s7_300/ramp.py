"""The statements that lead a setpoint along a ramp, for both controllers of the S7-300."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

from heatertune.plc.ramp import Number, Ramp, for_coolers

__all__ = ["ramp_begins", "ramp_moves"]

_SWAPPED: Final = {
    "+I": "-I", ">I": "<I", ">=I": "<=I", "+D": "-D", ">D": "<D", ">=D": "<=D", "down": "rise", "low": "top",
    "the reading less the holdback where that is more": "the reading and the holdback where that is less",
    "the reading and the holdback": "the reading less the holdback",
}


def ramp_begins(ramp: Ramp, at: Mapping[str, str]) -> list[str]:
    """Return the statements of the first call: the ramp begins at the reading; operands as for `ramp_moves`."""
    countdown = [] if ramp.calls == 1 else [f"      L     {ramp.calls};", f"      T     {at['COUNTDOWN']};"]
    return ["      L     #reading;", f"      T     {at['LED']};  // setpoint ramp begins at the reading", *countdown]


def ramp_moves(ramp: Ramp, at: Mapping[str, str]) -> list[str]:
    """Return the statements of each call: the setpoint moves by a step, or by what is left where that is less.

    It comes from the side on which it is, so that no sum can overflow on a setpoint within 0…27648. A holdback is
    reckoned in 32 bits: the reading of a broken sensor is at the end of 16.

    Args:
        ramp: how it moves.
        at: operands: SP asked for; LED, the setpoint that the controller follows; COUNTDOWN, the calls to its next
            step; LOWEST, how far a holdback lets it go down, or up for a cooler.
    """
    step, asked, word, lowest = int(ramp.step), at["SP"], at["LED"], at["LOWEST"]
    counts = [] if ramp.calls == 1 else _count(ramp.calls, at["COUNTDOWN"])
    up = [*_by(step, word, asked, "+I", ">I"), "      JU    ramp;"]
    if ramp.hold is None:
        return [
            *counts, f"      L     {word};", f"      L     {asked};", "      >I    ;", "      JC    down;",
            *up, *_by(step, word, asked, "-I", "<I", label="down:"),
            f"ramp: T     {word};", *(["kept: NOP   0;"] if counts else []),
        ]
    hold = abs(ramp.hold)
    heaters = [
        *_beside(hold, "-D", asked), "      <D    ;", "      JC    low;", "      TAK   ;",
        f"low:  T     {lowest};  // the setpoint asked for, or the reading less the holdback where that is more",
        f"      L     {word};", f"      L     {asked};", "      >I    ;", "      JC    down;", *up,
        f"down: L     {word};", f"      L     {lowest};", "      <=I   ;", "      JC    kept;",
        *_by(step, word, lowest, "-I", "<I"),
        f"ramp: T     {word};",
        *_beside(hold, "+D", word, label="kept:"), "      >=D   ;", "      JC    held;", "      TAK   ;",
        f"      T     {word};  // the reading and the holdback", "held: NOP   0;",
    ]
    return [*counts, *(map(partial(for_coolers, swapped=_SWAPPED), heaters) if ramp.cools else heaters)]


def _beside(hold: Number, sum_: str, word: str, label: str = "") -> list[str]:
    """Return the statements that leave the reading and a holdback in ACCU 2, a word in ACCU 1, both in 32 bits."""
    return [
        f"{label:6s}L     #reading;", "      ITD   ;", f"      L     L#{hold};", f"      {sum_}    ;",
        f"      L     {word};", "      ITD   ;",
    ]


def _count(calls: int, countdown: str) -> list[str]:
    return [
        f"      L     {countdown};", "      L     1;", "      -I    ;", f"      T     {countdown};",
        "      L     0;", "      >I    ;", "      JC    kept;",
        f"      L     {calls};", f"      T     {countdown};",
    ]


def _by(step: int, word: str, asked: str, move: str, beyond: str, label: str = "") -> list[str]:
    """Return the statements that leave a step on, or what is asked for where the step goes beyond it, in ACCU 1."""
    return [
        f"{label:6s}L     {word};", f"      L     {step};", f"      {move}    ;", f"      L     {asked};",
        f"      {beyond}    ;", "      JC    ramp;", "      TAK   ;",
    ]
