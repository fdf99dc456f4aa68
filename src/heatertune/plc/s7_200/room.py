"""The room of the repaired program; its step runs the statement list that is exported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from heatertune.plc.room import Certificate, Room, Scaling, Scan, Timing, Words
from heatertune.plc.s7_200.listing import repaired_program
from heatertune.plc.s7_200.machine import COLD, Program, State, assemble, run
from heatertune.plc.s7_200.wiring import COUNTS, WIDTH_APPLIES, count, head, inputs_of
from heatertune.plc.s7_200.words import FIELDS, TIMER, check_words, cycle_ms, decode, encode

__all__ = ["ROOM", "S7200"]

_INPUTS: Final = {"SP": "BYTE", "PV": "BYTE"}


class _Running(NamedTuple):
    program: Program
    interrupt: str | None  # attached to the timed interrupt
    cycle_ms: int
    next_cycle: bool
    cpu: State = COLD
    begun: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class S7200(Room):
    """See `heatertune.plc.room.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return the PWM cycle: the program computes once in each."""
        cycle = cycle_ms(words) / 1000.0
        return Timing(scan_s=cycle, pwm_period_s=cycle)

    def measure(self, words: Words, temperature_degC: float) -> int:
        """Return the count of the 8-bit input, cut as a converter does, limited to its range."""
        return count(words.scaling, temperature_degC)

    def start(self, words: Words, switches: Mapping[str, str]) -> _Running:
        """Return the state after power-up, the program loaded; `step` is told where its setpoint is on a ramp."""
        program = assemble(repaired_program(replace(words, ramp=None)))
        next_cycle = switches.get("width_applies") == "next_cycle"
        return _Running(program, None, cycle_ms(words), next_cycle)

    def step(
        self, words: Words, state: _Running, setpoint: int, reading: int, switches: Mapping[str, str],
        *, cycle_start: bool = True,
    ) -> tuple[_Running, Scan]:
        """Run the first scan, once, and the timed interrupt in which the program computes."""
        del words, switches, cycle_start
        cpu = state.cpu.written(inputs_of(setpoint, reading))
        if not state.begun:
            cpu = run(state.program, "OB1", cpu.written({"SM0.1": 1})).written({"SM0.1": 0})
            state = state._replace(begun=True, interrupt=dict(cpu.attached).get(10) if cpu.enabled else None)
        before = cpu.width
        if state.interrupt is not None:
            # the ticks before this one do nothing but count VW30 down; a test runs them all
            cpu = run(state.program, state.interrupt, cpu.written({"VW30": 1}))
        width = before if state.next_cycle else cpu.width
        flags = {"SM1.1": cpu.overflow, "SM1.3": cpu.zero_division}
        power = 100.0 * min(width, state.cycle_ms) / state.cycle_ms
        return state._replace(cpu=cpu), Scan(power_pct=power, output=width, flags=flags)

    def scan(self, state: _Running, inputs: Mapping[str, int]) -> tuple[_Running, Scan]:
        """Run one PWM cycle's computation."""
        return self.step(_NO_WORDS, state, inputs["SP"], inputs["PV"], {})


#: the words of a running program are in its state
_NO_WORDS: Final = Words(target="s7-200", values={}, scaling=Scaling(), sample_time_s=1.0)


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program that was proven, with its certificate in the head."""
    return {"s7_200_program.awl": repaired_program(words, head(words, certificate))}


ROOM: Final = S7200(
    name="s7-200",
    title="SIMATIC S7-200 CPU 214, PID/PWM program (Alia, Am. J. Appl. Sci. 4(5), 2007, Table 2), repaired",
    fields=FIELDS,
    switches=(WIDTH_APPLIES,),
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
)
