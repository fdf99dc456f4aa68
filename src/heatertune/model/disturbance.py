"""The effect of a measured disturbance on a heater, as identified by a fit."""

from __future__ import annotations

from dataclasses import dataclass

from heatertune.errors import OutOfRange
from heatertune.units import check

__all__ = ["CoolingEffect", "DisturbanceEffect", "LossEffect"]


_SURE = 10.0  # BIC points


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


@dataclass(frozen=True, slots=True, kw_only=True)
class CoolingEffect:
    """A cooler in addition to the heater, as a fit identifies it: negative power at the heater's own input.

    Attributes:
        cooling_gain: effect of full cooling as a fraction of that of full heating.
        cooling_gain_ci95: 95 % interval.
        lead_s: how much earlier than the heater's power it acts; below 0: later [s].
        lead_s_ci95: 95 % interval [s].
        delta_bic: decrease of BIC with the cooler (AR(1) errors); significant from 10.
        delta_bic_own_lag: decrease of BIC if it acts through a separate lag instead.
        own_lag_s: that lag [s].
        delta_bic_loss: by how much a cooler that multiplies the heat loss explains the log better; below 0: worse.
    """

    cooling_gain: float
    cooling_gain_ci95: tuple[float, float]
    lead_s: float
    lead_s_ci95: tuple[float, float]
    delta_bic: float
    delta_bic_own_lag: float
    own_lag_s: float
    delta_bic_loss: float = 0.0

    @property
    def acts(self) -> bool:
        """Whether the log shows that it cools."""
        return self.delta_bic >= _SURE and self.cooling_gain_ci95[0] > 0.0

    @property
    def at_once(self) -> bool:
        """Whether it may act at the same time as the heater's power."""
        low, high = self.lead_s_ci95
        return low <= 0.0 <= high

    @property
    def misleads(self) -> bool:
        """Whether a fit that takes it as negative power of the heater does not give the heater either."""
        return self.delta_bic_loss <= _SURE < self.delta_bic_own_lag - self.delta_bic

    @property
    def doubts(self) -> tuple[str, ...]:
        """How it differs from negative power at the heater's input, a clause each; empty: the log shows nothing."""
        if self.delta_bic_loss > _SURE:
            low, high = self.cooling_gain_ci95
            return ("the cooler multiplies the heat loss, so that it is the stronger the hotter the heater is: from "
                    f"{low:.3g} times full heating at the coldest reading at which it cooled to {high:.3g} at the "
                    "hottest",)
        if not self.acts:
            return (f"the log does not show that the cooler acts (BIC {self.delta_bic:.0f} lower with it)",)
        doubts = []
        if self.delta_bic_own_lag > self.delta_bic + _SURE:
            doubts.append(f"it acts through a lag of its own, {self.own_lag_s:.3g} s")
        if not self.at_once:
            doubts.append(f"it acts {abs(self.lead_s):.3g} s {'before' if self.lead_s > 0.0 else 'after'} the heater's "
                          "power would")
        return tuple(doubts)

    @property
    def sentence(self) -> str:
        """The result as a sentence."""
        low, high = self.cooling_gain_ci95
        return (f"Full cooling acts as {self.cooling_gain:.3g} times full heating, of the opposite sign ({low:.3g} … "
                f"{high:.3g}); BIC {self.delta_bic:.0f} below that of a heater without a cooler.")


@dataclass(frozen=True, slots=True, kw_only=True)
class LossEffect:
    """A fan or a flow that multiplies the heat loss: gain and time constant are both smaller while it is on.

    Attributes:
        column: its name in the log.
        factor: by how much the loss is larger at the strong level than at the calm one, as a fraction of the latter.
        factor_ci95: 95 % interval.
        calm, strong: 1st and 99th percentile of the logged level [units].
        delta_bic: decrease of BIC with it (AR(1) errors).
        delta_bic_as_power: decrease of BIC compared with an effect as equivalent power.
    """

    column: str
    factor: float
    factor_ci95: tuple[float, float]
    calm: float
    strong: float
    delta_bic: float
    delta_bic_as_power: float

    @property
    def sentence(self) -> str:
        """The result as a sentence."""
        low, high = self.factor_ci95
        at_strong, at_calm = f"at {self.strong:.3g}", f"at {self.calm:.3g}"
        return (
            f"{self.column!r} multiplies the heat loss: {at_strong} it is {1.0 + self.factor:.3g} times that {at_calm} "
            f"({1.0 + low:.3g} … {1.0 + high:.3g}; BIC {self.delta_bic:.0f} below that of a heater without it, "
            f"{self.delta_bic_as_power:.0f} below that of equivalent power). Its effect was taken out of the readings; "
            f"the plausible heaters are those {at_calm} and {at_strong}.")
