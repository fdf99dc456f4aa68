"""Klipper's PID against Kalico's own, run from its package: 0 differing bits; and sums worked out by hand."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.klipper.controller import COLD, KlipperAssumptions, loop_of, step

ROOM = controller_for("klipper")
KALICO = KlipperAssumptions(source=1)
DRIVER = Path(__file__).with_name("klipper_driver.py")
USUAL = {"pid_Kp": 22.2, "pid_Ki": 1.08, "pid_Kd": 114.0, "max_power": 1.0, "smooth_time": 1.0}


def _case(rng, reports):
    """Return words, targets, readings and starts: a loop at work, jumps, random walks, the heater off and on again, restarts."""
    size = 10.0 ** rng.uniform(-2.0, 2.5, 3) * (rng.random(3) > 0.15)
    gains = np.round([*size * [1.0, 0.1, 5.0], rng.choice([1.0, rng.uniform(0.05, 1.0)]), 10.0 ** rng.uniform(-1.0, 1.0)], 3)
    held = rng.choice([0.0, 0.0, 60.0, 200.0, 210.0, 245.3, -5.0], reports // 50 + 1).repeat(50)[:reports]
    near = held + np.cumsum(rng.normal(0.0, 0.3, reports)) * (rng.random() < 0.5)
    readings = np.where(rng.random(reports) < 0.01, rng.uniform(1.0, 400.0, reports), near + rng.normal(0.0, 2.0, reports))
    readings = np.maximum(np.round(readings, rng.choice([1, 12])), 0.1)  # the driver's first report needs a reading above 0
    starts = rng.random(reports) < 0.002
    starts[0] = True
    return gains, held, readings, starts


def _ours(gains, targets, readings, starts, assume=KALICO):
    loop = loop_of(dict(zip(USUAL, gains.tolist(), strict=True)), assume)
    out, state, sent = np.empty((len(targets), 4)), COLD, 0
    for k, (target, reading, start) in enumerate(zip(targets.tolist(), readings.tolist(), starts.tolist(), strict=True)):
        if start:
            state, sent = step(loop, COLD, 0.0, reading, False)[0], 0
        state, _, _, flags = step(loop, state, target, reading, False)
        sent += not flags & 4
        out[k] = state.duty, state.slope, state.integral, sent
    return out


def _theirs(folder, tmp_path, cases, *, clock=False):
    given, made = tmp_path / "given.npz", tmp_path / "made.npz"
    arrays = {"clock": np.array(clock)}
    for k, (gains, *columns) in enumerate(cases):
        arrays |= {str(k): gains} | {f"{k}_{name}": column for name, column in
                                     zip(("target", "temperature", "start"), columns, strict=True)}
    np.savez(given, **arrays)
    ran = subprocess.run([sys.executable, "-B", DRIVER, folder, given, made], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    read = np.load(made)
    return [read[str(k)] for k in range(len(cases))]


def _bits(folder, tmp_path, cases, reports):
    rng = np.random.default_rng(20260807)
    drawn = [_case(rng, reports) for _ in range(cases)]
    for case, theirs in zip(drawn, _theirs(folder, tmp_path, drawn), strict=True):
        ours = _ours(*case)
        assert np.array_equal(ours.view(np.uint64), theirs.view(np.uint64))
    return drawn


def test_no_bit_differs_from_kalico(witness, tmp_path):
    drawn = _bits(witness("kalico"), tmp_path, 25, 400)
    # the scans are worth something: duties of all kinds, and changes that are not sent
    duties = np.concatenate([_ours(*case)[:, 0] for case in drawn])
    assert np.mean((duties > 0.0) & (duties < 0.99)) > 0.05
    assert np.mean(duties == 0.0) < 0.9


@pytest.mark.long(seconds=10)
def test_no_bit_of_200_000_reports_differs_from_kalico(witness, tmp_path):  # run for a million before: 0 differ
    _bits(witness("kalico"), tmp_path, 100, 2000)


def test_on_a_clock_that_goes_on_the_rounding_of_its_instants_is_all(witness, tmp_path):
    rng = np.random.default_rng(7)
    gains = np.array(list(USUAL.values()))
    targets = np.full(3000, 210.0)
    readings = np.round(210.0 + 3.0 * np.sin(np.arange(3000) / 40.0) + rng.normal(0.0, 0.1, 3000), 2)
    case = (gains, targets, readings, np.arange(3000) == 0)
    [theirs], ours = _theirs(witness("kalico"), tmp_path, [case], clock=True), _ours(*case)
    assert np.array_equal(ours[:, 3], theirs[:, 3])
    assert np.max(np.abs(ours[:, :3] - theirs[:, :3])) < 1e-9


def _words(**changed):
    return Words(target="klipper", values=USUAL | changed, scaling=Scaling(high_degC=300.0), sample_time_s=0.3)


def _run(words, targets, readings, **switches):
    running, scans = ROOM.start(words, switches), []
    for target, reading in zip(targets, readings, strict=True):
        running, scan = ROOM.step(running, target, reading)
        scans.append(scan)
    return scans


def test_a_first_report_by_hand():
    """One degree too cold: Kp/255·1 + Ki/255·0.3; two reports later it has grown by 2·0.3·Ki/255 and is not sent again."""
    scans = _run(_words(pid_Kd=0.0), [200.0] * 3, [199.0] * 3)
    assert scans[0].power_pct == pytest.approx(100.0 * (22.2 + 0.3 * 1.08) / 255.0, rel=1e-12)
    assert [scan.power_pct for scan in scans[1:]] == [scans[0].power_pct] * 2
    assert [scan.flags["not sent"] for scan in scans] == [False, True, True]


def test_the_slope_is_smoothed_over_a_second():
    """1 °C more in one report: Kd/255·1/1 s at once, then 0.7 of it with each report, as one lag leaves it."""
    words = _words(pid_Kp=25.5, pid_Ki=0.0, pid_Kd=25.5)
    readings = [100.0, 101.0, 101.0, 101.0]
    running, wanted = ROOM.start(words, {}), []
    for reading in readings:
        running, _ = ROOM.step(running, 105.0, reading)
        wanted.append(running.state.slope)
    assert wanted == pytest.approx([0.0, 1.0, 0.7, 0.49])


@pytest.mark.parametrize(("firmware", "reports"), [("klipper", 8), ("kalico", 8), ("older", 14)])
def test_a_command_is_refreshed(firmware, reports):
    scans = _run(_words(pid_Ki=0.0, pid_Kd=0.0), [200.0] * 30, [195.0 + 0.001 * k for k in range(30)], firmware=firmware)
    assert [k for k, scan in enumerate(scans) if not scan.flags["not sent"]] == list(range(0, 30, reports))


@pytest.mark.parametrize(("firmware", "sent"), [("klipper", True), ("kalico", False), ("older", False)])
def test_the_dead_band_is_of_the_largest_power_or_of_full(firmware, sent):
    """A change of 3 % with max_power 0.5: more than 5 % of 50 %, less than 5 % of 100 %."""
    words = _words(pid_Kp=25.5, pid_Ki=0.0, pid_Kd=0.0, max_power=0.5)
    scans = _run(words, [200.0, 200.0], [197.0, 196.7], firmware=firmware)
    assert scans[1].power_pct == pytest.approx(33.0 if sent else 30.0)


def test_from_off_nothing_below_five_percent_is_sent():
    words = _words(pid_Kp=25.5, pid_Ki=0.0, pid_Kd=0.0)
    assert [scan.power_pct for scan in _run(words, [200.0] * 40, [199.51] * 40)] == [0.0] * 40
    assert _run(words, [200.0], [199.49])[0].power_pct == pytest.approx(5.1)


def test_a_target_of_nothing_is_off_whatever_the_integral_holds():
    scans = _run(_words(), [200.0] * 20 + [0.0] * 3, [190.0] * 23)
    assert scans[19].power_pct > 0.0
    assert [scan.power_pct for scan in scans[20:]] == [0.0] * 3
