"""Heaters on one supply: while another zone's heater is on, the voltage sags and a heater gives less power.

    q_i = u_i·(1 − Σ_j s_j·u_j / 100),   j ≠ i

s_j is the share of their power that all others lose while zone j is at full power: its current through the resistance
of supply and wires. u_i·u_j is the share of the time in which two PWMs of different clocks are on together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.model.findings import Finding
from heatertune.zones.network import ZonePower
from heatertune.zones.network_fit import NetworkFit, NetworkProblem, ParameterLayout, explanation_gain

__all__ = ["SupplyFit", "fit_supply", "power_courses"]

_NORMAL: Final = 1.96
_MOST_STEPS: Final = 30
_MOST_LOST: Final = 0.9  # of a heater's power
_LEAST_LOST: Final = 0.02  # below it a share is no sag of a supply
_SIGNIFICANT: Final = 25.0  # points that each share has to gain: five standard errors


class SupplyFit(NamedTuple):
    """A network whose heaters share a supply.

    Attributes:
        problem: with the powers that reach the heaters.
        fit: its Jacobian is by the shares, too.
        shares: of their power that all other zones lose while a zone is at full power, shape (n,).
        reach: half of the 95 % interval of each, shape (n,).
    """

    problem: NetworkProblem
    fit: NetworkFit
    shares: Array
    reach: Array

    def explains_more(self, fit: NetworkFit) -> bool:
        """Return whether a sag of the supply explains the log clearly better than a fit without it."""
        return bool(explanation_gain(fit, self.fit) > _SIGNIFICANT * len(self.shares)
                    and np.any(self.shares - self.reach > _LEAST_LOST) and np.all(self.shares + self.reach > 0.0)
                    and np.all(self.shares + self.reach < 1.0))

    def findings(self, zones: Sequence[str]) -> Iterator[Finding]:
        """Yield which zones take power from the others."""
        for zone, share, reach in zip(zones, self.shares, self.reach, strict=True):
            if share - reach > _LEAST_LOST:
                yield Finding(name="shared-supply", message=(
                    f"while the heater of zone {zone} is on, each other heater gives {100.0 * share:.3g} % less "
                    f"power ({100.0 * (share - reach):.3g}…{100.0 * (share + reach):.3g} %)"))


def power_courses(courses: Sequence[ZonePower], shares: Array) -> list[ZonePower]:
    """Return the powers that reach the heaters, each with a change wherever that of any zone changes.

    Args:
        courses: power of each zone as logged.
        shares: of their power that all others lose while a zone is at full power, shape (n,).
    """
    instants = np.unique(np.concatenate([course.instants_s for course in courses]))
    levels = np.column_stack([
        course.first_pct + np.concatenate([[0.0], np.cumsum(course.changes_pct)])[
            np.searchsorted(course.instants_s, instants, side="right")] for course in courses])
    levels = np.vstack([[course.first_pct for course in courses], levels])
    lost = levels * shares / 100.0
    left = levels * (1.0 - (lost.sum(axis=1, keepdims=True) - lost))
    return [ZonePower(float(own[0]), instants, np.diff(own)) for own in left.T]


def fit_supply(problem: NetworkProblem, fit: NetworkFit) -> SupplyFit:
    """Return the least-squares fit of a network and of the shares that its zones take from each other.

    Args:
        problem: with the powers as logged.
        fit: of a network without a sag of the supply, where the search begins.
    """
    found = _refined(problem, fit, np.zeros(fit.layout.size))
    wider = found.problem.with_second_lags(found.fit)
    return found if wider is found.fit else _refined(problem, wider, found.shares)


def _with_shares(problem: NetworkProblem, shares: Array) -> NetworkProblem:
    """Return the problem with the powers that reach the heaters."""
    instants, places = np.unique(np.concatenate([course.instants_s for course in problem.courses]), return_index=True)
    spans = np.concatenate(problem.spans_s)[places]
    assert len(spans) == len(instants)
    return replace(problem, courses=power_courses(problem.courses, shares), spans_s=[spans] * len(problem.courses))


def _refined(problem: NetworkProblem, fit: NetworkFit, shares: Array) -> SupplyFit:
    """Return the fit of parameters and shares together, by Levenberg and Marquardt's method."""
    layout, count = fit.layout, len(fit.values)
    both, damping = np.concatenate([fit.values, shares]), 1e-3
    residuals = _residuals(problem, layout, both)
    for _ in range(_MOST_STEPS):
        weights = 1.0 / np.maximum(residuals.std(axis=0), 1e-6)
        weighted = (_jacobian(problem, layout, both) * weights[:, None]).reshape(-1, len(both))
        target, gained = (residuals * weights).ravel(), 0.0
        normal, slope, cost = weighted.T @ weighted, weighted.T @ target, float(target @ target)
        for _ in range(8):
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), slope)
            tried = np.concatenate([
                problem.within_limits(layout, both[:count], step[:count]),
                np.clip(both[count:] + np.clip(step[count:], -0.2, 0.2), -_MOST_LOST, _MOST_LOST)])
            errors = _residuals(problem, layout, tried)
            gained = cost - float(np.sum((errors * weights) ** 2))
            if np.all(np.isfinite(errors)) and gained > 0.0:
                both, residuals, damping = tried, errors, damping / 5.0
                break
            damping *= 6.0
        if not gained > 1e-6 * cost:
            break
    jacobian = _jacobian(problem, layout, both)
    own = _with_shares(problem, both[count:])
    found = NetworkFit(layout, both[:count], residuals, jacobian)
    reach = _NORMAL * np.sqrt(np.diag(own.covariance(found))[count:])
    return SupplyFit(own, found, both[count:], reach)


def _residuals(problem: NetworkProblem, layout: ParameterLayout, both: Array) -> Array:
    values, shares = both[: -layout.size], both[-layout.size:]
    return np.asarray(problem.readings - _with_shares(problem, shares).simulate(layout, [values])[0])


def _jacobian(problem: NetworkProblem, layout: ParameterLayout, both: Array) -> Array:
    """Return the derivatives of all temperatures by parameters and shares, shape (rows, n, parameters + n)."""
    size = 1e-3
    by_share = [-(_residuals(problem, layout, moved) - _residuals(problem, layout, both)) / size
                for moved in both + size * np.eye(len(both))[-layout.size:]]
    own = _with_shares(problem, both[-layout.size:]).jacobian(layout, both[: -layout.size])
    return np.concatenate([own, np.moveaxis(np.array(by_share), 0, 2)], axis=2)
