"""A measured disturbance on its way to the controller's output: what the program writes into which input.

Static: the input is a straight line of the disturbance's reading, so that the power that the disturbance stands for is
given at once, and 0 at the disturbance's calm level.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.plc.core import Sensor, count
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import Certificate, round_half_away
from heatertune.units import check

__all__ = ["FeedForward", "FeedForwardHooks", "feed_forward"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForward:
    """The straight line that a program writes into a controller's input.

    Attributes:
        column: the disturbance's name in the log.
        low, high: the disturbance at the lowest and highest reading of its sensor [units of the log].
        calm: level at which nothing is added [units of the log].
        at_low, at_high: what the input holds there, as its format holds it [units of the input].
        pct_per_unit: power that one unit of the disturbance adds, as the input realises it [%].
        switched: whether the sensor is a contact: `low` where it is open, `high` where it is closed.
    """

    column: str
    low: float
    high: float
    calm: float
    at_low: Number
    at_high: Number
    pct_per_unit: float
    switched: bool = False

    def at(self, level: float, counts: int) -> Number:
        """Return the input's value at a level of the disturbance, read in so many counts; beyond its range: its end.

        A whole input is cut towards zero, a REAL computed as the exported program does.
        """
        read = count(Sensor(self.low, self.high - self.low, counts), level)
        if isinstance(self.at_low, int):
            return int(self.at_low + (self.at_high - self.at_low) * read / counts)
        return single(single(read * single((self.at_high - self.at_low) / counts)) + self.at_low)


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForwardHooks:
    """A controller's input for a measured disturbance.

    Attributes:
        word: its name.
        per_pct: its units per percent of power.
        most: largest size that it takes [units].
        whole: whether it holds whole numbers only, else REALs.
        listened: values of words → those with which the controller listens to it.
        given: (parameters of the core, value) → those with that value at the input.
        listing: (line, certificate) → file name → content: the program that writes it.
    """

    word: str
    per_pct: float
    most: float
    whole: bool
    listened: Callable[[Mapping[str, Number]], Mapping[str, Number]]
    set_disturbance: Callable[[Any, Number], Any]
    listing: Callable[[FeedForward, Certificate], Mapping[str, str]]


def feed_forward(
    feed: FeedForwardHooks, *, column: str, pct_per_unit: float, calm: float, low: float, high: float,
    switched: bool = False
) -> FeedForward:
    """Return the line that takes back what a disturbance does, as the input holds it.

    Args:
        feed: the input.
        column: the disturbance's name.
        pct_per_unit: power that one unit of the disturbance stands for [%].
        calm: level at which nothing is added [units of the log].
        low: the disturbance at the sensor's lowest reading [units of the log].
        high: likewise at its highest.
        switched: see `FeedForward`.

    Raises:
        OutOfRange: an empty sensor range, or a calm level outside it.
        NotRepresentable: the input cannot hold the line, or rounding would leave nothing of it.
    """
    check("disturbance range", low)
    check("disturbance range", high)
    if not high > low:
        raise OutOfRange("disturbance range", high, f"> its low end, {low:g}")
    if not low <= calm <= high:
        raise OutOfRange("disturbance's calm level", calm, f"{low:g}…{high:g}, the range of its sensor")
    at_low, at_high = (_stored(feed, -pct_per_unit * feed.per_pct * (level - calm)) for level in (low, high))
    if at_high == at_low:
        raise NotRepresentable(f"input {feed.word}", pct_per_unit * feed.per_pct * (high - low), "a unit or more",
                               "a disturbance as weak as this needs no feed-forward")
    realised = (at_high - at_low) / feed.per_pct / (high - low)
    return FeedForward(column=" ".join(column.split()), low=low, high=high, calm=calm, at_low=at_low, at_high=at_high,
                       pct_per_unit=realised, switched=switched)


def _stored(feed: FeedForwardHooks, exact: float) -> Number:
    word = round_half_away(exact) if feed.whole else single(exact)
    if abs(word) > feed.most:
        raise NotRepresentable(f"input {feed.word}", exact, f"{-feed.most:g}…{feed.most:g}",
                               "a narrower range of the disturbance's sensor would fit")
    return word
