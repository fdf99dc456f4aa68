"""The report: one self-contained HTML page made from the documents of the stages.

Also its glossary of symbols and words, the assumptions of the proof (requested, assumed, left open), and the
commissioning record for signature: verdict, parameters to tick off, commissioning, safety, acceptance test, as left,
signatures.
"""

from __future__ import annotations

import hashlib
import html
import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from heatertune import __version__
from heatertune.codec import Document, decode
from heatertune.model.findings import remedy_of
from heatertune.options import options_of
from heatertune.plc import OpenPoint, Scaling, controller_for
from heatertune.plc.inputs import describe_range
from heatertune.plc.keyed_entry import KeyedEntry
from heatertune.plc.targets import commissioning
from heatertune.proof.criteria import CRITERION, LIMITS
from heatertune.proof.event_table import NOT_RUN
from heatertune.proof.profile import Profile
from heatertune.proof.verdict import blocking_findings, relaxed_clause, sample_lines, samples_text, verdict_notes
from heatertune.report import plots
from heatertune.report.as_left_section import in_plc, judgement_text, measured_text, plot_as_left, worst_text, written
from heatertune.report.html import BLANK, Markup, bullets, page, picture, steps, table, text_of, tick, with_code
from heatertune.report.report_text import (
    NOT_IDENTIFIED,
    called_every_s,
    criterion_value,
    figure,
    holder,
    hypothesis_rows,
    keyed_entries,
    limit_text,
    main_file,
    model_rows,
    opinion_rows,
    ramp_note,
    readable_name,
    samples_rows,
    search_notes,
    setpoint_text,
)
from heatertune.settings import Conditions, SensorSettings
from heatertune.units import count, terms_in

__all__ = ["assumption_text", "glossary", "head", "limits", "record", "remedies", "render", "sections", "specification"]


_UNREAD: Final = re.compile(r"<(script|style|svg)\b.*?</\1>|<[^>]*>", re.DOTALL)


def glossary(body: str) -> str:
    """Return the terms used on a page with their meanings, as an HTML list; an empty text without terms.

    Args:
        body: HTML of the page.
    """
    terms = terms_in(html.unescape(_UNREAD.sub(" ", body)))
    lines = "".join(f"<dt>{text_of(', '.join(term.names[:2]))}</dt><dd>{text_of(term.meaning)}</dd>" for term in terms)
    return f'<h2>Terms</h2><dl class="terms">{lines}</dl>' if terms else ""


Documents = Mapping[str, Document]


def assumption_text(documents: Documents) -> str:
    """Return the assumptions of the proof about the plant, each with its unit and source."""
    proof, scale = documents["proof"], documents["words"]["scaling"]
    story, switch, limit = proof["scenario"], proof["actuator"], proof["limits"]
    sensor = options_of(SensorSettings)["range_degC"]
    rows = [
        ["sensor at the lowest reading", figure(scale["low_degC"]), "°C", sensor.flag],
        ["sensor at the highest reading", figure(scale["high_degC"]), "°C", sensor.flag],
        *([["range of the analog module", scale["input"], "", "--input"]] if scale.get("input") else []),
        _row("setpoint_degC", story["setpoint_degC"]),
        _row("noise_degC", story["noise_degC"]),
        _row("tolerance_degC", limit["tolerance_degC"]),
        ["duration of the proof", f"{story['duration_s']:.0f}", "s", "from the slowest plausible heater"],
    ]
    rows += [[part["label"], f"{part['begin_s']:.0f}", "s", "the test sequence of the specification, with "
              "durations for the slowest plausible heater"] for part in documents["pictures"]["phases"][1:]]
    if switch is not None:
        rows += [_row(name, switch[key]) for name, key in (
            ("pwm_period_s", "pwm_period_s"), ("pwm_resolution_s", "resolution_s"), ("minimum_on_s", "minimum_on_s"),
            ("minimum_off_s", "minimum_off_s"))]
        if switch.get("cooling_gain") is not None:
            names = ("cooling_gain", "cooling_minimum_on_s", "cooling_minimum_off_s")
            rows += [_row(name, switch[name]) for name in names if switch.get(name) is not None]
        if switch["minimum_rule"] == "carry":
            rows.append(["rest of a pulse", "carried to the next one", "", options_of(Conditions)["pwm_rule"].flag])
    points = controller_for(documents["words"]["target"]).switches
    stated = documents["proof"]["stated_settings"]
    settings = [[point.name, point.default, ", ".join(proven), point.reason]
                for point in points if not point.in_manual and (proven := _proven(point, stated))]
    by_hand = ", ".join(point.name for point in points if point.in_manual)
    open_points = (
        "<h3>Open points of the manual</h3><p>The proof ran under every setting"
        + (f", except for points that only show in manual mode: {by_hand}.</p>" if by_hand else ".</p>")
        + table(["open point", "default", "settings proven", "what is open"], settings,
                source="DIFFERENCES.md of the controller")
        if settings else ""
    )
    return (
        "<h2>Assumptions</h2>"
        + table(["", "value", "unit", "given by"], rows, numeric=(1,),
                source="options of the command, otherwise defaults")
        + open_points
    )


