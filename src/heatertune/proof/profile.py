"""A profile: ramps and soaks along which the program around the controller leads the setpoint, as kilns are fired."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.model.values import HeaterModel
from heatertune.proof.scenario import can_hold
from heatertune.units import check, count

__all__ = ["Leg", "Profile", "Segment", "told_rate"]

_DIGITS: Final = 12  # of a digest, as it is told


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A ramp and the soak at its end.

    Attributes:
        target_degC: of both [°C].
        rate_degC_per_s: how fast the setpoint goes there, up or down [°C/s]; None: in `ramp_s`.
        ramp_s: in what time it does [s]; None: at the rate.
        soak_s: how long it stays there [s].

    Raises:
        InputError: neither or both of rate and time.
        OutOfRange: a rate or time that is not above 0, a soak below 0.
    """

    target_degC: float
    rate_degC_per_s: float | None = None
    ramp_s: float | None = None
    soak_s: float = 0.0

    def __post_init__(self) -> None:
        if (self.rate_degC_per_s is None) == (self.ramp_s is None):
            raise InputError("a ramp has a rate or a duration; expected one of them")
        check("target_degC", self.target_degC, least=-273.15)
        for name in ("rate_degC_per_s", "ramp_s"):
            if (value := getattr(self, name)) is not None:
                check(name, value, above=0.0)
        check("soak_s", self.soak_s, least=0.0)

    def ramp_from(self, start_degC: float) -> float:
        """Return how long the ramp takes from a temperature on [s]."""
        if self.rate_degC_per_s is None:
            return float(self.ramp_s or 0.0)
        return abs(self.target_degC - start_degC) / self.rate_degC_per_s


class Leg(NamedTuple):
    """A ramp, a soak, or what comes after a last ramp without one: from when on, ends, how long, of which segment.

    Attributes:
        begin_s: after the begin of the profile [s].
        from_degC, to_degC: setpoint at its ends [°C].
        duration_s: [s].
        segment: from 1.
        soaks: whether it is a soak.
    """

    begin_s: float
    from_degC: float
    to_degC: float
    duration_s: float
    segment: int
    soaks: bool

    @property
    def degC_per_s(self) -> float:
        """How fast the setpoint moves [°C/s]; 0: a soak."""
        return (self.to_degC - self.from_degC) / self.duration_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """Segments one after the other.

    Attributes:
        name: of its file.
        segments: in order.

    Raises:
        InputError: no segment.
    """

    name: str
    segments: tuple[Segment, ...]

    def __post_init__(self) -> None:
        if not self.segments:
            raise InputError("no segment; expected at least one, with target, ramp and soak")

    @property
    def label(self) -> str:
        """What it is called, and what tells it from others of that name."""
        digest = hashlib.sha256(repr(self.segments).encode()).hexdigest()[:_DIGITS]
        return f"{self.name} ({count(len(self.segments), 'segment')}, sha256 {digest})"

    def legs(self, start_degC: float, watch_s: float = 0.0) -> Iterator[Leg]:
        """Return its ramps and soaks, those left out that take no time.

        Args:
            start_degC: setpoint before the first ramp [°C].
            watch_s: how long the last target is held where it has no soak, so that what its ramp leaves is seen [s].
        """
        begin, reached = 0.0, start_degC
        for number, segment in enumerate(self.segments, 1):
            target = segment.target_degC
            for start, duration in ((reached, segment.ramp_from(reached)), (target, segment.soak_s)):
                if duration > 0.0:
                    yield Leg(begin, start, target, duration, number, start == target)
                    begin += duration
            reached = target
        if watch_s > 0.0 and self.segments[-1].soak_s == 0.0:
            yield Leg(begin, reached, reached, watch_s, len(self.segments), soaks=False)

    def demand_followed(self, models: Sequence[tuple[HeaterModel, float]]) -> None:
        """Refuse a ramp that a heater cannot follow: at full power up, or without power down, as nothing cools it.

        A heater follows where its power a = (setpoint − ambient + lags·rate)/gain is one that it has.

        Args:
            models: the plausible heaters and their ambients [°C]; the ramp begins at that of the first.

        Raises:
            InputError: with the fastest ramp that all of them can follow.
        """
        for leg in self.legs(models[0][1]):
            if not all(can_hold(model, leg.to_degC, ambient) for model, ambient in models):
                least, most = _reach(models)
                raise InputError(f"{self.name}, segment {leg.segment}: target {leg.to_degC:g} °C; expected more than "
                                 f"{least:.4g} and less than {most:.4g} °C, which every plausible heater can hold")
            rate, fastest = leg.degC_per_s, min(_fastest(leg, model, ambient) for model, ambient in models)
            if abs(rate) > fastest:
                way = "at full power" if _by_power(leg, models[0][0]) else "without power"
                raise InputError(
                    f"{self.name}, segment {leg.segment}: {told_rate(abs(rate))} to {leg.to_degC:g} °C is faster than "
                    f"the weakest plausible heater follows {way} there; expected at most {told_rate(fastest)}")


def told_rate(degC_per_s: float) -> str:
    """Return a rate in the unit in which it is a handy number."""
    for factor, unit in ((1.0, "s"), (60.0, "min")):
        if factor * degC_per_s >= 1.0:
            return f"{factor * degC_per_s:.3g} °C/{unit}"
    return f"{3600.0 * degC_per_s:.3g} °C/h"


def _by_power(leg: Leg, model: HeaterModel) -> bool:
    return (leg.to_degC > leg.from_degC) == (model.gain_degC_per_pct > 0.0)


def _fastest(leg: Leg, model: HeaterModel, ambient_degC: float) -> float:
    """Return how fast a heater that can hold the end of a leg can follow up to it, where it is hardest [°C/s]."""
    end = ambient_degC + (100.0 * model.gain_degC_per_pct if _by_power(leg, model) else 0.0)
    return abs(end - leg.to_degC) / sum(model.lags_s)


def _reach(models: Sequence[tuple[HeaterModel, float]]) -> tuple[float, float]:
    """Return between which temperatures all heaters can hold any [°C]."""
    ends = [sorted((ambient, ambient + 100.0 * model.gain_degC_per_pct)) for model, ambient in models]
    return max(low for low, _ in ends), min(high for _, high in ends)
