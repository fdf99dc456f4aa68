"""HTML in one look: page, table, list, picture. Nothing is fetched from anywhere."""

from __future__ import annotations

import hashlib
import html
import re
from collections.abc import Sequence
from typing import Any, Final

from heatertune.report import live
from heatertune.report.style import to_svg

__all__ = ["Markup", "bullets", "coded", "page", "picture", "steps", "table", "text_of", "tick"]

_CODE: Final = re.compile(r"`([^`]+)`")

_STYLE = """
:root { --ink: #1a1a1a; --soft: #595959; --line: #d5d5d5; --pass: #00634a; --fail: #a33c00; }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: #fff; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
p, li { max-width: 46rem; } .soft { color: var(--soft); }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums;
        max-width: 100%; min-width: 24rem; }
caption { caption-side: bottom; text-align: left; color: var(--soft); font-size: .85em; padding-top: .2rem; }
th, td { border-bottom: 1px solid var(--line); padding: .25rem .7rem; text-align: left; vertical-align: top; }
td.n, th.n { text-align: right; } td.n { white-space: nowrap; } .pass { color: var(--pass); font-weight: 600; }
.fail, .not-proven { color: var(--fail); font-weight: 700; }
.verdict { font-size: 1.3rem; border: 2px solid currentColor; padding: .3rem .8rem; display: inline-block; }
figure { margin: 1rem 0; } figure svg { max-width: 100%; height: auto; } figcaption { color: var(--soft); }
figure.moves > svg { display: none; } code { font-family: ui-monospace, monospace; }
.u-legend { font-size: .85em; text-align: left; min-width: 0; } .hint { font-size: .85em; }
.u-legend th, .u-legend td { border: 0; padding: 0 .3rem 0 0; } .u-inline.u-live th { font-weight: 400; }
ol.steps { padding-left: 0; } ol.steps li { list-style: none; } label { display: block; padding-left: 1.6rem; }
label input { margin-left: -1.6rem; } input[type=checkbox] { width: 1rem; height: 1rem; margin-right: .6rem; }
.sign td { min-width: 13rem; height: 1.9rem; }
@media screen and (max-width: 60rem) { table:not(.u-legend) { display: block; overflow-x: auto; min-width: 0; } }
@page { size: A4; margin: 13mm 12mm; }
@media print {
  body { margin: 0; padding: 0; max-width: none; font-size: 8.6pt; line-height: 1.32; }
  h1 { font-size: 14pt; } h2 { font-size: 11pt; margin: .8rem 0 .2rem; } h3 { margin: .5rem 0 .1rem; }
  h2, h3, summary { break-after: avoid; } figure, tr, li { break-inside: avoid; }
  p, li { max-width: none; margin: .15rem 0; } ul, ol { margin: .2rem 0; } th, td { padding: .08rem .4rem; }
  table { margin: .25rem 0; } figure { margin: .3rem 0; } .live, .hint { display: none; }
  figure > svg, figure.moves > svg { display: block; max-height: 72mm; margin: 0 auto; }
  input[type=checkbox] { width: .7rem; height: .7rem; margin-right: .4rem; } label { padding-left: 1.1rem; }
  label input { margin-left: -1.1rem; } .sign td { height: 1.5rem; }
  details::details-content { content-visibility: visible; display: block; }
}
"""


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def page(title: str, body: str, *, mark: str = "") -> str:
    """Return a whole page with its style; with pictures, also the program that moves them.

    Args:
        title: heading.
        body: HTML.
        mark: what the browser keeps the ticks of this page under.
    """
    moves = "data-live" in body
    style = f"{live.style()}\n{_STYLE}" if moves else _STYLE
    program = f"<script>{live.program()}</script>" if moves else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en" data-words="{text_of(mark)}"><head><meta charset="utf-8">'
        f"<title>heatertune: {text_of(title)}</title>"
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{style}</style></head>\n'
        f"<body><main>\n<h1>{text_of(title)}</h1>\n{body}\n</main>{program}</body></html>\n"
    )


def picture(drawn: Any, caption: str, *, moves: bool = True) -> str:
    """Return a figure as inline SVG with its caption and, where it may and can be moved, its lines as data."""
    moved = live.panels_json(drawn) if moves else "[]"
    if moved == "[]":
        return f"<figure>{to_svg(drawn)}<figcaption>{text_of(caption)}</figcaption></figure>"
    name = hashlib.sha256(moved.encode()).hexdigest()[:8]
    return (
        f'<figure id="f{name}" data-live>{to_svg(drawn)}<script type="application/json">{moved}</script>'
        f'<figcaption>{text_of(caption)} <span class="hint">Drag to zoom, double-click for all.</span></figcaption>'
        "</figure>"
    )


def table(
    heads: Sequence[str], rows: Sequence[Sequence[str]], *, numeric: Sequence[int] = (), source: str = ""
) -> str:
    """Return a table; the columns named in `numeric` are aligned to the right, its source stands below."""
    caption = f"<caption>Source: {text_of(source)}</caption>" if source else ""
    kinds = [' class="n"' if i in numeric else "" for i in range(len(heads))]
    head = "".join(f'<th scope="col"{kind}>{text_of(cell)}</th>' for kind, cell in zip(kinds, heads, strict=True))
    body = "".join("<tr>" + "".join(_cell(cell, i in numeric) for i, cell in enumerate(row)) + "</tr>" for row in rows)
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def tick(name: str, label: str) -> Markup:
    """Return a box that can be ticked on screen and on paper; `label` is told to those who do not see it."""
    return Markup(f'<input type="checkbox" id="{text_of(name)}" aria-label="{text_of(label)}">')


def steps(name: str, items: Sequence[str]) -> str:
    """Return numbered steps, each with a box to tick."""
    boxes = "".join(
        f'<li><label><input type="checkbox" id="{text_of(name)}-{i}">{i}. {coded(item)}</label></li>'
        for i, item in enumerate(items, 1)
    )
    return f'<ol class="steps">{boxes}</ol>'


def coded(text: str) -> Markup:
    """Return text in which `this` stands as code."""
    return Markup(_CODE.sub(r"<code>\1</code>", text_of(text)))


def _cell(cell: str, numeric: bool) -> str:
    kinds = (("n", numeric), ("pass", cell in ("ok", "PASS")), ("fail", cell in ("FAIL", "NOT PROVEN")))
    marks = [name for name, applies in kinds if applies]
    kind = f' class="{" ".join(marks)}"' if marks else ""
    return f"<td{kind}>{text_of(cell)}</td>"


def bullets(items: Sequence[str]) -> str:
    """Return a list in which `this` stands as code, nothing without items."""
    return "<ul>" + "".join(f"<li>{coded(item)}</li>" for item in items) + "</ul>" if items else ""


def text_of(content: str) -> str:
    """Return text with what HTML would understand escaped; what is HTML already stays."""
    return content if isinstance(content, Markup) else html.escape(str(content))
