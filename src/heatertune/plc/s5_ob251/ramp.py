"""The program that leads OB251's setpoint W along a ramp, as a statement list to key in.

Only basic statements and TAK are used; the numbers of block and flag words are free in most programs.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.ramp import Ramp, for_coolers
from heatertune.plc.words import Certificate

__all__ = ["ramp_listing"]

_BLOCK: Final = 30
_ASKED: Final = "FW 200"
_COUNTDOWN: Final = "FW 202"
_LOWEST: Final = "FW 204"
_SWAPPED: Final = {"+F": "-F", ">F": "<F", ">=F": "<=F", "DOWN": "RISE", "LOW": "TOP"}


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
        *(["X must be in DW 22 before; W follows it",
           f"{_LOWEST}: how far W may go {'up' if ramp.cools else 'down'}"] if ramp.hold else []),
        *certificate.head,
    ]
    body, restart = [f"C  DB {db}"], [f"C  DB {db}", "L  DW 22", "T  DW 9"]
    if ramp.calls > 1:
        body += _count(ramp.calls, "BEC" if ramp.hold is None else "JC =HELD")
        restart += [f"L  KF +{ramp.calls}", f"T  {_COUNTDOWN}"]
    return "\n".join([
        *[f"// {line}" for line in head], f"FB {_BLOCK}", "NAME :RAMP", *_lines([*body, *_moves(ramp)]), "",
        "// in OB21 and OB22 after FB31 (start_up_listing.txt), X then written to DW22: the ramp begins at the reading",
        *_lines(restart),
    ]) + "\n"


def _lines(statements: list[str]) -> list[str]:
    """Return statements in columns: label, colon, operation."""
    split = [statement.rpartition(":") for statement in statements]
    return [f"{label:5s}:{operation}" for label, _, operation in split]


def _count(calls: int, leave: str) -> list[str]:
    return [
        f"L  {_COUNTDOWN}", "L  KF +1", "-F", f"T  {_COUNTDOWN}", "L  KF +0", ">F", leave,
        f"L  KF +{calls}", f"T  {_COUNTDOWN}",
    ]


def _moves(ramp: Ramp) -> list[str]:
    """Return the statements that move W by a step, or by what is left where that is less, and hold it at X."""
    step = int(ramp.step)
    if ramp.hold is None:
        return [*_up(step), "DOWN:L  DW 9", *_down(step, _ASKED), "END:T  DW 9", "BE"]
    hold = abs(ramp.hold)
    heaters = [
        *_up(step),
        "DOWN:L  DW 22", f"L  KF +{hold}", "-F", f"L  {_ASKED}", "<F", "JC =LOW", "TAK", f"LOW:T  {_LOWEST}",
        "L  DW 9", ">=F", "JC =HELD",
        "L  DW 9", *_down(step, _LOWEST), "END:T  DW 9",
        "HELD:L  DW 22", f"L  KF +{hold}", "+F", "L  DW 9", ">=F", "BEC", "TAK", "T  DW 9", "BE",
    ]
    return [for_coolers(statement, _SWAPPED) for statement in heaters] if ramp.cools else heaters


def _up(step: int) -> list[str]:
    return [
        "L  DW 9", f"L  {_ASKED}", ">F", "JC =DOWN",
        "L  DW 9", f"L  KF +{step}", "+F", f"L  {_ASKED}", ">F", "JC =END", "TAK", "JU =END",
    ]


def _down(step: int, lowest: str) -> list[str]:
    return [f"L  KF +{step}", "-F", f"L  {lowest}", "<F", "JC =END", "TAK"]
