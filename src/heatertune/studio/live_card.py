"""The card of a running loop: where it is read, its trace as it grows, and the way from there to a fit."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, Final

from nicegui import ui

from heatertune.errors import HeatertuneError, InputError
from heatertune.files import read_bytes
from heatertune.studio.access import LARGEST_LOG
from heatertune.studio.charts import live_charts
from heatertune.studio.live_log import LiveLog, RecordingRequest
from heatertune.studio.parts import card, chart, draw
from heatertune.studio.wording import for_page
from heatertune.studio.work import Work

__all__ = ["LiveCard"]

_HEIGHT_PX: Final = 260
_POWER_PX: Final = 140
_ADDRESSES: Final = "s7://192.168.0.10/0/2/db30"


class LiveCard:
    """A card that is seen once it is asked for, or a loop is being recorded.

    Args:
        work: that records.
        use: called with name and content of the log once the user wants it read.
    """

    def __init__(self, work: Work, use: Callable[[str, bytes], Awaitable[object]]) -> None:
        self._work, self._use = work, use
        self._asked_for = False
        self._drawn: Any = None
        with card("Record a running loop", "data-field=live", wide=True) as self._card:
            self._card.classes("live")
            self._build_form()
            self._error = ui.label().classes("error").props("role=alert data-field=live-error")
            self._state = ui.label().classes("verdict").props("role=status data-field=live-state")
            self._now = ui.label().props("id=live-now data-field=live-now")
            self._temperature = chart("Temperature and setpoint so far, in °C over seconds", _HEIGHT_PX, "live-now")
            self._power = chart("Power so far, in percent over seconds", _POWER_PX, "live-now")
            with ui.element("div").classes("actions"):
                self._start = ui.button("Start", on_click=self._begin).props("dense")
                self._stop = ui.button("Stop and read the log", on_click=self._end).props("dense")
                self._read = ui.button("Read the log", on_click=self._open).props("outline dense")
                self._away = ui.button("Put it away", on_click=self._put_away).props("outline dense")
        self.show()

    def _build_form(self) -> None:
        with ui.element("div").classes("fields") as self._form:
            self._address = _text("Address of the PLC", _ADDRESSES)
            self._where = _text("Folder of its design, or map (TOML)", "out/")
            self._log = _text("Log to write", "log.csv")
            self._every = _text("Least time between two rows, in s", "each scan")
            self._append = ui.checkbox("continue an existing log").props("dense")

    def ask(self) -> None:
        """Show the card, the keyboard in its first field."""
        self._asked_for = True
        self.show()
        self._address.run_method("focus")

    def show(self) -> None:
        """Show the recording as it is now."""
        live, error = self._work.live, self._work.live_error
        runs = live is not None and not live.is_over
        self._card.set_visibility(self._asked_for or live is not None)
        self._form.set_visibility(not runs)
        self._error.set_text(f"error: {for_page(error)}" if error else "")
        self._state.set_text("" if live is None else live.state)
        self._now.set_text("" if live is None else live.latest)
        for element, seen in (
                (self._error, bool(error)), (self._state, bool(self._state.text)), (self._now, bool(self._now.text)),
                (self._start, not runs), (self._stop, runs), (self._away, not runs),
                (self._read, not runs and live is not None and live.rows > 0)):
            element.set_visibility(seen)
        self._stop.set_enabled(live is not None and not live.is_ending)
        self._draw(live)

    def _draw(self, live: LiveLog | None) -> None:
        rows = 0 if live is None else live.rows
        if self._drawn == (live, rows):
            return
        self._drawn = live, rows
        shown = [None, None] if live is None or not rows else live_charts(live.trace)
        for element, options in zip((self._temperature, self._power), shown, strict=True):
            element.set_visibility(options is not None)
            if options is not None:
                draw(element, options)

    async def _begin(self) -> None:
        await self._work.record(RecordingRequest(address=self._address.value, where=self._where.value,
                                                 log=self._log.value,
                                      every=self._every.value, append=self._append.value))

    async def _end(self) -> None:
        await self._work.end_recording()
        await self._open()

    async def _open(self) -> None:
        live = self._work.live
        if live is None or not live.rows:
            return
        try:
            content = await asyncio.to_thread(_content, live)
        except HeatertuneError as problem:
            self._work.tell_recording(problem)
        else:
            await self._use(live.path.name, content)

    def _put_away(self) -> None:
        self._asked_for = False
        self._work.put_recording_away()


def _text(label: str, example: str) -> ui.input:
    return ui.input(label, placeholder=example, value="").props("outlined dense stack-label")


def _content(live: LiveLog) -> bytes:
    """Return what the log holds; raise InputError where it is too large, or is gone."""
    try:
        if live.path.stat().st_size > LARGEST_LOG:
            raise InputError(f"{live.path}: is larger than {LARGEST_LOG / 1e6:.0f} MB; heatertune fit reads it")
        return read_bytes(live.path)
    except OSError as problem:
        raise InputError(f"{live.path}: cannot be read: {problem.strerror}") from None
