"""A page of text about a monitor and the faults that it detects."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from heatertune.codec import Document
from heatertune.report.html import bullets, page, picture, table, text_of
from heatertune.report.plots import LOOK, key, new_figure
from heatertune.units import written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_fault", "supervision_html", "supervision_page"]

_WIDTH: Final = 80
_COLUMNS: Final = "{:30}{:>9} {:>21} {:>18}"


def supervision_page(document: Document) -> str:
    """Return the page of a document of `heatertune.supervision`."""
    return "\n".join(_lines(document))


def supervision_html(document: Document) -> str:
    """Return the same as one page to print, with a picture of a fault; each sheet bears the warning."""
    warning = document["warning"]
    low, high = document["noise_degC"]
    intro = (f"{document['false_trips']} false trips on {document['checked']} new heaters, each through the whole test "
             f"sequence (gain and lags ±{document['spread_pct']:g} %, ambient ±{document['ambient_spread_degC']:g} °C, "
             f"noise {low:g}…{high:g} °C).")
    body = [f'<p class="fail">{text_of(warning)}</p>', f"<p>{text_of(intro)}</p>", "<h2>What it sees</h2>",
            _table(document["faults"])]
    body.append(picture(plot_fault(document["trace"]), _caption(document["trace"]), moves=False))
    if document["built_in"]:
        body += [f"<h2>What {text_of(document['target'])} itself can see</h2>", _table(document["built_in"])]
    numbers = [(name, str(value)) for name, value in document["numbers"].items()]
    body += ["<h2>What it does not detect</h2>", bullets(list(_not_seen(document))), "<h2>Its rules</h2>",
             bullets(document["rules"]), "<h2>Its numbers</h2>", table(("number", "value"), numbers, numeric=(1,)),
             "<h2>Its program</h2>", f"<p>{text_of(_program(document))}</p>"]
    title = f"Supervision of {document['target']} at {document['setpoint_degC']:g} °C"
    return page(title, "\n".join(body), foot=warning)


def plot_fault(trace: Document) -> Figure:
    """Draw a fault and its alarm: the temperature without an alarm, and with the power switched off by it."""
    figure, (ax,) = new_figure(1, 2.2)
    ax.plot(trace["time_s"], trace["left_degC"], label="nobody sees it", **LOOK["worst"])
    ax.plot(trace["time_s"], trace["stopped_degC"], label="switched off by the alarm", **LOOK["realised"])
    for time in (0.0, trace["alarm_s"]):
        if time is not None:
            ax.axvline(time, **LOOK["limit"])
    key(ax, ("nobody sees it", "worst"), ("switched off by the alarm", "realised"), ("fault, alarm", "limit"))
    ax.set(ylabel="temperature [°C]", xlabel="time since the fault [s]")
    return figure


def _caption(trace: Document) -> str:
    alarm_text = "no alarm" if trace["alarm_s"] is None else f"the alarm comes after {written(trace['alarm_s'], 3)} s"
    return f"{trace['name'].capitalize()}, on one heater: {alarm_text}."


def _table(faults: Sequence[Document]) -> str:
    heads = ("fault", "seen", "median [s]", "95 % [s]", "worst [s]", "hottest, median [°C]", "hottest, worst [°C]")
    rows = []
    for fault in faults:
        after, peak = fault["detection_s"], fault["peak_degC"]
        late = ["–"] * 3 if after is None else [_short(after[name]).strip() for name in ("median", "p95", "worst")]
        rows.append([fault["name"], f"{fault['detected']}/{fault['heaters']}", *late, f"{peak['median']:.1f}",
                     f"{peak['worst']:.1f}"])
    return table(heads, rows, numeric=range(1, 7))


def _lines(document: Document) -> Iterator[str]:
    warning = textwrap.wrap(document["warning"], _WIDTH)
    low, high = document["noise_degC"]
    yield from warning
    yield ""
    yield (f"monitor of {document['target']}, setpoint {document['setpoint_degC']:g} °C, "
           f"a scan each {document['scan_s']:g} s")
    yield from _wrapped(
        f"{document['false_trips']} false trips on {document['checked']} new heaters, each through the whole test "
        "sequence: cold start, loads, setpoint steps, mains ±10 % (less if a heater could not hold the setpoint then), "
        f"outage and return (gain and lags ±{document['spread_pct']:g} %, ambient ±{document['ambient_spread_degC']:g} "
        f"°C, noise {low:g}…{high:g} °C).")
    if document["widened_for"]:
        yield from _wrapped(f"Before, {document['widened_for']} of others tripped: the limits were made wider.")
    yield ""
    yield from _numbers(document["numbers"])
    yield ""
    for sentence in document["rules"]:
        yield from _wrapped(sentence, "- ")
    yield ""
    yield _COLUMNS.format("fault", "seen", "after [s]", "hottest [°C]")
    yield _COLUMNS.format("", "", "median   95 %  worst", "median     worst")
    for fault in document["faults"]:
        yield _row(fault)
    yield ""
    if document["built_in"]:
        yield from _wrapped(f"The same faults by what {document['target']} itself can do "
                            f"({document['program']['file']}):")
        for fault in document["built_in"]:
            yield _row(fault)
        yield ""
    yield "What it does not detect:"
    yield from (line for what in _not_seen(document) for line in _wrapped(what, "- "))
    yield ""
    yield from _wrapped(_program(document))
    yield ""
    yield from warning


def _numbers(numbers: Mapping[str, int]) -> Iterator[str]:
    items = [f"{name} {value}" for name, value in numbers.items()]
    yield from textwrap.wrap("numbers: " + ", ".join(items), _WIDTH, break_long_words=False)


def _row(fault: Document) -> str:
    after, peak = fault["detection_s"], fault["peak_degC"]
    late = "-" if after is None else f"{_short(after['median'])} {_short(after['p95'])} {_short(after['worst'])}"
    hot = f"{peak['median']:7.1f}   {peak['worst']:7.1f}"
    return _COLUMNS.format(fault["name"], f"{fault['detected']}/{fault['heaters']}", late, hot)


def _short(seconds: float) -> str:
    return f"{seconds:6.1f}" if seconds < 100.0 else f"{seconds:6.0f}"


def _not_seen(document: Document) -> Iterator[str]:
    for fault in document["faults"]:
        if fault["missed_because"] is not None:
            missed = fault["heaters"] - fault["detected"]
            yield f"{fault['name']}, {missed} of {fault['heaters']}: {fault['missed_because']}."
    for rule in document["off"]:
        yield f"{rule['rule']}: {rule['why']}."
    yield from (f"not tested: {what}." for what in document["not_tested"])


def _program(document: Document) -> str:
    program = document["program"]
    if program["file"] is None:
        return f"No program: {program['why'].removeprefix('no program: ')}."
    if not program["runs"]:
        return f"Lines of its own rule: {program['file']}. They are less than the monitor: see the table."
    rules = "those of its rules that it can express" if document["built_in"] else "the monitor"
    return (f"Program: {program['file']}, run in a machine of its target beside {rules}, {program['runs']} runs and "
            f"{program['calls']} calls: the same alarm in each.")


def _wrapped(sentence: str, mark: str = "") -> list[str]:
    return textwrap.wrap(sentence, _WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark))
