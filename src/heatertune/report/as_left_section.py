"""The report's sections on the real plant: the as-left test, and the words written into the PLC.

As left: limit, proven worst case and measured value side by side, and the trace in the band of the proven runs.
Written: date and address, words as found, proven and as left, and the response in its proven band.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import TYPE_CHECKING, Final

import numpy as np

from heatertune.codec import Document
from heatertune.plc import controller_for
from heatertune.plc.keyed_entry import KeyedEntry, value_texts
from heatertune.proof.words_file import words_of
from heatertune.report.html import BLANK, bullets, picture, table, text_of, with_code
from heatertune.report.layout import LINES, cut, notes_within, screen, wrap_text
from heatertune.report.layout import table as text_table
from heatertune.report.plots import LOOK, key, label_levels, new_figure
from heatertune.report.report_text import figure, keyed_entries, limit_text, quantity, readable_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "CURVES", "as_left_brief", "in_plc", "judgement_text", "measured_text", "plot_as_left", "worst_text",
    "writes_brief", "written",
]


_KINDS: Final = {"write": "Write", "rollback": "Rollback"}
_NOT_KNOWN: Final = "not known"


def written(documents: Mapping[str, Document]) -> str:
    """Return each write to the PLC as HTML; empty if there was none."""
    record = documents.get("written")
    return "" if record is None else "<h2>Written into the PLC</h2>" + "".join(
        _passage(one, documents["words"]) for one in record["passages"])


def writes_brief(document: Document, page: str) -> str:
    """Return each time that somebody wrote, as a terminal shows it."""
    parts = [wrap_text(f"{_when(one)}, {_where(one)}: {one['message']}", f"{_outcome(one)}  ") + [
        f"  {row[0]:<14} {row[1]} -> {row[3]}" for row in _quantities(one)] for one in document["passages"]]
    return screen(*parts, [page])


def in_plc(values: Mapping[str, float] | None, words: Document) -> str:
    """Return the parameters in a PLC, each as entered, except those that the program writes."""
    if values is None:
        return _NOT_KNOWN
    texts = _texts(words, values)
    return ", ".join(f"{row.name} {texts[row.name]}" for row in _own(words) if row.name in values)


def _passage(entry: Document, words: Document) -> str:
    rows = [("when", f"{_when(entry)} to {_clock(entry['ended'])}" if entry["ended"] else f"{_when(entry)}, not ended"),
            ("record", entry["record"]), ("where", _where(entry)), ("made by", f"heatertune {entry['version']}"),
            ("by", BLANK)]
    facts = "".join(f"<dt>{name}</dt><dd>{text_of(value)}</dd>" for name, value in rows)
    mark = "pass" if entry["outcome"] == "done" else "fail"
    heads = ["", "as found", "proven", "as left"]
    source = f"{entry['record']}; proven: the proof of these words"
    watch = entry["watch"]
    drawn = "<p>The response was not watched.</p>" if watch is None else picture(
        plot_watch(watch), "Measured against proven: the response, and the band in which the proof has it.")
    earlier = f"<p>Looked at before: {text_of('; '.join(entry['observations']))}.</p>" if entry["observations"] else ""
    return (
        f'<section><h3>{_KINDS[entry["kind"]]}: <span class="{mark}">{_outcome(entry)}</span></h3>'
        f'<dl class="identity">{facts}</dl><p>{_sentence(entry["message"])}</p>{earlier}{bullets(entry["notes"])}'
        f"{table(heads, [*_quantities(entry), *_words(entry, words)], numeric=(1, 2, 3), source=source)}{drawn}"
        "</section>")


def _sentence(text: str) -> str:
    return with_code(f"{text[:1].upper()}{text[1:]}.")


def _outcome(entry: Document) -> str:
    return str(entry["outcome"]).upper()


def _when(entry: Document) -> str:
    return f"{datetime.fromisoformat(entry['begun']):%Y-%m-%d %H:%M:%S %Z}"


def _clock(instant: str) -> str:
    return f"{datetime.fromisoformat(instant):%H:%M:%S}"


def _where(entry: Document) -> str:
    return f"{entry['address']}{', a simulator' if entry['simulated'] else ''}"


def _quantities(entry: Document) -> Iterator[list[str]]:
    """Yield the meanings of the parameters that occur in at least one of the three sets."""
    for each in entry["quantities"]:
        values = [each[name] for name in ("as_found", "proven", "left")]
        if any(value is not None for value in values):
            shown = [_shown(value, each["unit"], is_known=entry[of] is not None)
                     for value, of in zip(values, ("as_found", "quantities", "left"), strict=True)]
            yield [each["name"], *shown]


def _shown(value: float | None, unit: str, *, is_known: bool) -> str:
    return _NOT_KNOWN if not is_known else "none" if value is None else f"{figure(value)} {unit}"


def _words(entry: Document, words: Document) -> Iterator[list[str]]:
    """Yield the words that are not the same in all three sets."""
    proven = {row.name: row.then for row in _own(words)}
    sets = [entry["as_found"] or {}, proven, entry["left"] or {}]
    texts = [_texts(words, values) for values in sets]
    for row in _own(words):
        if any(values.get(row.name) != row.then for values in sets):
            yield [row.name if row.address == row.name else f"{row.address} {row.name}",
                   *(text[row.name] if row.name in values else _NOT_KNOWN
                     for values, text in zip(sets, texts, strict=True))]


def _texts(words: Document, values: Mapping[str, float]) -> dict[str, str]:
    """Return each word as a person enters it, with these values in place of the proven ones."""
    return value_texts(words_of(words, words["target"], "words.json"), values)


def _own(words: Document) -> Iterator[KeyedEntry]:
    """Yield the words that the program does not write, with their proven values."""
    live = controller_for(words["target"]).written
    for row in keyed_entries(words):
        if row.name not in live:
            yield row


def plot_watch(watch: Document) -> Figure:
    """Draw the response over its band; readings outside the band are marked."""
    drawn, (ax,) = new_figure(1, 3.0)
    time, readings, low, high, setpoint_degC = (np.asarray(watch[name]) for name in (
        "time_s", "temperature_degC", "low_degC", "high_degC", "setpoint_degC"))
    ax.fill_between(time, low, high, step="post", color=LOOK["other"]["color"], alpha=0.6, linewidth=0)
    ax.step(time, high, where="post", label="highest that is proven", **LOOK["other"])
    ax.step(time, low, where="post", label="lowest that is proven", **LOOK["other"])
    ax.plot(time, readings, label="measured", **LOOK["log"])
    outside = (readings < low) | (readings > high)
    if outside.any():
        ax.plot(time[outside], readings[outside], linestyle="", marker="o", markersize=4, color=LOOK["worst"]["color"],
                label="outside")
    ax.step(time, setpoint_degC, where="post", label="setpoint", **LOOK["limit"])
    label_levels(ax, (float(setpoint_degC[-1]), "setpoint"))
    key(ax, ("measured", "log"), ("the proven band", "other"))
    ax.set(xlabel="time since the words were written [s]", ylabel="temperature [°C]")
    return drawn


#: keys of the document that contain curves
CURVES: Final = ("time_s", "temperature_degC", "power_s", "power_pct", "band_s", "low_degC", "high_degC")


def measured_text(line: Document) -> str:
    """Return the measured value of a criterion, or that it was not measured."""
    value = line["measured"]
    return "not measured" if value is None else value if isinstance(value, str) else quantity(value, line["unit"], 3)


def worst_text(line: Document) -> str:
    """Return the worst of all proven runs."""
    if line["worst"] is None:
        return "unlimited" if line["bound"] == ">=" else "never"
    return quantity(line["worst"], line["unit"])


def as_left_brief(left: Document, target: str, page: str, *, whole: bool = False) -> str:
    """Return a trace compared with its proof on one screen, or in full with `whole`."""
    count = sum(line["measured"] is not None for line in left["measurements"])
    message = " ".join(left["messages"]) or (
        "every figure keeps its limit, and the curve is inside of what the proven runs do")
    where = f"{left['trace']} beside {target} at {left['setpoint_degC']:g} °C"
    lines = wrap_text(f"{where}: {message}", f"{left['verdict']}  ", 6)
    rows = [("", "limit", "proven worst", "measured", "")]
    for line in left["measurements"]:
        if line["measured"] is not None or whole:
            rows.append((readable_name(line["name"]), limit_text(line), worst_text(line),
                         measured_text(line), judgement_text(line) or (line["message"] if whole else "")))
    figures = [row if whole else cut(row) for row in text_table(rows, right=(1, 2, 3)).splitlines()] if rows[1:] else []
    others = [f"{len(left['measurements']) - count} criteria cannot be seen in this trace (--verbose says why)"]
    notes = [f"- {note}" for note in left["notes"]] if whole else notes_within(
        LINES - len(lines) - len(figures) - 6, left["notes"])
    return screen(lines, figures, [*([] if whole else others), *notes], [page])


def judgement_text(line: Document) -> str:
    """Return whether the measured value is as proven, "" if it was not measured."""
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
        ax.step(left.get("power_s") or left["time_s"], left["power_pct"], where="post", label="power", **LOOK["log"])
        ax.set(ylabel="power [%]", ylim=(-4, 104))
    (others or [top])[-1].set_xlabel("time since the setpoint change [s]")
    return figure
