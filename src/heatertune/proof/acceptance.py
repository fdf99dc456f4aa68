"""What the runs of a proof are held against, and what is known of the heater that no run shows.

Which runs a proof makes.

An interlock between controller and heater: a second program that may open the heater's circuit.

The bit processor's heater program (E. Hryniewicz, M. Chmiel, Przegląd Elektrotechniczny 88(9a), 2012, below figure 9)
runs every 10 ms. Its output H is a contact in series with the switch that the controller drives. Its buttons A (fan)
and B (heater) are pressed during the first scan and never again; see plc/on_off/DIFFERENCES.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError, UnknownName
from heatertune.model.model_values import HeaterModel
from heatertune.options import options_of
from heatertune.pid.design_values import Margins, PidDesign
from heatertune.plc.cpu.one_bit.machine import HEATER, HEATER_NAMES, START, OneBitState, Wiring, assemble, scan
from heatertune.plc.open_points import OpenPoint, settings_to_prove
from heatertune.plc.pwm import INSTANT_S
from heatertune.processors import ProgressCallback
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.heaters import Supply
from heatertune.proof.specification import Specification
from heatertune.proof.verdict import FitDiagnostics
from heatertune.settings import Conditions
from heatertune.units import check

__all__ = ["INTERLOCKS", "Acceptance", "Coverage", "Interlock", "Run", "demand_none"]


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


#: label of a model, setting of each switch, full power as a share of the rated one (None: the rated power)
Run = tuple[str, Mapping[str, str], float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Which runs a proof makes: every model under every setting the manual leaves open, or fewer for a quick look.

    Attributes:
        known: switch → setting of what is known of this very controller, the manual leaving it open.
        open_points: False: only the default settings of the controller's switches, for a quick comparison.
        only: these runs, by the controller's direct form alone; None: every model under every setting at each power.
        night: with `only`: the heat-up and one of `heatertune.proof.long_outage` alone, by its name, if the words have
            it.
        night_times: how many times as long as in a proof the longest open circuit of that night lasts.
        draws: False: no more than one draw of the noise; see `heatertune.proof.proof`.
        progress: told how many runs are done, as "18 of 54 runs".
        supplies: other mains voltages, each with the heaters that run at it; none: the rated power alone.
    """

    stated_settings: Mapping[str, str] = field(default_factory=dict)
    open_points: bool = True
    only: Sequence[Run] | None = None
    night: str | None = None
    night_times: float = 1.0
    draws: bool = True
    progress: ProgressCallback = str
    supplies: Sequence[Supply] = ()

    @property
    def whole(self) -> bool:
        """Whether every model runs under every setting."""
        return self.open_points and self.only is None

    def settings(self, switches: Sequence[OpenPoint]) -> list[dict[str, str]]:
        """Return the settings under which words are run, the defaults (and what is known) first.

        Raises:
            UnknownName: what is known is no switch or setting.
        """
        return settings_to_prove(switches, self.stated_settings)[: None if self.open_points else 1]

    def runs(self, model: str, settings: Mapping[str, str], mains_power: float | None = None) -> bool:
        """Return whether a model, by its label, is run under these settings at a power, see `Run`."""
        return self.only is None or (model, settings, mains_power) in self.only

    def runs_any(self, mains_power: float | None) -> bool:
        """Return whether there is a run at a power, see `Run`."""
        return self.only is None or any(power == mains_power for *_, power in self.only)

    def in_question(self, switches: Sequence[OpenPoint]) -> list[OpenPoint]:
        """Return the switches that are run in several settings, or that no run can show though nobody knows them.

        None where only some runs are made, of which nothing is told.
        """
        if self.only is not None:
            return []
        return [switch for switch in switches
                if not switch.in_manual or (self.whole and switch.name not in self.stated_settings)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceptance:
    """What a proof's verdict rests on beside its runs.

    Attributes:
        limits: that every run must keep.
        specification: behind the limits, in its user's words; None: the limits were given as they are.
        margins_of: margins of a design on a heater; None: margins are not judged.
        reading_step_degC: step or noise of a reading on the heater, where that is more than the controller's own [°C].
        heard: what the fit found and the user knows.
    """

    limits: LoopLimits = field(default_factory=LoopLimits)
    specification: Specification | None = None
    margins_of: Callable[[HeaterModel, PidDesign], Margins] | None = None
    reading_step_degC: float = 0.0
    diagnostics: FitDiagnostics = field(default_factory=FitDiagnostics)

    def margins(self, designs: Sequence[PidDesign], models: Iterable[HeaterModel]) -> dict[HeaterModel, Margins]:
        """Return the worst margins of designs on each model; none where they are not judged, or there is no design."""
        of = self.margins_of
        if of is None or not designs:
            return {}
        return {model: _worst([of(linear, design) for linear in model.linear for design in designs])
                for model in dict.fromkeys(models)}

    def step_power_pct(self, designs: Sequence[PidDesign], reading_degC: float) -> float | None:
        """Return the most power that one step of the reading moves [%]; None where there is no design.

        Args:
            designs: as the words realise them.
            reading_degC: what the controller and the scenario make of a reading's step [°C].
        """
        step = max(self.reading_step_degC, reading_degC)
        return max((design.step_power_pct_per_degC * step for design in designs), default=None)


def _worst(margins: Sequence[Margins]) -> Margins:
    """Return the least of each margin."""
    return margins[0] if len(margins) == 1 else Margins(
        ms=max(one.ms for one in margins), mt=max(one.mt for one in margins),
        gain_margin=min(one.gain_margin for one in margins),
        phase_margin_deg=min(one.phase_margin_deg for one in margins))
