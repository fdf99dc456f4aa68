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
    "k": "by how much the heater gets warmer in the end for each percent of power",
    "T1": "the time in which the heater goes 63.2 % of its way after a step of the power",
    "T2": "the smaller of two time constants: of the sensor, say",
    "L": "how long nothing is seen of a change of the power",
    "Ta": "where the heater comes to rest without power",
    "k/T1": "how steeply the temperature rises for each percent of power; a short log tells it best",
    "Le": "the dead time, and what small time constants add to it",
    "Ku": "the gain at which a P controller lets the loop swing without end",
    "Tu": "the period of that swing",
    "K": "how much power the controller gives for each degree of error",
    "TN": "how long the I part needs, at a constant error, to give as much as the P part; smaller is more",
    "TV": "the lead that the D part gives a steady change; larger is more",
    "TA": "the time from one call of the controller to the next",
    "Ms": "how far from swinging the loop is: a disturbance grows at most Ms-fold at any frequency; small is calm",
    "Mt": "how much the loop at most amplifies a swing of the setpoint",
    "Mks": "how much power a noisy reading at most asks for",
    "GM": "by what factor the gain may grow until the loop swings without end",
    "PM": "by what angle the loop may lag more until it swings without end",
    "IAE": "the size of the error, added up over time; smaller is better",
}

_WORDS: Final[tuple[tuple[tuple[str, ...], str], ...]] = (
    (("process variable", "X", "PV"), "the temperature as the controller reads it"),
    (("setpoint", "W", "SP"), "the temperature that is wanted"),
    (("controller output", "Y", "LMN", "OUT"), "the power the controller asks for"),
    (("error", "e", "XW"), "setpoint minus process variable"),
    (("power", "u"), "what the heater gets, in percent of full power"),
    (("TI",), "TN as others call it; as a word of OB251, TA/TN in its fractions of one"),
    (("FOPDT",), "a heater with one time constant and a dead time"),
    (("half rule",), "how two time constants become one: half of the smaller one goes to each of the larger one and "
     "the dead time"),
    (("log",), "a record of time and temperature, better with power"),
    (("candidate",), "a model that explains the log nearly as well as the best one"),
    (("plausible heater",), "a candidate, or the end of what a log leaves open: what designs are made for and proven "
     "on"),
    (("ideal",), "the controller as designed, before its constants become words"),
    (("fit",), "the share of the log's movement that the model explains, in percent"),
    (("BIC", "ΔBIC"), "how well a hypothesis explains the log, paid for by its number of parameters; smaller is "
     "better"),
    (("word",), "a number as the PLC holds it: what is typed in"),
    (("realised",), "what the words do, as against what was wished"),
    (("switch",), "a point that a manual leaves open, with the settings it may have"),
    (("target",), "the controller that the words are for; in heatertune a class that encodes, decodes, steps and "
     "exports"),
    (("scan",), "one call of the controller"),
    (("proof",), "the closed loop with the words, on every plausible heater, under every switch"),
    (("run",), "one story of the loop (heating up, disturbances, a restart) on one plausible heater under one switch"),
    (("verdict",), "FAIL where a run breaks a limit; NOT PROVEN where the log leaves open what no run shows; else "
     "PASS"),
    (("criterion",), "what a run is judged by: overshoot, settling, robustness and more, each with its limit"),
    (("sample",), "one more run of the proof, whose heater, mains, ambient and goods are drawn"),
    (("anti-windup",), "what keeps the I part from growing while the power is at a limit"),
    (("setpoint ramp",), "a setpoint that is led to its end at a limited rate"),
    (("holdback",), "a band around the reading that a led setpoint does not leave: what the heater cannot follow does "
     "not wind up"),
    (("boost",), "full power from the program far from the setpoint, the controller not enabled meanwhile"),
    (("interlock",), "a program beside the controller that may open the heater's circuit"),
    (("limit cycle",), "a swing that a loop at rest keeps up, by rounding or switching"),
    (("TRdom",), "the time in which the closed loop covers 63.2 % of a setpoint step"),
    (("PWM period",), "the time from one switching-on of the heater to the next"),
    (("minimum on", "minimum off"), "the shortest time the switch stays on, or off"),
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
