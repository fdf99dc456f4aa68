"""The specification of a tuning: objective, limits, contradictions that no search is needed for, and which limits bind.

Loosening a limit that binds gains something, and the explanation says how much. For a heater that heats and cools with
different time constants: the gains for each direction, and the cost of one set for both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Any, Final

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import FittedModel, HeaterModel, TwoLag
from heatertune.pid.design_values import PidDesign
from heatertune.settings import TuneSettings
from heatertune.units import check

__all__ = [
    "LOOSER", "OBJECTIVES", "ROOM", "Specs", "explain", "heating_cooling_notes", "is_boundless", "refuse_boundless",
    "without_explanation",
]


#: name → objective
OBJECTIVES: Final[dict[str, str]] = {
    "load": "∫|e| dt after a load step of 1 % power [°C·s]",
    "setpoint": "∫|e| dt after a setpoint step of 1 °C [s]",
    "itae": "∫t·|e| dt after a load step of 1 % power [°C·s²]",
    "ki": "TN/K, the inverse of the integral gain [°C·s]",
    "iae": "the same as load",
    "ise": "∫e² dt after a load step of 1 % power [°C²·s]; sampled loops only",
}

#: a search takes this share less than the gain at which a limit is reached: neither the last digit nor the rounding of
#: single precision then lifts the loop over it, and whoever judges allows nothing
ROOM: Final = 1e-6

#: default
_ASKED: Final = TuneSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Specs:
    """An objective, and the limits on every model.

    Attributes:
        ms: limit of the maximum sensitivity, max |S|.
        mt: limit of the maximum complementary sensitivity, max |T|.
        mks: limit of the noise gain from reading to power, max |C·S| [%/°C].
        objective: one of `OBJECTIVES`.
        weight: with the objective load: (1 − weight)·∫|e| dt after a load of 1/k % + weight·∫|e| dt after a
            setpoint step of 1 °C, both in s; None for the load alone.

    Raises:
        OutOfRange: a limit that no loop can keep, a weight outside 0…1.
        UnknownName: no such objective.
        InputError: a weight with another objective than load.
    """

    ms: float = _ASKED.ms
    mt: float = _ASKED.mt
    mks: float = _ASKED.mks
    objective: str = _ASKED.objective
    weight: float | None = None

    def __post_init__(self) -> None:
        check("ms", self.ms, above=1.0, most=4.0)
        check("mt", self.mt, above=0.0, infinite=True)
        check("mks", self.mks, above=0.0, infinite=True)
        if self.objective not in OBJECTIVES:
            raise UnknownName("objective", self.objective, OBJECTIVES)
        if self.weight is not None:
            check("weight", self.weight, least=0.0, most=1.0)
            if self.objective not in ("load", "iae"):
                raise InputError(f"weight goes with the objective load, not with {self.objective}")

    @property
    def limits(self) -> dict[str, float]:
        """The limits that are set, name → value."""
        return {name: v for name in ("ms", "mt", "mks") if math.isfinite(v := getattr(self, name))}

    def with_limit(self, name: str, value: float) -> Specs:
        """Return the same with another limit; errors as the class."""
        other: dict[str, Any] = {name: value}
        return replace(self, **other)

    @property
    def text(self) -> str:
        """The limits as a person writes them."""
        return ", ".join(f"{name.capitalize()} <= {value:g}" for name, value in self.limits.items())

    def refuse_contradictions(self, plants: Sequence[HeaterModel], structure: str) -> None:
        """Refuse limits that integral action makes impossible: it sets T(0) = 1 and C(0)·S(0) = 1/k.

        Raises:
            OutOfRange: Mt below 1, Mks below the inverse of a model's gain.
        """
        if structure == "p":
            return
        if self.mt < 1.0:
            raise OutOfRange("mt", self.mt, ">= 1: integral action makes T = 1 at frequency 0, whatever Ms is")
        weakest = min(plant.gain_degC_per_pct for plant in plants)
        if self.mks * weakest < 1.0:
            raise OutOfRange("mks", self.mks, f">= {1.0 / weakest:.4g} %/°C: integral action makes C·S the inverse of "
                             "the process gain at frequency 0")


def is_boundless(plant: HeaterModel, structure: str) -> bool:
    """Return whether Ms leaves the gain without bound: the phase never reaches −180°."""
    two_lags = isinstance(plant, TwoLag) and plant.fast_share is None
    return plant.dead_time_s == 0.0 and (structure == "pid" or not two_lags)


def refuse_boundless(plants: Sequence[HeaterModel], structure: str, mks: float) -> None:
    """Refuse heaters for which no limit bounds the gain.

    Raises:
        InputError: no heater has a dead time, and the noise gain is not limited.
    """
    if math.isinf(mks) and all(is_boundless(plant, structure) for plant in plants):
        raise InputError("without dead time this heater keeps every Ms at any gain, so there is no optimum; "
                         "limit the noise gain with --mks, or give the dead time, which every real heater has")


#: suffix of the law of a candidate for heating or cooling only, and the verb for its direction;
#: `heatertune.model.power.fit_power` writes it, `heatertune.model.power.nonlinear` finds it
_FACES: Final = {"heating": "heats", "cooling": "cools"}

Alone = Callable[[HeaterModel], tuple[PidDesign, Callable[[PidDesign], float]]]


def heating_cooling_notes(fitted: FittedModel, design: PidDesign, alone: Alone) -> list[str]:
    """Return a sentence if the candidates contain separate models for heating and cooling, otherwise an empty list.

    Args:
        fitted: model and candidates.
        design: the single set of gains for all.
        alone: heater → its own best design under the same limits, and the cost of any design on it.
    """
    faces = {face: c.model for face in _FACES for c in fitted.candidates if c.law.endswith(f", {face}")}
    if len(faces) < len(_FACES) or not math.isfinite(design.integral_time_s):
        return []
    gains, losses = [], []
    for face, plant in faces.items():
        own, cost = alone(plant)
        tv = f", TV = {own.derivative_time_s:.4g} s" if own.derivative_time_s else ""
        gains.append(f"K = {own.gain_pct_per_degC:.4g} %/°C, TN = {own.integral_time_s:.4g} s{tv} for {face}")
        losses.append(f"{100.0 * (cost(design) / cost(own) - 1.0):.0f} % more than its own set when it {_FACES[face]}")
    times = " and ".join(f"{plant.time_constant_s:.4g} s" for plant in faces.values())
    return [
        f"This heater heats and cools with different time constants ({times}). Gains scheduled by the direction of "
        f"the change would be {'; '.join(gains)}. A single set costs {' and '.join(losses)}."
    ]


LOOSER = 1.05  # factor by which a limit is loosened to find its cost

_AT = 5e-3  # share of a limit within which it counts as reached
_NAMES = {"ms": "Ms", "mt": "Mt", "mks": "Mks"}

_left_out: ContextVar[bool] = ContextVar("left_out", default=False)


@contextmanager
def without_explanation() -> Iterator[None]:
    """Switch explanations off within the block: a table has no room for them, and each takes a separate search."""
    mark = _left_out.set(True)
    try:
        yield
    finally:
        _left_out.reset(mark)


def explain(
    specs: Specs, peaks: Mapping[str, float], cost: float, solve: Callable[[Specs], float], limits: Sequence[str] = ()
) -> list[str]:
    """Return one sentence for each active limit, or one if no limit is active; an empty list if switched off.

    Args:
        specs: objective and limits of the design.
        peaks: name of the limit → value of the design.
        cost: of the design.
        solve: specs → cost of the optimum under them; called once for each active limit.
        limits: other restrictions of the gain, one sentence each.
    """
    if _left_out.get():
        return []
    active = [name for name, limit in specs.limits.items() if peaks[name] >= limit * (1.0 - _AT)]
    if not active and not limits:
        return [f"No limit is active ({specs.text}): a larger gain would only make the response oscillate more."]
    return [*limits, *(_sentence(specs, name, cost, solve) for name in active)]


def _sentence(specs: Specs, name: str, cost: float, solve: Callable[[Specs], float]) -> str:
    limit, title = specs.limits[name], _NAMES[name]
    try:
        looser = specs.with_limit(name, limit * LOOSER)
    except InputError:  # beyond the allowed range of a limit
        return f"{title} is at its limit of {limit:g}, the largest possible."
    gained = 100.0 * (1.0 - solve(looser) / cost) if cost > 0.0 else 0.0
    worth = f"the cost would be {gained:.1f} % lower" if gained >= 0.05 else "there would be no gain"
    return f"{title} is at its limit of {limit:g}; with {title} <= {limit * LOOSER:.4g} {worth}."
