"""What the symbols and words mean that heatertune writes: one list for terminal, studio, report and manual."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from heatertune.errors import InputError, did_you_mean
from heatertune.units import NOMENCLATURE

__all__ = ["TERMS", "GlossaryTerm", "terms_in", "the_term"]


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
    (("word",), "a controller parameter as the PLC stores it; the value to enter"),
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
    found = _EXACT.get(name) or _FOLDED.get(name.casefold())
    if found is None:
        raise InputError(f"unknown term {name!r}{did_you_mean(name, _EXACT)} (see: heatertune terms)")
    return found


def terms_in(text: str) -> tuple[GlossaryTerm, ...]:
    """Return the terms that a text uses by one of their names, a plural included, in the order of the alphabet."""
    def used(name: str) -> bool:
        return re.search(rf"(?<!\w){re.escape(name)}s?(?!\w)", text) is not None

    found = [term for term in TERMS if any(map(used, term.names))]
    return tuple(sorted(found, key=lambda term: term.names[0].casefold()))
