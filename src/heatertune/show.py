"""What a notebook shows of a value: the last line of a cell is enough.

The six values of the chain take `Shown` as a base, so every front end that follows IPython's protocol (Jupyter, VS
Code, marimo) finds `_repr_html_` on them, whichever was imported first. The pictures belong to the report, the last
stage; it is looked up only when a front end asks, so that no stage imports one that sorts after it.
"""

from __future__ import annotations

from importlib import import_module

__all__ = ["Shown"]


class Shown:
    """A value that a notebook shows as a small table and a picture."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return the value as HTML, picture included; nothing in it is fetched from anywhere."""
        return str(import_module("heatertune.report.cards").card(self))
