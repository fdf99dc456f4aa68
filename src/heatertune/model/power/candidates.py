"""The models that explain a log with power: one lag, two, two time constants, an integrator, and the rivals.

The family of plausible heaters of a log with power: the candidates, the ends of their intervals, and the halves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.findings import Finding
from heatertune.model.power.alternative_models import Rival
from heatertune.model.power.fit_checks import unseen
from heatertune.model.power.interval_ends import ends_of, halves_of, held_by, told_apart
from heatertune.model.power.load_steps import bic_of
from heatertune.model.power.nonlinear import Bend
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.uncertainty import intervals_by
from heatertune.model.statistics import RATIO, Interval, fit_pct
from heatertune.model.values import Candidate, Half, HeaterModel, HeldOut

if TYPE_CHECKING:
    from heatertune.model.power.explanation import Explanation

__all__ = ["candidates_of", "family_of", "open_ends", "second_is_seen"]


_PLAUSIBLE_HEATERS_NEAR: Final = 10.0  # BIC points


class _Order(NamedTuple):
    """One lag or two: its place in problems and fits, its candidate and its intervals."""

    place: int
    candidate: Candidate
    ci95: Mapping[str, Interval | None]


def family_of(
    explanation: Explanation, candidates: Sequence[Candidate], ci95: Mapping[str, Interval | None],
    halves: tuple[Half, Half] | None, least_dead_time_s: float, wider: Mapping[str, float], seed: int,
) -> tuple[tuple[Candidate, ...], tuple[Finding, ...]]:
    """Return every plausible heater, and what is open that no heater can stand for.

    Args:
        explanation: what explains the log.
        candidates: the hypotheses that explain it, one lag first.
        ci95: intervals of one lag, gain per time constant and ultimate period among them.
        halves: one lag fitted to each half, None where that could not be done.
        least_dead_time_s: no dead time below this is believed.
        wider: factors by which the halves ask for wider intervals, see `parts.widening`; taken for two lags too.
        seed: of the bootstrap of two lags.
    """
    orders = list(_orders_plausible_heaters(explanation, candidates, ci95, wider, seed))
    ends: list[Candidate] = []
    for order in orders:
        values, held = held_by(explanation.problems[order.place], explanation.fits[order.place])
        ends += ends_of(order.candidate, values, order.ci95, held, least_dead_time_s=least_dead_time_s)
    parts = () if halves is None else halves_of(explanation.log, halves, law=candidates[0].law)
    return told_apart([*candidates, *ends, *parts], least_dead_time_s), tuple(
        open_ends([("two lags" if order.place else "one lag", order.ci95) for order in orders]))


def _orders_plausible_heaters(
    explanation: Explanation, candidates: Sequence[Candidate], ci95: Mapping[str, Interval | None],
    wider: Mapping[str, float], seed: int,
) -> Iterator[_Order]:
    """Return one lag and two, as far as they explain the log.

    Where two lags explain it far better, of one lag the dead time alone stays: its interval is what is told.
    """
    one, *others = candidates
    two = next((other for other in others if len(other.model.lags_s) > 1 and other.law == one.law), None)
    better = two is not None and one.delta_bic >= two.delta_bic + _PLAUSIBLE_HEATERS_NEAR
    yield _Order(0, one, {"dead_time_s": ci95["dead_time_s"]} if better else ci95)
    if two is not None:
        yield _Order(1, two, intervals_by(explanation.problems[1], explanation.fits[1], [wider], seed=seed)[0])


def open_ends(orders: Sequence[tuple[str, Mapping[str, Interval | None]]]) -> Iterator[Finding]:
    """Tell which upper ends are open: beyond them lie heaters on which nothing was proven.

    `orders`: number of lags in words, and the intervals with it.
    """
    for name, finding, what in (
        ("dead_time_s", "dead-time-open", "dead time has no upper end"),
        (RATIO, "faster-than-log", "gain per time constant has no upper end"),
    ):
        open_ = [lags for lags, ci95 in orders if (end := ci95.get(name)) is not None and end.high is None]
        if open_:
            yield Finding(name=finding, message=f"With {open_[0]}, the {what} within the log.")


Array = npt.NDArray[np.float64]

_NEAR = 10.0  # BIC points


class _CandidateTrial(NamedTuple):
    model: HeaterModel
    simulated_degC: Array
    bic: float
    law: str
    left_out: HeldOut | None = None
    is_kept: bool = False


def second_is_seen(two: PowerFit) -> bool:
    """Return whether the second lag is one: on its lower bound it is none."""
    return "second_time_constant_s" not in two.on_bound


def candidates_of(
    log: Log, problems: Sequence[PowerProblem], fits: Sequence[PowerFit], *, left_out: HeldOut, open_lag: bool,
    rivals: Sequence[Rival], bend: Bend | None = None,
) -> tuple[Candidate, ...]:
    """Return the one-lag model, its rivals, and every other model that explains the log nearly as well or better.

    Args:
        log: for its name and times.
        problems: of one lag and of two.
        fits: their best fits.
        left_out: error of one lag on windows left out.
        open_lag: whether the time constant's interval is open upwards.
        rivals: kept however far behind they are.
        bend: whose ends are kept.
    """
    record = problems[0].readings.temperature_degC
    tried = [*_orders(problems, fits, left_out, open_lag=open_lag)]
    tried += [_CandidateTrial(r.model, r.fit.simulated_degC, bic_of(r.problem, r.fit), r.law, None,
                              True) for r in rivals]
    if bend is not None:
        tried += [_CandidateTrial(end.model, bend.simulated_degC, bend.bic, f"power logged, {end.at}", None, True)
                  for end in dict.fromkeys(bend.ends)]
    least = min(trial.bic for trial in tried)
    return tuple(
        Candidate(
            model=trial.model, log=log.name, window_s=(float(log.time_s[0]), float(log.time_s[-1])), law=trial.law,
            fit_pct=fit_pct(record, trial.simulated_degC),
            rmse_degC=float(np.sqrt(np.mean((record - trial.simulated_degC) ** 2))), delta_bic=trial.bic - least,
            cross_rmse_degC=None if trial.left_out is None else trial.left_out.rmse_degC,
        )
        for trial in tried if trial.is_kept or trial.bic - least < _NEAR
    )


def _orders(
    problems: Sequence[PowerProblem], fits: Sequence[PowerFit], left_out: HeldOut, *, open_lag: bool
) -> list[_CandidateTrial]:
    """Return one lag, two where the second is seen, and the integrator where the time constant is open upwards."""
    (problem, other), (one, two) = problems, fits
    assert one.model is not None
    tried = [_CandidateTrial(one.model, one.simulated_degC, bic_of(problem, one), "power logged", left_out, True)]
    if second_is_seen(two) and two.model is not None:
        tried.append(_CandidateTrial(two.model, two.simulated_degC, bic_of(other, two), "power logged",
                                     unseen(other, two)))
    if open_lag:
        far = problem.far()
        if far.model is not None:
            law = "power logged, as an integrator"
            tried.append(_CandidateTrial(far.model, far.simulated_degC, bic_of(problem, far), law))
    return tried
