"""The room of the PID instruction; its step runs the statement list that is exported."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from heatertune.plc.controller import Certificate, Core, Room, Running, Scan, Sensor, Timing, Words
from heatertune.plc.cpu.s7_200 import COLD, Program, State, assemble, run
from heatertune.plc.cpu.s7_200.wiring import ascii_only
from heatertune.plc.s7_200.words import TIMER, cycle_ms
from heatertune.plc.s7_200_pid.image import from_image, oddities, to_image
from heatertune.plc.s7_200_pid.listing import ASKED, SETPOINT, pid_program
from heatertune.plc.s7_200_pid.step import Assumptions, Memory, Table, cycled
from heatertune.plc.s7_200_pid.words import FIELDS, TABLE, check_words, decode, encode
from heatertune.plc.single import divided

__all__ = ["ROOM", "S7200Pid"]

_FULL: Final = 32000  # analog input word at the end of the range
_STEP: Final = 8  # a converter of 12 bits, left-justified

_INPUTS: Final = {"SP": "INT", "PV": "INT"}


class _Loaded(NamedTuple):
    program: Program
    cycle_ms: int
    assume: Assumptions


class _Memory(NamedTuple):
    cpu: State = COLD
    begun: bool = False


def _step(
    loaded: _Loaded, state: _Memory, setpoint: int, reading: int, _begins: bool
) -> tuple[_Memory, float, int, int]:
    """Run the first scan, once, and the timed interrupt in which the loop is called."""
    cpu = state.cpu
    if not state.begun:
        cpu = run(loaded.program, "OB1", cpu.written({"SM0.1": 1})).written({"SM0.1": 0})
    before = cpu.width
    inputs = {"AIW0": reading, SETPOINT: _bits(divided(float(setpoint), float(_FULL)))}
    # the ticks before this one do nothing but count down
    cpu = run(loaded.program, "INT0", cpu.written(inputs | {"VW90": 1}), bumpless=loaded.assume.bumpless)
    width = before if loaded.assume.next_cycle else cpu.width
    power = 100.0 * min(width, loaded.cycle_ms) / loaded.cycle_ms
    return _Memory(cpu, True), power, width, int(cpu.overflow)


def _measure(sensor: Sensor, temperature_degC: float) -> int:
    share = (temperature_degC - sensor.low) / sensor.span
    return _STEP * int(min(max(share * sensor.counts, 0.0), float(sensor.counts)))


def _direct_step(
    p: tuple[Table, int, Assumptions], state: Memory, setpoint: int, reading: int, _begins: bool
) -> tuple[Memory, float, int, int]:
    """Compute the same without the listing."""
    table, cycle, assume = p
    after = cycled(table, cycle, state, divided(float(setpoint), float(_FULL)), _share(reading), assume.bumpless)
    width = state.width if assume.next_cycle else after.width
    return after, 100.0 * min(width, cycle) / cycle, width, int(after.overflow)


def _share(reading: int) -> float:
    return divided(float(reading), float(_FULL))


def _direct(words: Words, assume: Assumptions) -> tuple[Core, Running]:
    v = words.values
    return _DIRECT, Running((Table(v["KC"], v["TS"], v["TI"], v["TD"]), cycle_ms(words), assume), Memory())


_DIRECT: Final = Core(step=_direct_step, measure=_measure, flags=("SM1.1",))
_CORE: Final = Core(step=_step, measure=_measure, flags=("SM1.1",), compiles=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class S7200Pid(Room):
    """See `heatertune.plc.controller.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return the PWM cycle: the loop is called once in each."""
        cycle = cycle_ms(words) / 1000.0
        return Timing(scan_s=cycle, pwm_period_s=cycle)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state after power-up, the program loaded; `step` is told where its setpoint is on a ramp."""
        program = assemble(pid_program(replace(words, ramp=None)))
        return Running(_Loaded(program, cycle_ms(words), assume), _Memory())

    def scan(self, state: Running, inputs: Mapping[str, int]) -> tuple[Running, Scan]:
        """Run one sampling interval."""
        return _CORE.run(state, inputs["SP"], inputs["PV"], cycle_start=True)


def _bits(value: float) -> int:
    return int.from_bytes(struct.pack(">f", value), "big")


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program that was proven, and the loop table in both lengths."""
    s = words.scaling
    head = ascii_only([
        f"sensor {s.low_degC:g}...{s.high_degC:g} degC = 0...{_FULL} on AIW0; heater switch on Q0.0",
        f"setpoint as a share of that range in {SETPOINT}" if words.ramp is None
        else f"setpoint asked for in {ASKED}, as an analog input word; its ramp writes {SETPOINT}",
        *certificate.head, "not tried in STEP 7-Micro/WIN",
    ])
    return {
        "s7_200_pid.awl": pid_program(words, head),
        f"VB{TABLE}_36.bin": to_image(words),
        f"VB{TABLE}_80.bin": to_image(words, extended=True),
    }


ROOM: Final = S7200Pid(
    name="s7-200-pid",
    title="SIMATIC S7-200, PID instruction (System Manual C79000-G7076-C233-01, pp. 9-84 to 9-91)",
    fields=FIELDS,
    assumptions=Assumptions,
    inputs=_INPUTS,
    can=(
        "P, PI and PID in single precision, D on the process variable; its own PWM on Q0.0 of 0.1 to 32.7 s",
        "bias clamped with the output: no windup", "setpoint ramp in whole input words",
    ),
    cannot=("not on a CPU 212 or 214; no manual mode in this program", "no filter of the derivative"),
    counts=_FULL // _STEP,
    sample_times_s=TIMER,
    derivative_filter=0.0,
    encode=encode,
    decode=decode,
    check=check_words,
    export=_export,
    core=_CORE,
    direct=_direct,
    read_image=from_image,
    oddities=oddities,
    ramped=True,
)