def _proven(point: OpenPoint, stated: Mapping[str, str]) -> tuple[str, ...]:
    """Return the proven settings: for a choice the chosen one and the default, or none if the default is chosen."""
    chosen = stated.get(point.name, point.default)
    if point.chosen:
        return () if chosen == point.default else (chosen, point.default)
    return point.settings


def _row(name: str, value: float) -> list[str]:
    """Return one of the `Conditions` with its unit and source."""
    its = options_of(Conditions)[name]
    return [its.label or its.quantity, figure(value), its.unit, its.given_by]


def specification(documents: Documents) -> str:
    """Return the specification in the user's words, with its reasons; empty if the limits were given directly."""
    spec = documents["proof"]["specification"]
    if spec is None:
        return ""
    rows = [[name, " and ".join(values).replace("degC", "°C"), LIMITS[name].description, spec["reasons"].get(name, "")]
            for name, values in spec["limits"].items() if values]
    if (profile := spec.get("profile")) is not None:
        rows.append(["profile", decode(Profile, profile, "proof.json").label,
                     "ramps and soaks that your own program runs", ""])
    return (f"<h2>Specification</h2><p>The specification {text_of(spec['name'])}.</p>"
            + table(["limit", "value", "meaning", "reason"], rows, source="heatertune spec"))


def limits(documents: Documents) -> str:
    """Return the limits of validity of the proof."""
    proof = documents["proof"]
    ends = f"Setpoints above {figure(proof['scenario']['setpoint_degC'])} °C, and below those of the test sequence."
    unproven = [
        "Heaters outside the listed models.",
        "A faulty sensor, a stuck relay, a jittering timer (see `heatertune verify --samples`).",
        ends,
        *(f"Not tested: {part}." for part in proof["not_tested"]),
        *(f"Not run: {part}." for part in NOT_RUN),
    ]
    return f"<h2>What was not proven</h2>{bullets(unproven)}"


#: steps of COMMISSIONING.md that are done once; the others are in the appendix
_INTO_SERVICE: Final = ("Entering the parameters", "The first minutes")
#: criteria that no plant shows: they are of the words, or of flags in the PLC
_SHORT: Final = 160  # characters of all words in one cell
_SIDE_BY_SIDE: Final = 5  # from this number of words on they are set in two columns
_MOST_LETTERS: Final = 34  # of the longest word and of the longest value, for two columns to leave their meaning room


def head(documents: Documents) -> str:
    """Return the text at the foot of each printed page: document, plant, parameters."""
    about = documents.get("record", {})
    names = [about.get("document"), about.get("revision"), about.get("plant_tag"), documents["words"]["target"]]
    digest = documents["proof"]["digest"].removeprefix("sha256:")[:16]
    return " · ".join([*filter(None, names), f"proof {digest}"])


def record(documents: Documents) -> str:
    """Return all that is read, typed, ticked and signed."""
    parts = (_identity, _verdict, _words, _site, _safety, _acceptance, _as_left, written, _signatures)
    return "\n".join(f"<section>{text}</section>" for part in parts if (text := part(documents)))


def _identity(documents: Documents) -> str:
    about, proof = documents.get("record", {}), documents["proof"]
    rows = [("plant and heater", about.get("plant_tag")), ("document", about.get("document")),
            ("version", about.get("revision")), ("controller", controller_for(proof["target"]).title),
            ("log", documents["log"]["name"]), ("proof", Markup(f"<code>{text_of(proof['digest'])}</code>")),
            ("made by", f"heatertune {__version__}")]
    cells = "".join(f"<dt>{name}</dt><dd>{BLANK if value is None else text_of(value)}</dd>" for name, value in rows)
    return f'<dl class="identity">{cells}</dl>'


