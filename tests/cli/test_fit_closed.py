"""`fit` on logs of closed loops: the table of hypotheses, several logs, a known controller."""

import csv
import json

import numpy as np
import pytest

from heatertune.codec import to_json
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.proof import Actuator, Scenario, simulate
from heatertune.proof.words_file import WORDS_SCHEMA

HEATER = Fopdt(gain_degC_per_pct=0.6, time_constant_s=300.0, dead_time_s=25.0, ambient_degC=22.0)
DESIGN = PidDesign(gain_pct_per_degC=8.0, integral_time_s=240.0, derivative_time_s=0.0, sample_time_s=6.0,
                   structure="pi", method="by hand")


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """A log of a simulated FB41 loop at 50 °C, and the words it ran."""
    folder = tmp_path_factory.mktemp("known")
    found = controller_for("fb41")
    words = found.encode(DESIGN, Scaling())
    trace = simulate(found, words, HEATER, Scenario(setpoint_degC=50.0, duration_s=1800.0, noise_degC=0.05),
                     Actuator(pwm_period_s=6.0))
    with (folder / "loop.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", "temperature_degC"])
        rows.writerows(zip(trace.time_s, np.round(trace.reading_degC + 0.5 * 100.0 / found.counts, 4), strict=True))
    (folder / "words.json").write_text(to_json({
        "schema": WORDS_SCHEMA, "target": "fb41", "words": dict(words.values), "sample_time_s": words.sample_time_s,
        "scaling": {"low_degC": 0.0, "high_degC": 100.0},
    }))
    return folder


@pytest.mark.long
def test_a_known_controller_gives_the_heater_and_the_table_of_its_open_points(run, known):
    given = ("fit", known / "loop.csv", "--controller", "fb41", "--words", known / "words.json", "--setpoint", 50)
    status, out, err = run(*given, "--json", "--quiet")
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert document["gain_degC_per_pct"] == pytest.approx(0.6, rel=0.12)
    assert document["time_constant_s"] == pytest.approx(300.0, rel=0.12)
    assert document["dead_time_s"] == pytest.approx(25.0, abs=4.0)
    assert len(document["hypotheses"]) > 2
    assert any("Closed again in simulation" in note for note in document["notes"])
    status, out, _ = run(*given, "--assume", "integral=rectangle")
    assert status == 0
    assert "fb41, integral = rectangle replayed" in out
    assert "fb41 replayed" not in out


@pytest.mark.long
def test_the_table_of_hypotheses_names_each_once(run):
    status, out, _ = run("fit", "table4", "--until", 640, "--hypotheses", "--quiet")
    table = out.split("\n\n")[-1].splitlines()
    assert status == 0
    assert table[0].split()[:2] == ["law", "gain"]
    assert len(table) == 1 + 20  # five laws, one lag and two, with and without a setpoint step
    assert "truncated velocity PI" in out
    assert "on a bound" in table[0]


@pytest.mark.long
def test_two_logs_give_one_heater_and_the_fit_of_each(run):
    status, out, _ = run("fit", "table3", "table4", "--until", 640, "--ambient", 22, 28, "--json", "--quiet", "--errata")
    document = json.loads(out)
    assert status == 0
    assert document["candidates"][0]["log"] == "table3 + table4"
    # the identification page, both tables up to 640 s on one plant: 91.2 and 95.9 %
    assert document["candidates"][0]["fits_pct"]["table3"] > 88.0
    assert document["candidates"][0]["fits_pct"]["table4"] > 94.0
    assert all(22.0 <= each["ambient_degC"] <= 28.0 for each in document["hypotheses"])


@pytest.mark.parametrize(("arguments", "told"), [
    (("table3", "--words", "words.json"), "--words needs --controller"),
    (("table3", "--setpoint", 50), "--setpoint needs --controller"),
    (("table3", "--assume", "a=b"), "--assume needs --controller"),
    (("table3", "--controller", "fb41"), "needs --words"),
    (("table3", "--controller", "fb42", "--words", "words.json"), "unknown target 'fb42'"),
    (("table3", "table4", "--controller", "fb41", "--words", "words.json"), "takes one log"),
    (("table3", "--controller", "weg", "--words", "words.json", "--setpoint", 50), "words of target 'fb41'"),
    (("table3", "--controller", "fb41", "--words", "words.json"), "give --setpoint"),
    (("table3", "table4", "--power-before", 10), "power_before_pct means nothing"),
    (("table3", "--ambient", 1, 2, 3), "3 values"),
    (("table3", "table3"), "twice"),
])
def test_what_cannot_be_is_refused_in_one_line(run, known, monkeypatch, arguments, told):
    monkeypatch.chdir(known)
    status, out, err = run("fit", *arguments, "--quiet")
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert told in err
    assert err.count("\n") == 1
