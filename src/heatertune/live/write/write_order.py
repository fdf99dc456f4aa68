"""In which order parts are written, so that whatever stands in the PLC in between is stable, too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from heatertune.live.write.block_image import WritePart
from heatertune.plc.ramp import Number

__all__ = ["NoOrder", "in_order"]


class NoOrder(Exception):
    """Raised where every order leads through words that are not proven; the text says which, never a user's error."""


def in_order(
    parts: Sequence[WritePart], before: Mapping[str, Number], after: Mapping[str, Number],
    open_in_between: Callable[[Mapping[str, Number]], str],
) -> list[WritePart]:
    """Return parts in an order in which every set of words in between is proven stable.

    One request is whole or not there at all; between two, and for ever where the link breaks, the PLC runs what stands.

    Args:
        parts: what is to be written.
        before: all words as they are.
        after: all words as they are to be.
        open_in_between: why words are not proven stable, nothing where they are.

    Raises:
        NoOrder: there is none.
    """
    why: dict[frozenset[int], str] = {}

    def words(done: frozenset[int]) -> dict[str, Number]:
        written = [name for number in done for name in parts[number].names]
        return {**before, **{name: after[name] for name in written}}

    def reached(order: tuple[int, ...]) -> tuple[int, ...] | None:
        if len(order) == len(parts):
            return order
        done = frozenset(order)
        if order and done not in why:
            why[done] = open_in_between(words(done))
        if why.get(done):
            return None
        for number in range(len(parts)):
            if number not in done and not why.get(done | {number}) and (found := reached((*order, number))):
                return found
        return None

    order = reached(())
    if order is not None:
        return [parts[number] for number in order]
    first = min((done for done, told in why.items() if told), key=lambda done: (len(done), sorted(done)))
    told = ", ".join(f"{name} = {after[name]:g}" for number in sorted(first) for name in parts[number].names)
    raise NoOrder(f"no order of writing is proven: with {told} first, {why[first]}")
