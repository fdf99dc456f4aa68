"""As left: limit, proven worst and measured side by side, and the trace over what the proven runs do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from heatertune.report.layout import LINES, cut, notes_within, screen, table, wrap_text
from heatertune.report.plots import LOOK, key, label_levels, new_figure
from heatertune.report.text import limit_text, quantity, readable_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["CURVES", "as_left_brief", "judged_text", "measured_text", "plot_as_left", "worst_text"]

Document = Mapping[str, Any]

#: what of the document is a curve
CURVES: Final = ("time_s", "temperature_degC", "power_pct", "band_s", "low_degC", "high_degC")


def measured_text(line: Document) -> str:
    """Return what was measured of a criterion, or that it was not."""
    value = line["measured"]
    return "not measured" if value is None else value if isinstance(value, str) else quantity(value, line["unit"], 3)


def worst_text(line: Document) -> str:
    """Return the worst of all proven runs."""
    if line["worst"] is None:
        return "unlimited" if line["bound"] == ">=" else "never"
    return quantity(line["worst"], line["unit"])


def as_left_brief(left: Document, target: str, page: str, *, whole: bool = False) -> str:
    """Return a trace beside its proof on one screen, or, `whole`, all that is known of it."""
    count = sum(line["measured"] is not None for line in left["measurements"])
    said = " ".join(left["messages"]) or (
        "every figure keeps its limit, and the curve is inside of what the proven runs do")
    where = f"{left['trace']} beside {target} at {left['setpoint_degC']:g} °C"
    lines = wrap_text(f"{where}: {said}", f"{left['verdict']}  ", 6)
    rows = [("", "limit", "proven worst", "measured", "")]
    for line in left["measurements"]:
        if line["measured"] is not None or whole:
            rows.append((readable_name(line["name"]), limit_text(line), worst_text(line),
                         measured_text(line), judged_text(line) or (line["message"] if whole else "")))
    figures = [row if whole else cut(row) for row in table(rows, right=(1, 2, 3)).splitlines()] if rows[1:] else []
    others = [f"{len(left['measurements']) - count} criteria cannot be seen in this trace (--verbose says why)"]
    notes = [f"- {note}" for note in left["notes"]] if whole else notes_within(
        LINES - len(lines) - len(figures) - 6, left["notes"])
    return screen(lines, figures, [*([] if whole else others), *notes], [page])


def judged_text(line: Document) -> str:
    """Return whether what was measured is as proven, "" where nothing was."""
    if line["keeps"] is False:
        return "FAIL"
    return "" if line["keeps"] is None else "ok" if line["as_proven"] else "worse than proven"


def plot_as_left(left: Document) -> Figure:
    """Draw the trace over the band of the proven runs, and the power where it was logged; outside is shaded."""
    powered = left["power_pct"] is not None
    ratios = (3, 1) if powered else (1,)
    figure, (top, *others) = new_figure(len(ratios), 3.2 + 0.8 * powered, sharex=True, height_ratios=ratios)
    low, high = (np.asarray(left[name]) for name in ("low_degC", "high_degC"))
    top.fill_between(left["band_s"], low, high, color=LOOK["other"]["color"], alpha=0.6, linewidth=0)
    top.plot(left["band_s"], high, label="highest of the proven runs", **LOOK["other"])
    top.plot(left["band_s"], low, label="lowest of the proven runs", **LOOK["other"])
    top.plot(left["time_s"], left["temperature_degC"], label="measured", **LOOK["log"])
    for stretch in left["outside"]:
        top.axvspan(stretch["begin_s"], stretch["end_s"], color=LOOK["worst"]["color"], alpha=0.15, linewidth=0)
    top.axhline(left["setpoint_degC"], label="setpoint", **LOOK["limit"])
    label_levels(top, (left["setpoint_degC"], "setpoint"))
    top.set_ylabel("temperature [°C]")
    key(top, ("measured", "log"), ("between the lowest and highest of the proven runs", "other"))
    for ax in others:
        ax.step(left["time_s"], left["power_pct"], where="post", label="power", **LOOK["log"])
        ax.set(ylabel="power [%]", ylim=(-4, 104))
    (others or [top])[-1].set_xlabel("time since the setpoint change [s]")
    return figure
