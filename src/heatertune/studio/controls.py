"""The controls and card elements of the page: each control has a label for screen readers, a value and a unit.

Banner and words turn grey when they may no longer match the settings. The browser does so in the event that moves a
control, before anything is sent: it counts moves, and each answer of the server says how many it has received and
whether it is still computing.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, Final

from nicegui import ui

from heatertune.pid.tune import STRUCTURES
from heatertune.plc import NAMES, controller_for
from heatertune.plc.inputs import INPUTS
from heatertune.proof.ripple_and_wear import SWITCHES
from heatertune.proof.specification import PRESETS
from heatertune.report.html import text_of
from heatertune.report.report_text import figure
from heatertune.studio.charts import Options
from heatertune.studio.loop_settings import SLIDERS, Slider, StudioSettings
from heatertune.units import terms_in

__all__ = ["MOVE", "MOVED", "NUMBER_SEEN", "Controls", "Grey", "card", "chart", "draw", "explain_label", "html",
           "number_field", "select_field", "text_input"]


_CLIENT: Final = """<script>
window.studio = {
  moves: 0,
  waits: false,
  wait(waits) { this.waits = waits; this.paint(); },
  heard: 0,
  hear(move) { this.heard = move; this.paint(); },
  move() { this.moves += 1; this.paint(); return this.moves; },
  seen() {
    const stale = document.documentElement.hasAttribute('data-stale');
    return stale ? 0 : Number(document.querySelector('[data-number]').dataset.number);
  },
  paint() {
    const told = document.querySelector('[data-computing]')?.dataset;
    const stale = !told || this.waits || told.computing === 'yes' || this.heard < this.moves;
    const areas = document.querySelectorAll(
      '[data-field=banner], [data-field=words], [data-field=as-left], [data-field=drawn]');
    for (const each of [document.documentElement, ...areas]) each.toggleAttribute('data-stale', stale);
  },
  functions(options) {
    for (const [key, value] of Object.entries(options)) {
      if (key.startsWith(':')) options[key.slice(1)] = new Function(`return (${value})`)();
      else if (key !== 'data' && value && typeof value === 'object') this.functions(value);
    }
    return options;
  },
  draw(id, options) {
    const element = getElement(id);
    if (!element?.chart) { setTimeout(() => this.draw(id, options), 20); return; }
    element.chart.setOption(this.functions(options), {replaceMerge: ['series']});
    element.chart.getDom().querySelector('.sketch')?.remove();
    element.chart.drawnTo = [options.xAxis].flat()[0].max;
  },
  // the same picture as plain lines over the chart: the chart's own drawing takes a browser four times as long
  sketch(id, options) {
    const chart = getElement(id)?.chart;
    if (!Number.isFinite(chart?.drawnTo)) { this.draw(id, {...options, title: {text: ''}}); return; }
    const o = this.functions(options), wide = chart.getWidth(), ink = o.yAxis[0].nameTextStyle.color;
    const plain = words => String(words).replace(/[&<>]/g, sign => `&#${sign.charCodeAt(0)};`);
    const text = (x, y, words, anchor = 'middle') =>
      `<text x="${x}" y="${y}" text-anchor="${anchor}">${plain(words)}</text>`;
    const grids = o.grid.map((grid, place) => {
      const {left, top, height} = grid, across = wide - left - grid.right, axis = o.yAxis[place];
      const shown = [0, across].map(x => chart.convertFromPixel({xAxisIndex: place}, left + x) / chart.drawnTo);
      const [from, to] = shown.map(share => share * o.xAxis[place].max);  // as far as the chart is zoomed
      const px = (x) => (x - from) / (to - from) * across, py = (y) => (axis.max - y) / (axis.max - axis.min) * height;
      const at = ([x, y]) => `${px(x).toFixed(1)},${py(y).toFixed(1)}`;
      const line = (a, b, color, more) => `<path d="M${at(a)}L${at(b)}" stroke="${color}" ${more}/>`;
      const rough = (axis.max - axis.min) / 5, unit = 10 ** Math.floor(Math.log10(rough));
      const step = axis.interval || unit * [1, 2, 3, 5, 10].find(times => times * unit > 0.7 * rough);
      let inside = '', outside = text(left - 40, top + 2 - (axis.nameGap ?? 15), axis.name, 'start');
      for (let y = Math.ceil(axis.min / step) * step; y <= axis.max; y += step) {
        inside += line([from, y], [to, y], axis.splitLine.lineStyle.color, '');
        const label = String(Number(y.toPrecision(6)));
        if (axis.interval || (y > axis.min && y < axis.max)) outside += text(left - 8, top + py(y) + 4, label, 'end');
      }
      let free = 0;
      for (const x of place ? o.xAxis[place].axisLabel.customValues : []) {
        const label = o.xAxis[place].axisLabel.formatter(x), half = 3.4 * label.length;
        if (px(x) - half < free || px(x) > across - half) continue;
        outside += text(left + px(x), top + height + 14, label);
        free = px(x) + half + 3;
      }
      if (place) outside += text(left + across / 2, top + height + 32, o.xAxis[place].name);
      for (const series of o.series.filter(each => (each.xAxisIndex ?? 0) === place)) {
        const fill = series.markArea?.itemStyle.color;
        for (const [low, high] of series.markArea?.data ?? []) inside += `<path style="fill: ${fill}" ` +
          `d="M${at(low.coord)}H${px(high.coord[0])}V${py(high.coord[1])}H${px(low.coord[0])}Z"/>`;
        for (const mark of series.markLine?.data ?? []) {
          const color = series.markLine.lineStyle.color;
          if (Array.isArray(mark)) {
            inside += line(mark[0].coord, mark[1].coord, color, 'stroke-dasharray="1 2"');
            continue;
          }
          const x = px(mark.xAxis), {show, formatter, position, distance} = mark.label;
          if (x < 0 || x > across) continue;
          const faint = `opacity="${mark.lineStyle.opacity}"`;
          inside += line([mark.xAxis, axis.min], [mark.xAxis, axis.max], color, faint);
          if (show) outside += text(left + x, position === 'end' ? top + 3 - distance : top + height + 10, formatter);
        }
        const {color, width, type} = series.lineStyle;
        const apart = series.data.map(point => point[0] === null ? null : at(point));
        const dashes = Array.isArray(type) ? type.join(' ') : {dashed: '6 4', dotted: '2 3'}[type] ?? '';
        inside += `<path stroke="${color}" stroke-width="${width}" stroke-dasharray="${dashes}" ` +
          `d="M${apart.join('L').replaceAll('LL', 'M')}"/>`;
      }
      return `<svg x="${left}" y="${top}" width="${across}" height="${height}">${inside}</svg>` +
        `<path d="M${left} ${top}V${top + height}H${left + across}" stroke="${ink}"/><g>${outside}</g>`;
    });
    let sketch = chart.getDom().querySelector('.sketch');
    if (!sketch) chart.getDom().append(sketch = Object.assign(document.createElement('div'), {className: 'sketch'}));
    sketch.innerHTML = `<svg>${grids.join('')}<g>${text(wide - 14, 12, o.title?.text ?? '', 'end')}</g></svg>`;
  },
};
new MutationObserver(() => studio.paint()).observe(
  document, {subtree: true, childList: true, attributeFilter: ['data-computing']});
