"""The program around the PID instruction with its certificate in the head, and the loop table as the CPU holds it."""

from __future__ import annotations

from heatertune.plc.cpu.s7_200.wiring import SWITCH, clock, head
from heatertune.plc.inputs import INPUTS, module
from heatertune.plc.s7_200_pid.image import to_image
from heatertune.plc.s7_200_pid.listing import SETPOINT_INPUT, in_degrees, least_good, pid_program
from heatertune.plc.s7_200_pid.step import STEP, measure
from heatertune.plc.s7_200_pid.words import FULL, RANGES, SETPOINT, TABLE
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "setpoint_entry"]


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program that was proven, and the loop table in both lengths."""
    s = words.scaling
    least = least_good(words)
    low, high = s.sensor_degC
    begins, range_ = ("0", "that range") if least is None else (
        "4...20 mA = 6400", f"0...{FULL}, which is {s.low_degC:g}...{s.high_degC:g} degC,")
    facts = [
        f"sensor {low:g}...{high:g} degC = {begins}...{FULL} on AIW0; heater switch on Q0.0",
        f"setpoint as a share of {range_} in {SETPOINT}" if words.ramp is None
        else f"setpoint asked for in {SETPOINT_INPUT}, as an analog input word; its ramp writes {SETPOINT}",
        clock(words.whole),
    ]
    lines = head(facts, certificate, _by_hand(words, certificate))
    return {
        "s7_200_pid.awl": pid_program(words, lines),
        f"VB{TABLE}_36.bin": to_image(words),
        f"VB{TABLE}_80.bin": to_image(words, extended=True),
    }


def _by_hand(words: Words, certificate: Certificate) -> list[str]:
    place, asked = SETPOINT if words.ramp is None else SETPOINT_INPUT, certificate.setpoint_degC
    shown = place
    if asked is not None:
        word = measure(module(words.scaling, FULL // STEP, RANGES), asked)
        shown = f"{place} = {word / FULL if words.ramp is None else word:.9g}, the proven {asked:g} degC"
    return [
        f"CPU 22x; analog input module: the first input, {_range(words)}, is AIW0",
        "system block: analog input filter off for AIW0, for the proof reads without it",
        *SWITCH,
        f"enter the setpoint: {shown}; another one is not proven, and 0 is what a lost memory leaves",
        _seen(words),
    ]


def _range(words: Words) -> str:
    """Return how the analog input is to be set up."""
    if in_degrees(words):
        return (f"an EM231 for {INPUTS[words.scaling.input or '']} (0.1 degC per digit; switches: its type, degC, "
                "open-wire detection on)")
    return ("0...32000 unipolar = the sensor range" if least_good(words) is None else
            "0 to 20 mA = 0...32000 unipolar, for a transmitter of 4 to 20 mA")


def _seen(words: Words) -> str:
    """Return which broken wires the program sees."""
    if in_degrees(words):
        return ("a broken wire and a missing supply (32766 and more, -32767 and less) put the heater off; try it out. "
                "An EM231 with a fault of its own gives 0: a limiter must cut the heater")
    least = least_good(words)
    return ("a broken wire is seen where the module gives 32766 and more or -32767 and less (EM231), and a "
            "transmitter's with --input 4-20mA; else a limiter must cut the heater" if least is None else
            f"a broken wire, a current below 3.6 mA (AIW0 below {least}), puts the heater off; try it out")


def setpoint_entry(words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"{SETPOINT} = {units / FULL:.9g}" if words.ramp is None else f"{SETPOINT_INPUT} = {units}"
