"""The page: where everything stands, and what is told when. What is computed, and how, is `work`'s and `session`'s."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nicegui import background_tasks, events, ui

from heatertune.errors import HeatertuneError, InputError
from heatertune.proof.verdict import NOT_PROVEN
from heatertune.studio import charts, views
from heatertune.studio.controls import Controls
from heatertune.studio.session import Session
from heatertune.studio.settings import sliders_for
from heatertune.studio.work import Work

__all__ = ["Page"]

_CSS = (Path(__file__).with_name("look.css")).read_text(encoding="utf-8")
#: Quasar's button with the plus sign has no name of its own
_NAME_THE_UPLOAD = (
    "document.querySelectorAll('.q-uploader .q-btn, .q-uploader input').forEach("
    "e => e.setAttribute('aria-label', 'Choose a log file (CSV)'))"
)
_BLUE = "#005a9c"  # 7:1 on white
_LARGEST_LOG = 50_000_000  # bytes; a year of readings every second is about that


class Page:
    """One browser window on the session."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.work = Work(session, shown=self.show, busy=self._busy)
        ui.add_css(_CSS)
        ui.colors(primary=_BLUE)
        with ui.element("header").classes("bar"):
            ui.html("heatertune studio", sanitize=False, tag="h1")
            self._source = ui.label("no log yet").classes("source")
            paper = ui.button("Use the paper's table 4", on_click=lambda: self._open("table4"))
            paper.props("outline dense color=white")
            self._upload = ui.upload(
                label="Drop a log (CSV) here", auto_upload=True, max_file_size=_LARGEST_LOG, on_upload=self._dropped,
                on_rejected=lambda: self._tell_error("the file is larger than 50 MB"),
            ).props('flat aria-label="Drop a log here or choose a file"')
        with ui.element("main").classes("studio"):
            with ui.element("section").classes("card controls").props('aria-label="Settings"'):
                self._controls = Controls(self._moved)
            with ui.element("div").classes("results"):
                self._build_results()
        self._upload.client.run_javascript(_NAME_THE_UPLOAD)
        self._busy("")
        self.show()
        background_tasks.create(self.work.go_on())

    def _build_results(self) -> None:
        self._error = ui.label().classes("card error wide").props("role=alert data-field=error")
        self._progress = ui.label().classes("card wide").props("role=status data-field=progress")
        self._verdict = ui.label().classes("card verdict wide").props("role=status aria-live=polite data-field=verdict")
        with _card("The loop, nominal run"):
            self._loop = _chart("Temperature of the proven loop over time, in °C over seconds", 350)
            self._power = _chart("Power asked for over time, in percent over seconds", 150)
        with _card("Words for the controller", "data-field=words"):
            self._words = _html()
            ui.html("What rounding did", sanitize=False, tag="h2")
            self._rounding = _html()
            self._build_actions()
        with _card("Log and model"):
            self._log = _chart("Log and fitted model, in °C over seconds; shaded: 95 % of its errors", 210)
        with _card("The heater, and what the log leaves open"):
            self._heater = _chart("Rise after 10 % more power, in °C over seconds; shaded: all models", 210)
        with _card("What the log told"):
            self._diagnosis = _html()
        with _card("How it was found"):
            self._notes = _html()
        with _card("Designs side by side", wide=True):
            with ui.element("div").classes("actions"):
                ui.button("Keep this design", on_click=self._pin).props("outline dense")
                self._letters = ui.element("div").classes("actions")
            self._compared = _html()
        with _card("Criteria of the proof", wide=True):
            self._criteria = _html().classes("narrow")

    def _build_actions(self) -> None:
        with ui.element("div").classes("actions"):
            self._optimum = ui.button("Search the optimum", on_click=self._search).props("outline dense")
            self._zip = ui.button("Download words (zip)", on_click=self._download_zip).props("dense")
            self._report = ui.button("Download report", on_click=self._download_report).props("outline dense")
            self._force = ui.checkbox("export whatever the verdict", on_change=self.show).props("dense")

    def _busy(self, message: str) -> None:
        """Tell what takes long; "" where nothing does."""
        self._progress.set_text(message)
        self._progress.set_visibility(bool(message))

    def _tell_error(self, message: str) -> None:
        self.session.refuse_file(InputError(message))
        self.show()

    def _moved(self, **fields: Any) -> None:
        self.session.change(**fields)
        self._show_controls()
        background_tasks.create(self.work.look())

    async def _open(self, source: str) -> None:
        await self.work.open(source)

    async def _dropped(self, event: events.UploadEventArguments) -> None:
        name, content = event.file.name, await event.file.read()
        self._upload.reset()
        await self.work.drop(name, content)

    async def _search(self) -> None:
        self._optimum.disable()
        try:
            await self.work.optimum()
        finally:
            self._optimum.enable()

    def _pin(self) -> None:
        try:
            self.session.pin()
        except HeatertuneError as problem:
            ui.notify(str(problem), type="warning")
        self.show()

    def _unpin(self, name: str) -> None:
        self.session.unpin(name)
        self.show()

    async def _download_zip(self) -> None:
        await self._download(self.work.zip, "zip", "application/zip")

    async def _download_report(self) -> None:
        await self._download(self.work.report, "html", "text/html")

    async def _download(self, make: Any, ending: str, kind: str) -> None:
        session = self.session
        try:
            content = await make(force=bool(self._force.value))
        except HeatertuneError as problem:
            ui.notify(str(problem), type="negative")
            return
        assert session.log is not None
        assert session.look is not None
        ui.download(content, f"{views.export_name(session.log, session.look)}.{ending}", kind)

    def show(self) -> None:
        """Show the session as it is now."""
        session = self.session
        problem = session.file_error or session.error
        self._error.set_text(f"error: {problem}" if problem else "")
        self._error.set_visibility(bool(problem))
        self._show_controls()
        self._show_verdict()
        if session.log is not None and session.fitted is not None:
            self._show_heater()
        look = session.look
        if look is not None:
            for area, content in ((self._words, views.words(look)), (self._rounding, views.rounding(look)),
                                  (self._notes, views.notes(look)),
                                  (self._criteria, views.criteria(session.proof or look.proof))):
                area.set_content(content)
            _draw(self._loop, charts.loop_chart(look, session.pinned))
            _draw(self._power, charts.power_chart(look))
        self._show_pinned()

    def _show_heater(self) -> None:
        session = self.session
        if session.fitted is self._shown_heater or session.log is None or session.fitted is None:
            return
        self._shown_heater = session.fitted
        self._source.set_text(f"{session.log.name}: {len(session.log.time_s)} readings")
        self._controls.suit(sliders_for(session.fitted))
        self._diagnosis.set_content(views.diagnosis(session.log, session.fitted))
        _draw(self._log, charts.log_chart(session.log, session.fitted))
        _draw(self._heater, charts.heater_chart(session.fitted))

    _shown_heater: Any = None

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
        self._zip.set_enabled(verdict == "PASS" or (judged and bool(self._force.value)))
        self._report.set_enabled(judged)
        self._force.set_visibility(judged and verdict != "PASS")

    def _show_pinned(self) -> None:
        pinned = self.session.pinned
        self._compared.set_content(views.compared(pinned))
        self._letters.clear()
        with self._letters:
            for pin in pinned:
                ui.button(f"Let {pin.name} go", on_click=lambda name=pin.name: self._unpin(name)).props("flat dense")


def _card(title: str, props: str = "", *, wide: bool = False) -> ui.element:
    card = ui.element("section").classes(f"card {'wide' if wide else ''}").props(f'aria-label="{title}" {props}')
    with card:
        ui.html(title, sanitize=False, tag="h2")
    return card


def _html() -> ui.html:
    return ui.html("", sanitize=False).classes("scroll")  # every text in it went through report.html.text_of


def _chart(label: str, height: int) -> ui.echart:
    chart = ui.echart({"series": []}, renderer="svg").props(f'role=img aria-label="{label}"')
    return chart.style(f"height: {height}px; width: 100%")


def _draw(chart: ui.echart, options: charts.Options) -> None:
    chart.options.clear()
    chart.options.update(options)
    chart.update()
