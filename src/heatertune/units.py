"""The nomenclature: symbols, names, units and terms used everywhere, and the conversions between units.

Temperatures are in °C, times in seconds, heater power in percent of full power. A field's unit is the end
of its name: ``time_constant_s``, ``gain_degC_per_pct``.
"""

from __future__ import annotations

import math
import operator
import re
from dataclasses import dataclass
from numbers import Real
from typing import Final

from heatertune.errors import InputError, OutOfRange, did_you_mean

__all__ = [
    "LARGEST", "NOMENCLATURE", "SMALLEST", "TERMS", "GlossaryTerm", "check", "count", "degF_to_degC",
    "kelvin_to_degC", "terms_in", "the_term", "whole", "written",
]

LARGEST: Final = 1e100
_IN_POWERS: Final = 1e9  # from here on powers of ten are easier to read
SMALLEST: Final = 1e-100

#: field name → (symbol, name, unit)
NOMENCLATURE: Final[dict[str, tuple[str, str, str]]] = {
    "gain_degC_per_pct": ("k", "process gain", "°C/%"),
    "time_constant_s": ("T1", "time constant", "s"),
    "second_time_constant_s": ("T2", "second time constant", "s"),
    "dead_time_s": ("L", "dead time", "s"),
    "ambient_degC": ("Ta", "ambient temperature", "°C"),
    "cooling_gain": ("kc/k", "cooling gain", "of full heating"),
    "gain_per_time_constant_degC_per_s_pct": ("k/T1", "gain per time constant", "°C/(s·%)"),
    "effective_dead_time_s": ("Le", "effective dead time", "s"),
    "ultimate_gain_pct_per_degC": ("Ku", "ultimate gain", "%/°C"),
    "ultimate_period_s": ("Tu", "ultimate period", "s"),
    "gain_pct_per_degC": ("K", "proportional gain", "%/°C"),
    "integral_time_s": ("TN", "integral-action time", "s"),
    "derivative_time_s": ("TV", "derivative-action time", "s"),
    "sample_time_s": ("TA", "sampling interval", "s"),
    "ms": ("Ms", "maximum sensitivity", "1"),
    "mt": ("Mt", "maximum complementary sensitivity", "1"),
    "mks": ("Mks", "maximum noise gain from reading to power", "%/°C"),
    "gain_margin": ("GM", "gain margin", "1"),
    "phase_margin_deg": ("PM", "phase margin", "°"),
    "iae_load": ("IAE", "integrated absolute error after a load step of 1 % power", "°C·s"),
}


def check(field: str, value: float, *, above: float | None = None, least: float | None = None,
          most: float | None = None, infinite: bool = False) -> None:
    """Raise `OutOfRange` unless `value` is a number that keeps the field's bounds.

    No quantity of a heater is beyond `LARGEST`, and none that has to be positive below `SMALLEST`, whatever its unit:
    further out, squares and quotients of two of them are none that floating point holds.

    Args:
        field: name of the value, unit at its end, as the error tells it.
        value: to be checked; an `int` against the bounds alone.
        above: the value has to be larger.
        least: the value has to be as large or larger.
        most: the value has to be as small or smaller.
        infinite: whether it may be infinite.

    Raises:
        OutOfRange: it is not a number, infinite, beyond `LARGEST`, or breaks a bound.
    """
    if not isinstance(value, float | int | Real):
        raise OutOfRange(field, value, "a number")
    if isinstance(value, float):
        _check_size(field, value, above=above, infinite=infinite)
    rules = [
        (above is None or value > above, f"> {above:g}" if above is not None else ""),
        (least is None or value >= least, f">= {least:g}" if least is not None else ""),
        (most is None or value <= most, f"<= {most:g}" if most is not None else ""),
    ]
    for holds, rule in rules:
        if not holds:
            raise OutOfRange(field, value, rule)


