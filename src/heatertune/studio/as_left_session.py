"""As left: a trace of the commissioned loop beside the proven design in front, and what the page shows of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from heatertune.codec import decode, encode
from heatertune.commissioned import AsLeftSettings
from heatertune.documents import plain
from heatertune.log.values import Log
from heatertune.progress import ProgressCallback
from heatertune.proof.as_left import AsLeft, as_left
from heatertune.proof.document import ProofView
from heatertune.report.as_left import judged_text, measured_text, worst_text
from heatertune.report.html import bullets, table, text_of
from heatertune.report.style import LOOK
from heatertune.report.text import limit_text, readable_name
from heatertune.studio.charts import Options
from heatertune.studio.session import FrontDesign
from heatertune.studio.wording import for_page

__all__ = ["figures", "held_against", "left_chart", "left_sentence"]

_INK: Final = "#1a1a1a"
_BAND: Final = "#8c8c8c"
_OUTSIDE: Final = "rgba(163, 60, 0, 0.13)"


def held_against(standing: FrontDesign, log: Log, about: AsLeftSettings, progress: ProgressCallback) -> AsLeft:
    """Return a trace beside the proof of a design; errors as `heatertune.proof.as_left.as_left`."""
    proof = decode(ProofView, plain(standing.proof.to_document()), "the proof")
    return as_left(log, standing.look.gains.words, standing.fitted, proof, about, progress=progress)


def left_sentence(left: AsLeft, verdict: str) -> str:
    """Return what the trace shows as one sentence that can be read out; `verdict`: of the proof."""
    seen = sum(line.measured is not None for line in left.measurements)
    kept = ("the curve is inside of what the proven runs do, and each of the "
            f"{seen} figures that the trace shows is no worse than proven.")
    proof = "" if verdict == "PASS" else f" The proof of these words is itself {verdict}."
    return for_page(f"{left.verdict}: {' '.join(left.messages) or kept}{proof}")


def figures(left: AsLeft) -> str:
    """Return limit, proven worst and measured side by side, why a figure is not measured, and the notes, as HTML."""
    lines = plain(encode(left))["measurements"]
    seen = [[*_proven(line), measured_text(line), judged_text(line) or for_page(line["message"])]
            for line in lines if line["measured"] is not None]
    unseen = [[*_proven(line), for_page(line["message"])] for line in lines if line["measured"] is None]
    heads = ("criterion", "limit", "proven worst")
    text = f"<p>{text_of(left.trace)}, at {left.setpoint_degC:g} °C.</p>"
    if seen:
        text += table([*heads, "measured", "as proven"], seen, numeric=(1, 2, 3))
    if unseen:
        folded = table([*heads, "why it is not measured"], unseen, numeric=(1, 2))
        text += f"<details><summary>Not measured, and why ({len(unseen)})</summary>{folded}</details>"
    return text + bullets([for_page(note) for note in left.notes])


def _proven(line: Mapping[str, Any]) -> tuple[str, str, str]:
    return readable_name(line["name"]), limit_text(line), worst_text(line)


def left_chart(left: AsLeft) -> Options:
    """Return the trace over the band of the proven runs, what is outside of it shaded."""
    low, high, log = {"color": _BAND, "width": 0.7}, left.high_degC, LOOK["log"]
    width = [top - bottom for bottom, top in zip(left.low_degC, high, strict=True)]
    stacked = {"stack": "band", "stackStrategy": "all", "lineStyle": {"opacity": 0.0}, "tooltip": {"show": False}}
    asked = {"silent": True, "symbol": "none", "lineStyle": {"color": LOOK["limit"]["color"]}, "data": [
        {"yAxis": left.setpoint_degC, "label": {"formatter": "setpoint", "position": "insideStartTop", "color": _INK}}]}
    shaded = {"silent": True, "itemStyle": {"color": _OUTSIDE}, "data": [
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
            _line("", left.band_s, left.low_degC, stacked),
            _line("", left.band_s, width, stacked | {"areaStyle": {"color": _BAND, "opacity": 0.35}}),
            _line("lowest of the proven runs", left.band_s, left.low_degC, {"lineStyle": low}),
            _line("highest of the proven runs", left.band_s, high, {"lineStyle": low}),
            _line("measured", left.time_s, left.temperature_degC, {
                "lineStyle": {"color": log["color"], "width": 1.4}, "itemStyle": {"color": log["color"]}, "z": 3,
                "markLine": asked, "markArea": shaded}),
        ],
    }


def _line(name: str, time_s: Sequence[float], values: Sequence[float], other: Mapping[str, Any]) -> dict[str, Any]:
    points = [list(point) for point in zip(time_s, values, strict=True)]
    return {"type": "line", "name": name, "showSymbol": False, "itemStyle": {"color": _BAND}, "data": points, **other}
