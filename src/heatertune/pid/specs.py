"""The specification of a tuning: objective and limits, and contradictions that can be found without a search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import HeaterModel, TwoLag
from heatertune.settings import TuneSettings
from heatertune.units import check

__all__ = ["OBJECTIVES", "ROOM", "Specs", "is_boundless", "refuse_boundless"]

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
