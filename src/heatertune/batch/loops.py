"""The logs of running loops → one table: what is wrong with each, why, and the words that would cure it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from heatertune import cache
from heatertune.batch import Batch, Column, Progress, Row, Workers, run, silent
from heatertune.batch.fleets import find_logs
from heatertune.batch.table import read_rows
from heatertune.documents import data_folder, read_document
from heatertune.errors import HeatertuneError, InputError, LogError
from heatertune.files import read_bytes
from heatertune.log import read_log
from heatertune.log.values import Log
from heatertune.loops.cure import Cure, cured
from heatertune.loops.diagnosis import Diagnosis, diagnosed
from heatertune.loops.listed import listed, read_list
from heatertune.loops.measures import at_limit
from heatertune.loops.values import Cause, Loop
from heatertune.model import document as model_document
from heatertune.model.by_hand import model_by_hand
from heatertune.model.power.known_controller import replayed
from heatertune.model.values import FittedModel, Fopdt
from heatertune.plc import Scaling, Words
from heatertune.proof.asked import Asked
from heatertune.proof.known import controllers
from heatertune.proof.words_file import WORDS_SCHEMA, words_of
from heatertune.settings import ReadSettings

__all__ = ["SCHEMA", "HealthSettings", "health", "last_table", "ranked"]

SCHEMA: Final = "heatertune/health/1"

_POINTS: Final = 90  # of a sparkline, each with its lowest and highest
_HEATER: Final = {"gain_degC_per_pct": "process gain [°C/%]", "time_constant_s": "time constant [s]",
                  "dead_time_s": "dead time [s]", "ambient_degC": "temperature without power [°C]"}
_COLUMNS: Final = (
    Column(name="name", kind="text", what="the loop"),
    Column(name="file", kind="text", what="its log, without the part of its path that all logs share"),
    Column(name="outcome", kind="text", what="the cause of what is wrong, or well; no log: it cannot be read; crashed: "
                                             "a fault of the program"),
    Column(name="reason", kind="text", what="what was found, with its numbers"),
    Column(name="also", kind="text", what="what else was found"),
    Column(name="excess", kind="float", what="how far the worst is beyond what is accepted; below 1: well"),
    Column(name="confidence", kind="text", what="of the cause: high, medium, low"),
    Column(name="doubt", kind="text", what="what is to be said against the heater found, or why none was"),
    Column(name="what_to_do", kind="text", what="in one sentence"),
    Column(name="times_worse", kind="float", what="mean error, as a multiple of what is possible for this heater"),
    Column(name="half_cycles", kind="int", what="of the error in a row after one event"),
    Column(name="period_s", kind="float", what="of a whole cycle [s]"),
    Column(name="swing_degC", kind="float", what="median peak to peak of them [°C]"),
    Column(name="full_power_pct", kind="float", what="share of the time at full power, the setpoint out of reach [%]"),
    Column(name="switchings_per_h", kind="float", what="of what switches the heater"),
    Column(name="pwm_period_s", kind="float", what="in force [s]"),
    Column(name="switch_ticks", kind="int", what="ticks that the switch counts in it, where the log shows them"),
    Column(name="hours", kind="float", what="length of the log [h]"),
    Column(name="loads", kind="int", what="loads found in it"),
    *(Column(name=name, kind="float", what=f"{what} of the heater found") for name, what in _HEATER.items()),
    Column(name="fit_pct", kind="float", what="how much of the log it explains [%]"),
    Column(name="target", kind="text", what="controller of the words that would cure it"),
    Column(name="words", kind="text", what="these words, as JSON"),
    Column(name="verdict", kind="text", what="of their proof"),
    Column(name="why", kind="text", what="what the proof does not keep, or why there are no words"),
    Column(name="gain_pct_per_degC", kind="float", what="proportional gain K of these words' design [%/°C]"),
    Column(name="integral_time_s", kind="float", what="its TN [s]"),
    Column(name="sample_time_s", kind="float", what="its TA [s]"),
    Column(name="words_pwm_period_s", kind="float", what="PWM period of the proof [s]"),
    Column(name="was_degC", kind="float", what="mean error of the log beyond noise [°C]"),
    Column(name="would_degC", kind="float", what="the same, the logged day lived with these words [°C]"),
    Column(name="course", kind="text", what="the error for a picture: lowest and highest of equal parts, as JSON [°C]"),
    Column(name="log_taken", kind="text", what="what was taken of the log as what"),
)


class Sent(NamedTuple):
    """A loop on its way to a worker: what is known of it, its log, and the documents of its design."""

    loop: Loop
    content: bytes | None
    problem: str | None
    words: Mapping[str, Any] | None
    model: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthSettings:
    """What is asked of all loops.

    Attributes:
        asked: what a cure is designed for; its target may be empty: only loops whose own is known get words.
        read: how the logs are read.
    """

    asked: Asked
    read: ReadSettings


def health(
    logs: str | Path, settings: HealthSettings, *, out: str | Path, workers: Workers,
    loops: str | Path | Mapping[str, Loop] | None = None, since: str | Path | None = None, resume: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Examine every loop whose log is there, write the table, and return the document, the worst loop first.

    Args:
        logs: as `heatertune.batch.fleets.find_logs`.
        settings: what is asked of all loops.
        out: Parquet file.
        workers: where the loops are examined.
        loops: list of the loops, see `read_list`, or what it says; None: each log is a loop of its name.
        since: table of an earlier run; each loop is told beside what it was then.
        resume: go on where a run was stopped.
        progress: told how many loops are examined, and how many there are.

    Raises:
        InputError: no log, a list that is not right, no earlier table, documents of a design that are none; as
            `heatertune.batch.engine`.
    """
    folder, names = find_logs(logs)
    told, beside = _listed(loops)
    earlier = {} if since is None else {row["name"]: row for row in read_rows(Path(since))}
    cases = [_with_documents(loop, beside, earlier.get(loop.name)) for loop in listed(names, told)]
    batch = Batch(
        do=_examined, shared=settings, cases=cases, sent=partial(_sent, folder), lost=_lost, columns=_COLUMNS,
        identity={"asked": repr(settings.asked), "read": repr(settings.read), "logs": hashlib.sha256(
            json.dumps(names).encode()).hexdigest()})
    summary = run(batch, out, workers=workers, resume=resume, progress=progress)
    rows = ranked(read_rows(Path(out)))
    causes = {cause.told for cause in Cause}
    return {
        "schema": SCHEMA, "table": summary["table"], "outcomes": summary["outcomes"],
        "loops": [row | _since(row, earlier) for row in rows if row["outcome"] in causes],
        "left_out": [{name: row[name] for name in ("name", "file", "outcome", "reason")}
                     for row in rows if row["outcome"] not in causes],
        "gone": sorted(set(earlier) - {row["name"] for row in rows}),
        "compared": since is not None,
    }


