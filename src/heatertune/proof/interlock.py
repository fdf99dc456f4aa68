"""An interlock between controller and heater: a second program that may open the heater's circuit.

The bit processor's heater program (E. Hryniewicz, M. Chmiel, Przegląd Elektrotechniczny 88(9a), 2012, below figure 9)
runs every 10 ms. Its output H is a contact in series with the switch that the controller drives. Its buttons A (fan)
and B (heater) are pressed during the first scan and never again; see plc/on_off/DIFFERENCES.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError, UnknownName
from heatertune.options import options_of
from heatertune.plc.cpu.one_bit.machine import START, OneBitState, Wiring, assemble, scan
from heatertune.plc.cpu.one_bit.programs import HEATER, HEATER_NAMES
from heatertune.plc.pwm import INSTANT_S
from heatertune.settings import Conditions
from heatertune.units import check

__all__ = ["INTERLOCKS", "Interlock", "demand_none"]

#: names on the command line
INTERLOCKS: Final = tuple(options_of(Conditions)["interlock"].choices)

_SCAN_S: Final = 0.01

_BITS: Final = HEATER_NAMES.bits
_PROGRAM: Final = assemble(HEATER, HEATER_NAMES, operand_bits=5)
_WIRING: Final = Wiring(inputs=frozenset(_BITS[name] for name in "ABCDR"))

_BLOCK: Final = 100_000  # instants looked at in one go


def demand_none(name: str | None) -> None:
    """Refuse an interlock for samples, which are run without one.

    Raises:
        InputError: there is one.
    """
    if name is not None:
        raise InputError("samples are run without an interlock: leave out --interlock, or --samples and --replay")


@dataclass(frozen=True, slots=True, kw_only=True)
class Interlock:
    """The program that watches the heater.

    Attributes:
        name: one of `INTERLOCKS`.
        limit_degC: temperature from which on its limit sensor reads 1 [°C]; the sensor has neither noise nor delay.
        fan_stops_s: instant from which on the fan does not turn, whatever it is told [s]; None: it never fails.

    Raises:
        UnknownName: no such interlock.
        OutOfRange: a temperature or time without meaning.
    """

    name: str
    limit_degC: float
    fan_stops_s: float | None = None

    def __post_init__(self) -> None:
        if self.name not in INTERLOCKS:
            raise UnknownName("interlock", self.name, INTERLOCKS)
        check("limit_degC", self.limit_degC, least=-273.15)
        if self.fan_stops_s is not None:
            check("fan_stops_s", self.fan_stops_s, least=0.0)

    def opens_s(self, temperature_at: Callable[[Array], Array], end_s: float, cold_until_s: float = 0.0) -> float:
        """Return the instant at which the contact opens [s], infinite where it does not.

        The program rests between changes of its inputs, so it is run only at the scans that see one.

        Args:
            temperature_at: instants [s] → temperatures [°C] of a run whose contact stays closed, both of shape (n,).
            end_s: of that run [s].
            cold_until_s: up to then it is known to be colder than the limit [s].
        """
        stops = None if self.fan_stops_s is None else math.ceil(self.fan_stops_s / _SCAN_S - INSTANT_S)
        changes = {0, 1, self._first_hot(temperature_at, end_s, cold_until_s), stops}
        state = START
        for k in sorted(k for k in changes if k is not None and k * _SCAN_S <= end_s):
            hot = float(temperature_at(np.array([k * _SCAN_S]))[0]) >= self.limit_degC
            state = _scan(state, pressed=k == 0, hot=hot, turns=stops is None or k < stops)
            if not state.is_on(_BITS["H"]):
                return k * _SCAN_S
        return math.inf

    def _first_hot(self, temperature_at: Callable[[Array], Array], end_s: float, cold_until_s: float) -> int | None:
        """Return the first scan after the buttons' at which the limit sensor reads 1."""
        last = math.floor(end_s / _SCAN_S)
        for begin in range(1 + math.floor(min(cold_until_s, end_s) / _SCAN_S), last + 1, _BLOCK):
            scans = np.arange(begin, min(begin + _BLOCK, last + 1), dtype=np.float64)
            hot = np.flatnonzero(temperature_at(scans * _SCAN_S) >= self.limit_degC)
            if len(hot):
                return begin + int(hot[0])
        return None


def _scan(state: OneBitState, *, pressed: bool, hot: bool, turns: bool) -> OneBitState:
    signals = {"A": pressed, "B": pressed, "C": hot, "D": turns, "R": False}
    return scan(_PROGRAM, _WIRING, state, on=frozenset(_BITS[name] for name, value in signals.items() if value))
