"""Mains voltage that is low or high from the heat-up to the end of the test sequence.

EN 50160 allows ±10 % of the voltage, which is 81 and 121 % of the power. A controller that keeps its limits while the
voltage changes at rest may still wind up, overshoot or stay outside its window where the heater has less or more power
for the whole sequence. So each plausible heater also runs with its gain times these shares.

Criteria of time and cost (settling and recovery time as specified, IAE, power reserve) hold for the rated power alone:
less power takes longer, whatever the controller does. All others hold at each power. How long a part may take then
follows from what the heater can do at that power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from heatertune.model.values import HeaterModel
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.scenario import Scenario

__all__ = ["MAINS_POWERS", "RATED_ONLY", "RESERVE_PCT", "MainsScenario", "Supply", "limits_off_rated", "mains_label",
           "scale_power"]

#: ±10 % of the voltage (EN 50160), as a share of the rated power
MAINS_POWERS: Final = (0.9**2, 1.1**2)
#: power that is left over where a load or a low mains voltage is tested [%]
RESERVE_PCT: Final = 5.0
#: criteria that hold for the rated power alone
RATED_ONLY: Final = frozenset({"iae", "power_reserve"})


@dataclass(frozen=True, slots=True, kw_only=True)
class MainsScenario:
    """The test sequence at another mains voltage.

    Attributes:
        mains_power: full power as a share of the rated one.
        scenario: of each run at this power.
    """

    mains_power: float
    scenario: Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Supply:
    """The heaters that run at another mains voltage.

    Attributes:
        mains_power: full power as a share of the rated one.
        scenario: of each run at this power.
        models: (label, heater with its gain at this power).
    """

    mains_power: float
    scenario: Scenario
    models: tuple[tuple[str, HeaterModel], ...]


def scale_power(model: HeaterModel, mains_power: float) -> HeaterModel:
    """Return a heater whose full power is this share of the rated one."""
    return replace(model, gain_degC_per_pct=mains_power * model.gain_degC_per_pct)


def mains_label(mains_power: float) -> str:
    """Return a mains voltage as people know it: "mains −10 %"."""
    volts_pct = round(100.0 * (math.sqrt(mains_power) - 1.0))
    return f"mains {'−' if volts_pct < 0 else '+'}{abs(volts_pct)} %"


def limits_off_rated(limits: LoopLimits) -> LoopLimits:
    """Return the limits that hold at other than the rated power: those of time and cost do not."""
    return replace(limits, settling_s=None, recovery_s=None, iae_degC_s=None, power_reserve_pct=None)
