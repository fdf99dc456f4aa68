"""How the paper wires the CPU 214 (Table 1, Fig. 2): an 8-bit converter on the inputs, the heater's switch on Q0.0."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from heatertune.plc.cpu.s7_200.cells import cell
from heatertune.plc.open_points import Switch
from heatertune.plc.words import Certificate, Scaling, Words

__all__ = ["COUNTS", "WIDTH_APPLIES", "ascii_only", "head", "ms_per_count", "wire"]

#: highest reading of the 8-bit temperature input and of the analog adjustment SMB28
COUNTS: Final = 255
_INPUTS: Final = cell("IB0", 1).start
_ADJUSTMENT_0: Final = cell("SMB28", 1).start

WIDTH_APPLIES: Final = Switch(
    name="width_applies", means={"this_cycle": False, "next_cycle": True},
    why="whether a width written at the start of a PWM cycle shapes that cycle or the one after",
)


def wire(memory: bytearray, setpoint: int, reading: int) -> None:
    """Write what the CPU reads: PV on I0.1 to I0.7 and, bit 0, I1.0; I0.0 takes back Q0.0; SP on adjustment 0."""
    memory[_INPUTS] = reading & 0xFE | 1
    memory[_INPUTS + 1] = memory[_INPUTS + 1] & 0xFE | reading & 1
    memory[_ADJUSTMENT_0] = setpoint & 0xFF


def ms_per_count(scaling: Scaling, cycle: int) -> float:
    """Return the width [ms] per count that a gain of 1 %/°C asks for, the PWM cycle being so long [ms]."""
    return cycle / 100.0 * scaling.span_degC / COUNTS


def head(words: Words, certificate: Certificate) -> list[str]:
    """Return the comment lines that an exported program begins with."""
    s = words.scaling
    return ascii_only([
        f"sensor {s.low_degC:g}...{s.high_degC:g} degC = 0...{COUNTS} counts on I0.1-I0.7, I1.0 (bit 0)",
        "setpoint in counts on analog adjustment 0; heater switch on Q0.0",
        *certificate.head,
        "not tried in STEP 7-Micro/WIN",
    ])


def ascii_only(lines: Sequence[str]) -> list[str]:
    """Return lines that read the same in any code page of Windows: what is not ASCII becomes a question mark."""
    return [line.encode("ascii", "replace").decode("ascii") for line in lines]
