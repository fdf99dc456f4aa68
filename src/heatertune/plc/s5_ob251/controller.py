"""The room of OB251: its four doors under one name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from heatertune.plc.controller import Core, Room, Running, Scan, Timing, Words, count
from heatertune.plc.s5_ob251.export import export_words
from heatertune.plc.s5_ob251.image import from_image, oddities
from heatertune.plc.s5_ob251.step import COLD, Assumptions, Parameters, State, call
from heatertune.plc.s5_ob251.words import FACTOR, FIELDS, FULL_SCALE, TIMER, check_words, decode, encode

__all__ = ["ROOM", "Ob251"]

_INPUTS: Final = {"W": "KF", "X": "KF", "Z": "KF", "XZ": "KF", "YH": "KF", "STEU": "KM"}


def _step(
    parameters: tuple[Parameters, Assumptions], state: State, w: int, x: int, _begins: bool
) -> tuple[State, float, int, int]:
    return _told(call(parameters[0], parameters[1], state, w, x, 0, 0))


def _told(after: State) -> tuple[State, float, int, int]:
    """Return the state, YA in percent, YA, and the limits as bits."""
    power = min(max(100.0 * after.output / FULL_SCALE, 0.0), 100.0)
    return after, power, after.output, int(after.at_limit > 0) + 2 * int(after.at_limit < 0)


_CORE: Final = Core(step=_step, measure=count, flags=("upper limit", "lower limit"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ob251(Room):
    """See `heatertune.plc.controller.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return TA; the PWM is an actuator behind YA."""
        return Timing(scan_s=words.sample_time_s)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the cold state: DW18 to DW48 cleared."""
        v = words.whole
        parameters = Parameters(
            gain=v["K"] / FACTOR, r=v["R"] / FACTOR, ti=v["TI"] / FACTOR, td=float(v["TD"]), steu=v["STEU"],
            manual=v["YH"], upper=v["BGOG"], lower=v["BGUG"],
        )
        return Running((parameters, assume), COLD)

    def scan(self, state: Running, inputs: Mapping[str, int]) -> tuple[Running, Scan]:
        """Run OB251 once with W, X and, where named, Z, XZ, YH and STEU."""
        own, assume = state.parameters
        own = own._replace(manual=inputs.get("YH", own.manual), steu=inputs.get("STEU", own.steu))
        z, xz = inputs.get("Z", 0), inputs.get("XZ", 0)
        after, *told = _told(call(own, assume, state.state, inputs["W"], inputs["X"], z, xz))
        return Running(state.parameters, after), _CORE.told(told)


ROOM: Final = Ob251(
    name="s5-ob251",
    title="SIMATIC S5-115U, OB251 (manual 4NEB 811 6130, section 11.2.3)",
    fields=FIELDS,
    assumptions=Assumptions,
    inputs=_INPUTS,
    can=(
        "P, PI and PID; feed-forward of Z; manual with a bumpless return; position or velocity algorithm",
        "derivative of the control error, or of XZ",
        "setpoint ramp: the export brings the function block that moves W",
    ),
    cannot=(
        "no PWM of its own: a switch behind YA is proven with it",
        "TV is a whole multiple of TA; K is limited to ±1500/1024 units per unit with a D part",
    ),
    counts=FULL_SCALE,
    sample_times_s=TIMER,
    derivative_filter=0.5,
    encode=encode,
    decode=decode,
    check=check_words,
    export=export_words,
    read_image=from_image,
    oddities=oddities,
    ramped=True,
    core=_CORE,
)