def _listed(loops: str | Path | Mapping[str, Loop] | None) -> tuple[Mapping[str, Loop], Path]:
    """Return what is said of the loops, and where the folders that it names lie."""
    if loops is None or isinstance(loops, Mapping):
        return loops or {}, Path()
    return read_list(loops), Path(loops).parent


def ranked(rows: Sequence[Row]) -> list[Row]:
    """Return rows with the worst first; of two that are as bad, the surer one."""
    sure = {"high": 0, "medium": 1, "low": 2}
    return sorted(rows, key=lambda row: (-(row["excess"] or 0.0), sure.get(row["confidence"], 3), row["name"]))


def _since(row: Row, earlier: Mapping[str, Row]) -> dict[str, Any]:
    """Return what a loop was, and whether it is better, worse or the same: a fifth, or another cause, counts."""
    before = earlier.get(row["name"])
    if before is None or before["excess"] is None:
        return {"was": None, "change": "new" if earlier else None}
    ratio = row["excess"] / max(before["excess"], 1e-9)
    both_well = row["outcome"] == before["outcome"] == Cause.WELL.told
    change = "same" if both_well or 1.0 / 1.2 <= ratio <= 1.2 else "worse" if ratio > 1.0 else "better"
    return {"was": before["outcome"], "change": change}


def _with_documents(loop: Loop, beside: Path, before: Row | None) -> tuple[Loop, Any, Any]:
    """Return a loop with the documents of its design; without, its heater is that of the earlier run."""
    if loop.folder is None:
        return loop, None, None if before is None else {name: before[name] for name in _HEATER}
    data = data_folder(beside / loop.folder)
    words = data / "words.json"
    return (loop, read_document(words, WORDS_SCHEMA) if words.exists() else None,
            read_document(data / "model.json", model_document.SCHEMA))


def _sent(folder: str, case: tuple[Loop, Any, Any]) -> Sent:
    loop, words, model = case
    try:
        return Sent(loop, read_bytes(Path(folder, loop.file)), None, words, model)
    except OSError as problem:
        return Sent(loop, None, f"cannot be read: {problem.strerror}", words, model)


