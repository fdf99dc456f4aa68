"""In which orders zones are started one after the other, and what the verdict says about them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import Final

__all__ = ["StartOrder", "name_order", "start_orders", "summarize_orders"]

#: groups of zones, by their numbers, each started when those before it rest
StartOrder = tuple[tuple[int, ...], ...]

_EVERY: Final = 3  # zones of which every order is run


def start_orders(zones: int) -> tuple[StartOrder, ...]:
    """Return the orders in which so many zones are started: of up to three every order, of more each first and last.

    In the first ones, a zone that rests is followed by all others at once, which move it the most.
    """
    every = range(zones)
    alone = [(zone, tuple(other for other in every if other != zone)) for zone in every]
    orders, last = list(permutations(every)), []
    if zones > _EVERY:
        orders = [tuple(every), tuple(every[::-1]), (*every[::2], *every[1::2]), (*every[1::2], *every[::2])]
        last = [(others, (zone,)) for zone, others in alone]
    first = [((zone,), others) for zone, others in alone if others]
    return tuple(dict.fromkeys([*first, *(tuple((zone,) for zone in order) for order in orders), *last]))


def name_order(order: StartOrder, zones: Sequence[str], more: str = "") -> str:
    """Return the label of a run in which zones of these names are started in an order; `more`: what else differs."""
    groups = ", then ".join(" and ".join(zones[zone] for zone in group) for group in order)
    return f"zones started in turn: {groups}{more and ', '}{more}"


def summarize_orders(zones: Sequence[str], runs: Sequence[str]) -> list[str]:
    """Return what a verdict says about the orders in which zones are started, a line; nothing where one was not run.

    Args:
        zones: their names.
        runs: labels of the runs.
    """
    orders = start_orders(len(zones))
    if not {name_order(order, zones) for order in orders} <= {*runs}:
        return []
    which = "every order" if len(zones) <= _EVERY else f"{len(orders)} orders, each zone first and last"
    first = "; one before all others, which follow when it rests or nears its setpoint" if len(zones) > 1 else ""
    return [f"starts: all zones together; one after the other in {which}, each when those before it rest{first}"]
