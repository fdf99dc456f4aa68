"""Log → FittedModel: a first-order-plus-dead-time heater, what is identifiable, and all models that explain it."""

from heatertune.model.intervals import Interval
from heatertune.model.values import Candidate, FittedModel, Fopdt, HeaterModel, Outcome, TwoLag

__all__ = ["Candidate", "FittedModel", "Fopdt", "HeaterModel", "Interval", "Outcome", "TwoLag"]
