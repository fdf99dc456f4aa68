"""`heatertune plan` as a user types it, and what `fit` says of a relay test."""

import csv
import json

import numpy as np
import pytest

from heatertune.model.experiment.fisher import Schedule, rise, rows_of
from heatertune.model.model_values import Fopdt
from heatertune.model.relay_test import TwoLevelRelay, simulate_relay

POINT = ("--gain", 0.4, 0.4, "--time-constant", 100, 100, "--dead-time", 10, 10, "--ambient", 20, 20)
TEST = ("--limit-temperature", 50, "--noise", 0.1, "--log-interval", 5, "--max-duration", 1000)


@pytest.mark.long
def test_a_doublet_is_proposed_as_table_and_schedule(run, tmp_path):
    path = tmp_path / "new" / "plan.csv"
    status, out, err = run("plan", *POINT, *TEST, "--kind", "doublet", "-o", path, "--quiet")
    assert (status, err) == (0, "")
    assert out.startswith(("== doublet, 250 s, at most", "== step, 250 s, at most"))
    assert "before" in out
    assert "worth it: every interval is expected within ±10 % on every heater" in out
    rows = list(csv.reader(path.read_text().splitlines()))
    assert rows[0] == ["time_s", "power_pct"]
    numbers = np.array(rows[1:], dtype=float)
    assert numbers[0].tolist() == [0.0, 0.0]
    assert numbers[-1].tolist() == [250.0, 0.0]
    # on the heater it was made for, the schedule keeps the limit: a first order never rises above ambient + 0.4·u
    assert 20.0 + 0.4 * numbers[:, 1].max() > 30.0
    for line in out.splitlines()[2:7]:
        assert line.strip()


@pytest.mark.long
def test_a_relay_test_is_proposed_with_its_settings(run, tmp_path):
    path = tmp_path / "plan.csv"
    status, out, _ = run("plan", *POINT, *TEST, "--relay", "-o", path)
    assert status == 0
    assert "setpoint" in out
    (row,) = csv.DictReader(path.read_text().splitlines())
    settings = {name: float(value) for name, value in row.items()}
    assert 20.0 < settings["on_degC"] < settings["off_degC"] < 50.0
    assert settings["off_degC"] - settings["on_degC"] == pytest.approx(0.6)  # ±3 standard deviations of 0.1 °C
    assert settings["rest_s"] > 0.0
    assert settings["high_pct"] > settings["low_pct"]


@pytest.mark.long
def test_the_document_holds_what_the_table_shows(run):
    status, out, err = run("plan", *POINT, *TEST, "--kind", "doublet", "--json", "--quiet", "--aim", 1)
    document = json.loads(out)
    assert (status, err, document["schema"]) == (0, "", "heatertune/plan/1")
    assert [each["duration_s"] for each in document["durations"]] == [250.0, 500.0, 750.0, 1000.0]
    assert document["reached"] == (document["worst_share"] <= 0.01)
    gain = document["quantities"]["gain_degC_per_pct"]
    assert gain["before"] == [0.4, 0.4]
    assert gain["after"][0] + gain["after"][1] == pytest.approx(0.8)
    half = 1.96 * document["heaters"][0]["errors"]["gain_degC_per_pct"]
    assert gain["after"][1] - 0.4 == pytest.approx(half)
    assert gain["worst_share"] == pytest.approx(half / 0.4)
    assert document["worst_share"] <= document["step_worst_share"] + 1e-12
    assert document["highest_degC"] <= 50.0


@pytest.mark.long
def test_an_experiment_that_tells_nothing_says_so(run):
    # the power's step shows 900 s later: nothing is seen of it in 300 s, so no interval has an end
    late = (*POINT[:6], "--dead-time", 800, 1000, "--ambient", 18, 22)
    status, out, err = run("plan", *late, *TEST, "--max-duration", 300, "--kind", "doublet", "--quiet")
    assert (status, err) == (0, "")
    assert "the aim of ±10 % is not reached" in out
    assert "no end in 300 s" in out
    assert "it would not tell the dead time better than it is known before" in out


@pytest.fixture
def model(tmp_path, run):
    """A model file as `fit` writes it, of a short step of a noisy heater."""
    time = np.arange(0.0, 400.0, 5.0)
    noise = np.random.default_rng(2).normal(0.0, 0.5, len(time))
    log, path = tmp_path / "log.csv", tmp_path / "model.json"
    power = np.where(time < 50.0, 0.0, 40.0)
    heater = Fopdt(gain_degC_per_pct=0.4, time_constant_s=100.0, dead_time_s=10.0)
    step = Schedule(base_pct=0.0, time_s=np.array([50.0]), power_pct=np.array([40.0]))
    temperature = 20.0 + rise(rows_of([heater]), step, time)[0] + noise
    rows = "\n".join(f"{t:g},{y:.3f},{u:g}" for t, y, u in zip(time, temperature, power, strict=True))
    log.write_text(f"time_s,temp_C,power_pct\n{rows}\n")
    assert run("fit", log, "-o", path, "--quiet")[0] == 0
    return path