</script>"""
# by each area's own attribute: a rule that begins at the root makes the browser look at every element again
_LOOK: Final = """
body .card[data-stale] { background: #ececec; border-color: #767676; }
body .verdict[data-stale], body .card[data-stale] :is(.verdict, th, td, code, p, li) { color: #5f5f5f; }
"""
#: what a control says when it was moved: the number of the move, and before it its value
MOVE: Final = "() => emit(studio.move())"
MOVED: Final = "(e) => emit(e.target.value, studio.move())"
#: what a download says: the number of the design that stands beside its button at that moment; grey is no design
NUMBER_SEEN: Final = "() => emit(studio.seen())"


class Grey:
    """What one page tells its browser; elements that may be grey are chosen by the style sheet.

    What belongs to a result goes with it, as properties of the page's tree. A move alone goes as a call: the browser
    would go through all of the tree while the loop's picture is on its way.
    """

    def __init__(self) -> None:
        ui.add_head_html(_CLIENT)
        ui.add_css(_LOOK)
        self._heard = 0
        self._told = ui.element("div").props("hidden data-computing=yes data-number=0")

    def note_moves(self, move: int) -> None:
        """Take how many moves the browser has made, all of them heard by now."""
        self._heard = max(self._heard, move)
        self._call(f"studio.hear({self._heard})")

    def wait(self) -> None:
        """Tell that settings moved; `show` follows."""
        self._call("studio.wait(true)")

    def show(self, *, computing: bool, number: int) -> None:
        """Tell whether something is on its way, and the number of the design that is seen."""
        self._told.props(f"data-computing={'yes' if computing else 'no'} data-number={number}")
        self._call("studio.wait(false)")  # after the properties

    def _call(self, code: str) -> None:
        self._told.client.run_javascript(code)


def card(title: str, props: str = "", *, wide: bool = False) -> ui.element:
    """Return a card with its title."""
    section = ui.element("section").classes(f"card {'wide' if wide else ''}").props(f'aria-label="{title}" {props}')
    with section:
        ui.html(title, sanitize=False, tag="h2")
    return section


def text_input(label: str, example: str) -> ui.input:
    """Return a field for text with an example in it."""
    return ui.input(label, placeholder=example, value="").props("outlined dense stack-label")


def explain_label(label: str) -> str:
    """Return the meaning of the terms of a label, "" where it has none."""
    return "; ".join(f"{term.names[0]}: {term.meaning}" for term in terms_in(label))


def html() -> ui.html:
    """Return a place for HTML; every text in it went through `report.html.text_of`."""
    return ui.html("", sanitize=False).classes("scroll")


def chart(label: str, height_px: int, described_by: str = "") -> ui.echart:
    """Return an empty chart; `described_by`: id of the element that has its numbers in words."""
    element = ui.echart({"series": []}, renderer="svg").classes("chart").style(f"height: {height_px}px; width: 100%")
    described = f" aria-describedby={described_by}" if described_by else ""
    return element.props(f'role=img aria-label="{label}"{described}')


def draw(chart: ui.echart, options: Options, *, sketch: bool = False) -> None:
    """Draw a chart anew: not by a property of the page's tree, all of which a browser would go through.

    Args:
        chart: that is drawn.
        options: what it shows.
        sketch: whether only the lines of a `charts.loop_chart` are drawn, at once; the chart itself has to follow.
    """
    chart.client.run_javascript(f"studio.{'sketch' if sketch else 'draw'}({chart.id}, {json.dumps(options)})")


def select_field(
    name: str, change: str, place: int, options: Mapping[str, str], chosen: str, *, label: str = ""
) -> str:
    """Return a choice of a form, as HTML.

    Args:
        name: for screen readers.
        change: what is changed, and the place of the column or tag that it belongs to.
        place: as `change`.
        options: value → text.
        chosen: the value that is shown.
        label: before it; "": none.
    """
    shown = "".join(
        f'<option value="{text_of(value)}"{" selected" if value == chosen else ""}>{text_of(text)}</option>'
        for value, text in options.items())
    element = (f'<select aria-label="{text_of(name)}" data-change="{change}" data-place="{place}" '
               f'data-key="{change}-{place}">{shown}</select>')
    return f"<label>{label} {element}</label>" if label else element


def number_field(name: str, change: str, place: int, value: object, label: str) -> str:
    """Return a field of a form for a number, as HTML.

    Args:
        name: for screen readers.
        change: what is changed, and the place of the column or tag that it belongs to.
        place: as `change`.
        value: that is shown; None: nothing.
        label: after it.
    """
    text = "" if value is None else text_of(str(value))
    return (f'<label class="number"><input type="text" inputmode="decimal" size="6" value="{text}" '
            f'aria-label="{text_of(name)}" data-change="{change}" data-place="{place}" data-key="{change}-{place}"> '
            f"<span>{text_of(label)}</span></label>")


ChangeCallback = Callable[..., object]

_PLAIN: Final = "a plain range"
_KINDS: Final = {"ssr": "SSR", "contactor": "contactor", "relay": "relay"}
assert set(_KINDS) == set(SWITCHES)
#: the one that is a slider: the others are facts, typed as numbers
_LARGE: Final = next(slider for slider in SLIDERS if slider.field == "ms")
_FACTS: Final = tuple(slider for slider in SLIDERS if slider is not _LARGE)


class Controls:
    """The column of controls; `moved` is called with the fields that the user changed."""

    def __init__(self, moved: ChangeCallback, on_change: Callable[[int], object]) -> None:
        self._moved, self._seen = moved, on_change
        self._silent = False
        self._placed: dict[str, str] = {}
        self._elements: dict[str, ui.element] = {}
        self._radios: dict[str, ui.element] = {}
        self._add_large()
        self._target = self._select("Controller", list(NAMES), lambda value: {"target": value, "input": None})
        self._add_structure()
        with ui.element("details").classes("drawer").props("open"):
            ui.html("Facts of the plant", sanitize=False, tag="summary")
            with ui.element("div").classes("facts"):
                for fact in _FACTS:
                    self._add_fact(fact)
            self._input = self._select("Analog input", {"": _PLAIN}, lambda value: {"input": value or None})
            self._kind = self._select("Switched by", _KINDS, lambda value: {"switch_kind": value})
            self._spec = self._select("Specification", list(PRESETS), lambda value: {"spec": value})

    def _select(self, label: str, options: Any, fields: Callable[[str], dict[str, Any]]) -> ui.select:
        field = ui.select(options, label=label, on_change=lambda e: self._say(**fields(e.value)))
        # after what it says itself: the page is grey until that is heard
        field.on("update:model-value", lambda e: self._seen(e.args), js_handler=MOVE)
        return field.props("outlined dense options-dense").classes("w-full")

    def _add_large(self) -> None:
        meaning = explain_label(_LARGE.label)
        with ui.element("div").classes("large").props(f'title="{meaning}"'):
            with ui.element("div").classes("ends").props("aria-hidden=true"):
                ui.label("calm")
                self._ms = ui.label().classes("field-value")
                ui.label("brisk")
            # the browser's own slider: Quasar's takes the focus in a part that has no role and no name
            element = ui.element("input").props(
                f'type=range min={_LARGE.low} max={_LARGE.high} step={_LARGE.step} data-field={_LARGE.field} '
                f'aria-label="Calm to brisk: largest sensitivity Ms" aria-description="{meaning}"')
            element.on("input", lambda e: self._slid(*e.args), throttle=0.05, js_handler=MOVED)
            self._elements[_LARGE.field] = element

    def _add_structure(self) -> None:
        with ui.element("fieldset").classes("radios") as group:
            ui.html("Structure", sanitize=False, tag="legend")
            for name in STRUCTURES:
                with ui.element("label"):
                    self._radios[name] = ui.element("input").props(f"type=radio name=structure value={name}")
                    ui.html(name.upper(), sanitize=False, tag="span")
        group.on("change", lambda e: self._chose(*e.args), js_handler=MOVED)

    def _add_fact(self, fact: Slider) -> None:
        meaning = explain_label(fact.label)
        with ui.element("label").classes("fact").props(f'title="{meaning}"' if meaning else ""):
            ui.html(fact.label, sanitize=False, tag="span")
            with ui.element("span").classes("typed"):
                element = ui.element("input").props(
                    f"type=text inputmode=decimal size=7 autocomplete=off data-field={fact.field}"
                    + (f' aria-description="{meaning}"' if meaning else ""))
                ui.html(fact.unit, sanitize=False, tag="span")
        element.on("change", lambda e, fact=fact: self._typed(fact, *e.args), js_handler=MOVED)
        self._elements[fact.field] = element

    def _slid(self, text: str, move: int) -> None:
        self._placed[_LARGE.field] = text
        self._say(ms=round(float(text), 6))
        self._seen(move)

    def _chose(self, structure: str, move: int) -> None:
        self._say(structure=structure)
        self._seen(move)

    def _typed(self, fact: Slider, text: str, move: int) -> None:
        """Move what was typed; nothing is automatic where that can be, and else, like no number, put back."""
        self._placed[fact.field] = text
        is_nothing = not text.strip()
        try:
            value = None if is_nothing else float(text.replace(",", "."))
        except ValueError:
            value = None
        if value is not None or (is_nothing and fact.auto):
            self._say(**{fact.field: value})
        else:
            self._say()
        self._seen(move)

    def _say(self, **fields: Any) -> None:
        if not self._silent:
            self._moved(**fields)

    def show_move(self, settings: StudioSettings) -> None:
        """Show where the large slider stands, in the browser alone."""
        self._place(_LARGE, settings.ms, None)

    def show(self, settings: StudioSettings, chosen: dict[str, float]) -> None:
        """Show settings; `chosen` holds what the program took where it may choose."""
        self._silent = True  # what is shown was not moved by the user
        try:
            self._target.set_value(settings.target)
            ranges = {name: INPUTS[name] for name in controller_for(settings.target).ranges}
            self._input.set_options({"": _PLAIN, **ranges}, value=settings.input or "")
            self._kind.set_value(settings.switch_kind)
            self._spec.set_value(settings.spec)
            for name, element in self._radios.items():
                self._set(f"structure {name}", element, "checked", "true" if name == settings.structure else "false")
            for slider in SLIDERS:
                self._place(slider, getattr(settings, slider.field), chosen.get(slider.field))
        finally:
            self._silent = False

    def _place(self, slider: Slider, value: float | None, chosen: float | None) -> None:
        element = self._elements[slider.field]
        if slider is _LARGE:
            assert value is not None
            self._set(slider.field, element, "value", f"{value:g}")
            self._set("its text", self._ms, "textContent", f"Ms {figure(value)}")
            self._set("its text for readers", element, "ariaValueText", f"Ms {figure(value)}")
            return
        auto = "" if chosen is None else f"{figure(chosen)} auto"
        element.props(f'placeholder="{auto}"')
        self._set(slider.field, element, "value", "" if value is None else f"{value:g}")

    def _set(self, name: str, element: ui.element, attribute: str, value: str) -> None:
        """Set what the browser holds; not as a property: Vue would put it back under the user's hand."""
        if self._placed.get(name) != value:
            self._placed[name] = value
            literal = value if attribute == "checked" else f'"{value}"'
            element.client.run_javascript(f"getHtmlElement({element.id}).{attribute} = {literal}")
