"""The repaired program, with its certificate and what is left to do by hand in the head."""

from __future__ import annotations

from heatertune.plc.core import Sensor, count
from heatertune.plc.cpu.s7_200.wiring import COUNTS, SWITCH, clock, counts_wired, head
from heatertune.plc.s7_200.listing import repaired_program
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "setpoint_entry"]


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program that was proven, with its certificate in the head."""
    lines = head([*counts_wired(words), clock(words.whole)], certificate, _by_hand(words, certificate))
    return {"s7_200_program.awl": repaired_program(words, lines)}


def _by_hand(words: Words, certificate: Certificate) -> list[str]:
    asked = certificate.setpoint_degC
    sensor = Sensor(words.scaling.low_degC, words.scaling.span_degC, COUNTS)
    shown = "shows the setpoint" if asked is None else f"= {count(sensor, asked)}, the proven {asked:g} degC"
    return [
        "wire the converter's bits 1 to 7 to I0.1...I0.7 and its bit 0 to I1.0",
        *SWITCH,
        f"turn analog adjustment 0 until SMB28 {shown}; another one is not proven",
        "an open sensor is not seen by an 8-bit input: cut the heater by a limiter of its own",
    ]


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"SMB28 = {units} (analog adjustment 0)"
