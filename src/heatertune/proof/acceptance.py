"""What the runs of a proof are held against, and what is known of the heater that no run shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from heatertune.model.values import HeaterModel
from heatertune.pid.values import Margins, PidDesign
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.specification import Specification
from heatertune.proof.verdict import FitDiagnostics

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

    limits: LoopLimits = field(default_factory=LoopLimits)
    specification: Specification | None = None
    margins_of: Callable[[HeaterModel, PidDesign], Margins] | None = None
    reading_step_degC: float = 0.0
    diagnostics: FitDiagnostics = field(default_factory=FitDiagnostics)

    def margins(self, designs: Sequence[PidDesign], models: Iterable[HeaterModel]) -> dict[HeaterModel, Margins]:
        """Return the worst margins of designs on each model; none where they are not judged, or there is no design."""
        of = self.margins_of
        if of is None or not designs:
            return {}
        return {model: _worst([of(model, design) for design in designs]) for model in dict.fromkeys(models)}

    def step_power_pct(self, designs: Sequence[PidDesign], reading_degC: float) -> float | None:
        """Return the most power that one step of the reading moves [%]; None where there is no design.

        Args:
            designs: as the words realise them.
            reading_degC: what the controller and the scenario make of a reading's step [°C].
        """
        step = max(self.reading_step_degC, reading_degC)
        return max((design.step_power_pct_per_degC * step for design in designs), default=None)


def _worst(margins: Sequence[Margins]) -> Margins:
    """Return the least of each margin."""
    return margins[0] if len(margins) == 1 else Margins(
        ms=max(one.ms for one in margins), mt=max(one.mt for one in margins),
        gain_margin=min(one.gain_margin for one in margins),
        phase_margin_deg=min(one.phase_margin_deg for one in margins))
