"""What a proof that fails would need to pass: another question, since the one that was asked stays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from heatertune.model.values import FittedModel
from heatertune.plc import Words, controller_for
from heatertune.proof.criteria import Criterion
from heatertune.proof.fitted import prove, specified
from heatertune.proof.prove import Proof
from heatertune.proof.screen import Screen
from heatertune.settings import Conditions

__all__ = ["broken_names", "broken_told", "passing_settings", "settings_told", "suspects", "tolerance_that_passes"]

#: times the tolerance asked for
_WIDER: Final = (1.5, 2.0, 3.0, 5.0)
#: criteria that the band decides, beside those of time
_IN_BAND: Final = ("limit_cycle", "steady_offset", "soak_deviation")


def passing_settings(proof: Proof) -> dict[str, tuple[str, ...]]:
    """Return the switches that a failure hangs on alone, with the settings under which no run fails.

    The default is among these: a switch whose default fails, or that the user has set to another, is not what the
    failure hangs on.
    """
    settings = {}
    for switch in controller_for(proof.words.target).switches:
        failing = {run.switches[switch.name] for run in proof.runs if run.verdict == "FAIL"}
        tried = {run.switches[switch.name] for run in proof.runs}
        if failing and switch.default in tried - failing:
            settings[switch.name] = tuple(each for each in switch.settings if each in tried - failing)
    return settings


def settings_told(proof: Proof, what: str) -> list[str]:
    """Return a sentence for each switch that the failure of `what` hangs on alone, see `passing_settings`."""
    return [f"Under {name} = {' or '.join(kept)} no run of {what} fails: find out what this controller does, and say "
            f"--switch {name}={kept[0]}." for name, kept in passing_settings(proof).items()]


def suspects(proof: Proof) -> dict[str, str]:
    """Return the switches of which another setting than the default makes a broken criterion worst: that default."""
    runs = {run.label: run for run in proof.runs}
    worst = [runs[each.where] for each in proof.criteria if not each.ok and each.where in runs]
    return {switch.name: switch.default for switch in controller_for(proof.words.target).switches
            if any(run.switches[switch.name] != switch.default for run in worst)}


def tolerance_that_passes(words: Words, fitted: FittedModel, proof: Proof, conditions: Conditions) -> float | None:
    """Return a wider tolerance at which words pass [°C]; None: none does, or something else is broken."""
    broken = [each.name for each in proof.criteria if not each.ok]
    if not all(name.endswith("_time") or name in _IN_BAND for name in broken):
        return None
    screen, asked = Screen(fitted=fitted).with_failed(proof), specified(conditions).tolerance_degC
    for factor in _WIDER:
        tolerance = float(f"{factor * asked:.3g}")
        others = tuple(limit for limit in conditions.limit if not limit.lstrip().startswith("tolerance"))
        wider = replace(conditions, tolerance_degC=tolerance, limit=others)
        if screen.keeps(words, wider) and prove(words, fitted, wider).verdict != "FAIL":
            return tolerance
    return None


def broken_names(proof: Proof) -> set[str]:
    """Return the criteria that a proof breaks."""
    return {each.name for each in proof.criteria if not each.ok}


def broken_told(criteria: Iterable[Criterion]) -> str:
    """Return what is broken and by how much: "overshoot 24 (limit 20 %)"."""
    return ", ".join(f"{each.name.replace('_', ' ')} {each.value:.3g} (limit {each.limit:.3g} {each.unit})"
                     for each in criteria if not each.ok and each.limit is not None)
