"""Display of values in notebooks (IPython's protocol: Jupyter, VS Code, marimo), and the hook that runs words.

The values of the chain inherit `NotebookDisplay`. Pictures and sentences belong to the report, the last stage, and
words do not import controllers; the package sets both as hooks, so that no stage imports a later one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final, Protocol

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Artist", "NotebookDisplay", "run_by", "runner", "shown_by"]


#: (words, switch → setting) → the running controller
Runner = Callable[[Any, Mapping[str, str]], Any]

_runners: Final[list[Runner]] = []


def run_by(who: Runner) -> None:
    """Let words be run by a function; it is called when words are to run, not before."""
    _runners.append(who)


def runner() -> Runner:
    """Return who makes words run."""
    return _runners[-1]


class Artist(Protocol):
    """Who shows values."""

    def card(self, value: object, /) -> str:
        """Return a value as HTML."""

    def plot(self, value: object, ax: Axes | None, /) -> Axes:
        """Draw a value and return the axes."""

    def summary(self, value: object, /) -> str:
        """Return a value as lines of text."""


class NotebookDisplay:
    """A value that a notebook shows as a small table and a picture."""

    __slots__ = ()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the value's picture.

        Args:
            ax: where to; None makes a figure of its own, with a second panel for the power where there is one.

        Returns:
            The axes, of the temperature where there are several.
        """
        return _artist().plot(self, ax)

    def summary(self) -> str:
        """Return what the command line prints of the value: numbers with their units, and what there is to know."""
        return _artist().summary(self)

    def _repr_html_(self) -> str:
        """Return the value as HTML, picture included; nothing in it is fetched from anywhere."""
        return _artist().card(self)


_artists: list[Callable[[], Artist]] = []


def _artist() -> Artist:
    return _artists[-1]()


def shown_by(artist: Callable[[], Artist]) -> None:
    """Let values be shown by what a function returns; it is asked when a value is to be shown, not before."""
    _artists.append(artist)
