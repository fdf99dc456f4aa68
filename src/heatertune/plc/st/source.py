"""A FUNCTION_BLOCK in structured text (IEC 61131-3), as its declarations and its body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from heatertune.plc.cpu.letters import in_ascii

__all__ = ["LARGEST", "BlockSource", "comment", "function_block"]

#: the largest REAL
LARGEST: Final = "3.4028235E38"


class BlockSource(NamedTuple):
    """A block.

    Attributes:
        name: its type.
        declarations: section → (name, type, initial value, meaning).
        body: its statements.
    """

    name: str
    declarations: Mapping[str, tuple[tuple[str, str, str, str], ...]]
    body: str


def comment(*lines: str) -> str:
    """Return comments, one a line: in ASCII, and without the two signs that begin and end a comment."""
    plain = (in_ascii(line).replace("(*", "( *").replace("*)", "* )") for line in lines)
    return "".join(f"(* {line} *)\n" for line in plain)


def function_block(block: BlockSource) -> str:
    """Return the whole declaration, one line per variable."""
    lines = [f"FUNCTION_BLOCK {block.name}"]
    for section, variables in block.declarations.items():
        lines += [section, *[_declared(*variable) for variable in variables], "END_VAR"]
    return "\n".join(lines) + f"\n\n{block.body}\nEND_FUNCTION_BLOCK\n"


def _declared(name: str, type_: str, initial: str, meaning: str) -> str:
    value = f" := {initial}" if initial else ""
    return f"  {name} : {type_}{value}; (* {meaning} *)"
