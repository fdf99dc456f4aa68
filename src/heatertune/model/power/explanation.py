"""What explains a log with power: one lag and two, with the start, drift and loads that it asks for."""


from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.log.values import Log
from heatertune.model.power.aliasing import alias_of
from heatertune.model.power.causality import WRONG_SIGN, demand_cause, explains, follows_temperature
from heatertune.model.power.cleaning import clean_log
from heatertune.model.power.events import refit_all, with_events, without_events
from heatertune.model.power.feedback import is_feedback
from heatertune.model.power.log_arrays import Readings
from heatertune.model.power.nonlinear import Bend, judged_linear
from heatertune.model.power.open_circuit import refuse_opened
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.values import Fopdt

__all__ = ["Explanation", "explain_log"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """A log with power, the problems and fits of one lag and two, and what became of its readings.

    Attributes:
        log: without readings between disturbances that are too close.
        readings: its readings, one for one, and where its segments begin.
        problems: of one lag and of two, with the start, the drift and the loads the log asks for.
        fits: their best fits.
        cleaned: readings with outliers put where their neighbours are, shape (n,) [°C].
        outliers: their places.
        notes: about the log's disturbances, and what it cannot tell about its heater, one sentence each.
        alias: about power that switches faster than it was logged; empty where it does not.
        bend: what explains the log better than a linear heater, None where nothing does.
        doubt: what casts doubt on the power as the cause of the temperature; empty where nothing does.
    """

    log: Log
    readings: Readings
    problems: list[PowerProblem]
    fits: list[PowerFit]
    clean_temperature: Array
    outliers: npt.NDArray[np.intp]
    notes: tuple[str, ...]
    alias: str
    bend: Bend | None = None
    doubt: str = ""

    @property
    def model(self) -> Fopdt:
        """One lag."""
        model = self.fits[0].model
        assert isinstance(model, Fopdt)
        return model

    @property
    def simulated_degC(self) -> Array:
        """Answer of one lag at every reading of the log, shape (n,)."""
        return self.at_readings(self.problems[0], self.fits[0])

    def at_readings(self, problem: PowerProblem, fit: PowerFit) -> Array:
        """Return what a fit makes of every reading of the log, shape (n,) [°C]."""
        return fit.linear @ replace(problem, readings=self.readings).basis(fit.vector)

    def with_drift(self) -> Explanation:
        """Return the log with a drift of the ambient fitted, whether it asks for one alone or not."""
        problems = [replace(problem, drift=True) for problem in self.problems]
        return replace(self, problems=problems, fits=refit_all(problems, self.fits))


def explain_log(
    log: Log, *, ambient_degC: float | None, power_before_pct: float | None, believed: bool = False,
    most_dead_time_s: float | None = None,
) -> Explanation:
    """Return one lag and two, each with the start, drift and loads that a log with power asks for.

    Args:
        log: with power.
        ambient_degC: known ambient [°C], None where free.
        power_before_pct: power before the first reading [%], None where it is to be found out.
        believed: the power is known to be the heater's, so its cause is not asked for.
        most_dead_time_s: no dead time is longer, as the user knows [s].

    Raises:
        InputError: the power cannot have made the temperature (sign, clock, no answer at all).
    """
    readings = Readings.of(log)
    problem = PowerProblem(readings=readings, ambient_degC=ambient_degC, power_before_pct=power_before_pct,
                           most_dead_time_s=most_dead_time_s)
    return _search(log, problem, believed=believed)


def _search(log: Log, problem: PowerProblem, *, believed: bool) -> Explanation:
    """Return one lag and two, without the outliers, the start, the drift and the loads the log asks for."""
    log, clean, notes = clean_log(log, problem)
    thin, fit = clean.problem, clean.fit
    alias = "" if believed else alias_of(log, thin, fit)
    doubt = "" if believed else _demand_cause(log, thin, fit, alias)
    two = replace(thin, two_lags=True)
    closed = is_feedback(log) or follows_temperature(log)
    way = with_events([thin, two], [fit, _second(two, fit)], closed=closed)
    if doubt or way.problems[0].loads_s:
        refuse_opened(log, thin)
    if doubt and not doubt.startswith(WRONG_SIGN) and any(map(explains, *way)):
        doubt = ""
    (problems, fits), bend, untold = judged_linear(without_events(way), way)
    if any(fit.model is None for fit in fits):
        raise InputError(f"{log.name}: no heater explains the log, as something else than the power moved its "
                         "temperature; log steps of the power from rest, each until it rests")
    return Explanation(
        log=log, readings=clean.whole.readings, problems=problems, fits=fits, clean_temperature=clean.readings_degC,
        outliers=clean.outliers, notes=(*notes, *untold), alias=alias, bend=bend, doubt=doubt,
    )


def _demand_cause(log: Log, problem: PowerProblem, fit: PowerFit, alias: str) -> str:
    """Refuse a log in which the power cannot be the temperature's cause, by its aliasing where it has one."""
    try:
        return demand_cause(log, problem, None if fit.model is None else fit)
    except InputError as refused:
        if alias:
            raise InputError(f"{log.name}: {alias}") from refused
        refuse_opened(log, problem)
        raise


def _second(problem: PowerProblem, one: PowerFit) -> PowerFit:
    """Return two lags; where the free initial states alone make the best of it, the two nearest to the one lag."""
    fit = problem.fit()
    if fit.model is not None:
        return fit
    near = [(one.vector[0], max(one.vector[1] - ratio * math.exp(one.vector[0]), 0.0), ratio) for ratio in (0.03, 0.2)]
    return problem.refine(np.array(near))