def _verdict(documents: Documents) -> str:
    proof = documents["proof"]
    models = len({run["model"] for run in proof["runs"]})
    broken = [f"Not kept: {readable_name(name)}, {worst_text(_line(name, one))} (limit {limit_text(one)})."
              for name, one in proof["criteria"].items() if not one["ok"]]
    names = [finding["name"] for finding in proof["findings"]]
    points = [f"Not proven: {finding['message']} Remedy: {remedy_of(finding['name'], names)}."
              for finding in blocking_findings(proof)]
    points += [*sample_lines(proof), *verdict_notes(proof)]
    verdict = " ".join(filter(None, (proof["verdict"], relaxed_clause(proof))))
    forced = " The parameters were exported anyway (--force)." if documents["words"].get("forced") else ""
    return (
        f'<p class="verdict {proof["verdict"].lower().replace(" ", "-")}">{text_of(verdict)} at '
        f"{figure(proof['scenario']['setpoint_degC'])} °C</p>"
        f"<p>{len(proof['runs'])} closed-loop runs with the controller's own arithmetic on "
        f"{count(models, 'plausible heater')}, each under every setting of the open points."
        f"{forced}</p>{bullets([*broken, *points])}"
    )


def _words(documents: Documents) -> str:
    """Return the words, in the order in which they are typed in, each with a box to tick."""
    document = documents["words"]
    rows, scale = keyed_entries(document), document["scaling"]
    refused = '<p class="fail">Do not enter: these parameters are not proven.</p>' if _refused(document) else ""
    half = (len(rows) + 1) // 2 if len(rows) > _SIDE_BY_SIDE and _is_narrow(rows) else len(rows)
    source, ta_s = controller_for(document["target"]).title, called_every_s(document, documents["proof"]["actuator"])
    columns = "".join(_column(part) for part in (rows[:half], rows[half:]) if part)
    down = ", down the first column, then the second" if half < len(rows) else ""
    if down:
        columns = f'<div class="two">{columns}</div>'
    first = [main_file(document)] if document["files"] else []
    files = [f"<code>{text_of(name)}</code>" for name in dict.fromkeys([*first, *document["files"]])]
    others = f"; with it: {' '.join(files[1:])}" if files[1:] else ""
    listed = f"<p>File for the {holder(document['target'])}: {files[0]}{others}</p>" if files else ""
    return (
        f"<h2>Parameters for {text_of(document['target'])}</h2>{refused}<p>In the order in which they are entered"
        f"{down}. Sensor {describe_range(Scaling(**scale))}; call every "
        f"{figure(ta_s)} s. Setpoint of the proof: {figure(document['setpoint_degC'])} °C; enter "
        f"{text_of(setpoint_text(document))}.</p>"
        f'{columns}<p class="soft">Source: {text_of(source)}</p>'
        f"{bullets(ramp_note(document))}{listed}"
    )


def _is_narrow(rows: Sequence[KeyedEntry]) -> bool:
    """Whether two columns of parameters fit side by side without breaking a name or value."""
    names = max(len(row.name) if row.address == row.name else len(f"{row.address} {row.name}") for row in rows)
    values = max(len(f"{text} {row.format}") for row in rows for text in (row.first_text, row.then_text))
    return names + values <= _MOST_LETTERS


def _refused(words: Document) -> bool:
    return words["verdict"] != "PASS" and not words.get("forced")


def _column(rows: Sequence[KeyedEntry]) -> str:
    lines = "".join(_word(row) for row in rows)
    heads = "".join(f'<th scope="col">{name}</th>' for name in ("done", "parameter", "value", "meaning"))
    return f'<table class="words"><thead><tr>{heads}</tr></thead><tbody>{lines}</tbody></table>'


def _word(row: KeyedEntry) -> str:
    value = text_of(row.then_text)
    if row.changes:
        value = f"first {text_of(row.first_text)}<br>then {value}"
    shown = row.format and not row.changes and value.partition(" ")[0] != row.format
    kind = f' <span class="soft">{row.format}</span>' if shown else ""
    place = "" if row.address == row.name else f"{text_of(row.address)} "
    return (f"<tr><td>{tick(f'word-{row.name}', f'{row.name} entered')}</td>"
            f'<td class="word">{place}<b>{text_of(row.name)}</b></td><td class="value">{value}{kind}</td>'
            f'<td class="meaning">{text_of(row.meaning)}</td></tr>')


