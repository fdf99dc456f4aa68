"""The room of the printed program; its step runs the statement list that is exported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from heatertune.plc.controller import Certificate, Core, Room, Running, Scan, Timing, Words, count
from heatertune.plc.cpu.s7_200 import COLD, Program, State, assemble, run
from heatertune.plc.cpu.s7_200.wiring import COUNTS, head, inputs_of
from heatertune.plc.s7_200.words import TIMER
from heatertune.plc.s7_200_paper.faults import faults
from heatertune.plc.s7_200_paper.listing import printed_program
from heatertune.plc.s7_200_paper.step import Assumptions, Constants, Memory, counted, power_pct, rises, scan
from heatertune.plc.s7_200_paper.words import FIELDS, check_words, encode

__all__ = ["ROOM", "PaperProgram"]

#: scans per PWM cycle; real ones are more, which changes nothing between two readings
_SCANS_PER_CYCLE: Final = 5

_INPUTS: Final = {"SP": "BYTE", "PV": "BYTE", "CYCLE_START": "BOOL"}


class _Loaded(NamedTuple):
    program: Program
    constants: Constants


class _Memory(NamedTuple):
    cpu: State
    memory: Memory = Memory()  # of it: the scans counted, the width of the running PWM cycle


def _step(
    loaded: _Loaded, state: _Memory, setpoint: int, reading: int, begins: bool
) -> tuple[_Memory, float, int, int]:
    """Run the interrupt, where Q0.0 has risen and it is attached, and one scan."""
    c, memory = loaded.constants, counted(state.memory)
    cpu, overflow, attached = state.cpu.written(inputs_of(setpoint, reading)), False, dict(state.cpu.attached)
    if rises(c, memory, begins) and cpu.enabled and 0 in attached:
        before = cpu.width
        cpu = run(loaded.program, attached[0], cpu, wrap=c.assume.wrap)
        overflow = cpu.overflow
        memory = memory._replace(applied=before if c.assume.next_cycle else cpu.width)
    cpu = run(loaded.program, "OB1", cpu, wrap=c.assume.wrap).written({"SM0.1": 0})
    bits = int(overflow or cpu.overflow) + 2 * int(cpu.zero_division)
    return _Memory(cpu, memory), power_pct(c, memory.applied), memory.applied, bits


def _direct_step(
    c: Constants, state: Memory, setpoint: int, reading: int, begins: bool
) -> tuple[Memory, float, int, int]:
    """Compute the same without the listing."""
    after = scan(c, state, setpoint, reading, begins)
    return after, power_pct(c, after.applied), after.applied, int(after.overflow) + 2 * int(after.zero_division)


def _direct(words: Words, assume: Assumptions) -> tuple[Core, Running]:
    return _DIRECT, Running(_constants(words, assume), Memory())


_DIRECT: Final = Core(step=_direct_step, measure=count, flags=("SM1.1", "SM1.3"))
_CORE: Final = Core(step=_step, measure=count, flags=("SM1.1", "SM1.3"), compiles=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PaperProgram(Room):
    """See `heatertune.plc.controller.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return the scan interval and the PWM cycle."""
        cycle = words.whole["CYCLE"] / 1000.0
        return Timing(scan_s=cycle / _SCANS_PER_CYCLE, pwm_period_s=cycle)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state before the first scan: all words 0."""
        cpu = COLD.written({"SM0.1": 1, "SMB29": words.whole["POT1"]})
        return Running(_Loaded(assemble(printed_program(words)), _constants(words, assume)), _Memory(cpu))

    def scan(self, state: Running, inputs: Mapping[str, int]) -> tuple[Running, Scan]:
        """Run one scan with SP, PV and, where named, whether a PWM cycle begins."""
        return _CORE.run(state, inputs["SP"], inputs["PV"], cycle_start=bool(inputs.get("CYCLE_START", 1)))


def _constants(words: Words, assume: Assumptions) -> Constants:
    v = words.whole
    return Constants(
        kp=v["KP"], ki=v["KI"], kd=v["KD"], t=v["T"], cycle_ms=v["CYCLE"], pot1=v["POT1"], assume=assume,
    )


def _decode(words: Words) -> None:
    """Return None: what the program makes of its constants is no PID."""
    check_words(words)


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program, its faults and its certificate in the head."""
    lines = [*head(words, certificate), *[f"fault: {fault}" for fault in faults(words)]]
    return {"s7_200_paper.awl": printed_program(words, lines)}


ROOM: Final = PaperProgram(
    name="s7-200-paper",
    title="SIMATIC S7-200 CPU 214, PID/PWM program as printed (Alia, Am. J. Appl. Sci. 4(5), 2007, Table 2)",
    fields=FIELDS,
    assumptions=Assumptions,
    inputs=_INPUTS,
    can=("what the paper prints, its own PWM on Q0.0; for comparison",),
    cannot=(
        "no PID: its P accumulates, its D acts as P",
        "no setpoint 128 counts or more above the reading: the error word wraps",
        "no setpoint ramp: the program is exported as the paper prints it",
    ),
    counts=COUNTS,
    sample_times_s=TIMER,
    derivative_filter=0.5,
    encode=encode,
    decode=_decode,
    check=check_words,
    export=_export,
    core=_CORE,
    direct=_direct,
    faults=faults,
)