def whole(field: str, value: int, *, least: int = 0, most: int | None = None) -> int:
    """Return a whole number, NumPy's as Python's; raise `OutOfRange` unless it is one that keeps its bounds.

    Raises:
        OutOfRange: likewise.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise OutOfRange(field, value, "a whole number") from None
    check(field, number, least=least, most=most)
    return number


def _check_size(field: str, value: float, *, above: float | None, infinite: bool) -> None:
    if math.isnan(value) or (math.isinf(value) and not infinite):
        raise OutOfRange(field, value, "a finite number")
    if LARGEST < abs(value) < math.inf:
        raise OutOfRange(field, value, f"within ±{LARGEST:g}")
    if above == 0.0 and 0.0 < value < SMALLEST:
        raise OutOfRange(field, value, f">= {SMALLEST:g}")


def degF_to_degC(value: float) -> float:
    """Return °C for °F: (F − 32)·5/9."""
    return (value - 32.0) * 5.0 / 9.0


def kelvin_to_degC(value: float) -> float:
    """Return °C for kelvin: K − 273.15."""
    return value - 273.15


def written(value: float, digits: int = 4) -> str:
    """Return a number as people read it, so many digits of it: 1484, never 1.48e+03."""
    return f"{value:.0f}" if 10.0**digits <= abs(value) < _IN_POWERS else f"{value:.{digits}g}"


def count(number: int, singular: str) -> str:
    """Return "1 row", "2 rows"."""
    return f"{number} {singular}" + ("s" if number != 1 else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class GlossaryTerm:
    """One symbol or word."""

    names: tuple[str, ...]  # as they are written, the one that heatertune uses first
    meaning: str
    unit: str = ""  # of a quantity; "1": a plain number
    field: str = ""  # name in the code, where it is a field

    @property
    def anchor(self) -> str:
        """Where the term stands on the manual's page of terms: reference/nomenclature.html#TA."""
        return re.sub(r"\W+", "-", self.names[0]).strip("-")


#: symbol → what it means in plain words; its name and unit stand in NOMENCLATURE
_SYMBOLS: Final = {
    "k": "final temperature rise per percent of power",
    "T1": "time to cover 63.2 % of the response to a step of the power",
    "T2": "the smaller of two time constants, for example of the sensor",
    "L": "time before a change of the power shows in the temperature",
    "Ta": "steady temperature without power",
    "kc/k": "effect of full cooling as a fraction of that of full heating",
    "k/T1": "initial slope of the temperature per percent of power; what a short log identifies best",
    "Le": "dead time plus what small time constants add to it",
    "Ku": "gain at which a P controller makes the loop oscillate continuously",
    "Tu": "period of that oscillation",
    "K": "power per degree of error",
    "TN": "time in which the I part, at a constant error, reaches the value of the P part; smaller means more integral "
          "action",
    "TV": "lead of the D part on a steady ramp; larger means more derivative action",
    "TA": "time from one call of the controller to the next",
    "Ms": "largest amplification of a disturbance at any frequency; a small value means a robust, calm loop",
    "Mt": "largest amplification of a setpoint oscillation",
    "Mks": "largest amplification from measurement noise to power",
    "GM": "factor by which the gain may grow until the loop oscillates continuously",
    "PM": "additional phase lag until the loop oscillates continuously",
    "IAE": "magnitude of the error, integrated over time; smaller is better",
}

