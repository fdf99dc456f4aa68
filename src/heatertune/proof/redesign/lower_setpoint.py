"""A design whose limits hold after an open circuit at a lower setpoint, too, where there is one at little cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from heatertune.errors import HeatertuneError
from heatertune.model.model_values import FittedModel
from heatertune.processors import ProgressCallback
from heatertune.proof.design_request import DesignRequest, DesignResult
from heatertune.proof.long_outage import BELOW
from heatertune.proof.proof import Proof
from heatertune.proof.prove_words import prove
from heatertune.proof.redesign.design_changes import costs, more_iae
from heatertune.settings import Conditions

__all__ = ["kept_below"]

#: more IAE of load disturbances than of the first design that passes, as a share
_DEAREST: Final = 0.5


def kept_below(
    first: DesignResult, *, fitted: FittedModel, request: DesignRequest, dear: bool,
    close: Callable[..., DesignResult], progress: ProgressCallback,
) -> DesignResult:
    """Return a design whose limits hold after an open circuit at the test sequence's lower setpoint as well.

    It is made as for a range of setpoints down to that one. Where there is none, it costs too much, or a proof has so
    many scans that another search takes too long, what was found stays: its proof tells what breaks a limit there.

    Args:
        first: a design.
        fitted: the heater and its candidates.
        request: what it was found for; nothing is searched for words that stay as they are.
        dear: whether a proof has so many scans.
        close: `heatertune.proof.redesign.redesign_search.closed_on_runs`.
        progress: told what is tried.
    """
    if dear or request.as_is or not _tells_below(first.proof):
        return first
    try:
        second, proof = _for_range(first, fitted, request, close, progress)
    except HeatertuneError:  # the range is too small for a test sequence, or there is no such design
        return first
    keeps = proof.verdict == "PASS" and not _tells_below(proof) and more_iae(first, second) <= _DEAREST
    return _instead_of(first, second, proof) if keeps else first


def _for_range(
    first: DesignResult, fitted: FittedModel, request: DesignRequest, close: Callable[..., DesignResult],
    progress: ProgressCallback,
) -> tuple[DesignResult, Proof]:
    """Return a design for the range down to the lower setpoint, and its proof at the setpoint of the first if passing.

    Raises:
        HeatertuneError: as the stages.
    """
    low_degC, high_degC = first.proof.scenario.lower_setpoint_degC, first.proof.scenario.setpoint_degC
    if low_degC is None:
        return first, first.proof
    progress(f"an open circuit at {low_degC:.4g} °C overshoots: trying a design for {low_degC:.4g} to {high_degC:.4g} "
             "°C")
    conditions = replace(request.conditions, setpoint_degC=(low_degC, high_degC))
    second = close(fitted, replace(request, conditions=conditions), ways_on=False, verdict_only=True, progress=progress)
    if second.proof.verdict != "PASS":
        return second, second.proof
    return second, prove(second.proof.words, fitted, _at_setpoint_of(first, second.conditions), progress=progress)


def _instead_of(first: DesignResult, second: DesignResult, proof: Proof) -> DesignResult:
    """Return the other design with its proof at the setpoint of the first, and what it changes and costs."""
    changes = [remark for remark in second.proof.diagnostics.remarks if remark.startswith("with ")]
    heard = replace(proof.diagnostics, remarks=(*proof.diagnostics.remarks, *changes))
    note = (f"The first design that passes overshoots more than allowed after an open circuit at "
            f"{first.proof.scenario.lower_setpoint_degC:.4g} °C; "
            f"{''.join(f'{change}, ' for change in changes)}this one does not; {costs(first, second)}.")
    return replace(
        second, proof=replace(proof, diagnostics=heard), conditions=_at_setpoint_of(first, second.conditions),
        recipe=replace(second.recipe, conditions=_at_setpoint_of(first, second.recipe.conditions)), notes=(note,))


def _at_setpoint_of(first: DesignResult, conditions: Conditions) -> Conditions:
    return replace(conditions, setpoint_degC=first.conditions.setpoint_degC)


def _tells_below(proof: Proof) -> bool:
    tells = any(finding.name == BELOW for finding in proof.diagnostics.findings)
    return tells and proof.verdict == "PASS" and proof.design is not None
