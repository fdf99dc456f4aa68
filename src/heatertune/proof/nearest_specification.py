"""What a proof that fails would need to pass: another question, since the one that was asked stays.

A limit is the last resort, and never beyond twice its default or what sensor and log reach.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

from heatertune.model.model_values import FittedModel
from heatertune.model.reduction import cools
from heatertune.plc import Words, controller_for
from heatertune.proof.criteria import CRITERIA, CRITERION, HEATER_REMEDIES, LIMITS, Criterion
from heatertune.proof.heaters import ROOM_DEGC
from heatertune.proof.proof import Proof
from heatertune.proof.prove_words import RunScreen, prove
from heatertune.proof.specification import default_limit, quantity, specification_of
from heatertune.proof.verdict import WIDER
from heatertune.settings import Conditions
from heatertune.units import written

__all__ = [
    "both_that_pass", "broken_limits_text", "limits_above", "loosen_conditions", "options_of", "passing_settings",
    "physical_help", "setting_sentences", "suspects", "tolerance_that_passes", "wider_limits_text", "within_reach",
]

#: times the tolerance asked for
_WIDER: Final = (1.5, 2.0, 3.0, 5.0)
#: criteria that the band decides, beside those of time
_IN_BAND: Final = frozenset(kind.name for kind in CRITERIA if kind.otherwise == "band")
#: limits that are never loosened for a design that fails
_OF_ROBUSTNESS: Final = frozenset(kind.limit for kind in CRITERIA if kind.source == "words")
#: a suggested limit is at most so many times its default
_MOST_DEFAULTS: Final = 2.0
_ROUNDING: Final = 1e-9  # of a limit
#: above what was found, for another proof of the same words
_ROOM: Final = 1.02


def passing_settings(proof: Proof) -> dict[str, tuple[str, ...]]:
    """Return the switches that a failure hangs on alone, with the settings under which no run fails.

    The default is among these: a switch whose default fails, or that the user has set to another, is not what the
    failure hangs on.
    """
    settings = {}
    for switch in controller_for(proof.words.target).switches:
        failing = {run.switches[switch.name] for run in proof.runs if run.verdict == "FAIL"}
        tried = {run.switches[switch.name] for run in proof.runs}
        if failing and switch.default in tried - failing:
            settings[switch.name] = tuple(each for each in switch.settings if each in tried - failing)
    return settings


def setting_sentences(proof: Proof, what: str) -> list[str]:
    """Return a sentence for each switch that the failure of `what` hangs on alone, see `passing_settings`."""
    return [f"With {name} = {' or '.join(values)}, no run of {what} fails: find out what this controller does, and "
            f"state it with --assume {name}={values[0]}." for name, values in passing_settings(proof).items()]


def suspects(proof: Proof, wound: Sequence[Mapping[str, str]] = ()) -> dict[str, str]:
    """Return the switches of which another setting than the default makes a broken criterion worst: that default.

    Where the defaults wind up: the first setting of a switch under which no run does.

    Args:
        proof: that fails, or winds up.
        wound: settings of the runs that wind up.
    """
    runs = {run.label: run for run in proof.runs}
    worst = [runs[each.where].switches for each in proof.criteria if not each.ok and each.where in runs]
    worst += wound
    switches = controller_for(proof.words.target).switches
    if any(all(settings[switch.name] == switch.default for switch in switches) for settings in wound):
        free = ((switch.name, run.switches[switch.name]) for switch in switches for run in proof.runs
                if all(run.switches[switch.name] != settings[switch.name] for settings in wound))
        return dict([first]) if (first := next(free, None)) else {}
    return {switch.name: switch.default for switch in switches
            if any(settings[switch.name] != switch.default for settings in worst)}


def _keeps_all(proof: Proof) -> bool:
    return proof.verdict != "FAIL"


def tolerance_that_passes(
    words: Words, fitted: FittedModel, proof: Proof, conditions: Conditions,
    passes: Callable[[Proof], bool] = _keeps_all,
) -> float | None:
    """Return a wider tolerance at which words pass [°C]; None: none does, or something else is broken.

    Args:
        words: whose proof fails.
        fitted: the heater and its candidates.
        proof: that fails.
        conditions: of it.
        passes: whether another proof is good enough.
    """
    if not all(name.endswith("_time") or name in _IN_BAND for name in proof.broken_criteria):
        return None
    screen = RunScreen(fitted_model=fitted).with_failed(proof)
    for wider in _wider(proof, conditions):
        if screen.keeps(words, wider) and passes(prove(words, fitted, wider)):
            return wider.tolerance_degC
    return None


def _wider(proof: Proof, conditions: Conditions) -> Iterator[Conditions]:
    """Yield conditions with wider tolerances that hold the swing and the offset which a proof has found."""
    stated_degC, least = specification_of(conditions).tolerance_degC, max(
        (each.value for each in proof.criteria if each.name in _IN_BAND), default=0.0)
    others = tuple(limit for limit in conditions.limit if not limit.lstrip().startswith("tolerance"))
    most = _MOST_DEFAULTS * (default_limit(specification_of(conditions), "tolerance", "degC") or stated_degC)
    for tolerance in dict.fromkeys(min(most, float(f"{factor * stated_degC:.3g}")) for factor in _WIDER):
        if tolerance >= least and tolerance > stated_degC:
            yield replace(conditions, tolerance_degC=tolerance, limit=others)


def both_that_pass(
    words: Words, fitted: FittedModel, proof: Proof, conditions: Conditions,
    passes: Callable[[Proof], bool] = _keeps_all,
) -> tuple[str, ...]:
    """Return options of a wider tolerance and of the limits that are still broken then, under which words pass.

    Args:
        words: whose proof fails.
        fitted: the heater and its candidates.
        proof: that fails.
        conditions: of it.
        passes: whether another proof is good enough.
    """
    for wider in _wider(proof, conditions):
        looser = limits_above((wider_proof := prove(words, fitted, wider)).criteria)
        if not looser or not within_reach(looser, wider_proof, fitted, wider):
            continue
        if passes(prove(words, fitted, loosen_conditions(wider, looser))):
            return "--tolerance", f"{wider.tolerance_degC:g}", *options_of(looser)
    return ()


def loosen_conditions(conditions: Conditions, looser: Mapping[str, str]) -> Conditions:
    """Return conditions with limits in the place of what they say of these."""
    limits = [limit for limit in conditions.limit if limit.partition("=")[0].strip() not in looser]
    return replace(conditions, limit=(*limits, *(f"{name}={value}" for name, value in looser.items())))


def options_of(limits: Mapping[str, str]) -> tuple[str, ...]:
    """Return limits as a user types them."""
    return tuple(word for name, value in limits.items() for word in ("--limit", f"{name}={value}"))


def wider_limits_text(options: Sequence[str]) -> str:
    """Return what the limits among suggested options mean, in words; "" where there is none."""
    limits = [("tolerance", f"{value} degC") if flag == "--tolerance" else tuple(value.split("=", 1))
              for flag, value in pairwise(options) if flag in ("--tolerance", "--limit")]
    meant = " and ".join(f"{name.replace('-', ' ')} {value} ({LIMITS[name].description})" for name, value in limits)
    return f"{WIDER}{meant}" if meant else ""


def limits_above(criteria: Iterable[Criterion]) -> dict[str, str]:
    """Return the limits of broken criteria, each with the value that it would keep; none where one is not to be moved.

    Robustness is not to be moved, nor is there a limit for what never happens or is a fault.
    """
    by_field = {measure.field: (name, unit) for name, limit in LIMITS.items() for unit, measure in limit.units.items()
                if measure.factor == 1.0 and unit != "T+L" and measure.field not in _OF_ROBUSTNESS}
    looser: dict[str, tuple[float, str]] = {}
    for each in (each for each in criteria if not each.ok):
        kind = CRITERION.get(each.name)
        field = "" if kind is None else {"": kind.limit, "band": "tolerance_degC", "part": ""}[kind.otherwise]
        if field not in by_field or each.at_least or not math.isfinite(each.value):
            return {}
        name, unit = by_field[field]
        looser[name] = max(looser.get(name, (0.0, unit)), (each.value, unit))
    return {name: f"{_rounded_up(value):g}{unit}" for name, (value, unit) in looser.items()}


def within_reach(limits: Mapping[str, str], proof: Proof, fitted: FittedModel, conditions: Conditions) -> bool:
    """Return whether limits may be suggested: within twice their defaults, and where sensor and log reach.

    Args:
        limits: name → value, as `limits_above` returns them.
        proof: whose limits these are to replace.
        fitted: the heater and its candidates; one of a log tells how hot that was.
        conditions: of the proof.
    """
    spec = specification_of(conditions)
    for name, text in limits.items():
        number, unit = quantity(name, text)
        own = [value for value, its in (quantity(name, each) for each in spec.limits.get(name, ())) if its == unit]
        usual = default_limit(spec, name, unit)
        most = _MOST_DEFAULTS * (min(own, default=math.inf) if usual is None else usual)
        if not number <= most * (1.0 + _ROUNDING):
            return False
        if name.endswith("overshoot") and not _is_reached(number, unit, proof, fitted):
            return False
    return True


def _is_reached(overshoot: float, unit: str, proof: Proof, fitted: FittedModel) -> bool:
    """Return whether sensor and log reach so far beyond the setpoint."""
    setpoint, sensor = proof.scenario.setpoint_degC, proof.words.scaling.sensor_degC
    logged = () if fitted.residuals is None else fitted.residuals.measured_degC
    ambients = [ROOM_DEGC if plant.ambient_degC is None else plant.ambient_degC for plant in fitted.plants]
    rise = max(abs(setpoint - ambient) for ambient in ambients)
    beyond = overshoot if unit == "degC" else overshoot / 100.0 * rise
    if cools(fitted):
        return setpoint - beyond >= max(sensor[0], *(min(logged, default=-math.inf),))
    return setpoint + beyond <= min(sensor[1], max(logged, default=math.inf))


def physical_help(broken: Iterable[str]) -> str:
    """Return what at the heater, sensor or switch helps against broken criteria; "" where nothing is known to."""
    helpful = {remedy for name in broken if name in CRITERION for remedy in CRITERION[name].remedies}
    return "; ".join(remedy for remedy in HEATER_REMEDIES if remedy in helpful)


def _rounded_up(value: float) -> float:
    """Return a number of two digits that is larger by some hundredths at least."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value * _ROOM / digit) * digit:.6g}")


def broken_limits_text(criteria: Iterable[Criterion]) -> str:
    """Return what is broken and by how much: "overshoot 24 (limit 20 %)"."""
    return ", ".join(f"{each.name.replace('_', ' ')} {written(each.value, 3)} (limit {written(each.limit, 3)} "
                     f"{each.unit})" for each in criteria if not each.ok and each.limit is not None)
