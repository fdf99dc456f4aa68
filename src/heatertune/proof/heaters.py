"""The plausible heaters of a fit, as a proof uses them: each with its gain at rated, low and high mains voltage.

EN 50160 allows ±10 % of the voltage, which is 81 and 121 % of the power. A controller that keeps its limits while the
voltage changes at rest may still wind up, overshoot or leave its window where the power is lower or higher throughout.

Criteria of time and cost (settling and recovery time as specified, IAE, power reserve) apply at rated power only: less
power takes longer, whatever the controller does. All others apply at each power. The duration allowed for a part of
the test sequence follows from what the heater can do at that power.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from heatertune.model.findings import Finding
from heatertune.model.loss_curve import has_loss_curve, steady_power_pct
from heatertune.model.model_values import FitOutcome, FittedModel, HeaterModel
from heatertune.model.reduction import cools
from heatertune.model.statistics import replace_outliers
from heatertune.proof.criteria import CRITERIA, LoopLimits
from heatertune.proof.scenario import Scenario, can_hold

__all__ = [
    "BY_CURVE",
    "MAINS_POWERS",
    "RATED_ONLY",
    "RESERVE_PCT",
    "ROOM_DEGC",
    "MainsScenario",
    "Supply",
    "beyond_by_curve",
    "beyond_log",
    "cooler_findings",
    "covered_degC",
    "default_setpoint",
    "holding_heaters",
    "labelled_heaters",
    "left_out",
    "limits_off_rated",
    "mains_label",
    "range_is_unknown",
    "reach_degC",
    "scale_power",
    "unreachable_findings",
]


#: ±10 % of the voltage (EN 50160), as a share of the rated power
MAINS_POWERS: Final = (0.9**2, 1.1**2)
#: power that is left over where a load or a low mains voltage is tested [%]
RESERVE_PCT: Final = 5.0
#: criteria that hold for the rated power alone
RATED_ONLY: Final = frozenset(kind.name for kind in CRITERIA if kind.rated_power_only and not kind.otherwise)


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


@lru_cache(maxsize=64)
def limits_off_rated(limits: LoopLimits) -> LoopLimits:
    """Return the limits that hold at other than the rated power: those of time and cost do not."""
    rated = (kind.limit for kind in CRITERIA if kind.rated_power_only)
    return replace(limits, **dict.fromkeys(rated))  # type: ignore[arg-type]  # each of them may be None


#: ambient assumed where neither the log nor the user tells it [°C]
ROOM_DEGC: Final = 20.0
#: of the logged rise above the ambient: a setpoint so far beyond the log is covered by it. The gain of a heater that
#: loses by radiation alone falls with the third power of its absolute temperature: by a fifth over such a step
_COVERED: Final = 0.1
#: in the remark that a setpoint lies beyond the log
BY_CURVE: Final = "loss curve by two levels"
#: of the logged rise: so far beyond the log a loss curve of two levels leads, if all plausible heaters agree
_CURVE_REACH: Final = 2.2
_SAME_POWER: Final = 0.1
#: no room is colder or hotter, whatever ambient a fit extrapolates to [°C]
_ROOMS_DEGC: Final = (0.0, 40.0)

_AS_LOGGED: Final = 0.1  # of a cooler's power: a proven loop has as much in reserve
_NEAR: Final = 0.02  # of the span of the readings: as near to a setpoint they are at it


def labelled_heaters(fitted: FittedModel) -> list[tuple[str, HeaterModel]]:
    """Return every candidate with its label, the one that fits best first; an unknown ambient is taken as 20 °C."""
    ranked = sorted(fitted.candidates, key=lambda c: (c.part != "", c.log != fitted.candidates[0].log, -c.fit_pct))
    return [(label, _with_ambient(model)) for label, model in replace(fitted, candidates=tuple(ranked)).heaters]


def holding_heaters(fitted: FittedModel, setpoint_degC: float) -> list[tuple[str, HeaterModel]]:
    """Return the plausible heaters that can hold a setpoint with their labels; all of them where none can."""
    heaters = labelled_heaters(fitted)
    return [(label, model) for label, model in heaters
            if can_hold(model, setpoint_degC, float(model.ambient_degC or 0.0))] or heaters


def cooler_findings(fitted: FittedModel, cooling_gain: float | None) -> tuple[Finding, ...]:
    """Return the findings of a fit, with those of its cooler, if the words drive one.

    Args:
        fitted: the heater, and the cooler as its log shows it.
        cooling_gain: full power of the cooler that the proof takes, as a part of the heater's; None: it is left off.
    """
    logged = fitted.cooling
    if logged is None or cooling_gain is None:
        return fitted.findings
    findings = [finding for finding in fitted.findings if finding.name not in ("cooler", "cooler-differs")]
    if logged.doubts:
        findings.append(Finding(name="cooler-differs", message=f"{'; '.join(logged.doubts)}."))
    low, high = logged.cooling_gain_ci95
    if not low * (1.0 - _AS_LOGGED) <= cooling_gain <= high * (1.0 + _AS_LOGGED):
        findings.append(Finding(name="cooling-gain", message=(
            f"full cooling was taken as {cooling_gain:.3g} times full heating, where the log shows {low:.3g} … "
            f"{high:.3g} (--cooling-gain {logged.cooling_gain:.3g}).")))
    return tuple(findings)


def unreachable_findings(fitted: FittedModel, able: int, setpoint_degC: float) -> Iterator[Finding]:
    """Return the finding that only so many of the plausible heaters can hold the setpoint, none where all can.

    A heater that cannot, though the log shows that it did, contradicts the log and counts for nothing.
    """
    unable = [model for _, model in labelled_heaters(fitted)
              if not can_hold(model, setpoint_degC, float(model.ambient_degC or 0.0))]
    possible = len(fitted.heaters)
    if able < possible and not all(_contradicts(fitted, model, setpoint_degC) for model in unable):
        yield Finding(name="setpoint-unreached",
                      message=f"{possible - able} of {possible} plausible heaters cannot hold {setpoint_degC:g} °C.")


def covered_degC(fitted: FittedModel) -> tuple[float, float] | None:
    """Return the lowest and highest setpoint that a log covers [°C], None where it is unknown how far the log reached.

    A tenth of the logged rise above the ambient is added at both ends: the gain of a real heater falls as it gets
    hotter, and how fast it does beyond the log, no reading shows.
    """
    limits, rest = fitted.logged_range_degC, fitted.residuals
    if limits is None and rest is not None:
        limits = float(rest.measured_degC.min()), float(rest.measured_degC.max())
    if limits is None:
        return None
    (low, high), (coldest, hottest), ambient = limits, _ROOMS_DEGC, fitted.model.ambient_degC
    if cools(fitted):
        margin = _COVERED * (max(high, min(high if ambient is None else ambient, hottest)) - low)
    else:
        margin = _COVERED * (high - min(low, max(low if ambient is None else ambient, coldest)))
    return low - margin, high + margin


def beyond_log(fitted: FittedModel, setpoints_degC: Sequence[float]) -> Iterator[Finding]:
    """Yield the finding that a setpoint of use lies beyond what the log covers.

    That is on the far side of the log, seen from the ambient; on the near side, where the heater is known to be
    nonlinear.

    Args:
        fitted: the heater.
        setpoints_degC: every temperature that is asked for [°C].
    """
    covered = covered_degC(fitted)
    if fitted.outcome is FitOutcome.BY_HAND or covered is None:
        return
    if has_loss_curve(fitted):
        reach = max(reach_degC(fitted), covered[1])
        if max(setpoints_degC) > reach:
            yield _beyond(max(setpoints_degC), math.floor(10.0 * reach) / 10.0, "up")
        return
    (low, high), sides = covered, {"high"}
    if cools(fitted):
        sides = {"low"}
    if any(finding.name == "nonlinear" for finding in fitted.findings):
        sides = {"low", "high"}
    lowest, highest = min(setpoints_degC), max(setpoints_degC)
    if "high" in sides and highest > high:
        yield _beyond(highest, math.floor(10.0 * high) / 10.0, "up")
    if "low" in sides and lowest < low:
        yield _beyond(lowest, math.ceil(10.0 * low) / 10.0, "down")


def reach_degC(fitted: FittedModel) -> float:
    """Return the highest setpoint to which the loss curves of a fit lead beyond its log [°C].

    That is as long as all plausible heaters need the same power there within `_SAME_POWER`, up to `_CURVE_REACH` times
    the logged rise: further than that no log of half the temperature tells what else loses heat.
    """
    (_, high), room = fitted.logged_range_degC or (0.0, 0.0), float(fitted.candidates[0].model.ambient_degC or 0.0)
    far = [room + share * (high - room) for share in np.linspace(1.0, _CURVE_REACH, 25)]
    powers = np.array([[steady_power_pct(model, degC) for degC in far] for _, model in labelled_heaters(fitted)])
    differs = np.flatnonzero(np.ptp(powers, axis=0) > _SAME_POWER * powers.mean(axis=0))
    return float(far[-1] if not len(differs) else far[max(int(differs[0]) - 1, 0)])


def beyond_by_curve(fitted: FittedModel, setpoints_degC: Sequence[float]) -> Iterator[str]:
    """Yield the remark that a setpoint lies beyond the log, and within the reach of its loss curve.

    Args:
        fitted: the heater.
        setpoints_degC: every temperature that is asked for [°C].
    """
    covered, highest = covered_degC(fitted), max(setpoints_degC)
    if covered is None or fitted.logged_range_degC is None or not has_loss_curve(fitted):
        return
    if covered[1] < highest <= reach_degC(fitted):
        powers = [steady_power_pct(model, highest) for _, model in labelled_heaters(fitted)]
        yield (f"{highest:g} °C from a log up to {fitted.logged_range_degC[1]:.0f} °C, {BY_CURVE}: "
               f"{min(powers):.3g} to {max(powers):.3g} % of power hold it")


def range_is_unknown(fitted: FittedModel, setpoints_degC: Sequence[float]) -> bool:
    """Return whether nobody knows if a setpoint lies within a log: a model file of an earlier version has no range."""
    if fitted.outcome is FitOutcome.BY_HAND or fitted.log_interval_s == 0.0 or covered_degC(fitted) is not None:
        return False
    return fitted.setpoint_degC is None or any(setpoint != fitted.setpoint_degC for setpoint in setpoints_degC)


def _beyond(setpoint_degC: float, covered: float, towards: str) -> Finding:
    return Finding(name="beyond-the-log", message=(
        f"The setpoint is {setpoint_degC:g} °C, but the log covers setpoints {towards} to {covered:g} °C only "
        f"(--setpoint {covered:g})."))


def left_out(fitted: FittedModel, able: int, setpoint_degC: float) -> Iterator[str]:
    """Return the remark on plausible heaters that are left out as the log contradicts them, nothing without any."""
    possible = len(fitted.heaters)
    if able < possible and not any(unreachable_findings(fitted, able, setpoint_degC)):
        yield (f"{possible - able} of {possible} plausible heaters left out: they could not hold {setpoint_degC:g} °C, "
               "which the log shows to be held")


def _contradicts(fitted: FittedModel, model: HeaterModel, setpoint_degC: float) -> bool:
    """Return whether a log shows that a heater, which cannot hold a setpoint, is another than the log's.

    Its ambient lies beyond the setpoint, which the readings have passed; or full power does not lead as far as the
    readings have rested for as long as all its lags and its dead time.
    """
    if fitted.residuals is None:
        return False
    sign, time = math.copysign(1.0, model.gain_degC_per_pct), fitted.residuals.time_s
    above = sign * (replace_outliers(fitted.residuals.measured_degC) - setpoint_degC)
    near = _NEAR * float(np.ptp(above))
    if sign * (float(model.ambient_degC or 0.0) - setpoint_degC) >= 0.0:
        return float(above.min()) < -near
    lasts = model.dead_time_s + sum(model.lags_s)
    breaks = np.flatnonzero(above < -near)
    runs = zip(np.append(0, breaks + 1), np.append(breaks, len(above)), strict=True)
    return any(end - begin > 1 and time[end - 1] - time[begin] >= lasts and above[end - 1] > above[begin] - near
               for begin, end in runs)


def default_setpoint(fitted: FittedModel) -> float:
    """Return where the log says that the heater was used, else half way up (or down) on the weakest model [°C]."""
    if fitted.setpoint_degC is not None:
        return fitted.setpoint_degC
    weakest = min((model for _, model in labelled_heaters(fitted)), key=_half_way)
    return float(weakest.ambient_degC or 0.0) + 50.0 * weakest.gain_degC_per_pct


def _half_way(model: HeaterModel) -> float:
    """Return how high half power lifts a heater [°C], or how deep a cooler."""
    sign = math.copysign(1.0, model.gain_degC_per_pct)
    return sign * (float(model.ambient_degC or 0.0) + 50.0 * model.gain_degC_per_pct)


def _with_ambient(model: HeaterModel) -> HeaterModel:
    return model if model.ambient_degC is not None else replace(model, ambient_degC=ROOM_DEGC)
