"""HTML in one look: page, table, list, picture. Nothing is fetched from anywhere."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

from heatertune.report.style import to_svg

__all__ = ["bullets", "page", "picture", "table", "text_of"]

_STYLE = """
:root { --ink: #1a1a1a; --soft: #595959; --line: #d5d5d5; --pass: #00634a; --fail: #a33c00; }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: #fff; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
p, li { max-width: 46rem; } .soft { color: var(--soft); }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: .25rem .7rem; text-align: left; vertical-align: top; }
td.n { text-align: right; } .pass { color: var(--pass); font-weight: 600; }
.fail { color: var(--fail); font-weight: 700; }
.verdict { font-size: 1.3rem; border: 2px solid currentColor; padding: .3rem .8rem; display: inline-block; }
figure { margin: 1rem 0; } figure svg { max-width: 100%; height: auto; } figcaption { color: var(--soft); }
code { font-family: ui-monospace, monospace; }
@media print { h2 { break-after: avoid; } figure, table { break-inside: avoid; } body { margin: 0; max-width: none; } }
"""


def page(title: str, body: str) -> str:
    """Return a whole page with its style."""
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>heatertune: {text_of(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_STYLE}</style></head>\n'
        f"<body><main>\n<h1>{text_of(title)}</h1>\n{body}\n</main></body></html>\n"
    )


def picture(drawn: Any, caption: str) -> str:
    """Return a figure as inline SVG with its caption."""
    return f"<figure>{to_svg(drawn)}<figcaption>{text_of(caption)}</figcaption></figure>"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], *, numeric: Sequence[int] = ()) -> str:
    """Return a table; the columns named in `numeric` are aligned to the right."""
    head = "".join(f"<th scope='col'>{text_of(cell)}</th>" for cell in heads)
    body = "".join("<tr>" + "".join(_cell(cell, i in numeric) for i, cell in enumerate(row)) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cell(cell: str, numeric: bool) -> str:
    kinds = (("n", numeric), ("pass", cell in ("ok", "PASS")), ("fail", cell == "FAIL"))
    marks = [name for name, found in kinds if found]
    kind = f' class="{" ".join(marks)}"' if marks else ""
    return f"<td{kind}>{text_of(cell)}</td>"


def bullets(items: Sequence[str]) -> str:
    """Return a list, nothing without items."""
    return "<ul>" + "".join(f"<li>{text_of(item)}</li>" for item in items) + "</ul>" if items else ""


def text_of(content: str) -> str:
    """Return text with what HTML would understand escaped."""
    return html.escape(str(content))
