"""How the paper wires the CPU 214 (Table 1, Fig. 2): an 8-bit converter on the inputs, the heater's switch on Q0.0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from heatertune.plc.cpu.s7_200.memory import cell
from heatertune.plc.cpu.statements import in_ascii
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.words import Certificate, Scaling, Words

__all__ = ["COUNTS", "SWITCH", "WIDTH_APPLIES", "clock", "counts_wired", "head", "ms_per_count", "wire"]

#: highest reading of the 8-bit temperature input and of the analog adjustment SMB28
COUNTS: Final = 255
_INPUTS: Final = cell("IB0", 1).start
_ADJUSTMENT_0: Final = cell("SMB28", 1).start

WIDTH_APPLIES: Final = OpenPoint(
    name="width_applies", means={"this_cycle": False, "next_cycle": True},
    reason="whether a width written at the start of a PWM cycle applies to that cycle or to the next one",
)


def wire(memory: bytearray, setpoint: int, reading: int) -> None:
    """Write what the CPU reads: PV on I0.1 to I0.7 and, bit 0, I1.0; I0.0 takes back Q0.0; SP on adjustment 0."""
    memory[_INPUTS] = reading & 0xFE | 1
    memory[_INPUTS + 1] = memory[_INPUTS + 1] & 0xFE | reading & 1
    memory[_ADJUSTMENT_0] = setpoint & 0xFF


def ms_per_count(scaling: Scaling, cycle: int) -> float:
    """Return the width [ms] per count that a gain of 1 %/°C asks for, the PWM cycle being so long [ms]."""
    return cycle / 100.0 * scaling.span_degC / COUNTS


def counts_wired(words: Words) -> list[str]:
    """Return what an 8-bit converter and an analog adjustment mean, for the head of an exported program."""
    s = words.scaling
    return [
        f"sensor {s.low_degC:g}...{s.high_degC:g} degC = 0...{COUNTS} counts on I0.1-I0.7, I1.0 (bit 0)",
        "setpoint in counts on analog adjustment 0; heater switch on Q0.0",
    ]


def head(facts: Sequence[str], certificate: Certificate, by_hand: Sequence[str]) -> list[str]:
    """Return the comment lines that an exported program begins with, ASCII: they read the same in any code page.

    Args:
        facts: about inputs, outputs and clock.
        certificate: of the proof.
        by_hand: what is left to do, a step each.
    """
    steps = [f"{number}. {step}" for number, step in enumerate(by_hand, start=1)]
    lines = [*facts, *certificate.head, "not tried in STEP 7-Micro/WIN", *(["to do by hand:", *steps] if steps else [])]
    return [in_ascii(line) for line in lines]


def clock(values: Mapping[str, int]) -> str:
    """Return how the program keeps its time, for its head; `values` are TICK and TICKS."""
    cycle = values["TICK"] * values["TICKS"] / 1000.0
    return (f"TA and PWM cycle {cycle:g} s: {values['TICKS']} timed interrupts of {values['TICK']} ms; "
            "pulse width in steps of 1 ms")


#: steps that every program with its PWM on Q0.0 leaves
SWITCH: Final = (
    "wire the heater's switch to Q0.0, a transistor output: a solid-state relay, no contactor for short cycles",
    "system block, output table: Q0.0 off in STOP",
)
