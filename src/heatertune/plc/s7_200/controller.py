"""The room of the repaired program; its step runs the statement list that is exported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Final, NamedTuple

from heatertune.plc.controller import Certificate, Core, Room, Running, Scan, Timing, Words, count
from heatertune.plc.cpu.s7_200 import COLD, Program, State, assemble, run
from heatertune.plc.cpu.s7_200.wiring import COUNTS, WIDTH_APPLIES, head, inputs_of
from heatertune.plc.s7_200.listing import repaired_program
from heatertune.plc.s7_200.step import Constants, Memory, cycle
from heatertune.plc.s7_200.words import FIELDS, TIMER, check_words, cycle_ms, decode, encode

__all__ = ["ROOM", "S7200", "Assumptions"]

_INPUTS: Final = {"SP": "BYTE", "PV": "BYTE"}


class Assumptions(NamedTuple):
    """What the manual leaves open, see DIFFERENCES.md."""

    next_cycle: Annotated[bool, WIDTH_APPLIES] = False


class _Loaded(NamedTuple):
    program: Program
    cycle_ms: int
    assume: Assumptions


class _Memory(NamedTuple):
    cpu: State = COLD
    interrupt: str | None = None  # attached to the timed interrupt
    begun: bool = False


def _step(
    loaded: _Loaded, state: _Memory, setpoint: int, reading: int, _begins: bool
) -> tuple[_Memory, float, int, int]:
    """Run the first scan, once, and the timed interrupt in which the program computes."""
    cpu, interrupt = state.cpu.written(inputs_of(setpoint, reading)), state.interrupt
    if not state.begun:
        cpu = run(loaded.program, "OB1", cpu.written({"SM0.1": 1})).written({"SM0.1": 0})
        interrupt = dict(cpu.attached).get(10) if cpu.enabled else None
    before = cpu.width
    if interrupt is not None:
        # the ticks before this one do nothing but count VW30 down; a test runs them all
        cpu = run(loaded.program, interrupt, cpu.written({"VW30": 1}))
    width = before if loaded.assume.next_cycle else cpu.width
    power = 100.0 * min(width, loaded.cycle_ms) / loaded.cycle_ms
    return _Memory(cpu, interrupt, True), power, width, int(cpu.overflow) + 2 * int(cpu.zero_division)


def _direct_step(
    p: tuple[Constants, Assumptions], state: Memory, setpoint: int, reading: int, _begins: bool
) -> tuple[Memory, float, int, int]:
    """Compute the same without the listing, which never overflows."""
    c, assume = p
    after = cycle(c, state, setpoint & 0xFF, reading & 0xFF)
    width = state.width if assume.next_cycle else after.width
    return after, 100.0 * min(width, c.cycle_ms) / c.cycle_ms, width, 0


def _direct(words: Words, assume: Assumptions) -> tuple[Core, Running]:
    v = words.whole
    constants = Constants(v["KP"], v["KI"], v["KD"], v["SCALE"], cycle_ms(words))
    return _DIRECT, Running((constants, assume), Memory())


_DIRECT: Final = Core(step=_direct_step, measure=count, flags=("SM1.1", "SM1.3"))
_CORE: Final = Core(step=_step, measure=count, flags=("SM1.1", "SM1.3"), compiles=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class S7200(Room):
    """See `heatertune.plc.controller.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return the PWM cycle: the program computes once in each."""
        cycle = cycle_ms(words) / 1000.0
        return Timing(scan_s=cycle, pwm_period_s=cycle)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state after power-up, the program loaded; `step` is told where its setpoint is on a ramp."""
        program = assemble(repaired_program(replace(words, ramp=None)))
        return Running(_Loaded(program, cycle_ms(words), assume), _Memory())

    def scan(self, state: Running, inputs: Mapping[str, int]) -> tuple[Running, Scan]:
        """Run one PWM cycle's computation."""
        return _CORE.run(state, inputs["SP"], inputs["PV"], cycle_start=True)


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program that was proven, with its certificate in the head."""
    return {"s7_200_program.awl": repaired_program(words, head(words, certificate))}


ROOM: Final = S7200(
    name="s7-200",
    title="SIMATIC S7-200 CPU 214, PID/PWM program (Alia, Am. J. Appl. Sci. 4(5), 2007, Table 2), repaired",
    fields=FIELDS,
    assumptions=Assumptions,
    inputs=_INPUTS,
    can=(
        "PI and PID in whole numbers, D on the process variable; its own PWM on Q0.0 of 0.1 to 32.7 s",
        "free of overflow for every pair of setpoint and reading", "setpoint ramp in whole counts",
    ),
    cannot=("no P alone: the pulse width accumulates", "8-bit readings, no manual mode"),
    counts=COUNTS,
    sample_times_s=TIMER,
    derivative_filter=0.0,
    encode=encode,
    decode=decode,
    check=check_words,
    export=_export,
    ramped=True,
    core=_CORE,
    direct=_direct,
)
