"""A room as the known controller of a log: handed to the fit, then closed around the fitted heater as a check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from heatertune.errors import OutOfRange
from heatertune.log.values import Log
from heatertune.model.statistics import fit_pct
from heatertune.model.values import FittedModel
from heatertune.plc import Controller, Words, controller_for
from heatertune.plc.replay import powers
from heatertune.proof import Actuator, Scenario, simulate
from heatertune.proof.prove import settings_to_prove

__all__ = ["RoomController", "closed_again", "controllers"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RoomController:
    """A room with its words and one setting of its open points; see `heatertune.model.power.known_controller`."""

    room: Controller
    words: Words
    switches: Mapping[str, str]

    @property
    def name(self) -> str:
        """The room, and the settings that are not its defaults."""
        changed = [f"{s.name} = {self.switches[s.name]}" for s in self.room.switches
                   if self.switches[s.name] != s.default]
        return ", ".join([self.room.name, *changed])

    @property
    def interval_s(self) -> float:
        """Interval between two scans [s]."""
        return self.room.timing(self.words).scan_s

    @property
    def resolution_degC(self) -> float:
        """Step of the input module [°C]."""
        return self.words.scaling.span_degC / self.room.counts

    def power_pct(self, temperature_degC: Array, setpoint_degC: Array) -> Array:
        """Return the power after each scan, from the cold state on [%]."""
        return np.array(powers(self.room, self.words, temperature_degC.tolist(), setpoint_degC.tolist(), self.switches))


def controllers(words: Words, known: Mapping[str, str] | None = None) -> list[RoomController]:
    """Return the words' controller under every setting of its open points, but for those that are known.

    Raises:
        UnknownName: what is known is no switch or setting of the target.
    """
    found = controller_for(words.target)
    return [RoomController(room=found, words=words, switches=each) for each in settings_to_prove(found.switches, known)]


def closed_again(log: Log, fitted: FittedModel, tried: Sequence[RoomController], setpoint_degC: float | None) -> str:
    """Return how well the loop of the best model and its controller, closed in simulation, repeats the log."""
    if setpoint_degC is None:
        assert log.setpoint_degC is not None
        if float(np.ptp(log.setpoint_degC)) > 0.0:
            return "The loop was not closed again in simulation: the setpoint changes."
        setpoint_degC = float(log.setpoint_degC[0])
    best = fitted.hypotheses[0]
    controller = next(each for each in tried if best.law == f"{each.name} replayed")
    start, end = best.window_s
    part = log.window(start, end)
    try:
        scenario = Scenario(
            setpoint_degC=setpoint_degC, duration_s=end - start, start_degC=float(part.temperature_degC[0]),
        )
        actuator = Actuator(pwm_period_s=controller.words.sample_time_s)
        trace = simulate(controller.room, controller.words, best.model, scenario, actuator, controller.switches)
    except OutOfRange as problem:
        return f"The loop was not closed again in simulation: {problem}."
    repeated = trace.temperature_at(part.time_s - start)
    return (f"Closed again in simulation, {best.law.removesuffix(' replayed')} on the best model repeats the log to "
            f"{fit_pct(part.temperature_degC, repeated):.1f} %.")
