"""What a trace of the commissioned loop shows: where it begins, what is asked for, and what comes after."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.commissioned import AsLeftSettings
from heatertune.errors import InputError
from heatertune.log.values import Log
from heatertune.model.circumstances import reading_step_degC

__all__ = ["LEAST_STEP_DEGC", "LEAVES", "TracePart", "TraceParts", "begins_mid_way", "begun_mid_way", "leaves_s",
           "parts_of"]

Array = npt.NDArray[np.float64]

_OFF_PCT: Final = 0.5  # a power that is none
_AT_START: Final = 5  # readings whose median is the temperature at the start
_ONE_MOVE: Final = 3  # readings within which setpoints that follow one another are one move: a ramp
LEAST_STEP_DEGC: Final = 0.01  # of a reading, for when a temperature has left its rest
_FARTHER: Final = 3.0  # times as far as it takes to have left the rest: there the slope of the way is seen
_WHOLE: Final = 0.75  # of a whole heat-up: a shorter one begins warm
LEAVES: Final = 3.0  # steps or noise of a reading beyond which the temperature has left its rest


@dataclass(frozen=True, slots=True, kw_only=True)
class TracePart:
    """A part of a trace, from one event to the next.

    Attributes:
        kind: "heat-up", "change" (of the setpoint) or "recovery" (from a load), as `heatertune.proof.scenario.Phase`.
        begin_s, end_s: since the trace's beginning [s].
        setpoint_degC: what is asked for [°C].
        from_degC: what was asked for before, or where the heat-up begins [°C].
    """

    kind: str
    begin_s: float
    end_s: float
    setpoint_degC: float
    from_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceParts:
    """What a trace shows.

    Attributes:
        begins_s: instant in the log at which its first part begins [s].
        begins_by: how that is known: "told", by "setpoint", "power" or "temperature" (it leaves its rest), or it is the
            "first reading".
        unsure_s: how much earlier it may have begun [s].
        start_degC: temperature there [°C].
        step_degC: step or noise of a reading [°C].
        parts: what it shows, in order of time.
        notes: what is odd, one sentence each.
    """

    begins_s: float
    begins_by: str
    unsure_s: float
    start_degC: float
    step_degC: float
    parts: tuple[TracePart, ...]
    notes: tuple[str, ...] = ()

    def delay(self, later_s: float) -> TraceParts:
        """Return the same with the beginning later by so much, and what follows at its instant."""
        first, *others = self.parts
        rest = [replace(part, begin_s=part.begin_s - later_s, end_s=part.end_s - later_s) for part in others]
        return replace(self, begins_s=self.begins_s + later_s,
                       parts=(replace(first, end_s=first.end_s - later_s), *rest))


def parts_of(
    log: Log, asked: AsLeftSettings, *, setpoint_degC: float, band_degC: float, heats: bool
) -> TraceParts:
    """Return what a trace shows.

    Args:
        log: the trace.
        asked: what its user says of it.
        setpoint_degC: what is asked for, where neither the user nor the trace says so [°C].
        band_degC: how far from a setpoint is still right [°C].
        heats: whether power heats; it cools otherwise.

    Raises:
        InputError: nothing in it can be judged: it begins at its setpoint, or beyond it; an instant outside of it.
    """
    moves = _moves(log, asked, setpoint_degC)
    running = _runs(log, moves, band_degC, asked)
    index, by = _begin(log, moves, asked, band_degC, running=running, heats=heats)
    before = 0.0 if index == 0 else float(log.time_s[index] - log.time_s[index - 1])
    unsure = before if by in ("setpoint", "power") else _interval_s(log)
    start = float(np.median(log.temperature_degC[max(0, index - _AT_START + 1):index + 1]))
    asked_first = [value for at, value in moves if at <= index][-1]
    _demand_way(log, start, asked_first, band_degC, heats=heats, running=running)
    begins = float(log.time_s[index])
    return TraceParts(
        begins_s=begins, begins_by=by, unsure_s=unsure, start_degC=start, step_degC=reading_step_degC(log),
        parts=tuple(_parts(log, moves, asked, index, start, running=running)), notes=tuple(_doubts(by)))


def leaves_s(time_s: Array, temperature_degC: Array, start_degC: float, end_degC: float, least_degC: float) -> float:
    """Return the last instant before half of a way at which the temperature has not left its start yet [s].

    Args:
        time_s: [s], shape (n,).
        temperature_degC: [°C], shape (n,).
        start_degC: where the way begins [°C].
        end_degC: where it leads [°C].
        least_degC: how far from the start it has left it [°C].
    """
    sign = np.sign(end_degC - start_degC)
    gone = sign * (temperature_degC - start_degC)
    half = np.flatnonzero(gone > 0.5 * abs(end_degC - start_degC))
    still = np.flatnonzero(gone[: int(half[0]) if len(half) else None] <= least_degC)
    return float(time_s[still[-1]]) if len(still) else float(time_s[0])


def begins_mid_way(log: Log, parts: TraceParts, whole_degC: float) -> bool:
    """Return whether a trace begins in the middle of a heat-up: it shows no rest before the temperature moves.

    Args:
        log: the trace.
        parts: what it shows.
        whole_degC: of a heat-up from the ambient to the setpoint of the proof [°C].
    """
    first = parts.parts[0]
    if first.kind != "heat-up" or parts.begins_by not in ("temperature", "first reading", "power"):
        return False  # a power that is off at first may be between two pulses
    if abs(first.setpoint_degC - parts.start_degC) < _WHOLE * whole_degC:
        return True  # it is warm already, and nobody knows since when
    time, temperature = log.time_s, log.temperature_degC
    least = LEAVES * max(parts.step_degC, LEAST_STEP_DEGC)
    start, sign = float(temperature[0]), np.sign(first.setpoint_degC - parts.start_degC)
    gone = sign * (temperature - start)
    left = leaves_s(time, temperature, start, first.setpoint_degC, least) - float(time[0])
    far = min(_FARTHER * least, float(gone.max()))
    if far <= least:
        return True
    # at rest the temperature stays within `least` for longer than it takes to leave it at the slope that follows
    passed = float(time[np.flatnonzero(gone >= far)[0]] - time[0]) - left
    return left <= _interval_s(log) + passed * least / (far - least)


def begun_mid_way(log: Log, parts: TraceParts) -> TraceParts:
    """Return a trace that begins in the middle of a heat-up with its first reading as its beginning."""
    moved = parts.delay(float(log.time_s[0]) - parts.begins_s)
    return replace(moved, begins_by="first reading", start_degC=float(log.temperature_degC[0]), notes=())


def _interval_s(log: Log) -> float:
    return float(np.median(np.diff(log.time_s)))


def _moves(log: Log, asked: AsLeftSettings, setpoint_degC: float) -> list[tuple[int, float]]:
    """Return the reading from which on each setpoint is asked for [°C], the first from the first one on.

    A setpoint that is led to its end, reading by reading, is one move to that end.
    """
    given = asked.setpoint_degC
    if given is not None or log.setpoint_degC is None:
        return [(0, setpoint_degC if given is None else given)]
    column = log.setpoint_degC
    moves, last = [(0, float(column[0]))], -_ONE_MOVE
    for index in (np.flatnonzero(np.diff(column)) + 1).tolist():
        if index - last < _ONE_MOVE and len(moves) > 1:
            moves[-1] = (moves[-1][0], float(column[index]))
        else:
            moves.append((index, float(column[index])))
        last = index
    return moves


def _runs(log: Log, moves: list[tuple[int, float]], band_degC: float, asked: AsLeftSettings) -> bool:
    """Return whether the loop is at its first setpoint already when another one is asked for."""
    if len(moves) == 1 or asked.begins_s is not None:
        return False
    upto = log.temperature_degC[:moves[1][0]]
    return bool(np.all(np.abs(upto - moves[0][1]) <= band_degC))


def _begin(
    log: Log, moves: list[tuple[int, float]], asked: AsLeftSettings, band_degC: float, *, running: bool, heats: bool
) -> tuple[int, str]:
    """Return the reading with which the first part begins, and how that is known."""
    if asked.begins_s is not None:
        _demand_inside(log, "begins-at", asked.begins_s)
        return int(np.searchsorted(log.time_s, asked.begins_s)), "told"
    sign = 1.0 if heats else -1.0
    if running:
        return moves[1][0], "setpoint"
    calling = [index for index, value in moves if sign * (value - float(log.temperature_degC[index])) > band_degC]
    if not calling or calling[0] > 0:
        return (calling[0], "setpoint") if calling else (0, "first reading")
    power = log.power_pct
    if power is not None and power[0] <= _OFF_PCT and np.any(power > _OFF_PCT):
        return int(np.flatnonzero(power > _OFF_PCT)[0]), "power"
    if power is not None and power[0] > _OFF_PCT:
        return 0, "first reading"
    start = float(np.median(log.temperature_degC[:_AT_START]))
    left = leaves_s(log.time_s, log.temperature_degC, start, moves[0][1], LEAVES * reading_step_degC(log))
    return int(np.searchsorted(log.time_s, left)), "temperature"


def _demand_way(
    log: Log, start_degC: float, setpoint_degC: float, band_degC: float, *, heats: bool, running: bool
) -> None:
    where = f"{log.name}: begins at {start_degC:.4g} °C"
    if not running and abs(setpoint_degC - start_degC) <= band_degC:
        raise InputError(f"{where}, at its setpoint of {setpoint_degC:g} °C: no heat-up and no change of the setpoint "
                         "to be judged; log from before the heater is switched on, or say --setpoint")
    if not running and (setpoint_degC > start_degC) != heats:
        raise InputError(f"{where}, beyond its setpoint of {setpoint_degC:g} °C: log from before the way to it, or say "
                         "--setpoint")


def _demand_inside(log: Log, name: str, instant_s: float) -> None:
    first, last = float(log.time_s[0]), float(log.time_s[-1])
    if not first <= instant_s < last:
        raise InputError(f"--{name} = {instant_s:g} s: {log.name} goes from {first:g} to {last:g} s")


def _parts(
    log: Log, moves: list[tuple[int, float]], asked: AsLeftSettings, index: int, start_degC: float, *, running: bool
) -> Iterator[TracePart]:
    begins, end = float(log.time_s[index]), float(log.time_s[-1])
    before = [value for at, value in moves if at <= index]
    events = [("change" if running else "heat-up", begins, before[-1])]
    events += [("change", float(log.time_s[at]), value) for at, value in moves if at > index]
    if asked.load_at_s is not None:
        _demand_inside(log, "load-at", asked.load_at_s)
        if asked.load_at_s <= begins:
            raise InputError(f"--load-at = {asked.load_at_s:g} s: the heat-up of {log.name} begins at {begins:g} s")
        asked_then = [value for _, at, value in sorted(events, key=lambda event: event[1]) if at <= asked.load_at_s]
        events.append(("recovery", asked.load_at_s, asked_then[-1]))
    events.sort(key=lambda event: event[1])
    last = before[-2] if running else start_degC
    for number, (kind, instant, value) in enumerate(events):
        until = events[number + 1][1] if number + 1 < len(events) else end
        yield TracePart(kind=kind, begin_s=instant - begins, end_s=until - begins, setpoint_degC=value, from_degC=last)
        last = value


def _doubts(by: str) -> Iterator[str]:
    if by == "temperature":
        yield ("Neither setpoint nor power in the trace shows when the heat-up began: it is taken from where the "
               "temperature starts to move.")
    elif by == "first reading":
        yield "The heater is on from the first reading on: the heat-up may have begun earlier, and times be longer."
