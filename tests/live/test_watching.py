"""The watch: a loop in order is told nothing of; a fault that the virtual PLC has on its timetable is told as what it is."""

import json
from contextlib import nullcontext
from dataclasses import replace

import pytest
from tests.live.test_client import way

from heatertune import virtual_plc
from heatertune.cli import main
from heatertune.live.change.proven import read_proven
from heatertune.live.looking import Look
from heatertune.live.watching import Beside
from heatertune.model.intervals import Interval

FAST = {"step": False, "rate": 1500.0, "intervals": 4000}


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Words with their proof, as a user exports them."""
    where = tmp_path_factory.mktemp("watched")
    heater = ("--gain", "0.9", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")
    assert main(["tune", *heater, "-o", str(where / "pid.json"), "--quiet"]) == 0
    assert main(["export-db", str(where / "pid.json"), "--target", "s5-ob251", "--setpoint", "50", "-o", str(where), "--quiet"]) == 0
    return where


def watched(folder, tmp_path, capsys, *faults):
    with virtual_plc(folder, faults=list(faults), **FAST) as plc:
        status = main(["watch", way(plc, "s7").text, "--design", str(folder), "--for", "9000", "-o", str(tmp_path / "log.csv"),
                       "--quiet", "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_a_loop_in_order_is_well_through_its_whole_heat_up(folder, tmp_path, capsys):
    status, seen = watched(folder, tmp_path, capsys)
    assert (status, seen["well"], seen["told"], seen["outside_s"]) == (0, True, [], [])
    assert seen["rest_pct"] == pytest.approx([31.1, 31.1], abs=1.0)


@pytest.mark.parametrize(("fault", "told"), [
    ("t=6000 half-power", "outside of the proven band"), ("t=6000 word K=24000", "swings by ±"), ("t=6000 ambient=-15", "% at rest, at first 31"),
    ("t=6000 sensor-half", "outside of the proven band"), ("t=6000 stuck-on", "outside of the proven band")])
def test_what_goes_wrong_is_told(folder, tmp_path, capsys, fault, told):
    status, seen = watched(folder, tmp_path, capsys, fault)
    assert (status, seen["well"]) == (1, False)
    assert any(told in line for line in seen["told"]), seen
    assert all(begin >= 5990.0 for begin, _ in seen["outside_s"]), seen


def test_the_limit_cycle_of_the_pwm_is_no_swing(folder):
    """A ripple within the PWM's own period is not one of the loop: the mean of each period is looked at."""
    proven = read_proven(folder)
    beside, period = Beside(proven), proven.view.actuator.pwm_period_s
    within = proven.view.criteria["limit_cycle"].limit
    for k in range(4000):
        ripple = 3.0 * within * (1.0 if k % 4 < 2 else -1.0)
        beside.see(Look(k * period / 4.0, {"temperature": 50.0 + ripple, "power": 31.0, "setpoint": 50.0}))
    assert beside.seen.swing is None
    slow = Beside(proven)
    for k in range(1000):
        swing = 3.0 * within * (1.0 if k % 40 < 20 else -1.0)
        slow.see(Look(k * period, {"temperature": 50.0 + swing, "power": 31.0, "setpoint": 50.0}))
    assert slow.seen.swing == pytest.approx((3.0 * within, 40.0 * period), rel=0.05)


def test_a_refit_says_which_parameter_has_moved(folder, tmp_path, capsys, monkeypatch):
    """The fit itself is tested where it is; here a heater that has lost gain, known to 0.05 °C/%, stands in for it."""
    fitted = read_proven(folder).fitted
    lost = replace(fitted, model=replace(fitted.model, gain_degC_per_pct=0.5), ci95={"gain_degC_per_pct": Interval(low=0.45, high=0.55)})
    monkeypatch.setattr("heatertune.chain.fit", lambda _: lost)
    with virtual_plc(folder, **FAST) as plc:
        main(["watch", way(plc, "s7").text, "--design", str(folder), "--for", "300", "-o", str(tmp_path / "log.csv"), "--quiet", "--refit"])
    said = capsys.readouterr().out
    assert "gain_degC_per_pct: 0.5 (95 %: 0.45 … 0.55); was 0.9: MOVED" in said
    assert "time_constant_s: 167 (95 %: not known); was 167\n" in said


def test_a_folder_without_a_proof_is_told(design_folder, capsys):
    assert main(["watch", "s7://127.0.0.1:1/0/2/db30", "--design", str(design_folder)]) == 2
    assert "proof.json" in capsys.readouterr().err


def test_who_has_seen_nothing_says_so_and_is_not_well(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("heatertune.cli.watch.asked_to_end", lambda: nullcontext([1]))  # Ctrl-C before the first look
    with virtual_plc(folder, **FAST) as plc:
        status = main(["watch", way(plc, "s7").text, "--design", str(folder), "-o", str(tmp_path / "log.csv"), "--quiet"])
    assert (status, "nothing was seen" in capsys.readouterr().out) == (1, True)
