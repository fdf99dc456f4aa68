"""The program around the PID instruction with its certificate in the head, and the loop table as the CPU holds it."""

from __future__ import annotations

from heatertune.plc.cpu.s7_200.wiring import ascii_only
from heatertune.plc.s7_200_pid.image import to_image
from heatertune.plc.s7_200_pid.listing import ASKED, pid_program
from heatertune.plc.s7_200_pid.step import FULL
from heatertune.plc.s7_200_pid.words import SETPOINT, TABLE
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program that was proven, and the loop table in both lengths."""
    s = words.scaling
    head = ascii_only([
        f"sensor {s.low_degC:g}...{s.high_degC:g} degC = 0...{FULL} on AIW0; heater switch on Q0.0",
        f"setpoint as a share of that range in {SETPOINT}" if words.ramp is None
        else f"setpoint asked for in {ASKED}, as an analog input word; its ramp writes {SETPOINT}",
        *certificate.head, "not tried in STEP 7-Micro/WIN",
    ])
    return {
        "s7_200_pid.awl": pid_program(words, head),
        f"VB{TABLE}_36.bin": to_image(words),
        f"VB{TABLE}_80.bin": to_image(words, extended=True),
    }
