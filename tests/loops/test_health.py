"""Few of the loops of `tests.bench.health`; all of them with their shares: python -m tests.bench.health."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from tests.bench.loops import drawn, traced

from heatertune.batch.loop_health import rank_rows
from heatertune.cli import main
from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import Log
from heatertune.loops.diagnosis import cure_words, day, diagnose, ideal, times_worse
from heatertune.loops.measures import (
    Cause,
    LoopEntry,
    at_limit,
    average_log,
    course_of,
    list_loops,
    offset_degC,
    read_list,
    swings,
    switching_period_s,
    switchings_per_h,
)
from heatertune.loops.unlogged_loads import with_duty, without_loads
from heatertune.model.fit import fit
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.model.statistics import Interval
from heatertune.pid.tune import quick_tune
from heatertune.plc import Scaling
from heatertune.proof.design_request import DesignRequest
from heatertune.report.health_page import loops_lines, loops_page

LOOPS = drawn(60, seed=3)
ARDUINO = DesignRequest(target="arduino-pid", scaling=Scaling(low_degC=0.0, high_degC=500.0))


def of(cause, **changed):
    return replace(next(loop for loop in LOOPS if loop.cause == cause), **changed)


def log_of(loop):
    time, seen, asked, power, _ = traced(loop)
    return Log(name=loop.name, source="bench", time_s=time, temperature_degC=seen, setpoint_degC=asked, power_pct=power)


def sine(period_s, size, *, n=2000, noise=0.0):
    rng = np.random.default_rng(1)
    time = np.arange(float(n))
    return Log(name="sine", source="test", time_s=time, setpoint_degC=np.full(n, 50.0), power_pct=np.full(n, 40.0),
               temperature_degC=50.0 + size * np.sin(2 * np.pi * time / period_s) + noise * rng.standard_normal(n))


def test_a_sine_has_its_period_and_size_and_its_half_cycles_are_counted():
    course = course_of(sine(200.0, 1.0, noise=0.01), None)
    swung = swings(course, course.changes_s)
    assert swung.count == 20  # 2,000 s of half cycles of 100 s
    assert swung.even
    assert swung.period_s == pytest.approx(200.0, rel=0.05)
    assert swung.size_degC == pytest.approx(2.0, rel=0.05)


def test_a_ripple_of_the_pwm_is_none_of_the_loops_swings_once_averaged_over_the_period():
    log = sine(10.0, 1.0, noise=0.01)
    rippled, averaged = course_of(log, None), course_of(log, 10.0)
    assert swings(rippled, rippled.changes_s).count > 100
    assert swings(averaged, averaged.changes_s).count == 0


def test_a_switch_tells_its_period_and_how_often_it_switches():
    time = np.arange(0.0, 3600.0, 0.5)
    log = Log(name="switch", source="test", time_s=time, temperature_degC=50.0 + 0.1 * np.sin(time), power_pct=np.where(
        time % 7.3 < 3.0, 100.0, 0.0), setpoint_degC=np.full(len(time), 50.0))
    assert switching_period_s(log) == pytest.approx(7.3, rel=0.005)
    assert switchings_per_h(log, None) == pytest.approx(2 * 3600 / 7.3, rel=0.01)
    thin = average_log(log, 7.3)
    assert len(thin.time_s) < 1600
    assert thin.power_pct[10:-10] == pytest.approx(300.0 / 7.3, abs=8.0)  # a row of 0.5 s is 7 % of the period
    assert thin.power_pct.mean() == pytest.approx(300.0 / 7.3, abs=1.0)


@pytest.mark.long
@pytest.mark.parametrize("cause", ["good", "gain too high", "sluggish"])
def test_loads_are_found_where_and_as_large_as_they_are(cause):
    loop = of(cause, cold=False, duty=True)
    cleared, loads, *_ = without_loads(log_of(loop), loop.pwm)
    large = [load for load in loads if abs(load.power_pct) > 0.5 * loop.load]
    assert [round(load.instant_s / loop.duration, 1) for load in large] == [0.4, 0.7]
    assert [abs(load.power_pct) for load in large] == pytest.approx([loop.load] * 2, rel=0.25)
    assert np.ptp(cleared.time_s) == pytest.approx(loop.duration, rel=0.01)


@pytest.mark.long
@pytest.mark.parametrize(("interval", "ticks"), [(None, 50), (0.1, None)], ids=["fifty", "hundreds"])
def test_the_ticks_of_a_switch_are_found_where_they_are_coarse_and_the_dead_time_with_them(interval, ticks):
    """Bench's PWM counts steps of its integration, 50 in a period or 388, and logs the duty that it was asked for."""
    loop = of("sluggish", cold=False, duty=True)
    loop = loop if interval is None else replace(loop, interval=interval)
    cleared = without_loads(log_of(loop), loop.pwm)
    assert cleared.ticks == ticks
    assert [load.instant_s for load in cleared.loads] == pytest.approx(
        [0.4 * loop.duration, 0.7 * loop.duration], abs=loop.pwm)


