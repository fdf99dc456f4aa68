"""What an experiment is to do, what ends it at once, and when enough is known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Final

from heatertune.errors import InputError
from heatertune.model.model_values import FittedModel
from heatertune.units import check
from heatertune.writing import read_text

__all__ = ["RATE_ROWS", "AbortLimits", "Aims", "RelaySchedule", "Steps", "read_plan"]

_HEADS: Final = "time_s,power_pct"
_RELAY: Final = "rest_s,on_degC,off_degC,high_pct,low_pct,duration_s"
#: so many readings are looked at for the rate
RATE_ROWS: Final = 3
#: share of the sensor's range at its ends in which a reading is none
_EDGE: Final = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class AbortLimits:
    """What ends an experiment at once.

    Attributes:
        temperature_degC: none as high as this [°C].
        rate_degC_per_min: none faster, up or down, over three readings [°C/min]; None: any.
        silence_s: no new scan for so long by this machine's clock [s].

    Raises:
        OutOfRange: a number that is none.
    """

    temperature_degC: float
    rate_degC_per_min: float | None = None
    silence_s: float = 10.0

    def __post_init__(self) -> None:
        check("temperature_degC", self.temperature_degC)
        check("silence_s", self.silence_s, above=0.0)
        if self.rate_degC_per_min is not None:
            check("rate_degC_per_min", self.rate_degC_per_min, above=0.0)

    def broken(self, latest: Sequence[tuple[float, float]], sensor_degC: tuple[float, float]) -> tuple[str, str] | None:
        """Return what the latest readings break, a word and a sentence; None: nothing.

        Args:
            latest: time [s] and reading [°C] of each, the latest last.
            sensor_degC: both ends of the sensor's range [°C].
        """
        low, high = sensor_degC
        edge, (now_s, degC), (first_s, first) = _EDGE * (high - low), latest[-1], latest[0]
        if not low + edge < degC < high - edge:
            return "sensor", (
                f"the reading is {degC:.2f} °C, an end of its range {low:g}…{high:g} °C: is the sensor there?")
        if not degC < self.temperature_degC:
            return "limit", f"{degC:.2f} °C: the limit is {self.temperature_degC:g} °C"
        if self.rate_degC_per_min is not None and len(latest) == RATE_ROWS and now_s > first_s:
            rate = 60.0 * (degC - first) / (now_s - first_s)
            if not abs(rate) <= self.rate_degC_per_min:
                return "rate", f"{rate:.3g} °C/min: the limit is {self.rate_degC_per_min:g} °C/min"
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Aims:
    """When enough is known.

    Attributes:
        shares: field of the model → half of its 95 % interval over its value, at most; none: the plan decides.
        every_rows: a fit after so many more rows.
    """

    shares: Mapping[str, float] = field(default_factory=dict)
    every_rows: int = 40

    def reached(self, fitted: FittedModel) -> bool:
        """Return whether each interval is as narrow as asked; one that is open or unknown is not."""
        for name, share in self.shares.items():
            interval = fitted.ci95.get(name)
            if interval is None or interval.low is None or interval.high is None:
                return False
            if interval.high - interval.low > 2.0 * share * abs(getattr(fitted.model, name)):
                return False
        return True


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """A plan of powers at instants.

    Attributes:
        steps: instants [s] and powers [%], the first at 0 s; the last is held as long as the longest before it.
    """

    steps: tuple[tuple[float, float], ...]

    @property
    def powers(self) -> set[float]:
        """All its powers [%]."""
        return {power for _, power in self.steps}

    @property
    def ends_s(self) -> float:
        """After so long it is over [s]."""
        return self.steps[-1][0] + max(after - before for (before, _), (after, _) in pairwise(self.steps))

    def power(self, after_s: float, _degC: float, _last: float | None) -> float:
        """Return the power after so long [%]."""
        return next(power for at, power in reversed(self.steps) if at <= after_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class RelaySchedule:
    """A plan that switches by the reading.

    Attributes:
        rest_s: at the low power first [s].
        on_degC, off_degC: down to one the high power comes, up to the other it goes [°C].
        high_pct, low_pct: the powers [%].
        duration_s: after so long it is over [s].

    Raises:
        OutOfRange: a number that is none, both powers or both temperatures the wrong way round.
    """

    rest_s: float
    on_degC: float
    off_degC: float
    high_pct: float
    low_pct: float
    duration_s: float

    def __post_init__(self) -> None:
        check("rest_s", self.rest_s, least=0.0)
        check("duration_s", self.duration_s, above=self.rest_s)
        check("low_pct", self.low_pct, least=0.0, most=100.0)
        check("high_pct", self.high_pct, above=self.low_pct, most=100.0)
        check("on_degC", self.on_degC)
        check("off_degC", self.off_degC, above=self.on_degC)

    @property
    def powers(self) -> set[float]:
        """Both powers [%]."""
        return {self.high_pct, self.low_pct}

    @property
    def ends_s(self) -> float:
        """After so long it is over [s]."""
        return self.duration_s

    def power(self, after_s: float, degC: float, last: float | None) -> float:
        """Return the power after so long, at a reading, where it was another or none before [%]."""
        if after_s < self.rest_s:
            return self.low_pct
        if self.on_degC < degC < self.off_degC and last is not None and after_s > self.rest_s:
            return last if last == self.high_pct else self.low_pct
        return self.high_pct if degC <= self.on_degC else self.low_pct


def read_plan(path: str | Path) -> Steps | RelaySchedule:
    """Return a plan as `heatertune plan -o` writes it: powers at instants, or a relay's settings.

    Raises:
        InputError: it cannot be read, or a line is none of a plan; the message names it.
        OutOfRange: a number of a relay that cannot be.
    """
    try:
        lines = read_text(path).splitlines()
    except OSError as problem:
        raise InputError(f"{path}: cannot be read: {problem.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: no text; expected {_HEADS}") from None
    head = lines[0].strip() if lines else ""
    rest = [(number, line) for number, line in enumerate(lines[1:], start=2) if line.strip()]
    if head == _RELAY:
        number, line = rest[0] if rest else (2, "")
        values = _numbers(f"{path}, line {number}", line, _RELAY.split(","))
        return RelaySchedule(**dict(zip(_RELAY.split(","), values, strict=True)))
    if head != _HEADS:
        raise InputError(f"{path}, line 1: {head!r}; expected {_HEADS}, or {_RELAY}")
    steps = list[tuple[float, float]]()
    for number, line in rest:
        steps.append(_step(f"{path}, line {number}", line, steps))
    if len(steps) < 2:
        raise InputError(f"{path}: {len(steps)} steps; expected the power at 0 s and one step at least")
    return Steps(steps=tuple(steps))


def _numbers(place: str, line: str, names: Sequence[str]) -> list[float]:
    try:
        found = [float(cell) for cell in line.split(",")]
    except ValueError:
        found = []
    if len(found) != len(names) or not all(map(math.isfinite, found)):
        raise InputError(f"{place}: {line.strip()!r}; expected {len(names)} numbers: {', '.join(names)}")
    return found


def _step(place: str, line: str, before: Sequence[tuple[float, float]]) -> tuple[float, float]:
    at, power = _numbers(place, line, _HEADS.split(","))
    if not 0.0 <= power <= 100.0:
        raise InputError(f"{place}: power {power:g}; expected 0…100 %")
    if not (before[-1][0] < at if before else at == 0.0):
        raise InputError(f"{place}: {at:g} s; expected {'more than in the line above' if before else '0 s first'}")
    return at, power
