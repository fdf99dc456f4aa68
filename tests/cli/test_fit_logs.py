"""`fit` on several logs of one heater with power, as a user types it."""

import json

import numpy as np
import pytest
from tests.model.twins import GAIN, LAG, logged

TIME = np.arange(0.0, 900.0, 4.0)


def write(folder, name, *powers, gain=GAIN, without_power=False):
    power = np.select([TIME < 60, TIME < 400, TIME < 700], [0.0, *powers[:2]], powers[2])
    log = logged(TIME, power, gain=gain, noise=np.random.default_rng(len(name)).normal(0.0, 0.1, len(TIME)))
    columns = [log.time_s, log.temperature_degC] + [power] * (not without_power)
    head = "time_s,temperature_degC" + ("" if without_power else ",power_pct")
    np.savetxt(folder / f"{name}.csv", np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.4f")
    return folder / f"{name}.csv"


@pytest.mark.long
def test_two_logs_give_one_model_that_tune_takes(run, tmp_path):
    logs = write(tmp_path, "first", 60, 10, 80), write(tmp_path, "second", 40, 90, 0)
    status, out, _ = run("fit", *logs, "-o", tmp_path / "model.json", "--json")
    assert status == 0
    document = json.loads(out)
    assert document["gain_degC_per_pct"] == pytest.approx(GAIN, rel=0.01)
    assert document["time_constant_s"] == pytest.approx(LAG, rel=0.02)
    assert [log["name"] for log in document["logs"]] == ["first", "second"]
    assert all(log["fit_pct"] > 98.0 for log in document["logs"])
    low, high = document["logs"][0]["alone"]["gain_degC_per_pct_ci95"]
    assert low < GAIN < high
    status, out, _ = run("tune", tmp_path / "model.json", "--method", "simc", "--sample-time", 0, "--json", "--quiet")
    assert status == 0
    # continuous SIMC for PI: K = T/(k·2·L) with τc = L (S. Skogestad 2003, eq. 23), on the model above
    expected = document["time_constant_s"] / (document["gain_degC_per_pct"] * 2.0 * document["dead_time_s"])
    assert json.loads(out)["gain_pct_per_degC"] == pytest.approx(expected, rel=1e-6)


def test_a_log_with_power_and_one_without_are_not_mixed(run, tmp_path):
    logs = write(tmp_path, "first", 60, 10, 80), write(tmp_path, "bare", 40, 90, 0, without_power=True)
    status, out, err = run("fit", *logs, "--quiet")
    assert (status, out) == (2, "")
    assert err.startswith("error: first contains the power and bare does not")
    assert err.count("\n") == 1
