"""Log of several zones → the thermal network behind it, with intervals, and the couplings that the log leaves open.

`heatertune.zones.network_fit` fits; here are its result and what a log leaves open or contradicts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import ABSOLUTE_ZERO_DEGC, MIN_SAMPLES
from heatertune.model.findings import Finding
from heatertune.model.statistics import Interval, sensor_step
from heatertune.zones.network import ThermalNetwork, ZonePower, neighbours
from heatertune.zones.network_fit import (
    NetworkFit,
    NetworkProblem,
    ParameterLayout,
    explanation_gain,
    fit_supply,
    most_below,
    variance_inflation,
)

__all__ = ["FittedNetwork", "ParameterLayout", "ZoneLog", "fit_network", "network_by_hand"]

_LATE_ROWS: Final = 2  # by which the logged power may be late, as in the fit of one heater
_NORMAL: Final = 1.96
_FREE_UP_TO: Final = 3  # zones for which every coupling is fitted where no structure is stated
_POOR_PCT: Final = 80.0
_GOOD_PCT: Final = 98.0  # of a zone's log: a network that explains less has to leave little more than noise
_MOST_LEFT: Final = 4.0  # times the noise between neighbouring rows, that it may leave then
_COLDER: Final = 0.02  # exchange below 0 that cannot be the noise of a weak one
_NO_HEATER: Final = 1e3  # ratio of an end of an interval to the gain or lag, from which on nothing is known of it
_LONGEST_LAG: Final = 1e3  # times a log's length: a heater that is slower is none, its readings are a ramp
_FROM_REST: Final = "log a step of each zone's power, one after the other, each until all temperatures are steady"
_SIGNIFICANT: Final = 25.0  # points that couplings beyond a chain have to gain: five standard errors
_GAP_TIMES: Final = 5.0  # intervals without a row are a gap
_MOST_GAPS: Final = 3  # that are looked at, the longest
_COLOURED: Final = 4.0  # inflation of intervals by slow errors beyond which a log has more to explain
_WIDE: Final = 4.0  # ratio of an interval's ends above which the log bounds nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ZoneLog:
    """Temperatures and powers of several zones at the same instants.

    Attributes:
        name: of the log.
        zones: names, in order; neighbours in a chain follow each other.
        time_s: instants, increasing, shape (N,) [s].
        temperatures_degC: shape (N, n) [°C].
        powers_pct: held from its instant to the next, shape (N, n) [0…100 %].
        setpoints_degC: shape (N, n), None if not logged [°C].
        courses: of each power by its own instants; empty: as `powers_pct`.
        repairs: what the reader changed or assumed, one sentence each.
        findings: that leave a network of this log unproven: a unit without evidence.

    Raises:
        InputError: fewer than two zones, or names that are not unique.
        OutOfRange: shapes that differ, too few rows, times that do not increase, a power outside 0…100 %.
    """

    name: str
    zones: tuple[str, ...]
    time_s: Array
    temperatures_degC: Array
    powers_pct: Array
    setpoints_degC: Array | None = None
    courses: tuple[ZonePower, ...] = ()
    repairs: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        if len(self.zones) < 2 or len(set(self.zones)) < len(self.zones):
            raise InputError(f"zones {', '.join(self.zones)}: expected two or more zones, each with a name of its own")
        shape = (len(self.time_s), len(self.zones))
        if shape[0] < MIN_SAMPLES:
            raise OutOfRange("number of samples", shape[0], f">= {MIN_SAMPLES}")
        for name in ("temperatures_degC", "powers_pct", "setpoints_degC"):
            values = getattr(self, name)
            if values is not None and (values.shape != shape or not np.all(np.isfinite(values))):
                raise OutOfRange(name, values.shape, f"finite, of shape {shape}")
        if not np.all(np.diff(self.time_s) > 0.0):
            raise OutOfRange("time_s", float(self.time_s[0]), "strictly increasing")
        if np.min(self.powers_pct) < 0.0 or np.max(self.powers_pct) > 100.0:
            raise OutOfRange("powers_pct", float(np.max(np.abs(self.powers_pct))), ">= 0 and <= 100")

    @property
    def interval_s(self) -> float:
        """The usual time between two rows [s]."""
        return float(np.median(np.diff(self.time_s)))

    def part(self, from_s: float | None = None, until_s: float | None = None) -> ZoneLog:
        """Return the rows from one instant to another, with the power before them.

        Args:
            from_s: first instant; None: the first row [s].
            until_s: last instant; None: the last row [s].

        Raises:
            OutOfRange: too few rows.
        """
        rows = ((self.time_s >= (-math.inf if from_s is None else from_s))
                & (self.time_s <= (math.inf if until_s is None else until_s)))
        if np.count_nonzero(rows) < MIN_SAMPLES:
            raise OutOfRange("rows from --from to --until", int(np.count_nonzero(rows)), f">= {MIN_SAMPLES}")
        return replace(
            self, time_s=self.time_s[rows], temperatures_degC=self.temperatures_degC[rows],
            powers_pct=self.powers_pct[rows], courses=self.power_courses(),
            setpoints_degC=None if self.setpoints_degC is None else self.setpoints_degC[rows])

    def power_courses(self) -> tuple[ZonePower, ...]:
        """Return the power of each zone by the instants at which it changed."""
        return self.courses or tuple(ZonePower.from_rows(self.time_s, power) for power in self.powers_pct.T)

    def fit_zones(self, **settings: Any) -> FittedNetwork:
        """Identify the thermal network of the zones; arguments and errors as `fit_network`."""
        return fit_network(self, **settings)


@dataclass(frozen=True, slots=False, kw_only=True, eq=False)
class FittedNetwork:
    """The thermal network of a log, and how far the log determines it.

    Attributes:
        network: the best fit.
        layout: of `values`.
        values: the parameters, as `layout` places them.
        covariance: of the parameters.
        late_s: by how much longer than fitted the dead times may be, as the logged power may be late [s].
        noise_degC: standard deviation of the residuals of each zone [°C].
        fit_pct: 100·(1 − ‖y−ŷ‖/‖y−ȳ‖) of each zone [%].
        residuals_degC: shape (N, n) [°C].
        findings: that leave the network unproven, see `heatertune.model.findings`.
        log: name of the log.
        interval_s: between two rows [s].
        setpoints_degC: last logged setpoint of each zone, None if not logged [°C].
        highest_degC: highest reading of each zone [°C].
    """

    network: ThermalNetwork
    layout: ParameterLayout
    values: Array
    covariance: Array
    late_s: float = 0.0
    noise_degC: tuple[float, ...] = ()
    fit_pct: tuple[float, ...] = ()
    residuals_degC: Array = field(default_factory=lambda: np.zeros((0, 0)))
    findings: tuple[Finding, ...] = ()
    log: str = "by hand"
    interval_s: float = 0.0
    setpoints_degC: tuple[float, ...] | None = None
    highest_degC: tuple[float, ...] | None = None

    @cached_property
    def ci95(self) -> Mapping[str, Interval]:
        """Quantity with unit and zone, or "exchange A-B" → its 95 % interval."""
        per_zone, zones = self.layout.per_zone, self.network.zones
        names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC", "", "second_time_constant_s")
        intervals = {}
        for zone, label in enumerate(zones):
            for place, name in enumerate(names[:per_zone]):
                if name:
                    intervals[f"{name} {label}"] = self._interval(zone * per_zone + place, is_log=place in (0, 1, 5),
                                                                  late_s=self.late_s if place == 2 else 0.0)
        for zone, label in enumerate(zones if self.layout.sag else ()):
            intervals[f"supply_share {label}"] = self._interval(self.layout.first_share + zone)
        for number, (zone, neighbour) in enumerate(self.layout.pairs):
            intervals[f"exchange {zones[zone]}-{zones[neighbour]}"] = self._interval(len(zones) * per_zone + number)
        return intervals

    def _interval(self, place: int, *, is_log: bool = False, late_s: float = 0.0) -> Interval:
        reach = _NORMAL * math.sqrt(float(self.covariance[place, place]))
        low, high = float(self.values[place]) - reach, float(self.values[place]) + reach
        return Interval(low=math.exp(low), high=math.exp(high)) if is_log else Interval(low=low, high=high + late_s)

    @property
    def couplings(self) -> Mapping[str, bool]:
        """"A-B" → whether the log shows that zone A receives heat from zone B; if not, it is open."""
        return {name.removeprefix("exchange "): interval.low is not None and interval.low > 0.0
                for name, interval in self.ci95.items() if name.startswith("exchange ")}

    def draw(self, count: int, seed: int = 1) -> list[tuple[str, ThermalNetwork]]:
        """Return plausible networks with labels: the best fit, the ends of the intervals, and drawn ones.

        The draws follow the joint distribution of the parameters; dead times are longer by up to `late_s`.

        Args:
            count: number of drawn networks.
            seed: of the draws.
        """
        zones, per_zone = self.network.zones, self.layout.per_zone
        networks = [("best fit", self.network)]
        if not np.any(self.covariance):
            return networks
        reach = _NORMAL * np.sqrt(np.diag(self.covariance))
        place = np.arange(len(self.values))
        shares = place >= (self.layout.first_share if self.layout.sag else len(place))
        coupled = (place >= len(zones) * per_zone) & ~shares
        dead = (place < len(zones) * per_zone) & (place % per_zone == 2)
        for label, sign in (("strongest exchange, longest dead times", 1.0), ("weakest exchange", -1.0)):
            values = self.values + sign * np.where(coupled, reach, 0.0)
            values = np.where(dead, self.values + (reach + self.late_s if sign > 0.0 else 0.0), values)
            networks.append((label, self.layout.network(zones, values)))
        for label, sign in (("largest sag of the supply", 1.0), ("smallest sag", -1.0)) if np.any(shares) else ():
            networks.append((label, self.layout.network(zones, self.values + sign * np.where(shares, reach, 0.0))))
        random = np.random.default_rng(seed)
        spread = np.linalg.cholesky(self.covariance + 1e-15 * np.diag(np.diag(self.covariance)))
        for number in range(count):
            values = self.values + spread @ random.standard_normal(len(self.values))
            values = np.where(dead, values + random.uniform(0.0, self.late_s, len(values)), values)
            networks.append((f"drawn network {number + 1}", self.layout.network(zones, values)))
        return networks

    def summary(self) -> str:
        """Return the network as text, a line for each zone and one for each coupling."""
        net, lines = self.network, []
        for zone, label in enumerate(net.zones):
            parts = [f"{self._text(f'gain_degC_per_pct {label}', net.gains_degC_per_pct[zone])} °C/%",
                     f"time constant {self._text(f'time_constant_s {label}', net.time_constants_s[zone])} s",
                     f"dead time {self._text(f'dead_time_s {label}', net.dead_times_s[zone])} s"]
            lines.append(f"zone {label}: {', '.join(parts)}, ambient {net.ambients_degC[zone]:.4g} °C")
        for name, shown in self.couplings.items():
            zone, other = self.layout.pairs[list(self.couplings).index(name)]
            value = self._text(f"exchange {name}", float(net.exchange[zone, other]))
            lines.append(f"exchange {name}: {value}{'' if shown else ', open: the log does not show it'}")
        return "\n".join([*lines, *(f"{finding.name}: {finding.message}" for finding in self.findings)])

    def _text(self, name: str, value: float) -> str:
        interval = self.ci95[name]
        return f"{value:.4g} ({interval.low:.4g}…{interval.high:.4g})"


def network_by_hand(network: ThermalNetwork) -> FittedNetwork:
    """Return a network that was entered by its numbers, in the form that tuning and proof take; it has no intervals."""
    count = len(network.zones)
    pairs = tuple((i, j) for i in range(count) for j in range(count) if network.exchange[i, j] > 0.0)
    second = any(lag > 0.0 for lag in network.second_time_constants_s)
    layout = ParameterLayout(count, pairs, second, sag=network.is_supply_shared)
    own = [np.log(network.gains_degC_per_pct), np.log(network.time_constants_s), np.array(network.dead_times_s),
           np.array(network.ambients_degC), np.array(network.ambients_degC)]
    if second:
        own.append(np.log(np.maximum(network.second_time_constants_s, 1e-6)))
    values = np.concatenate([np.column_stack(own).ravel(), [network.exchange[pair] for pair in pairs],
                             network.supply_shares if layout.sag else ()])
    return FittedNetwork(network=network, layout=layout, values=values, covariance=np.zeros((len(values),) * 2))


def fit_network(
    log: ZoneLog, *, structure: str | None = None, from_s: float | None = None, until_s: float | None = None
) -> FittedNetwork:
    """Identify the thermal network of a log.

    Args:
        log: of all zones, with power.
        structure: "chain", "ring" or "free", see `heatertune.zones.network.neighbours`; None: free up to three zones,
            otherwise a chain and the couplings beyond it that the log shows.
        from_s: first instant to use; None: the first reading [s].
        until_s: last instant to use; None: the last reading [s].

    Raises:
        InputError: a zone whose power never changes, or a log that gives no heater.
        OutOfRange: another structure, or too few rows in the part that is used.
    """
    log = log.part(from_s, until_s)
    for zone, power in zip(log.zones, log.powers_pct.T, strict=True):
        if np.ptp(power) == 0.0:
            raise InputError(f"{log.name}: the power of zone {zone!r} never changes, so its gain is unknown: log a "
                             "step of the power of each zone, one after the other")
    fitted = _fit(log, structure)
    if any(finding.name == "poor-fit" for finding in fitted.findings):
        fitted = replace(fitted, findings=(*_hidden_powers(log, structure), *fitted.findings))
    return fitted


def _fit(log: ZoneLog, structure: str | None) -> FittedNetwork:
    """Return the network of a log; arguments and errors as `fit_network`."""
    count = len(log.zones)
    pairs = neighbours(structure or ("free" if count <= _FREE_UP_TO else "chain"), count)
    whole = _problem_of(log)
    layout, is_open = ParameterLayout(count, pairs, second=False), structure is None and count > _FREE_UP_TO
    if is_open and not whole.is_explained_by(pairs):
        problem, fitted = _with_clear_couplings(whole, layout)
    else:
        problem, fitted = whole.timed(whole.fit(layout, whole.start(layout)))
        if is_open and problem.lacks_couplings(fitted):
            timed, free = _with_clear_couplings(whole, layout)
            if explanation_gain(fitted, free) > _SIGNIFICANT:
                problem, fitted = timed, free
    wider = problem.with_second_lags(fitted)
    result = _result_or_error(log, problem, wider)
    if _is_unexplained(result):
        result = _with_shared_supply(log, whole, fitted, wider) or result
    if isinstance(result, InputError):
        raise result
    return result


def _with_clear_couplings(whole: NetworkProblem, layout: ParameterLayout) -> tuple[NetworkProblem, NetworkFit]:
    """Return the fit with the couplings beyond a layout that the log shows clearly, however the zones are listed."""
    free = layout._replace(pairs=neighbours("free", layout.size))
    timed, fit = whole.timed(whole.fit(free, whole.start(free)))
    return timed, timed.with_clear_couplings(fit, layout.pairs)


def _result_or_error(log: ZoneLog, problem: NetworkProblem, fit: NetworkFit) -> FittedNetwork | InputError:
    try:
        return _result(log, problem, fit)
    except InputError as error:
        return error


def _is_unexplained(result: FittedNetwork | InputError) -> bool:
    if isinstance(result, InputError) or max(map(variance_inflation, result.residuals_degC.T)) > _COLOURED:
        return True
    return any(finding.name in ("poor-fit", "contradicted") for finding in result.findings)


def _with_shared_supply(
    log: ZoneLog, problem: NetworkProblem, fit: NetworkFit, best: NetworkFit
) -> FittedNetwork | None:
    """Return the network of heaters that share a supply, None where none explains a log better than the best without.

    Args:
        log: of all zones.
        problem: of it.
        fit: without second lags, from which the search begins.
        best: fit without a shared supply.
    """
    supply = fit_supply(problem, fit)
    if not supply.explains_more(best):
        return None
    result = _result_or_error(log, supply.problem, supply.whole)
    if isinstance(result, InputError) or any(finding.name == "poor-fit" for finding in result.findings):
        return None
    return replace(result, findings=(*supply.findings(log.zones), *result.findings))


def _problem_of(log: ZoneLog) -> NetworkProblem:
    return NetworkProblem.from_readings(log.time_s, log.temperatures_degC, log.power_courses(), log.interval_s)


def _hidden_powers(log: ZoneLog, structure: str | None) -> Iterator[Finding]:
    """Yield which gap keeps a network from explaining a log: beside it, one explains the log before or after it."""
    spans = np.diff(log.time_s)
    gaps = [int(row) for row in np.argsort(-spans)[:_MOST_GAPS] if spans[row] > _GAP_TIMES * log.interval_s]
    for row in gaps:
        begin_s, end_s, parts = log.time_s[row], log.time_s[row + 1], (slice(row + 1, None), slice(row + 1))
        for part, option in zip(parts, (f"--from {end_s:.6g}", f"--until {begin_s:.6g}"), strict=True):
            own = _part_of(log, part)
            if own is not None and _is_explained(own, structure):
                yield _gap_finding(begin_s, end_s, f"one network explains the part that {option} leaves")
                return
    if gaps and not any(_part_of(log, part) for row in gaps for part in (slice(row + 1, None), slice(row + 1))):
        begin_s, end_s = log.time_s[gaps[0]:gaps[0] + 2]
        yield _gap_finding(begin_s, end_s, "neither part has steps of every zone: log again without a gap")


def _gap_finding(begin_s: float, end_s: float, message: str) -> Finding:
    return Finding(name="gap-hides-power", message=(
        f"the log has no row from {begin_s:.6g} to {end_s:.6g} s, so what the power did there is unknown; {message}"))


def _part_of(log: ZoneLog, rows: slice) -> ZoneLog | None:
    """Return some rows of a log, None where these do not show a heater of each zone."""
    time_s = log.time_s[rows]
    if len(time_s) < MIN_SAMPLES or not np.all(np.ptp(log.powers_pct[rows], axis=0)):
        return None
    return replace(log.part(float(time_s[0]), float(time_s[-1])), setpoints_degC=None, findings=())


def _is_explained(log: ZoneLog, structure: str | None) -> bool:
    try:
        return not _fit(log, structure).findings
    except InputError:
        return False


def _result(log: ZoneLog, problem: NetworkProblem, fit: NetworkFit) -> FittedNetwork:
    readings, (values, _), covariance = problem.readings, fit.layout.parts(fit.values), problem.covariance(fit)
    reach = _NORMAL * np.sqrt(np.diag(covariance)[: values.size].reshape(values.shape)[:, :2])
    mask = np.all(reach < math.log(_NO_HEATER), axis=1) & (values[:, 1] < math.log(_LONGEST_LAG * np.ptp(log.time_s)))
    for zone, ambient, is_known in zip(log.zones, values[:, 3], mask, strict=True):
        if ambient < ABSOLUTE_ZERO_DEGC or not is_known:
            raise InputError(f"{log.name}: the log does not show the heater of zone {zone!r}: {_cause(log, problem)}")
    error = np.sqrt(np.sum(fit.residuals**2, axis=0) / np.sum((readings - readings.mean(axis=0)) ** 2, axis=0))
    fit_pct = tuple(100.0 * (1.0 - error))
    findings = [*_poor_findings(log, fit_pct, fit.residuals)]
    if findings:
        findings += [Finding(name="contradicted", message=cause) for cause in problem.misread_powers(log.zones)]
    fitted = FittedNetwork(
        network=fit.layout.network(log.zones, fit.values), layout=fit.layout, values=fit.values,
        covariance=covariance, late_s=_LATE_ROWS * log.interval_s,
        noise_degC=tuple(fit.residuals.std(axis=0)), fit_pct=fit_pct, residuals_degC=fit.residuals,
        log=log.name, interval_s=log.interval_s,
        setpoints_degC=None if log.setpoints_degC is None else tuple(log.setpoints_degC[-1]),
        highest_degC=tuple(readings.max(axis=0)))
    return replace(fitted, findings=(*log.findings, *findings, *_open_findings(fitted)))


def _cause(log: ZoneLog, problem: NetworkProblem) -> str:
    """Return why a log shows no heater, and what to do."""
    clocks = [f"{each.message}: log dates, or all zones in one file, if they do not begin at the same instant"
              for each in log.findings if each.name == "one-clock"]
    return "; ".join([*clocks, *problem.misread_powers(log.zones)]) or _FROM_REST


def _poor_findings(log: ZoneLog, fit_pct: Sequence[float], residuals_degC: Array) -> Iterator[Finding]:
    """Yield which logs the network does not explain, residuals of shape (N, n)."""
    for zone, share, left, readings in zip(log.zones, fit_pct, residuals_degC.T, log.temperatures_degC.T, strict=True):
        noise = float(np.sqrt(np.mean(np.diff(left, 2) ** 2) / 6.0))
        noise = max(noise, (sensor_step(readings) or 0.0) / math.sqrt(12.0))
        message = f"the network explains {share:.3g} % of zone {zone}'s log"
        if share < _POOR_PCT:
            yield Finding(name="poor-fit", message=message)
        elif share < _GOOD_PCT and float(left.std()) > _MOST_LEFT * noise:
            yield Finding(name="poor-fit", message=(
                f"{message} and leaves {float(left.std()):.2g} °C, far more than noise; if zones share a slow mass, "
                "no network does better: log each zone while the others rest, and design each by itself"))


def _open_findings(fitted: FittedNetwork) -> Iterator[Finding]:
    """Yield which heaters the log does not bound."""
    for zone in fitted.network.zones:
        for name, what in (("gain_degC_per_pct", "gain"), ("time_constant_s", "time constant")):
            interval = fitted.ci95[f"{name} {zone}"]
            assert interval.low is not None
            assert interval.high is not None
            if interval.high > _WIDE * interval.low:
                yield Finding(name="unexplained-by-power", message=(
                    f"the log does not bound the {what} of zone {zone}: {interval.low:.3g} to {interval.high:.3g}"))
    for name, value in zip(fitted.couplings, fitted.layout.couplings(fitted.values), strict=True):
        high = fitted.ci95[f"exchange {name}"].high
        assert high is not None
        if high < -_COLDER:
            yield Finding(name="contradicted", message=(
                f"the exchange {name} would be below 0 ({high:.2g} at most), which no heat exchange is"))
        elif value <= -most_below(fitted.layout) + _COLDER:
            yield Finding(name="contradicted", message=(
                f"the exchange {name} fits best at {value:.2g}, the end of its search, and none is below 0: the "
                "log does not tell the zones apart"))
