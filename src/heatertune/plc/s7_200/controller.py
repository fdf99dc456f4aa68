"""The repaired program: its constants, its step, once per PWM cycle, and the statement list written and read back.

The interrupt adds to the pulse width, as the paper's does; so network 6 delivers the increments of the paper's
equation, KP·ΔE + KI·(E + E_prev) − KD·Δ²PV, in counts and 32 bits, and the rest of the scaling is carried to the next
cycle.

Only instructions of a CPU 214 are used. V memory: VW0, VW2, VW4 reading and its two predecessors; VW10, VW20 error and
its predecessor; VW24, VW26, VW28 differences and sum; VW30 ticks to go; VW34 setpoint on its ramp, VW36 to VW44 state
of the ramp; VD224 remainder; constants from VW200 (a data block has VW200 to VD220).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, ClassVar, Final, NamedTuple

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, Sensor, StepFunctions, count
from heatertune.plc.cpu.s7_200 import COLD, S7200State, assemble
from heatertune.plc.cpu.s7_200.assembler import Network, block, count_ticks, program, pwm_registers, timed_interrupt
from heatertune.plc.cpu.s7_200.io_and_cycle import (
    COUNTS,
    MOST,
    SWITCH,
    TICK_FIELDS,
    TIMER,
    WIDTH_APPLIES,
    TimedProgram,
    check_cycle,
    clock,
    cold_start,
    counts_wired,
    cycle_ms,
    cycle_s,
    head,
    ms_per_count,
    own,
    run_cycle,
    ticks_of,
    timed_program,
    warm_start,
    whole_cycle,
    wire,
)
from heatertune.plc.cpu.s7_200.readback import DataBlockMemory, LoadedNumber, difference, is_program, loads, statements
from heatertune.plc.print.statements import setpoint_ramp
from heatertune.plc.print.stl import networks, ramp_begins
from heatertune.plc.readback import ReadBack, WordCollector, whole_of, wrong
from heatertune.plc.words import Certificate, Scaling, WordField, Words, round_half_away

__all__ = [
    "COUNTDOWN", "FIELDS", "S7200", "S7200ManualAssumptions", "design_of", "export_words", "from_text", "most_gain",
    "repaired_program", "setpoint_entry", "step", "values_of",
]


_FINEST: Final = 16

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="KP", address="VW200", format="INT", low=-MOST, high=MOST, comment="of the change of the error"),
    WordField(name="KI", address="VW202", format="INT", low=-MOST, high=MOST, comment="of the sum of two errors"),
    WordField(name="KD", address="VW204", format="INT", low=-MOST, high=MOST, comment="of the second difference of PV"),
    WordField(name="SCALE", address="SRD", format="BYTE", low=1, high=_FINEST,
              comment="constants are in ms/2^SCALE per count"),
    *TICK_FIELDS,
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, int]:
    """Return the constants nearest to a PI or PID design, TA being the PWM cycle; each is rounded once.

    The scaling takes as many bits as the largest constant leaves room for.

    Raises:
        NotRepresentable: no integral part, constants too large or too small.
    """
    ta = design.sample_time_s
    if math.isinf(design.integral_time_s):
        raise NotRepresentable("integral-action time TN", design.integral_time_s, "finite: the program accumulates",
                               "tune --structure pi would fit")
    cycle = whole_cycle(ta)
    proportional = ms_per_count(scaling, cycle) * design.gain_pct_per_degC
    exact = {name: share * proportional for name, share in _shares(design).items()}
    scale = min(_FINEST, math.floor(math.log2((MOST + 0.5) / max(map(abs, exact.values())))))
    if scale < 1:
        worst = max(exact, key=lambda name: abs(exact[name]))
        raise NotRepresentable(f"constant {worst}", 2.0 * exact[worst], f"up to {MOST}", "a smaller K would fit")
    values = {name: round_half_away(value * 2.0**scale) for name, value in exact.items()}
    for name, exact_value in exact.items():
        if values[name] == 0 and exact_value != 0.0:
            remedy = "a slower TA would fit"
            raise NotRepresentable(f"constant {name}", exact_value * 2.0**scale, "at least 1 in size", remedy)
    return values | {"SCALE": scale, **ticks_of(cycle)}


def most_gain(scaling: Scaling, design: PidDesign) -> float:
    """Return the largest K whose constants are words at the coarsest scaling [%/°C]."""
    per_gain = ms_per_count(scaling, round(1000.0 * design.sample_time_s)) * max(_shares(design).values())
    return MOST / 2.0 / per_gain


def _shares(design: PidDesign) -> dict[str, float]:
    """Return the constants as multiples of the proportional part."""
    half = design.sample_time_s / design.integral_time_s / 2.0
    return {"KP": 1.0 + half, "KI": half, "KD": design.derivative_time_s / design.sample_time_s}


def design_of(words: Words) -> PidDesign:
    """Return the design that the repaired program runs with these constants.

    Raises:
        OutOfRange: KP = KI, which leaves no proportional part.
    """
    v, ta = words.whole, words.sample_time_s
    unit = 2.0 ** -v["SCALE"] / ms_per_count(words.scaling, cycle_ms(v))
    proportional = v["KP"] - v["KI"]  # the sum E + E_prev is 2·E less the change
    if proportional == 0:
        raise OutOfRange("word KP", v["KP"], "not KI: the standard form needs a P part")
    tn = math.inf if v["KI"] == 0 else ta * proportional / (2 * v["KI"])
    tv = ta * v["KD"] / proportional
    return PidDesign(
        gain_pct_per_degC=proportional * unit, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
        structure=structure_of(tn, tv), method="as the constants of the repaired program realise it",
        derivative_filter=0.0,
    )


class S7200ManualAssumptions(NamedTuple):
    """The open points of the manual, see DIFFERENCES.md."""

    next_cycle: Annotated[bool, WIDTH_APPLIES] = False


def step(timed: TimedProgram, state: S7200State, setpoint: int, reading: int, _begins: bool) -> tuple[S7200State, float,
                                                                                                      int, int]:
    """Compute one PWM cycle by the statement list, see `heatertune.plc.core.StepFunctions`.

    Args:
        timed: the program.
        state: of the CPU before the cycle; its memory is changed.
        setpoint: a byte.
        reading: a byte.
        _begins: not looked at: each scan is a whole PWM cycle.
    """
    wire(state.memory, setpoint, reading)
    power, width, faults = run_cycle(timed, state.memory)
    return state, power, width, faults


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
    degC = certificate.setpoint_degC
    sensor = Sensor(words.scaling.low_degC, words.scaling.span_degC, COUNTS)
    shown = "shows the setpoint" if degC is None else f"= {count(sensor, degC)}, the proven {degC:g} degC"
    return [
        "wire the converter's bits 1 to 7 to I0.1...I0.7 and its bit 0 to I1.0",
        *SWITCH,
        f"turn analog adjustment 0 until SMB28 {shown}; another one is not proven",
        "an open sensor is not seen by an 8-bit input: cut the heater by a limiter of its own",
    ]


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"SMB28 = {units} (analog adjustment 0)"


_FLAGS = ("SM1.1", "SM1.3")


class S7200(Controller, name="s7-200"):
    """The paper's PID/PWM program, repaired: whole numbers; the program computes once in each PWM cycle."""

    title = "SIMATIC S7-200 CPU 214, PID/PWM program (Alia, Am. J. Appl. Sci. 4(5), 2007, Table 2), repaired"
    main_file = "s7_200_program.awl"
    setpoint_entry = staticmethod(setpoint_entry)
    can = (
        "PI and PID in whole numbers, D on the process variable; its own PWM on Q0.0 of 0.1 to 32.7 s",
        "free of overflow for every pair of setpoint and reading", "setpoint ramp in whole counts",
    )
    cannot = ("no P alone: the pulse width accumulates", "8-bit readings, no manual mode")
    fields, assumptions, timer, counts = FIELDS, S7200ManualAssumptions, TIMER, COUNTS
    inputs: ClassVar = {"SP": "BYTE", "PV": "BYTE"}
    derivative_filter = 0.0
    scans_per_period = 1
    integers = ("KP", "KI", "KD")
    has_ramp = True
    core = StepFunctions(step=step, measure=count, flags=_FLAGS, own=own, cold_start=cold_start, warm_start=warm_start)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(check_cycle)
    interval_s, export = staticmethod(cycle_s), staticmethod(export_words)
    most_gain, text = staticmethod(most_gain), staticmethod(from_text)

    def begin(self, words: Words, assume: S7200ManualAssumptions) -> ControllerState:
        """Return the state after power-up, the program loaded; `step` is told where its setpoint is on a ramp."""
        program = assemble(repaired_program(replace(words, ramp=None)))
        return ControllerState(timed_program(program, words.whole, COUNTDOWN, next_cycle=assume.next_cycle), COLD)
