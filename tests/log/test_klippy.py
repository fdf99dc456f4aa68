"""What a printer writes of its heaters: klippy.log, heattest.txt and heattest.csv, as klippy's own format strings make them."""

import re

import numpy as np
import pytest

from heatertune import fit, read_log
from heatertune.errors import LogError
from heatertune.model.model_values import Fopdt

HEATER = Fopdt(gain_degC_per_pct=4.0, time_constant_s=150.0, dead_time_s=1.5, ambient_degC=24.0)
POWERS = ((0.0, 0.0), (40.0, 60.0), (300.0, 30.0), (640.0, 45.0))
BOOT = "Starting Klippy...\n===== Config file =====\n[extruder]\ncontrol = pid\npid_kp = 22.2\n=======================\n"


def _record(step_s, end_s):
    """Return times, temperatures and powers of a hot end: each lag answered exactly between the switchings."""
    times = np.arange(0.0, end_s, step_s)
    temperature = np.full(len(times), 24.0)
    for (begin, power), before in zip(POWERS[1:], (power for _, power in POWERS), strict=False):
        since = np.maximum(times - begin - HEATER.dead_time_s, 0.0)
        temperature += HEATER.gain_degC_per_pct * (power - before) * -np.expm1(-since / HEATER.time_constant_s)
    return times, temperature, np.array([next(p for begin, p in reversed(POWERS) if t >= begin) for t in times])


def _stats(order=("heater_bed", "extruder")):
    """Return a klippy.log: statistics.py, mcu.py and Heater.stats write its lines."""
    bed = np.random.default_rng(1).normal(22.0, 0.1, 2000)
    lines = []
    for k, (time, temperature, power) in enumerate(zip(*_record(1.0, 1000.0), strict=True)):
        heaters = {"extruder": f"extruder: target={210 if power else 0:.0f} temp={temperature:.1f} pwm={power / 100.0:.3f}",
                   "heater_bed": f"heater_bed: target=0 temp={bed[k]:.1f} pwm=0.000"}
        first, *rest = (heaters[name] for name in order)
        lines.append(f"Stats {944.7 + time:.1f}: gcodein=0  mcu: mcu_awake=0.004 freq=16000378 adj=15999900 {first} raspberry_pi: temp=45.2 "
                     f"sysload=0.17 print_time={time:.3f} buffer_time=0.000 {' '.join(rest)}")
    lines.insert(500, "Timeout with MCU 'mcu' (eventtime=1444.2)")
    return BOOT + "\n".join(lines) + "\n"


def test_the_extruder_of_a_klippy_log_is_read_and_fitted(tmp_path):
    path = tmp_path / "klippy.log"
    path.write_text(_stats())
    log = read_log(path)
    times, temperature, power = _record(1.0, 1000.0)
    assert np.allclose(log.time_s, 944.7 + times, atol=1e-6)
    assert np.max(np.abs(log.temperature_degC - temperature)) <= 0.051
    assert np.array_equal(log.power_pct, power)
    assert set(log.setpoint_degC) == {0.0, 210.0}
    said = " ".join(log.repairs)
    assert "1000 lines Stats of 'extruder' read, 7 others passed over" in said
    assert "heater_bed (--tag)" in said
    found = fit(log).model
    assert found.gain_degC_per_pct == pytest.approx(4.0, rel=0.02)
    assert found.dead_time_s == pytest.approx(1.5, abs=0.3)


@pytest.mark.parametrize("order", [("heater_bed", "extruder"), ("extruder", "heater_bed")])
def test_another_heater_is_read_by_its_name(tmp_path, order):
    path = tmp_path / "klippy.log"
    path.write_text(_stats(order))
    log = read_log(path, tag="heater_bed")
    assert np.max(log.temperature_degC) < 23.0
    assert not np.any(log.power_pct)
    with pytest.raises(LogError, match=f"no such heater .bed.; expected --tag and one of {order[0]}, {order[1]}"):
        read_log(path, tag="bed")


