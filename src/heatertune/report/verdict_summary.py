"""The summary on one screen: the verdict, the values to enter, the worst runs, and what is not known.

Nothing that a verdict depends on is omitted: what does not fit is counted, and `--verbose` lists it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from heatertune.codec import Document
from heatertune.model.findings import KINDS, remedy_of
from heatertune.plc.keyed_entry import KeyedEntry
from heatertune.plc.targets import REPAIRED
from heatertune.proof.criteria import CRITERION
from heatertune.proof.heaters import BY_CURVE
from heatertune.proof.long_outage import JUDGED
from heatertune.proof.verdict import (
    BREAKS_NONE,
    NOTHING_PASSES,
    WIDER,
    blocking_findings,
    closing_text,
    notes_by_kind,
    relaxed_clause,
    sample_lines,
    verdict_of_samples,
    wear_text,
)
from heatertune.report.layout import (
    LINES,
    WIDTH,
    command,
    cut,
    labelled_lines,
    notes_within,
    screen,
    table,
    two_columns,
    wrap_text,
)
from heatertune.report.report_text import (
    NOT_IDENTIFIED,
    called_every_s,
    criterion_value,
    figure,
    holder,
    keyed_entries,
    limit_text,
    main_file,
    model_rows,
    quantity,
    ramp_note,
    readable_name,
    search_notes,
    unit_text,
)
from heatertune.units import count

__all__ = ["design_brief", "model_brief", "tune_brief", "verify_brief"]


#: criteria that are shown, broken ones that are named in a verdict's line, and lines of doubts and of values that fail
_WORST: Final = 5
_NAMED: Final = 3
_DOUBTS: Final = 7
_FAILING: Final = 3
#: lines of a verdict, and of the reasons why it is not proven
_SAID: Final = 4
#: words up to which each has a line with its meaning
_WITH_MEANING: Final = 10

#: details for experts on fits and optima
_OF_EXPERTS: Final = re.compile(r"IPOPT|BIC|Ljung|TRdom|candidate|half rule|Jury|Nyquist|feasible")
_SETTINGS: Final = re.compile(r"settings of (.+) \(they change no run\)")


def design_brief(documents: Mapping[str, Document], out: str, nearest: Sequence[str] = (), hint: str = "") -> str:
    """Return a whole design on one screen.

    Args:
        documents: of all stages.
        out: the folder they are in.
        nearest: for a design that fails or winds up, the command that gives PASS; empty: unknown.
        hint: another suggestion, one line; empty: none.
    """
    model, pid, words, proof = (documents[name] for name in ("model", "pid", "words", "proof"))
    notes = [*_notes(model), *_notes(pid), *search_notes(words)]
    facts = {"heater": [_heater(model)], "ideal": [_ideal(pid)]}
    files = _files(words, out)
    fails = _fails_on_samples(proof) and not nearest
    drawn = wrap_text(_of_samples(proof["samples"], closed_loop=True), "", _SAID) if fails else []
    head, values, worst = [*_verdict(proof, nearest), *drawn, *labelled_lines(facts, 2)], _values(words,
                                                                                                  proof), _worst(proof)
    ends = [*files, *([hint] if hint else [])]
    room = LINES - sum(map(len, (head, values, worst, ends)))
    doubts = labelled_lines({**_doubts(proof, _unsure(model)), "notes": _counted(notes)}, max(1, min(room, _DOUBTS)))
    return screen(head, values, worst, [*doubts, *ends])


def verify_brief(
    proof: Document, notes: Sequence[str] = (), remedy: str | None = None, redesign: Sequence[str] = ()
) -> str:
    """Return a proof on one screen.

    Args:
        proof: its document.
        notes: one sentence each.
        remedy: the remedy found when the parameters were calculated, see `DesignProvenance`; None: not searched.
        redesign: the complete command for a redesign of a failing design; empty: unknown.
    """
    way_on = wrap_text(_way_on(proof, remedy), "remedy: ") if proof["verdict"] == "FAIL" else []
    way_on += command(redesign) if way_on and redesign and not _fails_on_samples(proof) else []
    return _with_notes(notes, [*_verdict(proof), *way_on], _worst(proof), labelled_lines(_doubts(proof), _DOUBTS))


def _way_on(proof: Document, remedy: str | None) -> str:
    if remedy is not None:
        return f"found during the design: {remedy}"
    if proof["target"] in REPAIRED:
        return f"the repaired version of the program: --target {REPAIRED[proof['target']]}"
    if _fails_on_samples(proof):
        return _of_samples(proof["samples"])
    return ("heatertune design or tune with this --target searches for the smallest change that passes, or suggests "
            "what would")


def _fails_on_samples(proof: Document) -> bool:
    """Whether only sampled heaters break the limits."""
    is_within_limits = all(criterion["ok"] for criterion in proof["criteria"].values())
    return is_within_limits and proof["verdict"] == "FAIL" and "samples" in proof


def _of_samples(samples: Document, *, closed_loop: bool = False) -> str:
    """Return the limits that sampled heaters break, and the remedies that are still possible."""
    spots = samples["criteria"]
    often = sorted((name for name in spots if spots[name]["passing"] < 1.0), key=lambda name: spots[name]["passing"])
    broken = [f"{figure(100.0 * (1.0 - spots[name]['passing']), 2)} % break {_called(name)}" for name in often[:2]]
    reserve = spots.get("power_reserve", {}).get("worst")
    most, helps = max(one["passing_count"] for one in samples["settings"]), []
    if verdict_of_samples(samples["count"], samples["quantile"], [most]) == "PASS":
        helps += ["if your controller is known to behave differently, state it with --assume"]
    if reserve is not None and not reserve > 0.0:
        helps += ["some heaters lack the power for this setpoint"]
    elif not closed_loop:
        helps += ["heatertune design or fleet with --samples searches for the smallest change that passes"]
    return ": ".join(filter(None, (f"of all samples, {' and '.join(broken)}", "; ".join(helps))))


def model_brief(model: Document, out: str | None = None) -> str:
    """Return a fit on one screen."""
    rows = [("", "value", "95 %", ""), *model_rows(model)]
    names = [finding["name"] for finding in model.get("findings", ())]
    remedies, assumed = ([f"{KINDS[name].short}: {remedy_of(name, names)}" for name in names
                          if KINDS[name].is_assumption is part] for part in (False, True))
    others = len(model.get("candidates", ()))
    unseen = model.get("held_out")
    fit = f"{figure(model.get('fit_pct'), 3)} % of the curve"
    fit += "" if unseen is None else f", {figure(unseen['fit_pct'], 3)} % of the parts left out of the fit"
    parts = {
        "fit": [fit], "outcome": [model["outcome_text"].rstrip(".")],
        "proven on": [f"{others} plausible heaters, which explain the log nearly as well"] if others > 1 else [],
        "not known": remedies, "assumed": assumed}
    return _with_notes(_notes(model), table(rows, right=(1,)).splitlines(), labelled_lines(parts, 14), _written(out))


def tune_brief(design: Document, proof: Document | None, nearest: Sequence[str] = (), out: str | None = None) -> str:
    """Return a design on one screen, with the proof of its words where there is one; `nearest` as in `design_brief`."""
    margins = (f"Ms {figure(design.get('ms'), 3)}, gain margin {figure(design.get('gain_margin'), 3)}, phase margin "
               f"{figure(design.get('phase_margin_deg'), 3)}°, the worst of all plausible heaters")
    facts = {"ideal": [_ideal(design)], "robustness": [margins], "found by": [design["method"]]}
    proven = ((), ()) if proof is None else (_verdict(proof, nearest), _worst(proof))
    doubts = {} if proof is None else _doubts(proof)
    return _with_notes(
        _notes(design), proven[0], labelled_lines(facts, 6), proven[1], labelled_lines(doubts, _DOUBTS), _written(out))


def _with_notes(notes: Sequence[str], *parts: Sequence[str]) -> str:
    """Return parts on one screen, and between the last two of them the notes that have room there."""
    *before, last = parts
    room = LINES - sum(len(part) + 1 for part in parts if part)
    plain = [note for note in notes if not _OF_EXPERTS.search(note)]
    return screen(*before, notes_within(max(1, room), plain, len(notes) - len(plain)), last)


def _written(out: str | None) -> list[str]:
    return [] if out is None else [f"written to {out}"]


def _verdict(proof: Document, nearest: Sequence[str] = ()) -> list[str]:
    """Return the verdict with the broken limits, and the remedy."""
    verdict, relaxed = proof["verdict"], [relaxed] if (relaxed := relaxed_clause(proof)) else []
    lines = wrap_text("; ".join([*relaxed, _finding(proof), *sample_lines(proof)]), f"{verdict}  ", _SAID)
    if open_ := {finding["name"]: finding for finding in blocking_findings(proof)}:
        first, *more = open_.values()
        others = ", ".join(finding["name"] for finding in more)
        lines += wrap_text(closing_text(first, proof), "  not proven: ", _SAID)
        lines += wrap_text(f"{others} (--verbose)", "  nor proven: ", 1) if others else []
    if verdict != "PASS" and nearest:
        unproven = set(open_) - set(JUDGED) or any(BREAKS_NONE in remark for remark in proof["remarks"])
        lines += ["no limit is broken by:" if unproven else "nearest that passes:", *command(nearest)]
    if verdict != "PASS":
        lines += _search_lines(proof)
    return lines


def _search_lines(proof: Document) -> list[str]:
    """Return that a search found nothing, or what the limits mean that it suggests; nothing where it did neither."""
    first = next(iter(proof["remarks"]), "")
    if NOTHING_PASSES in first:
        return wrap_text(first, "  ", _SAID)
    return wrap_text(WIDER + first.partition(WIDER)[2].partition("; ")[0], "  ", _SAID) if WIDER in first else []


def _finding(proof: Document) -> str:
    """Return where and on what a proof was made, and what breaks a limit there."""
    beyond = [remark.partition(":")[0] for remark in proof["remarks"] if BY_CURVE in remark]
    where = f"{proof['target']} at {beyond[0] if beyond else format(proof['scenario']['setpoint_degC'], 'g') + ' °C'}"
    heaters = len({run["model"] for run in proof["runs"]})
    on = f"{count(len(proof['runs']), 'run')} on {count(heaters, 'plausible heater')}"
    broken = [name for name, criterion in proof["criteria"].items() if not criterion["ok"]]
    more = f" and {len(broken) - _NAMED} more" if len(broken) > _NAMED else ""
    breaks = f"{', '.join(_breaks(proof, name) for name in broken[:_NAMED])}{more}; {on}"
    return f"{where}: {breaks if broken else f'every limit is kept in {on}'}"


def _breaks(proof: Document, name: str) -> str:
    """Return a broken criterion with its limit: "overshoot 24 % (limit 20 %)"."""
    criterion = proof["criteria"][name]
    if name == "stability":
        return "the loop is not stable"
    limit = limit_text(criterion).removeprefix("at most ").removeprefix("at least ")
    return f"{_called(name)} {_value(criterion)} (limit {limit})"


def _worst(proof: Document) -> list[str]:
    """Return the criteria that use most of their limits, the broken ones first."""
    limited = {name: criterion for name, criterion in proof["criteria"].items() if criterion["limit"] is not None}
    judged = [name for name in limited if name != "stability" or not limited[name]["ok"]]
    hardest = sorted(judged, key=lambda name: (limited[name]["ok"], -_used(limited[name])))[:_WORST]
    rows = [(f"of {count(len(proof['runs']), 'run')}", "the worst", "limit", "used")]
    for name in hardest:
        criterion, used = limited[name], _used(limited[name])
        rows.append((_called(name), _value(criterion), limit_text(criterion),
                     f"{math.floor(100.0 * used)} %" if criterion["ok"] else "FAIL"))
    often = proof["criteria"].get("switchings")
    if often is not None and often["limit"] is None:
        per_hour = math.inf if often["value"] is None else often["value"]
        rows.append(("switchings", f"{per_hour:.0f}{unit_text(often['unit'])}", "none",
                     wear_text(proof.get("target", ""), per_hour)))
    return table(rows, right=(1,)).splitlines()


def _used(criterion: Document) -> float:
    """Return the fraction of a limit that is used, above 1 beyond it, also for an event that never occurred."""
    value, limit = criterion["value"], criterion["limit"]
    if value is None:
        return 0.0 if criterion["ok"] else math.inf
    used, allowed = (limit, value) if criterion["bound"] == ">=" else (value, limit)
    if allowed > 0.0:
        return max(0.0, float(used) / float(allowed))
    return 0.0 if criterion["ok"] else math.inf


def _value(criterion: Document) -> str:
    return criterion_value(criterion) if criterion["value"] is None else quantity(criterion["value"], criterion["unit"])


def _called(name: str) -> str:
    return (name in CRITERION and CRITERION[name].label) or readable_name(name)


def _doubts(proof: Document, unsure: Iterable[str] = ()) -> dict[str, list[str]]:
    """Return the gaps and assumptions of the verdict, the most important first."""
    notes = notes_by_kind(proof)
    assumptions = [f"{name} = {setting}" for name, setting in proof["stated_settings"].items()]
    assumed = [each.removeprefix("assumed: ") for each in notes["assumed"]]
    return {
        "not known": [*notes["not known"], *unsure],
        "not tested": [_SETTINGS.sub(_points, part) for part in notes["not tested"]],
        "assumed": [*assumed, *(f"--assume {setting}" for setting in assumptions)],
        "asked": notes["asked"], "also": [remark for remark in notes["changed"] if NOTHING_PASSES not in remark],
        "faults": list(proof["faults"]),
    }


def _points(match: re.Match[str]) -> str:
    number = len(match[1].split(", "))
    return f"{count(number, 'point')} that the manual leaves open (no run shows a difference)"


def _values(words: Document, proof: Document) -> list[str]:
    """Return the values to enter and related settings; for refused parameters only their values."""
    rows = keyed_entries(words)
    if not words["files"]:
        values = ", ".join(f"{row.name} {row.then_text}" for row in rows)
        return wrap_text(values, "do not enter: ", _FAILING)
    forced = "exported with --force, against the verdict; " if words.get("forced") else ""
    return [*wrap_text(f"{forced}{_facts(words, proof)}", "values to enter: "), *_typed_lines(rows)]


def _typed_lines(rows: Sequence[KeyedEntry]) -> list[str]:
    """Return the words in the order in which they are typed in, each once or, where it changes, twice."""
    has_names = any(row.address != row.name for row in rows)
    cells = [[row.address, *([row.name] if has_names else []), row.first_text] for row in rows]
    if len(rows) > _WITH_MEANING:
        lines = two_columns(cells)
        short = lines if len(lines) < len(rows) else two_columns([[line[-2], line[-1]] for line in cells])
        return [f"  {line}" for line in min(lines, short, key=len)]
    later = [f"then {row.then_text}: " if row.changes else "" for row in rows]
    meant = [[*line, f"{then}{row.meaning}"] for line, then, row in zip(cells, later, rows, strict=True)]
    return [cut(f"  {line}") for line in table(meant).splitlines()]


def _facts(words: Document, proof: Document) -> str:
    """Return the required settings besides the parameters: interval, sensor, PWM, ramp."""
    scale, switch = words["scaling"], proof["actuator"]
    sensor = f" of {scale['input']}" if scale.get("input") else ""
    facts = [f"call every {figure(called_every_s(words, switch))} s",
             f"sensor{sensor} {figure(scale['low_degC'])} to {figure(scale['high_degC'])} °C"]
    if switch is not None:
        facts.append(f"PWM of {figure(switch['pwm_period_s'])} s")
    if boost := words.get("boost"):
        facts.append(f"boost until {figure(boost['within_degC'], 3)} °C from the setpoint")
    elif ramp_note(words):
        facts.append(f"setpoint ramp {figure(words['setpoint_ramp']['degC_per_min'], 3)} °C/min")
    return ", ".join(facts)


def _unsure(model: Document) -> list[str]:
    """Return the heater parameters that the log does not identify, as one part."""
    names = [label for label, _, ci95, _ in model_rows(model) if ci95 == NOT_IDENTIFIED]
    return [f"the heater's {', '.join(names)} by {'themselves' if len(names) > 1 else 'itself'}"] if names else []


def _heater(model: Document) -> str:
    others = len(model.get("candidates", ()))
    more = f"; {others} plausible heaters" if others > 1 else ""
    gain, lag, dead = (figure(model[name], 3) for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s"))
    return f"{gain} °C/%, time constant {lag} s, dead time {dead} s{more}"


def _ideal(design: Document) -> str:
    tn = design["integral_time_s"]
    return (f"{design['structure'].upper()} with K {figure(design['gain_pct_per_degC'])} %/°C, TN "
            f"{'none' if tn is None else f'{figure(tn)} s'}, TV {figure(design['derivative_time_s'])} s, TA "
            f"{figure(design['sample_time_s'])} s")


def _notes(document: Document) -> list[str]:
    return list(document.get("notes", ()))


def _counted(notes: Sequence[str]) -> list[str]:
    return [f"{len(notes)} more: --verbose"] if notes else []


def _files(words: Document, out: str) -> list[str]:
    """Return the two files that matter."""
    rows = [(str(Path(out) / "report.html"), "commissioning record (open in a browser, print, sign)")]
    if words["files"]:
        rows.append((str(Path(out) / main_file(words)), f"program for the {holder(words['target'])}"))
    lines = table(rows).splitlines()
    fits = all(len(line) <= WIDTH for line in lines)
    refused = [] if words["files"] else ["no files to enter: only proven parameters are exported (or use --force)"]
    return [*(lines if fits else [name for name, _ in rows]), *refused]
