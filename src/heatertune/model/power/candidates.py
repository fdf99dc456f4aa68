"""The models that explain a log with power: one lag, two, two time constants, an integrator, and the rivals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.check_results import HeldOut
from heatertune.model.power.alternative_models import Rival
from heatertune.model.power.fit_checks import unseen
from heatertune.model.power.load_steps import bic_of
from heatertune.model.power.nonlinear import Bend
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.statistics import fit_pct
from heatertune.model.values import Candidate, HeaterModel

__all__ = ["candidates_of", "second_is_seen"]

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
