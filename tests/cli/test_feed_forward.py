"""`heatertune feed-forward`, from a log with a fan to the program that feeds it."""

import json

import pytest
from tests.conftest import fan_log


@pytest.fixture
def designed(run, tmp_path):
    """The folder of a design for what a fan cools."""
    (tmp_path / "oven.csv").write_text(fan_log(), encoding="utf-8")
    status, _, _ = run("design", tmp_path / "oven.csv", "--disturbance-column", "fan", "--target", "fb41", "--setpoint", 70,
                       "--out", tmp_path / "oven", "--quiet")
    assert status == 0
    return tmp_path / "oven"


@pytest.mark.long(seconds=20)
@pytest.mark.usefixtures("whatever_pays")
def test_a_fan_is_fed_forward(designed, run):
    folder = designed
    seen = json.loads((folder / "data" / "model.json").read_text())["disturbance"]
    low, high = seen["pct_per_unit_ci95"]
    assert low <= -12.0 <= high  # of the simulation
    status, out, _ = run("feed-forward", folder, "--disturbance-range", 0, 1, "--contact")
    assert status == 0
    assert "fan: -1" in out
    assert "VERDICT PASS" in out
    text = (folder / "feed_forward.awl").read_text()
    assert "A     I      1.0" in text
    assert "// verdict of the proof: PASS" in text
    document = json.loads((folder / "data" / "feed_forward.json").read_text())
    assert document["at_low"] == 0.0
    assert document["at_high"] == pytest.approx(-seen["pct_per_unit"], rel=1e-6)
    plain, fed = document["runs"][0]["deviation_degC"]
    assert fed < 0.8 * plain
    (folder / "data" / "digest.json").unlink()  # it would refuse the changed model first
    for changed, match in (
        (None, "its log has no disturbance"),
        (seen | {"delta_bic": 2.0}, "The log does not show that the disturbance 'fan' acts"),
        (seen | {"delta_bic_own_lag": seen["delta_bic"] + 11.0}, "proven only for what acts as power does"),
    ):
        model = json.loads((folder / "data" / "model.json").read_text())
        (folder / "data" / "model.json").write_text(json.dumps(model | {"disturbance": changed, "residuals": None}))
        status, out, err = run("feed-forward", folder)
        assert (status, out) == (2, "")
        assert match in err


def test_a_folder_without_a_design_is_told_in_one_line(run, tmp_path):
    status, _, err = run("feed-forward", tmp_path)
    assert status == 2
    assert err.count("\n") == 1
    assert "model.json" in err
