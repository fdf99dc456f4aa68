"""The room of the PID tip: its four doors under one name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from heatertune.plc.controller import Core, Room, Running, Scan, Timing, Words, count
from heatertune.plc.cpu.s7_300.module import FULL_SCALE
from heatertune.plc.cpu.s7_300.timer import TIMER
from heatertune.plc.s7_300.export import export_words
from heatertune.plc.s7_300.image import from_image, oddities
from heatertune.plc.s7_300.step import COLD, Assumptions, Parameters, State, call, manual
from heatertune.plc.s7_300.words import FIELDS, check_words, decode, encode

__all__ = ["ROOM", "PidTip"]

_INPUTS: Final = {"SP": "INT", "PV": "INT", "mode_req": "BOOL", "OUT": "INT"}


def _step(
    parameters: tuple[Parameters, Assumptions], state: State, setpoint: int, reading: int, _begins: bool
) -> tuple[State, float, int, int]:
    return _told(call(parameters[0], parameters[1], state, setpoint, reading))


def _told(after: State) -> tuple[State, float, int, int]:
    """Return the state, OUT in percent, OUT, and the flag."""
    return after, min(max(100.0 * after.output / FULL_SCALE, 0.0), 100.0), after.output, int(after.overflow)


_CORE: Final = Core(step=_step, measure=count, flags=("overflow",))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PidTip(Room):
    """See `heatertune.plc.controller.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return OB35's interval; the PWM is an actuator behind OUT."""
        return Timing(scan_s=words.sample_time_s)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state after OB100."""
        v = words.values
        parameters = Parameters(gain=v["GAIN"], rate=v["RATE"], reset=v["RESET"], sample=v["SAMPLE"])
        return Running((parameters, assume), COLD)

    def scan(self, state: Running, inputs: Mapping[str, int]) -> tuple[Running, Scan]:
        """Call the block once with SP and PV and, where named, mode_req and what the user wrote to OUT in manual."""
        if inputs.get("mode_req", 1):
            return _CORE.run(state, inputs["SP"], inputs["PV"], cycle_start=True)
        after, *told = _told(manual(state.state, inputs["PV"], inputs.get("OUT", state.state.output)))
        return Running(state.parameters, after), _CORE.told(told)


ROOM: Final = PidTip(
    name="s7-300",
    title="SIMATIC S7-300/400, application tip PID No. 2 (Siemens, V1.0, 11/96)",
    fields=FIELDS,
    assumptions=Assumptions,
    inputs=_INPUTS,
    can=(
        "P, PI, PD and PID in single precision; derivative of the reading, not filtered; I, ID and D with GAIN = 0",
        "exported as a whole STL program, with a setpoint ramp in whole analog values where one is asked for",
    ),
    cannot=(
        "no PWM of its own: a switch behind OUT is proven with it",
        "no feed-forward, no dead band, no derivative filter",
    ),
    counts=FULL_SCALE,
    sample_times_s=TIMER,
    derivative_filter=0.0,
    encode=encode,
    decode=decode,
    check=check_words,
    export=export_words,
    core=_CORE,
    read_image=from_image,
    oddities=oddities,
    ramped=True,
)
