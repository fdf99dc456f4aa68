"""The card of the loop: one sentence, the picture with its zoom and its key, and the same in numbers."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from functools import lru_cache
from typing import Final
from weakref import WeakSet

from nicegui import background_tasks, ui

from heatertune.proof import Proof
from heatertune.studio import charts, views
from heatertune.studio.loop import LoopView
from heatertune.studio.parts import card, chart, draw, html
from heatertune.studio.picture import Picture, picture_of
from heatertune.studio.session import PinnedDesign

__all__ = ["LoopCard"]

_HEIGHT_PX: Final = 470
_KEPT: Final = 8
_REST_S: Final = 0.3  # a verdict is read first; a design that moved on by then wants no picture of all its runs
#: of the last proofs; every window shows the same ones
_pictures: dict[int, tuple[Proof, Picture]] = {}
#: on their way, number of the proof → its picture
_drawn: dict[int, asyncio.Task[Picture]] = {}

_first_picture = lru_cache(_KEPT)(picture_of)
_loop_chart = lru_cache(_KEPT)(charts.loop_chart)


class _WindowGone(Exception):
    """No window shows the proof any more."""


class LoopCard:
    """The loop of the design in front."""

    def __init__(self) -> None:
        self._shown: tuple[object, ...] = ()
        self._picture: Picture | None = None
        _cards.add(self)
        self._zooms: list[tuple[str, float, float]] = []
        with card("The loop", wide=True):
            self._sentence = ui.label().classes("sentence").props("data-field=sentence")
            self._buttons = ui.element("div").classes("actions zooms").props('role=group aria-label="Show"')
            self._chart = chart("Temperature of the proven loop, and requested power, over time", _HEIGHT_PX,
                                "loop-numbers").classes("loop-chart")
            self._key = html()
            with ui.element("details").classes("numbers"):
                ui.html("The picture in numbers", sanitize=False, tag="summary")
                self._numbers = html().props("id=loop-numbers")

    def show(self, look: LoopView, proof: Proof | None, pinned: Sequence[PinnedDesign]) -> None:
        """Show a loop; `proof`: its full one, None until it is done."""
        wanted = (look, proof, *((pin.name, pin.look) for pin in pinned))
        if len(wanted) == len(self._shown) and all(a is b or a == b for a, b in zip(wanted, self._shown, strict=True)):
            return
        verdict_alone = self._shown[:1] + self._shown[2:] == wanted[:1] + wanted[2:]
        self._shown = wanted
        self._sentence.set_text(views.sentence(proof or look.proof, look.settings.switch_kind))
        known = None if proof is None else _pictures.get(id(proof))
        picture = known[1] if known else _first_picture(look.proof)
        if not (verdict_alone and picture is self._picture):
            self._draw(look, picture, pinned)
        if proof is not None and known is None:
            background_tasks.create(self._with_all_runs(wanted, look, proof, pinned))

    def shows(self, proof: Proof) -> bool:
        """Return whether this is the proof that is seen."""
        return len(self._shown) > 1 and self._shown[1] is proof

    async def _with_all_runs(
        self, shown: tuple[object, ...], look: LoopView, proof: Proof, pinned: Sequence[PinnedDesign]
    ) -> None:
        await asyncio.sleep(_REST_S)
        while self._shown is shown:
            try:
                picture = await _picture_with_all_runs(proof)
            except _WindowGone:  # and wanted again meanwhile
                continue
            if self._shown is shown:
                self._draw(look, picture, pinned)
            return

    def _draw(self, look: LoopView, picture: Picture, pinned: Sequence[PinnedDesign]) -> None:
        self._picture = picture
        draw(self._chart, _loop_chart(look, picture, tuple(pinned)))
        self._key.set_content(views.key(charts.key_of(look, picture, pinned)))
        self._numbers.set_content(views.in_words(picture, picture.runs))
        zooms = charts.zooms(picture)
        if [name for name, *_ in zooms] != [name for name, *_ in self._zooms]:
            self._buttons.clear()
            with self._buttons:
                for number, (name, *_) in enumerate(zooms):
                    ui.button(name, on_click=lambda number=number: self._zoom(number)).props("flat dense")
        self._zooms = zooms

    def _zoom(self, number: int) -> None:
        _, begin_s, end_s = self._zooms[number]
        self._chart.run_chart_method("dispatchAction", {"type": "dataZoom", "startValue": begin_s, "endValue": end_s})


_cards: WeakSet[LoopCard] = WeakSet()


async def _picture_with_all_runs(proof: Proof) -> Picture:
    """Return the picture of a proof, made once for all windows; raise `_Abandoned` once none shows the proof."""
    known = _pictures.get(id(proof))
    if known is not None:
        return known[1]
    if id(proof) not in _drawn:
        cards = [*_cards]  # those that the thread asks; a window that opens meanwhile asks anew

        def before_run() -> None:
            if not any(card.shows(proof) for card in cards):
                raise _WindowGone

        _drawn[id(proof)] = asyncio.create_task(asyncio.to_thread(picture_of, proof, before_run))
        _drawn[id(proof)].add_done_callback(lambda _: _drawn.pop(id(proof)))
    picture = await asyncio.shield(_drawn[id(proof)])
    _pictures[id(proof)] = proof, picture
    if len(_pictures) > _KEPT:
        del _pictures[next(iter(_pictures))]
    return picture
