"""The program that clears OB251's memory at a start-up, as a statement list to key in.

A data block keeps its words over a loss of supply (battery) and over STOP, so OB251 would go on with the sum of before;
what was proven is the cold controller.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.words import Certificate

__all__ = ["start_up_listing"]

_BLOCK: Final = 31


def start_up_listing(db: int, certificate: Certificate) -> str:
    """Return the listing of the function block and of its calls, for the controller DB of this number."""
    head = [
        f"FB{_BLOCK}: clears what OB251 keeps in DW18 to DW48 of DB{db}; nothing is proven without it",
        f"JU FB{_BLOCK} in OB21 (STOP to RUN) and in OB22 (supply back), before X is written to DW22",
        "bit 2 of STEU (DW11): OB251 off, memory cleared",
        *certificate.head,
    ]
    block = [f"C  DB {db}", "SU D 11.2", "JU OB 251", "RU D 11.2", "BE"]
    call = [f"JU FB {_BLOCK}", "BE"]
    calls = [line for number in (21, 22) for line in ("", f"OB {number}", *_columns(call))]
    lines = [*(f"// {line}" for line in head), f"FB {_BLOCK}", "NAME :START", *_columns(block), *calls]
    return "\n".join(lines) + "\n"


def _columns(statements: list[str]) -> list[str]:
    return [f"     :{statement}" for statement in statements]
