"""One heater from its log, or its model, to proven words, as one flat row of a table."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Final

from heatertune import cache
from heatertune.batch.values import Column, Row
from heatertune.errors import HeatertuneError, LogError
from heatertune.model.values import FittedModel, Fopdt
from heatertune.pid.explain import unexplained
from heatertune.pid.values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.words import FLOATS
from heatertune.processors import on_one
from heatertune.proof import Proof
from heatertune.proof.asked import Asked
from heatertune.proof.closing.on_samples import closed_on_samples
from heatertune.proof.exported import as_exported
from heatertune.proof.verdict import blocking, samples_told

__all__ = ["HEAD", "RESULT", "lost_row", "word_columns", "zone_row"]

#: column → criterion of the proof
_CRITERIA: Final = {
    "overshoot_pct": "overshoot", "settling_time_s": "settling_time", "steady_offset_degC": "steady_offset",
    "limit_cycle_degC": "limit_cycle", "pwm_ripple_degC": "pwm_ripple", "iae_degC_s": "iae",
    "recovery_time_s": "recovery_time", "recovery_overshoot_pct": "recovery_overshoot", "deviation_degC": "deviation",
    "saturation_pct": "saturation", "switchings_per_h": "switchings", "overflows": "overflow",
    "interlock_trips": "interlock_trips", "ms": "ms", "gain_margin": "gain_margin",
    "phase_margin_deg": "phase_margin",
}

_WHAT: Final = {
    "gain_degC_per_pct": "process gain [°C/%]", "time_constant_s": "time constant [s]", "dead_time_s": "dead time [s]",
    "ambient_degC": "temperature without power [°C]",
}

_DESIGN: Final = {
    "gain_pct_per_degC": "proportional gain K [%/°C]", "integral_time_s": "TN [s], infinite without an I part",
    "derivative_time_s": "TV [s]", "sample_time_s": "sampling interval TA [s]",
}

#: the columns every row begins with
HEAD: Final = (
    Column(name="outcome", kind="text", what="PASS, FAIL or NOT PROVEN; else the stage that refused: no log, no fit, "
                                             "no design, no words, no proof; crashed: a fault of the program"),
    Column(name="reason", kind="text", what="what a proof did not keep, or why a stage refused"),
)

#: the columns of what was found
RESULT: Final = (
    Column(name="log_taken", kind="text", what="what was taken of the log as what"),
    Column(name="fit_outcome", kind="text", what="how the fit ended"),
    *(Column(name=f"{name}{end}", kind="float", what=f"{what}{of}") for name, what in _WHAT.items() for end, of in (
        ("", " of the working model"), ("_ci95_low", ", low end of its 95 % interval"),
        ("_ci95_high", ", high end of its 95 % interval"))),
    Column(name="fit_pct", kind="float", what="how much of the log the working model explains [%]"),
    Column(name="models", kind="int", what="candidate models that were tuned for and proven on"),
    *(Column(name=name, kind="float", what=f"{what} of the design") for name, what in _DESIGN.items()),
    Column(name="structure", kind="text", what="parts that act"),
    Column(name="method", kind="text", what="how the design was found"),
    Column(name="words", kind="text", what="the words the PLC will hold, as JSON"),
    Column(name="remarks", kind="text", what="what else stands on the verdict's line: what was changed to pass, or "
                                             "what would pass"),
    Column(name="ramp_degC_per_min", kind="float", what="setpoint ramp [°C/min]; empty: none"),
    Column(name="hold_degC", kind="float", what="its holdback: how far from the reading it lets the setpoint be [°C]; "
                                                "empty: as far as it goes"),
    Column(name="boost_within_degC", kind="float", what="full power until so near to the setpoint [°C]; empty: none"),
    Column(name="boost_again_degC", kind="float", what="and again where it is farther off than this [°C]"),
    Column(name="setpoint_degC", kind="float", what="setpoint of the proof [°C]"),
    Column(name="pwm_period_s", kind="float", what="PWM period of the proof [s]: the one to set where none was given"),
    Column(name="runs", kind="int", what="closed-loop runs of the proof"),
    *(Column(name=name, kind="float", what=f"{criterion.replace('_', ' ')}, the worst over all runs")
      for name, criterion in _CRITERIA.items()),
    Column(name="samples", kind="int", what="drawn heaters on which the words were proven, too"),
    Column(name="samples_passing_pct", kind="float", what="share of them that keep every limit [%]"),
    Column(name="samples_worst_seed", kind="int", what="seed of the worst of them, for verify --replay"),
)


def word_columns(targets: Iterable[str]) -> tuple[Column, ...]:
    """Return a column for every word of the targets; words of one name share it.

    Raises:
        UnknownName: no such target.
    """
    columns: dict[str, Column] = {}
    for target in targets:
        for field in controller_for(target).fields:
            before = columns.get(field.name)
            whole = field.format not in FLOATS and (before is None or before.kind == "int")
            what = f"word {field.name} of {target}" if before is None else f"{before.what}, {target}"
            columns[field.name] = Column(name=f"word_{field.name}", kind="int" if whole else "float", what=what)
    return tuple(columns.values())


def zone_row(name: str, find: Callable[[], FittedModel], asked: Asked) -> Row:
    """Take a heater through the chain as `design` does; what cannot be done is told in the row, never raised.

    Nothing but what `find` finds is kept in the cache: a million designs would fill the disk.

    Args:
        name: of the row.
        find: reads and fits the log, or reads the model.
        asked: what the design is asked for.
    """
    row: Row = {"name": name}
    stage = "no fit"
    try:
        fitted = find()
        row |= _model(fitted)
        with cache.unused(), unexplained(), on_one():
            begun = list[str]()
            try:
                design = closed_on_samples(fitted, asked, stage=begun.append)
                proof = as_exported(design.proof)
            finally:
                stage = f"no {begun[-1]}"
            return row | _design(design.wished) | _words(proof.words) | _proof(proof) | _sampled(proof)
    except HeatertuneError as problem:
        return row | {"outcome": "no log" if isinstance(problem, LogError) else stage, "reason": str(problem)}
    except Exception as problem:  # one zone must not stop the others, whatever is wrong in the program
        return row | {"outcome": "crashed", "reason": f"{stage}: {type(problem).__name__}: {problem}"}


def lost_row(name: str, why: str) -> Row:
    """Return the row of a case whose process died."""
    return {"name": name, "outcome": "crashed", "reason": why}


def _model(fitted: FittedModel) -> Row:
    row: Row = {"log_taken": "; ".join(fitted.log_told) or None, "fit_outcome": fitted.outcome.name,
                "fit_pct": fitted.fit_pct, "models": len(fitted.plants)}
    for field in fields(Fopdt):
        interval = fitted.ci95.get(field.name)
        row[field.name] = getattr(fitted.model, field.name)
        row[f"{field.name}_ci95_low"] = None if interval is None else interval.low
        row[f"{field.name}_ci95_high"] = None if interval is None else interval.high
    return row


def _design(design: PidDesign) -> Row:
    return {name: getattr(design, name) for name in (*_DESIGN, "structure", "method")}


def _words(words: Words) -> Row:
    values = dict(words.values)
    return {"words": json.dumps(values), **{f"word_{name}": value for name, value in values.items()}}


def _proof(proof: Proof) -> Row:
    worst, boost = {criterion.name: criterion for criterion in proof.criteria}, proof.words.boost
    broken = [criterion.name for criterion in proof.criteria if not criterion.ok]
    reasons = [f"not kept: {', '.join(broken)}"] if broken else []
    reasons += [f"not proven: {criterion['name']}" for criterion in blocking(proof.heard.to_document())]
    if proof.samples is not None and proof.samples.verdict != "PASS":
        reasons += [samples_told(proof.samples.to_document())]
    return {
        "outcome": proof.verdict, "reason": "; ".join(reasons) or None,
        "remarks": "; ".join(proof.heard.remarks) or None,
        "ramp_degC_per_min": None if proof.words.ramp is None else proof.ramp_degC_per_min,
        "hold_degC": proof.hold_degC,
        "boost_within_degC": None if boost is None else boost.within_degC,
        "boost_again_degC": None if boost is None else boost.again_degC,
        "setpoint_degC": proof.scenario.setpoint_degC, "pwm_period_s": proof.actuator.pwm_period_s,
        "runs": len(proof.runs),
        **{column: None if name not in worst or math.isnan(worst[name].value) else float(worst[name].value)
           for column, name in _CRITERIA.items()},
    }


def _sampled(proof: Proof) -> Row:
    drawn = proof.samples
    return {} if drawn is None else {
        "samples": drawn.count, "samples_passing_pct": 100.0 * drawn.passing, "samples_worst_seed": drawn.worst_seed}
