"""The pictures. Each function takes one part of the pictures document and returns the figure; nothing is computed here.

All pictures share one style: each quantity keeps its colour and line style, also when printed in greyscale.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "LOOK", "key", "label_levels", "new_figure", "plot_fit", "plot_loop", "plot_paper", "plot_pareto", "plot_pwm",
    "plot_robustness", "plot_wish", "power_limits", "to_png", "to_svg",
]


# M. Okabe and K. Ito, "Color universal design" (2008): distinguishable for colour-blind eyes, and by brightness
LOOK: Final[dict[str, dict[str, Any]]] = {
    "log": {"color": "#000000", "linewidth": 0.9},
    "model": {"color": "#0072B2", "linewidth": 1.6},
    "ideal": {"color": "#E69F00", "linewidth": 1.6, "linestyle": (0, (5, 2))},
    "realised": {"color": "#009E73", "linewidth": 1.6},
    "worst": {"color": "#D55E00", "linewidth": 1.4, "linestyle": (0, (7, 1.5, 1.5, 1.5))},  # as dark as realised
    "other": {"color": "#C0C0C0", "linewidth": 0.7},
    "limit": {"color": "#666666", "linewidth": 0.8, "linestyle": ":"},
}


def new_figure(
    rows: int, height: float, columns: int = 1, *, figure: Figure | None = None, **settings: Any
) -> tuple[Figure, list[Axes]]:
    """Return a figure of full page width and its axes, row by row.

    Args:
        rows: number of rows of axes.
        height: of the figure [inch].
        columns: number of columns of axes.
        figure: an empty figure to use; None: a new one.
        settings: of `Figure.subplots`.
    """
    from matplotlib.figure import Figure

    figure = Figure() if figure is None else figure
    figure.set_size_inches(9.0, height)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **settings).ravel()
    for ax in axes:
        ax.grid(color="#dddddd", linewidth=0.5)
        ax.spines[["top", "right"]].set_visible(False)
    return figure, list(axes)


def power_limits(*powers: Any) -> tuple[float, float]:
    """Return the ends of an axis of power [%], from below 0 if one of them cools."""
    return -4.0 if all(np.nanmin(power, initial=0.0) >= 0.0 for power in powers) else -104.0, 104.0


def key(ax: Axes, *names: tuple[str, str]) -> None:
    """Draw a legend in a row above the axes, so that it covers no curve and is readable in greyscale.

    Args:
        ax: where.
        names: name and style of each line.
    """
    from matplotlib.lines import Line2D

    ax.legend(handles=[Line2D([], [], label=name, **LOOK[look]) for name, look in names], loc="lower left",
              bbox_to_anchor=(0.0, 1.0), ncols=len(names), frameon=False, fontsize=8, handlelength=3.5,
              borderaxespad=0.1)


def label_levels(ax: Axes, *levels: tuple[float, str]) -> None:
    """Write the names of at most two level lines to the right of them, outside the axes, the higher one higher."""
    places = ("center",) if len(levels) == 1 else ("top", "bottom")
    for (value, text), place in zip(sorted(levels), places, strict=True):
        ax.annotate(text, (1.0, value), xycoords=("axes fraction", "data"), xytext=(3, 0), textcoords="offset points",
                    color=LOOK["limit"]["color"], fontsize=8, va=place, annotation_clip=False)


def to_png(figure: Figure) -> bytes:
    """Return the figure as a PNG file; the same figure always gives the same bytes."""
    content = io.BytesIO()
    _lay_out(figure)
    figure.savefig(content, format="png", dpi=150, metadata={"Software": None})
    return content.getvalue()


def to_svg(figure: Figure) -> str:
    """Return the figure as an SVG element; the same figure always gives the same text."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    text = io.StringIO()
    _lay_out(figure)
    with mpl.rc_context({"svg.hashsalt": "heatertune", "svg.fonttype": "none", "font.family": "sans-serif"}):
        # not by `savefig`, which draws a figure that had an engine a second time before
        FigureCanvasSVG(figure).print_svg(text, metadata={"Date": None, "Creator": None})
    content = text.getvalue()
    return content[content.index("<svg") :]


