"""The doors of a room, written down once.

A room is one controller. Its four doors are `encode` (design → words), `decode` (words → the design the PLC will
really run), `step` (one scan in the PLC's own arithmetic) and `export` (words → text). Proof and chain
know rooms only through this file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from heatertune.errors import OutOfRange
from heatertune.pid.values import PidDesign
from heatertune.units import check

__all__ = ["Certificate", "Room", "Scaling", "Scan", "Switch", "Timing", "WordField", "Words", "check_fields"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """How the temperature becomes the controller's number: a linear sensor range.

    Attributes:
        low_degC, high_degC: the temperatures at the lowest and highest reading [°C].

    Raises:
        OutOfRange: a range that is empty or upside down.
    """

    low_degC: float = 0.0
    high_degC: float = 100.0

    def __post_init__(self) -> None:
        check("low_degC", self.low_degC, least=-273.15)
        check("high_degC", self.high_degC)
        if not self.high_degC > self.low_degC:
            raise OutOfRange("high_degC", self.high_degC, f"> low_degC = {self.low_degC:g}")

    @property
    def span_degC(self) -> float:
        """Width of the range [°C]."""
        return self.high_degC - self.low_degC


@dataclass(frozen=True, slots=True, kw_only=True)
class WordField:
    """One word of a room: its place, format, range and meaning."""

    name: str
    address: str
    format: str
    low: int
    high: int
    comment: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """The numbers the PLC will hold, for one target.

    Attributes:
        target: the room's name.
        values: word name → integer as stored.
        scaling: the sensor range the words were made for.
        sample_time_s: interval at which the controller is called [s].
    """

    target: str
    values: Mapping[str, int]
    scaling: Scaling
    sample_time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """A point the manual leaves open: the settings it may have, and the one taken by default."""

    name: str
    settings: tuple[str, ...]
    default: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """When the room wants to be called.

    Attributes:
        scan_s: interval between two calls of `step` [s].
        pwm_period_s: PWM period where the controller makes the PWM itself [s], else None (the PWM
            is an actuator behind the controller's output).
    """

    scan_s: float
    pwm_period_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """What one scan gave.

    Attributes:
        power_pct: heater power asked for, 0…100 % of full power.
        output: the same in the controller's own units.
        flags: the controller's flags after the scan, name → set?
    """

    power_pct: float
    output: int
    flags: Mapping[str, bool] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """What an export says about its proof.

    Attributes:
        verdict: "PASS" or "FAIL".
        lines: one line per fact (models proven on, worst criterion, …); no date, no locale.
        forced: whether the words left in spite of a FAIL.
    """

    verdict: str
    lines: tuple[str, ...] = ()
    forced: bool = False


def check_fields(fields: tuple[WordField, ...], words: Words) -> None:
    """Raise OutOfRange for the first word that is missing, unknown, not whole or outside its field's range."""
    names = [each.name for each in fields]
    unknown = sorted(set(words.values) - set(names))
    if unknown:
        raise OutOfRange(f"word {unknown[0]}", words.values[unknown[0]], f"one of {', '.join(names)}")
    for each in fields:
        value = words.values.get(each.name)
        if isinstance(value, bool) or not isinstance(value, int) or not each.low <= value <= each.high:
            raise OutOfRange(f"word {each.name}", value, f"a whole number {each.low}…{each.high}")


class Room(Protocol):
    """One controller."""

    @property
    def name(self) -> str:
        """Name on the command line."""

    @property
    def title(self) -> str:
        """Controller, manual and edition."""

    @property
    def fields(self) -> tuple[WordField, ...]:
        """The words, in the order in which they are typed in."""

    @property
    def switches(self) -> tuple[Switch, ...]:
        """What the manual leaves open."""

    @property
    def sample_times_s(self) -> tuple[float, float, float]:
        """Shortest, longest and step of the sampling interval the target's timer can do [s]."""

    def encode(self, design: PidDesign, scaling: Scaling) -> Words:
        """Round the design to words, once; raise NotRepresentable for what does not fit."""

    def decode(self, words: Words) -> PidDesign:
        """Return the design as the words realise it."""

    def check(self, words: Words) -> None:
        """Raise OutOfRange naming the first word that is missing, unknown, not whole or out of its range."""

    def timing(self, words: Words) -> Timing:
        """Return when the room wants to be called."""

    def measure(self, words: Words, temperature_degC: float) -> int:
        """Return the reading for a temperature, quantised and limited as the input module does [units]."""

    def start(self, words: Words, switches: Mapping[str, str]) -> Any:
        """Return the cold state for these settings of the switches."""

    def step(self, words: Words, state: Any, setpoint: int, reading: int, switches: Mapping[str, str],
             *, cycle_start: bool = True) -> tuple[Any, Scan]:
        """Run one scan; pure, total for every bit pattern.

        `setpoint` and `reading` are in the controller's units; `cycle_start` tells a room that makes
        its own PWM that a PWM period begins with this scan.
        """

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what one scan reads, in the controller's units; the first two are setpoint and reading."""

    def scan(self, state: Any, inputs: Mapping[str, int]) -> tuple[Any, Scan]:
        """Run one scan on all of its inputs; those not named stay as the words have them. Pure, as `step`."""

    def export(self, words: Words, certificate: Certificate) -> dict[str, str | bytes]:
        """Return file name → content; the same words and certificate always give the same bytes."""
