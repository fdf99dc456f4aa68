"""HTML elements in one style (page, table, list, picture, interactive figure); nothing is loaded from the network.

uPlot draws the interactive figures, with values under the cursor and zoom (Leon Sorokin, MIT; unmodified, in `uplot/`
with its licence; 51 kB). Without JavaScript, and on paper, the page shows the figure as SVG.
"""

from __future__ import annotations

import hashlib
import html
import json
import re
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from heatertune.report.plots import to_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

__all__ = [
    "BLANK", "Markup", "bullets", "live_program", "live_style", "page", "panels", "panels_json", "picture", "steps",
    "table", "text_of", "tick", "with_code",
]


@cache
def live_program() -> str:
    """Return the scripts of the page: uPlot, its connection to the figures, and the storage of ticked boxes."""
    folder = files("heatertune.report")
    library, licence = (folder.joinpath("uplot", name).read_text(encoding="utf-8").strip()
                        for name in ("uPlot.iife.min.js", "LICENSE"))
    return f"/*! uPlot: {licence} */\n{library}\n{folder.joinpath('live.js').read_text(encoding='utf-8')}"


@cache
def live_style() -> str:
    """Return uPlot's style sheet."""
    return files("heatertune.report").joinpath("uplot", "uPlot.min.css").read_text(encoding="utf-8").strip()


def panels_json(figure: Figure) -> str:
    """Return the figure's panels as JSON for a script element; "[]" if none can be interactive."""
    # "<!--<script" would keep the parser from seeing the end of the element, "</script" would be one
    return json.dumps(panels(figure), ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def panels(figure: Figure) -> list[dict[str, Any]]:
    """Return one panel per pair of axes, except axes on which x is not monotonic.

    A panel has its relative height, the labels of its axes with units, and its lines: label, x, y, style.
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
        "label": "" if label.startswith("_child") else label, "color": line.get_color(), "width": line.get_linewidth(),
        "dash": [float(n) for n in getattr(line, "_unscaled_dash_pattern", (0, None))[1] or ()],
        "step": line.get_drawstyle() == "steps-post", "x": [round(float(v), 4) for v in x],
        "y": [None if not np.isfinite(v) else round(float(v), 4) for v in y],
    }


def _xy(line: Line2D) -> tuple[Any, Any]:
    return np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)


_CODE: Final = re.compile(r"`([^`]+)`")

_FOOT: Final = "font: 7.5pt system-ui, sans-serif; color: #595959"
_NUMBER: Final = f'@bottom-right {{ content: "page\u00a0" counter(page) "\u00a0of\u00a0" counter(pages); {_FOOT} }}'

class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


#: to be filled in manually
BLANK: Final = Markup('<span class="blank"></span>')


def page(title: str, body: str, *, mark: str = "", foot: str = "") -> str:
    """Return a complete page with its style and, for pictures, the script that makes them interactive.

    Args:
        title: heading.
        body: HTML.
        mark: key under which the browser stores the ticked boxes of this page.
        foot: text at the foot of each printed page, next to the page number.
    """
    moves = "data-live" in body
    own = files("heatertune.report").joinpath("page.css").read_text(encoding="utf-8")
    style = f"{live_style()}\n{own}" if moves else own
    style += f'@page {{ @bottom-left {{ content: "{_in_style(foot)}"; {_FOOT} }} {_NUMBER} }}\n' if foot else ""
    program = f"<script>{live_program()}</script>" if moves else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en" data-words="{text_of(mark)}"><head><meta charset="utf-8">'
        f"<title>heatertune: {text_of(title)}</title>"
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{style}</style></head>\n'
        f"<body><main>\n<h1>{text_of(title)}</h1>\n{body}\n</main>{program}</body></html>\n"
    )


def _in_style(text: str) -> str:
    """Escape text for a quoted string of a style sheet: everything except letters and digits as code points."""
    return "".join(each if each.isascii() and each.isalnum() else f"\\{ord(each):x} " for each in text)


def picture(drawn: Any, caption: str, *, moves: bool = True) -> str:
    """Return a figure as inline SVG with its caption and, where it may and can be moved, its lines as data."""
    moved = panels_json(drawn) if moves else "[]"
    if moved == "[]":
        return f"<figure>{to_svg(drawn)}<figcaption>{text_of(caption)}</figcaption></figure>"
    name = hashlib.sha256(moved.encode(errors="backslashreplace")).hexdigest()[:8]
    return (
        f'<figure id="f{name}" data-live>{to_svg(drawn)}<script type="application/json">{moved}</script>'
        f'<figcaption>{text_of(caption)} <span class="hint">Drag to zoom, double-click for all.</span></figcaption>'
        "</figure>"
    )


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], *, numeric: Sequence[int] = (), source: str = "") -> str:
    """Return a table; the columns in `numeric` are right-aligned, the source is below."""
    caption = f"<caption>Source: {text_of(source)}</caption>" if source else ""
    kinds = [' class="n"' if i in numeric else "" for i in range(len(heads))]
    head = "".join(f'<th scope="col"{kind}>{text_of(cell)}</th>' if cell else "<td></td>"
                   for kind, cell in zip(kinds, heads, strict=True))
    body = "".join("<tr>" + "".join(_cell(cell, i in numeric) for i, cell in enumerate(row)) + "</tr>" for row in rows)
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def tick(name: str, label: str) -> Markup:
    """Return a box to tick on screen and on paper; `label` is for screen readers."""
    return Markup(f'<input type="checkbox" id="{text_of(name)}" aria-label="{text_of(label)}">')


def steps(name: str, items: Sequence[str]) -> str:
    """Return numbered steps, each with a box to tick."""
    boxes = "".join(
        f'<li><label><input type="checkbox" id="{text_of(name)}-{i}">{i}. {with_code(item)}</label></li>'
        for i, item in enumerate(items, 1)
    )
    return f'<ol class="steps">{boxes}</ol>'


def with_code(text: str) -> Markup:
    """Return text with `this` set as code."""
    return Markup(_CODE.sub(r"<code>\1</code>", text_of(text)))


def _cell(cell: str, numeric: bool) -> str:
    kinds = (("n", numeric), ("pass", cell in ("ok", "PASS")), ("fail", cell in ("FAIL", "NOT PROVEN")))
    marks = [name for name, applies in kinds if applies]
    kind = f' class="{" ".join(marks)}"' if marks else ""
    return f"<td{kind}>{text_of(cell)}</td>"


def bullets(items: Sequence[str]) -> str:
    """Return a list with `this` set as code; an empty text without items."""
    return "<ul>" + "".join(f"<li>{with_code(item)}</li>" for item in items) + "</ul>" if items else ""


def text_of(content: str) -> str:
    """Escape text for HTML; existing HTML stays unchanged."""
    return content if isinstance(content, Markup) else html.escape(str(content))
