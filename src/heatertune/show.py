"""What a notebook shows of a value: the last line of a cell is enough.

The six values of the chain take `Shown` as a base, so every front end that follows IPython's protocol (Jupyter, VS
Code, marimo) finds `_repr_html_` on them, whichever was imported first. The pictures belong to the report, the last
stage: the package hands its cards in from above, so that no stage knows one that sorts after it.
"""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Shown", "shown_by"]


class Shown:
    """A value that a notebook shows as a small table and a picture."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return the value as HTML, picture included; nothing in it is fetched from anywhere."""
        return _cards[-1](self)


_cards: list[Callable[[object], str]] = [repr]


def shown_by(card: Callable[[object], str]) -> None:
    """Let values be shown by a function from value to HTML."""
    _cards.append(card)
