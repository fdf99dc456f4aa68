import json

import pytest

from heatertune.bench import Throughput, Times, _in_turns, _python
from heatertune.cli.reference import _speed_text
from heatertune.codec import decode


@pytest.mark.long
@pytest.mark.usefixtures("whatever_pays")
def test_bench_tells_times_that_agree_with_each_other(run):
    status, said, _ = run("bench", "--samples", 100, "--rounds", 3, "--json", "--target", "weg")
    told = json.loads(said)
    assert (status, told["schema"], told["samples"], told["rounds"]) == (0, "heatertune/bench/3", 100, 3)
    loop, rate, beside = told["loop"], told["samples_per_s"], told["yardsticks"]
    for times in (*loop.values(), *rate.values(), *beside.values(), *told["fit_ms"].values()):
        assert isinstance(times, float) or 0.0 < times["least"] <= times["median"] <= times["most"]
    # a sample is 3,000 scans of 1 s: both figures are of one run
    assert rate["single_processor"]["most"] * loop["compiled_ns_per_scan"]["least"] * 3000.0 == pytest.approx(1e9, rel=1e-9)
    # machine code is some hundred times faster than plain Python; a tenth is left for a machine that is busy
    assert loop["plain_ns_per_scan"]["least"] > 10.0 * loop["compiled_ns_per_scan"]["least"]
    assert beside["python_ns_per_scan"]["least"] > beside["lfilter_ns_per_value"]["least"]
    said = _speed_text(decode(Throughput, told, "bench"))
    assert "fit of 100,000 rows" in said
    assert f"{loop['compiled_ns_per_scan']['median']:.1f}" in said


def test_times_are_the_least_the_median_and_the_most_of_runs_in_turn():
    asked = []
    tasks = {name: lambda name=name: asked.append(name) for name in ("first", "second")}
    runs = _in_turns(tasks, 2, str)
    assert asked == ["first", "second"] * 3, "the first round counts for nothing"
    assert [len(seconds) for seconds in runs.values()] == [2, 2]
    assert Times.of([4.0, 1.0, 3.0, 9.0], 2.0) == Times(least=0.5, median=1.75, most=4.5)


def test_the_yardstick_in_plain_python_is_a_pi_on_the_heater_that_is_timed():
    # the same loop by Euler's small steps
    y, total, integral, asked = 20.0, 0.0, 0.0, []
    for _ in range(3000):
        total += abs(50.0 - y)
        integral = min(max(integral + 3.0 / 150.0 * (50.0 - y), 0.0), 100.0)
        asked.append(min(max(3.0 * (50.0 - y) + integral, 0.0), 100.0))
        power = asked[-15] if len(asked) > 14 else 0.0
        for _ in range(20):
            y += 0.05 / 166.0 * (20.0 + 0.41 * power - y)
    assert _python() == pytest.approx(total, rel=1e-3)


def test_bench_refuses_what_makes_no_sense(run):
    assert run("bench", "--samples", 99)[0] == 2
    assert run("bench", "--rounds", 0)[0] == 2
    status, _, said = run("bench", "--target", "z80")
    assert status == 2
    assert "z80" in said
