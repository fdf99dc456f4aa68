"""The card of several zones in one log: their request, heaters, joint proof, and parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from nicegui import ui

from heatertune.errors import HeatertuneError, InputError
from heatertune.settings import ReadSettings
from heatertune.studio import views
from heatertune.studio.background_work import Work
from heatertune.studio.controls import card, chart, draw, html, text_input
from heatertune.studio.wording import for_page
from heatertune.studio.zones_design import (
    DesignedZones,
    ZonesRequest,
    criteria_html,
    heaters_html,
    parameters_html,
    request_html,
    typed_numbers,
    verdict_lines,
    zones_charts,
    zones_key,
)

__all__ = ["ZonesCard"]

_NEIGHBOURS: Final = {"": "as the log shows", "chain": "chain", "ring": "ring", "free": "each with each"}
_TEMPERATURES_PX: Final = 260
_POWERS_PX: Final = 170


class ZonesCard:
    """A card that is seen once a log has several zones: their request, heaters, joint proof, and parameters.

    Args:
        work: that designs them.
        reading: how the user has the sheet of the file read.
    """

    def __init__(self, work: Work, reading: Callable[[], ReadSettings]) -> None:
        self._work, self._reading = work, reading
        self._offered: tuple[str, ...] = ()
        self._shown: DesignedZones | None = None
        with card("Zones: heaters that belong together", "data-field=zones", wide=True) as self._card:
            self._card.classes("live")
            self._form()
            self._error = ui.label().classes("error").props("role=alert data-field=zones-error")
            with ui.element("div") as self._result:
                self._verdict = ui.label().classes("verdict").props("role=status data-field=zones-verdict")
                self._reasons = html()
                self._temperatures = chart("Temperatures of all zones heated up together, setpoints dotted, in °C over "
                                           "seconds", _TEMPERATURES_PX, "zone-criteria")
                self._powers = chart("Requested power of all zones, in percent over seconds", _POWERS_PX,
                                     "zone-criteria")
                self._key, self._heaters, self._parameters = html(), html(), html()
                with ui.element("div").classes("actions"):
                    ui.button("Download programs (zip)", on_click=self._download).props("dense")
                    ui.button("Download the record", on_click=self._record).props("outline dense")
                    self._force = ui.checkbox("export even if the verdict is not PASS").props("dense")
                self._criteria, self._request = html().props("id=zone-criteria"), html()
        self.show()

    def _form(self) -> None:
        ui.html("<p>Fitted, tuned and proven together, for the controller, structure, intervals, range and "
                "specification of the settings; Ms and noise are those of zones.</p>", sanitize=False)
        with ui.element("div").classes("fields") as self._fields:
            self._names = text_input("Names of the zones", "front, middle, back")
            self._setpoints = text_input("Setpoints, in °C", "as set, or as logged")
            self._neighbours = ui.select(_NEIGHBOURS, value="", label="Zones exchange heat").props(
                "outlined dense options-dense")
            self._deviation = text_input("A neighbour may leave its setpoint by, in °C", "40 % of a change")
            self._spread = text_input("Zones may be apart while heating up by, in °C", "no limit")
            self._rated = text_input("Full power of each heater, in kW", "3, 5, 3")
            self._peak = text_input("Most power of all heaters at once, in kW", "no limit")
            self._stagger = ui.checkbox("PWM periods begin one after the other").props("dense")
        with ui.element("div").classes("actions"):
            self._start = ui.button("Design all zones", on_click=self._begin).props("dense")
            ui.button("Put it away", on_click=self._put_away).props("outline dense")

    async def _begin(self) -> None:
        try:
            request = ZonesRequest(
                files=self._work.zone_files, zones=tuple(name.strip() for name in self._names.value.split(",")),
                settings=self._work.session.settings, reading=self._reading(), setpoints=self._setpoints.value,
                rated_kw=self._rated.value, neighbours=self._neighbours.value, staggered=self._stagger.value,
                deviation_degC=_typed("neighbour's deviation", self._deviation.value),
                peak_kw=_typed("most power", self._peak.value), spread_degC=_typed("spread", self._spread.value))
        except HeatertuneError as problem:
            self._work.zones_error = str(problem)
            self.show()
        else:
            await self._work.design_zones(request)

    def show(self) -> None:
        """Show the zones as they are now."""
        design, error = self._work.zones, self._work.zones_error
        files = self._work.zone_files
        self._card.set_visibility(bool(files or design or error))
        for element in (self._fields, self._start):
            element.set_visibility(bool(files))
        if self._work.zone_names != self._offered:
            self._offered = self._work.zone_names
            self._names.set_value(", ".join(self._offered))
        self._error.set_text(f"error: {for_page(error)}" if error else "")
        self._error.set_visibility(bool(error))
        self._result.set_visibility(design is not None)
        if design is not None and design is not self._shown:
            self._show_design(design)

    def _show_design(self, design: DesignedZones) -> None:
        self._shown, proof = design, design.proof
        first, reasons = verdict_lines(proof)
        self._verdict.set_text(first)
        self._verdict.classes(remove="pass fail not-proven", add=proof.verdict.lower().replace(" ", "-"))
        self._force.set_visibility(proof.verdict != "PASS")
        for area, content in ((self._reasons, reasons), (self._heaters, heaters_html(proof.fitted)),
                              (self._parameters, parameters_html(proof)), (self._criteria, criteria_html(proof)),
                              (self._key, views.key(zones_key(proof.fitted.network.zones), walls=False)),
                              (self._request, request_html(design.request))):
            area.set_content(content)
        for element, options in zip((self._temperatures, self._powers), zones_charts(proof), strict=True):
            draw(element, options)

    def _download(self) -> None:
        design = self._work.zones
        if design is not None:
            try:
                ui.download(design.zip(force=bool(self._force.value)), "zones.zip", "application/zip")
            except HeatertuneError as problem:
                ui.notify(for_page(str(problem)), type="negative")

    def _record(self) -> None:
        design = self._work.zones
        if design is not None:
            content = design.files(force=bool(self._force.value))["record.html"]
            ui.download(str(content).encode(), "record.html", "text/html")

    def _put_away(self) -> None:
        self._work.put_zones_away()


def _typed(name: str, text: str) -> float | None:
    numbers = typed_numbers(name, text)
    if len(numbers) > 1:
        raise InputError(f"{name} {text}: expected one number, with a decimal point")
    return numbers[0] if numbers else None
