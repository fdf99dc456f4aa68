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
from heatertune.batch import CaseBatch, Progress, Row, TableColumn, Workers, run, silent
from heatertune.batch.engine import read_rows
from heatertune.batch.fleets import find_logs
from heatertune.codec import data_folder, read_document
from heatertune.errors import HeatertuneError, InputError, LogError
from heatertune.log import read_log
from heatertune.log.log_values import Log
from heatertune.loops.diagnosis import Cure, Diagnosis, cure_words, diagnose
from heatertune.loops.measures import Cause, LoopEntry, at_limit, list_loops, read_list
from heatertune.model import model_document
from heatertune.model.model_values import FittedModel, Fopdt, model_by_hand
from heatertune.model.power.known_controller import replay_controller
from heatertune.plc import Scaling, Words
from heatertune.proof.design_request import DesignRequest
from heatertune.proof.known_controller_check import controllers
from heatertune.proof.words_file import WORDS_SCHEMA, words_of
from heatertune.settings import ReadSettings
from heatertune.writing import read_bytes

__all__ = ["SCHEMA", "HealthSettings", "health", "last_table", "rank_rows"]

SCHEMA: Final = "heatertune/health/1"

_POINTS: Final = 90  # of a sparkline, each with its lowest and highest
_HEATER: Final = {"gain_degC_per_pct": "process gain [°C/%]", "time_constant_s": "time constant [s]",
                  "dead_time_s": "dead time [s]", "ambient_degC": "ambient temperature, reached without power [°C]"}
_COOLING: Final = "cooling_gain"
_COLUMNS: Final = (
    TableColumn("name", "text", "the loop"),
    TableColumn("file", "text", "its log, without the common part of the paths"),
    TableColumn("outcome", "text", "cause of the fault, or well; no log: it cannot be read; crashed: program error"),
    TableColumn("reason", "text", "the finding, with its figures"),
    TableColumn("also", "text", "further findings"),
    TableColumn("excess", "float", "worst value as a multiple of its limit; below 1: well"),
    TableColumn("confidence", "text", "confidence in the cause: high, medium, low"),
    TableColumn("doubt", "text", "reservations about the identified heater, or why none was identified"),
    TableColumn("what_to_do", "text", "recommendation in one sentence"),
    TableColumn("times_worse", "float", "mean error as a multiple of the best achievable for this heater"),
    TableColumn("half_cycles", "int", "consecutive half cycles of the error after one event"),
    TableColumn("period_s", "float", "period of a whole cycle [s]"),
    TableColumn("swing_degC", "float", "their median peak-to-peak value [°C]"),
    TableColumn("full_power_pct", "float", "fraction of the time at full power with the setpoint out of reach [%]"),
    TableColumn("switchings_per_h", "float", "switching operations of the heater per hour"),
    TableColumn("pwm_period_s", "float", "PWM period in the log [s]"),
    TableColumn("switch_ticks", "int", "timer ticks per PWM period, if the log shows them"),
    TableColumn("hours", "float", "length of the log [h]"),
    TableColumn("loads", "int", "loads found in the log"),
    *(TableColumn(name, "float", f"{what} of the identified heater") for name,
      what in _HEATER.items()),
    TableColumn(_COOLING, "float", "full cooling as a fraction of full heating"),
    TableColumn("fit_pct", "float", "fit of the heater to the log [%]"),
    TableColumn("target", "text", "controller of the parameters that would fix it"),
    TableColumn("words", "text", "these parameters, as JSON"),
    TableColumn("verdict", "text", "verdict of their proof"),
    TableColumn("why", "text", "limits that the proof does not keep, or why there are no parameters"),
    TableColumn("gain_pct_per_degC", "float", "proportional gain K of their design [%/°C]"),
    TableColumn("integral_time_s", "float", "its TN [s]"),
    TableColumn("sample_time_s", "float", "its TA [s]"),
    TableColumn("words_pwm_period_s", "float", "PWM period of the proof [s]"),
    TableColumn("was_degC", "float", "mean error of the log beyond noise [°C]"),
    TableColumn("would_degC", "float", "the same for the logged day, simulated with these parameters [°C]"),
    TableColumn("course", "text", "error for the plot: minimum and maximum of equal sections, as JSON [°C]"),
    TableColumn("log_taken", "text", "columns of the log and their meaning"),
)


