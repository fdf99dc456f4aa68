"""The known controller of a log: handed to the fit, then closed around the fitted heater as a check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.model_values import FittedModel
from heatertune.model.statistics import fit_pct
from heatertune.plc import Controller, Words, controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.replay import powers
from heatertune.proof import Actuator, Scenario, simulate

__all__ = ["ConfiguredController", "closed_again", "controllers"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfiguredController:
    """A controller with its words and one setting of its open points; see `heatertune.model.power.known_controller`."""

    controller: Controller
    words: Words
    switches: Mapping[str, str]

    @property
    def name(self) -> str:
        """The controller, and the settings that are not its defaults."""
        changed = [f"{s.name} = {self.switches[s.name]}" for s in self.controller.switches
                   if self.switches[s.name] != s.default]
        return ", ".join([self.controller.name, *changed])

    @property
    def interval_s(self) -> float:
        """Interval between two scans [s]."""
        return self.controller.timing(self.words).scan_s

    @property
    def resolution_degC(self) -> float:
        """Step of the input module [°C]."""
        return self.words.scaling.span_degC / self.controller.sensor(self.words.scaling).counts

    def power_pct(self, temperature_degC: Array, setpoint_degC: Array) -> Array:
        """Return the power after each scan, from the cold state on [%], shape (n,).

        Args:
            temperature_degC: at each scan [°C], shape (n,).
            setpoint_degC: likewise [°C], shape (n,).
        """
        temperatures, setpoints = temperature_degC.tolist(), setpoint_degC.tolist()
        return np.array(powers(self.controller, self.words, temperatures, setpoints, self.switches))


def controllers(words: Words, stated: Mapping[str, str] | None = None) -> list[ConfiguredController]:
    """Return the words' controller under every setting of its open points, but for those that are known.

    Raises:
        UnknownName: what is known is no switch or setting of the target.
    """
    controller = controller_for(words.target)
    return [
        ConfiguredController(controller=controller, words=words, switches=switches)
        for switches in settings_to_prove(controller.switches, stated)
    ]


def closed_again(log: Log, fitted: FittedModel, tried: Sequence[ConfiguredController],
                 setpoint_degC: float | None) -> str:
    """Return how well the loop of the best model and its controller, closed in simulation, repeats the log."""
    if setpoint_degC is None:
        assert log.setpoint_degC is not None
        if float(np.ptp(log.setpoint_degC)) > 0.0:
            return "The loop was not closed again in simulation: the setpoint changes."
        setpoint_degC = float(log.setpoint_degC[0])
    best = fitted.hypotheses[0]
    closed = next(one for one in tried if best.law == f"{one.name} replayed")
    start, end = best.window_s
    part = log.window(start, end)
    try:
        scenario = Scenario(
            setpoint_degC=setpoint_degC, duration_s=end - start, start_degC=float(part.temperature_degC[0]),
        )
        actuator = Actuator(pwm_period_s=closed.words.sample_time_s)
        trace = simulate(closed.controller, closed.words, best.model, scenario, actuator, closed.switches)
    except OutOfRange as problem:
        return f"The loop was not closed again in simulation: {problem}."
    repeated = trace.temperature_at(part.time_s - start)
    return (f"Closed again in simulation, {best.law.removesuffix(' replayed')} on the best model repeats the log to "
            f"{fit_pct(part.temperature_degC, repeated):.1f} %.")