def test_a_duty_is_found_finer_than_the_rows_of_its_switch():
    """Beside the duty itself, which the bench's PI asked for; a constant part acts as a warmer room and may stay."""
    loop = of("sluggish", cold=False, duty=False, interval=1.0)
    log, asked = log_of(loop), log_of(replace(loop, duty=True)).power_pct
    off = with_duty(log, switching_period_s(log)).power_pct - asked
    assert float(np.std(off[len(off) // 10:])) < 0.25 * 100.0 / loop.pwm  # a row of a second
    random = replace(log, temperature_degC=np.random.default_rng(1).normal(50.0, 5.0, len(asked)))
    assert with_duty(random, switching_period_s(log)) is random


def test_a_loop_that_swings_as_it_nears_its_setpoint_swings():
    """Half cycles of 100 s on the way of an exponential, which is always below the setpoint."""
    log = sine(200.0, 1.0)
    near = replace(log, temperature_degC=log.temperature_degC - 1.5 - 4.0 * np.exp(-log.time_s / 500.0))
    course = course_of(near, None)
    assert course.error_degC.min() > 0.0
    swung = swings(course, course.changes_s)
    assert swung.even
    assert swung.count >= 15
    assert swung.period_s == pytest.approx(200.0, rel=0.05)


def test_a_day_begins_with_the_mean_power_of_a_switch_that_is_on():
    log = sine(200.0, 0.1)
    switch = np.where(np.arange(2000) % 20 < 8, 100.0, 0.0)
    assert course_of(replace(log, power_pct=switch), 20.0).power_pct[0] == pytest.approx(40.0, abs=5.0)  # a row


@pytest.mark.parametrize(("rest", "share"), [(49.0, 1.0), (51.0, 0.0)])
def test_a_heater_at_full_power_that_comes_to_rest_below_its_setpoint_is_at_its_limit(rest, share):
    log = sine(200.0, 1.0)
    rising = np.minimum(rest - 30.0 * np.exp(-log.time_s / 600.0), 49.9)
    course = course_of(replace(log, temperature_degC=rising, power_pct=np.full(2000, 100.0)), None)
    assert at_limit(course, high=True) == pytest.approx(share, abs=0.1)


def test_a_heater_that_is_too_weak_is_at_its_limit_and_a_heat_up_is_not():
    weak = course_of(log_of(of("at its limits")), None)
    assert at_limit(weak, high=True) > 0.5
    assert at_limit(course_of(log_of(of("good", cold=True)), None), high=True) == 0.0


def test_an_error_that_stays_is_an_offset_only_while_the_power_rests():
    n = np.arange(1000.0)
    still = Log(name="p", source="test", time_s=n, temperature_degC=48.0 + 0.01 * (n % 2), setpoint_degC=np.full(1000, 50.0),
                power_pct=np.full(1000, 40.0))
    assert offset_degC(course_of(still, None)) == pytest.approx(2.0, abs=0.02)
    assert offset_degC(course_of(replace(still, power_pct=20.0 + 0.05 * n), None)) == 0.0


def test_the_day_lived_again_with_the_very_controller_that_ran_is_the_day_itself():
    """Bench's own plant and PI against the day lived again with the same gains: they share no line."""
    loop = of("sluggish", cold=False, duty=True, second=0.0, noise=0.0, step=0.001)
    log = log_of(loop)
    heater = Fopdt(gain_degC_per_pct=loop.gain, time_constant_s=loop.lag, dead_time_s=loop.dead, ambient_degC=loop.ambient)
    own = replace(quick_tune([heater]), gain_pct_per_degC=loop.k, integral_time_s=loop.tn, sample_time_s=loop.ta)
    course = course_of(log, loop.pwm)
    lived = day(course, heater, ideal(own), loop.ta)
    off = np.abs(lived.relived_degC - lived.measured_degC)
    assert off.max() < 0.05 * np.ptp(log.temperature_degC)
    assert times_worse(lived, course)[0] == pytest.approx(1.0, abs=0.15)


@pytest.mark.long
def test_a_day_that_never_comes_to_its_setpoint_is_as_bad_as_it_is():
    """A controller that gives no power: the mean error is the way down to the room, by the heater's own formula."""
    loop = of("good", cold=False, duty=True, second=0.0)
    heater = Fopdt(gain_degC_per_pct=loop.gain, time_constant_s=loop.lag, dead_time_s=loop.dead, ambient_degC=loop.ambient)
    course = course_of(log_of(loop), loop.pwm)
    worse, was, would = times_worse(day(course, heater, lambda *_: 0.0, loop.ta), course)
    assert worse < 0.1
    assert was < 0.1 * would
    assert would == pytest.approx(loop.setpoint - loop.ambient, rel=0.15)  # a load cools it further for a third of the day


def oscillating():
    """Return the log of a loop that oscillates, and what is known of it."""
    loop = of("gain too high", duty=True)
    return log_of(loop), LoopEntry(name=loop.name, file="loop.csv", switch=loop.switch, pwm_period_s=loop.pwm)


@pytest.mark.long
def test_a_heater_that_the_log_leaves_open_gets_no_words(monkeypatch):
    log, loop = oscillating()
    opened = Interval(low=0.2, high=None)
    monkeypatch.setattr("heatertune.loops.diagnosis.fit", lambda *args, **known: replace(
        fit(*args, **known), ci95={"gain_degC_per_pct": opened, "time_constant_s": opened}))
    told = diagnose(log, loop)
    assert told.cause is Cause.OSCILLATING
    assert told.confidence != "high"
    assert told.worse is None
    cure = cure_words(told, loop, ARDUINO)
    assert cure.words is None
    assert cure.reason == ("no heater to design for: the log leaves gain or time constant open, so the power that "
                        "holds the setpoint is unknown")


@pytest.mark.long(seconds=60)
def test_words_with_which_the_logged_day_is_worse_are_not_proven():
    """A heater like one that once passed for bench's of 0.89 °C/% and 454 s: its proof keeps every limit, the day does not.

    It was 63 °C/%; tested at 121 % of the power, the words for that one are too calm to make the day worse. 50 °C/% and 35,000 s do
    the same as a fifth of both, which rises as fast, in five times as many scans.
    """
    log, loop = oscillating()
    wrong = model_by_hand(Fopdt(gain_degC_per_pct=10.0, time_constant_s=7_000.0, dead_time_s=60.0, ambient_degC=20.0))
    cure = cure_words(replace(diagnose(log, loop), fitted_model=wrong, why_not=""), loop, ARDUINO)
    assert cure.would_degC > cure.was_degC
    assert cure.verdict != "PASS"
    assert re.search(r"the logged day lived with them is worse, mean error [\d.]+ → [\d.]+ °C", cure.reason)


@pytest.mark.long
@pytest.mark.parametrize(("cold", "known"), [(True, True), (False, False)])
def test_a_loop_that_begins_cold_tells_its_room(cold, known):
    loop = of("good", cold=cold, duty=True)
    cleared = without_loads(log_of(loop), loop.pwm)
    assert (cleared.ambient_degC is not None) is known
    if known:
        assert cleared.ambient_degC == pytest.approx(loop.ambient, abs=1.0)
        assert cleared.power_before_pct == 0.0
    else:
        assert cleared.power_before_pct == pytest.approx((loop.low - loop.ambient) / loop.gain, abs=5.0)


@pytest.mark.long
@pytest.mark.parametrize("cause", ["gain too high", "TN too short", "sluggish"])
def test_what_the_whole_log_rules_out_is_no_dead_time_of_its_heater(cause):
    """Bench's heater stands: its dead time, second lag and the wait for the next PWM period lie below the bound."""
    loop = of(cause, duty=True)
    most = without_loads(log_of(loop), loop.pwm).most_dead_time_s
    assert most is not None
    assert loop.dead + loop.second < most < 6.0 * (loop.dead + loop.second + loop.pwm)


@pytest.mark.long(seconds=30)
@pytest.mark.parametrize("loop", [loop for loop in drawn(24, seed=7) if loop.name == "loop021"])
def test_a_second_lag_is_not_taken_for_a_load(loop):
    """Once 63 °C/% and 35,000 s were found for this heater of the bench, and loads that it never had."""
    cleared, loads, *_ = without_loads(log_of(loop), loop.pwm)
    assert [round(load.instant_s / loop.duration, 1) for load in loads] == [0.4, 0.7]
    gain = fit(cleared).model.gain_degC_per_pct
    assert gain == pytest.approx(loop.gain, rel=0.25)


def test_the_ripple_of_a_pwm_is_gone_from_readings_and_power_and_nothing_else():
    """One lag under a PWM of 20 s by its own recursion, beside the same heater under the mean power."""
    time, duty = np.arange(0.0, 4000.0, 1.0), 40.0
    power = np.where(time % 20.0 < 20.0 * duty / 100.0, 100.0, 0.0)
    rows, temperature, keep = [], 20.0, np.exp(-1.0 / 150.0)
    for each in power:
        rows.append(temperature)
        temperature = 20.0 + 0.5 * each + keep * (temperature - 20.0 - 0.5 * each)
    smooth = 20.0 + 0.5 * duty * (1.0 - np.exp(-time / 150.0))
    log = Log(name="pwm", source="test", time_s=time, temperature_degC=np.array(rows), power_pct=power)
    thin = average_log(log, 20.0, 0.0)
    inside = slice(20, -20)
    assert np.ptp(np.array(rows)[3000:]) > 1.5
    assert thin.power_pct[inside] == pytest.approx(duty, abs=1e-6)
    # the pulse lies at the head of its period, so that the mean is ahead of the smooth one by its share of it
    assert thin.temperature_degC[inside] == pytest.approx(
        np.interp(thin.time_s[inside] + 0.5 * 20.0 * (1.0 - duty / 100.0), time, smooth), abs=0.35)


def test_a_list_says_what_is_wrong_with_it(tmp_path):
    path = tmp_path / "list.csv"
    for text, said in (
        ("file,swich\na.csv,ssr\n", "unknown field 'swich'"), ("name\nx\n", "line 2: no file"),
        ("file,pwm_period_s\na.csv,ten\n", "line 2, field pwm_period_s: no number: 'ten'"),
        ("file,pwm_period_s\na.csv,-1\n", "line 2: pwm_period_s"), ("file,switch\na.csv,valve\n", "line 2: "),
        ("file\na.csv\na.csv\n", "line 3: the log 'a.csv' is listed twice"), ("file,name\na.csv\n", "line 2: 1 cells; expected 2"),
        ("file,target\na.csv,s7-333\n", "line 2: "), ("file,low_degC\na.csv,5\n", "line 2: high_degC"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=said.replace("(", r"\(")):
            read_list(path)
    path.write_text("file;switch\na.csv;ssr\n")
    with pytest.raises(InputError, match="which is no log of the folder"):
        list_loops(["b.csv"], read_list(path))
    toml = tmp_path / "list.toml"
    toml.write_text("[[loop]]\nfile = 'a.csv'\npwm_period_s = 10\n")
    assert list_loops(["a.csv", "b.csv"], read_list(toml))[0].pwm_period_s == 10.0


def row(name, outcome, excess, **more):
    names = ("reason", "also", "doubt", "times_worse", "words", "verdict", "why", "course")
    return dict.fromkeys(names) | {"name": name, "file": f"{name}.csv", "outcome": outcome, "excess": excess,
                                   "confidence": "high", "what_to_do": "…", "was": None, "change": None} | more


def test_the_worst_stands_first_and_names_are_escaped_on_the_page_and_the_terminal_has_thirty_lines():
    rows = rank_rows([row(f"loop{k}", "sluggish", 1.0 + k, reason="slow " * 40) for k in range(40)] + [row("<b>", "well", 0.5)])
    assert rows[0]["name"] == "loop39"
    assert rows[-1]["name"] == "<b>"
    document = {"loops": rows, "left_out": [{"name": f"x{k}", "file": f"x{k}.csv", "outcome": "no log", "reason": "torn"}
                                            for k in range(9)],
                "gone": [], "compared": False, "page": "health.html", "table": "health.parquet"}
    page = loops_page(document)
    assert "<b>" not in page.partition("<tbody>")[2].partition("</tbody>")[0]
    assert "http" not in page
    lines = loops_lines(document).splitlines()
    assert len(lines) <= 30
    assert max(map(len, lines)) <= 80
    assert lines[-1] == "written to health.html and health.parquet"


@pytest.mark.long(seconds=120)
def test_the_command_ranks_cures_and_compares_and_tells_the_torn_one(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "logs"
    folder.mkdir()
    for name, loop in (("well", of("good", duty=True)), ("wild", of("gain too high", duty=True)),
                       ("slow", of("sluggish", duty=True))):
        time, seen, asked, power, _ = traced(loop)
        lines = [f"{t:.2f},{y:.3f},{r},{u:.2f}" for t, y, r, u in zip(time, seen, asked, power, strict=True)]
        (folder / f"{name}.csv").write_text("\n".join(["time_s,temperature_degC,setpoint_degC,power_pct", *lines]))
    (folder / "torn.csv").write_text("time_s,temperature_degC,setpoint_degC,power_pct\n0,20,50,oops\n")
    given = ["health", "logs", "--target", "arduino-pid", "--range", "0", "500", "-o", "health.html", "--quiet", "--json",
             "--jobs", "1"]
    assert main(given) == 0
    first = json.loads(capsys.readouterr().out)
    told = {loop["name"]: loop for loop in first["loops"]}
    assert {name: loop["outcome"] for name, loop in told.items()} == {
        "well": "well", "wild": "oscillating", "slow": "sluggish"}
    assert first["loops"][-1]["name"] == "well"
    assert "torn.csv, line 2" in first["left_out"][0]["reason"]
    for name in ("wild", "slow"):
        assert told[name]["words"] is not None
        assert told[name]["would_degC"] < 0.5 * told[name]["was_degC"]
    assert main([*given, "--no-redesign", "--since", "last"]) == 0  # what is compared is the loop, not the design
    again = json.loads(capsys.readouterr().out)
    assert {loop["change"] for loop in again["loops"]} == {"same"}
    assert (tmp_path / "health.html").read_text(encoding="utf-8").count("<tr") == 4


def test_without_an_earlier_run_there_is_no_last(tmp_path, capsys):
    assert main(["health", str(tmp_path), "-o", str(tmp_path / "h.html"), "--since", "last"]) == 2
    assert "no" in capsys.readouterr().err
    assert main(["health", str(tmp_path), "-o", str(tmp_path / "h.parquet")]) == 2
    assert "expected the name of a page" in capsys.readouterr().err


@pytest.mark.long
def test_a_reading_that_stands_still_is_not_judged_and_a_coarse_one_at_rest_is():
    time = np.arange(3600.0)
    drawn_power = 40.0 + np.random.default_rng(2).standard_normal(3600)

    def cause(temperature, power):
        log = Log(name="still", source="test", time_s=time, setpoint_degC=np.full(3600, 50.0), power_pct=power,
                  temperature_degC=temperature)
        return diagnose(log, LoopEntry(name="still", file="")).faults

    for power in (np.full(3600, 40.0), drawn_power):
        with pytest.raises(OutOfRange, match="varying, not constant"):  # such a file is no log, and `health` leaves it out
            cause(np.full(3600, 50.0), power)
    for temperature, power in (
            (np.where(time < 1.0, 50.1, 50.0), np.where(time < 1800.0, 40.0, 60.0)),
            (np.where(time < 1500.0, 50.0 + 0.1 * (time % 2), 49.9), np.clip(40.0 + 0.02 * (time - 1500.0), 40.0, 100.0))):
        found = cause(temperature, power)
        assert found[0].cause is Cause.UNKNOWN
        assert found[0].message.startswith("not judged: the reading stands still at ")
    coarse = np.where(time % 900.0 < 850.0, 50.0, 50.1)  # in steps of 0.1 °C, minutes at rest
    assert not any("stands still" in each.message for each in cause(coarse, drawn_power))
