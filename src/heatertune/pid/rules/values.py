"""What a tuning rule is: its formulas as printed, where they come from, and how far they hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from heatertune.errors import OutOfRange
from heatertune.model.values import HeaterModel
from heatertune.pid.values import Settings

__all__ = ["Formula", "Rule", "on_one_lag"]

#: model (dead time with the half sample in it), wanted closed-loop time constant [s] or None → settings as printed
Formula = Callable[[HeaterModel, float | None], Settings]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One tuning rule.

    Attributes:
        source: authors, journal, volume, year, pages, table or equation.
        formulas: structure → formula.
        claim: what its authors say a loop tuned by it does.
        form: the form the settings are printed in, "ideal" or "series".
        least_ratio, most_ratio: dead time over time constant its authors cover.
        narrower: structure → least ratio, where one structure holds from a larger one on.
        two_lags: structures that need a model with two lags.
        closed_loop: name of the closed-loop time constant it leaves open, None where it leaves nothing open.
        errata: what common copies print wrongly or differently, one sentence each.

    Raises:
        OutOfRange: a form that is unknown, a range that is empty.
    """

    source: str
    formulas: Mapping[str, Formula]
    claim: str
    form: str = "ideal"
    least_ratio: float = 0.0
    most_ratio: float = math.inf
    narrower: Mapping[str, float] = field(default_factory=dict)
    two_lags: tuple[str, ...] = ()
    closed_loop: str | None = None
    errata: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.form not in ("ideal", "series"):
            raise OutOfRange("form", self.form, "'ideal' or 'series'")
        if not 0.0 <= self.least_ratio < self.most_ratio:
            raise OutOfRange("least_ratio", self.least_ratio, f">= 0 and < most_ratio = {self.most_ratio:g}")


def on_one_lag(formula: Callable[[float, float, float], Settings]) -> Formula:
    """Return a formula in k [°C/%], T [s] and L [s] as one that takes any model, by way of its half rule."""

    def applied(model: HeaterModel, wanted_s: float | None) -> Settings:  # noqa: ARG001 - leaves nothing open
        one = model.half_rule()
        return formula(one.gain_degC_per_pct, one.time_constant_s, one.dead_time_s)

    return applied
