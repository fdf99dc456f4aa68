"""Values → options of the page's charts (Apache ECharts): a unit on every axis, names beside the lines.

The preview of a dropped log is a drawing of its own (SVG), over which a part can be chosen.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.heater.exact import since_step
from heatertune.log.log_values import Log
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.pid.search.robust import interval_ends
from heatertune.proof.as_left import AsLeft
from heatertune.report.html import text_of
from heatertune.report.plots import LOOK
from heatertune.studio.live_log import RecordedTrace
from heatertune.studio.loop_settings import LoopView
from heatertune.studio.proof_picture import Line, Picture, course_of, downsample, parts_of, step_corners, straight
from heatertune.studio.session import PinnedDesign

__all__ = ["DRAGGED", "Options", "heater_chart", "key_of", "left_chart", "line_chart", "line_series", "live_charts",
           "log_chart", "loop_chart", "preview", "zooms"]

Options = dict[str, Any]

_PIECES: Final = 100  # that lines are made of, at least
_MOST_NAMED: Final = 100  # instants of the axis; a tenth of them finds room
_PIXELS: Final = 3000  # of the whole story, which is zoomed to a tenth
_STEP_PCT: Final = 10.0
_LAGS: Final = 4.0  # times the slowest lag: 98 % of a step
_PIN_LINES: Final = ("dashed", "dotted", [8, 2, 2, 2], [2, 6])
_INK: Final = "#1a1a1a"
_PIN: Final = "#595959"
_CROWD: Final = "#8c8c8c"
_WALL: Final = "rgba(163, 60, 0, 0.13)"
_DASHES: Final = {"ideal": "6 3", "worst": "7 2 2 2"}
#: text of a crosshair: each line's own value there, not that of its nearest point; %s: place → instant
_POINTED_AT: Final = """found => { const x = found[0].axisValue, instant = %s;
  const at = (points) => { const i = points.findIndex(p => p[0] >= x); if (i < 1) return points[Math.max(i, 0)][1];
    const [[a, y], [b, z]] = [points[i - 1], points[i]]; return b > a ? y + (z - y) * (x - a) / (b - a) : z; };
  const chart = getElement(Number(document.querySelector(".loop-chart").id.slice(1)));
  const seen = chart.chart.getOption().series.filter(s => s.data.length && !(s.tooltip && s.tooltip.show === false));
  const rows = seen.map(s => `${s.name}: <b>${at(s.data).toFixed(1)} ${s.yAxisIndex ? "%%" : "°C"}</b>`);
  return [`${instant(x)} s`, ...rows].join("<br>"); }"""
#: what a picture says that does not show all of a test sequence yet
OPENING: Final = "heat-up and first event alone, less time at rest; the whole test sequence follows"
_BAND: Final = 1.96  # of a normal distribution, 95 %
_FAILING_PX: Final = 2.6  # width of the line of the run that breaks a limit
_APART: Final = 0.06  # of the axis: room for a number of two digits in a picture of a telephone
_LINES_OF_NUMBERS: Final = 3
_LINE_PX: Final = 12
_WIDE, _HIGH, _LOW = 640, 150, 34  # of the preview: its width, the temperature's height, the power's
_EDGE: Final = 8
#: of the browser, for `preview`: a drag over the picture chooses the part that is fitted, a click all of it
DRAGGED: Final = """(e) => { const svg = e.target.closest && e.target.closest(".preview svg"); if (!svg) return;
  e.preventDefault(); svg.setPointerCapture(e.pointerId);
  const box = svg.getBoundingClientRect(), share = (p) => Math.min(Math.max((p.clientX - box.left) / box.width, 0), 1);
  const [left, right] = svg.querySelectorAll(".outside"), wide = svg.viewBox.baseVal.width, begun = share(e);
  const first = Number(svg.dataset.first), span = Number(svg.dataset.last) - first;
  const ends = (p) => [Math.min(begun, share(p)), Math.max(begun, share(p))];
  const shade = (p) => { const [a, b] = ends(p); left.setAttribute("width", a * wide);
    right.setAttribute("x", b * wide); right.setAttribute("width", (1 - b) * wide); };
  const instant = (at) => (first + at * span).toPrecision(4);
  svg.onpointermove = shade;
  svg.onpointercancel = () => { svg.onpointermove = svg.onpointerup = null; emit(["window", 0, " ", "from_s-0"]); };
  svg.onpointerup = (p) => { svg.onpointermove = svg.onpointerup = null; const [a, b] = ends(p);
    emit(["window", 0, b - a < 0.01 ? " " : `${instant(a)} ${instant(b)}`, "from_s-0"]); }; }"""


def log_chart(log: Log, fitted: FittedModel) -> Options:
    """Return log, model and the band in which 95 % of the model's errors lie."""
    points = downsample(log.time_s, log.temperature_degC, _PIXELS)
    measured = line_series("log", log.time_s[points], log.temperature_degC[points], "log")
    lines = [_named(measured, "log", lower=-1)]  # both end at one point
    residuals = fitted.residuals
    if residuals is not None:
        wide = _BAND * float(np.sqrt(np.mean((residuals.measured_degC - residuals.simulated_degC) ** 2)))
        points = downsample(residuals.time_s, residuals.simulated_degC, _PIXELS)
        time, simulated = residuals.time_s[points], residuals.simulated_degC[points]
        model = line_series("model", time, simulated, "model")
        lines += [*_band(time, simulated - wide, simulated + wide), _named(model, "model")]
    return line_chart("time [s]", "temperature [°C]", lines)


