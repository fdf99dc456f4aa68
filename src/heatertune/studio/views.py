"""Values → the words and tables on the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from heatertune.log.log_values import Log
from heatertune.model.model_document import to_document
from heatertune.model.model_values import FittedModel
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.keyed_entry import FIRST, THEN, KeyedEntry, typed_words
from heatertune.plc.targets import GROUPS
from heatertune.proof import Proof
from heatertune.proof.ripple_and_wear import life
from heatertune.proof.verdict import verdict_brief, verdict_details
from heatertune.report.html import Markup, bullets, table, text_of
from heatertune.report.report_text import criterion_value, figure, model_rows
from heatertune.studio.loop_settings import LoopView, document_of
from heatertune.studio.proof_picture import Picture
from heatertune.studio.session import PinnedDesign
from heatertune.studio.wording import for_page
from heatertune.units import the_term

__all__ = [
    "comparison_html", "conditions", "criteria", "diagnosis", "duration_text", "export_name", "in_words", "key",
    "notes", "proving_text", "rounding", "sentence", "verdict_text", "words", "words_html",
]

_PARTS = (("K", "gain_pct_per_degC", "%/°C"), ("TN", "integral_time_s", "s"), ("TV", "derivative_time_s", "s"),
          ("TA", "sample_time_s", "s"))
_SEEN_PCT: Final = 0.05  # a smaller overshoot is none
_MINUTE_S: Final = 60.0
_HOUR_S: Final = 3600.0


def diagnosis(log: Log, fitted: FittedModel) -> str:
    """Return the fit of the log: outcome, parameters with intervals, doubts, as HTML."""
    document = to_document(fitted)
    rows = model_rows(document)
    models = len(fitted.plants)
    several = (f"{models} models explain the log nearly as well; every design is made for all of them and proven on "
               "all of them." if models > 1 else "One model explains the log.")
    fit = "" if fitted.fit_pct is None else f" It follows {figure(fitted.fit_pct, 3)} % of the log's movement."
    return (
        f"<p><strong>{text_of(fitted.outcome_text)}</strong>{fit} {several}</p>"
        + table(["parameter", "value", "95 % interval", "unit"], rows, numeric=(1,))
        + "".join(f"<p>{text_of(for_page(line))}</p>" for line in fitted.log_summary)
        + _folded("What the fit has to say", fitted.notes)
        + _folded("Changed or assumed by the reader", log.repairs) + _folded("Odd, but left as it is", log.warnings)
    )


def _folded(title: str, items: Sequence[str]) -> str:
    if not items:
        return ""
    return f"<details><summary>{title} ({len(items)})</summary>{bullets([for_page(item) for item in items])}</details>"


def words(look: LoopView) -> str:
    """Return the words of a loop, see `words_html`."""
    return words_html(look.gains.words, look.proof.scenario.setpoint_degC)


def words_html(parameters: Words, setpoint_degC: float) -> str:
    """Return words as the programming tool shows them, in the order of typing, each to be copied.

    Args:
        parameters: the words.
        setpoint_degC: of the proof [°C].
    """
    rows = typed_words(parameters, setpoint_degC)
    twice = any(row.changes for row in rows)
    values = (FIRST, THEN) if twice else ("value",)
    heads = "".join(f'<th scope="col">{head}</th>' for head in ("address", "name", "type", *values, "meaning"))
    body = "".join(_word_row(row, twice=twice) for row in rows)
    whole = "\n".join("\t".join((row.address, row.name, row.format, *_typed(row, twice=twice))) for row in rows)
    return (f'<table class="words"><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>'
            + _copy(whole, "Copy all", "Copy all words"))


def _word_row(row: KeyedEntry, *, twice: bool) -> str:
    cells = "".join(f'<td data-label="{head}">{text_of(text)}</td>' for head, text in
                    (("address", row.address), ("name", row.name), ("type", row.format)))
    typed = _typed(row, twice=twice)
    for head, text in zip((FIRST, THEN) if twice else ("value",), typed, strict=True):
        copy = _copy(text, "Copy", f"Copy {row.name}: {text}") if text else ""
        cells += f'<td class="value" data-label="{head}"><code>{text_of(text)}</code>{copy}</td>'
    return f'<tr>{cells}<td class="meaning">{text_of(row.meaning)}</td></tr>'


def _typed(row: KeyedEntry, *, twice: bool) -> tuple[str, ...]:
    """Return the values in the controller's own format: first and then, or the one."""
    return (row.first_text, row.then_text if row.changes else "") if twice else (row.then_text,)


def _copy(text: str, label: str, said: str) -> str:
    return (f'<button type="button" class="copy" data-copy="{text_of(text)}" aria-label="{text_of(said)}">'
            f"{label}</button>")


