"""What a loop has to live through: heat-up, then disturbances, and a sensor that is not quiet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from heatertune.errors import InputError, OutOfRange
from heatertune.model.values import HeaterModel
from heatertune.units import check

__all__ = ["Kick", "Load", "Scenario", "can_hold", "conditions", "paper_scenario", "scenario_for", "temperatures"]

#: The paper's record (Tables 3 and 4): disturbance in the 27th minute, last row at 40 min [s].
_PAPER_KICK_S: Final = 1620.0
_PAPER_DURATION_S: Final = 2400.0
#: Sum of lags and dead time up to which the paper's times suit a heater [s].
_PAPER_HEATER_S: Final = 600.0
#: The paper's kick, 53.3 → 44.5 °C, is 30 % of its setpoint step of 29.3 °C.
_KICK_SHARE: Final = 0.3
#: Record of a heater as fast as the paper's [s]; recovery gets nearly as long as heat-up.
_DURATION_S: Final = 3000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Kick:
    """The temperature of every lag jumps at once: cold goods, an opened door.

    Attributes:
        time_s: [s].
        temperature_degC: the jump, signed [°C].
    """

    time_s: float
    temperature_degC: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("temperature_degC", self.temperature_degC)


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """A power that is added at the heater's input from then on: a draught, a second source of heat.

    It acts after the dead time, as the heater's own power does.

    Attributes:
        time_s: [s].
        power_pct: added to all that is there already, signed [% of full power].
    """

    time_s: float
    power_pct: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("power_pct", self.power_pct)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One run of the loop, from a cold heater with the power off.

    Attributes:
        setpoint_degC: [°C], constant: what is asked for. A ramp on the way to it belongs to the words.
        duration_s: [s].
        ambient_degC: temperature without power [°C]; None: the model's own.
        start_degC: temperature of all lags at the start [°C]; None: ambient.
        disturbances: in order of time.
        noise_degC: standard deviation of the sensor's Gaussian noise [°C].
        seed: of that noise.

    Raises:
        OutOfRange: a time or temperature without meaning, a start that is not below the setpoint, disturbances
            out of order or after the end.
    """

    setpoint_degC: float
    duration_s: float
    ambient_degC: float | None = None
    start_degC: float | None = None
    disturbances: tuple[Kick | Load, ...] = ()
    noise_degC: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        check("setpoint_degC", self.setpoint_degC)
        check("duration_s", self.duration_s, above=0.0)
        check("noise_degC", self.noise_degC, least=0.0)
        check("seed", self.seed, least=0)
        for name in ("ambient_degC", "start_degC"):
            if (value := getattr(self, name)) is not None:
                check(name, value, least=-273.15)
                if not value < self.setpoint_degC:
                    raise OutOfRange(name, value, f"< setpoint_degC = {self.setpoint_degC:g}")
        times = [each.time_s for each in self.disturbances]
        if any(later <= earlier for earlier, later in pairwise([*times, self.duration_s])):
            raise OutOfRange("disturbances", times, f"ascending in time and < duration_s = {self.duration_s:g}")


def conditions(scenario: Scenario, model: HeaterModel) -> tuple[float, float]:
    """Return ambient and start temperature of a run [°C].

    Raises:
        InputError: neither scenario nor model knows the ambient temperature.
        OutOfRange: the setpoint lies outside what the heater can hold, between ambient and full power.
    """
    ambient, start = temperatures(scenario, model)
    top = ambient + 100.0 * model.gain_degC_per_pct
    if not can_hold(model, scenario.setpoint_degC, ambient):
        rule = (
            f"> {ambient:g} (ambient) and < {top:g} (ambient + 100 % · {model.gain_degC_per_pct:g} °C/%), "
            "or this heater cannot hold it"
        )
        raise OutOfRange("setpoint_degC", scenario.setpoint_degC, rule)
    return ambient, start


def can_hold(model: HeaterModel, setpoint_degC: float, ambient_degC: float) -> bool:
    """Return whether a heater reaches a setpoint with less than full power, and is colder without any."""
    return ambient_degC < setpoint_degC < ambient_degC + 100.0 * model.gain_degC_per_pct


def temperatures(scenario: Scenario, model: HeaterModel) -> tuple[float, float]:
    """Return ambient and start temperature of a run [°C], whether or not the heater can hold the setpoint.

    Raises:
        InputError: neither scenario nor model knows the ambient temperature.
    """
    ambient = model.ambient_degC if scenario.ambient_degC is None else scenario.ambient_degC
    if ambient is None:
        raise InputError("ambient_degC is unknown to both model and scenario: give the temperature without power")
    return ambient, ambient if scenario.start_degC is None else scenario.start_degC


def paper_scenario(
    *, setpoint_degC: float = 53.3, ambient_degC: float | None = None, kick_degC: float = -8.8,
    duration_s: float = _PAPER_DURATION_S,
) -> Scenario:
    """Return the paper's record: heat-up, and from 53.3 to 44.5 °C at once in the 27th minute."""
    return Scenario(
        setpoint_degC=setpoint_degC,
        ambient_degC=ambient_degC,
        duration_s=duration_s,
        disturbances=(Kick(time_s=_PAPER_KICK_S, temperature_degC=kick_degC),),
    )


def scenario_for(
    models: Sequence[HeaterModel], *, setpoint_degC: float, ambient_degC: float | None = None,
    kick_degC: float | None = None, noise_degC: float = 0.0, seed: int = 0,
) -> Scenario:
    """Return the paper's story in times that suit the slowest of the models.

    Up to 600 s of lags and dead time the kick comes at 1620 s, as in the paper; above, all times grow in
    proportion. Without `kick_degC` the temperature falls by 30 % of the largest setpoint step, as in the paper.

    Raises:
        InputError: no model, or nobody knows the ambient temperature.
        OutOfRange: one of the heaters cannot hold the setpoint.
    """
    if not models:
        raise InputError("a scenario needs at least one model")
    slowest = max(sum(model.lags_s) + model.dead_time_s for model in models)
    stretch = max(1.0, slowest / _PAPER_HEATER_S)
    plain = Scenario(
        setpoint_degC=setpoint_degC, ambient_degC=ambient_degC, duration_s=stretch * _DURATION_S,
        noise_degC=noise_degC, seed=seed,
    )
    step = max(setpoint_degC - conditions(plain, model)[0] for model in models)
    fall = -_KICK_SHARE * step if kick_degC is None else kick_degC
    return replace(plain, disturbances=(Kick(time_s=stretch * _PAPER_KICK_S, temperature_degC=fall),))