def preview(log: Log, window: tuple[float, float] | None = None) -> str:
    """Return the log as a small picture: temperature, and below it power where it is logged.

    Args:
        log: the log.
        window: first and last instant that are fitted [s]; what lies outside is shaded; None: all of it.
    """
    time, temperature, signal = log.time_s, log.temperature_degC, log.signals.get("power")
    power_s, power = (time, None) if signal is None else signal.until(float(time[-1]))
    low, high = float(temperature.min()), float(temperature.max())
    below = 0 if power is None else _LOW + _EDGE
    caption = (f"Temperature from {low:.4g} to {high:.4g} °C in {time[-1] - time[0]:.4g} s"
               + ("" if power is None else f", power from {power.min():.4g} to {power.max():.4g} %"))
    lines = _path(time, temperature, (low, high), (_EDGE, _HIGH), "temperature")
    if power is not None:
        lines += _path(power_s, power, (0.0, 100.0), (_HIGH + _EDGE, _HIGH + _EDGE + _LOW), "power", fixed=True)
    first, last, high_px = float(time[0]), float(time[-1]), _HIGH + below + _EDGE
    begin, end = ((at - first) / (last - first) * _WIDE for at in window or (first, last))
    shades = "".join(f'<rect class="outside" x="{x:.1f}" y="0" width="{max(wide, 0.0):.1f}" height="{high_px}"/>'
                     for x, wide in ((0.0, begin), (end, _WIDE - end)))
    return (f'<figure class="preview"><svg viewBox="0 0 {_WIDE} {high_px}" role="img" data-first="{first:g}" '
            f'data-last="{last:g}" aria-label="{text_of(caption)}">{lines}{shades}</svg>'
            f"<figcaption>{text_of(caption)}</figcaption></figure>")


