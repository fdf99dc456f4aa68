"""Values → the words and tables on the page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from heatertune.log.values import Log
from heatertune.model.document import to_document
from heatertune.model.values import FittedModel
from heatertune.pid.values import PidDesign
from heatertune.plc import controller_for
from heatertune.plc.typed import typed_table, typed_words, word_text
from heatertune.proof import Proof
from heatertune.proof.verdict import verdict_line
from heatertune.report.html import bullets, table, text_of
from heatertune.report.text import criterion_value, figure, model_rows
from heatertune.studio.loop import Look
from heatertune.studio.session import Pinned

__all__ = ["compared", "criteria", "diagnosis", "export_name", "notes", "rounding", "verdict_text", "words"]

_PARTS = (("K", "gain_pct_per_degC", "%/°C"), ("TN", "integral_time_s", "s"), ("TV", "derivative_time_s", "s"),
          ("TA", "sample_time_s", "s"))


def diagnosis(log: Log, fitted: FittedModel) -> str:
    """Return what the log told: outcome, parameters with intervals, doubts, as HTML."""
    document = to_document(fitted)
    rows = model_rows(document)
    models = len(fitted.plants)
    several = (f"{models} models explain the log nearly as well; every design is made for all of them and proven on "
               "all of them." if models > 1 else "One model explains the log.")
    fit = "" if fitted.fit_pct is None else f" It follows {figure(fitted.fit_pct, 3)} % of the log's movement."
    return (
        f"<p><strong>{text_of(fitted.outcome.value)}</strong>{fit} {several}</p>"
        + table(["", "value", "95 % interval", "unit"], rows, numeric=(1,))
        + "".join(f"<p>{text_of(line)}</p>" for line in fitted.log_told)
        + _folded("What the fit has to say", fitted.notes)
        + _folded("Changed or assumed by the reader", log.repairs) + _folded("Odd, but left as it is", log.doubts)
    )


def _folded(title: str, items: Sequence[str]) -> str:
    if not items:
        return ""
    return f"<details><summary>{title} ({len(items)})</summary>{bullets(items)}</details>"


def words(look: Look) -> str:
    """Return the words in the order in which they are typed in, as HTML."""
    heads, values, rows = typed_table(typed_words(look.gains.words, look.proof.scenario.setpoint_degC))
    return table(heads, rows, numeric=values)


def rounding(look: Look) -> str:
    """Return the design as wished and as the words realise it, as HTML."""
    wish, real = look.gains.design, look.realised
    if real is None:
        return "<p>This controller is no PID: its words hold no gains.</p>"
    rows = [[name, _part(wish, field), _part(real, field), _change(wish, real, field), unit]
            for name, field, unit in _PARTS]
    return table(["", "wished", "realised", "change", "unit"], rows, numeric=(1, 2, 3))


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
    return table(["criterion", "worst" if proof.open_points else "nominal", "limit", "unit", ""], rows, numeric=(1,))


def verdict_text(verdict: str, proof: Proof | None, *, last: bool = False) -> str:
    """Return the verdict as one sentence that can be read out; `last`: an earlier design is still seen."""
    if proof is None:
        if verdict == "proving…":
            return "Proving the words on every model under every open point of the manual…"
        return "No design for these settings; what is seen is the last one." if last else "No design yet: drop a log."
    return f"{verdict_line(proof.to_document())}."


def notes(look: Look) -> str:
    """Return how the gains and the words were found and how the loop is switched, as HTML."""
    held, search = look.gains.words, look.gains.search
    settings, actuator = look.settings, look.proof.actuator
    own = controller_for(held.target).timing(held).pwm_period_s is not None
    sentences = [
        f"Gains: {look.gains.design.method}.",
        *([] if search is None else search["notes"]),
        f"One step of the sensor is {figure(settings.resolution_degC, 3)} °C.",
        f"The controller makes the PWM itself, with a period of {figure(actuator.pwm_period_s)} s: the slider has no "
        "say." if own else f"The switch works with a PWM period of {figure(actuator.pwm_period_s)} s.",
    ]
    if look.margins is not None:
        margins = look.margins
        sentences.append(f"Margins of the words, worst over the models: Ms {figure(margins.ms, 3)}, gain margin "
                         f"{figure(margins.gain_margin, 3)}, phase margin {figure(margins.phase_margin_deg, 3)}°.")
    return bullets(sentences)


def compared(pinned: Sequence[Pinned]) -> str:
    """Return the designs set aside side by side, as HTML."""
    if not pinned:
        return "<p>Keep a design to compare it with the next one; four can stand side by side.</p>"
    rows = [["controller", *(pin.look.settings.target for pin in pinned)],
            ["structure", *(pin.look.settings.structure.upper() for pin in pinned)],
            ["Ms wished", *(figure(pin.look.settings.ms) for pin in pinned)]]
    for name, field, unit in _PARTS:
        rows.append([f"{name} [{unit}]", *(
            "—" if pin.look.realised is None else _part(pin.look.realised, field) for pin in pinned)])
    rows.append(["words", *(
        ", ".join(f"{row.name} {word_text(row.then, row.format)}" for row in typed_words(
            pin.look.gains.words, pin.look.proof.scenario.setpoint_degC)) for pin in pinned)])
    rows.append(["Ms of the words", *(
        "—" if pin.look.margins is None else figure(pin.look.margins.ms, 3) for pin in pinned)])
    for name in ("overshoot", "settling_time", "iae"):
        worst = [next((c for c in pin.look.proof.criteria if c.name == name), None) for pin in pinned]
        unit = next((c.unit for c in worst if c is not None), "")
        rows.append([f"{name.replace('_', ' ')}, nominal [{unit}]", *(
            "—" if c is None else criterion_value(c.to_document()) for c in worst)])
    rows.append(["verdict", *(pin.verdict for pin in pinned)])
    return table(["", *(f"design {pin.name}" for pin in pinned)], rows)


def export_name(log: Log, look: Look) -> str:
    """Return the name of the zip and the report, without ending."""
    kept = "".join(c if c.isalnum() or c in "-_" else "-" for c in log.name)
    return f"{kept}-{look.settings.target}"
