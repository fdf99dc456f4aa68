"""The repaired program as a statement list written from its words, with its certificate; and read back.

Only instructions of a CPU 214 are used. V memory: VW0, VW2, VW4 reading and its two predecessors; VW10, VW20 error and
its predecessor; VW24, VW26, VW28 differences and sum; VW30 ticks to go; VW34 setpoint on its ramp, VW36 to VW44 state
of the ramp; VD224 remainder; constants from VW200 (a data block has VW200 to VD220).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from heatertune.plc.core import Sensor, count
from heatertune.plc.cpu.s7_200.assembler import Network, block, count_ticks, program, pwm_registers, timed_interrupt
from heatertune.plc.cpu.s7_200.io_and_cycle import COUNTS, SWITCH, clock, counts_wired, head
from heatertune.plc.cpu.s7_200.readback import DataBlockMemory, LoadedNumber, difference, is_program, loads, statements
from heatertune.plc.print.statements import setpoint_ramp
from heatertune.plc.print.stl import networks, ramp_begins
from heatertune.plc.readback import ReadBack, WordCollector, whole_of, wrong
from heatertune.plc.s7_200.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["COUNTDOWN", "export_words", "from_text", "repaired_program", "setpoint_entry"]


#: ticks to go
COUNTDOWN = "VW30"
#: cells of the setpoint ramp: setpoint asked for and reading, which may change places with it, and its own
_RAMP: Final = {"ASKED": "VW10", "READING": "VW0", "LEAD": "VW34", "CALLS": "VW36", "SIZE": "VW38", "AHEAD": "VW40",
                "BACK": "VW42", "END": "VW44"}


def repaired_program(words: Words, head: Sequence[str] = ()) -> str:
    """Return the program; the same words and head give the same bytes."""
    first = Network("first scan", ["LD SM0.1", "CALL SBR0"])
    return program(
        block("OB1", "PID/PWM heater controller, repaired", [first], head),
        block("SBR0", "constants, PWM on Q0.0, timed interrupt", _initialisation(words)),
        block("INT0", "one PWM cycle: errors, increments, pulse width", _interrupt(words)),
    )


def _initialisation(words: Words) -> list[Network]:
    v = words.whole
    cycle, scale = v["TICK"] * v["TICKS"], v["SCALE"]
    return [
        Network("constants", [
            "LD SM0.0", f"MOVW {v['KP']:+d}, VW200", f"MOVW {v['KI']:+d}, VW202", f"MOVW {v['KD']:+d}, VW204",
            f"MOVW {v['TICKS']:+d}, VW208", f"MOVD {(1 << scale) - 1:+d}, VD212", f"MOVD {1 << (31 - scale):+d}, VD216",
            f"MOVD {cycle:+d}, VD220",
        ]),
        Network("nothing summed up, the first tick computes", [
            "LD SM0.0", "MOVD +0, VD224", "MOVW +0, VW10", f"MOVW +1, {COUNTDOWN}",
        ]),
        Network("process variable: IB0", ["LD SM0.0", "MOVW +0, VW0", "MOVB IB0, VB1"]),
        Network("its bit 0 is wired to I1.0", ["LD I1.0", "= V1.0"]),
        Network("no change of it before the start", ["LD SM0.0", "MOVW VW0, VW2"]),
        *([] if words.ramp is None else [ramp_begins(words.ramp, _RAMP)]),
        pwm_registers(cycle, "16#CB"),
        timed_interrupt(v["TICK"]),
    ]


def _ramped(words: Words) -> list[Network]:
    """Return the networks that put the setpoint on its ramp in the place of the one asked for."""
    if words.ramp is None:
        return []
    follow = Network("set point on its ramp", ["LD SM0.0", f"MOVW {_RAMP['LEAD']}, VW10"])
    return [*networks(setpoint_ramp(words.ramp), _RAMP), follow]


def _interrupt(words: Words) -> list[Network]:
    scale = words.whole["SCALE"]
    return [
        *count_ticks(COUNTDOWN, "VW208"),
        Network("set point: analog adjustment 0; process variable: IB0", [
            "LD SM0.0", "MOVW VW2, VW4", "MOVW VW0, VW2", "MOVW VW10, VW20",
            "MOVW +0, VW10", "MOVB SMB28, VB11", "MOVB IB0, VB1",
        ]),
        Network("its bit 0 is wired to I1.0", ["LD I1.0", "= V1.0"]),
        *_ramped(words),
        Network("error, its change and sum, second difference of the process variable", [
            "LD SM0.0", "-I VW0, VW10", "MOVW VW10, VW24", "-I VW20, VW24", "MOVW VW10, VW26", "+I VW20, VW26",
            "MOVW VW2, VW28", "-I VW0, VW28", "+I VW2, VW28", "-I VW4, VW28",
        ]),
        Network("KP*change + KI*sum + KD*second difference + rest", [
            "LD SM0.0", "MOVW VW24, AC0", "MUL VW200, AC0", "MOVW VW26, AC1", "MUL VW202, AC1", "+D AC1, AC0",
            "MOVW VW28, AC1", "MUL VW204, AC1", "+D AC1, AC0", "+D VD224, AC0",
        ]),
        Network("scaling: shift with sign, keep the rest", [
            "LD SM0.0", "MOVD AC0, VD224", "ANDD VD212, VD224", "XORD 16#80000000, AC0", f"SRD AC0, {scale}",
            "-D VD216, AC0",
        ]),
        Network("pulse width in 32 bits", ["LD SM0.0", "MOVD +0, AC2", "MOVW SMW70, AC2", "+D AC0, AC2"]),
        Network("not above the cycle", ["LDD>= AC2, VD220", "MOVD VD220, AC2"]),
        Network("not below zero", ["LDD<= AC2, +0", "MOVD +0, AC2"]),
        Network("out; the cycle time is loaded once", [
            "LD SM0.0", "MOVW AC2, SMW70", "PLS 0", "MOVB 16#CA, SMB67",
        ]),
    ]


_IN_V: Final = {field.name: field.address for field in FIELDS if field.address.startswith("VW")}
#: the words of a cycle [ms], and of 2^SCALE - 1
_CYCLE: Final = "VD220"
_REST: Final = "VD212"


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a statement list, or in the text of a data block.

    Raises:
        InputError: a bad line, a constant that is missing, there with two values or out of its range.
    """
    collected = WordCollector(source, FIELDS)
    if not is_program(text):
        memory = DataBlockMemory(text, source)
        _from_memory(memory, collected, source)
        return ReadBack(collected.values(), memory.rest)
    loaded = loads(text, source)
    for name, address in {**_IN_V, "TICK": "SMB34"}.items():
        for number in loaded.get(address, ()):
            collected.put(name, number.value, number.line, number.shown)
    for line, name, operands in statements(text):
        if name == "SRD" and operands[0] == "AC0":
            collected.put("SCALE", whole_of(operands[-1]), line, operands[-1])
    return ReadBack(collected.values(), unlike=lambda words: difference(text, repaired_program(words)))


def _from_memory(memory: DataBlockMemory, collected: WordCollector, source: str) -> None:
    for name, address in _IN_V.items():
        _put(collected, name, memory.read(name, address, real=False))
    rest, cycle = memory.read("SCALE", _REST, real=False), memory.read("TICK", _CYCLE, real=False)
    if rest is not None:
        scale = int(rest.value).bit_length()
        if rest.value != (1 << scale) - 1:
            raise wrong(source, rest.line, _REST, rest.shown, "2^SCALE - 1, the part of a sum that is kept")
        collected.put("SCALE", scale, rest.line, rest.shown)
    ticks = memory.read("TICKS", _IN_V["TICKS"], real=False)
    if cycle is not None and ticks is not None:
        if ticks.value <= 0 or cycle.value % ticks.value:
            raise wrong(source, cycle.line, _CYCLE, cycle.shown, f"whole ticks: a multiple of VW208 = {ticks.shown}")
        collected.put("TICK", int(cycle.value // ticks.value), cycle.line, cycle.shown)


def _put(collected: WordCollector, name: str, number: LoadedNumber | None) -> None:
    if number is not None:
        collected.put(name, number.value, number.line, number.shown)


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
