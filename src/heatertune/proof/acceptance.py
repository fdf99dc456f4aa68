"""What the runs of a proof are held against, and what is known of the heater that no run shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from heatertune.model.values import HeaterModel
from heatertune.pid.values import Margins, PidDesign
from heatertune.proof.criteria import Limits
from heatertune.proof.specification import Specification
from heatertune.proof.verdict import Heard

__all__ = ["Acceptance"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceptance:
    """What a proof's verdict rests on beside its runs.

    Attributes:
        limits: that every run must keep.
        specification: behind the limits, in its user's words; None: the limits were given as they are.
        margins_of: margins of a design on a heater; None: margins are not judged.
        reading_step_degC: step or noise of a reading on the heater, where that is more than the controller's own [°C].
        heard: what the fit found and the user knows.
    """

    limits: Limits = field(default_factory=Limits)
    specification: Specification | None = None
    margins_of: Callable[[HeaterModel, PidDesign], Margins] | None = None
    reading_step_degC: float = 0.0
    heard: Heard = field(default_factory=Heard)

    def margins(self, design: PidDesign | None, models: Iterable[HeaterModel]) -> dict[HeaterModel, Margins]:
        """Return the margins on each model; none where they are not judged, or the controller is no PID."""
        if self.margins_of is None or design is None:
            return {}
        return {model: self.margins_of(model, design) for model in dict.fromkeys(models)}

    def step_power_pct(self, design: PidDesign | None, reading_degC: float) -> float | None:
        """Return the power that one step of the reading moves [%]; None where the controller is no PID.

        Args:
            design: as the words realise it.
            reading_degC: what the controller and the scenario make of a reading's step [°C].
        """
        return None if design is None else design.step_power_pct_per_degC * max(self.reading_step_degC, reading_degC)
