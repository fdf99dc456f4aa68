"""Tables to read in ten seconds, from the documents of the stages.

Also the comparison of two sets of parameters as text, and a proposed experiment: the uncertainty before and after it,
and how to run it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from heatertune.codec import Document
from heatertune.plc.controller import controller_for
from heatertune.plc.inputs import INPUTS
from heatertune.plc.keyed_entry import KeyedEntry, setpoint_entry, typed_table, typed_words, word_text
from heatertune.plc.targets import GROUPS, NAMES, TARGETS
from heatertune.proof.verdict import samples_text, verdict_line
from heatertune.proof.words_file import words_of
from heatertune.report.layout import table
from heatertune.units import NOMENCLATURE, written

__all__ = [
    "NOT_IDENTIFIED", "advice_table", "alternatives_table", "criteria_table", "criterion_value", "design_lines",
    "difference_lines", "feed_forward_lines", "figure", "forms_lines", "holder", "hypothesis_rows",
    "hypothesis_table", "keyed_entries", "limit_text", "main_file", "model_lines", "model_rows", "opinion_rows",
    "outcome_lines", "pareto_table", "plan_csv", "plan_lines", "quantity", "ramp_note", "readable_name",
    "samples_rows", "samples_table", "search_notes", "setpoint_text", "summary", "unit_text", "validation_lines",
    "words_table",
]


NOT_IDENTIFIED = "not identified"


def figure(value: Any, digits: int = 4) -> str:
    """Return a number as text, large ones in whole units instead of powers of ten; "—" if unknown."""
    if value is None:
        return "—"
    if isinstance(value, int | float) and not isinstance(value, bool):
        return written(value, digits)
    return str(value)


def quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """Return a criterion's number with its unit; one that is not finite never happened."""
    return "never" if value is None or math.isinf(value) else f"{figure(value, digits)}{unit_text(unit)}"


def unit_text(unit: str) -> str:
    """Return a unit as it follows a number."""
    return {"1": "", "°": "°", "1/h": " an hour"}.get(unit, f" {unit}")


def limit_text(criterion: Document) -> str:
    """Return a criterion's limit in words."""
    if criterion["limit"] is None:
        return "none"
    way = "at least" if criterion["bound"] == ">=" else "at most"
    return f"{way} {quantity(criterion['limit'], criterion['unit'].partition(' of ')[0])}"


def criterion_value(criterion: Document) -> str:
    """Return a criterion's value; one that is not finite never happened, or, where it is ok, has no limit."""
    return ("unlimited" if criterion["ok"] else "never") if criterion["value"] is None else figure(criterion["value"])


def model_lines(model: Document) -> str:
    """Return the fitted FOPDT, its intervals, its candidates and the parameters that were not identified."""
    rows = [("", "value", "95 %", ""), *model_rows(model)]
    unseen = model.get("held_out")
    unseen_fit = "" if unseen is None else f" ({figure(unseen['fit_pct'])} % on windows left out)"
    fit = f"fit {figure(model.get('fit_pct'))} %{unseen_fit}, {model['method']}"
    lines = [table(rows, right=(1,)), fit, model["outcome_text"]]
    others = len(model.get("candidates", ()))
    if others > 1:
        lines.append(f"{others} plausible heaters; design and proof run on all of them.")
    lines += [f"! {finding['effect']}: {finding['message']}" for finding in model.get("findings", ())]
    return "\n".join(lines + [f"- {note}" for note in model.get("notes", ())])