def test_of_several_heated_ones_none_of_which_is_the_extruder_one_has_to_be_named(tmp_path):
    path, bed = tmp_path / "klippy.log", iter(np.linspace(20.0, 60.0, 1000))
    path.write_text(_stats().replace("extruder:", "chamber:"))
    log = read_log(path)  # the bed was never heated: there is no question
    assert np.max(log.temperature_degC) > 150.0
    assert "'chamber' read, the only heater that was heated" in " ".join(log.repairs)
    both = re.sub(r"heater_bed: target=0 temp=\S+ pwm=\S+", lambda _: f"heater_bed: target=60 temp={next(bed):.1f} pwm=0.500", _stats())
    path.write_text(both.replace("extruder:", "chamber:"))
    with pytest.raises(LogError, match="several heaters 'heater_bed, chamber'; expected --tag and one of heater_bed, chamber"):
        read_log(path)
    assert np.max(read_log(path, tag="chamber").temperature_degC) > 150.0


def test_a_klippy_log_of_one_heater_needs_no_name(tmp_path):
    path = tmp_path / "klippy.log"
    path.write_text(_stats().replace("heater_bed: target=0", "board:").replace("extruder:", "chamber:"))
    assert np.max(read_log(path).temperature_degC) > 150.0


def test_heattest_of_klipper_is_read_with_each_power_from_its_instant_on(tmp_path):
    times, temperature, power = _record(0.3, 700.0)
    changes = [f"pwm: {begin + 100.0:.3f} {level / 100.0:.3f}" for begin, level in POWERS[1:]]
    path = tmp_path / "heattest.txt"
    path.write_text("\n".join([*changes, *(f"{100.0 + t:.3f} {x:.3f}" for t, x in zip(times, temperature, strict=True))]))
    log = read_log(path)
    assert len(log.time_s) == len(times)
    assert np.allclose(log.temperature_degC, temperature, atol=6e-4)
    assert np.array_equal(log.power_pct, power)
    assert "3 changes of the power" in " ".join(log.repairs)


def test_heattest_of_kalico_is_read_without_its_second_table(tmp_path):
    times, temperature, power = _record(0.3, 700.0)
    rows = [f"{100.0 + t:.5f}, {x:.5f}, {p / 100.0:.5f}, 210.00000" for t, x, p in zip(times, temperature, power, strict=True)]
    path = tmp_path / "heattest.csv"
    path.write_text("\n".join(["time, temp, pwm, target", *rows, "sample, low time, low, high time, high, max power",
                               "0, 140.1, 207.2, 150.3, 213.4, 1.0", "1, 160.1, 207.2, 170.3, 213.4, 0.8"]))
    log = read_log(path)
    assert len(log.time_s) == len(times)
    assert np.allclose(log.power_pct, power)
    assert "3 lines of its peaks passed over" in " ".join(log.repairs)


@pytest.mark.parametrize(("damage", "named"), [
    (("\n120.100 ", "\n12O.100 "), "PID_CALIBRATE does not write"), (("pwm: 140.000", "pwm: 940.000"), "do not rise"),
])
def test_a_damaged_heattest_is_refused(tmp_path, damage, named):
    times, temperature, _ = _record(0.3, 700.0)
    changes = [f"pwm: {begin + 100.0:.3f} {level / 100.0:.3f}" for begin, level in POWERS[1:]]
    text = "\n".join([*changes, *(f"{100.0 + t:.3f} {x:.3f}" for t, x in zip(times, temperature, strict=True))])
    assert damage[0] in text
    path = tmp_path / "heattest.txt"
    path.write_text(text.replace(*damage))
    with pytest.raises(LogError, match=named):
        read_log(path)


