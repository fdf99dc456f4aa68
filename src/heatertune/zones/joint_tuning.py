"""PI or PID of each zone under joint robustness.

Each zone is tuned by the tuner of one loop for two heaters: itself with its neighbours held at their temperatures,
where it answers fastest, and itself with its neighbours moving along, where it answers slowest. All zones are then
detuned together, by a smaller Ms of each, until the whole loop is robust: the largest singular value of
S = (I + G·C)⁻¹ stays within its limit on every plausible network, and so does the largest sensitivity of each zone
alone with the others off. With decoupling F (see `heatertune.zones.decoupling`), S = (I + G·(C − F))⁻¹, and every
subset of the zones counts, as zones that are off or in manual are still read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.model.model_values import Candidate, FitOutcome, FittedModel, Fopdt
from heatertune.model.statistics import Interval
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import controller_response
from heatertune.plc import Scaling, controller_for
from heatertune.plc.design import tune
from heatertune.plc.ramp import Ramp
from heatertune.plc.word_selection import choose_words
from heatertune.plc.words import Words
from heatertune.settings import TuneSettings
from heatertune.zones.decoupling import Decoupling
from heatertune.zones.identify import FittedNetwork
from heatertune.zones.network import ThermalNetwork

__all__ = ["JOINT_MS", "MS_LADDER", "JointDesign", "JointTuner", "closed_loop_radius", "joint_sensitivity",
           "sensitivity_alone", "zone_model", "zone_sensitivity"]

Complex = npt.NDArray[np.complex128]

#: largest singular value of S that a design may have; and the largest sensitivity of a zone alone
JOINT_MS: Final = 2.0
#: most Ms of a zone alone, as of one heater; exchange of heat raises that of all together first
_ALONE_MS: Final = 1.6
#: Ms that each zone is tuned for, in turn; the first serves zones that exchange much heat
MS_LADDER: Final = (1.8, 1.6, 1.5, 1.4, 1.32, 1.25, 1.2, 1.15, 1.1)
_CLEARLY: Final = 1.05  # times a limit of Ms: more than rounding to words lowers it
_DRAWN: Final = 12
_FREQUENCIES: Final = 300
_POWERS_PCT: Final = (0.0, 50.0, 100.0)  # of all zones, at which heaters on one supply are linearised


@dataclass(frozen=True, slots=True, kw_only=True)
class JointDesign:
    """The controllers of all zones.

    Attributes:
        designs: as the words realise them.
        words: of each zone.
        ms_zones: Ms that each zone was tuned for.
        joint_ms: largest singular value of S over all plausible networks.
        alone_ms: largest sensitivity of a zone with the others off, over all plausible networks; with decoupling, of
            any zones with the others off.
        radius: largest magnitude of an eigenvalue of the sampled closed loop.
        structure: "pi" or "pid".
        decoupling: what is added for the neighbours' temperatures; None: nothing.
    """

    designs: tuple[PidDesign, ...]
    words: tuple[Words, ...]
    ms_zones: tuple[float, ...]
    joint_ms: float
    alone_ms: float
    radius: float
    structure: str = "pi"
    decoupling: Decoupling | None = None

    @property
    def is_robust(self) -> bool:
        """Whether the joint loop keeps the limit, and so does each zone alone, as tuned or as one heater."""
        return (max(self.joint_ms, self.alone_ms) <= JOINT_MS and min(max(self.ms_zones), self.alone_ms) <= _ALONE_MS
                and self.radius < 1.0)

    def with_ramp(self, ramp: Ramp | None) -> JointDesign:
        """Return this design with the same setpoint ramp for all zones; None: without one."""
        return replace(self, words=tuple(replace(words, ramp=ramp) for words in self.words))


def zone_model(
    fitted: FittedNetwork, zone: int, networks: Sequence[ThermalNetwork], at_degC: Sequence[float] | None = None
) -> FittedModel:
    """Return what the tuner of one loop takes: a zone with its neighbours held, and with its neighbours moving along.

    Args:
        fitted: the network.
        zone: its number.
        networks: plausible networks.
        at_degC: temperatures of all zones at which the neighbours are held; None: their ambients [°C].
    """
    heaters = [heater for network in networks for heater in (
        network.neighbours_held(zone, at_degC), _alone(network).neighbours_held(zone))]
    plants = list(dict.fromkeys(heaters))
    candidates = tuple(Candidate(
        model=heater, log=fitted.log, window_s=(0.0, 0.0), law="power logged, all zones", fit_pct=math.nan,
        rmse_degC=math.nan, delta_bic=0.0) for heater in plants)
    nominal = plants[0]
    model = nominal if isinstance(nominal, Fopdt) else nominal.half_rule()
    dead = fitted.ci95[f"dead_time_s {fitted.network.zones[zone]}"]
    return FittedModel(
        model=model, outcome=FitOutcome.IDENTIFIED, method="zone of a thermal network", candidates=candidates,
        ci95={"dead_time_s": Interval(low=max(dead.low or 0.0, 0.0), high=dead.high)},
        least_dead_time_s=0.5 * fitted.interval_s,
        reading_step_degC=fitted.noise_degC[zone] if fitted.noise_degC else 0.0, log_interval_s=fitted.interval_s)


def _alone(network: ThermalNetwork) -> ThermalNetwork:
    return replace(network, exchange=np.zeros_like(network.exchange))


class JointTuner:
    """Tunes the controllers of all zones for one target.

    Args:
        fitted: the network.
        target: the controller of all zones.
        scaling: sensor range of all zones; None: 0…100 °C.
        structure: "pi" or "pid".
        sample_time_s: common interval of the controllers; None: the shortest that the tuner finds for a zone [s].

    Raises:
        InputError: another structure.
        UnknownName, OutOfRange, NotRepresentable: as `heatertune.plc.design.tune` and `choose_words`.
    """

    def __init__(
        self, fitted: FittedNetwork, target: str, *, scaling: Scaling | None = None, structure: str = "pi",
        sample_time_s: float | None = None,
    ) -> None:
        if structure not in ("pi", "pid"):
            raise InputError(f"structure {structure!r}: zones are tuned as pi or pid")
        self.target, self.scaling = target, scaling
        self.networks = [network for _, network in fitted.draw(_DRAWN)]
        self._ends = self.networks[: max(len(self.networks) - _DRAWN, 1)]
        self.models = [zone_model(fitted, zone, self._ends) for zone in range(len(fitted.network.zones))]
        settings = TuneSettings(structure=structure, sample_time_s=sample_time_s)
        if sample_time_s is None:
            alone = [tune(model, settings, target=target, scaling=scaling).sample_time_s for model in self.models]
            settings = replace(settings, sample_time_s=min(alone))
        self.settings: Final = settings
        self._tuned: dict[tuple[int, float], Words] = {}

    def designs(self, is_broken: Callable[[Words], bool] = lambda _: False) -> Iterator[JointDesign | float]:
        """Yield robust designs, the fastest first, each detuned further than the one before; errors as the class.

        A zone whose words cannot serve, whatever those of the others are, spares the tuning of the others: then the Ms
        that the zones would be tuned for comes instead of a design.

        Args:
            is_broken: whether the words of a zone break the specification by themselves.
        """
        for ms in MS_LADDER:
            if self._is_fragile(ms):
                continue
            if any(is_broken(self._words(zone, ms)) for zone in range(len(self.models))):
                yield ms
                continue
            design = self.design_for((ms,) * len(self.models))
            if design.is_robust:
                yield design

    def _is_fragile(self, ms: float) -> bool:
        """Return whether a zone tuned for an Ms beyond that of one heater is clearly not robust while alone."""
        if ms <= _ALONE_MS:
            return False
        delay = controller_for(self.target).delayed_s(self.scaling or Scaling())
        return any(zone_sensitivity(network, self._tuned_for(zone, ms), zone, delay) > _CLEARLY * _ALONE_MS
                   for zone in range(len(self.models)) for network in self.networks)

    def slower(self, design: JointDesign, zone: int) -> JointDesign | None:
        """Return a design with one zone detuned further, None where that is not robust or no slower one is left."""
        rung = MS_LADDER.index(design.ms_zones[zone]) + 1
        if rung == len(MS_LADDER):
            return None
        slower = self.design_for((*design.ms_zones[:zone], MS_LADDER[rung], *design.ms_zones[zone + 1:]))
        return slower if slower.is_robust else None

    def _tuned_for(self, zone: int, ms: float) -> PidDesign:
        return tune(self.models[zone], replace(self.settings, ms=ms), target=self.target, scaling=self.scaling)

    def _words(self, zone: int, ms: float) -> Words:
        if (zone, ms) not in self._tuned:
            model, design = self.models[zone], self._tuned_for(zone, ms)
            self._tuned[zone, ms] = choose_words(design, self.target, model, scaling=self.scaling).words
        return self._tuned[zone, ms]

    def design_for(self, ms_zones: tuple[float, ...], decoupling: Decoupling | None = None) -> JointDesign:
        """Return the design of zones that are tuned for these Ms; errors as the class.

        Args:
            ms_zones: of each zone.
            decoupling: what is added for the neighbours' temperatures; None: nothing.
        """
        words = tuple(self._words(zone, ms) for zone, ms in enumerate(ms_zones))
        realised = tuple(_realised(each) for each in words)
        delay = controller_for(self.target).delayed_s(self.scaling or Scaling())
        return JointDesign(
            designs=realised, words=words, ms_zones=ms_zones,
            joint_ms=max(joint_sensitivity(network, realised, delay, decoupling) for network in self.networks),
            alone_ms=max(sensitivity_alone(network, realised, delay, decoupling) for network in self.networks),
            radius=max(closed_loop_radius(network, realised, delay, decoupling) for network in self._ends),
            structure=self.settings.structure, decoupling=decoupling)


def _realised(words: Words) -> PidDesign:
    design = controller_for(words.target).decode(words)
    if design is None:
        raise InputError(f"{words.target} is no PID: zones need one")
    return design


def joint_sensitivity(
    network: ThermalNetwork, designs: Sequence[PidDesign], delay_s: float = 0.0, decoupling: Decoupling | None = None
) -> float:
    """Return the largest singular value of S = (I + G·(C − F))⁻¹ over all frequencies.

    Args:
        network: the heaters.
        designs: of all zones, with one interval.
        delay_s: of the controllers' input and output [s].
        decoupling: F; None: none.
    """
    plant, control = _responses(network, designs, delay_s)
    difference = np.eye(len(designs)) + plant * control[:, None, :]
    if decoupling is not None:
        difference = difference - plant @ decoupling.matrix
    return float(1.0 / np.linalg.svd(difference, compute_uv=False)[:, -1].min())


def sensitivity_alone(
    network: ThermalNetwork, designs: Sequence[PidDesign], delay_s: float = 0.0, decoupling: Decoupling | None = None
) -> float:
    """Return the largest sensitivity of any zone while the others are off or in manual; arguments as above.

    With decoupling, the largest singular value of the sensitivity of any zones, at their heaters, while the others are
    off or in manual: they are read all the same.
    """
    plant, control = _responses(network, designs, delay_s)
    if decoupling is None:
        own = np.diagonal(plant, axis1=1, axis2=2) * control
        return float(np.max(1.0 / np.abs(1.0 + own)))
    loop = (control[:, :, None] * np.eye(len(designs)) - decoupling.matrix) @ plant
    subsets = [zones for size in range(1, len(designs)) for zones in combinations(range(len(designs)), size)]
    least = [np.linalg.svd(np.eye(len(zones)) + loop[np.ix_(range(len(loop)), zones, zones)], compute_uv=False)[:, -1]
             for zones in map(list, subsets)]
    return float(1.0 / np.min(least))


def zone_sensitivity(network: ThermalNetwork, design: PidDesign, zone: int, delay_s: float = 0.0) -> float:
    """Return the largest sensitivity of a zone while the others are off or in manual.

    Args:
        network: the heaters.
        design: of the zone.
        zone: its number.
        delay_s: of the controller's input and output [s].
    """
    plant, control = _responses(network, [design], delay_s)
    return float(np.max(1.0 / np.abs(1.0 + plant[:, zone, zone] * control[:, 0])))


def _responses(network: ThermalNetwork, designs: Sequence[PidDesign], delay_s: float) -> tuple[Complex, Complex]:
    interval = designs[0].sample_time_s
    slowest = max(*network.time_constants_s, *(design.integral_time_s for design in designs), interval)
    omega = np.geomspace(min(1e-2 / slowest, 1e-2 * math.pi / interval), math.pi / interval, _FREQUENCIES)
    control = np.stack([controller_response(design, omega) for design in designs], axis=1)
    plant = network.pulse_response(omega, interval, delay_s)
    if not network.is_supply_shared:
        return plant, control
    powers = _powers_pct(network)
    return np.concatenate([plant @ network.power_slopes(each) for each in powers]), np.tile(control, (len(powers), 1))


def _powers_pct(network: ThermalNetwork) -> tuple[float, ...]:
    """Return the powers at which a network is linearised: it is linear unless its heaters share a supply [%]."""
    return _POWERS_PCT if network.is_supply_shared else _POWERS_PCT[:1]


def closed_loop_radius(
    network: ThermalNetwork, designs: Sequence[PidDesign], delay_s: float = 0.0, decoupling: Decoupling | None = None
) -> float:
    """Return the largest magnitude of the eigenvalues of the sampled closed loop; arguments as `joint_sensitivity`.

    On a supply that sags, the largest at the powers of `_POWERS_PCT`. The states are the network's modes, the powers on
    their way, and of each controller the sum of the errors, the filtered difference and the last error.
    """
    added = np.zeros((len(designs),) * 2) if decoupling is None else decoupling.matrix
    return max(_radius(network, designs, delay_s, network.power_slopes(power), added)
               for power in _powers_pct(network))


def _radius(
    network: ThermalNetwork, designs: Sequence[PidDesign], delay_s: float, slopes: Array, added: Array
) -> float:
    modes, interval, count = network.modes, designs[0].sample_time_s, len(designs)
    size, dead = len(modes.rates), [divmod(late + delay_s, interval) for late in network.dead_times_s]
    places = np.cumsum([size, *(int(whole) + 1 for whole, _ in dead)])  # the powers on their way
    states = places[-1] + 3 * count
    matrix = np.zeros((states, states), dtype=np.complex128)
    matrix[:size, :size] = np.diag(np.exp(modes.rates * interval))
    powers = np.zeros((count, states), dtype=np.complex128)
    for zone, design in enumerate(designs):
        total = places[-1] + 3 * zone
        error, difference, power = (np.zeros(states, dtype=np.complex128) for _ in range(3))
        error[:size] = -modes.outputs[zone]
        filtered = design.derivative_filter
        share = (1.0 - filtered) * design.derivative_time_s / interval
        difference += share * error
        difference[[total + 1, total + 2]] += [filtered, -share]
        sums = error.copy()
        sums[total] += 1.0
        power += design.gain_pct_per_degC * (error + interval / design.integral_time_s * sums + difference)
        matrix[total], matrix[total + 1], matrix[total + 2], powers[zone] = sums, difference, error, power
    powers[:, :size] += added @ modes.outputs
    for zone, (power, (whole, rest)) in enumerate(zip(slopes @ powers, dead, strict=True)):
        begin, own = places[zone], int(whole)
        now = np.expm1(modes.rates * (interval - rest)) / modes.rates * modes.inputs[:, zone]
        before = (np.exp(modes.rates * (interval - rest)) * np.expm1(modes.rates * rest) / modes.rates
                  * modes.inputs[:, zone])
        matrix[begin] = power
        for place in range(1, own + 1):
            matrix[begin + place, begin + place - 1] = 1.0
        if own == 0:
            matrix[:size] += np.outer(now, power)
        else:
            matrix[:size, begin + own - 1] += now
        matrix[:size, begin + own] += before
    return float(np.abs(np.linalg.eigvals(matrix)).max())
