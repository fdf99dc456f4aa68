"""What the runs of a proof are held against, and what is known of the heater that no run shows.

Which runs a proof makes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from heatertune.model.values import HeaterModel
from heatertune.pid.values import Margins, PidDesign
from heatertune.plc.open_points import OpenPoint, settings_to_prove
from heatertune.processors import ProgressCallback
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.heaters import Supply
from heatertune.proof.specification import Specification
from heatertune.proof.verdict import FitDiagnostics

__all__ = ["Acceptance", "Coverage", "Run"]


#: label of a model, setting of each switch, full power as a share of the rated one (None: the rated power)
Run = tuple[str, Mapping[str, str], float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Which runs a proof makes: every model under every setting the manual leaves open, or fewer for a quick look.

    Attributes:
        known: switch → setting of what is known of this very controller, the manual leaving it open.
        open_points: False: only the default settings of the controller's switches, for a quick comparison.
        only: these runs, by the controller's direct form alone; None: every model under every setting at each power.
        night: with `only`: the heat-up and one of `heatertune.proof.long_outage` alone, by its name, if the words have
            it.
        night_times: how many times as long as in a proof the longest open circuit of that night lasts.
        draws: False: no more than one draw of the noise; see `heatertune.proof.proof`.
        progress: told how many runs are done, as "18 of 54 runs".
        supplies: other mains voltages, each with the heaters that run at it; none: the rated power alone.
    """

    stated_settings: Mapping[str, str] = field(default_factory=dict)
    open_points: bool = True
    only: Sequence[Run] | None = None
    night: str | None = None
    night_times: float = 1.0
    draws: bool = True
    progress: ProgressCallback = str
    supplies: Sequence[Supply] = ()

    @property
    def whole(self) -> bool:
        """Whether every model runs under every setting."""
        return self.open_points and self.only is None

    def settings(self, switches: Sequence[OpenPoint]) -> list[dict[str, str]]:
        """Return the settings under which words are run, the defaults (and what is known) first.

        Raises:
            UnknownName: what is known is no switch or setting.
        """
        return settings_to_prove(switches, self.stated_settings)[: None if self.open_points else 1]

    def runs(self, model: str, settings: Mapping[str, str], mains_power: float | None = None) -> bool:
        """Return whether a model, by its label, is run under these settings at a power, see `Run`."""
        return self.only is None or (model, settings, mains_power) in self.only

    def runs_any(self, mains_power: float | None) -> bool:
        """Return whether there is a run at a power, see `Run`."""
        return self.only is None or any(power == mains_power for *_, power in self.only)

    def in_question(self, switches: Sequence[OpenPoint]) -> list[OpenPoint]:
        """Return the switches that are run in several settings, or that no run can show though nobody knows them."""
        return [switch for switch in switches
                if not switch.in_manual or (self.whole and switch.name not in self.stated_settings)]


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
