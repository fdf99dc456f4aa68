"""Tuning rules, each as its authors print it, with source, range and claim; settings come out in the ideal form.

The sampled loop's own half sample counts as dead time (S. Skogestad, J. Process Control 13 (2003), section 2.2).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.values import FittedModel, HeaterModel, TwoLag
from heatertune.pid.rules.direct import DIRECT, INTEGRALS, REACTION, ULTIMATE, USORT, ultimate_cycle
from heatertune.pid.rules.values import Rule
from heatertune.pid.values import Settings, series_to_ideal
from heatertune.units import check

__all__ = ["RULES", "Rule", "apply_rule", "model_for", "range_note", "ultimate_cycle"]

RULES: Final[dict[str, Rule]] = DIRECT | REACTION | ULTIMATE | INTEGRALS | USORT


def apply_rule(
    method: str, model: HeaterModel, structure: str, sample_time_s: float, *, closed_loop_s: float | None = None
) -> Settings:
    """Return K [%/°C], TN [s] and TV [s] of a rule, in the ideal form.

    Args:
        method: name of the rule.
        model: the heater; a rule for one lag takes the half rule of two.
        structure: "p", "pi" or "pid".
        sample_time_s: TA [s]; half of it counts as dead time.
        closed_loop_s: τc of SIMC, λ of lambda tuning and IMC [s]; None: the rule's own choice.

    Raises:
        UnknownName: no such rule.
        OutOfRange: a closed-loop time that is not positive; no dead time at all.
        InputError: the rule does not give this structure or leaves no closed-loop time open, or its formula gives
            times that are negative, so far outside its range is the model.
    """
    rule = _rule(method)
    if structure not in rule.formulas:
        given = " and ".join(name.upper() for name in rule.formulas)
        raise InputError(f"{method} gives {given} settings, none for {structure.upper()}; "
                         "use another --structure or --method")
    if closed_loop_s is not None:
        check("closed_loop_s", closed_loop_s, above=0.0)
        if rule.closed_loop is None:
            open_ones = ", ".join(name for name, other in RULES.items() if other.closed_loop is not None)
            raise InputError(f"{method} leaves no closed-loop time constant open; those that do: {open_ones}")
    seen = _as_sampled(model, sample_time_s)
    printed = rule.formulas[structure](seen, closed_loop_s)
    gain, integral, derivative = series_to_ideal(*printed) if rule.form == "series" else printed
    if integral <= 0.0 or derivative < 0.0:
        raise InputError(f"{method} gives K = {gain:.4g} %/°C, TN = {integral:.4g} s, TV = {derivative:.4g} s here, "
                         f"which no controller can hold; {range_note(method, model, structure, sample_time_s)}")
    return gain, integral, derivative


def model_for(method: str, structure: str, fitted: FittedModel) -> HeaterModel:
    """Return the model a rule is applied to.

    That is the working model, with its two lags where it stands for two; the candidate with two lags that fits best
    where the rule needs two.

    Raises:
        UnknownName: no such rule.
    """
    if structure in _rule(method).two_lags:
        return next((plant for plant in fitted.plants if isinstance(plant, TwoLag)), fitted.model)
    return next((plant for plant in fitted.plants if plant.half_rule() == fitted.model), fitted.model)


def range_note(method: str, model: HeaterModel, structure: str, sample_time_s: float) -> str | None:
    """Return in one sentence that a model lies outside the range of a rule; None where it lies inside.

    Raises:
        UnknownName, OutOfRange: as `apply_rule`.
    """
    rule = _rule(method)
    one = _as_sampled(model, sample_time_s).half_rule()
    ratio = one.dead_time_s / one.time_constant_s
    least = rule.narrower.get(structure, rule.least_ratio)
    if least <= ratio <= rule.most_ratio:
        return None
    low = f"{least:g} <= " if least > 0.0 else ""
    return f"Made for {low}L/T <= {rule.most_ratio:g}; L/T is {ratio:.3g} here, half a sample included."


def _rule(method: str) -> Rule:
    if method not in RULES:
        raise UnknownName("tuning method", method, ("optimum", *RULES))
    return RULES[method]


def _as_sampled(model: HeaterModel, sample_time_s: float) -> HeaterModel:
    dead = model.dead_time_s + sample_time_s / 2.0
    if dead <= 0.0:
        raise OutOfRange("dead_time_s", dead, "> 0 with half a sampling interval added: the rules divide by it")
    return replace(model, dead_time_s=dead)
