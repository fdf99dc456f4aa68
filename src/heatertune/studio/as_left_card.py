"""The card of the commissioned loop: one sentence, the trace over what was proven, and its figures."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from heatertune.proof.as_left import AsLeft
from heatertune.studio.as_left_session import figures, left_chart, left_sentence
from heatertune.studio.parts import card, chart, draw, html

__all__ = ["LeftCard"]

_HEIGHT_PX = 300


class LeftCard:
    """A trace beside the proven design in front; `away` is called where the user wants it no more."""

    def __init__(self, away: Callable[[], object]) -> None:
        self._shown: AsLeft | None = None
        with card("As left: the commissioned loop and its proof", "data-field=as-left", wide=True) as self._card:
            self._sentence = ui.label().classes("verdict").props("role=status data-field=left-sentence")
            self._chart = chart("The trace over the band of the proven runs, in °C over seconds; shaded: outside of it",
                                _HEIGHT_PX, "left-figures")
            self._figures = html().props("id=left-figures")
            with ui.element("div").classes("actions"):
                ui.button("Put the trace away", on_click=away).props("outline dense")
        self._card.set_visibility(False)

    def show(self, left: AsLeft | None, verdict: str) -> None:
        """Show a trace beside the proof, which ended in a verdict; None: there is none for the design in front."""
        if left is self._shown:
            return
        self._shown = left
        self._card.set_visibility(left is not None)
        if left is not None:
            self._sentence.set_text(left_sentence(left, verdict))
            kept = (left.verdict, verdict) == ("AS PROVEN", "PASS")
            self._sentence.classes(remove="pass fail", add="pass" if kept else "fail")
            self._figures.set_content(figures(left))
            draw(self._chart, left_chart(left))
