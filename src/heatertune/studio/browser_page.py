"""The page of the studio: its layout, its cards and their updates. `work` and `session` compute the contents.

Cards: the loop (sentence, picture with zoom and legend, figures), drawn heaters (table of quantiles), the commissioned
loop (trace in the proven band), a running loop (address, growing trace, and its fit), and several zones of one log.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Final
from weakref import WeakSet

from nicegui import background_tasks, events, ui

from heatertune.errors import HeatertuneError, InputError
from heatertune.proof import Proof
from heatertune.proof.as_left import AsLeft
from heatertune.proof.design_request import with_pwm
from heatertune.proof.verdict import NOT_PROVEN, samples_text
from heatertune.report.html import text_of
from heatertune.report.report_text import samples_rows
from heatertune.studio import charts, views
from heatertune.studio.access import LARGEST_LOG
from heatertune.studio.background_work import Work, figures, left_sentence
from heatertune.studio.charts import left_chart, live_charts
from heatertune.studio.controls import NUMBER_SEEN, Controls, Grey, card, chart, draw, html, text_input
from heatertune.studio.live_log import LiveLog, RecordingRequest
from heatertune.studio.loop_settings import DRAWN, LoopView
from heatertune.studio.proof_picture import Picture, picture_of
from heatertune.studio.session import PinnedDesign
from heatertune.studio.sheet_card import DroppedFile, SheetCard
from heatertune.studio.wording import assumptions_text, for_page
from heatertune.studio.zones_card import ZonesCard
from heatertune.writing import read_bytes

__all__ = ["DrawnCard", "LeftCard", "LiveCard", "LoopCard", "Page"]


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
            is_as_proven = (left.verdict, verdict) == ("AS PROVEN", "PASS")
            self._sentence.classes(remove="pass fail", add="pass" if is_as_proven else "fail")
            self._figures.set_content(figures(left))
            draw(self._chart, left_chart(left))


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
            self._sentence.set_text(f"{verdict}: {samples_text(samples)}. The worst is number {samples['worst_seed']}.")
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


_LOOP_CARD_HEIGHT_PX: Final = 500
_KEPT: Final = 8
_REST_S: Final = 0.3  # a verdict is read first; a design that moved on by then wants no finer picture
#: of the last proofs; every window shows the same ones
_pictures: dict[int, tuple[Proof, Picture]] = {}
#: on their way, number of the proof → its picture
_drawn: dict[int, asyncio.Task[Picture]] = {}

_first_picture = lru_cache(_KEPT)(picture_of)
_failing_run = lru_cache(_KEPT)(partial(picture_of, crowd=False))
_loop_chart = lru_cache(_KEPT)(charts.loop_chart)


class _WindowGone(Exception):
    """No window shows the proof any more."""


class LoopCard:
    """The loop of the design in front."""

    def __init__(self) -> None:
        self._shown: tuple[object, ...] = ()
        self._picture: Picture | None = None
        self._coarse = False
        self._untold: Callable[[], object] = bool
        _cards.add(self)
        self._zooms: list[tuple[str, float, float]] = []
        with card("The loop", wide=True):
            self._sentence = ui.label().classes("sentence").props("data-field=sentence")
            self._buttons = ui.element("div").classes("actions zooms").props('role=group aria-label="Show"')
            self._chart = chart("Temperature of the proven loop, and requested power, over time", _LOOP_CARD_HEIGHT_PX,
                                "loop-numbers").classes("loop-chart")
            self._key = html()
            with ui.element("details").classes("numbers"):
                ui.html("The picture in numbers", sanitize=False, tag="summary")
                self._numbers = html().props("id=loop-numbers")

    def show(self, look: LoopView, proof: Proof | None, pinned: Sequence[PinnedDesign]) -> None:
        """Draw a loop; `proof`: its full one, None until it is done. What is told beside it follows with `tell`."""
        shows = (look, proof, *((pin.name, pin.look) for pin in pinned))
        if len(shows) == len(self._shown) and all(a is b or a == b for a, b in zip(shows, self._shown, strict=True)):
            return
        verdict_alone = self._shown[:1] + self._shown[2:] == shows[:1] + shows[2:]
        self._shown = shows
        picture = _first_picture(look.proof)
        if not (verdict_alone and picture is self._picture):
            self._draw(look, picture, pinned, coarse=True)
        self._untold = partial(self._tell, look, proof, picture, pinned)
        if not look.is_opening:  # else the whole of it follows
            background_tasks.create(self._refine(shows, look, proof, pinned))

    def tell(self) -> None:
        """Tell what is drawn in words and numbers, if that was not done."""
        self._untold()
        self._untold = bool

    def leave(self) -> None:
        """Draw no further runs of the proof that is seen: another loop is on its way."""
        self._shown = ()

    def shows(self, proof: Proof) -> bool:
        """Return whether this is the proof that is seen."""
        return len(self._shown) > 1 and self._shown[1] is proof and not self._chart.is_deleted

    def _still_shows(self, shown: tuple[object, ...]) -> bool:
        return self._shown is shown and not self._chart.is_deleted

    async def _refine(
        self, shown: tuple[object, ...], look: LoopView, proof: Proof | None, pinned: Sequence[PinnedDesign]
    ) -> None:
        """Draw a loop at rest so that it bears a zoom, then every run of its proof."""
        await asyncio.sleep(_REST_S)
        if self._coarse and self._picture is not None:
            await self._show_picture(shown, look, proof, self._picture, pinned)
        if proof is None or not self._still_shows(shown):
            return
        if proof.verdict == "FAIL":  # before the others
            await self._show_picture(shown, look, proof, await asyncio.to_thread(_failing_run, proof), pinned)
        while self._still_shows(shown):
            with suppress(_WindowGone):  # and wanted again meanwhile
                await self._show_picture(shown, look, proof, await _picture_with_all_runs(proof), pinned)
                return

    async def _show_picture(
        self, shown: tuple[object, ...], look: LoopView, proof: Proof | None, picture: Picture,
        pinned: Sequence[PinnedDesign],
    ) -> None:
        """Draw a picture finely, and tell what is in it, if its loop is still the one that is seen."""
        if self._still_shows(shown):
            await asyncio.to_thread(_loop_chart, look, picture, tuple(pinned), coarse=False)  # the wish is run, too
        if self._still_shows(shown):
            self._draw(look, picture, pinned)
            self._tell(look, proof, picture, pinned)

    def _draw(
        self, look: LoopView, picture: Picture, pinned: Sequence[PinnedDesign], *, coarse: bool = False
    ) -> None:
        self._picture, self._coarse = picture, coarse
        draw(self._chart, _loop_chart(look, picture, tuple(pinned), coarse=coarse), sketch=coarse)

    def _tell(self, look: LoopView, proof: Proof | None, picture: Picture, pinned: Sequence[PinnedDesign]) -> None:
        self._sentence.set_text(views.sentence(proof or look.proof, look.settings.switch_kind))
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
    entry = _pictures.get(id(proof))
    if entry is not None:
        return entry[1]
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


_LIVE_CARD_HEIGHT_PX: Final = 260
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
            self._temperature = chart("Temperature and setpoint so far, in °C over seconds", _LIVE_CARD_HEIGHT_PX,
                                      "live-now")
            self._power = chart("Power so far, in percent over seconds", _POWER_PX, "live-now")
            with ui.element("div").classes("actions"):
                self._start = ui.button("Start", on_click=self._begin).props("dense")
                self._stop = ui.button("Stop and read the log", on_click=self._end).props("dense")
                self._read = ui.button("Read the log", on_click=self._open).props("outline dense")
                self._away = ui.button("Put it away", on_click=self._put_away).props("outline dense")
        self.show()

    def _build_form(self) -> None:
        with ui.element("div").classes("fields") as self._form:
            self._address = text_input("Address of the PLC", _ADDRESSES)
            self._where = text_input("Folder of its design, or map (TOML)", "out/")
            self._log = text_input("Log to write", "log.csv")
            self._every = text_input("Least time between two rows, in s", "each scan")
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
        for element, is_visible in (
                (self._error, bool(error)), (self._state, bool(self._state.text)), (self._now, bool(self._now.text)),
                (self._start, not runs), (self._stop, runs), (self._away, not runs),
                (self._read, not runs and live is not None and live.rows > 0)):
            element.set_visibility(is_visible)
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


def _content(live: LiveLog) -> bytes:
    """Return the content of the log; raise InputError where it is too large, or is gone."""
    try:
        if live.path.stat().st_size > LARGEST_LOG:
            raise InputError(f"{live.path}: is larger than {LARGEST_LOG / 1e6:.0f} MB; heatertune fit reads it")
        return read_bytes(live.path)
    except OSError as problem:
        raise InputError(f"{live.path}: cannot be read: {problem.strerror}") from None


_CSS = (Path(__file__).with_name("look.css")).read_text(encoding="utf-8")
#: a file that is dropped anywhere on the page (kept until the page can take it), and words that are copied
_PROGRAM = """<script>
async function takeFiles(files) {
  while (!window.did_handshake) await new Promise((ready) => setTimeout(ready, 50));
  runMethod(UPLOAD, "addFiles", [files]); }
