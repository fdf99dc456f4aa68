"""A heater that was typed in: no log, no fit, nothing that takes long to load."""

from __future__ import annotations

from heatertune.model.values import Candidate, FitOutcome, FittedModel, Fopdt, HeaterModel

__all__ = ["model_by_hand"]


def model_by_hand(model: HeaterModel) -> FittedModel:
    """Return a model that was typed in, in the form the other stages take."""
    fopdt = model if isinstance(model, Fopdt) else model.half_rule()
    candidate = Candidate(
        model=model, log="by hand", window_s=(0.0, 0.0), law="no log", fit_pct=float("nan"), rmse_degC=float("nan"),
        delta_bic=0.0,
    )
    return FittedModel(
        model=fopdt, outcome=FitOutcome.BY_HAND, method="given by hand", candidates=(candidate,),
        notes=("No intervals are known: the proof runs on this model only.",),
    )
