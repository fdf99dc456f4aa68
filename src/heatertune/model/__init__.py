"""Log → FittedModel: a first-order-plus-dead-time heater, what is identifiable, and all models that explain it."""

from heatertune.model.model_values import Candidate, FitOutcome, FittedModel, Fopdt, HeaterModel, TwoLag
from heatertune.model.statistics import Interval

__all__ = ["Candidate", "FitOutcome", "FittedModel", "Fopdt", "HeaterModel", "Interval", "TwoLag"]
