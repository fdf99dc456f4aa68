"""The repaired program with its certificate in the head."""

from __future__ import annotations

from heatertune.plc.cpu.s7_200.wiring import head
from heatertune.plc.s7_200.listing import repaired_program
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program that was proven, with its certificate in the head."""
    return {"s7_200_program.awl": repaired_program(words, head(words, certificate))}
