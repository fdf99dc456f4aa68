"""A FUNCTION_BLOCK in structured text (IEC 61131-3), as its declarations and its body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

__all__ = ["LARGEST", "Source", "function_block"]

#: the largest REAL
LARGEST: Final = "3.4028235E38"


class Source(NamedTuple):
    """A block.

    Attributes:
        name: its type.
        declarations: section → (name, type, initial value, meaning).
        body: its statements.
    """

    name: str
    declarations: Mapping[str, tuple[tuple[str, str, str, str], ...]]
    body: str


def function_block(block: Source) -> str:
    """Return the whole declaration, one line per variable."""
    lines = [f"FUNCTION_BLOCK {block.name}"]
    for section, variables in block.declarations.items():
        lines += [section, *[_declared(*variable) for variable in variables], "END_VAR"]
    return "\n".join(lines) + f"\n\n{block.body}\nEND_FUNCTION_BLOCK\n"


def _declared(name: str, type_: str, initial: str, meaning: str) -> str:
    value = f" := {initial}" if initial else ""
    return f"  {name} : {type_}{value}; (* {meaning} *)"
