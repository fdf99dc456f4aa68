"""Cards that a notebook shows of a value of the chain: a small table and a picture, also as a figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import singledispatch
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.codec import plain
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model import model_document
from heatertune.model.model_values import FittedModel
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.inputs import describe_range
from heatertune.plc.keyed_entry import typed_table, typed_words
from heatertune.proof import Proof, Trace
from heatertune.proof.proof_document import ProofView
from heatertune.report.html import bullets, table, text_of
from heatertune.report.plots import LOOK, key, label_levels, new_figure, power_limits, to_svg
from heatertune.report.report_text import criterion_value, figure, model_rows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Panel", "card", "draw_figure", "panels", "reaction", "thinned"]


_POINTS: Final = 600  # the width of a card
_CONTINUOUS: Final = 200  # points without a sampling interval


class Panel(NamedTuple):
    """A part of a picture: its height, and the function that draws it."""

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
    """Reduce each column to every n-th value, no more than can be seen; the last is kept."""
    n = len(columns[0])
    rows = np.unique(np.linspace(0, n - 1, min(n, _POINTS)).astype(int))
    return [np.asarray(column)[rows] for column in columns]


def reaction(design: PidDesign) -> tuple[Array, Array]:
    """Return instants [s] and the change of power [%] after the error has stepped by 1 °C, without limits.

    The sampled law of `PidDesign`: K·(1 + (n + 1)·TA/TN + D_n), D_n = f·D_{n−1} + (1 − f)·TV/TA·(e_n − e_{n−1}).
    It runs for two TN, after which the I part is twice the P part, or for 20 samples without one. A continuous design
    is drawn in 200 steps, without its filter. Both are of shape (n,).
    """
    tn = design.integral_time_s
    ta = design.sample_time_s or (tn if math.isfinite(tn) else 1.0) / (_CONTINUOUS / 2)
    n = np.arange(max(20, math.ceil(2.0 * tn / ta)) if math.isfinite(tn) else 20)
    integral = (n + 1.0) * ta / tn
    decay = design.derivative_filter
    derivative = (1.0 - decay) * design.derivative_time_s / ta * np.power(decay, n)
    return np.asarray(n * ta, dtype=np.float64), design.gain_pct_per_degC * (1.0 + integral + derivative)


@panels.register
def _log_pictures(value: Log) -> Sequence[Panel]:
    def temperature(ax: Axes) -> None:
        ax.plot(*thinned(value.time_s, value.temperature_degC), **LOOK["log"])
        ax.set(xlabel="time [s]", ylabel="temperature [°C]")

    if (power := value.signals.get("power")) is None:
        return [Panel(2.4, temperature)]
    return [Panel(2.55, temperature), _power(0.85, [(*power.until(float(value.time_s[-1])), "log")])]


@panels.register
def _model_pictures(value: FittedModel) -> Sequence[Panel]:
    left = value.residuals
    if left is None:
        raise InputError("a model given by hand has no log to draw; design.plot() and proof.plot() draw what comes of "
                         "it")

    def paint(ax: Axes) -> None:
        time, measured, simulated = thinned(left.time_s, left.measured_degC, left.simulated_degC)
        for line, name in ((measured, "log"), (simulated, "model")):
            ax.plot(time, line, **LOOK[name])
        key(ax, ("log", "log"), ("model", "model"))
        ax.set(xlabel="time [s]", ylabel="temperature [°C]")

    return [Panel(2.6, paint)]


@panels.register
def _design_pictures(value: PidDesign) -> Sequence[Panel]:
    def paint(ax: Axes) -> None:
        ax.step(*thinned(*reaction(value)), where="post", **LOOK["realised"])
        ax.set(xlabel="time since the error stepped by 1 °C [s]", ylabel="change of power [%]")
        ax.set_ylim(bottom=min(0.0, value.gain_pct_per_degC))

    return [Panel(2.0, paint)]


@panels.register
def _words_pictures(value: Words) -> Sequence[Panel]:
    design = controller_for(value.target).decode(value)
    if design is None:
        raise ValueError(f"the words of {value.target} are no PID constants")
    return panels(design)


@panels.register
def _saved_proof_pictures(_value: ProofView) -> Sequence[Panel]:
    raise InputError("a proof that was saved has no traces to draw; heatertune.prove(words, model).plot() draws them")


@panels.register
def _proof_pictures(value: Proof) -> Sequence[Panel]:
    return _loop([("worst", value.worst, "worst"), ("nominal", value.nominal, "realised")])


@panels.register
def _trace_pictures(value: Trace) -> Sequence[Panel]:
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


# a notebook has its own paper, white or dark: a card brings its own
_STYLE: Final = """\
.heatertune { background: #fff; color: #1a1a1a; font: 14px/1.4 system-ui, sans-serif; max-width: 46rem;
  padding: .6rem .8rem; border: 1px solid #d5d5d5; overflow-x: auto; }
.heatertune th, .heatertune td { padding: .1rem .7rem .1rem 0; text-align: left; }
.heatertune td.n, .heatertune th.n { text-align: right; font-variant-numeric: tabular-nums; }
.heatertune td.fail { color: #a33c00; font-weight: 700; }"""


@singledispatch
def card(value: object) -> str:
    """Return a value of the chain as HTML; raise TypeError for any other."""
    raise TypeError(f"no card for a {type(value).__name__}")


def _card(title: str, *parts: str) -> str:
    return (f'<div class="heatertune"><style>{_STYLE}</style><strong>{text_of(title)}</strong>'
            f'{"".join(parts)}</div>')


def _picture(value: object) -> str:
    # it contains only numbers and text: the page chooses only the width
    return to_svg(draw_figure(value)[0]).replace("<svg ", '<svg style="max-width:100%;height:auto" ', 1)


@card.register
def _log(value: Log) -> str:
    rows = [("readings", str(len(value.time_s)), ""), ("duration", figure(float(np.ptp(value.time_s))), "s"),
            _span("temperature", value.temperature_degC, "°C"), _span("heater power", value.power_pct, "%"),
            _span("setpoint", value.setpoint_degC, "°C")]
    summary = [] if value.taken is None else [value.taken.line]
    remarks = [*summary, *value.repairs, *value.warnings]
    count = f"<summary>{len(remarks)} notes of the reader</summary>"
    notes = f"<details>{count}{bullets(remarks)}</details>" if remarks else ""
    return _card(f"log {value.name}", table(["", "", "unit"], rows, numeric=(1,)), _picture(value), notes)


def _span(name: str, column: Any, unit: str) -> tuple[str, str, str]:
    if column is None:
        return name, "not logged", ""
    return name, f"{figure(float(np.min(column)))} … {figure(float(np.max(column)))}", unit


@card.register
def _model(value: FittedModel) -> str:
    rows = model_rows(model_document.to_document(value))
    remark = text_of(value.outcome_text)
    if len(value.candidates) > 1:
        remark += f" {len(value.candidates)} candidate models; design and proof run on all of them."
    if value.fit_pct is not None:
        remark += f" Fit {figure(value.fit_pct)} %."
    parts = [table(["", "value", "95 % interval", "unit"], rows, numeric=(1,)), f"<p>{remark}</p>"]
    if value.residuals is not None:
        parts.append(_picture(value))
    return _card("heater", *parts)


@card.register
def _design(value: PidDesign) -> str:
    margins = value.margins
    rows = [*_constants(value)]
    if margins is not None:
        rows += [("Ms", figure(margins.ms), ""), ("Mt", figure(margins.mt), ""),
                 ("gain margin", figure(margins.gain_margin), ""),
                 ("phase margin", figure(margins.phase_margin_deg), "°")]
    title = f"{value.structure.upper()} controller, {value.method}"
    return _card(title, table(["", "value", "unit"], rows, numeric=(1,)), _picture(value), bullets(value.notes))


def _constants(design: PidDesign) -> list[tuple[str, str, str]]:
    tn = design.integral_time_s
    return [
        ("K", figure(design.gain_pct_per_degC), "%/°C"), ("TN", figure(tn) if math.isfinite(tn) else "none", "s"),
        ("TV", figure(design.derivative_time_s), "s"), ("TA", figure(design.sample_time_s), "s"),
    ]


@card.register
def _words(value: Words) -> str:
    controller = controller_for(value.target)
    heads, values, rows = typed_table(typed_words(value))
    scale = f"<p>Called every {figure(value.sample_time_s)} s; sensor {describe_range(value.scaling)}.</p>"
    parts = [table(heads, rows, numeric=values), scale]
    real = controller.decode(value)
    if real is not None:
        parts += ["<p>What the controller makes of them:</p>",
                  table(["", "value", "unit"], _constants(real), numeric=(1,)), _picture(real)]
    return _card(f"words for {controller.title}", *parts)


@card.register
def _proof(value: Proof | ProofView) -> str:
    rows = []
    document = plain(value.to_dict())
    for name, criterion in document["criteria"].items():
        bound = "≥" if criterion["bound"] == ">=" else "≤"
        limit = "" if criterion["limit"] is None else f"{bound} {figure(criterion['limit'])}"
        mark = "" if criterion["limit"] is None else "ok" if criterion["ok"] else "FAIL"
        rows.append([name.replace("_", " "), criterion_value(criterion), limit, criterion["unit"], mark])
    models = len({run.model for run in value.runs})
    counted = f"<p>{len(value.runs)} runs on {models} heater models; each criterion is the worst of all runs.</p>"
    return _card(
        f"proof of {document['target']}: {value.verdict}", counted,
        table(["criterion", "worst", "limit", "unit", ""], rows, numeric=(1,)),
        _picture(value) if isinstance(value, Proof) else "", bullets(value.faults),
    )


@card.register
def _trace(value: Trace) -> str:
    temperature = value.temperature_degC
    rows = [
        ("setpoint", figure(value.setpoint_degC), "°C"), ("duration", figure(float(value.time_s[-1])), "s"),
        _span("temperature", temperature, "°C"), _span("requested power", value.power_asked_pct, "%"),
        ("scans", str(len(value.time_s)), ""), ("switchings of the heater", str(len(value.edge_time_s)), ""),
    ]
    who = "ideal controller" if value.words is None else value.words.target
    return _card(f"closed loop of {who}", table(["", "", "unit"], rows, numeric=(1,)), _picture(value))