def _path(
    time: Array, values: Array, range_: tuple[float, float], place: tuple[float, float], kind: str, *,
    fixed: bool = False,
) -> str:
    (low, high), (top, bottom) = range_, place
    time, values = step_corners(time, values) if fixed else (time, values)
    points = downsample(time, values, _WIDE // 2)
    x, y = time[points], values[points]
    across = (x - time[0]) / (time[-1] - time[0]) * _WIDE
    down = bottom - (y - low) / max(high - low, 1e-9) * (bottom - top)
    return f'<polyline class="{kind}" points="{_points(across, down)}"/>'


def _points(x: Sequence[float] | Array, y: Sequence[float] | Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def live_charts(trace: RecordedTrace) -> tuple[Options, Options | None]:
    """Return temperature and setpoint of a loop that is being recorded, and its power, None where it shows none."""
    def line(name: str, values: Array, look: str) -> Options:
        return _with_gaps(line_series(name, trace.time_s, values, look), trace.part)

    lines = [line("temperature", trace.temperature_degC, "log")]
    if np.isfinite(trace.setpoint_degC).all():
        setpoint = line("setpoint", trace.setpoint_degC, "limit") | {"step": "end"}
        lines.append(_named(setpoint, "limit", lower=-1))
    power = line_chart("time [s]", "power [%]", [line("power", trace.power_pct, "log")])
    power["yAxis"] |= {"min": 0 if np.min(trace.power_pct) >= 0.0 else -100, "max": 100}
    return line_chart("time [s]", "temperature [°C]", lines), power if np.isfinite(trace.power_pct).all() else None


def _with_gaps(line: Options, part: Array) -> Options:
    """Return a line that is broken where its part changes."""
    data = line["data"]
    for place in reversed(np.flatnonzero(np.diff(part)) + 1):
        data.insert(int(place), [None, None])
    return line | {"connectNulls": False}


def left_chart(left: AsLeft) -> Options:
    """Return the trace over the band of the proven runs, what is outside of it shaded."""
    low, high, log = {"color": _CROWD, "width": 0.7}, left.high_degC, LOOK["log"]
    width = [top - bottom for bottom, top in zip(left.low_degC, high, strict=True)]
    stacked = {"stack": "band", "stackStrategy": "all", "lineStyle": {"opacity": 0.0}, "tooltip": {"show": False}}
    mark_line = {"silent": True, "symbol": "none", "lineStyle": {"color": LOOK["limit"]["color"]}, "data": [
        {"yAxis": left.setpoint_degC, "label": {"formatter": "setpoint", "position": "insideStartTop", "color": _INK}}]}
    shaded = {"silent": True, "itemStyle": {"color": _WALL}, "data": [
        [{"xAxis": stretch.begin_s}, {"xAxis": stretch.end_s}] for stretch in left.outside]}
    text = {"color": _INK, "fontSize": 12}
    ends = text | {"showMinLabel": False, "showMaxLabel": False}
    axis = {"type": "value", "nameTextStyle": text, "axisLabel": ends, "splitLine": {"lineStyle": {"color": "#dddddd"}}}
    return {
        "animation": False, "grid": {"left": 52, "right": 20, "top": 30, "bottom": 42},
        "tooltip": {"trigger": "axis", "confine": True, ":valueFormatter": "v => v.toFixed(1) + ' °C'"},
        "xAxis": axis | {"name": "time since the setpoint change [s]", "nameLocation": "middle", "nameGap": 26,
                         "min": "dataMin", "max": "dataMax", "axisLine": {"onZero": False}},
        "yAxis": axis | {"name": "temperature [°C]", "scale": True, "axisLine": {"onZero": False},
                         "nameTextStyle": text | {"align": "left", "padding": [0, 0, 0, -40]}},
        "series": [
            _left_line("", left.band_s, left.low_degC, stacked),
            _left_line("", left.band_s, width, stacked | {"areaStyle": {"color": _CROWD, "opacity": 0.35}}),
            _left_line("lowest of the proven runs", left.band_s, left.low_degC, {"lineStyle": low}),
            _left_line("highest of the proven runs", left.band_s, high, {"lineStyle": low}),
            _left_line("measured", left.time_s, left.temperature_degC, {
                "lineStyle": {"color": log["color"], "width": 1.4}, "itemStyle": {"color": log["color"]}, "z": 3,
                "markLine": mark_line, "markArea": shaded}),
        ],
    }


def _left_line(name: str, time_s: Sequence[float], values: Sequence[float], document: Options) -> Options:
    points = [list(point) for point in zip(time_s, values, strict=True)]
    look = {"type": "line", "showSymbol": False, "itemStyle": {"color": _CROWD}}
    return {**look, "name": name, "data": points, **document}


def heater_chart(fitted: FittedModel) -> Options:
    """Return what 10 % more power does on the working model, and between which curves the log leaves it open."""
    models = (fitted.model, *fitted.plants, *interval_ends(fitted))
    time = np.linspace(0.0, _LAGS * sum(fitted.model.lags_s) + fitted.model.dead_time_s, 120)
    rises = np.array([_rise(model, time) for model in models])
    model = _named(line_series("model", time, rises[0], "model"), "model")
    lines = [*_band(time, rises.min(axis=0), rises.max(axis=0)), model]
    return line_chart("time [s]", f"rise after {_STEP_PCT:g} % more power [°C]", lines)


def _rise(model: HeaterModel, time: Array) -> Array:
    covered, _ = since_step(np.maximum(time - model.dead_time_s, 0.0), *model.lags_s)
    return np.asarray(_STEP_PCT * model.gain_degC_per_pct * covered)


class _Detail(NamedTuple):
    """How exactly lines are drawn.

    Attributes:
        pixels: of the whole story.
        pointed: instants of the nominal run at which a crosshair stands, at least.
        within: of the temperature's span.
        within_pct: of the power.
    """

    pixels: int
    pointed: int
    within: float
    within_pct: float


_FINE: Final = _Detail(_PIXELS, 500, 0.001, 0.3)  # a quarter of a pixel
_COARSE: Final = _Detail(_PIXELS // 2, 120, 0.004, 1.0)  # a pixel, with half the points


def loop_chart(
    look: LoopView, picture: Picture, pinned: Sequence[PinnedDesign] = (), *, coarse: bool = False
) -> Options:
    """Return temperature and power of the loop over one time axis: nominal run, wish, designs kept, and the proof's.

    Args:
        look: the loop.
        picture: of its proof, or of its first look; it tells which times at rest are left out.
        pinned: designs kept.
        coarse: without the wish and to a pixel of the whole story, as long as a control moves; else so that it bears
            a zoom.
    """
    proof, detail = look.proof, _COARSE if coarse else _FINE
    nominal = proof.nominal
    course = course_of(nominal, proof, detail.pixels, coarse=coarse)
    words = _over(picture, "nominal run", course, "realised", detail.within, detail.pointed)
    words["z"] = 4  # over the worst run
    lines = [words]
    if picture.worst is not None:
        lines.append(_worst(picture, picture.worst[1], detail.within))
    if not coarse and look.wish is not None:
        wish = course_of(look.wish, proof, detail.pixels)
        lines.append(_over(picture, "unrounded wish", wish, "ideal", detail.within))
    for pin, kind in zip(pinned, _PIN_LINES, strict=False):
        lines.append(_over(
            picture, f"design {pin.name}", _aligned(pin, picture), "other", detail.within, kind=kind, color=_PIN))
    values = np.concatenate([[point[1] for point in line["data"]] for line in lines] + [y for _, y in picture.crowd])
    low, high = float(values.min()), float(values.max())
    room = 0.06 * (high - low)
    words["markArea"] = _walls(picture, low - room, high + room)
    words["markLine"] = _setpoint_and_parts(picture)
    request = step_corners(nominal.time_s, nominal.power_asked_pct)
    points = downsample(picture.place(request[0]), request[1], detail.pixels)
    share = detail.within_pct / max(float(np.ptp(request[1])), detail.within_pct)
    power = _over(picture, "requested power", (request[0][points], request[1][points]), "realised", share)
    crowd = [_crowd(picture)] if picture.crowd else []
    second = {"xAxisIndex": 1, "yAxisIndex": 1}
    options = _two_grids([*crowd, *lines, power | second], picture, end_s=float(nominal.time_s[-1]))
    options["yAxis"][0] |= {"min": round(low - room, 1), "max": round(high + room, 1)}
    if nominal.actuator.cooling_gain is not None:
        options["yAxis"][1] |= {"min": -100, "interval": 100}
    if look.is_opening:  # a sketch shows it, the chart that follows bears all
        options["title"] = {"text": OPENING}
    return options


def zooms(picture: Picture) -> list[tuple[str, float, float]]:
    """Return the parts of the story that the picture can be zoomed to: name, begin and end on its axis."""
    begins = picture.place([part.begin_s for part in picture.parts]).tolist()
    ends = [*begins[1:], float(picture.place(picture.parts[-1].end_s))]
    names = (f"{number} {part.name}" for number, part in enumerate(picture.parts, 1))
    phases = zip(names, begins, ends, strict=True)
    return [("whole story", 0.0, ends[-1]), *((name, begin, end - 1e-3 * (end - begin)) for name, begin, end in phases)]


def key_of(look: LoopView, picture: Picture, pinned: Sequence[PinnedDesign] = ()) -> list[tuple[str, str, str]]:
    """Return the legend of the loop's picture: name, colour and SVG dashes."""
    names = [("nominal run", LOOK["realised"]["color"], "")]
    if picture.worst is not None:
        dashes = "" if picture.fails else _DASHES["worst"]
        worst = f"{picture.called}: {picture.worst[0]}", LOOK["worst"]["color"], dashes
        names.insert(0 if picture.fails else 1, worst)
    names += [] if look.realised is None else [("unrounded wish", LOOK["ideal"]["color"], _DASHES["ideal"])]
    names += [(f"all {picture.runs} runs", _CROWD, "")] if picture.runs > 1 else []
    return [*names, *((f"design {pin.name}", _PIN, "6 4") for pin in pinned)]


def _over(
    picture: Picture, name: str, line: Line, look: str, within: float, pieces: int = _PIECES, **right: Any
) -> Options:
    """Return a line over the picture's axis, without points that nobody would miss, `within` of its span."""
    across, values = picture.place(line[0]), line[1]
    points = straight(across, values, within * float(np.ptp(values)), pieces)
    return line_series(name, across[points], values[points], look, **right)


def _worst(picture: Picture, line: Line, within: float) -> Options:
    """Return the line of the worst run; what a FAIL is about comes first."""
    worst = _over(picture, picture.called, line, "worst", within)
    if picture.fails:
        worst |= {"z": 5, "lineStyle": {**worst["lineStyle"], "width": _FAILING_PX, "type": "solid"}}
    return worst


def _aligned(pin: PinnedDesign, picture: Picture) -> Line:
    """Return the nominal run of a design that was kept, each event where it is in the picture."""
    proof = pin.look.proof
    time, temperature = course_of(proof.nominal, proof)
    own = parts_of(proof.nominal, proof)
    if [part.name for part in own] != [part.name for part in picture.parts]:  # another story
        return time, temperature
    pieces = [(time >= part.begin_s) & (time < part.end_s) & (time < part.begin_s + there.end_s - there.begin_s)
              for part, there in zip(own, picture.parts, strict=True)]
    moved = [time[piece] - part.begin_s + there.begin_s
             for piece, part, there in zip(pieces, own, picture.parts, strict=True)]
    return np.concatenate(moved), np.concatenate([temperature[piece] for piece in pieces])


def _crowd(picture: Picture) -> Options:
    """Return all runs as one series, a gap between two of them."""
    data: list[list[float | None]] = []
    for time, values in picture.crowd:
        across = np.round(picture.place(time)).astype(np.intp).tolist()
        data += [*map(list, zip(across, values.tolist(), strict=True)), [None, None]]
    return {
        "type": "line", "name": f"all {picture.runs} runs", "showSymbol": False, "silent": True, "z": 2, "data": data,
        "lineStyle": {"color": _CROWD, "width": 0.7}, "tooltip": {"show": False}, "connectNulls": False}


def _walls(picture: Picture, low: float, high: float) -> Options:
    data = []
    ends = picture.place([(wall.begin_s, wall.end_s) for wall in picture.walls]).round(1).tolist()
    for wall, (begin, end) in zip(picture.walls, ends, strict=True):
        bottom, top = max(wall.low_degC, low), min(wall.high_degC, high)
        if bottom < top:
            data.append([{"coord": [begin, round(bottom, 2)]}, {"coord": [end, round(top, 2)]}])
    return {"silent": True, "itemStyle": {"color": _WALL}, "data": data}


def _setpoint_and_parts(picture: Picture) -> Options:
    """Return the setpoint of each part, where each part begins, by number, and where a time at rest is left out."""
    ink, data = LOOK["limit"]["color"], list[Any]()
    lines = _lines_of_numbers(picture)
    places = picture.place([(part.begin_s, part.end_s) for part in picture.parts]).round(1).tolist()
    for number, (part, (begin, end)) in enumerate(zip(picture.parts, places, strict=True), 1):
        data.append([{"coord": [begin, part.setpoint_degC], "lineStyle": {"type": "dotted"}},
                     {"coord": [end, part.setpoint_degC]}])
        if part.begin_s > 0.0:
            line = lines.get(number)
            data.append({"xAxis": begin, "lineStyle": {"type": "solid", "width": 1, "opacity": 0.5}, "label": {
                "show": line is not None, "formatter": str(number), "position": "end", "color": _INK, "opacity": 1,
                "fontSize": 11, "distance": 2 + _LINE_PX * (line or 0)}})
    for begin in picture.place([begin for begin, _ in picture.torn]).round(1).tolist():
        data.append({"xAxis": begin, "lineStyle": {"opacity": 0}, "label": {
            "show": True, "formatter": "//", "position": "start", "color": _INK, "opacity": 1, "fontSize": 11,
            "distance": 1}})
    return {"silent": True, "symbol": "none", "lineStyle": {"color": ink}, "label": {"show": False}, "data": data}


def _lines_of_numbers(picture: Picture) -> dict[int, int]:
    """Return number of a part → in which line above the picture it stands; one that finds no room is left out."""
    ends = [-math.inf] * _LINES_OF_NUMBERS
    room = _APART * float(picture.place(picture.parts[-1].end_s))
    lines = dict[int, int]()
    places = picture.place([part.begin_s for part in picture.parts]).tolist()
    for number, place in enumerate(places, 1):
        free = next((line for line, end in enumerate(ends) if place >= end), None)
        if free is not None:
            lines[number], ends[free] = free, place + room
    return lines


def _instants(picture: Picture, end_s: float) -> list[float]:
    """Return round instants that the axis may name; those that find no room are not."""
    least = float(picture.place(end_s)) / _MOST_NAMED
    decade = 10.0 ** math.floor(math.log10(least))
    step = next(times * decade for times in (1.0, 2.0, 5.0, 10.0) if times * decade >= least)
    instants = np.arange(0.0, end_s, step)
    is_visible = np.all([(instants <= begin) | (instants >= end) for begin, end in picture.torn], axis=0)
    return [float(instant) for instant in instants[is_visible]]


def _two_grids(lines: Sequence[Options], picture: Picture, *, end_s: float) -> Options:
    """Return temperature above power, with one crosshair and one zoom over both."""
    upper = line_chart("time [s]", "temperature [°C]", lines)
    ticks = {"customValues": np.round(picture.place(_instants(picture, end_s)), 1).tolist()}
    axis_x = upper["xAxis"] | {"min": 0, "max": round(float(picture.place(end_s)), 1), "splitLine": {"show": False},
                               "axisTick": ticks}
    axis_x["axisLabel"] = axis_x["axisLabel"] | ticks | {":formatter": _instant_of(picture)}
    axis_y, pointed = upper["yAxis"], f"p => ({_instant_of(picture)})(p.value) + ' s'"
    left, right = 52, 14
    return upper | {
        "grid": [{"left": left, "right": right, "top": 58, "height": 250, "outerBoundsMode": "none"},
                 {"left": left, "right": right, "top": 348, "height": 80, "outerBoundsMode": "none"}],
        "xAxis": [axis_x | {"name": "", "axisLabel": {"show": False}, "axisTick": {"show": False},
                            "axisPointer": {"label": {"show": False}}},
                  axis_x | {"gridIndex": 1, "axisPointer": {"label": {":formatter": pointed}}}],
        "yAxis": [axis_y | {"nameGap": 4 + _LINE_PX * _LINES_OF_NUMBERS},
                  axis_y | {"gridIndex": 1, "name": "requested power [%]", "min": 0, "max": 100,
                                    "interval": 50, "scale": False, "axisLabel": {"color": _INK, "fontSize": 12}}],
        "axisPointer": {"link": [{"xAxisIndex": "all"}], "snap": False},
        "tooltip": {"trigger": "axis", "confine": True, "axisPointer": {"type": "cross"},
                    ":formatter": _POINTED_AT % _instant_of(picture)},
        "dataZoom": [{"type": "inside", "xAxisIndex": [0, 1], "zoomOnMouseWheel": "ctrl", "filterMode": "none"},
                     {"type": "slider", "xAxisIndex": [0, 1], "bottom": 2, "height": 24, "filterMode": "none",
                      "showDataShadow": False, "showDetail": False}],
    }


def _instant_of(picture: Picture) -> str:
    """Return the browser's function: place on the axis → instant [s], as text."""
    gaps = [[round(float(picture.place(begin)), 1), round(end - begin, 1)] for begin, end in picture.torn]
    return f"v => String(Math.round({json.dumps(gaps)}.reduce((t, [at, lost]) => v > at ? t + lost : t, v)))"


def _named(line: Options, look: str, lower: int = 0) -> Options:
    """Return a line with its name at its end, so many lines of text lower."""
    letters = {"show": True, "formatter": line["name"], "color": LOOK[look]["color"], "distance": 4,
               "offset": [0, 13 * lower]}
    return line | {"endLabel": letters}


def line_series(name: str, time: Array, values: Array, look: str, *, kind: Any = None, color: str = "") -> Options:
    """Return a line.

    Args:
        name: as a key or crosshair shows it.
        time: instants, shape (n,) [s].
        values: at the instants, shape (n,).
        look: one of `heatertune.report.plots.LOOK`.
        kind: dashes, as ECharts names them; None: those of the look.
        color: "": that of the look.
    """
    style = LOOK[look]
    color, dashes = color or style["color"], [int(length) for length in _DASHES.get(look, "").split()]
    return {
        "type": "line", "name": name, "showSymbol": False, "silent": True, "z": 3,
        "data": np.column_stack([np.round(time, 2), np.round(values, 3)]).tolist(), "itemStyle": {"color": color},
        "lineStyle": {"color": color, "width": style["linewidth"], "type": kind or dashes or "solid"},
    }


def _band(time: Array, low: Array, high: Array) -> list[Options]:
    """Return two stacked lines: the lower end, invisible, and the shaded width above it."""
    color = LOOK["model"]["color"]
    hidden = {"type": "line", "showSymbol": False, "silent": True, "stack": "band", "stackStrategy": "all", "z": 1,
              "lineStyle": {"opacity": 0.0}}
    data = [np.column_stack([np.round(time, 2), np.round(y, 3)]).tolist() for y in (low, high - low)]
    return [hidden | {"name": "band, low", "data": data[0]},
            hidden | {"name": "band, width", "data": data[1], "areaStyle": {"color": color, "opacity": 0.2}}]


def line_chart(x: str, y: str, lines: Sequence[Options]) -> Options:
    """Return a chart of lines; `x` and `y` are the names of its axes with their units."""
    text = {"color": _INK, "fontSize": 12}
    axis = {"type": "value", "nameTextStyle": text, "splitLine": {"lineStyle": {"color": "#dddddd"}},
            "axisLabel": text | {"showMinLabel": False, "showMaxLabel": False}}
    return {
        "animation": False,
        "grid": {"left": 52, "right": 58, "top": 30, "bottom": 42},
        "xAxis": axis | {"name": x, "nameLocation": "middle", "nameGap": 26, "min": "dataMin", "max": "dataMax",
                         "axisLabel": text | {"showMaxLabel": False, "hideOverlap": True}},
        "yAxis": axis | {"name": y, "nameLocation": "end", "scale": True,
                         "nameTextStyle": text | {"align": "left", "padding": [0, 0, 0, -40]}},
        "series": list(lines),
    }