def _site(documents: Documents) -> str:
    """Return the steps on site: entering the parameters, and the first minutes."""
    manual = commissioning(documents["words"]["target"])
    source = f'<p class="soft">Source: {text_of(manual.facts)}</p>'
    return f"<h2>Commissioning</h2>{_steps(manual.steps, _INTO_SERVICE)}{source}"


def remedies(documents: Documents) -> str:
    """Return the troubleshooting steps, and how to restore the old parameters."""
    steps = commissioning(documents["words"]["target"]).steps
    others = [title for title in steps if title not in _INTO_SERVICE]
    search = bullets(search_notes(documents["words"]))
    how = f"<h2>How the parameters were found</h2>{search}" if search else ""
    return f"<h2>Troubleshooting</h2>{_steps(steps, others)}{how}"


def _steps(steps_by_title: Mapping[str, Sequence[str]], titles: Sequence[str]) -> str:
    number = {title: each for each, title in enumerate(steps_by_title)}
    return "".join(
        f"<h3>{text_of(title)}</h3>{steps(f'step-{number[title]}', steps_by_title[title])}" for title in titles)


def _safety(documents: Documents) -> str:
    watch, scale = documents["proof"]["interlock"], documents["words"]["scaling"]
    limit = BLANK if watch is None else Markup(text_of(f"{figure(watch['limit_degC'])} °C ({watch['name']})"))
    rows = [
        [tick("safety-limit", "limit temperature checked"), "Limit temperature of plant and goods", limit],
        [tick("safety-cut-out", "independent cut-out checked"),
         "Independent cut-out, with its own sensor and its own contact: switches off at", BLANK],
        [tick("safety-tried", "cut-out tried"), "Cut-out tried on the plant: heater off, and off until it is reset",
         BLANK],
        [tick("safety-sensor", "broken sensor tried"), "Sensor unplugged: heater off", BLANK],
    ]
    return (
        "<h2>Safety</h2><p>Nothing in this record replaces a cut-out that is independent of the controller. Readings "
        f"from {figure(scale['low_degC'])} to {figure(scale['high_degC'])} °C: the controller cannot detect "
        f"higher temperatures.</p>{table(['checked', '', 'value'], rows)}")


def _acceptance(documents: Documents) -> str:
    proof, left = documents["proof"], documents.get("as_left")
    measurements = {line["name"]: line for line in left["measurements"]} if left else {}
    rows = []
    for name, one in proof["criteria"].items():
        line = measurements.get(name, {"measured": None, "keeps": None})
        measured = line["measured"] is not None
        if CRITERION[name].source == "run" and (one["limit"] is not None or measured):
            rows.append([tick(f"test-{name}", f"{readable_name(name)} accepted"), readable_name(name), limit_text(one),
                         worst_text(_line(name, one)), measured_text(line) if measured else BLANK,
                         judgement_text(line)])
    ends = proof["criteria"].get("settling_time", {}).get("limit")
    long_enough = "" if ends is None else f" for at least {2.0 * ends:.0f} s"
    heads = ["", "criterion", "limit", "proven worst", "measured", ""]
    return (
        "<h2>Acceptance test</h2><p>Starting cold and with the heater off, log time and temperature, and if possible "
        f"setpoint and power; set {figure(proof['scenario']['setpoint_degC'])} °C and log{long_enough}. Then "
        + with_code("`heatertune report DIR --as-left trace.csv` evaluates the trace and fills in this table.")
        + f"</p>{table(heads, rows, numeric=(2, 3, 4), source='the proof; measured: the trace, or manual entry')}"
    )