def rounding(look: LoopView) -> str:
    """Return the design as wished and as the words realise it, as HTML."""
    wish, real = look.gains.design, look.realised
    if real is None:
        return "<p>This controller is no PID: its words hold no gains.</p>"
    rows = [[_term(name), _part(wish, field), _part(real, field), _change(wish, real, field), unit]
            for name, field, unit in _PARTS]
    return table(["part", "wished", "realised", "change", "unit"], rows, numeric=(1, 2, 3))


def _term(name: str) -> Markup:
    """Return a symbol that tells what it means."""
    return Markup(f'<abbr title="{text_of(the_term(name).meaning)}">{name}</abbr>')


def _part(design: PidDesign, field: str) -> str:
    value = getattr(design, field)
    return "none" if math.isinf(value) or (field == "derivative_time_s" and value == 0.0) else figure(value)


def _change(wish: PidDesign, real: PidDesign, field: str) -> str:
    before, after = getattr(wish, field), getattr(real, field)
    if not (math.isfinite(before) and math.isfinite(after)):
        return "" if before == after else "lost"
    if before == 0.0:
        return "" if after == 0.0 else "added"
    return f"{100.0 * (after / before - 1.0):+.2g} %" if after != before else "exact"


def criteria(proof: Proof) -> str:
    """Return the criteria with their limits, as HTML; those of a first look bear no verdict."""
    rows = []
    for criterion in proof.criteria:
        document = criterion.to_document()
        limit = "" if criterion.limit is None else f"{'≥' if criterion.at_least else '≤'} {figure(criterion.limit)}"
        mark = "" if criterion.limit is None or not proof.open_points else "ok" if criterion.ok else "FAIL"
        rows.append([criterion.name.replace("_", " "), criterion_value(document), limit, criterion.unit, mark])
    value_title = "worst" if proof.open_points else "nominal"
    return table(["criterion", value_title, "limit", "unit", "kept"], rows, numeric=(1,))


def verdict_text(verdict: str, proof: Proof | None, *, last: bool = False) -> str:
    """Return the verdict as one sentence that can be read out; `last`: an earlier design is still seen."""
    if proof is None:
        if verdict == "proving…":
            return proving_text("")
        return "No design for these settings; what is seen is the last one." if last else "No design yet: drop a log."
    return f"{for_page(verdict_brief(document_of(proof)))}."


def conditions(proof: Proof | None) -> str:
    """Return what a proof leaves open and the conditions it holds under, as HTML to unfold; "" where there is none."""
    parts = [] if proof is None else verdict_details(document_of(proof))
    if not parts:
        return ""
    sentences = bullets([f"{for_page(part)[:1].upper()}{for_page(part)[1:]}." for part in parts])
    return f"<details><summary>Reasons and conditions ({len(parts)})</summary>{sentences}</details>"


def sentence(proof: Proof, switch_kind: str) -> str:
    """Return the behaviour of the loop in one sentence; of a first look it is the nominal run's."""
    by_name = {criterion.name: criterion.value for criterion in proof.criteria}
    settling, overshoot, switchings = (by_name.get(name) for name in ("settling_time", "overshoot", "switchings"))
    worst = " at worst" if proof.open_points else ", nominal run"
    parts = []
    if settling is not None:
        parts.append("never settles" if math.isinf(settling) else f"settles in {duration_text(settling)}")
    if overshoot is not None:
        parts.append(f"overshoots {figure(overshoot, 2)} %{worst}" if overshoot > _SEEN_PCT else f"no overshoot{worst}")
    if switchings is not None and math.isfinite(switchings):
        printer = proof.words.target in GROUPS["printer"]
        kind = "MOSFET" if printer else "SSR" if switch_kind == "ssr" else switch_kind
        lasts = "" if kind.isupper() else f", which lasts {life(switch_kind, switchings)}"
        parts.append(f"{switchings:.0f} switchings an hour ({kind}{lasts})")
    text = ", ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def duration_text(seconds: float) -> str:
    """Return a time as people say it."""
    if seconds < 2.0 * _MINUTE_S:
        return f"{seconds:.0f} s"
    return f"{seconds / _MINUTE_S:.0f} min" if seconds < 2.0 * _HOUR_S else f"{seconds / _HOUR_S:.1f} h"


def key(names: Sequence[tuple[str, str, str]], *, walls: bool = True) -> str:
    """Return the legend of a picture: name, colour and dashes of it; `walls`: of a picture with limits."""
    shown = "".join(
        f'<li><svg width="34" height="10" aria-hidden="true"><line x1="0" y1="5" x2="34" y2="5" stroke="{color}" '
        f'stroke-width="2" stroke-dasharray="{dashes}"/></svg>{text_of(name)}</li>' for name, color, dashes in names)
    wall = ('<li><svg width="34" height="12" aria-hidden="true"><rect width="34" height="12" class="wall"/></svg>'
            "no run may be here</li><li>// time at rest left out</li>")
    return f'<ul class="key">{shown}{wall if walls else ""}</ul>'