document.addEventListener("dragover", (e) => { e.preventDefault(); document.body.classList.add("dragged"); });
document.addEventListener("dragleave", (e) => { if (!e.relatedTarget) document.body.classList.remove("dragged"); });
document.addEventListener("drop", (e) => { e.preventDefault(); document.body.classList.remove("dragged");
  if (e.dataTransfer.files.length) takeFiles([...e.dataTransfer.files]); });
document.addEventListener("click", async (e) => { const button = e.target.closest("[data-copy]"); if (!button) return;
  const label = button.textContent;
  await navigator.clipboard.writeText(button.dataset.copy);
  button.textContent = "Copied"; setTimeout(() => { button.textContent = label; }, 1200); });
</script>"""
_DRAWER = 'if (window.innerWidth < 1000) document.querySelector(".drawer").open = false;'
_BLUE = "#005a9c"  # 7:1 on white


class Page:
    """One browser window on the session, which every window follows."""

    def __init__(self, work: Work) -> None:
        self.work, self.session = work, work.session
        ui.add_css(_CSS)
        self._grey = Grey()
        ui.colors(primary=_BLUE)
        with ui.element("header").classes("bar"):
            ui.html("heatertune studio", sanitize=False, tag="h1")
            self._source = ui.label("no log yet").classes("source")
            paper = ui.button("Use the paper's table 4", on_click=lambda: self._open("table4"))
            paper.props("outline dense color=white")
            self._upload = ui.upload(
                multiple=True, auto_upload=True, max_file_size=LARGEST_LOG, on_multi_upload=self._dropped,
                on_rejected=lambda: self._tell_error("the file is larger than 50 MB"),
            ).classes("hidden")
            ui.button("Record a running loop", on_click=self._ask_live).props("outline dense color=white")
            choose = ui.button("Drop a log here, or choose a file").props("dense").classes("choose")
            choose.on("click", js_handler=f"() => runMethod({self._upload.id}, 'pickFiles', [])")
        with ui.element("div").classes("studio"):
            with ui.element("section").classes("card controls").props('aria-label="Settings"'):
                self._controls = Controls(self._moved, self._grey.note_moves)
            with ui.element("div").classes("results"):
                self._build_results()
        ui.dark_mode(None)
        ui.add_head_html(_PROGRAM.replace("UPLOAD", str(self._upload.id)))
        self._upload.client.run_javascript(_DRAWER)
        self.show()
        self._upload.client.on_connect(self._follow)
        self._upload.client.on_disconnect(self._forget)
        self._upload.client.on_delete(self._forget)  # of a page that never was connected
        background_tasks.create(self.work.go_on())

    def _follow(self) -> None:
        """Follow the session once a browser is connected, again after it was not."""
        self.work.forget(self)  # it may connect again before its old connection is found dead
        self.work.follow(self)
        self.show()

    def _forget(self) -> None:
        """Leave a page whose browser is gone: nothing is drawn for it, and no task draws into a deleted page."""
        if not self._upload.client.has_socket_connection:
            self.work.forget(self)
            self._loop.leave()
            self._seen = None

    def _build_results(self) -> None:
        self._error = ui.label().classes("card error wide").props("role=alert data-field=error")
        self._progress = ui.label().classes("card wide").props("role=status data-field=progress")
        self._live = LiveCard(self.work, self._read)
        self._zones = ZonesCard(self.work, lambda: self._sheet.reading)
        self._sheet = SheetCard(self._use, self._hold)
        with ui.element("div").classes("card verdict wide").props("data-field=banner") as self._banner:
            self._verdict = ui.label().props("role=status aria-live=polite data-field=verdict")
            self._conditions = html().props("data-field=conditions")
        with ui.element("div").classes("card mend wide").props("role=status data-field=mend") as self._mend:
            self._mend_told = ui.label().props("data-field=mend-told")
            with ui.element("div").classes("actions"):
                self._mend_button = ui.button("", on_click=self.work.mend).props("dense")
                self._back = ui.button("Back to the request", on_click=self.work.take_back).props("outline dense")
        with ui.element("div").classes("results wide") as self._found:
            self._build_found()

    def _build_found(self) -> None:
        """Build what is seen once there is a design."""
        self._left = LeftCard(self.work.put_trace_away)
        self._loop = LoopCard()
        with card("Words for the controller, as its tool shows them", "data-field=words", wide=True) as parameters:
            self._words = html()
            self._build_actions()
        parameters.classes("parameters")
        with card("What rounding did"):
            self._rounding = html()
        with card("Log and model"):
            self._log = chart("Log and fitted model, in °C over seconds; shaded: 95 % of its errors", 210, "diagnosis")
        with card("The heater, and what the log leaves open"):
            self._heater = chart("Rise after 10 % more power, in °C over seconds; shaded: all models", 210, "diagnosis")
        with card("What the log shows"):
            self._diagnosis = html().props("id=diagnosis")
        with card("How it was found"):
            self._notes = html()
        with card("Designs side by side", wide=True):
            with ui.element("div").classes("actions"):
                ui.button("Keep this design", on_click=self._pin).props("outline dense")
                self._letters = ui.element("div").classes("actions")
            self._compared = html()
        with card("Criteria of the proof", wide=True):
            self._criteria = html().classes("narrow")
        self._drawn = DrawnCard(self.work.draw)

    def _build_actions(self) -> None:
        with ui.element("div").classes("actions"):
            self._optimum = ui.button("Search the optimum", on_click=self.work.design).props("outline dense")
            self._zip = ui.button("Download words (zip)").props("dense")
            self._zip.on("click", lambda event: self._download(self.work.zip, event.args, "zip", "application/zip"),
                         js_handler=NUMBER_SEEN)
            self._report = ui.button("Download report").props("outline dense")
            self._report.on("click", lambda event: self._download(self.work.report, event.args, "html", "text/html"),
                            js_handler=NUMBER_SEEN)
            self._force = ui.checkbox("export even if the verdict is not PASS", on_change=self.show).props("dense")

    def show_progress(self) -> None:
        """Show what takes long, and how far the proof is."""
        self._progress.set_text(self.work.busy)
        self._progress.set_visibility(bool(self.work.busy))
        if self.session.verdict == "proving…":
            self._verdict.set_text(views.proving_text(self.work.proving))

    def show_live(self) -> None:
        """Show the loop that is being recorded."""
        self._live.show()

    def _tell_error(self, message: str) -> None:
        self.session.refuse_file(InputError(message))
        self.work.tell()

    def _moved(self, **fields: Any) -> None:
        self.work.move(**fields, **self._period(fields))
        background_tasks.create(self.work.look())

    def _period(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        """Return the PWM period that suits a kind of switch that was chosen."""
        session, kind = self.session, fields.get("switch_kind")
        if kind is None or session.look is None or session.fitted is None:
            return {}
        gains, assumed = session.look.gains, replace(session.settings.conditions, pwm_period_s=None)
        _, proposed = with_pwm(gains.design, session.fitted, kind, assumed, words=gains.words)
        return {"pwm_period_s": None if kind == "ssr" else proposed.pwm_period_s}

    async def _open(self, source: str) -> None:
        await self.work.open(source)

    def _ask_live(self) -> None:
        self._live.ask()

    async def _read(self, name: str, content: bytes) -> None:
        await self._sheet.open(name, content)

    async def _dropped(self, event: events.MultiUploadEventArguments) -> None:
        files = [(file.name, await file.read()) for file in event.files]
        self._upload.reset()
        await self.work.offer_zones(files)
        for name, content in files:
            await self._read(name, content)

    async def _use(self, dropped: DroppedFile) -> None:
        log, assumptions = dropped.to_log()
        await self.work.take(log, assumptions)

    async def _hold(self, dropped: DroppedFile, number: int) -> None:
        await self.work.hold(dropped.to_log()[0], dropped.assumptions.about, number)

    def _pin(self) -> None:
        try:
            self.session.pin()
        except HeatertuneError as problem:
            ui.notify(for_page(str(problem)), type="warning")
        self.work.tell()

    def _unpin(self, name: str) -> None:
        self.session.unpin(name)
        self.work.tell()

    async def _download(self, make: Any, number: Any, ending: str, kind: str) -> None:
        try:
            name, content = await make(int(number), force=bool(self._force.value))
        except HeatertuneError as problem:
            ui.notify(for_page(str(problem)), type="negative")
            return
        ui.download(content, f"{name}.{ending}", kind)

    def show(self) -> None:
        """Show the session as it is now."""
        session = self.session
        problem = session.fault or session.file_error or session.error
        self._error.set_text(f"error: {for_page(problem)}" if problem else "")
        self._error.set_visibility(bool(problem))
        self._show_controls()
        self._show_verdict()
        self._show_mend()
        self.show_progress()
        self._sheet.show(proven=session.proof is not None)
        self._zones.show()
        self._banner.set_visibility(session.look is not None or self.work.zones is None)
        self._left.show(session.as_left, session.verdict)
        self._drawn.show(session.samples, ready=self.work.can_draw)
        self._grey.show(computing=session.is_computing, number=session.number)
        if session.log is not None and session.fitted is not None:
            self._show_heater()
        self._found.set_visibility(session.look is not None)
        if session.front is not None or session.error:  # else what is seen stays until there is something else
            self._show_look()
        else:
            self._loop.leave()
        self._show_pinned()

    def show_move(self) -> None:
        """Show that settings moved: what is seen is grey until `show`."""
        self._grey.wait()
        self._controls.show_move(self.session.settings)

    def show_loop(self, look: LoopView) -> None:
        """Draw a loop alone, the newest while a slider moves on: what is told beside it takes a browser longer."""
        session = self.session  # the full proof is of the loop in front alone
        self._loop.show(look, session.proof if look is session.front else None, session.pinned_designs)

    def _show_look(self) -> None:
        session, look = self.session, self.session.look
        state = look, session.proof, session.pinned_designs
        if look is None or state == self._seen:
            return
        self._seen = state
        for area, content in ((self._words, views.words(look)), (self._rounding, views.rounding(look)),
                              (self._notes, views.notes(look)),
                              (self._criteria, views.criteria(session.proof or look.proof))):
            area.set_content(content)
        self.show_loop(look)
        self._loop.tell()

    def _show_heater(self) -> None:
        session = self.session
        if session.fitted is self._shown_heater or session.log is None or session.fitted is None:
            return
        self._shown_heater = session.fitted
        self._source.set_text(f"{session.log.name}: {len(session.log.time_s)} readings")
        self._diagnosis.set_content(views.diagnosis(session.log, session.fitted))
        draw(self._log, charts.log_chart(session.log, session.fitted))
        draw(self._heater, charts.heater_chart(session.fitted))

    _shown_heater: Any = None
    _seen: Any = None
    _pins_seen: Any = None

    def _show_controls(self) -> None:
        chosen: dict[str, float] = {}
        if self.session.look is not None:
            nominal = self.session.look.proof.nominal
            chosen = {
                "sample_time_s": self.session.look.gains.words.sample_time_s,
                "pwm_period_s": nominal.actuator.pwm_period_s, "setpoint_degC": nominal.setpoint_degC,
            }
        self._controls.show(self.session.settings, chosen)

    def _show_verdict(self) -> None:
        session = self.session
        verdict = session.verdict
        proof = None if session.error else session.proof
        self._verdict.set_text(views.verdict_text(verdict, proof, last=session.look is not None))
        judged = verdict in ("PASS", "FAIL", NOT_PROVEN)
        self._banner.classes(remove="pass fail not-proven", add=verdict.lower().replace(" ", "-") if judged else "")
        self._conditions.set_content(views.conditions(proof))
        self._zip.set_enabled(not session.is_computing and (verdict == "PASS" or (judged and bool(self._force.value))))
        self._report.set_enabled(judged and not session.is_computing)
        self._optimum.set_enabled(session.fitted is not None and not session.is_awaited and not session.has_design)
        self._force.set_visibility(judged and verdict != "PASS")

    def _show_mend(self) -> None:
        session = self.session
        mend, assumed = session.suggestion, assumptions_text(session.settings)
        self._mend_told.set_text(" ".join(filter(None, (assumed, mend.message if mend else ""))))
        self._mend_button.set_text(mend.button if mend else "")
        self._mend_button.set_visibility(bool(mend and mend.button))
        self._back.set_visibility(session.has_design or bool(assumed))
        self._mend.set_visibility(session.has_design or bool(assumed or mend))

    def _show_pinned(self) -> None:
        pinned = self.session.pinned_designs
        if pinned == self._pins_seen:
            return
        self._pins_seen = pinned
        self._compared.set_content(views.comparison_html(pinned))
        self._letters.clear()
        with self._letters:
            for pin in pinned:
                ui.button(f"Let {pin.name} go", on_click=lambda name=pin.name: self._unpin(name)).props("flat dense")
