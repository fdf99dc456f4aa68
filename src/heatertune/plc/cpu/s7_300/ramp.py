"""The statements that lead a setpoint along a ramp, for both controllers of the S7-300."""

from __future__ import annotations

from functools import partial
from typing import Final

from heatertune.plc.ramp import Number, Ramp, for_coolers

__all__ = ["WORD", "ramp_begins", "ramp_moves"]

#: the setpoint that the controller follows, and the calls to its next step; free in most programs
WORD: Final = "MW 30"
_COUNTDOWN: Final = "MW 32"
#: how far a holdback lets the setpoint go down, or up for a cooler
_LOWEST: Final = "MW 38"
_SWAPPED: Final = {
    "+I": "-I", ">I": "<I", ">=I": "<=I", "+D": "-D", ">D": "<D", ">=D": "<=D", "down": "rise", "low": "top",
    "the reading less the holdback where that is more": "the reading and the holdback where that is less",
    "the reading and the holdback": "the reading less the holdback",
}


def ramp_begins(ramp: Ramp) -> list[str]:
    """Return the statements for the restart: the ramp begins at the reading."""
    countdown = [] if ramp.calls == 1 else [f"      L     {ramp.calls};", f"      T     {_COUNTDOWN};"]
    return ["      L     PIW 256;", f"      T     {WORD};  // setpoint ramp begins at the reading", *countdown]


def ramp_moves(ramp: Ramp, asked: str) -> list[str]:
    """Return the statements of each call: the setpoint moves by a step, or by what is left where that is less.

    It comes from the side on which it is, so that no sum can overflow on a setpoint within 0…27648. A holdback is
    reckoned in 32 bits: the reading of a broken sensor is at the end of 16.
    """
    step, counts = int(ramp.step), [] if ramp.calls == 1 else _count(ramp.calls)
    up = [*_by(step, asked, "+I", ">I"), "      JU    ramp;"]
    if ramp.hold is None:
        return [
            *counts, f"      L     {WORD};", f"      L     {asked};", "      >I    ;", "      JC    down;",
            *up, *_by(step, asked, "-I", "<I", label="down:"),
            f"ramp: T     {WORD};", *(["kept: NOP   0;"] if counts else []),
        ]
    hold = abs(ramp.hold)
    heaters = [
        *_beside(hold, "-D", asked), "      <D    ;", "      JC    low;", "      TAK   ;",
        f"low:  T     {_LOWEST};  // the setpoint asked for, or the reading less the holdback where that is more",
        f"      L     {WORD};", f"      L     {asked};", "      >I    ;", "      JC    down;", *up,
        f"down: L     {WORD};", f"      L     {_LOWEST};", "      <=I   ;", "      JC    kept;",
        *_by(step, _LOWEST, "-I", "<I"),
        f"ramp: T     {WORD};",
        *_beside(hold, "+D", WORD, label="kept:"), "      >=D   ;", "      JC    held;", "      TAK   ;",
        f"      T     {WORD};  // the reading and the holdback", "held: NOP   0;",
    ]
    return [*counts, *(map(partial(for_coolers, swapped=_SWAPPED), heaters) if ramp.cools else heaters)]


def _beside(hold: Number, sum_: str, word: str, label: str = "") -> list[str]:
    """Return the statements that leave the reading and a holdback in ACCU 2, a word in ACCU 1, both in 32 bits."""
    return [
        f"{label:6s}L     PIW 256;", "      ITD   ;", f"      L     L#{hold};", f"      {sum_}    ;",
        f"      L     {word};", "      ITD   ;",
    ]


def _count(calls: int) -> list[str]:
    return [
        f"      L     {_COUNTDOWN};", "      L     1;", "      -I    ;", f"      T     {_COUNTDOWN};",
        "      L     0;", "      >I    ;", "      JC    kept;",
        f"      L     {calls};", f"      T     {_COUNTDOWN};",
    ]


def _by(step: int, asked: str, move: str, beyond: str, label: str = "") -> list[str]:
    """Return the statements that leave a step on, or what is asked for where the step goes beyond it, in ACCU 1."""
    return [
        f"{label:6s}L     {WORD};", f"      L     {step};", f"      {move}    ;", f"      L     {asked};",
        f"      {beyond}    ;", "      JC    ramp;", "      TAK   ;",
    ]
