"""The program that leads OB251's setpoint W along a ramp, as a statement list to key in.

Only basic statements and TAK are used; the numbers of block and flag words are free in most programs.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.ramp import Ramp
from heatertune.plc.words import Certificate

__all__ = ["ramp_listing"]

_BLOCK: Final = 30
_ASKED: Final = "FW 200"
_COUNTDOWN: Final = "FW 202"


def ramp_listing(ramp: Ramp, interval_s: float, db: int, certificate: Certificate) -> str:
    """Return the listing of the function block and of its calls.

    Args:
        ramp: step in units of W.
        interval_s: TA [s].
        db: number of the controller DB.
        certificate: of the words with this ramp.
    """
    head = [
        f"FB{_BLOCK}: leads W (DW 9 of DB{db}) to the setpoint asked for, {ramp}",
        f"JU FB{_BLOCK} in the timed block (OB13, every {interval_s:g} s) before OB251 is called",
        f"{_ASKED}: the setpoint asked for, -2047...+2047 units, written by your program",
        *([f"{_COUNTDOWN}: calls to the next step"] if ramp.calls > 1 else []),
        *certificate.head,
    ]
    body, restart = [f"C  DB {db}"], [f"C  DB {db}", "L  DW 22", "T  DW 9"]
    if ramp.calls > 1:
        body += _count(ramp.calls)
        restart += [f"L  KF +{ramp.calls}", f"T  {_COUNTDOWN}"]
    return "\n".join([
        *[f"// {line}" for line in head], f"FB {_BLOCK}", "NAME :RAMP", *_lines([*body, *_move(int(ramp.step))]), "",
        "// in OB21 and OB22 (restart), X taken over from your input before: the ramp begins at the reading",
        *_lines(restart),
    ]) + "\n"


def _lines(statements: list[str]) -> list[str]:
    """Return statements in columns: label, colon, operation."""
    split = [statement.rpartition(":") for statement in statements]
    return [f"{label:5s}:{operation}" for label, _, operation in split]


def _count(calls: int) -> list[str]:
    return [
        f"L  {_COUNTDOWN}", "L  KF +1", "-F", f"T  {_COUNTDOWN}", "L  KF +0", ">F", "BEC",
        f"L  KF +{calls}", f"T  {_COUNTDOWN}",
    ]


def _move(step: int) -> list[str]:
    """Return the statements that move W by a step, or by what is left where that is less."""
    return [
        "L  DW 9", f"L  {_ASKED}", ">F", "JC =DOWN",
        "L  DW 9", f"L  KF +{step}", "+F", f"L  {_ASKED}", ">F", "JC =END", "TAK", "JU =END",
        "DOWN:L  DW 9", f"L  KF +{step}", "-F", f"L  {_ASKED}", "<F", "JC =END", "TAK",
        "END:T  DW 9", "BE",
    ]
