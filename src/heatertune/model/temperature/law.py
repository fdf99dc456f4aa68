"""What a fit needs to know of a controller that runs inside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

__all__ = ["Constant", "ControllerLaw", "Step"]

Array = npt.NDArray[np.float64]
#: laws: (which of them, its constants, four numbers of memory, error °C, interval s) → power 0…100 %
Step = Callable[[int, Array, Array, float, float], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """One unknown constant of a law, with the bounds of its search.

    A logarithmic one is searched by ratio.
    """

    name: str
    low: float
    high: float
    logarithmic: bool = False


class ControllerLaw(Protocol):
    """A hypothesis about the controller that made a log.

    Its step is handed in by whoever knows the controller; the model stage only calls it.
    """

    @property
    def name(self) -> str:
        """Short name for tables."""

    @property
    def constants(self) -> tuple[Constant, ...]:
        """At most four unknown constants."""

    @property
    def step(self) -> Step:
        """Plain function of its module, compiled together with the loop around it; memory begins at 0.

        Laws that are compared share one, as a loop around each would have to be compiled.
        """

    @property
    def form(self) -> int:
        """Which of the step's laws it is."""
