"""The four controllers in the parallel form against programs that are not ours: simple-pid as its package brings it, ESPHome's
pid_controller.cpp compiled from its package, Marlin and PID_v1 as tests/witness writes them from the sources: 0 differing bits."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.witness.arduino_pid import ArduinoPid
from tests.witness.marlin import MarlinPid

from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.single_precision import single

HERE = Path(__file__).parent
#: the buffer and the clock that ESPHome's file includes, for a computer
HAL = "#pragma once\n#include <cstdint>\nnamespace esphome { uint32_t millis(); }\n"
HELPERS = """#pragma once
#include <cstddef>
#include <deque>
namespace esphome {
template<typename T> class FixedRingBuffer {
 public:
  void init(size_t most) { most_ = most; }
  void push(T value) { if (held_.size() < most_) held_.push_back(value); }
  void pop() { held_.pop_front(); }
  void clear() { held_.clear(); }
  size_t size() const { return held_.size(); }
  auto begin() { return held_.begin(); }
  auto end() { return held_.end(); }
 private:
  size_t most_ = 0;
  std::deque<T> held_;
};
}
"""


def _walk(rng, scans, spread):
    """Return setpoints that are held for a while and readings that wander about them, jump, and stand still."""
    setpoints = rng.choice([0.0, 60.0, 200.0, 210.0, 245.0], scans // 40 + 1).repeat(40)[:scans]
    near = setpoints + np.cumsum(rng.normal(0.0, 0.3, scans)) * (rng.random() < 0.5) + rng.normal(0.0, spread, scans)
    readings = np.where(rng.random(scans) < 0.02, rng.uniform(-20.0, 400.0, scans), near)
    return setpoints, np.float32(np.round(readings, int(rng.choice([1, 2, 9])))).astype(float)


def _gains(rng):
    return (10.0 ** rng.uniform(-2.0, 2.5, 3) * [1.0, 0.1, 5.0] * (rng.random(3) > 0.15)).tolist()


def _outputs(target, values, rows, switches=None):
    which = controller_for(target)
    words = Words(target=target, values=values, scaling=Scaling(), sample_time_s=which.interval_s(values))
    which.check(words)
    running, out = which.start(words, switches or {}), []
    for row in rows:
        running, scan = which.scan(running, row)
        out.append(scan.output)
    return out


def _same(ours, theirs):
    one, other = (np.array(each, float).view(np.uint64) for each in (ours, theirs))
    differ = np.flatnonzero(one != other)
    assert differ.size == 0, (differ[:3], [ours[k] for k in differ[:3]], [theirs[k] for k in differ[:3]])


def _worth(outputs, most):
    """Refuse runs that were at a limit all the time."""
    found = np.array(outputs)
    assert np.mean((found > 0.0) & (found < most)) > 0.1


def _simple(folder, tmp_path, cases, scans):
    rng, drawn, arrays = np.random.default_rng(1), [], {}
    for k in range(cases):
        words = [*_gains(rng), rng.choice([100.0, 40.0]), int(rng.random() < 0.3), int(rng.random() < 0.7)]
        calls = np.column_stack([*_walk(rng, scans, 2.0), rng.random(scans) > 0.05, np.float32(rng.uniform(-20.0, 120.0, scans)),
                                 np.float32(rng.choice([0.5, 1.0, 0.1], scans) * rng.choice([1.0, rng.uniform(0.5, 2.0)]))])
        drawn.append((words, calls))
        arrays |= {str(k): np.array(words), f"{k}_calls": calls}
    np.savez(tmp_path / "given.npz", **arrays)
    ran = subprocess.run([sys.executable, "-B", HERE / "simple_pid_driver.py", folder, tmp_path / "given.npz", tmp_path / "made.npz"],
                         capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    made, seen = np.load(tmp_path / "made.npz"), []
    for k, (words, calls) in enumerate(drawn):
        values = dict(zip(("Kp", "Ki", "Kd", "output_max", "proportional_on_measurement", "differential_on_measurement"), words,
                          strict=True)) | {"PERIOD_MS": 500}
        names = ("setpoint", "input_", "auto_mode", "last_output", "dt")
        ours = _outputs("simple-pid", values, [dict(zip(names, call, strict=True)) for call in calls.tolist()])
        _same(ours, made[str(k)].tolist())
        seen += ours
    _worth(seen, 100.0)


def test_no_bit_differs_from_simple_pid(witness, tmp_path):
    _simple(witness("simple-pid"), tmp_path, 20, 400)


@pytest.mark.long(seconds=10)
def test_no_bit_of_200_000_calls_differs_from_simple_pid(witness, tmp_path):  # run for a million before: 0 differ
    _simple(witness("simple-pid"), tmp_path, 100, 2000)


def _compiled(folder, tmp_path):
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("g++ is not installed")
    core = tmp_path / "esphome" / "core"
    core.mkdir(parents=True)
    (core / "hal.h").write_text(HAL)
    (core / "helpers.h").write_text(HELPERS)
    program = tmp_path / "driver"
    source = Path(folder) / "esphome" / "components" / "pid" / "pid_controller.cpp"
    ran = subprocess.run([compiler, "-std=gnu++20", "-O1", "-ffp-contract=off", "-I", tmp_path, "-I", folder, "-o", program,
                          HERE / "esphome_driver.cpp", source], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return program


def _esphome(folder, tmp_path, cases, scans):
    rng, drawn, stream = np.random.default_rng(2), [], []
    for _ in range(cases):
        gains = [single(gain / 100.0) for gain in _gains(rng)]
        words = [*gains, float(rng.choice([0.0, -1.0, -0.25])), float(rng.choice([1.0, 0.5])), int(rng.integers(1, 9))]
        rows = np.column_stack([*_walk(rng, scans, 2.0), rng.choice([1000, 1016, 0, 60000, int(rng.integers(1, 3000))], scans)])
        drawn.append((words, rows))
        stream += [np.float32([*words, scans]), np.float32(rows).ravel()]
    ran = subprocess.run([_compiled(folder, tmp_path)], input=np.concatenate(stream).tobytes(), capture_output=True, check=True)
    made, seen = np.frombuffer(ran.stdout, np.float32).astype(float).reshape(cases, scans), []
    for (words, rows), theirs in zip(drawn, made, strict=True):
        values = dict(zip(("kp", "ki", "kd", "min_integral", "max_integral", "derivative_averaging_samples"), words, strict=True))
        names = ("target_temperature", "current_temperature", "elapsed_ms")
        ours = _outputs("esphome", values | {"update_interval": 1000}, [dict(zip(names, row, strict=True)) for row in rows.tolist()])
        _same(ours, np.clip(theirs, 0.0, 1.0) + 0.0)  # the climate's limits; its level has no -0
        seen += ours
    _worth(seen, 1.0)


def test_no_bit_differs_from_esphome(witness, tmp_path):
    _esphome(witness("esphome"), tmp_path, 20, 400)


@pytest.mark.long(seconds=10)
def test_no_bit_of_200_000_readings_differs_from_esphome(witness, tmp_path):  # run for a million before: 0 differ
    _esphome(witness("esphome"), tmp_path, 100, 2000)


def _marlin(cases, scans):
    rng, seen = np.random.default_rng(3), []
    for _ in range(cases):
        gains = [single(gain) for gain in _gains(rng)]
        loops, high, window = int(rng.integers(10, 17)), int(rng.choice([255, 200, 1])), int(rng.choice([10, 20, 255]))
        weight, timer, history = single(rng.choice([0.95, 0.0, rng.uniform(0.0, 0.99)])), rng.choice(["1000hz", "977hz"]), rng.choice(["all", "inside"])
        values = dict(zip(("Kp", "Ki", "Kd"), gains, strict=True)) | {
            "PID_MAX": high, "PID_FUNCTIONAL_RANGE": window, "PID_K1": weight, "ADC_LOOPS": loops}
        pid = MarlinPid(*gains, timer_hz=1000.0 if timer == "1000hz" else 976.5625, states=loops, window=window, K1=weight,
                        inside=history == "inside", max_pow=high)
        setpoints, readings = _walk(rng, scans, 2.0)
        rows = [{"target": w, "celsius": x} for w, x in zip(setpoints.tolist(), readings.tolist(), strict=True)]
        ours = _outputs("marlin", values, rows, {"timer": str(timer), "history": str(history)})
        with np.errstate(all="ignore"):
            _same(ours, [pid.amount(row["target"], row["celsius"]) for row in rows])
        seen += ours
    _worth(seen, 127.0)


def test_no_step_differs_from_marlin():
    _marlin(20, 400)


@pytest.mark.long(seconds=15)
def test_no_step_of_200_000_updates_differs_from_marlin():  # run for a million before: 0 differ
    _marlin(100, 2000)


def _arduino(cases, scans):
    rng, seen = np.random.default_rng(4), []
    for _ in range(cases):
        gains, sample, on = _gains(rng), int(rng.choice([100, 1000, 250, 17])), int(rng.random() < 0.7)
        high = float(rng.choice([255.0, 100.0, 5000.0]))
        number = rng.choice(["64bit", "32bit"])
        pid = ArduinoPid(*gains, on_measurement=on == 0, number=np.float64 if number == "64bit" else np.float32, now_ms=5000)
        pid.set_output_limits(0, high)
        pid.set_sample_time(sample)
        now, theirs, rows = 5000, [], []
        for (w, x), auto, by_hand, elapsed in zip(
                zip(*(each.tolist() for each in _walk(rng, scans, 2.0)), strict=True), (rng.random(scans) > 0.05).tolist(),
                np.float32(rng.uniform(-10.0, 300.0, scans)).astype(float).tolist(), rng.integers(1, 2 * sample, scans).tolist(), strict=True):
            rows.append({"Setpoint": w, "Input": x, "Mode": int(auto), "Output": by_hand, "Elapsed": elapsed})
            now += elapsed
            pid.input, pid.setpoint = pid.number(x), pid.number(w)
            pid.set_mode(auto)
            if not auto:
                pid.output = pid.number(by_hand)
            pid.compute(now)
            theirs.append(float(pid.output))
        values = dict(zip(("Kp", "Ki", "Kd"), gains, strict=True)) | {"POn": on, "OutMax": high, "Full": high, "SampleTime": sample}
        _same(_outputs("arduino-pid", values, rows, {"double": str(number)}), theirs)
        seen += theirs
    _worth(seen, 100.0)


def test_no_bit_differs_from_pid_v1():
    _arduino(20, 400)


@pytest.mark.long(seconds=15)
def test_no_bit_of_200_000_passes_differs_from_pid_v1():  # run for a million before: 0 differ
    _arduino(100, 2000)
