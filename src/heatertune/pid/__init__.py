"""FittedModel → PidDesign: rules, robustness, the sampling interval, the optimum."""

from heatertune.pid.design_values import Margins, PidDesign

__all__ = ["Margins", "PidDesign"]
