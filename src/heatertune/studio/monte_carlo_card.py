"""The card of drawn heaters: one sentence and a table of quantiles, once they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from nicegui import ui

from heatertune.proof.verdict import samples_told
from heatertune.report.html import text_of
from heatertune.report.text import samples_rows
from heatertune.studio.loop import DRAWN
from heatertune.studio.parts import card, html

__all__ = ["DrawnCard"]

_TEXTS: Final = (0, 6)  # columns that are no numbers: the criterion and its unit
_WHAT: Final = (
    "The proof runs the heaters that the log leaves possible. Here heater, mains, room, goods and sensor are drawn at "
    "random for each of many days, as for the samples of heatertune verify.")


class DrawnCard:
    """What the design in front does on drawn heaters; `draw` is called where the user wants to know."""

    def __init__(self, draw: Callable[[], object]) -> None:
        self._shown: Mapping[str, Any] | None = None
        with card("On many drawn heaters", "data-field=drawn", wide=True):
            ui.html(f"<p>{_WHAT}</p>", sanitize=False)
            self._sentence = ui.label().classes("verdict").props("role=status data-field=drawn-sentence")
            self._table = html()
            with ui.element("div").classes("actions"):
                self._button = ui.button(f"Run {DRAWN:,} drawn heaters", on_click=draw).props("outline dense")
        self._sentence.set_visibility(False)

    def show(self, samples: Mapping[str, Any] | None, *, ready: bool) -> None:
        """Show what was seen, None: nothing yet of the design in front; `ready`: whether it can be asked for."""
        self._button.set_enabled(ready and samples is None)
        if samples is self._shown:
            return
        self._shown = samples
        self._sentence.set_visibility(samples is not None)
        self._table.set_content("" if samples is None else _table(samples))
        if samples is not None:
            verdict = samples["verdict"]
            self._sentence.set_text(f"{verdict}: {samples_told(samples)}. The worst is number {samples['worst_seed']}.")
            self._sentence.classes(remove="pass fail", add="pass" if verdict == "PASS" else "fail")


def _table(samples: Mapping[str, Any]) -> str:
    """Return the quantiles of each criterion as HTML; on a telephone each cell bears its head."""
    heads, *rows = samples_rows(samples)
    kinds = ["" if place in _TEXTS else ' class="n"' for place in range(len(heads))]
    head = "".join(f'<th scope="col"{kind}>{text_of(name)}</th>' for kind, name in zip(kinds, heads, strict=True))
    body = "".join("<tr>" + "".join(
        f'<td{kind} data-label="{text_of(name)}">{text_of(cell)}</td>'
        for kind, name, cell in zip(kinds, heads, row, strict=True)) + "</tr>" for row in rows)
    return f'<table class="drawn"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
