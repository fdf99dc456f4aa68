"""A dropped file as it is understood → HTML; what can be changed has `data-change`, `data-place` and `data-key`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.report.html import bullets, text_of
from heatertune.studio.downsample import downsample, step_corners
from heatertune.studio.sheet import IGNORED, DroppedFile, SheetColumn
from heatertune.studio.wording import for_page

__all__ = ["preview", "sheet"]

Array = npt.NDArray[np.float64]

_UNITS: Final[Mapping[str, Mapping[str, str]]] = {
    "temperature": {
        "degC": "°C", "degF": "°F", "K": "K", "0.1degC": "0.1 °C", "0.01degC": "0.01 °C", "0.1degF": "0.1 °F"},
    "time": {"s": "s", "ms": "ms", "min": "min", "h": "h", "d": "days"},
}
_MOST_COLUMNS: Final = 40
_WIDE, _HIGH, _LOW = 640, 150, 34  # of the preview: its width, the temperature's height, the power's
_EDGE: Final = 8


def sheet(dropped: DroppedFile) -> str:
    """Return first rows with the role and unit of each column, preview and assumptions."""
    return "".join((_told(dropped), _table(dropped), _rest(dropped), preview(dropped.log) if dropped.log else "",
                    _assumptions(dropped), _repairs(dropped.log)))


def _told(dropped: DroppedFile) -> str:
    if dropped.problem:
        return f'<p class="error" role="alert">error: {text_of(for_page(dropped.problem))}</p>'
    assert dropped.log is not None
    time = dropped.log.time_s
    line = (f"{len(time)} readings every {float(np.median(np.diff(time))):.4g} s, "
            f"{dropped.log.temperature_degC.min():.4g} to {dropped.log.temperature_degC.max():.4g} °C")
    return f'<p role="status" data-field="taken">{line}</p>'


def _table(dropped: DroppedFile) -> str:
    if not dropped.columns:
        return f"<pre>{text_of(chr(10).join(dropped.lines))}</pre>" if dropped.lines else ""
    shown = "".join(_column(column, place, "column") for place, column in enumerate(dropped.columns[:_MOST_COLUMNS]))
    text = f'<h3>Columns, with their first rows</h3><div class="columns">{shown}</div>'
    if dropped.tags:
        tags = "".join(_column(column, place, "tag") for place, column in enumerate(dropped.tags))
        text += f'<h3>Tags: each becomes a column</h3><div class="columns">{tags}</div>'
    if dropped.zones:
        text += _select("the zone that is read", "zone", 0, {zone: zone for zone in dropped.zones}, dropped.zone,
                        label="Rows of the zone")
    return text


def _column(column: SheetColumn, place: int, kind: str) -> str:
    """Return one column: its name, role, unit and first cells."""
    name = text_of(column.name)
    role = _select(f"role of {kind} {column.name}", kind, place, {role: role for role in column.roles}, column.role)
    used = "" if column.role == IGNORED else " used"
    cells = "".join(f"<li>{text_of(cell) or '&nbsp;'}</li>" for cell in column.cells)
    return f'<div class="read-column{used}"><b>{name}</b>{role}{_unit(column, place)}<ol>{cells}</ol></div>'


def _unit(column: SheetColumn, place: int) -> str:
    if column.role == "power":
        return _number("reading at full power", "power_full_scale", place, column.unit, "at full power")
    if column.role == "time" and column.unit == "stamps":
        return '<span class="unit">date and time</span>'
    known = _UNITS.get("temperature" if column.role == "values" else column.role)
    if known is None:
        return ""
    option = "time_unit" if column.role == "time" else "temperature_unit"
    return _select(f"unit of {column.name}", option, place, {"": "unit?", **known}, column.unit)


def _rest(dropped: DroppedFile) -> str:
    """Return what else tells how the file is read."""
    settings, parts = dropped.settings, []
    if dropped.columns and not any(column.role == "time" for column in dropped.columns):
        parts.append(_number("seconds between two rows", "sample_time_s", 0, settings.sample_time_s, "s between rows"))
    parts.append(_number("title lines left out", "skip_rows", 0, settings.skip_rows or None, "title lines left out"))
    if dropped.run is not None:
        parts.append(_number("run that is read, 1 is the first", "run", 0, dropped.run, "run that is read"))
    ticked = " checked" if settings.skip_empty else ""
    parts.append('<label><input type="checkbox" data-change="skip_empty" data-place="0" data-key="skip_empty"'
                 f"{ticked}> leave out rows without a reading</label>")
    return f'<div class="fields">{"".join(parts)}</div>'


def _assumptions(dropped: DroppedFile) -> str:
    """Return what the file does not say: ambient, power before, and a constant power where none is logged."""
    assumed, powered = dropped.assumptions, any(column.role == "power" for column in (*dropped.columns, *dropped.tags))
    fields = [_number("ambient temperature in °C, if known", "ambient_degC", 0, assumed.ambient_degC,
                      "°C ambient (empty: found by the fit)"),
              _number("power before the log in percent, if known", "power_before_pct", 0, assumed.power_before_pct,
                      "% power before the log (empty: found by the fit)")]
    if not powered:
        fields.append(_number("constant power in percent, if known", "power_pct", 0, assumed.power_pct,
                              "% power throughout (empty: not known)"))
    told = [_number("setpoint of the trace in °C", "setpoint_degC", 0, assumed.setpoint_degC,
                    "°C setpoint (empty: as logged, else that of the proof)"),
            _number("heat-up begins, in s", "begins_s", 0, assumed.begins_s, "s: heat-up begins (empty: found)"),
            _number("load came, in s", "load_at_s", 0, assumed.load_at_s, "s: load came (empty: none)")]
    return (f'<h3>Assumptions</h3><div class="fields">{"".join(fields)}</div><div class="of-trace">'
            f'<h3>Of a trace of the commissioned loop</h3><div class="fields">{"".join(told)}</div></div>')


def _repairs(log: Log | None) -> str:
    """Return what the reader changed, assumed or finds odd; nothing of it is folded away."""
    if log is None:
        return ""
    parts = (("Changed or assumed by the reader", log.repairs), ("Odd, but left as it is", log.warnings))
    return "".join(f"<h3>{title}</h3>{bullets([for_page(item) for item in items])}" for title, items in parts if items)


def _select(
    name: str, change: str, place: int, options: Mapping[str, str], chosen: str, *, label: str = ""
) -> str:
    shown = "".join(
        f'<option value="{text_of(value)}"{" selected" if value == chosen else ""}>{text_of(text)}</option>'
        for value, text in options.items())
    element = (f'<select aria-label="{text_of(name)}" data-change="{change}" data-place="{place}" '
               f'data-key="{change}-{place}">{shown}</select>')
    return f"<label>{label} {element}</label>" if label else element


def _number(name: str, change: str, place: int, value: object, label: str) -> str:
    held = "" if value is None else text_of(str(value))
    return (f'<label class="number"><input type="text" inputmode="decimal" size="6" value="{held}" '
            f'aria-label="{text_of(name)}" data-change="{change}" data-place="{place}" data-key="{change}-{place}"> '
            f"<span>{text_of(label)}</span></label>")


def preview(log: Log) -> str:
    """Return the log as a small picture: temperature, and below it power where it is logged."""
    time, temperature, power = log.time_s, log.temperature_degC, log.power_pct
    low, high = float(temperature.min()), float(temperature.max())
    below = 0 if power is None else _LOW + _EDGE
    said = (f"Temperature from {low:.4g} to {high:.4g} °C in {time[-1] - time[0]:.4g} s"
            + ("" if power is None else f", power from {power.min():.4g} to {power.max():.4g} %"))
    lines = _path(time, temperature, (low, high), (_EDGE, _HIGH), "temperature")
    if power is not None:
        lines += _path(time, power, (0.0, 100.0), (_HIGH + _EDGE, _HIGH + _EDGE + _LOW), "power", held=True)
    return (f'<figure class="preview"><svg viewBox="0 0 {_WIDE} {_HIGH + below + _EDGE}" role="img" '
            f'aria-label="{text_of(said)}">{lines}</svg><figcaption>{text_of(said)}</figcaption></figure>')


def _path(
    time: Array, values: Array, range_: tuple[float, float], place: tuple[float, float], kind: str, *,
    held: bool = False,
) -> str:
    (low, high), (top, bottom) = range_, place
    time, values = step_corners(time, values) if held else (time, values)
    kept = downsample(time, values, _WIDE // 2)
    x, y = time[kept], values[kept]
    across = (x - time[0]) / (time[-1] - time[0]) * _WIDE
    down = bottom - (y - low) / max(high - low, 1e-9) * (bottom - top)
    return f'<polyline class="{kind}" points="{_points(across, down)}"/>'


def _points(x: Sequence[float] | Array, y: Sequence[float] | Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
