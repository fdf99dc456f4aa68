"""The health of many loops, as a page and as a few lines: one row per loop, the worst first."""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from importlib.resources import files
from typing import Final

from heatertune.codec import Document
from heatertune.plc import Scaling, Words
from heatertune.plc.keyed_entry import value_texts
from heatertune.report.html import Markup, page, text_of
from heatertune.units import written

__all__ = ["loops_lines", "loops_page"]

Loop = Document

_TITLE: Final = "the health of your loops"
_WIDTH: Final = 80
_SHOWN: Final = 10  # of the worst, in a terminal
_LEFT: Final = 4  # of those that were left out, likewise
_WELL: Final = "well"
_WHOLE: Final = 0.9  # of the parts of a course lie within its scale
_SURE: Final = {"high": "3", "medium": "2", "low": "1"}  # to sort by
_HEADS: Final = ("#", "loop", "course of the error", "cause", "sure", "mean error", "what was found", "what to do",
                 "since last")
_KEY: Final = (
    "Worst first; a click on a head sorts by it. Course: temperature minus setpoint, averaged over the PWM period, its "
    "scale below it. Mean error: as a multiple of what is possible for the heater that the log shows, with the loads, "
    "the room and the noise of that day. What words would make of it: the logged day lived again with them. Words "
    "without PASS are not for a plant.")


def loops_page(document: Document) -> str:
    """Return the page of a document of `heatertune.batch.loop_health`; it fetches nothing and works from a file."""
    own = files("heatertune.report")
    style = own.joinpath("loops.css").read_text(encoding="utf-8")
    program = own.joinpath("loops.js").read_text(encoding="utf-8")
    body = "\n".join([f"<style>{style}</style>", *_parts(document), f"<script>{program}</script>"])
    return page(_TITLE, body, foot=_TITLE)


def _parts(document: Document) -> Iterator[str]:
    loops, compared = document["loops"], document["compared"]
    yield f"<p>{text_of(_summary(document))}</p>"
    heads = _HEADS if compared else _HEADS[:-1]
    head = "".join(f'<th scope="col"><button>{name}</button></th>' for name in heads)
    rows = "".join(_row(number, loop, compared=compared) for number, loop in enumerate(loops, 1))
    yield f'<table class="loops"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
    yield f'<p class="soft">{_KEY}</p>'
    if document["left_out"]:
        items = "".join(f"<li><b>{text_of(row['name'])}</b> ({text_of(row['outcome'])}): {text_of(row['reason'])}</li>"
                        for row in document["left_out"])
        yield f"<h2>Left out</h2><ul>{items}</ul>"
    if document["gone"]:
        yield f"<p>Not there any more: {text_of(', '.join(document['gone']))}.</p>"


def _summary(document: Document) -> str:
    loops = document["loops"]
    counts = Counter(loop["outcome"] for loop in loops)
    ill = [f"{number} {cause}" for cause, number in counts.most_common() if cause != _WELL]
    parts = [f"{len(loops)} loops: {counts[_WELL]} well" + "".join(f", {each}" for each in ill)]
    passing = sum(loop["verdict"] == "PASS" for loop in loops)
    parts += [f"proven words for {passing}"] if passing else []
    parts += [f"{len(document['left_out'])} left out, see below"] if document["left_out"] else []
    changes = Counter(loop["change"] for loop in loops)
    changes_text = [f"{changes[change]} {change}" for change in ("worse", "better", "new") if changes[change]]
    parts += [f"since last: {', '.join(changes_text) or 'no change'}"] if document["compared"] else []
    return "; ".join(parts) + "."


def _row(number: int, loop: Loop, *, compared: bool) -> str:
    bad = loop["outcome"] != _WELL
    times = loop["times_worse"]
    cells = [
        _cell(str(number)), _cell(loop["name"], kind="cause"), _cell(_sparkline(loop["course"]), kind="wide"),
        _cell(loop["outcome"], kind="cause"), _cell(loop["confidence"], key=_SURE[loop["confidence"]]),
        _cell("" if times is None else f"{times:.2g} ×", key=str(-1.0 if times is None else times)),
        _cell(_fault_text(loop), kind="wide"), _cell(_to_do(loop), kind="wide"),
    ]
    if compared:
        kind = "worse" if loop["change"] == "worse" else ""
        was = f" (was {loop['was']})" if loop["was"] not in (None, loop["outcome"]) else ""
        cells.append(_cell(f"{loop['change'] or ''}{was}", kind=kind))
    return f'<tr{" class=bad" if bad else ""}>{"".join(cells)}</tr>'


