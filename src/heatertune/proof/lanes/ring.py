"""The edges under way to 32 heaters, PWM period by period in a ring.

A heater of much dead time has many edges under way, but what it may feel next are those of few periods: begun no longer
ago than the longest dead time of the 32, and no later than the shortest one lets any be felt. So it costs little, how
long the dead times are, and much, how far they are apart.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from heatertune.proof.lanes.parts import NEVER, Under, loaded_edges, loaded_line, loaded_under, stored_under
from heatertune.proof.lanes.rows import LANES, lanes_of
from heatertune.proof.meter import Places

__all__ = ["EdgeWindow", "Ring", "begun_at", "cut_off", "next_edge", "next_edges", "open_window", "ring_for"]


class Ring(NamedTuple):
    """PWM periods, number p at place p modulo the size.

    Attributes:
        begins: of the periods [s], shape (size,).
        rises: instants at which the heaters are switched on; infinite: not [s], shape (size, `LANES`).
        falls: likewise off.
    """

    begins: Places
    rises: Places
    falls: Places


class EdgeWindow(NamedTuple):
    """The periods of whose edges one may be felt next: numbers of the first one, and of the first one behind."""

    first: int
    beyond: int


def ring_for(dead_s: float, scan_s: float, period_s: float, restarts: int) -> Ring:
    """Return a ring that holds what is under way.

    Args:
        dead_s: the longest dead time [s].
        scan_s: interval between two scans [s].
        period_s: PWM period [s].
        restarts: how often the PLC starts up, and its PWM with it.
    """
    size = 1 << (math.ceil((dead_s + 2.0 * scan_s) / period_s) + 3 + restarts).bit_length()
    return Ring(np.zeros(size), np.zeros((size, LANES)), np.zeros((size, LANES)))


def begun_at(rows: Places, ring: Ring, number: int, begin: float) -> None:
    """Enter a period and the edges that were made for it.

    Args:
        rows: places.
        ring: of the periods.
        number: of the period.
        begin: of it [s].
    """
    place = number & (len(ring.begins) - 1)
    ring.begins[place] = begin
    all_rises, all_falls = ring.rises[place], ring.falls[place]
    for lane in range(lanes_of(rows)):  # a pass of its own: a compiler sees less where two arrays are written
        edges = loaded_edges(rows, lane)
        all_rises[lane], all_falls[lane] = edges.rises, edges.falls


def open_window(
    rows: Places, ring: Ring, window: EdgeWindow, begun: int, before: float, t: float, dead: tuple[float, float]
) -> EdgeWindow:
    """Let the heaters see the edges that one of them may feel until a scan; return the window that has them.

    Args:
        rows: places.
        ring: of the periods.
        window: until the scan before.
        begun: how many periods have begun.
        before: instant of the scan before [s].
        t: instant of the scan [s].
        dead: shortest and longest dead time [s].
    """
    first, beyond, last = window.first, window.beyond, len(ring.begins) - 1
    while beyond < begun and ring.begins[beyond & last] + dead[0] <= t:
        _sooner(rows, ring, beyond, False)
        beyond += 1
    while first + 1 < beyond and ring.begins[first + 1 & last] + dead[1] <= before:
        first += 1
    return EdgeWindow(first, beyond)


def next_edges(rows: Places, ring: Ring, window: EdgeWindow) -> None:
    """Look for the next edge of each heater, behind the one it felt last."""
    if window.first == window.beyond:
        for lane in range(lanes_of(rows)):
            u = loaded_under(rows, lane)
            stored_under(rows, lane, Under(NEVER, NEVER, u.last, u.power, u.owed, u.on, u.times, u.happened))
    for number in range(window.first, window.beyond):
        _sooner(rows, ring, number, number == window.first)


def _sooner(rows: Places, ring: Ring, number: int, anew: bool) -> None:
    """Take the edges of a period where they come before what is the next one so far; `anew`: none is."""
    place = number & (len(ring.begins) - 1)
    all_rises, all_falls = ring.rises[place], ring.falls[place]  # so a compiler sees that they follow one another
    for lane in range(lanes_of(rows)):
        u, rises, falls = loaded_under(rows, lane), all_rises[lane], all_falls[lane]
        edge = min(NEVER if anew else u.edge, rises if rises > u.last else NEVER, falls if falls > u.last else NEVER)
        stored_under(rows, lane, Under(
            edge + loaded_line(rows, lane).dead, edge, u.last, u.power, u.owed, u.on, u.times, u.happened))


def next_edge(ring: Ring, window: EdgeWindow, lane: int, last: float) -> float:
    """Return the edge of one heater that follows the one it felt last; infinite: none so far [s]."""
    edge, end = NEVER, len(ring.begins) - 1
    for number in range(window.first, window.beyond):
        rises, falls = ring.rises[number & end][lane], ring.falls[number & end][lane]
        edge = min(edge, rises if rises > last else NEVER, falls if falls > last else NEVER)
    return edge


def cut_off(rows: Places, ring: Ring, begun: int, now: float) -> None:
    """Take back what is left of a pulse, without supply, as `switch.switched_off` does.

    Args:
        rows: places.
        ring: of the periods.
        begun: how many periods have begun.
        now: instant of the scan [s].
    """
    all_falls = ring.falls[begun - 1 & len(ring.begins) - 1]
    for lane in range(lanes_of(rows)):
        u, falls = loaded_under(rows, lane), all_falls[lane]
        all_falls[lane] = now if u.on or now < falls < NEVER else falls
        stored_under(rows, lane, Under(u.due, u.edge, u.last, 0.0, u.owed, False, u.times, u.happened))
