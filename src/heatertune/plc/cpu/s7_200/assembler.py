"""Statement list as STEP 7-Micro/WIN exports it → a program as the CPU takes it."""

from __future__ import annotations

import re
from array import array
from functools import lru_cache
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200.cpu import S7200Program
from heatertune.plc.cpu.s7_200.instructions import block_number, instruction, is_subroutine
from heatertune.plc.cpu.s7_200.opcodes import ATCH, CALL, END, ROW

__all__ = ["assemble"]

_BLOCK: Final = re.compile(r"(ORGANIZATION|SUBROUTINE|INTERRUPT)_BLOCK \w+:(\w+)")
_NO_CODE: Final = re.compile(r"BEGIN|TITLE=.*|Network \d+|END_\w+_BLOCK|")

#: number of a block → number, text and code of its lines
_Rows = dict[int, list[tuple[int, str, list[int]]]]


@lru_cache(maxsize=64)
def assemble(text: str) -> S7200Program:
    """Return a program.

    Raises:
        InputError: by its number, a line that is no known instruction, one outside any block, or one that calls or
            attaches a block that is not there; a subroutine that calls another.
    """
    rows: _Rows = {}
    current: int | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        code = line.split("//")[0].strip()
        match = _BLOCK.fullmatch(code)
        if match is None and _NO_CODE.fullmatch(code):
            continue
        if match is None and current is None:
            raise InputError(f"line {number}: {code!r} stands outside any block")
        try:
            if match is not None:
                current = block_number(match[2])
                rows.setdefault(current, [])
            elif current is not None:
                name, _, rest = code.partition("\t")
                operands = [part.strip() for part in rest.split(",")] if rest else []
                rows[current].append((number, code, instruction(name, operands)))
        except (KeyError, TypeError, ValueError) as problem:
            raise InputError(f"line {number}: {code!r} is no instruction this machine knows") from problem
    _check_calls(rows)
    return _laid_out(rows)


def _check_calls(rows: _Rows) -> None:
    for block, lines in rows.items():
        for number, code, (op, _, wanted, *_) in lines:
            if op in (CALL, ATCH) and wanted not in rows:
                raise InputError(f"line {number}: {code!r} names a block that is not there")
            if op == CALL and (is_subroutine(block) or not is_subroutine(wanted)):
                raise InputError(f"line {number}: {code!r}: only OB1 and interrupts call subroutines here")


def _laid_out(rows: _Rows) -> S7200Program:
    code, begins = array("q"), array("q", [-1] * (1 + max(rows, default=0)))
    for block, lines in rows.items():
        begins[block] = len(code)
        for *_, row in lines:
            code.extend(row)
        code.extend([END] + [0] * (ROW - 1))
    return S7200Program(code, begins)
