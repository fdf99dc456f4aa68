"""The report: one self-contained HTML page made from the documents of the stages."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from heatertune.plc import controller_for
from heatertune.proof.verdict import samples_told
from heatertune.report import plots
from heatertune.report.commissioning_record import head, record, remedies
from heatertune.report.conditions import assumption_text, limits, specification
from heatertune.report.glossary import glossary
from heatertune.report.html import bullets, page, picture, table, text_of
from heatertune.report.text import (
    NOT_IDENTIFIED,
    criterion_value,
    figure,
    hypothesis_rows,
    model_rows,
    samples_rows,
)

__all__ = ["render", "sections"]

Document = Mapping[str, Any]
Documents = Mapping[str, Document]


def render(documents: Documents, drawn: Mapping[str, str] | None = None) -> str:
    """Return the page.

    Args:
        documents: "log", "model", "pid", "words", "proof", "pictures" and "comparison".
        drawn: of these documents what `sections` gave; None: nothing yet.
    """
    words = documents["words"]
    title = f"Commissioning record: {documents['log']['name']} → {words['target']}"
    proven = [words["target"], words["words"], words["sample_time_s"]]
    mark = hashlib.sha256(json.dumps(proven, sort_keys=True).encode()).hexdigest()[:16]
    signed = record(documents)
    found = "\n".join(f"<section>{part}</section>" for name, section in _APPENDIX.items()
                      if (part := (drawn or {}).get(name) or section(documents)))
    terms = f"<section>{glossary(signed + found)}</section>"
    appendix = f'<div class="appendix"><h1>Appendix: how it was found</h1>\n{found}\n{terms}</div>'
    body = f'<div class="record">{signed}</div>\n{appendix}'
    return page(title, body, mark=mark, foot=head(documents))


def sections(documents: Documents, names: Sequence[str]) -> dict[str, str]:
    """Return some of the appendix's sections, of which "log", "design", "proof" and "comparison" have pictures.

    Only the last one needs the comparison.
    """
    return {name: _APPENDIX[name](documents) for name in names}


def _log(documents: Documents) -> str:
    log = documents["log"]
    lists = f"<p>{text_of(log['taken']['line'])}</p>" if log.get("taken") else ""
    for name, title in (("repairs", "Changed or assumed when reading"), ("warnings", "Unusual, but left unchanged")):
        if log[name]:
            lists += f"<details><summary>{title} ({len(log[name])})</summary>{bullets(log[name])}</details>"
    rows = [["readings", str(len(log["time_s"])), "1"], _span("time", log["time_s"], "s"),
            _span("temperature", log["temperature_degC"], "°C"), _span("heater power", log["power_pct"], "%"),
            _span("setpoint", log["setpoint_degC"], "°C")]
    residuals = documents["model"].get("residuals")
    fit = picture(plots.plot_fit(log, residuals), "Log, model and residuals.") if residuals else ""
    return f"<h2>Log</h2>{table(['', 'from … to', 'unit'], rows, numeric=(1,), source=log['source'])}{lists}{fit}"


def _span(name: str, column: Sequence[float] | None, unit: str) -> list[str]:
    span = "not logged" if column is None else f"{figure(min(column))} … {figure(max(column))}"
    return [name, span, unit]


def _model(documents: Documents) -> str:
    model = documents["model"]
    parameters = table(["", "value", "95 % interval", "unit"], model_rows(model), numeric=(1,),
                       source=f"{documents['log']['name']}; {model['method']}")
    return (
        f"<h2>Model</h2><p>{text_of(model['outcome_text'])} Method: {text_of(model['method'])}.</p>{parameters}"
        f"{_checks(model)}{bullets(model.get('notes', ()))}{_candidates(model)}{_hypotheses(model)}{_price(documents)}"
    )


def _price(documents: Documents) -> str:
    price = documents["comparison"]["cost"]
    return f"<p>Effect on the gains: {text_of(price)}</p>" if price else ""


def _candidates(model: Document) -> str:
    rows = []
    for c in model.get("candidates", ()):
        second = c.get("second_time_constant_s")
        lags = figure(c["time_constant_s"]) + (f" + {figure(second)}" if second else "")
        rows.append([c["log"], c["law"], figure(c["gain_degC_per_pct"]), lags, figure(c["dead_time_s"]),
                     figure(c["ambient_degC"]), figure(c["fit_pct"]), figure(c["delta_bic"], 3),
                     *(_reduced(c.get(name)) for name in ("half_rule", "matched"))])
    if not rows:
        return ""
    heads = ["log", "law inside the fit", "gain °C/%", "lags s", "dead time s", "ambient °C", "fit %", "ΔBIC",
             "as one lag, half rule", "matched at the crossover"]
    return (
        "<h3>Models that explain the data nearly as well</h3><p>One of them may destabilise a design made for another, "
        "so design and proof run on all of them.</p>"
        + table(heads, rows, numeric=range(2, 8), source=f"{model['method']}; units in the heads")
    )


def _checks(model: Document) -> str:
    """Return what the fit is worth on windows left out of it, and whether its residuals are noise."""
    held, white, follows = (model.get(name) for name in ("held_out", "whiteness", "input_crosscorrelation"))
    if held is None or white is None:
        return ""
    rows = [["fit", figure(model["fit_pct"]), "", "%", ""],
            ["fit on windows left out", figure(held["fit_pct"]), "", "%", ""],
            ["whiteness of the residuals (Ljung–Box, 20 lags)", figure(white["ljung_box"], 3),
             f"≤ {figure(white['limit'])}", "", _mark(white["ok"])]]
    if follows is not None:
        name = f"correlation of the residuals with the power {figure(follows['at_lag_s'], 3)} s before"
        rows.append([name, figure(follows["largest"], 2), f"≤ {figure(follows['limit'], 2)}", "", _mark(follows["ok"])])
    return table(["check of the working model", "value", "by chance", "unit", ""], rows, numeric=(1, 2),
                 source="simulation of the model on the log")


def _mark(ok: bool) -> str:
    return "ok" if ok else "not by chance"


def _hypotheses(model: Document) -> str:
    """Return every hypothesis about the controller that was compared; nothing where the power was logged."""
    if not model.get("hypotheses"):
        return ""
    heads, *rows = hypothesis_rows(model)
    sure = [called for called, _, ci95, _ in model_rows(model) if ci95 != NOT_IDENTIFIED]
    seen = f"Known within the intervals above: {', '.join(sure)}." if sure else "No parameter is identified."
    return (
        f"<h3>Hypotheses about the controller</h3><p>{text_of(seen)} BIC with AR(1) errors on the same readings; RMS "
        "in °C on the readings used, on the later ones predicted from the earlier, and on blocks left out.</p>"
        f"<details open><summary>{len(rows)} compared</summary>{table(heads, rows, numeric=(1, 2, 3, 4, 6, 7, 8, 9))}"
        "</details>"
    )


def _reduced(plant: Document | None) -> str:
    return "" if plant is None else f"{figure(plant['time_constant_s'], 3)} s, {figure(plant['dead_time_s'], 3)} s"


def _design(documents: Documents) -> str:
    pid, real = documents["pid"], documents["words"]["realised"]
    rows = [
        [name, *("—" if of is None else "none" if of[field] is None else figure(of[field]) for of in (pid, real)), unit]
        for name, field, unit in (("K", "gain_pct_per_degC", "%/°C"), ("TN", "integral_time_s", "s"),
                                  ("TV", "derivative_time_s", "s"), ("TA", "sample_time_s", "s"))
    ]
    margins = [
        [name, figure(pid.get(field)), unit] for name, field, unit in
        (("Ms", "ms", "1"), ("Mt", "mt", "1"), ("gain margin", "gain_margin", "1"),
         ("phase margin", "phase_margin_deg", "°"), ("IAE after a load step of 1 %", "iae_load", "°C·s"))
    ]
    curves = documents["pictures"]["curves"]
    robustness = "" if not curves else picture(
        plots.plot_robustness(curves, documents["pictures"]["ms_limit"], pid.get("ms")),
        "The rounded controller on every model: the Nyquist curve has to stay outside the inner circle, |S| below the "
        "limit; dashed: Ms as designed, before rounding.",
    )
    target = controller_for(documents["words"]["target"]).title
    chosen = table(["", "ideal", "realised", "unit"], rows, numeric=(1, 2),
                   source=f"ideal: {pid['method']}; realised: the parameters as {target} reads them")
    return (
        f"<h2>Design and rounding</h2><p>{text_of(pid['structure'].upper())}, {text_of(pid['method'])}.</p>"
        f"{chosen}{bullets(pid.get('notes', ()))}<p>Worst over all models, of the ideal design:</p>"
        + table(["", "value", "unit"], margins, numeric=(1,), source="sampled loop of the ideal design, all models")
        + robustness
    )


def _on_drawn_heaters(proof: Document) -> str:
    """Return what drawn heaters showed, if there were any."""
    if "samples" not in proof:
        return ""
    heads, *rows = samples_rows(proof["samples"])
    told = f"{proof['samples']['verdict']}: {samples_told(proof['samples'])}."
    source = "random heater, mains voltage, room, load and sensor; each sample under its worst setting"
    return f"<h3>Samples</h3><p>{text_of(told)}</p>{table(heads, rows, numeric=(1, 2, 3, 4), source=source)}"


def _proof(documents: Documents) -> str:
    proof, pictures = documents["proof"], documents["pictures"]
    rows = []
    for name, c in proof["criteria"].items():
        limit = "none" if c["limit"] is None else f"{'≥' if c['bound'] == '>=' else '≤'} {figure(c['limit'])}"
        mark = "" if c["limit"] is None else "ok" if c["ok"] else "FAIL"
        rows.append([name.replace("_", " "), criterion_value(c), limit, c["unit"], mark, c["where"], c["what"]])
    heads = ["criterion", "worst", "limit", "unit", "", "in the run", "meaning"]
    nominal, phases = pictures["nominal"], pictures["phases"]
    shaken = phases[min(1, len(phases) - 1)]
    parts = ", ".join(f"{part['label']} at {part['begin_s']:.0f} s" for part in phases)
    return (
        "<h2>Proof</h2>"
        + table(heads, rows, numeric=(1, 2), source="closed loop in the PLC's own arithmetic; each line names its run")
        + _on_drawn_heaters(proof)
        + (f"<h3>Known faults of this controller</h3>{bullets(proof['faults'])}" if proof["faults"] else "")
        + picture(plots.plot_loop(nominal, pictures["worst"], pictures["others"], phases),
                   f"One run, {parts}; nominal: {pictures['nominal']['label']}, worst: {pictures['worst']['label']}.")
        + picture(plots.plot_pwm(nominal, shaken["begin_s"] - 60.0, shaken["begin_s"] + 180.0),
                   f"Switching of the heater around {shaken['begin_s']:.0f} s ({shaken['label']}).")
        + picture(plots.plot_wish(nominal, pictures["ideal"], phases),
                   "The ideal design in floating point and the rounded parameters.")
    )


def _comparison(documents: Documents) -> str:
    comparison = documents["comparison"]
    rows = [[r["label"], figure(r["gain_pct_per_degC"]), figure(r["integral_time_s"]), r["verdict"], figure(r["ms"]),
             ", ".join(r["fails"])] for r in comparison["rivals"]]
    heads = ["design", "K %/°C", "TN s", "verdict", "worst Ms", "fails by"]
    text = (
        "<h2>Comparison with other designs</h2><p>The same proof, for rules applied to the best single-lag model "
        "of the log alone, and for two-level control (open points at their defaults).</p>"
        + table(heads, rows, numeric=(1, 2, 4), source="the same proof; rules as named")
    )
    paper = comparison.get("paper")
    if paper:
        rows = [[p["label"], *(f"{p[name]:.1f}" for name in ("overshoot_degC", "offset_degC", "offset_after_degC"))]
                for p in paper["runs"]]
        text += (
            f"<h3>The paper's own settings</h3><p>{text_of(paper['message'])}</p>"
            + table(["run", "overshoot °C", "offset before the disturbance °C", "mean of the last 150 s °C"], rows,
                     numeric=(1, 2, 3), source="the paper's settings in the S7-200's arithmetic; units in the heads")
            + picture(plots.plot_paper(paper["runs"]), "The paper's settings in the S7-200's integer arithmetic.")
        )
    return text


_APPENDIX: Mapping[str, Callable[[Documents], str]] = {
    "specification": specification, "proof": _proof, "limits": limits, "remedies": remedies, "design": _design,
    "model": _model, "log": _log, "assumed": assumption_text, "comparison": _comparison,
}
