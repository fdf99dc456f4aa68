"""Values → options of the page's charts (Apache ECharts): a unit on every axis, names beside the lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.heater.exact import since_step
from heatertune.log.values import Log
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.search.uncertain import interval_ends
from heatertune.proof import Trace
from heatertune.report.style import LOOK
from heatertune.studio.loop import Look
from heatertune.studio.session import Pinned

__all__ = ["Options", "heater_chart", "log_chart", "loop_chart", "power_chart"]

Array = npt.NDArray[np.float64]
Options = dict[str, Any]

_POINTS: Final = 800
_NAME: Final = 0.12  # of the chart's width that the name of a level takes
_STEP_PCT: Final = 10.0
_LAGS: Final = 4.0  # times the slowest lag: 98 % of a step
_PIN_LINES: Final = ("dashed", "dotted", [8, 2, 2, 2], [2, 6])
_INK: Final = "#1a1a1a"
_PIN: Final = "#595959"
#: look → darker tone of the same colour for its name: letters need more contrast than lines (WCAG 2.1, 1.4.3: 4.5:1)
_LETTERS: Final = {"realised": "#00634a", "wish": "#8a5a00"}
_BAND: Final = 1.96  # of a normal distribution, 95 %


def log_chart(log: Log, fitted: FittedModel) -> Options:
    """Return log, model and the band in which 95 % of the model's errors lie."""
    lines = [_line("log", log.time_s, log.temperature_degC, "log", lower=-1)]  # both end at one point
    residuals = fitted.residuals
    if residuals is not None:
        wide = _BAND * float(np.sqrt(np.mean((residuals.measured_degC - residuals.simulated_degC) ** 2)))
        low, high = residuals.simulated_degC - wide, residuals.simulated_degC + wide
        model = _line("model", residuals.time_s, residuals.simulated_degC, "model")
        lines += [*_band(residuals.time_s, low, high), model]
    return _chart("time [s]", "temperature [°C]", lines)


def heater_chart(fitted: FittedModel) -> Options:
    """Return what 10 % more power does on the working model, and between which curves the log leaves it open."""
    models = (fitted.model, *fitted.plants, *interval_ends(fitted))
    time = np.linspace(0.0, _LAGS * sum(fitted.model.lags_s) + fitted.model.dead_time_s, 120)
    rises = np.array([_rise(model, time) for model in models])
    lines = [*_band(time, rises.min(axis=0), rises.max(axis=0)), _line("model", time, rises[0], "model")]
    return _chart("time [s]", f"rise after {_STEP_PCT:g} % more power [°C]", lines)


def _rise(model: HeaterModel, time: Array) -> Array:
    covered, _ = since_step(np.maximum(time - model.dead_time_s, 0.0), *model.lags_s)
    return np.asarray(_STEP_PCT * model.gain_degC_per_pct * covered)


def loop_chart(look: Look, pinned: Sequence[Pinned]) -> Options:
    """Return the temperature of the nominal loop: as the words make it, as it was wished, and of the designs kept."""
    nominal = look.proof.nominal
    lines = [_temperature("words", nominal, "realised")]
    if look.wish is not None:
        lines.append(_temperature("wish", look.wish, "wish", lower=1))
    for i, (pin, kind) in enumerate(zip(pinned, _PIN_LINES, strict=False)):
        lines.append(_temperature(pin.name, pin.look.proof.nominal, "other", kind=kind, color=_PIN, lower=-1 - i))
    # the name stands where the run has settled, on the side of the line that it has left
    late = nominal.temperature_degC[nominal.time_s > (1.0 - _NAME) * nominal.time_s[-1]]
    side = "Bottom" if late.mean() >= nominal.setpoint_degC else "Top"
    lines[0]["markLine"] = {
        "silent": True, "symbol": "none", "lineStyle": {"color": LOOK["limit"]["color"], "type": "dotted"},
        "label": {"formatter": "setpoint", "position": f"insideEnd{side}", "color": LOOK["limit"]["color"]},
        "data": [{"yAxis": nominal.setpoint_degC}],
    }
    return _chart("time [s]", "temperature [°C]", lines)


def power_chart(look: Look) -> Options:
    """Return the power that the words ask for."""
    nominal = look.proof.nominal
    line = _line("words", nominal.time_s, nominal.power_asked_pct, "realised")
    options = _chart("time [s]", "power asked for [%]", [line | {"step": "end"}])
    options["yAxis"] |= {"min": 0, "max": 100}
    return options


def _temperature(name: str, trace: Trace, look: str, **other: Any) -> dict[str, Any]:
    """Return the temperature at the scans: any other even spacing would beat with the PWM's ripple."""
    every = -(-len(trace.time_s) // _POINTS)
    return _line(name, trace.time_s[::every], trace.temperature_degC[::every], look, **other)


def _line(
    name: str, time: Array, values: Array, look: str, *, kind: Any = None, color: str = "", lower: int = 0
) -> dict[str, Any]:
    """Return a line with its name at its end, so many lines of text lower."""
    style = LOOK[look]
    color = color or style["color"]
    return {
        "type": "line", "name": name, "showSymbol": False, "silent": True, "z": 3,
        "data": np.column_stack([np.round(time, 2), np.round(values, 3)]).tolist(),
        "lineStyle": {"color": color, "width": style["linewidth"],
                      "type": kind or ([6, 3] if "linestyle" in style else "solid")},
        "endLabel": {"show": True, "formatter": name, "color": _LETTERS.get(look, color), "distance": 4,
                     "offset": [0, 13 * lower]},
    }


def _band(time: Array, low: Array, high: Array) -> list[dict[str, Any]]:
    """Return two stacked lines: the lower end, invisible, and the shaded width above it."""
    color = LOOK["model"]["color"]
    hidden = {"type": "line", "showSymbol": False, "silent": True, "stack": "band", "stackStrategy": "all", "z": 1,
              "lineStyle": {"opacity": 0.0}}
    data = [np.column_stack([np.round(time, 2), np.round(y, 3)]).tolist() for y in (low, high - low)]
    return [hidden | {"name": "band, low", "data": data[0]},
            hidden | {"name": "band, width", "data": data[1], "areaStyle": {"color": color, "opacity": 0.2}}]


def _chart(x: str, y: str, lines: Sequence[dict[str, Any]]) -> Options:
    text = {"color": _INK, "fontSize": 12}
    axis = {"type": "value", "nameTextStyle": text, "axisLabel": text, "splitLine": {"lineStyle": {"color": "#dddddd"}}}
    return {
        "animation": False,
        "grid": {"left": 52, "right": 58, "top": 30, "bottom": 42},
        "xAxis": axis | {"name": x, "nameLocation": "middle", "nameGap": 26, "min": "dataMin", "max": "dataMax",
                         "axisLabel": text | {"showMaxLabel": False}},
        "yAxis": axis | {"name": y, "nameLocation": "end", "scale": True,
                         "nameTextStyle": text | {"align": "left", "padding": [0, 0, 0, -40]}},
        "series": list(lines),
    }