_WORDS: Final[tuple[tuple[tuple[str, ...], str], ...]] = (
    (("process variable", "X", "PV"), "the temperature as the controller reads it"),
    (("setpoint", "W", "SP"), "the desired temperature"),
    (("controller output", "Y", "LMN", "OUT"), "the power requested by the controller"),
    (("error", "e", "XW"), "setpoint minus process variable"),
    (("power", "u"), "the power of the heater, in percent of full power"),
    (("TI",), "another name of TN; in OB251's data block, TA/TN in its fractions of one"),
    (("FOPDT",), "a heater with one time constant and a dead time"),
    (("half rule",), "a reduction of two time constants to one: half of the smaller is added to the larger, half to "
                     "the dead time"),
    (("log",), "a record of time and temperature, better with power"),
    (("candidate",), "a model that explains the log nearly as well as the best one"),
    (("plausible heater",), "a candidate, or an extreme of what the log leaves open; designs are made for and proven "
                            "on all of them"),
    (("ideal",), "the controller as designed, before rounding"),
    (("fit",), "share of the log's variation that the model explains, in percent"),
    (("BIC", "ΔBIC"), "how well a hypothesis explains the log, with a penalty per parameter; smaller is better"),
    (("word",), "a controller parameter as the controller stores it; the value to enter"),
    (("realised",), "the controller after rounding, as opposed to the ideal one"),
    (("switch",), "an open point of a manual, with its possible settings"),
    (("target",), "the controller that the parameters are for; in heatertune, a class that encodes, decodes, steps and "
                  "exports"),
    (("scan",), "one call of the controller"),
    (("proof",), "simulations of the closed loop with the parameters, on every plausible heater and under every "
                 "setting of the open points"),
    (("run",), "one test sequence (heat-up, disturbances, restarts) on one plausible heater under one setting of the "
               "open points"),
    (("verdict",), "FAIL if a run breaks a limit; NOT PROVEN if the log leaves something open that no run can show; "
                   "otherwise PASS"),
    (("criterion",), "a quantity by which a run is judged (overshoot, settling, robustness, …), with its limit"),
    (("sample",), "a run with a randomly drawn heater, mains voltage, ambient temperature and load"),
    (("anti-windup",), "keeps the I part from growing while the power is at a limit"),
    (("setpoint ramp",), "a setpoint that moves to its target at a limited rate"),
    (("holdback",), "a band around the temperature that a ramping setpoint does not leave, so that the controller does "
                    "not wind up"),
    (("boost",), "full power from the program far from the setpoint, with the controller disabled"),
    (("interlock",), "a program in addition to the controller that may open the heater circuit"),
    (("limit cycle",), "a sustained oscillation of a loop at rest, caused by rounding or switching"),
    (("TRdom",), "time in which the closed loop covers 63.2 % of a setpoint step"),
    (("PWM period",), "time from one switch-on of the heater to the next"),
    (("minimum on", "minimum off"), "shortest on or off time of the switch"),
)

#: symbols first, in the order of the chain
TERMS: Final[tuple[GlossaryTerm, ...]] = (
    *(GlossaryTerm(names=(symbol, name), meaning=_SYMBOLS[symbol], unit=unit, field=field)
      for field, (symbol, name, unit) in NOMENCLATURE.items()),
    *(GlossaryTerm(names=names, meaning=meaning) for names, meaning in _WORDS),
)
_EXACT: Final = {name: term for term in reversed(TERMS) for name in term.names}  # where two share a name, the first
_FOLDED: Final = {name.casefold(): term for term in TERMS for name in term.names}  # the last: ta is TA, not Ta


def the_term(name: str) -> GlossaryTerm:
    """Return a term by one of its names; capitals count where they tell two apart (TA, Ta).

    Raises:
        InputError: there is none of that name.
    """
    term = _EXACT.get(name) or _FOLDED.get(name.casefold())
    if term is None:
        raise InputError(f"unknown term {name!r}{did_you_mean(name, _EXACT)} (see: heatertune terms)")
    return term


def terms_in(text: str) -> tuple[GlossaryTerm, ...]:
    """Return the terms that a text uses by one of their names, a plural included, in the order of the alphabet."""
    def used(name: str) -> bool:
        return re.search(rf"(?<!\w){re.escape(name)}s?(?!\w)", text) is not None

    terms = [term for term in TERMS if any(map(used, term.names))]
    return tuple(sorted(terms, key=lambda term: term.names[0].casefold()))
