"""One of every document, made of values in a moment: what `tests/bench/fuzz.py` damages. Every optional field is there."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from heatertune import chain
from heatertune.chain.pipeline import dossier
from heatertune.codec import to_json
from heatertune.log.log_values import Log
from heatertune.model import model_document
from heatertune.model.findings import Finding
from heatertune.model.model_values import (
    Candidate,
    FitOutcome,
    FittedModel,
    Fopdt,
    Half,
    HeldOut,
    InputCorrelation,
    OneLog,
    Residuals,
    TwoLag,
    Validation,
    model_by_hand,
)
from heatertune.model.statistics import Interval
from heatertune.pid import design_document as pid_document
from heatertune.pid.design_values import Margins, PidDesign, Promise
from heatertune.plc import controller_for
from heatertune.writing import write_files

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
DESIGN = PidDesign(
    gain_pct_per_degC=9.5, integral_time_s=66.0, derivative_time_s=0.0, sample_time_s=4.0, structure="pi", method="by hand",
    margins=Margins(ms=1.6, mt=1.2, gain_margin=3.1, phase_margin_deg=51.0), iae_load=8.25, iae_setpoint=901.5, mks=9.6,
    notes=("one note",), promise=Promise(way="p95", limits={"ms": 1.6}), step_power_limit_pct_per_degC=80.0,
)
STUDY = """\
[fixed]
model = "model.json"
setpoint_degC = 50.0
tolerance_degC = 1.5
pwm_period_s = 4.0
[grid]
target = ["s5-ob251", "s7-300"]
ms = [1.4, 1.6]
[[case]]
target = "s7-200"
switches = { rails = "edges_go_on" }
samples = 10
"""


def rich_model() -> FittedModel:
    """Return a fit with every field filled, its numbers none that any log gave."""
    values = {"gain_degC_per_pct": 0.37, "time_constant_s": 167.0, "dead_time_s": 12.0}
    ci95 = {name: Interval(low=0.9 * value, high=None) for name, value in values.items()}
    halves = tuple(
        Half(window_s=(start, start + 300.0), values=values, ci95=ci95, ambient_degC=ambient, fit_pct=91.0, rmse_degC=0.2)
        for start, ambient in ((0.0, 22.0), (300.0, None)))
    one_lag = Candidate(
        model=HEATER, log="log", window_s=(0.0, 600.0), law="power logged", fit_pct=95.0, rmse_degC=0.1, delta_bic=0.0,
        fits_pct={"log": 95.0}, hold_out_rmse_degC=0.2, cross_rmse_degC=0.3, on_bound=("dead_time_s",))
    two_lags = Candidate(
        model=TwoLag(gain_degC_per_pct=0.38, time_constant_s=150.0, second_time_constant_s=9.0, dead_time_s=8.0, ambient_degC=None),
        log="log", window_s=(0.0, 600.0), law="relay", controller={"width_degC": 1.5}, fit_pct=94.0, rmse_degC=0.12,
        delta_bic=3.5, part="dead time at its high end")
    logged = own_log()  # its readings are the model's own: of others the folder would be refused
    return FittedModel(
        model=HEATER, outcome=FitOutcome.IDENTIFIED, method="made by hand",
        ci95={"gain_degC_per_pct": Interval(low=0.35, high=0.39), "time_constant_s": Interval(low=150.0, high=None),
              "dead_time_s": None, "ambient_degC": None},
        combinations={"gain_per_time_constant_degC_per_s_pct": (0.0022, Interval(low=0.002, high=0.0024))},
        candidates=(one_lag, two_lags), hypotheses=(one_lag, two_lags), fit_pct=95.0, notes=("a note",),
        residuals=Residuals(time_s=logged.time_s, measured_degC=logged.temperature_degC, simulated_degC=logged.temperature_degC,
                            autocorrelation=np.array([0.5, 0.25])),
        validation=Validation(
            ljung_box=17.5, input_correlation=InputCorrelation(largest=0.1, at_lag_s=10.0, limit=0.3),
            held_out=HeldOut(fit_pct=90.0, rmse_degC=0.2, windows_s=((0.0, 300.0), (300.0, 600.0)), rmses_degC=(0.1, 0.3)),
            halves=(halves[0], halves[1])),
        logs=(OneLog(name="log", fit_pct=95.0, alone_fit_pct=96.0, ambient_degC=22.0, drift_degC_per_s=0.0, noise_degC=0.1,
                     values=values, ci95=ci95),),
        log_summary=("a line",), findings=(Finding(name="repaired", message="Two rows were left out."),), setpoint_degC=50.0,
        log_interval_s=1.0, least_dead_time_s=0.5, reading_step_degC=0.1, assumed={"sensor_delay_s": 1.0},
    )


def own_log() -> Log:
    """Return the log of a heater that only heats."""
    time = np.arange(0.0, 400.0, 10.0)
    return Log(name="own log", source="own.csv", time_s=time, temperature_degC=22.0 + 30.0 * (1 - np.exp(-time / 167.0)),
               power_pct=np.full_like(time, 80.0))


def write_all(folder: Path) -> None:
    """Write the documents of `heatertune design`, a model by hand, a dump, a log, raw inputs and a study into a folder."""
    fitted, bare = rich_model(), model_by_hand(HEATER)
    words = chain.encode(DESIGN, "s5-ob251")
    proof = chain.prove(words, bare, setpoint_degC=45.0)
    files = chain.export(words, proof, force=True)
    documents = dossier(own_log(), bare, DESIGN, proof, files)
    documents |= {
        "model": model_document.to_document(fitted), "pid": pid_document.to_document(DESIGN, fitted),
        "bare": model_document.to_document(bare)}
    inputs = list(controller_for("s5-ob251").inputs)[:2]
    log = own_log()
    rows = (f"{t:g},{y:.2f},{0 if t < 20 else 80},45" for t, y in zip(log.time_s, log.temperature_degC, strict=True))
    write_files(folder, {
        **{f"{name}.json": to_json(document) for name, document in documents.items()}, **files, "study.toml": STUDY,
        "log.csv": "\n".join(["time [s],T [degC],power [%],SP [degC]", *rows]) + "\n",
        "inputs.csv": "\n".join([",".join(inputs), *["1024,500"] * 5]) + "\n",
    })
