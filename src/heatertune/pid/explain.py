"""Explain a design: the limits that bind, and what loosening each would gain.

For a heater that heats and cools with different time constants: the gains for each direction, and the cost of one set
for both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final

from heatertune.errors import InputError
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.pid.design_values import PidDesign
from heatertune.pid.specs import Specs

__all__ = ["LOOSER", "explain", "told_about_faces", "without_explanation"]


#: suffix of the law of a candidate for heating or cooling only, and the verb for its direction;
#: `heatertune.model.power.fit_power` writes it, `heatertune.model.power.nonlinear` finds it
_FACES: Final = {"heating": "heats", "cooling": "cools"}

Alone = Callable[[HeaterModel], tuple[PidDesign, Callable[[PidDesign], float]]]


def told_about_faces(fitted: FittedModel, design: PidDesign, alone: Alone) -> list[str]:
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
    limit, called = specs.limits[name], _NAMES[name]
    try:
        looser = specs.with_limit(name, limit * LOOSER)
    except InputError:  # beyond the allowed range of a limit
        return f"{called} is at its limit of {limit:g}, the largest possible."
    gained = 100.0 * (1.0 - solve(looser) / cost) if cost > 0.0 else 0.0
    worth = f"the cost would be {gained:.1f} % lower" if gained >= 0.05 else "there would be no gain"
    return f"{called} is at its limit of {limit:g}; with {called} <= {limit * LOOSER:.4g} {worth}."
