"""The statements that lead a setpoint along a ramp, for both controllers of the S7-300."""

from __future__ import annotations

from typing import Final

from heatertune.plc.ramp import Ramp

__all__ = ["WORD", "ramp_begins", "ramp_moves"]

#: the setpoint that the controller follows, and the calls to its next step; free in most programs
WORD: Final = "MW 30"
_COUNTDOWN: Final = "MW 32"


def ramp_begins(ramp: Ramp) -> list[str]:
    """Return the statements for the restart: the ramp begins at the reading."""
    countdown = [] if ramp.calls == 1 else [f"      L     {ramp.calls};", f"      T     {_COUNTDOWN};"]
    return ["      L     PIW 256;", f"      T     {WORD};  // setpoint ramp begins at the reading", *countdown]


def ramp_moves(ramp: Ramp, asked: str) -> list[str]:
    """Return the statements of each call: the setpoint moves by a step, or by what is left where that is less.

    It comes from the side on which it is, so that no sum can overflow on a setpoint within 0…27648.
    """
    step = int(ramp.step)
    return [
        *([] if ramp.calls == 1 else _count(ramp.calls)),
        f"      L     {WORD};", f"      L     {asked};", "      >I    ;", "      JC    down;",
        *_by(step, asked, "+I", ">I"), "      JU    ramp;",
        *_by(step, asked, "-I", "<I", label="down:"),
        f"ramp: T     {WORD};",
        *([] if ramp.calls == 1 else ["kept: NOP   0;"]),
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
