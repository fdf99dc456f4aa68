"""What a fit needs to know of a controller that runs inside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Protocol

from numba import types

__all__ = ["STEP", "Constant", "ControllerLaw"]

STEP: Final = types.float64(types.CPointer(types.float64), types.CPointer(types.float64), types.float64, types.float64)


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
    def step(self) -> Any:
        """Compiled function of type `STEP`: (constants[4], memory[4], error °C, interval s) → power 0…100 %.

        Memory begins at 0. All laws have one type, so the loop around them is compiled once and kept on disk.
        """
