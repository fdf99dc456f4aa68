"""The effect of a measured disturbance on a heater, as identified by a fit."""

from __future__ import annotations

from dataclasses import dataclass

from heatertune.errors import OutOfRange
from heatertune.units import check

__all__ = ["DisturbanceEffect"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DisturbanceEffect:
    """A measured disturbance as equivalent power at the heater's input, acting through the heater's own lags.

    Attributes:
        column: its name in the log.
        pct_per_unit: equivalent power of one unit [% of full power per unit]; below 0: it cools.
        pct_per_unit_ci95: 95 % interval [% per unit].
        delay_s: its dead time [s].
        lead_s: how much earlier than the heater's power it acts; below 0: later [s].
        lead_s_ci95: 95 % interval [s].
        calm, strong: 1st and 99th percentile of the logged level [units].
        delta_bic: decrease of BIC with the disturbance (AR(1) errors); significant from 10.
        delta_bic_own_lag: decrease of BIC if it acts through a separate lag instead.
        own_lag_s: that lag [s].

    Raises:
        OutOfRange: an interval without its value, a negative delay, equal levels.
    """

    column: str
    pct_per_unit: float
    pct_per_unit_ci95: tuple[float, float]
    delay_s: float
    lead_s: float
    lead_s_ci95: tuple[float, float]
    calm: float
    strong: float
    delta_bic: float
    delta_bic_own_lag: float
    own_lag_s: float

    def __post_init__(self) -> None:
        for name in ("pct_per_unit", "lead_s"):
            value, (low, high) = getattr(self, name), getattr(self, f"{name}_ci95")
            if not low <= value <= high:
                raise OutOfRange(name, value, f"{low:g}…{high:g}, its own interval")
        check("delay_s", self.delay_s, least=0.0)
        if not self.strong > self.calm:
            raise OutOfRange("strong", self.strong, f"> calm = {self.calm:g}")

    @property
    def acts(self) -> bool:
        """Whether the log shows that it acts, and in which direction."""
        low, high = self.pct_per_unit_ci95
        return self.delta_bic >= 10.0 and low * high > 0.0

    @property
    def as_power(self) -> bool:
        """Whether it acts through the heater's own lags, as far as the log distinguishes this from a separate lag."""
        return self.delta_bic >= self.delta_bic_own_lag - 10.0

    @property
    def sentence(self) -> str:
        """The result as a sentence."""
        low, high = self.pct_per_unit_ci95
        effect = (f"The disturbance {self.column!r} acts as {self.pct_per_unit:.3g} % of full power per unit "
                  f"({low:.3g} … {high:.3g}), {self.delay_s:.3g} s after it changes and {abs(self.lead_s):.3g} s "
                  f"{'before' if self.lead_s >= 0.0 else 'after'} the power would; BIC {self.delta_bic:.0f} below that "
                  "of a heater without it")
        if not self.acts:
            return (f"The log does not show that the disturbance {self.column!r} acts: {self.pct_per_unit:.3g} % per "
                    f"unit, interval {low:.3g} … {high:.3g}, BIC {self.delta_bic:.0f} lower with it. Log a step of it "
                    "with the power held.")
        own = "" if self.as_power else (f"; through a lag of its own, {self.own_lag_s:.3g} s, it fits better still "
                                        f"(BIC {self.delta_bic_own_lag:.0f} lower)")
        return f"{effect}{own}. Its effect was taken out of the readings before the heater was fitted."
