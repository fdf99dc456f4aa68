"""The sheet that a dropped file opens on the page."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, Final

from nicegui import ui

from heatertune.report.html import text_of
from heatertune.studio.sheet import DroppedFile, change_sheet
from heatertune.studio.sheet_view import sheet
from heatertune.studio.stale import NUMBER_SEEN

__all__ = ["SheetCard"]

_CHANGED: Final = """(e) => { const t = e.target; if (!t.dataset.change) return;
  emit([t.dataset.change, Number(t.dataset.place), t.type === "checkbox" ? t.checked ? "1" : "" : t.value,
        t.dataset.key]); }"""


class SheetCard:
    """A card that is seen while a dropped file waits.

    Args:
        use: called with the file once the user takes it as the log of a heater.
        hold: called with the file and the number of the design in front once it is to be held against that.
    """

    def __init__(
        self, use: Callable[[DroppedFile], Awaitable[object]], hold: Callable[[DroppedFile, int], Awaitable[object]]
    ) -> None:
        self._use, self._hold = use, hold
        self._dropped: DroppedFile | None = None
        self._in_turn = asyncio.Lock()  # a change is read in a thread: no button may act on what was there before it
        self._card = ui.element("section").classes("card wide sheet").props('aria-labelledby="sheet-title"')
        with self._card:
            self._title = ui.html("", sanitize=False, tag="h2").props('id=sheet-title tabindex=-1')
            self._content = ui.html("", sanitize=False).on("change", self._changed, js_handler=_CHANGED)
            with ui.element("div").classes("actions"):
                self._take = ui.button("Use this log", on_click=self._taken).props("dense")
                self._against = ui.button("Hold against the proven design").props("outline dense")
                self._against.on("click", lambda event: self._holds(int(event.args)), js_handler=NUMBER_SEEN)
                ui.button("Put it away", on_click=self.close).props("outline dense")
        self.close()

    async def open(self, name: str, content: bytes) -> None:
        """Show how a file is understood."""
        self._show(await asyncio.to_thread(DroppedFile.of, name, content))
        self._title.client.run_javascript("document.getElementById('sheet-title').focus()")

    def show(self, *, proven: bool) -> None:
        """Show whether the file can be the trace of a commissioned loop: a proven design is in front."""
        self._card.classes(remove="" if proven else "proven", add="proven" if proven else "")
        self._against.set_visibility(proven)

    def close(self) -> None:
        """Forget the file."""
        self._dropped = None
        self._content.set_content("")
        self._card.set_visibility(False)

    def _show(self, dropped: DroppedFile) -> None:
        self._dropped = dropped
        self._title.set_content(f"The file as read: {text_of(dropped.name)}")
        self._content.set_content(sheet(dropped))
        for button in (self._take, self._against):
            button.set_enabled(dropped.log is not None)
        self._card.set_visibility(True)

    async def _changed(self, event: Any) -> None:
        change, place, value, key = event.args
        async with self._in_turn:
            before = self._dropped
            if before is None:
                return
            after = await asyncio.to_thread(change_sheet, before, change, int(place), str(value))
            if self._dropped is not before:  # put away meanwhile, or another file is there
                return
            self._show(after)
        # what was changed was drawn anew, so the keyboard would have lost its place
        self._content.client.run_javascript(f"document.querySelector('[data-key=\"{key}\"]')?.focus()")

    async def _taken(self) -> None:
        dropped = await self._closed_with()
        if dropped is not None:
            await self._use(dropped)

    async def _holds(self, number: int) -> None:
        dropped = await self._closed_with()
        if dropped is not None:
            await self._hold(dropped, number)

    async def _closed_with(self) -> DroppedFile | None:
        """Close the sheet and return it with every change that came before; None where it holds no log."""
        async with self._in_turn:
            dropped = self._dropped
            if dropped is None or dropped.log is None:
                return None
            self.close()
            return dropped
