"""Display of values in notebooks (IPython's protocol: Jupyter, VS Code, marimo), their files, and how words are run.

The values of the chain inherit `NotebookDisplay`. Pictures, sentences and documents belong to later stages, and words
do not import controllers; the package sets them as hooks, so that no stage imports a later one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from heatertune.codec import to_json
from heatertune.errors import InputError, closest
from heatertune.writing import write_files

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

__all__ = ["Archive", "Artist", "NotebookDisplay", "run_by", "runner", "shown_by", "stored_by"]


#: (words, switch → setting) → the running controller
Runner = Callable[[Any, Mapping[str, str]], Any]

_runners: Final[list[Runner]] = []


def run_by(who: Runner) -> None:
    """Let words be run by a function; it is called when words are to run, not before."""
    _runners.append(who)


def runner() -> Runner:
    """Return who makes words run."""
    return _runners[-1]


#: what a part of a heater or a controller is called in formulas and in other programs → how its attribute begins
_SYMBOLS: Final[Mapping[str, str]] = dict.fromkeys(("k", "kp", "kc", "gain"), "gain_") | dict.fromkeys(
    ("tn", "ti", "integral"), "integral_time") | dict.fromkeys(("tv", "td", "derivative"), "derivative_time") | (
    dict.fromkeys(("ta", "ts", "dt"), "sample_time") | dict.fromkeys(("tau", "t", "t1"), "time_constant")) | (
    dict.fromkeys(("l", "theta", "delay", "deadtime"), "dead_time"))


def _meant(value: Any, name: str) -> str | None:
    """Return the attribute or the parameter of a value that a name is near to; None if there is none."""
    if name in (value.values if hasattr(type(value), "values") else ()):
        return f"values[{name!r}]"
    of_model = dir(value.model) if hasattr(type(value), "model") else []
    names = [each for each in (*dir(value), *(f"model.{part}" for part in of_model))
             if not each.startswith(("_", "model._"))]
    symbol = _SYMBOLS.get(name.lower(), " ")
    starts = (each for each in names if each.removeprefix("model.").startswith(symbol))
    return next(starts, None) or closest(name, names)


class Artist(Protocol):
    """Who shows values."""

    def card(self, value: object, /) -> str:
        """Return a value as HTML."""

    def plot(self, value: object, ax: Axes | None, /) -> Axes:
        """Draw a value and return the axes."""

    def summary(self, value: object, /, *, verbose: bool) -> str:
        """Return a value as lines of text."""


class Archive(Protocol):
    """Who turns values into documents and tables."""

    def to_dict(self, value: object, /) -> dict[str, Any]:
        """Return a value as a JSON document."""

    def rows(self, value: object, /) -> list[dict[str, Any]]:
        """Return a value as the rows of a table."""


class NotebookDisplay:
    """A value that a notebook shows as a small table and a picture."""

    __slots__ = ()

    if not TYPE_CHECKING:  # for a type checker, a value has only its own attributes

        def __getattr__(self, name):
            """Refuse an attribute that the value does not have, with the one that was meant."""
            meant = None if name.startswith("_") else _meant(self, name)
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}"
                                 f"{f': did you mean {meant}?' if meant else ''}", name=name, obj=self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the value's picture.

        Args:
            ax: where to; None makes a figure of its own, with a second panel for the power where there is one.

        Returns:
            The axes, of the temperature where there are several.
        """
        return _artist().plot(self, ax)

    def summary(self, *, verbose: bool = False) -> str:
        """Return what the command line prints of the value on one screen, the point first; `verbose`: all of it."""
        return _artist().summary(self, verbose=verbose)

    def to_dict(self) -> dict[str, Any]:
        """Return the value as the JSON document that `save` writes.

        Raises:
            InputError: a trace, which has none.
        """
        return _archives[-1]().to_dict(self)

    def save(self, path: str | Path) -> Path:
        """Write the value to a JSON file, which `heatertune.load` and the commands read; return its path.

        Raises:
            InputError: a name that does not end in .json, a file that cannot be written, a trace.
        """
        file = Path(path)
        if file.suffix.lower() != ".json":
            raise InputError(f"{file}: expected a name that ends in .json")
        write_files(file.parent, {file.name: to_json(self.to_dict())})
        return file

    def to_frame(self) -> DataFrame:
        """Return the value as a table of pandas: parameters, criteria, or readings, a row each.

        Raises:
            InputError: pandas is not installed; a value without such a table.
        """
        try:
            from pandas import DataFrame
        except ImportError as problem:
            raise InputError("a table needs pandas: pip install 'heatertune[notebook]'") from problem
        return DataFrame(_archives[-1]().rows(self))

    def _repr_html_(self) -> str:
        """Return the value as HTML, picture included; nothing in it is fetched from anywhere."""
        return _artist().card(self)


_artists: list[Callable[[], Artist]] = []


def _artist() -> Artist:
    return _artists[-1]()


_archives: list[Callable[[], Archive]] = []


def stored_by(archive: Callable[[], Archive]) -> None:
    """Let values be saved by what a function returns; it is asked when a value is to be saved, not before."""
    _archives.append(archive)


def shown_by(artist: Callable[[], Artist]) -> None:
    """Let values be shown by what a function returns; it is asked when a value is to be shown, not before."""
    _artists.append(artist)
