"""The pictures. Each takes one part of the pictures document and returns the figure; nothing is computed here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from heatertune.report.style import LOOK, label_end, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_fit", "plot_loop", "plot_paper", "plot_pareto", "plot_pwm", "plot_robustness", "plot_wish"]

Part = Mapping[str, Any]


def plot_fit(log: Part, residuals: Part) -> Figure:
    """Draw the log, the fitted model and the residuals under it."""
    figure, (top, middle) = new_figure(2, 5.2, sharex=True, height_ratios=(3, 1))
    top.plot(log["time_s"], log["temperature_degC"], label="_log", **LOOK["log"])
    label_end(top, log["time_s"], log["temperature_degC"], "log", "log")
    top.plot(residuals["time_s"], residuals["simulated_degC"], label="_model", **LOOK["model"])
    label_end(top, residuals["time_s"], residuals["simulated_degC"], "model", "model")
    top.set_ylabel("temperature [°C]")
    if log["power_pct"] is not None:
        power = top.twinx()
        power.step(log["time_s"], log["power_pct"], where="post", label="_power", **LOOK["other"])
        power.set_ylabel("power [%]", color=LOOK["other"]["color"])
        power.set_ylim(-2, 300)
    error = np.subtract(residuals["measured_degC"], residuals["simulated_degC"])
    middle.plot(residuals["time_s"], error, label="_residual", **LOOK["model"])
    middle.axhline(0.0, label="_zero", **LOOK["limit"])
    middle.set_ylabel("residual [°C]")
    middle.set_xlabel("time [s]")
    return figure


def plot_loop(nominal: Part, worst: Part, others: Sequence[Part]) -> Figure:
    """Draw the proven loop: temperature on all models, power asked for on the nominal and the worst."""
    figure, (top, low) = new_figure(2, 5.6, sharex=True, height_ratios=(2, 1))
    for run in others:
        top.plot(run["time_s"], run["temperature_degC"], label=f"_{run['label']}", **LOOK["other"])
    _temperature(top, worst, "worst", "worst")
    _temperature(top, nominal, "nominal", "realised")
    _setpoint(top, nominal)
    for run, name, look in ((worst, "_worst", "worst"), (nominal, "_nominal", "realised")):
        low.step(run["asked_time_s"], run["asked_pct"], where="post", label=name, **LOOK[look])
    low.set_ylabel("power asked for [%]")
    low.set_ylim(-4, 104)
    low.set_xlabel("time [s]")
    return figure


def plot_pwm(nominal: Part, start_s: float, end_s: float) -> Figure:
    """Draw the heater's switching within a short stretch."""
    figure, (ax,) = new_figure(1, 1.7)
    edges, power = np.asarray(nominal["edge_s"]), np.asarray(nominal["edge_pct"])
    before = power[np.searchsorted(edges, start_s) - 1] if len(edges) and edges[0] < start_s else 0.0
    inside = (edges >= start_s) & (edges <= end_s)
    time = np.concatenate([[start_s], edges[inside], [end_s]])
    level = np.concatenate([[before], power[inside]])
    ax.step(time, np.append(level, level[-1]), where="post", label="_heater", **LOOK["realised"])
    ax.set_ylabel("heater [%]")
    ax.set_xlabel("time [s]")
    ax.set_ylim(-8, 108)
    return figure


def plot_wish(nominal: Part, wish: Part) -> Figure:
    """Draw what the design meant against what the words do."""
    figure, (top, low) = new_figure(2, 5.0, sharex=True, height_ratios=(2, 1))
    _temperature(top, nominal, "realised", "realised")
    _temperature(top, wish, "wished", "wish")  # dashed, on top: where they agree both can be seen
    _setpoint(top, nominal)
    instants = np.asarray(nominal["time_s"])
    wished = np.interp(instants, wish["time_s"], wish["temperature_degC"])
    low.plot(instants, np.asarray(nominal["temperature_degC"]) - wished, label="_realised − wished", **LOOK["realised"])
    low.set_ylabel("realised − wished [°C]")
    low.set_xlabel("time [s]")
    return figure


def plot_paper(runs: Sequence[Part]) -> Figure:
    """Draw the temperature of the paper's own runs."""
    figure, (ax,) = new_figure(1, 3.0)
    for run, look in zip(runs, ("log", "worst", "realised"), strict=False):
        series = run["series"]
        ax.plot(series["time_s"], series["temperature_degC"], label=run["label"], **LOOK[look])
    _setpoint(ax, runs[0]["series"])
    ax.set(xlabel="time [s]", ylabel="temperature [°C]")
    ax.legend(frameon=False, fontsize=8, loc="lower right")
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


def plot_robustness(curves: Sequence[Part], limit: float) -> Figure:
    """Draw the Nyquist curves of all models with the Ms circle, and the sensitivities."""
    from matplotlib.figure import Figure  # noqa: PLC0415
    from matplotlib.patches import Circle  # noqa: PLC0415

    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for i, curve in enumerate(curves):
        look = LOOK["worst"] if curve["worst"] else LOOK["realised"] if i == 0 else LOOK["other"]
        left.plot(curve["real"], curve["imaginary"], **look)
        right.semilogx(curve["omega"], curve["sensitivity"], **look)
    left.add_patch(Circle((-1.0, 0.0), 1.0 / limit, fill=False, **LOOK["limit"]))
    left.plot([-1.0], [0.0], "k+")
    left.annotate(f"Ms = {limit:g}", (-1.0, 1.0 / limit), ha="center", va="bottom", fontsize=8)
    left.set(xlim=(-2.2, 0.6), ylim=(-1.9, 0.9), xlabel="Re L [1]", ylabel="Im L [1]", aspect="equal")
    right.axhline(limit, **LOOK["limit"])
    right.annotate(f"limit {limit:g}", (right.get_xlim()[0], limit), va="bottom", fontsize=8)
    right.set(xlabel="frequency [rad/s]", ylabel="|S| [1]", ylim=(0, max(2.2, 1.2 * limit)))
    for ax in (left, right):
        ax.grid(color="#dddddd", linewidth=0.5)
        ax.spines[["top", "right"]].set_visible(False)
    return figure


def _temperature(ax: Axes, run: Part, name: str, look: str) -> None:
    ax.plot(run["time_s"], run["temperature_degC"], label=name, **LOOK[look])
    ax.legend(frameon=False, fontsize=8, loc="lower right")
    ax.set_ylabel("temperature [°C]")


def _setpoint(ax: Axes, run: Part) -> None:
    if run.get("followed_degC") is not None:
        ax.step(run["asked_time_s"], run["followed_degC"], where="post", label="_setpoint on its ramp", **LOOK["limit"])
    ax.axhline(run["setpoint_degC"], label="_setpoint", **LOOK["limit"])
    ax.annotate("setpoint", (0.0, run["setpoint_degC"]), va="bottom", fontsize=8, color=LOOK["limit"]["color"])