def model_rows(model: Document) -> list[tuple[str, str, str, str]]:
    """Return name, value, 95 % interval and unit of each parameter and combination."""
    parameters = [(name, model[name], model.get(f"{name}_ci95"))
                  for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")]
    parameters += [(name, item["value"], item["ci95"]) for name, item in model.get("combinations", {}).items()]
    cooling = model.get("cooling")
    parameters += [] if cooling is None else [("cooling_gain", cooling["cooling_gain"], cooling["cooling_gain_ci95"])]
    names = [NOMENCLATURE[name] for name, _, _ in parameters]
    return [(label, figure(value), _interval(ci95), unit)
            for (_, label, unit), (_, value, ci95) in zip(names, parameters, strict=True)]


def hypothesis_table(model: Document) -> str:
    """Return every hypothesis as aligned columns; see `hypothesis_rows`."""
    return table(hypothesis_rows(model), right=(1, 3, 4, 6, 7, 8, 9))


def hypothesis_rows(model: Document) -> list[tuple[str, ...]]:
    """Return heads and every hypothesis, the best by BIC first: fit, errors, heater, bounds touched.

    Errors are RMS in °C: on the readings used, on the later ones foretold from the earlier, on blocks left out.
    """
    heads = ("law", "gain", "lags s", "dead s", "ambient", "fit %", "ΔBIC", "RMS", "foretold", "left out", "on a bound")
    rows: list[tuple[str, ...]] = [heads]
    for tried in model["hypotheses"]:
        lags = [figure(tried[name], 3) for name in ("time_constant_s", "second_time_constant_s") if name in tried]
        fits = [figure(fit, 3) for fit in tried["fits_pct"].values()] or [figure(tried["fit_pct"], 3)]
        rows.append((
            tried["law"], figure(tried["gain_degC_per_pct"], 3), " + ".join(lags),
            figure(tried["dead_time_s"], 3), figure(tried["ambient_degC"], 3), " / ".join(fits),
            f"{tried['delta_bic']:.0f}", *[figure(tried[f"{name}_degC"], 2)
                                          for name in ("rmse", "hold_out_rmse", "cross_rmse")],
            ", ".join(tried["on_bound"]),
        ))
    return rows


def validation_lines(verdict: Document) -> str:
    """Return each model's run on another log, its meaning, and the verdict with the failed criteria."""
    rows = [("model", "ambient", "fit %", "bias °C", "RMS °C", "white", "follows the power")]
    for run in verdict["runs"]:
        test = run["input_crosscorrelation"]
        follows = "—" if test is None else "no" if test["ok"] else f"after {figure(test['at_lag_s'], 3)} s"
        numbers = (figure(run[name], 3) for name in ("ambient_degC", "fit_pct", "bias_degC", "rmse_degC"))
        rows.append((run["label"], *numbers, "yes" if run["whiteness"]["ok"] else "no", follows))
    by = f", by {' and '.join(verdict['fails'])}" if verdict["fails"] else ""
    notes = [f"- {note}" for note in verdict["notes"]]
    return "\n".join([table(rows, right=(1, 2, 3, 4)), *notes, f"VERDICT {verdict['verdict']}{by}"])


def design_lines(design: Document) -> str:
    """Return K, TN, TV, TA and the margins."""
    tn = "none" if design["integral_time_s"] is None else f"{figure(design['integral_time_s'])} s"
    rows = [
        ("K", f"{figure(design['gain_pct_per_degC'])} %/°C", "Ms", figure(design.get("ms"))),
        ("TN", tn, "Mt", figure(design.get("mt"))),
        ("TV", f"{figure(design['derivative_time_s'])} s", "gain margin", figure(design.get("gain_margin"))),
        ("TA", f"{figure(design['sample_time_s'])} s", "phase margin", f"{figure(design.get('phase_margin_deg'))} °"),
    ]
    lines = [table(rows), f"{design['structure'].upper()}, {design['method']}"]
    return "\n".join(lines + [f"- {note}" for note in design.get("notes", ())])


def opinion_rows(opinion: Document) -> list[list[str]]:
    """Return quantity, figure of heatertune and of the library, allowed difference, and which library it is."""
    figures = ("value", "library_value", "tolerance")
    return [[row["quantity"], *("∞" if row[name] is None else figure(row[name], 5) for name in figures),
             row["library"] if row["agrees"] else f"{row['library']}: DISAGREES"] for row in opinion["rows"]]


def opinion_lines(opinion: Document) -> str:
    """Return the results of python-control and CasADi, next to those of heatertune."""
    rows = [["", "heatertune", "the library", "allowed", "by"], *opinion_rows(opinion)]
    return "\n".join([*([table(rows, right=(1, 2, 3))] if opinion["rows"] else []),
                      *(f"- {note}" for note in opinion["notes"])])


def forms_lines(forms: Document) -> str:
    """Return the same controller in the series and in the parallel form."""
    series, parallel = forms["series"], forms["parallel"]
    in_series = "none: TV is above TN/4" if series is None else (
        f"K {figure(series['gain_pct_per_degC'])} %/°C, TN {_seconds(series['integral_time_s'])}, "
        f"TV {_seconds(series['derivative_time_s'])}"
    )
    gains = (f"{name.capitalize()} {figure(parallel[name])} {unit}"
             for name, unit in (("kp", "%/°C"), ("ki", "%/(°C·s)"), ("kd", "%·s/°C")))
    return f"- the same in the series form: {in_series}\n- the same in the parallel form: {', '.join(gains)}"


def _seconds(value: float) -> str:
    return "none" if math.isinf(value) else f"{figure(value)} s"


def alternatives_table(rows: Sequence[Document]) -> str:
    """Return the results of the rules compared with the design; the reason why a rule does not apply ends its row."""
    cells = [("method", "K", "TN", "TV", "worst Ms", "IAE load", "")]
    names = ("gain_pct_per_degC", "integral_time_s", "derivative_time_s", "ms", "iae_load")
    for row in rows:
        numbers = ["∞" if row[name] == math.inf else figure(row[name]) for name in names]
        cells.append((row["method"], *numbers, row["why_not"] or ""))
    return table(cells, right=(1, 2, 3, 4, 5))


def pareto_table(front: Document) -> str:
    """Return the front: for each limit of Ms the cost, and how much lower it is than in the most robust row."""
    first = front["rows"][0]["cost"]
    rows: list[tuple[str, ...]] = [("Ms <=", "K %/°C", "TN s", "TV s", "Mt", "Mks %/°C", "cost", "saved", "")]
    for row in front["rows"]:
        names = ("ms_limit", "gain_pct_per_degC", "integral_time_s", "derivative_time_s", "mt", "mks", "cost")
        saved = f"{100.0 * (1.0 - row['cost'] / first):.0f} %"
        rows.append((*[figure(row[name]) for name in names], saved, "" if row["on_front"] else "no gain"))
    loop = "continuous loop" if front["sample_time_s"] == 0.0 else f"TA = {figure(front['sample_time_s'])} s"
    return f"{front['structure'].upper()}, {loop}; cost: {front['cost']}\n{table(rows, right=tuple(range(8)))}"


def words_table(words: Document) -> str:
    """Return the parameters in the order of entry, and how they were found."""
    heads, values, cells = typed_table(keyed_entries(words))
    notes = [f"- {note}" for note in (*ramp_note(words), *search_notes(words))]
    return "\n".join([table([heads, *cells], right=values), *notes])


def keyed_entries(words: Document) -> tuple[KeyedEntry, ...]:
    """Return the words of a document as they are typed in."""
    return typed_words(words_of(words, words["target"], "words.json"), words["setpoint_degC"])


def holder(target: str) -> str:
    """Return the kind of device of a controller: "PLC", "instrument", "printer" or "controller"."""
    packages = {TARGETS[name]: group for group, names in GROUPS.items() for name in names}
    group = packages.get(NAMES.get(target, ""), "PLC")
    return "controller" if group == "maker" else group


def main_file(words: Document) -> str:
    """Return which of the exported files a person loads or enters first."""
    declared = controller_for(words["target"]).main_file
    return declared if declared in words["files"] else str(words["files"][0])


def setpoint_text(words: Document) -> str:
    """Return the setpoint of the proof of a document's words as a person enters it."""
    return setpoint_entry(words_of(words, words["target"], "words.json"), words["setpoint_degC"])


def called_every_s(words: Document, switch: Document | None) -> float:
    """Return the interval at which a program calls the controller [s]: TA; of a block that keeps it, a PWM step."""
    if switch is None or controller_for(words["target"]).own_pwm[0] is None:
        return float(words["sample_time_s"])
    return float(switch.get("resolution_s", words["sample_time_s"]))


def ramp_note(words: Document) -> list[str]:
    """Describe the setpoint ramp or boost in a sentence; empty if there is none."""
    if boost := words.get("boost"):
        near, far = (figure(boost[name]) for name in ("within_degC", "again_degC"))
        return [f"The program gives full power until {near} °C from the setpoint and only then enables the controller; "
                f"more than {far} °C off, it does so again. The exported files contain the program of this boost; the "
                "parameters are proven with it only."]
    ramp = words.get("setpoint_ramp")
    if ramp is None:
        return []
    every = "call" if ramp["calls"] == 1 else f"{ramp['calls']} calls"
    rate, unit = figure(ramp["degC_per_min"], 3), "units" if isinstance(ramp["step"], int) else "°C"
    holdback = ramp.get("hold_degC")
    hold = "" if holdback is None else f", and stays within {figure(holdback, 3)} °C of the temperature while it ramps"
    starts = "" if holdback is None else (
        " After a start-up it begins at the temperature, and the controller's integral at zero: a short outage of the "
        "controller may take as long to return from as a cold start.")
    return [f"The setpoint moves by {figure(ramp['step'])} {unit} every {every}, {rate} °C/min{hold}.{starts} The "
            "exported files contain the program of this ramp; the parameters are proven with it only."]


def search_notes(words: Document) -> list[str]:
    """Return how the parameters were found and how robust they are, one sentence each; empty for given parameters."""
    search = words.get("search")
    if search is None:
        return []
    drawn = search["ms_sampled"]
    return [*search["notes"], *([drawn["message"]] if drawn else [])]


def criteria_table(proof: Document) -> str:
    """Return each criterion (worst value, limit, verdict, the run it comes from) and the controller's known faults."""
    rows = [("criterion", "worst", "limit", "unit", "", "where")]
    for name, criterion in proof["criteria"].items():
        limit = "" if criterion["limit"] is None else f"{criterion['bound']} {figure(criterion['limit'])}"
        verdict = "" if criterion["limit"] is None else "ok" if criterion["ok"] else "FAIL"
        rows.append((readable_name(name), criterion_value(criterion), limit, criterion["unit"], verdict,
                     criterion["where"]))
    return "\n".join([table(rows, right=(1,)), *[f"fault: {fault}" for fault in proof["faults"]]])


def samples_table(proof: Document) -> list[str]:
    """Return the results of the samples of a proof, if any, as lines: quantiles and percentage that keeps the limit."""
    if "samples" not in proof:
        return []
    samples = proof["samples"]
    return [
        f"samples from seed {samples['seed']} on: {samples_text(samples)}: {samples['verdict']}; the worst: --replay "
        f"{samples['worst_seed']}",
        table(samples_rows(samples), right=(1, 2, 3, 4)),
    ]


def samples_rows(samples: Document) -> list[tuple[str, ...]]:
    """Return quantiles of each criterion and the share of the samples that keeps its limit, a head first."""
    rows: list[tuple[str, ...]] = [("criterion", "median", "95 %", "99 %", "worst", "limit", "unit", "keep it")]
    for name, spot in samples["criteria"].items():
        numbers = ["never" if spot[key] is None else figure(spot[key]) for key in ("median", "p95", "p99", "worst")]
        limit = "" if spot["limit"] is None else f"{spot.get('bound', '<=')} {figure(spot['limit'])}"
        share = "" if spot["limit"] is None else f"{100.0 * spot['passing']:.4g} %"
        rows.append((readable_name(name), *numbers, limit, spot["unit"], share))
    return rows


def advice_table(advice: Document) -> str:
    """Return the symptom with its numbers, and each step of the advice: gains, verdict and criteria after it."""
    step = advice["response"]
    settled = "never" if step["settled_s"] is None or math.isinf(step["settled_s"]) else f"{step['settled_s']:.0f} s"
    decay = "" if step["decay"] is None else f", each {figure(step['decay'], 2)} of the one before"
    lines = [
        f"{advice['log'] or 'the proof'}: {advice['symptom_text']}",
        f"- step of {figure(step['step_degC'])} °C to {figure(step['setpoint_degC'])} °C, overshoot "
        f"{figure(step['overshoot_pct'], 3)} %, settled: {settled} (expected within {step['expected_s']:.0f} s)",
        f"- at the end {figure(step['distance_degC'], 2)} °C short of the setpoint, swinging by "
        f"±{figure(step['swing_degC'], 2)} °C; {step['swings']} wide swings{decay}",
    ]
    aim = f"effect on {readable_name(advice['aim'])}"
    rows = [("", "Kp", "Ki", "Kd", "verdict", "overshoot %", "settling s", "IAE °C·s", aim, "fails by")]
    for case in advice["cases"]:
        numbers = [_reached(case.get(name)) for name in ("overshoot", "settling_time", "iae")]
        rows.append((case["step"], *[figure(case[gain]) for gain in ("kp", "ki", "kd")], case["verdict"], *numbers,
                     case["effect"], ", ".join(case["fails"])))
    best = f"best: {advice['best']}" if advice["best"] else "no step improves the design on the model and passes"
    notes = [f"- {note}" for note in advice["notes"]]
    return "\n".join([*lines, table(rows, right=(1, 2, 3, 5, 6, 7)), *([best] if len(rows) > 2 else []), *notes])


def feed_forward_lines(fed: Document) -> str:
    """Return the feed-forward, and the working heater and the worst run compared with plain feedback."""
    low, high = fed["effect_pct_per_unit_ci95"]
    (calm, strong), (begin, end) = fed["step"], fed["range"]
    labelled_runs = {"as found": fed["runs"][0], f"worst of {len(fed['runs'])} runs": fed["runs"][fed["worst"]]}
    rows = [("", "error plain", "fed forward", "°C·s", "largest plain", "fed forward", "°C", "")]
    rows += [(name, *map(figure, run["iae_degC_s"]), "",
              *(figure(number, 3) for number in run["deviation_degC"]), "", run["label"])
             for name, run in labelled_runs.items()]
    return "\n".join([
        f"{fed['disturbance']}: {figure(fed['effect_pct_per_unit'])} % of full power per unit "
        f"({figure(low, 3)} … {figure(high, 3)})",
        f"{fed['input']} = {word_text(fed['at_low'])} at {begin:g}, {word_text(fed['at_high'])} at {end:g}: "
        f"{fed['pct_per_unit']:+.4g} % per unit, none at {fed['calm']:g}",
        f"the disturbance from {calm:g} to {figure(strong)} (logged: up to {figure(fed['logged'][1])}) and back, "
        f"{figure(fed['load_pct'], 3)} % of full power, at {fed['setpoint_degC']:g} °C:",
        table(rows, right=(1, 2, 4, 5)),
        f"VERDICT {fed['verdict']}{', ' if fed['refusal'] else ''}{fed['refusal']}",
    ])


def readable_name(name: str) -> str:
    """Return a name as people read it."""
    return name.replace("_", " ")


def _reached(value: float | None) -> str:
    return "never" if value is not None and math.isinf(value) else figure(value)


def summary(documents: Mapping[str, Document]) -> str:
    """Return the terminal's summary of a whole design."""
    model, pid, words, proof = (documents[name] for name in ("model", "pid", "words", "proof"))
    parts = [
        ("heater", model_lines(model)),
        ("design", design_lines(pid)),
        (f"words for {words['target']}", words_table(words)),
        ("proof", criteria_table(proof)),
        *([("second opinion", opinion_lines(documents["second_opinion"]))] if "second_opinion" in documents else []),
        *([("drawn heaters", "\n".join(drawn))] if (drawn := samples_table(proof)) else []),
    ]
    comparison = documents["comparison"]
    if comparison["cost"]:
        parts[0] = ("heater", f"{model_lines(model)}\n- {comparison['cost']}")
    rows = [("design", "verdict", "worst Ms", "fails by")]
    rows += [(r["label"], r["verdict"], figure(r["ms"]), ", ".join(r["fails"])) for r in comparison["rivals"]]
    parts.append(("the same proof for other designs", table(rows)))
    text, line = "\n\n".join(f"== {title}\n{body}" for title, body in parts), verdict_line(proof)
    return f"{line}\n\n{text}\n\nVERDICT {line}"


def outcome_lines(summary: Document) -> str:
    """Return the number of cases of each outcome in a table, and the first ones without a PASS."""
    rows = [(outcome, str(number)) for outcome, number in summary["outcomes"].items()]
    lines = [table([*rows, ("together", str(summary["rows"]))], right=(1,))]
    for outcome, examples in summary["examples"].items():
        lines += [f"{outcome}: {example['reason']}" if example["reason"].startswith(example["name"]) else
                  f"{outcome}: {example['name']}: {example['reason']}" for example in examples]
        more = summary["outcomes"][outcome] - len(examples)
        lines += [f"{outcome}: and {more} more"] if more else []
    again = summary.get("done_again", 0)
    lines += [f"repeated because their input has changed since the interrupted run: {again}"] if again else []
    return "\n".join([*lines, f"written to {summary['table']}"])


def _interval(pair: Sequence[float | None] | None) -> str:
    if pair is None:
        return NOT_IDENTIFIED
    low, high = ("open" if end is None else figure(end, 3) for end in pair)
    return f"{low} … {high}"


def difference_lines(document: Document) -> str:
    """Return quantities, words, oddities and proofs of two word sets, side by side; the last line is the outcome."""
    a, b = document["a"], document["b"]
    blocks = [table([("", a["source"], b["source"], ""), *_terms(document)], right=(1, 2))]
    if rows := list(_words(document)):
        blocks.append(table([("address", "word", "before", "after", "meaning"), *rows], right=(2, 3)))
    notes = [f"{side['source']}: {sentence}" for side in (a, b) for sentence in _of_side(side)]
    notes += [f"no longer: {sentence}" for sentence in document["odd_in_a_alone"]]
    notes += [f"now: {sentence}" for sentence in document["odd_in_b_alone"]]
    notes += [_covers(proof) for proof in document["proofs"]]
    if document["conditions"] is not None:
        unlike = ", ".join(document["conditions"])
        notes.append(f"the proofs differ in {unlike}" if unlike else "both proofs were made under the same conditions")
    return "\n".join([*blocks, *(f"- {note}" for note in notes), _outcome(document)])


def _terms(document: Document) -> Iterator[tuple[str, str, str, str]]:
    """Yield the quantities that occur in at least one of the two sets."""
    for term in document["terms"]:
        one, two = term["a"], term["b"]
        if one is None and two is None:
            continue
        shown = [f"{figure(value)} {term['unit']}" if value is not None else "none" for value in (one, two)]
        yield term["name"], shown[0], shown[1], _change(term)


def _change(term: Document) -> str:
    if term["a"] == term["b"]:
        return "as before"
    if term["change_pct"] is None:
        return "changed"
    return f"{term['change_pct']:+.2g} %" if abs(term["change_pct"]) < 1e3 else f"{term['b'] / term['a']:.3g} times"


def _words(document: Document) -> Iterator[tuple[str, str, str, str, str]]:
    for one in document["words"]:
        live = " (written by the program: no difference)" if one["written"] else ""
        yield one["address"], one["name"], one["a_text"], one["b_text"], f"{one['comment']}{live}"


def _of_side(side: Document) -> Iterator[str]:
    if side["kind"] == "design":
        yield f"a design, made words of {side['target']}"
    if side["input"] is not None:
        yield f"its sensor is {INPUTS[side['input']]}"
    yield from side["notes"]


def _covers(proof: Document) -> str:
    head = f"the proof of {proof['proof_of']} ({proof['verdict']})"
    if not proof["covers"]:
        return f"{head} does not cover {proof['words_of']}: another {', another '.join(proof['why_not'])}"
    provided = f", where these are as proven: {', '.join(proof['provided'])}" if proof["provided"] else ""
    return f"{head} covers {proof['words_of']}{provided}"


def _outcome(document: Document) -> str:
    if document["same"]:
        return "SAME WORDS"
    unlike = [*document["around"], *(f"word {one['name']}" for one in document["words"] if not one["written"])]
    return f"DIFFERENT: {', '.join(unlike)}"


def plan_lines(plan: Document) -> str:
    """Return the experiment, the table of before and after, and whether it is worth heating."""
    parts = [
        f"== {plan['kind']}, {figure(plan['duration_s'])} s, at most {figure(plan['highest_degC'])} °C "
        f"(limit {figure(plan['conditions']['limit_degC'])} °C) on {len(plan['heaters'])} plausible heaters",
        _relay(plan["relay"]) if "relay" in plan else _schedule(plan["schedule"]),
        _before_and_after(plan["quantities"]),
        *(f"- {line}" for line in _words_plan(plan)),
    ]
    return "\n".join(parts)


def plan_csv(plan: Document) -> str:
    """Return the experiment's settings as CSV: instants and powers, or the relay's settings."""
    if "relay" in plan:
        names = ("rest_s", "on_degC", "off_degC", "high_pct", "low_pct")
        values = [plan["relay"][name] for name in names] + [plan["duration_s"]]
        return f"{','.join(names)},duration_s\n{','.join(f'{value:.10g}' for value in values)}\n"
    schedule = plan["schedule"]
    rows = [(0.0, schedule["base_pct"]), *zip(schedule["time_s"], schedule["power_pct"], strict=True)]
    return "time_s,power_pct\n" + "".join(f"{time:.10g},{power:.10g}\n" for time, power in rows)


def _schedule(schedule: Document) -> str:
    rows = [("from s", "power %"), ("0", figure(schedule["base_pct"]))]
    rows += [(figure(t, 6), figure(p)) for t, p in zip(schedule["time_s"], schedule["power_pct"], strict=True)]
    return table(rows, right=(0, 1))


def _relay(relay: Document) -> str:
    shortest, longest = relay["period_s"]
    return (
        f"log {figure(relay['rest_s'])} s at rest; then {figure(relay['high_pct'])} % until "
        f"{figure(relay['off_degC'])} °C, {figure(relay['low_pct'])} % until {figure(relay['on_degC'])} °C, and so on\n"
        f"(setpoint {figure(relay['setpoint_degC'])} °C, hysteresis ±{figure(relay['hysteresis_degC'])} °C); expected "
        f"period {figure(shortest, 3)} to {figure(longest, 3)} s"
    )


def _before_and_after(quantities: Document) -> str:
    rows = [("", "before", "after, 95 %", "worst ±", "unit", "worst on")]
    for name, quantity in quantities.items():
        _, label, unit = NOMENCLATURE[name]
        share = quantity["worst_share"]
        worst = _share(share) if share is not None else f"±{figure(quantity['worst_half_width'], 2)}"
        rows.append((label, _range(quantity["before"]), _range(quantity["after"]), worst, unit, quantity["worst_on"]))
    return table(rows)


def _words_plan(plan: Document) -> list[str]:
    """Return whether the experiment is worthwhile, and the basis of the figures."""
    conditions, noise = plan["conditions"], plan["conditions"]["noise"]
    aim = _share(conditions["aim"])
    worth = [f"worth it: every interval is expected within {aim} on every heater"]
    if not plan["reached"]:
        worth = [f"the aim of {aim} is not reached: a longer test, a higher limit or less noise would help"]
    for name, quantity in plan["quantities"].items():
        low, high = quantity["before"]
        half = quantity["worst_half_width"]
        if high > low and (half is None or half >= 0.5 * (high - low)):
            worth.append(f"it would not tell the {NOMENCLATURE[name][1]} better than it is known before")
    tried = [f"{_share(test['worst_share'])} in {figure(test['duration_s'])} s" for test in plan["durations"]]
    step = f"a plain step of {figure(plan['duration_s'])} s: {_share(plan['step_worst_share'])}"
    return [
        *worth,
        f"worst interval: {', '.join(tried)}; {step}",
        f"readings every {figure(noise['sample_time_s'])} s, noise {figure(noise['std_degC'], 2)} °C with correlation "
        f"{figure(noise['correlation'], 2)}, resolution {figure(noise['resolution_degC'], 2)} °C",
        "the time constant is the sum of both where there are two lags",
    ]


def _share(value: float | None) -> str:
    return "no end" if value is None else f"±{100.0 * value:.2g} %"


def _range(pair: Any) -> str:
    low, high = (figure(end, 3) for end in pair)
    return f"{low} … {high}"
