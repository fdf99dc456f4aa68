"""The page: where everything stands, and what is told when. What is computed, and how, is `work`'s and `session`'s."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from nicegui import background_tasks, events, ui

from heatertune.errors import HeatertuneError, InputError
from heatertune.proof.pwm_period import with_pwm
from heatertune.proof.verdict import NOT_PROVEN
from heatertune.studio import charts, views
from heatertune.studio.access import LARGEST_LOG
from heatertune.studio.as_left_card import LeftCard
from heatertune.studio.controls import Controls
from heatertune.studio.live_card import LiveCard
from heatertune.studio.loop_card import LoopCard
from heatertune.studio.monte_carlo_card import DrawnCard
from heatertune.studio.parts import card, chart, draw, html
from heatertune.studio.sheet import DroppedFile
from heatertune.studio.sheet_card import SheetCard
from heatertune.studio.stale import NUMBER_SEEN, Grey
from heatertune.studio.suggest import assumed_told
from heatertune.studio.wording import for_page
from heatertune.studio.work import Work

__all__ = ["Page"]

_CSS = (Path(__file__).with_name("look.css")).read_text(encoding="utf-8")
#: a file that is dropped anywhere on the page, and words that are copied
_PROGRAM = """
if (window.innerWidth < 1000) document.querySelector(".drawer").open = false;
document.addEventListener("dragover", (e) => { e.preventDefault(); document.body.classList.add("dragged"); });
document.addEventListener("dragleave", (e) => { if (!e.relatedTarget) document.body.classList.remove("dragged"); });
document.addEventListener("drop", (e) => { e.preventDefault(); document.body.classList.remove("dragged");
  if (e.dataTransfer.files.length) runMethod(UPLOAD, "addFiles", [e.dataTransfer.files]); });
document.addEventListener("click", async (e) => { const button = e.target.closest("[data-copy]"); if (!button) return;
  const label = button.textContent;
  await navigator.clipboard.writeText(button.dataset.copy);
  button.textContent = "Copied"; setTimeout(() => { button.textContent = label; }, 1200); });
"""
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
                auto_upload=True, max_file_size=LARGEST_LOG, on_upload=self._dropped,
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
        self._upload.client.run_javascript(_PROGRAM.replace("UPLOAD", str(self._upload.id)))
        self.show()
        work.follow(self)
        self._upload.client.on_delete(lambda: work.forget(self))
        background_tasks.create(self.work.go_on())

    def _build_results(self) -> None:
        self._error = ui.label().classes("card error wide").props("role=alert data-field=error")
        self._progress = ui.label().classes("card wide").props("role=status data-field=progress")
        self._live = LiveCard(self.work, self._read)
        self._sheet = SheetCard(self._use, self._hold)
        self._verdict = ui.label().classes("card verdict wide").props("role=status aria-live=polite data-field=verdict")
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
        with card("Words for the controller, as its tool shows them", "data-field=words", wide=True):
            self._words = html()
            self._build_actions()
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

    async def _dropped(self, event: events.UploadEventArguments) -> None:
        name, content = event.file.name, await event.file.read()
        self._upload.reset()
        await self._read(name, content)

    async def _use(self, dropped: DroppedFile) -> None:
        log, known = dropped.to_log()
        await self.work.take(log, known)

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
        self._left.show(session.as_left, session.verdict)
        self._drawn.show(session.samples, ready=self.work.can_draw)
        self._grey.show(computing=session.is_computing, number=session.number)
        if session.log is not None and session.fitted is not None:
            self._show_heater()
        self._found.set_visibility(session.look is not None)
        if session.front is not None or session.error:  # else what is seen stays until there is something else
            self._show_look()
        self._show_pinned()

    def _show_look(self) -> None:
        session, look = self.session, self.session.look
        seen = look, session.proof, session.pinned_designs
        if look is None or seen == self._seen:
            return
        self._seen = seen
        for area, content in ((self._words, views.words(look)), (self._rounding, views.rounding(look)),
                              (self._notes, views.notes(look)),
                              (self._criteria, views.criteria(session.proof or look.proof))):
            area.set_content(content)
        # the full proof is of the loop in front alone
        self._loop.show(look, session.proof if look is session.front else None, session.pinned_designs)

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
        self._verdict.classes(remove="pass fail not-proven", add=verdict.lower().replace(" ", "-") if judged else "")
        self._zip.set_enabled(not session.is_computing and (verdict == "PASS" or (judged and bool(self._force.value))))
        self._report.set_enabled(judged and not session.is_computing)
        self._optimum.set_enabled(session.fitted is not None and not session.is_awaited and not session.has_design)
        self._force.set_visibility(judged and verdict != "PASS")

    def _show_mend(self) -> None:
        session = self.session
        mend, assumed = session.suggestion, assumed_told(session.settings)
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
