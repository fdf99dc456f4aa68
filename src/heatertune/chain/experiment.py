"""Prior → the experiment to make, as a document."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from heatertune.errors import InputError
from heatertune.model.experiment.doublet import Plan, best_step
from heatertune.model.experiment.fisher import Noise
from heatertune.model.experiment.plan import propose
from heatertune.model.experiment.prior import QUANTITIES, ExperimentSetup, Prior, prior_by_hand, prior_of
from heatertune.model.experiment.relay import RelayPlan
from heatertune.model.values import FittedModel
from heatertune.proof.heaters import ROOM_DEGC

__all__ = ["PLAN_SCHEMA", "noise_of", "plan"]

PLAN_SCHEMA = "heatertune/plan/1"

_LONG = 6.0  # times the slowest heater of the prior: the longest experiment where none is given
_Z95 = 1.96  # half width of a 95 % interval in standard errors


def plan(
    believed: FittedModel | Mapping[str, tuple[float, float]], *, limit_degC: float, noise: Noise,
    ambient_degC: float | None = None, longest_s: float | None = None, kind: str = "best",
    progress: Callable[[str], object] = str, **settings: float,
) -> dict[str, Any]:
    """Return the experiment that makes a heater known best, and what it would make known, as a document.

    Args:
        believed: a fitted model, or quantity → (low, high), see `experiment.QUANTITIES`.
        limit_degC: temperature that no heater of the prior may pass [°C].
        noise: of the readings; see `noise_of`.
        ambient_degC: ambient, where the fit after the experiment will be told it [°C].
        longest_s: longest duration [s]; None: six times the slowest heater's lags and dead time.
        kind: "doublet", "relay", or "best" of both.
        progress: told what begins.
        settings: base_pct, least_pct, most_pct, aim, see `experiment.ExperimentSetup`.

    Raises:
        OutOfRange, InputError: as `propose`; a range that is missing or no heater's.
    """
    if isinstance(believed, FittedModel):
        prior = prior_of(believed, ambient_degC=ambient_degC, assumed_degC=ROOM_DEGC)
    else:
        known = {} if ambient_degC is None else {"ambient_degC": (ambient_degC, ambient_degC)}
        prior = prior_by_hand(dict(believed) | known, ambient_known=ambient_degC is not None)
    setup = ExperimentSetup(
        limit_degC=limit_degC, noise=noise, longest_s=_LONG * prior.slowest_s if longest_s is None else longest_s,
        **settings,
    )
    return _document(prior, setup, propose(prior, setup, kind=kind, progress=progress))


def noise_of(
    fitted: FittedModel | None, *, std_degC: float | None = None, correlation: float | None = None,
    resolution_degC: float | None = None, sample_time_s: float | None = None,
) -> Noise:
    """Return the noise of the readings: what is given, else what a model's residuals show.

    Residuals hold the sensor's resolution already, and the correlation between two of them shrinks with the interval.

    Raises:
        InputError: neither noise nor resolution is given, and the model has no residuals.
        OutOfRange: as `Noise`.
    """
    shown = None if fitted is None else fitted.residuals
    if shown is None or std_degC is not None:
        if std_degC is None and resolution_degC is None:
            raise InputError("the noise is unknown: give --noise or --resolution, or a model fitted to a log")
        return Noise(
            std_degC=std_degC or 0.0, correlation=correlation or 0.0, resolution_degC=resolution_degC or 0.0,
            sample_time_s=1.0 if sample_time_s is None else sample_time_s,
        )
    logged = float(np.median(np.diff(shown.time_s)))
    interval = logged if sample_time_s is None else sample_time_s
    lag_one = min(max(float(shown.autocorrelation[0]), 0.0), 0.999)
    return Noise(
        std_degC=float(np.std(shown.measured_degC - shown.simulated_degC)), sample_time_s=interval,
        correlation=min(lag_one ** (interval / logged), 0.999) if correlation is None else correlation,
        resolution_degC=resolution_degC or 0.0,
    )


def _document(prior: Prior, setup: ExperimentSetup, tried: list[Plan]) -> dict[str, Any]:
    chosen = tried[-1]
    document: dict[str, Any] = {
        "schema": PLAN_SCHEMA, "kind": chosen.kind, "duration_s": chosen.duration_s,
        "conditions": asdict(setup),
        "schedule": {
            "base_pct": chosen.schedule.base_pct, "time_s": chosen.schedule.time_s,
            "power_pct": chosen.schedule.power_pct,
        },
        "highest_degC": float(chosen.peaks_degC.max()),
        "quantities": {name: _quantity(prior, chosen, i) for i, name in enumerate(QUANTITIES)},
        "worst_share": chosen.worst, "reached": chosen.worst <= setup.aim,
        "durations": [{"duration_s": each.duration_s, "worst_share": each.worst} for each in tried],
        "step_worst_share": best_step(prior, setup, chosen.duration_s).worst,
        "heaters": [
            {"label": label, "errors": dict(zip(QUANTITIES, errors, strict=True)), "highest_degC": peak}
            for label, errors, peak in zip(prior.models, chosen.errors, chosen.peaks_degC, strict=True)
        ],
    }
    if isinstance(chosen, RelayPlan):
        shortest, longest = float(chosen.periods_s.min()), float(chosen.periods_s.max())
        document["relay"] = asdict(chosen.relay) | {
            "on_degC": chosen.relay.on_degC, "off_degC": chosen.relay.off_degC, "rest_s": chosen.rest_s,
            "period_s": [shortest, longest],
        }
    return document


def _quantity(prior: Prior, plan: Plan, index: int) -> dict[str, Any]:
    """Return one quantity: its range over the prior, the interval on the first heater, the worst of all."""
    values, half = prior.values[:, index], _Z95 * plan.errors[:, index]
    worst = int(np.argmax(plan.shares[:, index])) if index < plan.shares.shape[1] else int(np.argmax(half))
    return {
        "before": [float(values.min()), float(values.max())],
        "value": float(values[0]), "after": [float(values[0] - half[0]), float(values[0] + half[0])],
        "worst_half_width": float(half[worst]), "worst_on": list(prior.models)[worst],
        "worst_share": float(plan.shares[worst, index]) if index < plan.shares.shape[1] else None,
    }
