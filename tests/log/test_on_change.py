"""Logs with a row only where a value changes: what is put back, what is not, and where the power keeps its instants."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heatertune.errors import LogError
from heatertune.log import read_log
from heatertune.log.partial_rows import held_readings, on_change, spread, stale_readings


def oven(n=600):
    """Readings of an oven, one every 5 s in tenths: at rest, up by 36 °C after 60 s, and at rest again."""
    time = 5.0 * np.arange(n)
    return time, np.round(20.0 + 36.0 * np.where(time < 80.0, 0.0, 1.0 - np.exp(-(time - 80.0) / 200.0)), 1)


@pytest.mark.parametrize(("every", "late"), [(3, 0), (10, 1), (60, 7)])
def test_a_sensor_that_is_read_in_every_kth_row_leaves_the_power_its_own_rows(every, late):
    """Of rows each 5 s the sensor's are kept, and those in which the power changes; all others are no reading."""
    rows = np.arange(40 * every)
    truth = 20.0 + 0.01 * rows + 0.3 * np.sin(rows)
    begins = np.maximum((rows - late) // every * every + late, 0)
    power = np.where(rows < 5 * every + 1, 0, np.where(rows < 21 * every + 2, 60, 20))
    text = "time [s],T [°C],power [%]\n" + "".join(f"{5 * k},{truth[begins[k]]:.4f},{power[k]}\n" for k in rows)
    log = read_log("log.csv", content=text.encode())
    own = np.unique(begins)
    assert log.time_s.tolist() == (5.0 * own).tolist()
    assert log.temperature_degC == pytest.approx(truth[own], abs=1e-4)
    changes = np.flatnonzero(np.diff(power)) + 1
    assert set(5.0 * changes) <= set(log.signals["power"].time_s)
    assert log.taken.left_out == 0


def test_readings_that_stand_are_no_held_ones():
    rng = np.random.default_rng(3)
    assert not held_readings(np.round(20.0 + rng.normal(0.0, 0.05, 900), 1)).any()
    assert not held_readings(oven()[1]).any()
    assert not held_readings(np.repeat([20.0, 21.0], 400)).any()
    uneven = np.repeat(np.arange(100.0), rng.integers(9, 12, 100))
    assert not held_readings(uneven).any()


def thinned(time, readings):
    kept = np.array([True, *(np.diff(readings) != 0.0)])
    return time[kept], readings[kept]


def test_what_was_thinned_is_put_back_to_the_last_digit():
    time, readings = oven()
    few_time, few = thinned(time, readings)
    assert len(few) < 0.4 * len(readings)
    written = on_change(few_time, few)
    assert (written.interval_s, written.rounded) == (5.0, True)
    assert written.step_degC == pytest.approx(0.1)
    again = spread(few_time, few, written, np.array([]))
    n = len(again.time_s)
    assert np.array_equal(again.time_s, time[:n])
    assert np.array_equal(again.temperature, readings[:n])
    assert np.array_equal(few[again.source], readings[:n])


def test_nothing_is_put_back_where_a_reading_was_lost():
    time, readings = thinned(*oven())
    k = int(np.argmax(np.diff(time)))
    again = spread(time, readings, on_change(time, readings), np.array([time[k] + 1.0]))
    assert not np.any((again.time_s > time[k]) & (again.time_s < time[k + 1]))


def test_nothing_is_put_back_before_a_jump_that_no_reading_shows_the_heater_to_make():
    time, readings = thinned(*oven())
    gone = (time > 200.0) & (time < 320.0)  # the logger was off while it rose
    time, readings = time[~gone], readings[~gone]
    again = spread(time, readings, on_change(time, readings), np.array([]))
    assert not np.any((again.time_s > 200.0) & (again.time_s < 320.0))


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.01, 0.1, 0.5]), st.floats(0.0, 0.4), st.floats(0.05, 0.4))
def test_a_log_that_is_read_at_an_interval_and_lost_rows_is_not_taken_for_one_written_on_change(seed, step, noise, lost):
    rng = np.random.default_rng(seed)
    time = 5.0 * np.arange(400)
    truth = 20.0 + 36.0 * np.where(time < 80.0, 0.0, 1.0 - np.exp(-(time - 80.0) / 400.0))
    readings = truth + noise * rng.normal(size=400)
    readings = readings if step == 0.0 else np.round(np.round(readings / step) * step, 3)
    kept = rng.random(400) > lost
    written = on_change(time[kept], readings[kept])
    if written is not None:  # it may look like one where the sensor is coarse: what is put back is off by a step
        again = spread(time[kept], readings[kept], written, np.array([]))
        off = np.abs(again.temperature - np.interp(again.time_s, time, truth))
        assert off.max() <= 2.5 * max(step, noise, written.step_degC) + 4.5 * noise


def rows_of(text, **options):
    return read_log(io.StringIO(text), **options)