def test_a_kalico_row_that_is_cut_costs_this_row(tmp_path):
    path = tmp_path / "heattest.csv"
    path.write_text("time, temp, pwm, target\n" + "".join(f"{k}.0, {20 + k}.0, 1.0, 210.0\n" for k in range(30)) + "30.0, 50.0\n")
    log = read_log(path)
    assert (len(log.time_s), log.taken.left_out) == (30, 1)
    assert "(line 32)" in " ".join(log.repairs)


def _started(begin_s, heaters, seconds):
    """Return a session of klippy.log; heaters: name → function of the second → target, temperature and power."""
    lines = ["Starting Klippy...", "===== Config file =====", "[extruder]", "=======================", f"Loaded MCU 'mcu' at {begin_s:.1f}"]
    for k in range(seconds):
        parts = [f"{name}: target={target:.0f} temp={temp:.1f} pwm={pwm:.3f}" for name, (target, temp, pwm) in ((n, f(k)) for n, f in heaters.items())]
        lines.append(f"Stats {begin_s + k:.1f}: gcodein=0  mcu: mcu_awake=0.004 {' '.join(parts)} sysload=0.17 cputime=8.1")
    return lines


def _idle(_):
    return 0, 21.0, 0.0


def _ramp(k):
    return 60, min(21.0 + 0.1 * max(k - 30, 0), 60.0), 0.5 if k >= 30 else 0.0


@pytest.mark.parametrize("begins", [(300.0, 1200.0, 9000.0), (9000.0, 40.0, 30.0)])  # restarts of the host, and of the computer
def test_of_several_sessions_the_one_in_which_the_heater_moved_is_read(tmp_path, begins):
    first = _started(begins[0], {"extruder": _idle, "heater_bed": _idle}, 700)  # the longest
    second = _started(begins[1], {"extruder": _idle, "heater_bed": _ramp}, 500)
    third = _started(begins[2], {"extruder": _idle, "heater_bed": _idle}, 200)
    path = tmp_path / "klippy.log"
    path.write_text("\n".join([*first, *second, *third]) + "\n")
    log = read_log(path)
    assert (log.time_s[0], len(log.time_s)) == (begins[1], 500)
    assert log.temperature_degC.max() == 60.0
    said = " ".join(log.repairs)
    assert "'heater_bed' read, the only heater that was heated" in said
    assert "run 2 was read, in which the heater moved most: --run reads another" in said
    again = read_log(path, **log.taken.reading)
    assert again.time_s.tolist() == log.time_s.tolist()


def test_a_table_that_speaks_of_stats_is_a_table(tmp_path):
    path = tmp_path / "log.csv"
    rows = "".join(f"{k},{20 + k / 10},{0 if k < 5 else 50}\n" for k in range(40))
    path.write_text("# Stats 1.0: extruder: target=0 temp=20.0 pwm=0.000\ntime_s,temperature_degC,power_pct\n" + rows)
    assert len(read_log(path).time_s) == 40


def test_a_chamber_without_a_power_of_its_own_does_not_get_the_hot_ends(tmp_path):
    """Marlin prints C: of a chamber that has a sensor alone, and C@: only of one that is heated (temperature.cpp)."""
    file = tmp_path / "serial.log"
    file.write_text("".join(
        f"Recv: ok T:{20 + 0.5 * k:.2f} /200.00 B:{50 + 0.1 * k:.2f} /60.00 C:{20 + 0.1 * k:.2f} /0.00 @:{k % 128} B@:{k % 60}\n" for k in range(120)))
    with pytest.raises(LogError, match="no such heater 'C'; expected --tag and one of T"):
        read_log(file, tag="C", sample_time_s=1.0)
    assert read_log(file, tag="B", sample_time_s=1.0).power_pct == pytest.approx([100.0 * (k % 60) / 127.0 for k in range(120)])
    assert read_log(file, tag="T", sample_time_s=1.0).power_pct == pytest.approx([100.0 * (k % 128) / 127.0 for k in range(120)])