def _lost(case: tuple[Loop, Any, Any], why: str) -> Row:
    return {"name": case[0].name, "file": case[0].file, "outcome": "crashed", "reason": why}


def _examined(settings: HealthSettings, sent: Sent) -> Row:
    """Return the row of one loop; this runs on the worker."""
    loop = sent.loop
    row: Row = {"name": loop.name, "file": loop.file}
    try:
        if sent.content is None:
            raise LogError(str(sent.problem), file=loop.file)
        words = None if sent.words is None else words_of(sent.words, loop.target or sent.words["target"], loop.file)
        log = read_log(loop.file, settings.read, content=sent.content)
        row["log_taken"] = None if log.taken is None else log.taken.line
        with cache.unused():
            told = diagnosed(_powered(log, loop, words), loop, _before(sent.model))
            cure = cured(told, loop, _asked(settings.asked, loop, words))
        return row | _told(told) | ({} if cure is None else _cure(cure))
    except HeatertuneError as problem:
        return row | {"outcome": "no log", "reason": str(problem)}
    except Exception as problem:  # one loop must not stop the others, whatever is wrong in the program
        return row | {"outcome": "crashed", "reason": f"{type(problem).__name__}: {problem}"}


def _powered(log: Log, loop: Loop, words: Words | None) -> Log:
    """Return a log with its power; where it holds none, that of its known words."""
    if log.power_pct is not None or words is None or words.ramp is not None:
        return log
    return replayed(log, controllers(words)[0], loop.setpoint_degC)


def _before(model: Mapping[str, Any] | None) -> FittedModel | None:
    if model is None or model.get("gain_degC_per_pct", 0.0) is None:
        return None
    return model_document.from_document(model) if "schema" in model else model_by_hand(Fopdt(**model))


def _asked(asked: Asked, loop: Loop, words: Words | None) -> Asked | None:
    """Return what this loop's cure is designed for, None where nobody says for which controller."""
    target = loop.target or (None if words is None else words.target) or asked.target
    if not target:
        return None
    scaling = asked.scaling if words is None else words.scaling
    if loop.low_degC is not None and loop.high_degC is not None:
        scaling = Scaling(low_degC=loop.low_degC, high_degC=loop.high_degC)
    return replace(asked, target=target, scaling=scaling)


def _told(told: Diagnosis) -> Row:
    heater = None if told.fitted is None else told.fitted.model
    return {
        "outcome": told.cause.told, "reason": told.found[0].told if told.found else None,
        "also": "; ".join(found.told for found in told.found[1:]) or None, "excess": float(told.excess),
        "confidence": told.confidence, "doubt": told.why_not or None, "what_to_do": told.cause.value,
        "times_worse": told.worse, "half_cycles": told.swings.count, "period_s": told.swings.period_s,
        "swing_degC": told.swings.size_degC, "full_power_pct": 100.0 * at_limit(told.course, high=True),
        "switchings_per_h": told.switchings_per_h, "pwm_period_s": told.pwm_period_s, "switch_ticks": told.switch_ticks,
        "hours": told.course.hours,
        "loads": len(told.loads), "course": json.dumps(_course(told)),
        "fit_pct": None if told.fitted is None else told.fitted.fit_pct,
        **({} if heater is None else asdict(heater)),
    }


def _course(told: Diagnosis) -> list[list[float]]:
    """Return lowest and highest error of equal parts of the log, setpoint minus temperature turned about [°C]."""
    parts = np.array_split(-told.course.error_degC, min(_POINTS, len(told.course.error_degC)))
    return [[float(f"{part.min():.3g}"), float(f"{part.max():.3g}")] for part in parts]


def _cure(cure: Cure) -> Row:
    design = cure.design
    row: Row = {"verdict": cure.verdict or None, "why": cure.why or None, "was_degC": cure.was_degC,
                "would_degC": cure.would_degC, "words_pwm_period_s": cure.pwm_period_s}
    if cure.words is None or design is None:
        return row
    return row | {"target": cure.words.target, "words": json.dumps(dict(cure.words.values)),
                  **{name: getattr(design, name) for name in ("gain_pct_per_degC", "integral_time_s", "sample_time_s")}}


def last_table(out: str | Path) -> Path:
    """Return the table of the last run at a place.

    Raises:
        InputError: there is none.
    """
    if not Path(out).is_file():
        raise InputError(f"--since last: there is no {out} of an earlier run; leave --since out the first time")
    return Path(out)
