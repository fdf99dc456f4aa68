"""`validate`: exit status, document and words, with power and with a known controller."""

import csv
import json

import numpy as np
import pytest
from tests.model.twins import doublet, logged

from heatertune.codec import to_json
from heatertune.model.model_document import to_document
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.proof import Actuator, Scenario, simulate
from heatertune.proof.words_file import WORDS_SCHEMA

TRUE = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=12.0, ambient_degC=20.0)


@pytest.fixture
def day(tmp_path, monkeypatch):
    """A folder with the model of a heater and a log of it on another day."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.json").write_text(to_json(to_document(model_by_hand(TRUE))))
    time, power = doublet()
    log = logged(time, power, noise=np.random.default_rng(5).normal(0.0, 0.1, len(time)))
    _write(tmp_path / "day.csv", time_s=time, temperature_degC=log.temperature_degC, power_pct=power)
    _write(tmp_path / "warm.csv", time_s=time, temperature_degC=log.temperature_degC + 6.0, power_pct=power)
    return tmp_path


def _write(path, **columns):
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(columns)
        rows.writerows(zip(*(np.round(each, 4) for each in columns.values()), strict=True))


def test_a_model_that_holds_ends_with_status_0_and_its_document(run, day):
    status, out, _ = run("validate", "model.json", "day.csv", "--json", "--quiet", "-o", "found.json")
    document = json.loads(out)
    assert (status, document["verdict"]) == (0, "PASS")
    assert document["criteria"]["fit"]["value"] > 98.0
    assert {"largest", "at_lag_s", "limit", "ok"} == set(document["runs"][0]["input_crosscorrelation"])
    assert json.loads((day / "found.json").read_text()) == document


def test_a_model_that_does_not_hold_ends_with_status_1_and_says_by_what(run, day):
    status, out, _ = run("validate", "model.json", "warm.csv", "--quiet")
    assert status == 1
    assert out.splitlines()[-1] == "VERDICT FAIL, by fit and bias"
    assert "give --ambient" in out
    assert run("validate", "model.json", "warm.csv", "--ambient", 26, "--quiet")[0] == 0
    assert run("validate", "model.json", "day.csv", "--least-fit", 99.9, "--quiet")[0] == 1


@pytest.mark.long
def test_a_log_without_power_is_judged_through_its_known_controller(run, day):
    found = controller_for("fb41")
    words = found.encode(PidDesign(gain_pct_per_degC=6.0, integral_time_s=150.0, derivative_time_s=0.0,
                                   sample_time_s=4.0, structure="pi", method="by hand"), Scaling())
    trace = simulate(found, words, TRUE, Scenario(setpoint_degC=50.0, duration_s=1500.0, noise_degC=0.05),
                     Actuator(pwm_period_s=4.0))
    _write(day / "loop.csv", time_s=trace.time_s, temperature_degC=trace.reading_degC + 50.0 / found.counts)
    (day / "words.json").write_text(to_json({
        "schema": WORDS_SCHEMA, "target": "fb41", "words": dict(words.values), "sample_time_s": words.sample_time_s,
        "scaling": {"low_degC": 0.0, "high_degC": 100.0},
    }))
    known = ("--controller", "fb41", "--words", "words.json", "--setpoint", 50)
    status, out, _ = run("validate", "model.json", "loop.csv", *known, "--json", "--quiet")
    document = json.loads(out)
    assert (status, document["verdict"]) == (0, "PASS")
    assert document["notes"][0].startswith("The power was not logged; fb41 was run")
    status, _, err = run("validate", "model.json", "loop.csv", "--quiet")
    assert status == 2
    assert "--controller" in err
    assert run("validate", "model.json", "day.csv", *known, "--quiet")[0] == 2, "the power is there: no need to guess"
