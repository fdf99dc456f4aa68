"""What gains do not tell of the words that were proven: controller, changes beside the gains, conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from heatertune.codec import LEFT_OUT
from heatertune.settings import Conditions, SensorSettings, WordSettings
from heatertune.units import check

__all__ = ["BoostView", "DesignProvenance", "RampView"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RampView:
    """The setpoint ramp; hold: how far from the reading the setpoint may be, null: as far as it goes."""

    step: int | float
    calls: int
    hold: int | float | None
    hold_degC: float | None
    degC_per_min: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BoostView:
    """Full power until so near to the setpoint, and again from so far on."""

    within_degC: float
    again_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignProvenance:
    """How a design became words, and what these were proven under.

    Attributes:
        target: the controller.
        range_degC: of the sensor, at its lowest and highest reading [°C].
        input: range of the analog module; None: a plain one.
        words_by, refined: see `heatertune.settings.WordSettings`.
        power_most_pct: the controller never asks for more [%]; None: as it would.
        setpoint_ramp: None: the setpoint goes to its end at once.
        boost: None: the controller always has the heater.
        conditions: of the proof.
        files: "spec" and "profile" → digest of what that file asked for, where there is one.
        way_on: of words that fail, what was found when they were made: what would pass, or that nothing tried does.

    Raises:
        OutOfRange, UnknownName: what the options of these names cannot be.
    """

    target: str
    range_degC: tuple[float, float] = (0.0, 100.0)
    input: str | None = field(default=None, metadata=LEFT_OUT)
    words_by: str = "auto"
    refined: bool = False
    power_most_pct: float | None = None
    setpoint_ramp: RampView | None = None
    boost: BoostView | None = field(default=None, metadata=LEFT_OUT)
    conditions: Conditions
    files: Mapping[str, str] = field(default_factory=dict)
    way_on: str | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        SensorSettings(range_degC=self.range_degC, input=self.input)
        WordSettings(words_by=self.words_by, refined=self.refined)
        if self.power_most_pct is not None:
            check("power_most_pct", self.power_most_pct, above=0.0, most=100.0)
