"""The record that one signs: verdict, words to tick, into service, safety, acceptance test, as left, who signs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from heatertune import __version__
from heatertune.model.findings import remedy_of
from heatertune.plc import Scaling, controller_for
from heatertune.plc.commissioning import commissioning
from heatertune.plc.inputs import describe_range
from heatertune.plc.keyed_entry import KeyedEntry
from heatertune.proof.verdict import blocking_findings, relaxed_clause, sample_lines, told_of
from heatertune.report.as_left import judged_text, measured_text, plot_as_left, worst_text
from heatertune.report.html import BLANK, Markup, bullets, picture, steps, table, text_of, tick, with_code
from heatertune.report.text import (
    called_every_s,
    figure,
    holder,
    keyed_entries,
    limit_text,
    main_file,
    ramp_note,
    readable_name,
    search_notes,
    setpoint_text,
)
from heatertune.report.write_report_section import in_plc, written
from heatertune.units import count

__all__ = ["head", "record", "remedies"]

Document = Mapping[str, Any]
Documents = Mapping[str, Document]

#: steps of COMMISSIONING.md that are done once; the others stand in the appendix, for when they are needed
_INTO_SERVICE: Final = ("Entering the parameters", "The first minutes")
#: criteria that no plant shows: they are of the words, or of flags in the PLC
_OF_WORDS: Final = ("stability", "ms", "gain_margin", "phase_margin", "step_power", "overflow", "interlock_trips")
_SHORT: Final = 160  # characters of all words in one cell
_SIDE_BY_SIDE: Final = 5  # words from which on they stand in two columns
_MOST_LETTERS: Final = 34  # of the longest word and of the longest value, for two columns to leave their meaning room


def head(documents: Documents) -> str:
    """Return what the foot of each printed page says: document, plant, words."""
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
    points += [*sample_lines(proof), *told_of(proof)]
    verdict = " ".join(filter(None, (proof["verdict"], relaxed_clause(proof))))
    forced = " The parameters were exported anyway (--force)." if documents["words"].get("forced") else ""
    return (
        f'<p class="verdict {proof["verdict"].lower().replace(" ", "-")}">{text_of(verdict)} at '
        f"{figure(proof['scenario']['setpoint_degC'])} °C</p>"
        f"<p>{len(proof['runs'])} closed-loop runs with the PLC's own arithmetic on "
        f"{count(models, 'plausible heater')}, each under every setting of the open points."
        f"{forced}</p>{bullets([*broken, *points])}"
    )


def _words(documents: Documents) -> str:
    """Return the words, in the order in which they are typed in, each with a box to tick."""
    document = documents["words"]
    rows, scale = keyed_entries(document), document["scaling"]
    refused = '<p class="fail">Do not enter: these parameters are not proven.</p>' if _refused(document) else ""
    half = (len(rows) + 1) // 2 if len(rows) > _SIDE_BY_SIDE and _is_narrow(rows) else len(rows)
    source, called = controller_for(document["target"]).title, called_every_s(document, documents["proof"]["actuator"])
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
        f"{figure(called)} s. Setpoint of the proof: {figure(document['setpoint_degC'])} °C; enter "
        f"{text_of(setpoint_text(document))}.</p>"
        f'{columns}<p class="soft">Source: {text_of(source)}</p>'
        f"{bullets(ramp_note(document))}{listed}"
    )


def _is_narrow(rows: Sequence[KeyedEntry]) -> bool:
    """Whether two columns of words stand side by side: neither a word nor its value is broken in lines."""
    names = max(len(row.name) if row.address == row.name else len(f"{row.address} {row.name}") for row in rows)
    values = max(len(f"{text} {row.format}") for row in rows for text in (row.first_text, row.then_text))
    return names + values <= _MOST_LETTERS


def _refused(words: Document) -> bool:
    return words["verdict"] != "PASS" and not words.get("forced")


def _column(rows: Sequence[KeyedEntry]) -> str:
    lines = "".join(_word(row) for row in rows)
    heads = "".join(f'<th scope="col">{name}</th>' for name in ("entered", "parameter", "value", "meaning"))
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
    """Return the steps on site: where the words go, and what to watch at first."""
    manual = commissioning(documents["words"]["target"])
    source = f'<p class="soft">Source: {text_of(manual.facts)}</p>'
    return f"<h2>Commissioning</h2>{_steps(manual.steps, _INTO_SERVICE)}{source}"


def remedies(documents: Documents) -> str:
    """Return what to do where something goes wrong, and how to go back."""
    found = commissioning(documents["words"]["target"]).steps
    others = [title for title in found if title not in _INTO_SERVICE]
    search = bullets(search_notes(documents["words"]))
    how = f"<h2>How the parameters were found</h2>{search}" if search else ""
    return f"<h2>Troubleshooting</h2>{_steps(found, others)}{how}"


def _steps(found: Mapping[str, Sequence[str]], titles: Sequence[str]) -> str:
    number = {title: each for each, title in enumerate(found)}
    return "".join(f"<h3>{text_of(title)}</h3>{steps(f'step-{number[title]}', found[title])}" for title in titles)


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
        "<h2>Safety</h2><p>Nothing in this record replaces a cut-out that is independent of the PLC. Readings go "
        f"from {figure(scale['low_degC'])} to {figure(scale['high_degC'])} °C: the controller cannot detect "
        f"higher temperatures.</p>{table(['checked', '', 'value'], rows)}")


def _acceptance(documents: Documents) -> str:
    proof, left = documents["proof"], documents.get("as_left")
    seen = {line["name"]: line for line in left["measurements"]} if left else {}
    rows = []
    for name, one in proof["criteria"].items():
        line = seen.get(name)
        measured = line is not None and line["measured"] is not None
        if name in _OF_WORDS or (one["limit"] is None and not measured):
            continue
        rows.append([tick(f"test-{name}", f"{readable_name(name)} accepted"), readable_name(name), limit_text(one),
                     worst_text(_line(name, one)), measured_text(line) if measured and line is not None else BLANK,
                     "" if line is None else judged_text(line)])
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
    told = ""
    if left is not None:
        told = f"{bullets([*left['messages'], *left['notes']])}" + picture(
            plot_as_left(left), "The trace and the band of the proven runs; shaded: outside the band.")
    return f"<h2>As found, as left</h2>{table(['', 'as found', 'as left'], rows)}{told}"


def _signatures(_: Documents) -> str:
    rows = [[who, BLANK, BLANK, BLANK] for who in ("prepared", "checked", "accepted")]
    return (f'<div class="sign"><h2>Signed</h2>{table(["", "name", "date", "signature"], rows)}'
            '<p>Remarks</p><p class="remarks"></p></div>')


def _line(name: str, criterion: Document) -> Document:
    """Return a criterion of a proof as `worst_text` takes it."""
    return {"name": name, "worst": criterion["value"], "bound": criterion["bound"], "unit": criterion["unit"]}