def _lay_out(figure: Figure) -> None:
    """Lay out a figure once, because saving a figure with a layout engine draws it twice."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")


Part = Mapping[str, Any]

_MANY_PARTS: Final = 4  # a run with fewer is drawn on a linear axis
_NAMES_IN: Final = 1.1  # of the names of the parts below a picture [inch]
_RESTS_DRAWN: Final = 0.05  # of a time at rest
_NAMED: Final = 0.015  # a narrower part of the picture is only named in the text below
_SEEN: Final = 0.02  # |S| that is distinguishable from 0 in the picture


def plot_fit(log: Part, residuals: Part) -> Figure:
    """Draw the log and the fitted model, the power where it was logged, and the residuals."""
    powered = log["power_pct"] is not None
    ratios = (3, 1, 1) if powered else (3, 1)
    figure, (top, *middle, low) = new_figure(len(ratios), 3.8 + 0.8 * powered, sharex=True, height_ratios=ratios)
    top.plot(log["time_s"], log["temperature_degC"], label="log", **LOOK["log"])
    top.plot(residuals["time_s"], residuals["simulated_degC"], label="model", **LOOK["model"])
    top.set_ylabel("temperature [°C]")
    key(top, ("log", "log"), ("model", "model"))
    for ax in middle:
        time, power = (log.get("signals") or {}).get("power", (log["time_s"], log["power_pct"]))
        ax.step(time, power, where="post", label="power", **LOOK["log"])
        ax.set(ylabel="power [%]", ylim=(-4, 104))
    error = np.subtract(residuals["measured_degC"], residuals["simulated_degC"])
    low.plot(residuals["time_s"], error, label="residual", **LOOK["model"])
    low.axhline(0.0, label="zero", **LOOK["limit"])
    low.set(ylabel="residual [°C]", xlabel="time [s]")
    return figure


def plot_loop(nominal: Part, worst: Part, others: Sequence[Part], phases: Sequence[Part] = ()) -> Figure:
    """Draw the proven loop: temperature on all models, requested power on the nominal and the worst."""
    figure, (top, low) = new_figure(2, 4.2 + _named_height(phases), sharex=True, height_ratios=(2, 1.2))
    for run in others:
        top.plot(run["time_s"], run["temperature_degC"], label=run["label"], **LOOK["other"])
    _temperature(top, worst, "worst", "worst")
    _temperature(top, nominal, "nominal", "realised")
    _setpoint(top, nominal)
    names = [("nominal", "realised"), ("worst", "worst"), ("other models", "other")]
    key(top, *names[: 3 if others else 2])
    for run, name, look in ((worst, "worst", "worst"), (nominal, "nominal", "realised")):
        low.step(run["request_time_s"], run["request_pct"], where="post", label=name, **LOOK[look])
    powers = power_limits(nominal["request_pct"], worst["request_pct"])
    low.set(ylabel="requested power [%]", ylim=powers, xlabel="time [s]")
    _parts(phases, top, low)
    return figure


def plot_pwm(nominal: Part, start_s: float, end_s: float) -> Figure:
    """Draw the heater's switching within a short stretch."""
    figure, (ax,) = new_figure(1, 1.7)
    edges, power = np.asarray(nominal["edge_s"]), np.asarray(nominal["edge_pct"])
    before = power[np.searchsorted(edges, start_s) - 1] if len(edges) and edges[0] < start_s else 0.0
    inside = (edges >= start_s) & (edges <= end_s)
    time = np.concatenate([[start_s], edges[inside], [end_s]])
    level = np.concatenate([[before], power[inside]])
    ax.step(time, np.append(level, level[-1]), where="post", label="heater", **LOOK["realised"])
    ax.set_ylabel("heater [%]")
    ax.set_xlabel("time [s]")
    ax.set_ylim(-8 if np.min(level) >= 0.0 else -108, 108)
    return figure


def plot_wish(nominal: Part, wish: Part, phases: Sequence[Part] = ()) -> Figure:
    """Draw the ideal design and its rounded parameters."""
    figure, (top, low) = new_figure(2, 3.8 + _named_height(phases), sharex=True, height_ratios=(2, 1.2))
    _temperature(top, nominal, "realised", "realised")
    _temperature(top, wish, "ideal", "ideal")  # dashed, on top: where they agree, both are visible
    _setpoint(top, nominal)
    instants = np.asarray(nominal["time_s"])
    wished = np.interp(instants, wish["time_s"], wish["temperature_degC"])
    key(top, ("realised", "realised"), ("ideal", "ideal"))
    low.plot(instants, np.asarray(nominal["temperature_degC"]) - wished, label="realised − ideal", **LOOK["realised"])
    low.set(ylabel="difference [°C]", xlabel="time [s]")
    _parts(phases, top, low)
    return figure


def plot_paper(runs: Sequence[Part]) -> Figure:
    """Draw the temperature of the paper's own runs."""
    figure, (ax,) = new_figure(1, 3.0)
    looks = ("log", "worst", "realised")
    for run, look in zip(runs, looks, strict=False):
        _temperature(ax, run["series"], run["label"], look)
    _setpoint(ax, runs[0]["series"])
    key(ax, *((run["label"], look) for run, look in zip(runs, looks, strict=False)))
    ax.set_xlabel("time [s]")
    return figure


def plot_pareto(front: Part) -> Figure:
    """Draw cost against the limit of Ms, and the noise gain that the performance costs."""
    figure, (top, low) = new_figure(2, 4.6, sharex=True, height_ratios=(2, 1))
    rows = front["rows"]
    limits = [row["ms_limit"] for row in rows]
    top.plot(limits, [row["cost"] for row in rows], marker="o", markersize=4, **LOOK["realised"])
    top.set_ylim(bottom=0.0)
    top.set_ylabel("cost")
    top.set_title(f"{front['structure'].upper()}: {front['cost']}", fontsize=8, loc="left")
    low.plot(limits, [row["mks"] for row in rows], marker="o", markersize=4, **LOOK["worst"])
    low.set_ylim(bottom=0.0)
    low.set_ylabel("Mks [%/°C]")
    low.set_xlabel("limit of Ms [1]")
    return figure


