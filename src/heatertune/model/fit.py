"""Log → FittedModel: which experiment the log is, which models explain it, and what it cannot tell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from heatertune.errors import InputError, OutOfRange
from heatertune.log.values import Log
from heatertune.model.fit_power import fit_power
from heatertune.model.fit_temperature import fit_temperature
from heatertune.model.law import ControllerLaw
from heatertune.model.relay_log import with_relay
from heatertune.model.values import Candidate, FittedModel, Fopdt, HeaterModel, Outcome
from heatertune.model.windows import undisturbed
from heatertune.units import check

__all__ = ["fit", "model_by_hand", "pool_candidates"]


def fit(
    log: Log,
    *,
    laws: Sequence[ControllerLaw] = (),
    ambient_degC: float | None = None,
    power_before_pct: float | None = None,
    until_s: float | None = None,
    seed: int = 1,
    progress: Callable[[str], object] = str,
) -> FittedModel:
    """Identify the heater behind a log.

    Args:
        log: with power, the power is believed; without, the controller laws are run inside the fit.
        laws: hypotheses about the controller, needed where the power was not logged.
        ambient_degC: ambient temperature where it is known [°C].
        power_before_pct: power before the first reading [%], where it differs from the first logged one.
        until_s: last instant to use [s]; by default the log is used up to its first disturbance.
        seed: of the random starts and the bootstrap.
        progress: called with a short message when a stage begins.

    Raises:
        InputError: the power never changes, or neither power nor laws are there, or power_before without power.
        OutOfRange: fewer than 20 readings are left, an ambient above all readings, a power outside 0…100 %.
    """
    _check_given(log, ambient_degC, power_before_pct)
    if until_s is not None:
        used = log.window(float(log.time_s[0]), until_s)
        notes: tuple[str, ...] = (f"Readings after {until_s:g} s were not used.",)
    else:
        used, notes = undisturbed(log)
    if used.power_pct is None:
        if not laws:
            raise InputError(f"{log.name}: the power was not logged and no controller law was given to run in the fit")
        progress(f"{log.name}: fitting {len(laws)} controller laws inside the loop")
        found = fit_temperature(used, laws, ambient_degC=ambient_degC, seed=seed)
    else:
        _demand_excitation(used, ambient_degC)
        progress(f"{log.name}: fitting one and two lags to the logged power")
        found = fit_power(used, ambient_degC=ambient_degC, power_before_pct=power_before_pct, seed=seed)
        found = with_relay(used, found, ambient_degC=ambient_degC)
    return replace(found, notes=notes + found.notes)


def pool_candidates(fitted: FittedModel, others: Sequence[FittedModel]) -> FittedModel:
    """Return the fit with the candidates of other logs of the same heater added."""
    added = tuple(candidate for other in others for candidate in other.candidates)
    if not added:
        return fitted
    logs = ", ".join(dict.fromkeys(candidate.log for candidate in added))
    note = f"Candidates of {logs}, a log of the same heater, were added: a design has to serve them too."
    return replace(fitted, candidates=fitted.candidates + added, notes=(*fitted.notes, note))


def model_by_hand(model: HeaterModel) -> FittedModel:
    """Return a model that was typed in, in the form the other stages take."""
    fopdt = model if isinstance(model, Fopdt) else model.half_rule()
    candidate = Candidate(
        model=model, log="by hand", window_s=(0.0, 0.0), law="no log", fit_pct=float("nan"), rmse_degC=float("nan"),
        delta_bic=0.0,
    )
    return FittedModel(
        model=fopdt, outcome=Outcome.BY_HAND, method="given by hand", candidates=(candidate,),
        notes=("No interval is known: the proof runs on this one model only.",),
    )


def _check_given(log: Log, ambient_degC: float | None, power_before_pct: float | None) -> None:
    if ambient_degC is not None:
        highest = float(log.temperature_degC.max())
        check("ambient_degC", ambient_degC, least=-273.15)
        if ambient_degC >= highest:
            raise OutOfRange("ambient_degC", ambient_degC, f"< {highest:g}, the highest reading of {log.name}")
    if power_before_pct is not None:
        check("power_before_pct", power_before_pct, least=0.0, most=100.0)
        if log.power_pct is None:
            raise InputError(f"{log.name}: the power was not logged, so power_before_pct means nothing here")


def _demand_excitation(log: Log, ambient_degC: float | None) -> None:
    """Refuse constant power: gain and ambient, and step response and initial state, would be one and the same."""
    assert log.power_pct is not None
    if float(np.ptp(log.power_pct)) == 0.0 and ambient_degC is None:
        raise InputError(
            f"{log.name}: {Outcome.NO_POWER_CHANGE.value} The power is {log.power_pct[0]:g} % throughout; "
            "or give --ambient, the temperature without power"
        )