def test_a_power_in_a_row_of_its_own_keeps_its_instant_and_a_reading_that_does_not_repeat_stood():
    time, readings = thinned(*oven())
    rows = [(t, f"{y:g}", "") for t, y in zip(time, readings, strict=True)] + [(57.0, "", "60")]
    rows[0] = (0.0, "20", "0")
    text = "\n".join(["time_s,temp_C,power_pct", *(f"{t:g},{y},{u}" for t, y, u in sorted(rows))])
    log = rows_of(text)
    assert [*map(list, log.signals["power"].changes)] == [[0.0, 57.0], [0.0, 60.0]]
    assert 57.0 not in log.time_s  # no reading
    assert np.all(log.temperature_degC[log.time_s < 80.0] == 20.0)
    assert any("The power is written where it changes" in told for told in log.repairs)
    assert any("rows in which it stood were put back, 5 s apart" in told for told in log.repairs)


@pytest.mark.parametrize("at", [0, 3])
def test_a_single_power_is_held_where_it_stands_in_the_first_row(at):
    text = "\n".join(["time_s,temp_C,power_pct", *(f"{t},{20 + 0.1 * t:.1f},{60 if t == at else ''}" for t in range(60))])
    if at:
        with pytest.raises(LogError, match="power_pct: an empty cell"):
            rows_of(text)
    else:
        assert rows_of(text).power_pct.tolist() == [60.0] * 60


def test_an_empty_power_of_a_log_at_an_interval_costs_its_row():
    rows = [f"{t},{20 + 0.1 * t:.1f},{'' if t == 30 else 60}" for t in range(60)]
    log = rows_of("\n".join(["time_s,temp_C,power_pct", *rows]))
    assert (len(log.time_s), log.taken.left_out) == (59, 1)
    many = [f"{t},{20 + 0.1 * t:.1f},{'' if t % 5 == 3 else 60}" for t in range(60)]
    with pytest.raises(LogError, match="an empty cell"):
        rows_of("\n".join(["time_s,temp_C,power_pct", *many]))


def test_a_reading_that_is_lost_where_the_power_changes_does_not_move_the_power():
    rows = [f"{t},{'' if t == 30 else f'{20 + 0.1 * max(0, t - 34):.1f}'},{60 if t >= 30 else 0}" for t in range(80)]
    log = rows_of("\n".join(["time_s,temp_C,power_pct", *rows]), skip_empty=True)
    assert log.signals["power"].changes[0][1] == 30.0
    assert 30.0 not in log.time_s  # no reading


def test_a_tag_that_was_unavailable_is_not_put_back():
    time, readings = thinned(*oven())
    k = int(np.argmax(np.diff(time)[:-1]))
    rows = [*((t, "oven_temperature", f"{y:g}") for t, y in zip(time, readings, strict=True)),
            (time[k] + 2.0, "oven_temperature", "unavailable"), (0.0, "heater_power", "0"), (60.0, "heater_power", "60")]
    log = rows_of("\n".join(["tag,time_s,value", *(f"{name},{t:g},{value}" for t, name, value in sorted(rows))]))
    assert not np.any((log.time_s > time[k]) & (log.time_s < time[k + 1]))
    assert len(log.time_s) > len(time)


def test_the_counts_of_what_was_read_do_not_hold_the_rows_put_back():
    time, readings = thinned(*oven())
    text = "\n".join(["time_s,temp_C,power_pct", *(f"{t:g},{y:g},{60 if t >= 60 else 0}" for t, y in zip(time, readings, strict=True))])
    taken = rows_of(text).taken
    assert (taken.rows_read, taken.left_out) == (len(time), 0)
    assert taken.rows > len(time)


def hung(readings, *runs):
    """Return readings of a sensor that repeats its last one in some rows, and which these are."""
    stale = np.zeros(len(readings), dtype=np.bool_)
    for begin, end in runs:
        readings[begin:end], stale[begin:end] = readings[begin - 1], True
    return readings, stale


def test_readings_of_a_sensor_that_hangs_are_none():
    """Which rows repeat the last reading is known by construction."""
    rng = np.random.default_rng(5)
    noisy = np.round(50.0 + rng.normal(0.0, 0.15, 400), 1)
    readings, stale = hung(noisy, (100, 115), (300, 320))
    found = stale_readings(readings)
    assert np.all(found[stale])
    assert np.count_nonzero(found & ~stale) <= 2  # the next reading may be the same by chance
    rising, stale = hung(np.round(20.0 + 0.05 * np.arange(300.0), 2), (120, 130))
    assert np.array_equal(stale_readings(rising), stale)


@pytest.mark.parametrize("readings", [
    np.round(20.0 + 30.0 * (1.0 - np.exp(-np.arange(900.0) / 100.0)), 1),  # comes to rest
    np.round(50.0 + 0.2 * np.sin(np.arange(900.0) / 40.0), 1),  # swings by few digits
    np.round(np.concatenate([np.full(100, 20.0), np.linspace(20.0, 60.0, 200), np.full(100, 60.0), np.full(100, 45.0)]), 1),  # cold goods at rest
    np.round(50.0 + np.random.default_rng(2).normal(0.0, 0.03, 2000), 1),  # noise within the last digit
    np.round(50.0 + np.random.default_rng(3).normal(0.0, 0.1, 5000), 1),  # noise of one digit
    np.repeat(np.arange(20.0, 60.0, 0.7), 9),  # a deadband
])
def test_readings_of_a_heater_that_stands_are_kept(readings):
    assert not stale_readings(readings).any()
