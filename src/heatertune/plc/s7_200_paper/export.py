"""The printed program with its certificate and its faults in the head."""

from __future__ import annotations

from heatertune.plc.cpu.s7_200.wiring import counts_wired, head
from heatertune.plc.s7_200_paper.faults import faults
from heatertune.plc.s7_200_paper.listing import printed_program
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "setpoint_entry"]


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program, its faults and its certificate in the head."""
    lines = [*head(counts_wired(words), certificate, ()), *[f"fault: {fault}" for fault in faults(words)]]
    return {"s7_200_paper.awl": printed_program(words, lines)}


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"SMB28 = {units} (analog adjustment 0)"