@pytest.mark.long
def test_a_model_file_is_prior_and_noise(run, model):
    status, out, _ = run("plan", model, "--limit-temperature", 60, "--aim", 99, "--json", "--quiet")
    document = json.loads(out)
    fitted = json.loads(model.read_text())
    assert status == 0
    residuals = np.subtract(fitted["residuals"]["measured_degC"], fitted["residuals"]["simulated_degC"])
    noise = document["conditions"]["noise"]
    assert noise["std_degC"] == pytest.approx(np.std(residuals), rel=1e-3)
    assert noise["sample_time_s"] == 5.0
    assert noise["correlation"] == pytest.approx(max(0.0, fitted["residuals"]["autocorrelation"][0]), abs=1e-3)
    before = document["quantities"]["gain_degC_per_pct"]["before"]
    assert before[0] <= fitted["gain_degC_per_pct"] <= before[1]
    ends = [end for end in fitted["gain_degC_per_pct_ci95"] if end is not None]
    assert all(before[0] <= end <= before[1] for end in ends)
    assert {each["label"] for each in document["heaters"]} >= {"working model"}
    names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
    worst = max(abs(high - low) / 2.0 / fitted[name] for name in names for low, high in [fitted[f"{name}_ci95"]])
    for aim, known in ((100.0 * worst * 1.1, True), (100.0 * worst * 0.9, False)):
        shown = run("plan", model, "--limit-temperature", 60, "--aim", f"{aim:.6g}", "--quiet")[1]
        assert ("no experiment is needed for this aim" in shown) == known


@pytest.mark.parametrize(("arguments", "told"), [
    (("--limit-temperature", 50, "--noise", 1), "no model: name a model file, or add --gain, --time-constant, --dead-time"),
    ((*POINT, "--limit-temperature", 50), "--noise"),
    ((*POINT, "--limit-temperature", 15, "--noise", 1), "limit_degC"),
    ((*POINT, *TEST, "--ambient", 1, 2, 3), "--ambient has 3 numbers"),
    ((*POINT, *TEST, "--gain", 0.6, 0.3), "gain_degC_per_pct"),
    ((*POINT, *TEST, "--gain", -1, 0.3), "gain_degC_per_pct"),
    ((*POINT, *TEST, "--power", 50, 20), "most_pct"),
    ((*POINT, *TEST, "--power-now", 120), "base_pct"),
    ((*POINT, *TEST, "--correlation", 1.5), "correlation"),
    ((*POINT, *TEST, "--relay", "--limit-temperature", 20.9), "swings"),
    ((*POINT,), "--limit-temperature"),
])
def test_bad_input_is_told_in_one_line(run, arguments, told):
    status, out, err = run("plan", *arguments, "--quiet")
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert told in err


def test_a_model_and_ranges_together_are_refused(run, tmp_path):
    path = tmp_path / "model.json"
    path.write_text("{}")
    for extra in (("--gain", 1, 2), ("--ambient", 1, 2)):
        status, _, err = run("plan", path, *TEST, *extra)
        assert status == 2
        assert err.startswith("error: ")


@pytest.mark.long
def test_a_log_and_the_folder_of_its_design_are_planned_for_as_the_model_of_fit(run, model, tmp_path):
    (tmp_path / "design").mkdir()
    (tmp_path / "design" / "model.json").write_bytes(model.read_bytes())
    stated = ("--limit-temperature", 60, "--kind", "doublet", "--json", "--quiet")
    expected = run("plan", model, *stated)
    assert expected[0] == 0
    assert run("plan", tmp_path / "design", *stated)[1] == expected[1]
    assert run("plan", tmp_path / "log.csv", *stated)[1] == expected[1]
    highest = max(float(line.split(",")[1]) for line in (tmp_path / "log.csv").read_text().splitlines()[1:])
    unstated = json.loads(run("plan", tmp_path / "log.csv", *stated[2:])[1])
    assert unstated["conditions"]["limit_degC"] == highest
    assert unstated["highest_degC"] <= highest


def test_a_log_that_needs_options_names_the_way_by_fit_which_works(run, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("temp_C,power_pct\n" + "".join(
        f"{20 + 16 * (1 - np.exp(-max(0, k - 8) / 12)):.2f},{40 * (k > 5)}\n" for k in range(60)))
    status, _, err = run("plan", path, "--limit-temperature", 60, "--quiet")
    assert status == 2
    assert "--log-interval" in err
    assert "heatertune fit LOG -o model.json; then heatertune plan model.json" in err
    model = tmp_path / "model.json"
    assert run("fit", path, "--log-interval", 2, "-o", model, "--quiet")[0] == 0
    assert run("plan", model, "--limit-temperature", 60, "--kind", "doublet", "--quiet")[0] == 0


@pytest.mark.long
def test_fit_says_that_a_log_is_a_relay_test(run, tmp_path):
    heater = Fopdt(gain_degC_per_pct=0.4, time_constant_s=100.0, dead_time_s=10.0, ambient_degC=20.0)
    schedule = simulate_relay(heater, TwoLevelRelay(setpoint_degC=38.0, hysteresis_degC=0.5, high_pct=80.0), 700.0, sample_time_s=2.0)
    time = np.arange(0.0, 760.0, 2.0)
    power = np.where(time < 60.0, 0.0, schedule.at(time - 60.0))
    temperature = 20.0 + np.where(time < 60.0, 0.0, rise(rows_of([heater]), schedule, np.clip(time - 60.0, 0.0, None))[0])
    rows = "\n".join(f"{t:g},{y:.3f},{u:g}" for t, y, u in zip(time, temperature, power, strict=True))
    (tmp_path / "log.csv").write_text(f"time_s,temp_C,power_pct\n{rows}\n")
    status, out, _ = run("fit", tmp_path / "log.csv", "--quiet")
    assert status == 0
    for words in ("ultimate gain", "ultimate period", "log is a relay test: 0 and 80 %", "FOPDT from the oscillation"):
        assert words in out
