"""Which runs a proof makes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from heatertune.plc.open_points import OpenPoint, settings_to_prove
from heatertune.progress import ProgressCallback
from heatertune.proof.mains import Supply

__all__ = ["Coverage", "Run"]

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
        draws: False: no more than one draw of the noise; see `heatertune.proof.noise`.
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
