"""A figure as the browser moves it: the same lines as in print, with values under the cursor and zoom.

The drawing is done by uPlot (Leon Sorokin, MIT; unmodified, in `uplot/` with its licence): 51 kB that need no network.
Where no program runs, and on paper, the page shows the figure's SVG.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

__all__ = ["panels", "panels_json", "program", "style"]


@cache
def program() -> str:
    """Return the statements of the page: uPlot, then what ties it to the figures and keeps the ticks."""
    folder = files("heatertune.report")
    library, licence = (folder.joinpath("uplot", name).read_text(encoding="utf-8").strip()
                        for name in ("uPlot.iife.min.js", "LICENSE"))
    return f"/*! uPlot: {licence} */\n{library}\n{folder.joinpath('live.js').read_text(encoding='utf-8')}"


@cache
def style() -> str:
    """Return uPlot's style sheet."""
    return files("heatertune.report").joinpath("uplot", "uPlot.min.css").read_text(encoding="utf-8").strip()


def panels_json(figure: Figure) -> str:
    """Return the figure's panels as JSON that may stand in a script element; "[]" where none can be moved."""
    # "<!--<script" would keep the parser from seeing the end of the element, "</script" would be one
    return json.dumps(panels(figure), ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def panels(figure: Figure) -> list[dict[str, Any]]:
    """Return one panel per pair of axes; none where x runs back and forth.

    A panel has its height as a share, the labels of its axes with their units, and its lines: label, x, y, look.
    """
    if any(np.any(np.diff(_xy(line)[0]) < 0.0) for ax in figure.axes for line in ax.lines):
        return []  # a Nyquist curve: no function of x
    return [
        {"x": ax.get_xlabel() or "time [s]", "y": ax.get_ylabel(), "height": round(float(ax.get_position().height), 3),
         "log": ax.get_xscale() == "log", "lines": [_line(line, ax) for line in ax.lines]}
        for ax in figure.axes
    ]


def _line(line: Line2D, ax: Axes) -> dict[str, Any]:
    x, y = _xy(line)
    if line.get_transform() != ax.transData:  # a level line spans the axes in their own units
        x = np.asarray(ax.get_xlim(), dtype=float)
        shown = [xs for xs in (_xy(other)[0] for other in ax.lines) if len(xs) > 2]
        if shown:
            x = np.array([min(float(xs.min()) for xs in shown), max(float(xs.max()) for xs in shown)])
    label = str(line.get_label())
    return {
        "label": "" if label.startswith("_child") else label,
        "color": line.get_color(), "width": line.get_linewidth(),
        "dash": [float(n) for n in getattr(line, "_unscaled_dash_pattern", (0, None))[1] or ()],
        "step": line.get_drawstyle() == "steps-post",
        "x": [round(float(v), 4) for v in x], "y": [None if not np.isfinite(v) else round(float(v), 4) for v in y],
    }


def _xy(line: Line2D) -> tuple[Any, Any]:
    return np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
