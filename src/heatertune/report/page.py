"""The report: one self-contained HTML page made from the documents of the stages."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from heatertune.report import plots
from heatertune.report.style import to_svg
from heatertune.report.text import criterion_value, figure, model_rows, word

__all__ = ["render"]

Document = Mapping[str, Any]
Documents = Mapping[str, Document]

_STYLE = """
:root { --ink: #1a1a1a; --soft: #595959; --line: #d5d5d5; --pass: #00634a; --fail: #a33c00; }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: #fff; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
p, li { max-width: 46rem; } .soft { color: var(--soft); }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: .25rem .7rem; text-align: left; vertical-align: top; }
td.n { text-align: right; } .pass { color: var(--pass); font-weight: 600; }
.fail { color: var(--fail); font-weight: 700; }
.verdict { font-size: 1.3rem; border: 2px solid currentColor; padding: .3rem .8rem; display: inline-block; }
figure { margin: 1rem 0; } figure svg { max-width: 100%; height: auto; } figcaption { color: var(--soft); }
code { font-family: ui-monospace, monospace; }
@media print { h2 { break-after: avoid; } figure, table { break-inside: avoid; } body { margin: 0; max-width: none; } }
"""


def render(documents: Documents) -> str:
    """Return the page.

    Args:
        documents: "log", "model", "pid", "words", "proof", "pictures" and "comparison".
    """
    title = f"{documents['log']['name']} → {documents['words']['target']}"
    body = "\n".join(section(documents) for section in _SECTIONS)
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>heatertune: {_text(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_STYLE}</style></head>\n'
        f"<body><main>\n<h1>{_text(title)}</h1>\n{body}\n</main></body></html>\n"
    )


def _verdict(documents: Documents) -> str:
    proof = documents["proof"]
    models = len({run["model"] for run in proof["runs"]})
    forced = " The words were exported in spite of it (--force)." if documents["words"].get("forced") else ""
    return (
        f'<p class="verdict {proof["verdict"].lower()}">{proof["verdict"]}</p>'
        f"<p>{len(proof['runs'])} closed-loop runs of the PLC's own arithmetic: {models} heater models, each under "
        "every setting of what the manual leaves open. Setpoint "
        f"{figure(documents['pictures']['nominal']['setpoint_degC'])} °C.{forced}</p>"
    )


def _log(documents: Documents) -> str:
    log = documents["log"]
    lists = ""
    for name, title in (("repairs", "Changed or assumed by the reader"), ("doubts", "Odd, but left as it is")):
        if log[name]:
            lists += f"<details><summary>{title} ({len(log[name])})</summary>{_list(log[name])}</details>"
    residuals = documents["model"].get("residuals")
    picture = _picture(plots.plot_fit(log, residuals), "Log, model and residuals.") if residuals else ""
    return f"<h2>Log</h2><p>{_text(log['source'])}, {len(log['time_s'])} readings.</p>{lists}{picture}"


def _model(documents: Documents) -> str:
    model = documents["model"]
    found = _table(["", "value", "95 % interval", "unit"], model_rows(model), numeric=(1,))
    return (
        f"<h2>Heater</h2><p>{_text(model['outcome_text'])} Method: {_text(model['method'])}.</p>{found}"
        f"{_list(model.get('notes', ()))}{_candidates(model)}{_price(documents)}"
    )


def _price(documents: Documents) -> str:
    price = documents["comparison"]["price"]
    return f"<p>What that means for the gains: {_text(price)}</p>" if price else ""


def _candidates(model: Document) -> str:
    rows = []
    for c in model.get("candidates", ()):
        second = c.get("second_time_constant_s")
        lags = figure(c["time_constant_s"]) + (f" + {figure(second)}" if second else "")
        rows.append([c["log"], c["law"], figure(c["gain_degC_per_pct"]), lags, figure(c["dead_time_s"]),
                     figure(c["ambient_degC"]), figure(c["fit_pct"]), figure(c["delta_bic"], 3)])
    if not rows:
        return ""
    heads = ["log", "law inside the fit", "gain °C/%", "lags s", "dead time s", "ambient °C", "fit %", "ΔBIC"]
    return (
        "<h3>Models that explain the data nearly as well</h3><p>One of them may destabilise a design made for another, "
        f"so design and proof run on all of them.</p>{_table(heads, rows, numeric=range(2, 8))}"
    )


def _design(documents: Documents) -> str:
    pid, real = documents["pid"], documents["words"]["realised"]
    rows = [
        [name, *("—" if of is None else "none" if of[field] is None else figure(of[field]) for of in (pid, real)), unit]
        for name, field, unit in (("K", "gain_pct_per_degC", "%/°C"), ("TN", "integral_time_s", "s"),
                                  ("TV", "derivative_time_s", "s"), ("TA", "sample_time_s", "s"))
    ]
    margins = [
        [name, figure(pid.get(field)), unit] for name, field, unit in
        (("Ms", "ms", ""), ("Mt", "mt", ""), ("gain margin", "gain_margin", ""),
         ("phase margin", "phase_margin_deg", "°"), ("IAE after a load step of 1 %", "iae_load", "°C·s"))
    ]
    curves = documents["pictures"]["curves"]
    robustness = "" if not curves else _picture(
        plots.plot_robustness(curves, documents["pictures"]["ms_limit"]),
        "The words as realised, on every model (worst one orange): the Nyquist curve has to stay out of the circle, "
        "|S| below the limit.",
    )
    return (
        f"<h2>Design</h2><p>{_text(pid['structure'].upper())}, {_text(pid['method'])}.</p>"
        f"{_table(['', 'wished', 'realised by the words', 'unit'], rows, numeric=(1, 2))}{_list(pid.get('notes', ()))}"
        f"<p>Worst over all models, of the wished design:</p>{_table(['', 'value', 'unit'], margins, numeric=(1,))}"
        + robustness
    )


def _words(documents: Documents) -> str:
    words = documents["words"]
    rows = [[f["address"], f["name"], word(words["words"][f["name"]]), f["comment"], "☐"] for f in words["fields"]]
    files = "".join(f"<li><code>{_text(name)}</code></li>" for name in words["files"])
    scale = words["scaling"]
    return (
        f"<h2>Words for {_text(words['target'])}</h2><p>In the order in which they are typed in. Sensor "
        f"{figure(scale['low_degC'])}…{figure(scale['high_degC'])} °C; call every "
        f"{figure(words['sample_time_s'])} s. The setpoint of the proof, {figure(words['setpoint_degC'])} °C, is "
        f"{words['setpoint_units']} units.</p>"
        f"{_table(['address', 'word', 'value', 'meaning', 'typed'], rows, numeric=(2,))}<ul>{files}</ul>"
    )


def _proof(documents: Documents) -> str:
    proof, pictures = documents["proof"], documents["pictures"]
    rows = []
    for name, c in proof["criteria"].items():
        limit = "told only" if c["limit"] is None else f"{'≥' if c['bound'] == '>=' else '≤'} {figure(c['limit'])}"
        mark = "" if c["limit"] is None else "ok" if c["ok"] else "FAIL"
        rows.append([name.replace("_", " "), criterion_value(c), limit, c["unit"], mark, c["where"], c["what"]])
    heads = ["criterion", "worst", "limit", "unit", "", "in the run", "meaning"]
    nominal, kick = pictures["nominal"], pictures["kick_s"]
    return (
        f"<h2>Proof</h2>{_table(heads, rows, numeric=(1,))}"
        + (f"<h3>Known faults of this controller</h3>{_list(proof['faults'])}" if proof["faults"] else "")
        + _picture(plots.plot_loop(nominal, pictures["worst"], pictures["others"]),
                   f"Heat-up and a disturbance at {figure(kick)} s; nominal: {pictures['nominal']['label']}, worst: "
                   f"{pictures['worst']['label']}, grey: all other models.")
        + _picture(plots.plot_pwm(nominal, kick - 60.0, kick + 180.0), "The heater's switching around the disturbance.")
        + _picture(plots.plot_wish(nominal, pictures["wish"]),
                   "What the design meant, in floating point, against the words.")
    )


def _comparison(documents: Documents) -> str:
    comparison = documents["comparison"]
    rows = [[r["label"], figure(r["gain_pct_per_degC"]), figure(r["integral_time_s"]), r["verdict"], figure(r["ms"]),
             ", ".join(r["fails"])] for r in comparison["rivals"]]
    heads = ["design", "K %/°C", "TN s", "verdict", "worst Ms", "fails by"]
    text = (
        "<h2>What other designs would have done</h2><p>The same proof, for rules applied to the best single-lag model "
        f"of the log alone (open points at their defaults).</p>{_table(heads, rows, numeric=(1, 2, 4))}"
    )
    paper = comparison.get("paper")
    if paper:
        rows = [[p["label"], *(f"{p[name]:.1f}" for name in ("overshoot_degC", "offset_degC", "offset_after_degC"))]
                for p in paper["runs"]]
        text += (
            f"<h3>The paper's own settings</h3><p>{_text(paper['told'])}</p>"
            + _table(["run", "overshoot °C", "offset before the disturbance °C", "mean of the last 150 s °C"], rows,
                     numeric=(1, 2, 3))
            + _picture(plots.plot_paper(paper["runs"]), "The paper's settings in the S7-200's integer arithmetic.")
        )
    return text


def _limits(documents: Documents) -> str:
    unproven = [
        "Heaters outside the listed models: nothing is claimed for them.",
        "A sensor that is wrong, a relay that sticks, mains voltage that changes, a jittering timer.",
        "Anything but one heat-up from ambient and one disturbance at one setpoint.",
        *documents["proof"].get("unproven", ()),
    ]
    return f"<h2>What was not proven</h2>{_list(unproven)}"


_SECTIONS: Sequence[Callable[[Documents], str]] = (
    _verdict, _words, _proof, _design, _model, _log, _comparison, _limits,
)


def _picture(drawn: Any, caption: str) -> str:
    return f"<figure>{to_svg(drawn)}<figcaption>{_text(caption)}</figcaption></figure>"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], *, numeric: Sequence[int] = ()) -> str:
    head = "".join(f"<th scope='col'>{_text(cell)}</th>" for cell in heads)
    body = "".join("<tr>" + "".join(_cell(cell, i in numeric) for i, cell in enumerate(row)) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cell(cell: str, numeric: bool) -> str:
    kinds = (("n", numeric), ("pass", cell in ("ok", "PASS")), ("fail", cell == "FAIL"))
    marks = [name for name, found in kinds if found]
    kind = f' class="{" ".join(marks)}"' if marks else ""
    return f"<td{kind}>{_text(cell)}</td>"


def _list(items: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{_text(item)}</li>" for item in items) + "</ul>" if items else ""


def _text(content: str) -> str:
    return html.escape(str(content))
