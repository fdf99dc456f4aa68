"""The picture of each value of the chain, panel by panel: for a card, for a figure, or into a user's own axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import singledispatch
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from heatertune.log.values import Log
from heatertune.model.values import FittedModel
from heatertune.pid.reaction import reaction
from heatertune.pid.values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.proof import Proof, Trace
from heatertune.report.plots import LOOK, key, label_levels, new_figure, power_limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Panel", "draw_figure", "panels", "thinned"]

_POINTS: Final = 600  # what a card's width can show


class Panel(NamedTuple):
    """A part of a picture: its height, and what draws it."""

    height_in: float
    paint: Callable[[Axes], None]


@singledispatch
def panels(value: object) -> Sequence[Panel]:
    """Return the panels of a value's picture, the main one first.

    Raises:
        TypeError: no value of the chain.
        ValueError: a value without anything to draw.
    """
    raise TypeError(f"no picture of a {type(value).__name__}")


def draw_figure(value: object, figure: Figure | None = None) -> tuple[Figure, list[Axes]]:
    """Return a figure of a value, and its axes; `figure`: an empty one to be used."""
    parts = panels(value)
    heights = [part.height_in for part in parts]
    figure, axes = new_figure(len(parts), sum(heights), figure=figure, sharex=True, height_ratios=heights)
    for part, ax in zip(parts, axes, strict=True):
        part.paint(ax)
    for ax in axes[:-1]:
        ax.set_xlabel("")
    return figure, axes


def thinned(*columns: Any) -> list[Any]:
    """Return every n-th of each column, so that no more stays than can be seen; the last is kept."""
    n = len(columns[0])
    kept = np.unique(np.linspace(0, n - 1, min(n, _POINTS)).astype(int))
    return [np.asarray(column)[kept] for column in columns]


@panels.register
def _log(value: Log) -> Sequence[Panel]:
    def temperature(ax: Axes) -> None:
        ax.plot(*thinned(value.time_s, value.temperature_degC), **LOOK["log"])
        ax.set(xlabel="time [s]", ylabel="temperature [°C]")

    if value.power_pct is None:
        return [Panel(2.4, temperature)]
    return [Panel(2.55, temperature), _power(0.85, [(value.time_s, value.power_pct, "log")])]


@panels.register
def _model(value: FittedModel) -> Sequence[Panel]:
    left = value.residuals
    if left is None:
        raise ValueError("a model given by hand has no log to be drawn beside")

    def paint(ax: Axes) -> None:
        time, measured, simulated = thinned(left.time_s, left.measured_degC, left.simulated_degC)
        for line, name in ((measured, "log"), (simulated, "model")):
            ax.plot(time, line, **LOOK[name])
        key(ax, ("log", "log"), ("model", "model"))
        ax.set(xlabel="time [s]", ylabel="temperature [°C]")

    return [Panel(2.6, paint)]


@panels.register
def _design(value: PidDesign) -> Sequence[Panel]:
    def paint(ax: Axes) -> None:
        ax.step(*thinned(*reaction(value)), where="post", **LOOK["realised"])
        ax.set(xlabel="time since the error stepped by 1 °C [s]", ylabel="change of power [%]")
        ax.set_ylim(bottom=min(0.0, value.gain_pct_per_degC))

    return [Panel(2.0, paint)]


@panels.register
def _words(value: Words) -> Sequence[Panel]:
    design = controller_for(value.target).decode(value)
    if design is None:
        raise ValueError(f"the words of {value.target} are no PID constants")
    return panels(design)


@panels.register
def _proof(value: Proof) -> Sequence[Panel]:
    return _loop([("worst", value.worst, "worst"), ("nominal", value.nominal, "realised")])


@panels.register
def _trace(value: Trace) -> Sequence[Panel]:
    return _loop([("temperature", value, "realised")])


def _loop(runs: Sequence[tuple[str, Trace, str]]) -> Sequence[Panel]:
    def temperature(ax: Axes) -> None:
        for _, trace, look in runs:
            ax.plot(*thinned(trace.time_s, trace.temperature_degC), **LOOK[look])
        ax.axhline(runs[0][1].setpoint_degC, **LOOK["limit"])
        label_levels(ax, (runs[0][1].setpoint_degC, "setpoint"))
        key(ax, *((name, look) for name, _, look in runs))
        ax.set(xlabel="time [s]", ylabel="temperature [°C]")

    powers = [(trace.time_s, trace.power_asked_pct, look) for _, trace, look in runs]
    return [Panel(2.27, temperature), _power(1.13, powers)]


def _power(height_in: float, lines: Sequence[tuple[Any, Any, str]]) -> Panel:
    def paint(ax: Axes) -> None:
        for time, power, look in lines:
            ax.step(*thinned(time, power), where="post", **LOOK[look])
        ax.set(xlabel="time [s]", ylabel="power [%]", ylim=power_limits(*(power for _, power, _ in lines)))

    return Panel(height_in, paint)