def in_words(picture: Picture, runs: int) -> str:
    """Return the picture's numbers as a table: what the nominal run does in each part of the story."""
    rows = [[f"{number} {part.name}", duration_text(part.begin_s), figure(part.setpoint_degC),
             figure(part.highest_degC), figure(part.lowest_degC),
             "never" if part.within_s is None else f"in {duration_text(part.within_s - part.begin_s)}"]
            for number, part in enumerate(picture.parts, 1)]
    subject = f"The nominal run of {runs}" if runs > 1 else "The nominal run"
    heads = ("part", "from", "asked", "most", "least", "settled")
    return f"<p>{subject}, part by part; temperatures in °C:</p>" + table(heads, rows, numeric=(2, 3, 4))


def proving_text(done: str) -> str:
    """Return the banner's text while a proof runs, which is so far."""
    return f"Proving the words on every plausible heater{', ' if done else ''}{done}…"


def notes(look: LoopView) -> str:
    """Return how the gains and the words were found and how the loop is switched, as HTML."""
    words = look.gains.words
    settings, actuator = look.settings, look.proof.actuator
    own = controller_for(words.target).timing(words).pwm_period_s is not None
    sentences = [
        f"Gains: {look.gains.design.method}.",
        *look.gains.notes,
        f"One step of the sensor is {figure(settings.resolution_degC, 3)} °C.",
        f"The controller makes the PWM itself, with a period of {figure(actuator.pwm_period_s)} s: the slider has no "
        "say." if own else f"The switch works with a PWM period of {figure(actuator.pwm_period_s)} s.",
    ]
    if look.margins is not None:
        margins = look.margins
        sentences.append(f"Margins of the words, worst over the models: Ms {figure(margins.ms, 3)}, gain margin "
                         f"{figure(margins.gain_margin, 3)}, phase margin {figure(margins.phase_margin_deg, 3)}°.")
    return bullets([for_page(sentence) for sentence in sentences])


def comparison_html(pinned: Sequence[PinnedDesign]) -> str:
    """Return the designs set aside side by side, as HTML; what is not as in the first is marked."""
    if not pinned:
        return "<p>Keep a design to compare it with the next one; four can stand side by side.</p>"
    heads = "".join(f'<th scope="col">design {text_of(pin.name)}</th>' for pin in pinned)
    body = "".join(f'<tr><th scope="row">{text_of(name)}</th>{"".join(_differing(values))}</tr>'
                   for name, values in _side_by_side(pinned))
    return (f'<table class="compared"><thead><tr><td></td>{heads}</tr></thead><tbody>{body}</tbody></table>'
            "<p>Marked: other than in the first.</p>")


def _differing(values: Sequence[str]) -> Iterator[str]:
    for value in values:
        text = text_of(value)
        yield f"<td>{text}</td>" if value == values[0] else f"<td><mark>{text}</mark></td>"


def _side_by_side(pinned: Sequence[PinnedDesign]) -> Iterator[tuple[str, list[str]]]:
    """Return the rows of the comparison: what it is, and its text for each design."""
    settings = [pin.look.settings for pin in pinned]
    yield "controller", [one.target for one in settings]
    yield "structure", [one.structure.upper() for one in settings]
    yield "Ms wished", [figure(one.ms) for one in settings]
    for name, field, unit in _PARTS:
        yield f"{name} [{unit}]", [
            "—" if pin.look.realised is None else _part(pin.look.realised, field) for pin in pinned]
    for name in dict.fromkeys(name for pin in pinned for name in _words_of(pin)):
        yield f"word {name}", [_words_of(pin).get(name, "—") for pin in pinned]
    yield "Ms of the words", ["—" if pin.look.margins is None else figure(pin.look.margins.ms, 3) for pin in pinned]
    for name in ("overshoot", "settling_time", "iae"):
        criteria_of_pins = [next((c for c in pin.look.proof.criteria if c.name == name), None) for pin in pinned]
        unit = next((c.unit for c in criteria_of_pins if c is not None), "")
        yield f"{name.replace('_', ' ')}, nominal [{unit}]", [
            "—" if c is None else criterion_value(c.to_document()) for c in criteria_of_pins]
    yield "verdict", [pin.verdict for pin in pinned]


def _words_of(pin: PinnedDesign) -> dict[str, str]:
    rows = typed_words(pin.look.gains.words, pin.look.proof.scenario.setpoint_degC)
    return {row.name: row.then_text for row in rows}


def export_name(log: Log, look: LoopView) -> str:
    """Return the name of the zip and the report, without ending."""
    stem = "".join(c if c.isalnum() or c in "-_" else "-" for c in log.name)
    return f"{stem}-{look.settings.target}"
