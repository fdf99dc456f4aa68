"""What a monitor is and what it sees, as a page of text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any, Final

__all__ = ["supervision_page"]

_WIDTH: Final = 80
_COLUMNS: Final = "{:30}{:>9} {:>21} {:>18}"


def supervision_page(document: Mapping[str, Any]) -> str:
    """Return the page of a document of `heatertune.proof.supervision`."""
    return "\n".join(_lines(document))


def _lines(document: Mapping[str, Any]) -> Iterator[str]:
    warning = textwrap.wrap(document["warning"], _WIDTH)
    low, high = document["noise_degC"]
    yield from warning
    yield ""
    yield (f"monitor of {document['target']}, setpoint {document['setpoint_degC']:g} °C, "
           f"a scan each {document['scan_s']:g} s")
    yield from _wrapped(
        f"{document['false_trips']} false trips on {document['checked']} heaters that no limit was made from, each "
        f"through its whole story: cold start, loads, setpoint steps, mains ±10 % (less where "
        f"a heater could not hold the setpoint then), outage and return "
        f"(gain and lags ±{document['spread_pct']:g} %, ambient ±{document['ambient_spread_degC']:g} °C, noise "
        f"{low:g}…{high:g} °C).")
    if document["widened_for"]:
        yield from _wrapped(f"Before, {document['widened_for']} of others tripped: the limits were made wider.")
    yield ""
    yield from _numbers(document["numbers"])
    yield ""
    for sentence in document["told"]:
        yield from _wrapped(sentence, "- ")
    yield ""
    yield _COLUMNS.format("fault", "seen", "after [s]", "hottest [°C]")
    yield _COLUMNS.format("", "", "median   95 %  worst", "median     worst")
    for fault in document["faults"]:
        yield _row(fault)
    yield ""
    yield from _missed(document)
    yield ""
    yield from _program(document["program"])
    yield ""
    yield from warning


def _numbers(numbers: Mapping[str, int]) -> Iterator[str]:
    items = [f"{name} {value}" for name, value in numbers.items()]
    yield from textwrap.wrap("numbers: " + ", ".join(items), _WIDTH, break_long_words=False)


def _row(fault: Mapping[str, Any]) -> str:
    after, peak = fault["detection_s"], fault["peak_degC"]
    late = "-" if after is None else f"{_short(after['median'])} {_short(after['p95'])} {_short(after['worst'])}"
    hot = f"{peak['median']:7.1f}   {peak['worst']:7.1f}"
    return _COLUMNS.format(fault["name"], f"{fault['detected']}/{fault['heaters']}", late, hot)


def _short(seconds: float) -> str:
    return f"{seconds:6.1f}" if seconds < 100.0 else f"{seconds:6.0f}"


def _missed(document: Mapping[str, Any]) -> Iterator[str]:
    yield "What it does not see:"
    for fault in document["faults"]:
        if fault["missed_because"] is not None:
            missed = fault["heaters"] - fault["detected"]
            yield from _wrapped(f"{fault['name']}, {missed} of {fault['heaters']}: {fault['missed_because']}.", "- ")
    for rule in document["off"]:
        yield from _wrapped(f"{rule['rule']}: {rule['why']}.", "- ")
    yield from (line for what in document["not_tested"] for line in _wrapped(f"not tested: {what}.", "- "))


def _program(program: Mapping[str, Any]) -> list[str]:
    if program["file"] is None:
        return _wrapped(f"No program: {program['why'].removeprefix('no program: ')}.")
    return _wrapped(f"Program: {program['file']}, run in a machine of its target beside the monitor, {program['runs']} "
                    f"runs and {program['calls']} calls: the same alarm in each.")


def _wrapped(sentence: str, mark: str = "") -> list[str]:
    return textwrap.wrap(sentence, _WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark))
