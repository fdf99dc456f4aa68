"""Statement list as STEP 7-Micro/WIN exports it → blocks of instructions."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200.cpu import Action, Program
from heatertune.plc.cpu.s7_200.instructions import instruction

__all__ = ["assemble"]

_BLOCK: Final = re.compile(r"(ORGANIZATION|SUBROUTINE|INTERRUPT)_BLOCK \w+:(\w+)")
_NO_CODE: Final = re.compile(r"BEGIN|TITLE=.*|Network \d+|END_\w+_BLOCK|")


@lru_cache(maxsize=64)
def assemble(text: str) -> Program:
    """Return block name (OB1, SBR0, INT0) → instructions.

    Raises:
        InputError: a line that is no known instruction, by its number, or one outside any block.
    """
    blocks: dict[str, list[Action]] = {}
    current: list[Action] | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        code = line.split("//")[0].strip()
        if match := _BLOCK.fullmatch(code):
            current = blocks.setdefault(match[2], [])
        elif not _NO_CODE.fullmatch(code):
            name, _, rest = code.partition("\t")
            operands = [part.strip() for part in rest.split(",")] if rest else []
            if current is None:
                raise InputError(f"line {number}: {code!r} stands outside any block")
            try:
                current.append(instruction(name, operands))
            except (KeyError, TypeError, ValueError) as problem:
                raise InputError(f"line {number}: {code!r} is no instruction this machine knows") from problem
    return {name: tuple(actions) for name, actions in blocks.items()}
