"""What is believed of a heater → the experiment that makes it known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from heatertune.cache import load_or_compute
from heatertune.model.experiment.document import to_document
from heatertune.model.experiment.fisher import ReadingNoise
from heatertune.model.experiment.plan import propose
from heatertune.model.experiment.prior import ExperimentSetup, prior_by_hand, prior_of
from heatertune.model.values import FittedModel
from heatertune.progress import ProgressCallback
from heatertune.proof.heaters import ROOM_DEGC

__all__ = ["plan"]


def plan(
    believed: FittedModel | Mapping[str, tuple[float, float]], *, limit_degC: float, noise: ReadingNoise,
    ambient_degC: float | None = None, longest_s: float | None = None, kind: str = "best",
    progress: ProgressCallback = str, **settings: float,
) -> dict[str, Any]:
    """Return the experiment that makes a heater known best, and what it would make known, as a document.

    It is kept: the search takes seconds, see `heatertune.cache`.

    Args:
        believed: a fitted model, or quantity → (low, high), see `experiment.QUANTITIES`.
        limit_degC: temperature that no heater of the prior may pass [°C].
        noise: of the readings; see `heatertune.model.experiment.noise.noise_of`.
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
        ambient = {} if ambient_degC is None else {"ambient_degC": (ambient_degC, ambient_degC)}
        prior = prior_by_hand(dict(believed) | ambient, ambient_known=ambient_degC is not None)
    setup = ExperimentSetup(
        limit_degC=limit_degC, noise=noise, longest_s=prior.longest_s if longest_s is None else longest_s,
        **settings,
    )
    inputs = {"models": {label: repr(model) for label, model in prior.models.items()}, "setup": asdict(setup),
              "ambient_known": prior.ambient_known, "kind": kind}

    def run() -> dict[str, Any]:
        return to_document(prior, setup, propose(prior, setup, kind=kind, progress=progress))

    return load_or_compute("plan", inputs, run, dict, progress=progress)