def plot_robustness(curves: Sequence[Part], limit: float, designed: float | None = None) -> Figure:
    """Draw the Nyquist curves and the sensitivities of all models, with the limit and the design value of Ms.

    Args:
        curves: of the realised parameters; the first is the nominal model's.
        limit: the largest Ms [1] that passes.
        designed: Ms [1] of the unrounded design, worst over the models; None if it was not computed.
    """
    figure, (left, right) = new_figure(1, 3.6, columns=2)
    names = [("nominal", "realised"), ("worst", "worst"), ("other models", "other")]
    looks = ["worst" if curve["worst"] and i else "other" if i else "realised" for i, curve in enumerate(curves)]
    for curve, look in zip(curves, looks, strict=True):
        left.plot(curve["real"], curve["imaginary"], label=curve["label"], **LOOK[look])
        right.semilogx(curve["omega"], curve["sensitivity"], label=curve["label"], **LOOK[look])
    key(left, *(entry for entry in names if entry[1] in looks))
    top = max(2.2, 1.2 * limit)
    levels = [(limit, f"limit {limit:g}", "limit")]
    if designed is not None and designed < top:
        levels.append((designed, f"design {designed:.3g}", "ideal"))
    for inner, (level, text, look) in enumerate(sorted(levels)):
        _circle(left, level, text, look, inner=bool(inner))
        right.axhline(level, label=text, **LOOK[look])
    left.plot([-1.0], [0.0], "k+")
    left.set(xlim=(-2.2, 0.6), ylim=(-1.9, 0.9), xlabel="Re L [1]", ylabel="Im L [1]", aspect="equal")
    label_levels(right, *((level, text) for level, text, _ in levels))
    slow = min(w for curve in curves for w, s in zip(curve["omega"], curve["sensitivity"], strict=True) if s > _SEEN)
    right.set(xlabel="frequency [rad/s]", ylabel="|S| [1]", xlim=(slow, None), ylim=(0, top))
    return figure


def _circle(ax: Axes, ms: float, text: str, look: str, *, inner: bool) -> None:
    """Draw the circle that a loop with this Ms touches, its name above it or, of an inner one, inside."""
    from matplotlib.patches import Circle

    ax.add_patch(Circle((-1.0, 0.0), 1.0 / ms, fill=False, **LOOK[look]))
    ax.annotate(f"Ms, {text}", (-1.0, 0.0 if inner else 1.0 / ms), xytext=(0, -6 if inner else 3), ha="center",
                textcoords="offset points", va="top" if inner else "bottom", fontsize=8)


def _named_height(phases: Sequence[Part]) -> float:
    """Return the height of the names of a run's phases below its picture [inch]."""
    return _NAMES_IN if len(phases) >= _MANY_PARTS else 0.0


def _parts(phases: Sequence[Part], top: Axes, low: Axes) -> None:
    """Mark where the parts of a run begin, and draw long times at rest short; each part has its name and instant."""
    if len(phases) < _MANY_PARTS:
        return
    ends = np.array([0.0, *(instant for part in phases for instant in (part["rest_s"], part["end_s"]))])
    lengths = np.diff(ends) * np.tile([1.0, _RESTS_DRAWN], len(phases))
    drawn = np.concatenate([[0.0], np.cumsum(lengths)]) + 1e-9 * np.arange(len(ends))  # no two of them the same
    instants = ends + 1e-9 * np.arange(len(ends))
    for ax in (top, low):
        ax.set_xscale("function", functions=(
            lambda time: np.interp(time, instants, drawn), lambda place: np.interp(place, drawn, instants)))
        ax.set_xlim(instants[0], instants[-1])
    places = np.interp([*(part["begin_s"] for part in phases), instants[-1]], instants, drawn)
    parts = [part for part, wide in zip(phases, np.diff(places), strict=True) if wide > _NAMED * places[-1]]
    low.set_xticks([part["begin_s"] for part in parts], [f"{part['label']}, {part['begin_s']:.0f} s" for part in parts],
                   rotation=40, ha="right", fontsize=7, rotation_mode="anchor")


def _temperature(ax: Axes, run: Part, name: str, look: str) -> None:
    ax.plot(run["time_s"], run["temperature_degC"], label=name, **LOOK[look])
    ax.set_ylabel("temperature [°C]")


def _setpoint(ax: Axes, run: Part) -> None:
    if run.get("followed_degC") is not None:
        ax.step(run["request_time_s"], run["followed_degC"], where="post", label="setpoint on its ramp",
                **LOOK["limit"])
    ax.axhline(run["setpoint_degC"], label="setpoint", **LOOK["limit"])
    label_levels(ax, (run["setpoint_degC"], "setpoint"))
