"""What the user moves: every control has a name that is read out, its value and its unit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nicegui import ui

from heatertune.pid.tune import STRUCTURES
from heatertune.plc import TARGETS, controller_for
from heatertune.plc.inputs import INPUTS
from heatertune.report.text import figure
from heatertune.studio.settings import SLIDERS, Settings, Slider

__all__ = ["Controls"]

Moved = Callable[..., object]

_PLAIN: Final = "a plain range"


class Controls:
    """The column of controls; `moved` is called with the fields that the user changed."""

    def __init__(self, moved: Moved) -> None:
        self._moved = moved
        self._silent = False
        self._values: dict[str, ui.label] = {}
        self._sliders: dict[str, ui.element] = {}
        self._placed: dict[str, float] = {}
        self._autos: dict[str, ui.checkbox] = {}
        self._target = ui.select(
            list(TARGETS), label="Controller", on_change=lambda e: self._say(target=e.value, input=None)
        ).props("outlined dense options-dense").classes("w-full")
        self._input = ui.select(
            {"": _PLAIN}, label="Analog input", value="", on_change=lambda e: self._say(input=e.value or None)
        ).props("outlined dense options-dense").classes("w-full")
        with ui.element("div").classes("control"):
            ui.label("Structure").classes("field-name").props("aria-hidden=true")
            self._structure = ui.radio(
                {name: name.upper() for name in STRUCTURES}, on_change=lambda e: self._say(structure=e.value)
            ).props('inline dense aria-label="Structure of the controller"')
        for slider in SLIDERS:
            with ui.element("div").classes("control"):
                self._add(slider)

    def _add(self, slider: Slider) -> None:
        with ui.element("div").classes("slider-head"):
            ui.label(slider.label).classes("field-name").props("aria-hidden=true")
            self._values[slider.field] = ui.label().classes("field-value").props("aria-hidden=true")
        with ui.element("div").classes("slider-row"):
            # the browser's own slider: Quasar's takes the focus in a part that has no role and no name
            element = ui.element("input").props("type=range").props(
                f'min={slider.low} max={slider.high} step={slider.step} aria-label="{slider.label}" '
                f"data-field={slider.field}")
            element.on("input", lambda e, field=slider.field: self._slid(field, float(e.args)), throttle=0.05,
                       js_handler="(e) => emit(e.target.value)")
            self._sliders[slider.field] = element
            if slider.auto:
                self._autos[slider.field] = ui.checkbox(
                    "auto", on_change=lambda e, field=slider.field: self._auto(field, on=bool(e.value))
                ).props(f'dense aria-label="{slider.label}: automatic"')

    def _slid(self, field: str, value: float) -> None:
        self._placed[field] = value
        self._say(**{field: round(value, 6)})

    def _say(self, **fields: Any) -> None:
        if not self._silent:
            self._moved(**fields)

    def _auto(self, field: str, *, on: bool) -> None:
        self._say(**{field: None if on else self._placed.get(field)})

    def suit(self, sliders: tuple[Slider, ...]) -> None:
        """Give the sliders the ends that suit a heater."""
        for slider in sliders:
            self._sliders[slider.field].props(f"min={slider.low} max={slider.high}")

    def show(self, settings: Settings, chosen: dict[str, float]) -> None:
        """Show settings; `chosen` holds what the program took where it may choose."""
        self._silent = True  # what is shown was not moved by the user
        try:
            self._target.set_value(settings.target)
            known = {name: INPUTS[name] for name in controller_for(settings.target).ranges}
            self._input.set_options({"": _PLAIN, **known}, value=settings.input or "")
            self._structure.set_value(settings.structure)
            for slider in SLIDERS:
                given = getattr(settings, slider.field)
                value = chosen.get(slider.field) if given is None else given
                if slider.auto:
                    self._autos[slider.field].set_value(given is None)
                if value is not None:
                    self._place(slider, value, given=given is not None)
        finally:
            self._silent = False

    def _place(self, slider: Slider, value: float, *, given: bool) -> None:
        text = f"{figure(value)} {slider.unit}".strip()
        self._values[slider.field].set_text(text)
        element = self._sliders[slider.field]
        element.props(f'aria-valuetext="{text}{"" if given else ", automatic"}"')
        if self._placed.get(slider.field) != value:
            self._placed[slider.field] = value
            # not as a property: Vue would put the slider back to it with every answer, under the user's hand
            element.client.run_javascript(f"getHtmlElement({element.id}).value = {value}")
