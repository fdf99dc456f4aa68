"""The room of WEG's PID block: its four doors under one name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from heatertune.plc.controller import Core, Number, Room, Running, Scan, Sensor, Timing, Words, count
from heatertune.plc.single import single
from heatertune.plc.weg.export import export_words
from heatertune.plc.weg.step import COLD, Assumptions, Block, Inputs, State, block_of, call
from heatertune.plc.weg.words import FIELDS, TIMER, check_words, decode, encode

__all__ = ["ROOM", "Weg"]

#: highest count of the 12-bit input module that is assumed
_COUNTS: Final = 4095

_INPUTS: Final = {
    "SetPoint": "REAL", "Feedback": "REAL", "ManualSetPoint": "REAL", "SelectSetPoint": "BOOL", "EN": "BOOL",
}


def _step(
    parameters: tuple[Block, Assumptions], state: State, setpoint: float, feedback: float, _begins: bool
) -> tuple[State, float, float, int]:
    automatic = Inputs(setpoint, feedback, setpoint, False, True)  # by hand: nothing, but a REAL like the others
    return _told(parameters[0], call(parameters[0], parameters[1], state, automatic))


def _told(block: Block, after: State) -> tuple[State, float, float, int]:
    """Return the state, Output as power, Output, and the flags as bits."""
    bits = int(after.output >= block.maximum) + 2 * int(after.output <= block.minimum) + 4 * int(after.overflow)
    return after, min(max(after.output, 0.0), 100.0), after.output, bits


def _measure(sensor: Sensor, temperature_degC: float) -> float:
    return single(sensor.low + sensor.span * count(sensor, temperature_degC) / sensor.counts)


_CORE: Final = Core(step=_step, measure=_measure, flags=("upper limit", "lower limit", "overflow"),
                    singles=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weg(Room):
    """See `heatertune.plc.controller.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return Ts; the PWM is an actuator behind Output."""
        return Timing(scan_s=words.sample_time_s)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state before EN has ever been TRUE."""
        return Running((block_of(words.values, assume), assume), COLD)

    def scan(self, state: Running, inputs: Mapping[str, Number]) -> tuple[Running, Scan]:
        """Call the block once with SetPoint, Feedback and, where named, ManualSetPoint, SelectSetPoint and EN."""
        given = Inputs(
            inputs["SetPoint"], inputs["Feedback"], inputs.get("ManualSetPoint", 0.0),
            bool(inputs.get("SelectSetPoint", 0)), bool(inputs.get("EN", 1)),
        )
        block, assume = state.parameters
        after, *told = _told(block, call(block, assume, state.state, given))
        return Running(state.parameters, after), _CORE.told(told)


ROOM: Final = Weg(
    name="weg",
    title="WEG SCA06 Ladder, block PID (WPS help; equation of the CFW501 programming manual V1.8x)",
    fields=FIELDS,
    assumptions=Assumptions,
    inputs=_INPUTS,
    can=(
        "P, PI, PD and PID in single precision, academic or parallel form, direct or reverse action",
        "setpoint filter of first order, limits of the output, manual output, enabling; Ts of 1 to 65535 ms",
        "setpoint ramp by statements before the block's call",
    ),
    cannot=(
        "no derivative filter: noise and steps of the reading reach the output times K*TV/TA",
        "TauSetPoint does not soften a start: the filter begins at the setpoint (the proof tries both readings)",
        "no PWM of its own: a switch behind Output is proven with it",
        "an integral step below half a digit of the sum is lost: a slower Ts makes it larger",
    ),
    counts=_COUNTS,
    sample_times_s=TIMER,
    derivative_filter=0.0,
    encode=encode,
    decode=decode,
    check=check_words,
    export=export_words,
    ramped=True,
    core=_CORE,
)
