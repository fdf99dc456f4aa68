"""Dirt of real logs: what is left out is told by line and value, and nothing is put in its place."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from heatertune.errors import LogError
from heatertune.log import read_log


def _rows(n=120, noise=0.05):
    """A heat-up with a jump that stays (cold goods at row 80), three columns."""
    rng = np.random.default_rng(4)
    time = 10.0 * np.arange(n)
    temperature = 20.0 + 40.0 * (1.0 - np.exp(-time / 200.0)) - 8.0 * (np.arange(n) >= 80) + rng.normal(0.0, noise, n)
    return [[f"{t:g}", f"{y:.2f}", "50"] for t, y in zip(time, temperature, strict=True)]


def _read(tmp_path, rows, **options):
    path = tmp_path / "log.csv"
    path.write_text("time_s,temp_C,duty_pct\n" + "\n".join(",".join(row) for row in rows) + "\n")
    return read_log(path, **options)


def _told(log):
    return " ".join(log.repairs)


def test_a_clean_log_with_a_jump_that_stays_loses_nothing(tmp_path):
    log = _read(tmp_path, _rows())
    assert len(log.time_s) == 120
    assert "left out" not in _told(log)
    assert log.warnings == ()


@pytest.mark.parametrize(("cells", "told"), [
    (["1023.75"], "1 row with an open sensor's reading left out (line 42: 1023.75)."),
    (["1023.75"] * 9, "9 rows with an open sensor's reading left out (line 42: 1023.75, line 43: 1023.75"),
    (["", "nan", "---"], "3 rows without a reading left out (line 42, line 43, line 44)."),
    (["150"] * 9, "9 rows at one value that the log jumps to, as of an open sensor, left out (line 42: 150, line 43"),
    (["0"] * 5, "5 rows at one value that the log jumps to, as of an open sensor, left out (line 42: 0, line 43: 0"),
    (["85.0"], "1 row with a spike left out (line 42: 85)."),
    (["12.5", "11.9", "13.0"], "3 rows with a spike left out (line 42: 12.5, line 43: 11.9, line 44: 13)."),
])
def test_what_is_no_reading_of_the_heater_is_left_out_by_line_and_value(tmp_path, cells, told):
    rows = _rows()
    clean = _read(tmp_path, rows)
    for k, cell in enumerate(cells):
        rows[40 + k][1] = cell
    log = _read(tmp_path, rows, skip_empty="without" in told)
    assert told in _told(log)
    kept = np.r_[0:40, 40 + len(cells):120]
    assert log.time_s.tolist() == clean.time_s[kept].tolist()
    assert log.temperature_degC.tolist() == clean.temperature_degC[kept].tolist()
    assert len(log.power_pct) == 120 - len(cells)


@pytest.mark.parametrize("cell", ["", "nan", "--.-", "warm", "inf", "OPEN", "+OVER", "NULL", "Err"])
def test_a_few_rows_without_a_reading_are_left_out_and_counted(tmp_path, cell):
    rows = _rows()
    rows[40][1] = cell
    log = _read(tmp_path, rows)
    assert (len(log.time_s), log.taken.left_out) == (119, 1)
    assert "1 row without a reading left out (line 42)" in _told(log)


@pytest.mark.parametrize("cell", ["", "NaN"])
def test_the_way_on_from_many_rows_without_a_reading_works(tmp_path, cell):
    rows = _rows()
    for k in range(0, 120, 2):
        rows[k][1] = cell
    with pytest.raises(LogError, match="--skip-empty"):
        _read(tmp_path, rows)
    assert len(_read(tmp_path, rows, skip_empty=True).time_s) == 60


def test_four_readings_apart_are_no_spike_but_what_the_heater_did(tmp_path):
    rows = _rows()
    for k in range(4):
        rows[40 + k][1] = "12.5"
    assert len(_read(tmp_path, rows).time_s) == 120


def test_a_sensor_that_is_open_for_long_is_told_by_its_first_line(tmp_path):
    rows = _rows()
    for k in range(20):
        rows[40 + k][1] = "100"
    with pytest.raises(LogError, match=r"line 42, column temp_C: 20 rows of 120 at one value .*open sensor, the first: '100'"):
        _read(tmp_path, rows)


def test_an_end_of_the_range_that_is_reached_in_steps_is_kept(tmp_path):
    rows = _rows()
    for row in rows:
        row[1] = f"{min(float(row[1]), 55.0):.2f}"
    assert len(_read(tmp_path, rows).time_s) == 120


def test_a_log_with_too_many_holes_is_refused_with_the_first(tmp_path):
    rows = _rows()
    for k in range(13):
        rows[5 + 3 * k][1] = "1023.75"
    with pytest.raises(LogError, match=r"line 7, column temp_C: 13 rows of 120 without a reading"):
        _read(tmp_path, rows)


def test_a_noisy_log_keeps_its_noise(tmp_path):
    rng = np.random.default_rng(8)
    rows = [[f"{k}", f"{40.0 + 0.2 * k + rng.standard_t(3):.2f}", "50"] for k in range(400)]
    assert len(_read(tmp_path, rows).time_s) >= 399  # Student's t with three degrees: the wildest noise of a sensor


def test_gaps_are_told_and_kept(tmp_path):
    rows = _rows()
    del rows[50:70]
    log = _read(tmp_path, rows)
    assert log.warnings == ("The log has 1 gap (210 s after line 51); the power is assumed constant in them.",)
    assert np.max(np.diff(log.time_s)) == 210.0


def test_a_gap_is_more_than_five_times_the_usual_interval(tmp_path):
    # readings every 10 s: 45 and 50 s are none, 51 s is one
    for pause, gaps in ((45, 0), (50, 0), (51, 1)):
        rows = [[str(int(row[0]) + (pause - 10) * (k >= 60)), *row[1:]] for k, row in enumerate(_rows())]
        assert len(_read(tmp_path, rows).warnings) == gaps

def test_of_several_runs_the_longest_is_read_unless_another_is_asked_for(tmp_path):
    rows = _rows(30) + _rows(60) + _rows(40)
    log = _read(tmp_path, rows)
    assert len(log.time_s) == 60
    assert "The file holds 3 runs (from lines 2, 32, 92); run 2 was read, the longest: --run reads another." in _told(log)
    assert len(_read(tmp_path, rows, run=3).time_s) == 40
    with pytest.raises(LogError, match=r"run 4.*1…3"):
        _read(tmp_path, rows, run=4)
    with pytest.raises(LogError, match="run 2"):
        _read(tmp_path, _rows(), run=2)


def test_a_clock_that_goes_back_is_no_new_run(tmp_path):
    rows = _rows()
    rows[60][0] = "5"
    with pytest.raises(LogError, match=r"line 62.*goes backwards"):
        _read(tmp_path, rows)


def test_a_clock_put_back_at_the_end_of_summer_time_is_told_with_what_reads_the_log(tmp_path):
    path, begin = tmp_path / "october.csv", datetime(2025, 10, 26, 2, 50)
    instants = [begin + timedelta(seconds=10 * i - (3600 if i >= 60 else 0)) for i in range(240)]
    path.write_text("time,temp_C\n" + "".join(f"{at},{20 + 0.1 * i:.1f}\n" for i, at in enumerate(instants)))
    with pytest.raises(LogError, match=r"summer time.*--log-interval 10 counts the rows"):
        read_log(path)
    assert read_log(path, sample_time_s=10.0).time_s[-1] == 2390.0


@pytest.mark.parametrize("readings", [["85"], ["0"], ["85", "85"], ["85"] * 9, ["0"] * 6, ["150.5"], ["180", "170", "160"], ["-40"]])
@pytest.mark.parametrize("at_end", [False, True])
def test_a_sensor_that_starts_or_stops_is_left_out_at_either_end(tmp_path, readings, at_end):
    # 85 °C is what a DS18B20 gives before its first conversion (its data sheet, "power-on reset value")
    rows = _rows()
    clean = _read(tmp_path, rows)
    n = len(readings)
    for k, cell in enumerate(readings):
        rows[k - n if at_end else k][1] = cell
    log = _read(tmp_path, rows)
    kept = slice(0, -n) if at_end else slice(n, None)
    assert log.temperature_degC.tolist() == clean.temperature_degC[kept].tolist()
    what = "at one value that the log jumps to, as of an open sensor," if at_end and n > 4 else "at an end of the log, far from all others,"
    assert f"{n} row{'s' if n > 1 else ''} {what} left out" in _told(log)
    assert log.taken.left_out == n


def test_a_heater_that_is_logged_slowly_keeps_its_first_and_last_reading(tmp_path):
    # an exponential read once per time constant: 63 % of the way in its first step
    rest, heat = [20.0] * 30, [20.0 + 60.0 * (1.0 - np.exp(-k)) for k in range(12)]
    for values in (heat + [heat[-1] + 0.1 * (k % 2) for k in range(40)], rest + heat, [20.0, *heat[1:], *(80.0 - y for y in heat)]):
        rows = [[f"{60 * k}", f"{y:.1f}", "50"] for k, y in enumerate(values)]
        assert len(_read(tmp_path, rows).time_s) == len(values)


def test_a_jump_after_a_pause_is_the_heaters(tmp_path):
    rows = _rows()
    rows[0][1] = "80"
    rows[0][0] = "-3000"
    assert len(_read(tmp_path, rows).time_s) == 120


def test_short_pulses_of_a_heater_that_is_logged_slowly_are_no_spikes(tmp_path):
    # 90 s of time constant, read every 30 s, heated for one to three readings now and then
    y, values = 20.0, []
    for k in range(150):
        on = k % 13 in (0, 1, 2) or k % 17 == 0
        values.append(y)
        y += (1.0 - np.exp(-30.0 / 90.0)) * (20.0 + 60.0 * on - y)
    rows = [[f"{30 * k}", f"{v:.1f}", "50"] for k, v in enumerate(values)]
    assert len(_read(tmp_path, rows).time_s) == 150


def _with_loose_probe(rows, begin, end):
    for k in range(begin, end):
        rows[k][1] = f"{21.0 + 0.1 * (k % 3):.1f}"
    return rows


def test_a_probe_that_hung_in_the_air_is_left_out_and_told(tmp_path):
    rows = [[f"{k}", f"{20 + 0.5 * min(k, 80):.1f}", "60"] for k in range(120)]
    log = _read(tmp_path, _with_loose_probe(rows, 60, 80))
    assert (len(log.time_s), log.taken.left_out) == (100, 20)
    assert "20 rows between two opposite jumps, as of a loose probe, left out (line 62: 21" in _told(log)


@pytest.mark.parametrize("dead_rows", [0, 1, 10])
def test_a_pulse_that_a_fast_heater_follows_is_no_loose_probe(tmp_path, dead_rows):
    # a time constant far below the interval: the readings are the power's, later by the dead time
    power = [60 if 40 <= k < 60 else 0 for k in range(120)]
    rows = [[f"{k}", f"{20 + 0.5 * power[max(k - dead_rows, 0)] + 0.1 * (k % 3):.1f}", f"{power[k]}"] for k in range(120)]
    assert len(_read(tmp_path, rows).time_s) == 120


def test_minutes_and_seconds_go_on_after_the_full_hour(tmp_path):
    # a spreadsheet shows times of day as mm:ss.0 and saves what it shows
    rows = [[f"{(3000 + 10 * k) % 3600 // 60:02d}:{10 * k % 60:02d}.0", *cells] for k, (_, *cells) in enumerate(_rows())]
    log = _read(tmp_path, rows)
    assert np.diff(log.time_s) == pytest.approx(10.0)
    assert "the full hour" in _told(log)


def test_a_second_mark_in_half_of_the_rows_costs_none(tmp_path):
    path = tmp_path / "log.csv"
    lines = [(";" if k % 2 else ",").join(row) for k, row in enumerate(_rows())]
    path.write_text("\n".join(["time_s;temp_C;duty_pct", *(line.replace(",", ";", 1) for line in lines)]) + "\n")
    assert read_log(path).temperature_degC == pytest.approx([float(row[1]) for row in _rows()])


def test_the_option_that_an_error_names_leaves_out_rows_of_another_length(tmp_path):
    rows = [[*row, "7"] if k % 5 == 0 else row for k, row in enumerate(_rows(), start=1)]
    with pytest.raises(LogError, match="--skip-empty leaves out such rows"):
        _read(tmp_path, rows)
    assert len(_read(tmp_path, rows, skip_empty=True).time_s) == 96


@pytest.mark.parametrize("cells", [("20", "25"), ("−5 °C", "20 °F"), ("1 234 °C", "2 000 °F")])
def test_a_temperature_of_two_values_in_turns_is_read_or_refused(tmp_path, cells):
    """Every step is then one to an end of the range: none is left to compare it with."""
    path = tmp_path / "turns.csv"
    rows = (f"{row};{cells[row % 2]};{50 if row > 20 else 0}" for row in range(60))
    path.write_text("\n".join(["time_s;temp;power %", *rows]), encoding="utf-8")
    assert len(read_log(path, temperature_unit="degC").time_s) == 60


def test_marks_in_place_of_a_temperature_in_one_of_two_units_cost_their_row(tmp_path):
    path = tmp_path / "marks.csv"
    rows = (f"{row};{'#### °C' if row == 30 else ('20 °C', '70 °F')[row % 2]};{50 if row > 20 else 0}" for row in range(60))
    path.write_text("\n".join(["time_s;temp;power %", *rows]), encoding="utf-8")
    log = read_log(path)
    assert 30.0 not in log.time_s
    assert (len(log.time_s), log.taken.left_out) == (59, 1)
