"""One design on every controller: table and picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from heatertune.codec import Document
from heatertune.report.html import page, picture, text_of
from heatertune.report.html import table as html_table
from heatertune.report.layout import cut, table, wrap_text
from heatertune.report.plots import LOOK, new_figure
from heatertune.report.report_text import figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_targets", "render_targets", "targets_brief", "targets_table"]


_HEADS = (
    "target", "verdict", "IAE °C·s", "words", "arithmetic", "overshoot %", "offset °C", "settling s", "recovery s",
)
_NUMERIC = range(2, len(_HEADS))
#: times the ideal controller's integral of the error, from which on it is no percentage
_DEAR = 3.0


def targets_table(document: Document) -> str:
    """Return one line per controller, and below why one could not hold the design or failed."""
    lines = [_where(document), table([_HEADS, *_rows(document)], right=_NUMERIC), _legend(document)]
    return "\n".join(lines + [f"- {line}" for line in _reasons(document)])


def targets_brief(document: Document) -> str:
    """Return one line per controller on one screen: its performance, and its cost compared with the ideal."""
    rows: list[tuple[str, ...]] = [("", "", "settles", "overshoot", "offset", "costs", "")]
    rows += [_brief(row) for row in document["rows"]]
    legend = "costs: how much larger the integral of the error is than that of the ideal controller on this heater"
    own = ", ".join(f"{row['target']} {row['sample_time_s']:g} s" for row in document["rows"] if "sample_time_s" in row)
    return "\n".join([
        _where(document), *map(cut, table(rows, right=(2, 3, 4, 5)).splitlines()), *wrap_text(legend),
        *(wrap_text(f"TA as the controller has it, not as designed: {own}") if own else [])])


def _brief(row: Document) -> tuple[str, ...]:
    if "realised" not in row:
        return (row["target"], "", "", "", "", "", row["verdict"])
    real, fails = row["realised"], [name.replace("_", " ") for name in row["fails"]]
    settles = "never" if real["settling_time"] is None else f"{real['settling_time']:.0f} s"
    times = real["iae"] / row["wished"]["iae"]
    broken = f"{fails[0]}{f' +{len(fails) - 1}' if len(fails) > 1 else ''}" if fails else ""
    return (row["target"], row["verdict"], settles, f"{figure(real['overshoot'], 3)} %",
            f"{figure(real['steady_offset'], 2)} °C", f"{100.0 * (times - 1.0):+.1f} %" if times < _DEAR else
            f"{times:.0f} times", broken)


def render_targets(document: Document) -> str:
    """Return the page: table, reasons, picture."""
    reasons = "".join(f"<li>{text_of(line)}</li>" for line in _reasons(document))
    body = (
        f"<p>{text_of(_where(document))}. {text_of(_legend(document))}</p>"
        f"{html_table(_HEADS, _rows(document), numeric=_NUMERIC)}<ul>{reasons}</ul>"
    )
    if proven := _proven(document):
        body += picture(
            plot_targets(proven),
            "Left: temperature on each controller, and of the unrounded design with the same switch (dashed). "
            "Right: their difference, each on its own scale.", moves=False)
    return page("One design on every controller", body)


def plot_targets(rows: Sequence[Document]) -> Figure:
    """Draw each target's temperature with that of the unrounded design, and their difference on a separate scale."""
    drawn, axes = new_figure(len(rows), 1.15 * len(rows) + 0.4, 2, sharex=True)
    for row, left, right in zip(rows, axes[::2], axes[1::2], strict=True):
        series, wish = row["series"], row["ideal"]
        left.axhline(series["setpoint_degC"], **LOOK["limit"])
        left.plot(series["time_s"], series["temperature_degC"], **LOOK["realised"])
        left.plot(wish["time_s"], wish["temperature_degC"], **LOOK["ideal"])
        left.set_title(row["target"], loc="left", fontsize=9, pad=2)
        left.set_ylabel("°C")
        wished = np.interp(series["time_s"], wish["time_s"], wish["temperature_degC"])
        right.plot(series["time_s"], np.subtract(series["temperature_degC"], wished), **LOOK["realised"])
        right.set_ylabel("Δ °C")
    for ax in axes[-2:]:
        ax.set_xlabel("time [s]")
    return drawn


def _proven(document: Document) -> list[Document]:
    return [row for row in document["rows"] if "realised" in row]


def _rows(document: Document) -> list[tuple[str, ...]]:
    return [_row(row) for row in document["rows"]]


def _row(row: Document) -> tuple[str, ...]:
    if "realised" not in row:
        return (row["target"], row["verdict"], *[""] * len(_NUMERIC))
    real, rounded, wished = row["realised"], row["rounded"], row["wished"]
    words, arithmetic = "", _more(real["iae"], wished["iae"])
    if rounded is not None:
        words, arithmetic = _more(rounded["iae"], wished["iae"]), _more(real["iae"], rounded["iae"])
    numbers = [figure(real["iae"]), words, arithmetic, figure(real["overshoot"], 3), figure(real["steady_offset"], 2)]
    times = ["never" if real[name] is None else figure(real[name], 3) for name in ("settling_time", "recovery_time")]
    return (row["target"], row["verdict"], *numbers, *times)


def _more(value: float, than: float) -> str:
    return f"{100.0 * (value / than - 1.0):+.2f} %"


def _where(document: Document) -> str:
    return f"One design on every controller, at {document['setpoint_degC']:g} °C"


def _legend(document: Document) -> str:
    return (
        f"On {document['model']}. words: what rounding to words adds to the IAE of the unrounded design; arithmetic: "
        "what the controller's own arithmetic, order and limits add to that. The verdict is that of all models and "
        "open points."
    )


def _reasons(document: Document) -> list[str]:
    reasons = []
    for row in document["rows"]:
        if "sample_time_s" in row:
            reasons.append(f"{row['target']} has a TA of {row['sample_time_s']:g} s alone: the design is taken at it")
        if "why" in row:
            reasons.append(f"{row['target']}: {row['why']}")
        elif row["fails"]:
            by = ", ".join(name.replace("_", " ") for name in row["fails"])
            reasons.append(f"{row['target']} is {row['verdict']} by {by}")
    return reasons