def _cell(content: str, *, kind: str = "", key: str | None = None) -> str:
    marks = (f' class="{kind}"' if kind else "") + (f' data-key="{text_of(key)}"' if key is not None else "")
    return f"<td{marks}>{text_of(content)}</td>"


def _fault_text(loop: Loop) -> str:
    parts = [loop["reason"], loop["also"], None if loop["doubt"] is None else f"doubt: {loop['doubt']}"]
    return "; ".join(filter(None, parts))


def _to_do(loop: Loop) -> Markup | str:
    """Return the recommended action, with the parameters if there are any."""
    if loop["outcome"] == _WELL:
        return ""
    action = text_of(loop["what_to_do"])
    if loop["words"] is None:
        return Markup(action + (f" <span class=soft>(no words: {text_of(loop['why'])})</span>" if loop["why"] else ""))
    values = json.loads(loop["words"])
    plain = Words(target=loop["target"], values=values, scaling=Scaling(), sample_time_s=1.0)
    words = ", ".join(f"{name} {text}" for name, text in value_texts(plain, values).items())
    kind = "pass" if loop["verdict"] == "PASS" else "fail"
    why = "" if loop["why"] is None else f" ({text_of(loop['why'])})"
    return Markup(
        f'{action}: <span class="{kind}">{text_of(loop["verdict"])}</span>{why}, {text_of(loop["target"])}: '
        f'<span class="mono">{text_of(words)}</span>; PWM {loop["words_pwm_period_s"]:.3g} s; mean error '
        f"{loop['was_degC']:.2g} → {loop['would_degC']:.2g} °C")


def _sparkline(course: str | None) -> Markup | str:
    """Return the error as a band from the lowest to the highest of each part, with its scale."""
    if course is None:
        return ""
    parts: Sequence[Sequence[float]] = json.loads(course)
    peaks = sorted(max(map(abs, part)) for part in parts)
    size = peaks[int(_WHOLE * (len(peaks) - 1))] or 1.0  # anything beyond is a heat-up, clipped at the edge

    def height(value: float) -> float:
        return 14.0 - 13.0 * min(max(value / size, -1.0), 1.0)

    step = 100.0 / max(1, len(parts) - 1)
    shown = written(size, 2)
    high = [f"{step * place:.1f},{height(top):.1f}" for place, (_, top) in enumerate(parts)]
    low = [f"{step * place:.1f},{height(bottom):.1f}" for place, (bottom, _) in enumerate(parts)]
    return Markup(
        f'<svg viewBox="0 0 100 28" preserveAspectRatio="none" role="img" aria-label="error, ±{shown} °C">'
        f'<line class="zero" x1="0" x2="100" y1="14" y2="14"/><polygon class="curve" points="{" ".join(high)} '
        f'{" ".join(reversed(low))}"/></svg><span class="soft">±{shown} °C</span>')


def loops_lines(document: Document) -> str:
    """Return the text for the terminal: the worst loops with recommended actions, and the number of the others."""
    return "\n".join(_lines(document))


def _lines(document: Document) -> Iterator[str]:
    yield from textwrap.wrap(_summary(document), _WIDTH)
    ill = [loop for loop in document["loops"] if loop["outcome"] != _WELL]
    for number, loop in enumerate(ill[:_SHOWN], 1):
        words = "" if loop["verdict"] is None else f" [words: {loop['verdict']}]"
        yield _cut(f"{number:2} {loop['name']}: {loop['outcome']} ({loop['confidence']}){words}")
        yield _cut(f"     {loop['reason']}")
    yield from [f"   and {len(ill) - _SHOWN} more on the page"] if len(ill) > _SHOWN else []
    left = document["left_out"]
    for row in left[:_LEFT]:
        reason = row["reason"] if row["reason"].startswith(row["file"]) else f"{row['file']}: {row['reason']}"
        yield _cut(f"left out: {reason}")
    yield from [f"left out: {len(left) - _LEFT} more on the page"] if len(left) > _LEFT else []
    yield _cut(f"written to {document['page']} and {document['table']}")


def _cut(line: str) -> str:
    return line if len(line) <= _WIDTH else f"{line[:_WIDTH - 1]}…"
