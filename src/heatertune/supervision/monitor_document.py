"""What supervision.json holds: the monitor, how soon it sees each fault, its program; checked when it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from heatertune.codec import decode, read_document, register_schema
from heatertune.errors import DocumentError
from heatertune.supervision.monitor import RING, Numbers
from heatertune.supervision.text.program_check import MonitorProgram

__all__ = [
    "SCHEMA", "CardView", "FaultView", "OffView", "SpreadView", "SupervisionView", "TraceView", "read_supervision",
]

SCHEMA: Final = "heatertune/supervision/2"


@dataclass(frozen=True, slots=True, kw_only=True)
class SpreadView:
    """A figure over all heaters that show it."""

    median: float
    p95: float
    worst: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultView:
    """How soon a fault is seen.

    Attributes:
        name: of the fault.
        heaters: that had it.
        detected: of these, on so many it was seen.
        detection_s: from the fault to the alarm, where it was seen; None: nowhere [s].
        peak_degC: the hottest of each heater, switched off by the alarm [°C].
        alarms: which alarm → on how many heaters.
        missed_because: why it is not always seen; None: it is, or nobody knows.
    """

    name: str
    heaters: int
    detected: int
    detection_s: SpreadView | None
    peak_degC: SpreadView
    alarms: Mapping[str, int]
    missed_because: str | None

    def __post_init__(self) -> None:
        if not 0 <= self.detected <= self.heaters or sum(self.alarms.values()) != self.detected:
            raise DocumentError(f"detected: {self.detected} of {self.heaters}, {sum(self.alarms.values())} alarms")
        if (self.detection_s is None) != (self.detected == 0):
            raise DocumentError(f"detection_s: expected where a fault is seen; {self.detected} are")


@dataclass(frozen=True, slots=True, kw_only=True)
class CardView:
    """The input module: the temperature at count 0 and of a count [°C]."""

    zero_degC: float
    step_degC: float

    def __post_init__(self) -> None:
        if not self.step_degC > 0.0:
            raise DocumentError(f"step_degC: {self.step_degC:g}; expected more than 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class OffView:
    """A rule that is off, and why."""

    rule: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceView:
    """A fault on one heater: temperatures if nobody sees it, and switched off by the alarm [s from the fault, °C]."""

    name: str
    time_s: tuple[float, ...]
    left_degC: tuple[float, ...]
    stopped_degC: tuple[float, ...]
    alarm_s: float | None


@register_schema(SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class SupervisionView:
    """The document.

    Attributes:
        warning: what it does not replace.
        target: of the controller.
        words: it holds.
        scan_s: from one call of the monitor to the next [s].
        setpoint_degC: the highest setpoint of use [°C].
        card: the input module.
        numbers: of the monitor, see `heatertune.supervision.monitor.Numbers`.
        told: what they mean.
        heaters: possible ones, around which others were drawn.
        spread_pct: half width of gain and lags [%].
        ambient_spread_degC: half width of the ambient temperature [°C].
        noise_degC: least and most noise of the sensor [°C].
        seed: of the first heater that was drawn.
        checked: fresh heaters that it was tried on.
        false_trips: on these.
        widened_for: heaters before, for which the limits were made wider.
        off: rules that are off.
        faults: how soon each is seen.
        not_tested: what no heater lived through.
        program: of the monitor in the target's own language.
        beside: how soon the target sees each fault itself, where it can do less than the monitor.
        trace: a picture's.
    """

    warning: str
    target: str
    words: Mapping[str, float]
    scan_s: float
    setpoint_degC: float
    card: CardView
    numbers: Mapping[str, int]
    rules: tuple[str, ...]
    heaters: int
    spread_pct: float
    ambient_spread_degC: float
    noise_degC: tuple[float, float]
    seed: int
    checked: int
    false_trips: int
    widened_for: int
    off: tuple[OffView, ...]
    faults: tuple[FaultView, ...]
    not_tested: tuple[str, ...]
    program: MonitorProgram
    built_in: tuple[FaultView, ...]
    trace: TraceView

    def __post_init__(self) -> None:
        if tuple(self.numbers) != Numbers._fields:
            raise DocumentError(f"numbers: {', '.join(self.numbers)}; expected {', '.join(Numbers._fields)}")
        if not self.scan_s > 0.0:
            raise DocumentError(f"scan_s: {self.scan_s:g}; expected more than 0")
        numbers = Numbers(**self.numbers)
        if numbers.block < 1 or not 0 <= numbers.delay_low <= numbers.delay_high:
            raise DocumentError(f"numbers: block {numbers.block}, delay_low {numbers.delay_low}, delay_high "
                                f"{numbers.delay_high}; expected 1 or more, and 0 or more, and no less than delay_low")
        reach = numbers.delay_high + max(numbers.slow_blocks, numbers.fast_blocks)
        if reach >= RING:
            raise DocumentError(f"numbers: windows and delay_high reach {reach} blocks back; expected less than {RING}")


def read_supervision(path: str | Path) -> SupervisionView:
    """Return what a supervision.json holds.

    Raises:
        DocumentError: it is none, or does not hold together; the error names the field.
    """
    return decode(SupervisionView, read_document(path, SCHEMA), path)