class HealthTask(NamedTuple):
    """A loop on its way to a worker: what is known of it, its log, and the documents of its design."""

    loop: LoopEntry
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

    request: DesignRequest
    read: ReadSettings


def health(
    logs: str | Path, settings: HealthSettings, *, out: str | Path, workers: Workers,
    loops: str | Path | Mapping[str, LoopEntry] | None = None, since: str | Path | None = None, resume: bool = False,
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
        progress: called with how many loops are examined, and how many there are.

    Raises:
        InputError: no log, a list that is not right, no earlier table, documents of a design that are none; as
            `heatertune.batch.engine`.
    """
    folder, names = find_logs(logs)
    names_or_table, documents = _listed(loops)
    earlier = {} if since is None else {row["name"]: row for row in read_rows(Path(since))}
    cases = [_with_documents(loop, documents, earlier.get(loop.name)) for loop in list_loops(names, names_or_table)]
    batch = CaseBatch(
        do=_examined, common=settings, cases=cases, sent=partial(_sent, folder), lost=_lost, columns=_COLUMNS,
        identity={"asked": repr(settings.request), "read": repr(settings.read), "logs": hashlib.sha256(
            json.dumps(names).encode()).hexdigest()})
    summary = run(batch, out, workers=workers, resume=resume, progress=progress)
    rows = rank_rows(read_rows(Path(out)))
    causes = {cause.label for cause in Cause}
    return {
        "schema": SCHEMA, "table": summary["table"], "outcomes": summary["outcomes"],
        "loops": [row | _since(row, earlier) for row in rows if row["outcome"] in causes],
        "left_out": [{name: row[name] for name in ("name", "file", "outcome", "reason")}
                     for row in rows if row["outcome"] not in causes],
        "gone": sorted(set(earlier) - {row["name"] for row in rows}),
        "compared": since is not None,
    }


def _listed(loops: str | Path | Mapping[str, LoopEntry] | None) -> tuple[Mapping[str, LoopEntry], Path]:
    """Return the entries of the loops, and the folder in which the folders they name lie."""
    if loops is None or isinstance(loops, Mapping):
        return loops or {}, Path()
    return read_list(loops), Path(loops).parent


def rank_rows(rows: Sequence[Row]) -> list[Row]:
    """Return rows with the worst first; of two that are as bad, the surer one."""
    sure = {"high": 0, "medium": 1, "low": 2}
    return sorted(rows, key=lambda row: (-(row["excess"] or 0.0), sure.get(row["confidence"], 3), row["name"]))


def _since(row: Row, earlier: Mapping[str, Row]) -> dict[str, Any]:
    """Return a loop's last outcome, and whether it is better, worse or the same: a fifth, or another cause, counts."""
    before = earlier.get(row["name"])
    if before is None or before["excess"] is None:
        return {"was": None, "change": "new" if earlier else None}
    ratio = row["excess"] / max(before["excess"], 1e-9)
    both_well = row["outcome"] == before["outcome"] == Cause.WELL.label
    change = "same" if both_well or 1.0 / 1.2 <= ratio <= 1.2 else "worse" if ratio > 1.0 else "better"
    return {"was": before["outcome"], "change": change}


def _with_documents(loop: LoopEntry, folder: Path, before: Row | None) -> tuple[LoopEntry, Any, Any]:
    """Return a loop with the documents of its design; without, its heater is that of the earlier run."""
    if loop.folder is None:
        return loop, None, None if before is None else {name: before.get(name) for name in (*_HEATER, _COOLING)}
    data = data_folder(folder / loop.folder)
    words = data / "words.json"
    return (loop, read_document(words, WORDS_SCHEMA) if words.exists() else None,
            read_document(data / "model.json", model_document.SCHEMA))


def _sent(folder: str, case: tuple[LoopEntry, Any, Any]) -> HealthTask:
    loop, words, model = case
    try:
        return HealthTask(loop, read_bytes(Path(folder, loop.file)), None, words, model)
    except OSError as problem:
        return HealthTask(loop, None, f"cannot be read: {problem.strerror}", words, model)


def _lost(case: tuple[LoopEntry, Any, Any], why: str) -> Row:
    return {"name": case[0].name, "file": case[0].file, "outcome": "crashed", "reason": why}


def _examined(settings: HealthSettings, sent: HealthTask) -> Row:
    """Return the row of one loop; this runs on the worker."""
    loop = sent.loop
    row: Row = {"name": loop.name, "file": loop.file}
    try:
        if sent.content is None:
            raise LogError(str(sent.problem), file=loop.file)
        words = None if sent.words is None else words_of(sent.words, loop.target or sent.words["target"], loop.file)
        log = read_log(loop.file, settings.read, content=sent.content)
        row["log_taken"] = None if log.taken is None else log.taken.line
        with cache.cache_disabled():
            diagnosis = diagnose(_powered(log, loop, words), loop, *_before(sent.model))
            cure = cure_words(diagnosis, loop, _cure_request(settings.request, loop, words))
        return row | _diagnosis_row(diagnosis) | ({} if cure is None else _cure(cure))
    except HeatertuneError as problem:
        return row | {"outcome": "no log", "reason": str(problem)}
    except Exception as problem:  # one loop must not stop the others, whatever is wrong in the program
        return row | {"outcome": "crashed", "reason": f"{type(problem).__name__}: {problem}"}


def _powered(log: Log, loop: LoopEntry, words: Words | None) -> Log:
    """Return a log with its power; where it holds none, that of its known words."""
    if log.power_pct is not None or words is None or words.ramp is not None:
        return log
    return replay_controller(log, controllers(words)[0], loop.setpoint_degC)


def _before(model: Mapping[str, Any] | None) -> tuple[FittedModel | None, float | None]:
    """Return the heater of a document, or of an earlier run's row, and the gain of its cooler."""
    if model is None or model.get("gain_degC_per_pct", 0.0) is None:
        return None, None
    if "schema" not in model:
        return model_by_hand(Fopdt(**{name: model[name] for name in _HEATER})), model.get(_COOLING)
    fitted = model_document.from_document(model)
    return fitted, None if fitted.cooling is None else fitted.cooling.cooling_gain


def _cure_request(request: DesignRequest, loop: LoopEntry, words: Words | None) -> DesignRequest | None:
    """Return the request that this loop's cure is designed for, None where no controller is named."""
    target = loop.target or (None if words is None else words.target) or request.target
    if not target:
        return None
    scaling = request.scaling if words is None else words.scaling
    if loop.low_degC is not None and loop.high_degC is not None:
        scaling = Scaling(low_degC=loop.low_degC, high_degC=loop.high_degC)
    return replace(request, target=target, scaling=scaling)


def _diagnosis_row(diagnosis: Diagnosis) -> Row:
    fitted = diagnosis.fitted_model
    return {
        "outcome": diagnosis.cause.label, "reason": diagnosis.faults[0].message if diagnosis.faults else None,
        "also": "; ".join(fault.message for fault in diagnosis.faults[1:]) or None, "excess": float(diagnosis.excess),
        "confidence": diagnosis.confidence, "doubt": diagnosis.why_not or None, "what_to_do": diagnosis.cause.value,
        "times_worse": diagnosis.worse, "half_cycles": diagnosis.swings.count, "period_s": diagnosis.swings.period_s,
        "swing_degC": diagnosis.swings.size_degC, "full_power_pct": 100.0 * at_limit(diagnosis.course, high=True),
        "switchings_per_h": diagnosis.switchings_per_h, "pwm_period_s": diagnosis.pwm_period_s,
        "switch_ticks": diagnosis.switch_ticks, "hours": diagnosis.course.hours,
        "loads": len(diagnosis.loads), "course": json.dumps(_course(diagnosis)),
        **({"fit_pct": None} if fitted is None else {"fit_pct": fitted.fit_pct, **asdict(fitted.model)}),
        **({} if diagnosis.cooling is None else {_COOLING: diagnosis.cooling.fraction}),
    }


def _course(diagnosis: Diagnosis) -> list[list[float]]:
    """Return lowest and highest error of equal parts of the log, setpoint minus temperature turned about [°C]."""
    parts = np.array_split(-diagnosis.course.error_degC, min(_POINTS, len(diagnosis.course.error_degC)))
    return [[float(f"{part.min():.3g}"), float(f"{part.max():.3g}")] for part in parts]


def _cure(cure: Cure) -> Row:
    design = cure.design
    row: Row = {"verdict": cure.verdict or None, "why": cure.reason or None, "was_degC": cure.was_degC,
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
        raise InputError(f"--since last: {out} does not exist; omit --since in the first run")
    return Path(out)