def _as_left(documents: Documents) -> str:
    left, words = documents.get("as_left"), documents["words"]
    values = ", ".join(f"{row.name} {row.then_text}" for row in keyed_entries(words))
    if _refused(words):
        values = "do not enter"
    now: list[str] = [BLANK, values if len(values) <= _SHORT else "as above, each entry ticked"]
    if "written" in documents:
        passages = documents["written"]["passages"]
        now = [text if len(text) <= _SHORT else "see below" for text in (
            in_plc(passages[0]["as_found"], words), in_plc(passages[-1]["left"], words))]
    rows = [["parameters", *now],
            ["setpoint", BLANK, f"{figure(words['setpoint_degC'])} °C"],
            ["trace", BLANK, BLANK if left is None else left["trace"]],
            ["what it shows", BLANK, BLANK if left is None else left["verdict"]]]
    remarks = ""
    if left is not None:
        remarks = f"{bullets([*left['messages'], *left['notes']])}" + picture(
            plot_as_left(left), "The trace and the band of the proven runs; shaded: outside the band.")
    return f"<h2>As found, as left</h2>{table(['', 'as found', 'as left'], rows)}{remarks}"


def _signatures(_: Documents) -> str:
    rows = [[who, BLANK, BLANK, BLANK] for who in ("prepared", "checked", "accepted")]
    return (f'<div class="sign"><h2>Signed</h2>{table(["", "name", "date", "signature"], rows)}'
            '<p>Remarks</p><p class="remarks"></p></div>')


def _line(name: str, criterion: Document) -> Document:
    """Return a criterion of a proof as `worst_text` takes it."""
    return {"name": name, "worst": criterion["value"], "bound": criterion["bound"], "unit": criterion["unit"]}


def render(documents: Documents, drawn: Mapping[str, str] | None = None) -> str:
    """Return the page.

    Args:
        documents: "log", "model", "pid", "words", "proof", "pictures" and "comparison".
        drawn: result of `sections` for these documents; None: not drawn yet.
    """
    words = documents["words"]
    title = f"Commissioning record: {documents['log']['name']} → {words['target']}"
    proven = [words["target"], words["words"], words["sample_time_s"]]
    mark = hashlib.sha256(json.dumps(proven, sort_keys=True).encode()).hexdigest()[:16]
    signed = record(documents)
    sections = "\n".join(f"<section>{part}</section>" for name, section in _APPENDIX.items()
                         if (part := (drawn or {}).get(name) or section(documents)))
    terms = f"<section>{glossary(signed + sections)}</section>"
    appendix = f'<div class="appendix"><h1>Appendix: how it was found</h1>\n{sections}\n{terms}</div>'
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


def _second_opinion(documents: Documents) -> str:
    opinion = documents.get("second_opinion")
    if opinion is None:
        return ""
    rows = opinion_rows(opinion)
    compared = table(["", "heatertune", "the library", "allowed difference", "by"], rows, numeric=(1, 2, 3),
                     source=f"{opinion['heater']}; the optimum: all models") if rows else ""
    return f"<h2>Second opinion</h2>{compared}{bullets(opinion['notes'])}"


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
        share = c.get("fast_share")
        lags += "" if share is None else f", {100.0 * share:.0f} % past the first"
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
    """Return the cross-validation of the fit, and the whiteness test of its residuals."""
    blocks, white, follows = (model.get(name) for name in ("held_out", "whiteness", "input_crosscorrelation"))
    if blocks is None or white is None:
        return ""
    rows = [["fit", figure(model["fit_pct"]), "", "%", ""],
            ["fit on windows left out", figure(blocks["fit_pct"]), "", "%", ""],
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
    """Return every hypothesis about the controller that was compared; nothing if the power was logged."""
    if not model.get("hypotheses"):
        return ""
    heads, *rows = hypothesis_rows(model)
    sure = [label for label, _, ci95, _ in model_rows(model) if ci95 != NOT_IDENTIFIED]
    remark = f"Known within the intervals above: {', '.join(sure)}." if sure else "No parameter is identified."
    return (
        f"<h3>Hypotheses about the controller</h3><p>{text_of(remark)} BIC with AR(1) errors on the same readings; RMS "
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
    """Return the results on sampled heaters, if there are any."""
    if "samples" not in proof:
        return ""
    heads, *rows = samples_rows(proof["samples"])
    summary = f"{proof['samples']['verdict']}: {samples_text(proof['samples'])}."
    source = "random heater, mains voltage, room, load and sensor; each sample under its worst setting"
    return f"<h3>Samples</h3><p>{text_of(summary)}</p>{table(heads, rows, numeric=(1, 2, 3, 4), source=source)}"


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
        + table(heads, rows, numeric=(1, 2), source="closed loop in its own arithmetic; each line names its run")
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
    "second_opinion": _second_opinion,
    "model": _model, "log": _log, "assumed": assumption_text, "comparison": _comparison,
}
