"""What was taken of a file as what: told in one line, and repeated by the options that it names."""

import random

import numpy as np
import pytest
from tests.bench import drawn_exports as messy

from heatertune.errors import LogError
from heatertune.log import read_log

ROWS = [(2.0 * k, round(20.0 + 0.2 * k, 1), 60.0 if k > 9 else 0.0) for k in range(60)]


def _read(tmp_path, text, **options):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    return read_log(path, **options)


def _table(header, rows=ROWS):
    return "\n".join([header, *(",".join(f"{cell:g}" if isinstance(cell, float) else cell for cell in row) for row in rows)]) + "\n"


def test_one_line_tells_columns_units_rows_and_what_was_not_used(tmp_path):
    rows = [(*row, "1.2", "7") for row in ROWS]
    rows[5] = (10.0, "", 0.0, "1.2", "7")
    log = _read(tmp_path, _table("Time,T1,Q1 [%],amps,control", rows), skip_empty=True)
    assert log.taken.line == (
        "log.csv: 59 rows every 2 s; time = 'Time' [s, assumed], temperature = 'T1' [°C, from a room's temperature], power = 'Q1 [%]' [0…100 %], "
        "setpoint = none; 1 row left out; not used: 'amps', 'control'"
    )
    assert log.taken.repaired_share == 1 / 60
    assert log.window(0.0, 60.0).taken is log.taken


@pytest.mark.parametrize(("name", "scale", "written"), [
    ("PWM 0-255", 2.55, "0…255"), ("power [0..1]", 0.01, "0…1"), ("OP [%]", 1.0, "0…100 %"), ("heater", 1.0, "0…100 %, assumed"),
])
def test_the_scale_of_the_power_stands_in_the_line(tmp_path, name, scale, written):
    log = _read(tmp_path, _table(f"time_s,temp_C,{name}", [(t, y, round(u * scale, 3)) for t, y, u in ROWS]))
    assert log.power_pct.max() == pytest.approx(60.0)
    assert f"power = '{name}' [{written}]" in log.taken.line


@pytest.mark.parametrize("name", ["amps", "control", "heater [V]", "U (0-10V)", "Strom", "Leistung [W]", "current", "power [counts]"])
def test_a_power_in_a_unit_that_is_no_share_is_asked_for_and_may_be_left_out(tmp_path, name):
    text = _table(f"time_s,temp_C,{name}", [(t, y, u / 10.0) for t, y, u in ROWS])
    with pytest.raises(LogError, match=r"--power-full-scale.*--power-column none"):
        _read(tmp_path, text)
    assert _read(tmp_path, text, power_full_scale=10.0).power_pct.max() == 60.0
    log = _read(tmp_path, text, power_column="none")
    assert log.power_pct is None
    assert log.taken.unused == (name,)


def test_a_power_in_percent_is_taken_before_one_in_watts(tmp_path):
    log = _read(tmp_path, _table("time_s,temp_C,Leistung [W],Stellgrad [%]", [(t, y, u * 5.0, u) for t, y, u in ROWS]))
    assert log.power_pct.max() == 60.0
    assert "not used: 'Leistung [W]'" in log.taken.line


def test_a_power_that_may_be_volts_is_doubted(tmp_path):
    log = _read(tmp_path, _table("time_s,temp_C,CV", [(t, y, u / 6.0) for t, y, u in ROWS]))
    assert any("never exceeds 10 %" in doubt for doubt in log.warnings)


@pytest.mark.parametrize(("column", "rows"), [
    ("PV", [(t, y * 100.0, u) for t, y, u in ROWS]), ("PV", [(t, y - 150.0, u) for t, y, u in ROWS]),
])
def test_readings_that_no_heater_has_ask_for_their_unit(tmp_path, column, rows):
    with pytest.raises(LogError, match=r"unit is not known.*--temperature-unit"):
        _read(tmp_path, _table(f"time_s,{column},duty_pct", rows))
    with pytest.raises(LogError, match=r"line \d+.*that no heater reaches.*-90…2000 °C"):
        _read(tmp_path, _table(f"time_s,{column},duty_pct", rows), temperature_unit="degC")


def test_rows_of_two_zones_are_refused_with_the_column_that_tells_them_apart(tmp_path):
    rows = [(t, zone, y + shift, u) for t, y, u in ROWS for zone, shift in (("left", 0.0), ("right", 5.0))]
    text = _table("time_s,side,temp_C,duty_pct", rows)
    with pytest.raises(LogError, match=r"column 'side' tells them apart \(left, right\).*--tag left --tag-column side"):
        _read(tmp_path, text)
    log = _read(tmp_path, text, tag="right")
    assert log.temperature_degC.tolist() == [y + 5.0 for _, y, _ in ROWS]
    assert any("60 whose 'side' is 'right'" in told for told in log.repairs)


def test_rows_of_a_clock_too_coarse_are_spread_and_a_row_now_and_then_is_told(tmp_path):
    coarse = [(2.0 * (k // 2), y, u) for k, (_, y, u) in enumerate(ROWS)]
    log = _read(tmp_path, _table("time_s,temp_C,duty_pct", coarse))
    assert log.time_s.tolist() == [float(k) for k in range(60)]  # two rows in each two seconds: one a second
    assert any("The clock shows one instant for 2 rows" in told for told in log.repairs)
    begun = _read(tmp_path, _table("time_s,temp_C,duty_pct", coarse[1:]))
    assert begun.time_s.tolist() == [float(k) for k in range(1, 60)]  # the first row is the second one of its instant
    uneven = [(2.0 * (k // 2) if k % 10 < 5 else 2.0 * (k // 5), y, u) for k, (_, y, u) in enumerate(ROWS)]
    with pytest.raises(LogError, match=r"rows of 60 share an instant.*--log-interval|backwards"):
        _read(tmp_path, _table("time_s,temp_C,duty_pct", uneven))
    once = [*ROWS[:20], (ROWS[19][0], *ROWS[20][1:]), *ROWS[21:]]
    log = _read(tmp_path, _table("time_s,temp_C,duty_pct", once))
    assert len(log.time_s) == 59
    assert any("1 of them with another reading" in told for told in log.repairs)


def test_two_sensors_in_the_rows_of_one_instant_are_not_spread(tmp_path):
    two = [(2.0 * (k // 2), y if k % 2 else 20.0, u) for k, (_, y, u) in enumerate(ROWS)]
    text = _table("time_s,temp_C,duty_pct", two)
    with pytest.raises(LogError, match=r'2 heaters or sensors have rows in turns; expected --tag "1 of 2".*--tag-column none'):
        _read(tmp_path, text)
    assert _read(tmp_path, text, tag="2 of 2").temperature_degC.tolist() == [y for _, y, _ in ROWS[1::2]]
    with pytest.raises(LogError, match=r"rows of 60 share an instant"):
        _read(tmp_path, text, tag_column="none")


def test_repeated_rows_lose_nothing(tmp_path):
    taken = _read(tmp_path, _table("time_s,temp_C,duty_pct", [row for row in ROWS for _ in (1, 2)])).taken
    assert (taken.left_out, taken.repeats, taken.repaired_share) == (60, 60, 0.0)


def test_blank_setpoints_hold_the_last_one(tmp_path):
    rows = [(*row, 50.0 if k == 3 else 55.0 if k == 30 else "") for k, row in enumerate(ROWS)]
    log = _read(tmp_path, _table("time_s,temp_C,duty_pct,SP", rows))
    assert log.setpoint_degC.tolist() == [50.0] * 30 + [55.0] * 30
    assert "58 rows repaired" in log.taken.line
    empty = _read(tmp_path, _table("time_s,temp_C,duty_pct,SP", [(*row, "") for row in ROWS[:-1]] + [(*ROWS[-1], "-")]))
    assert empty.setpoint_degC is None


LONG = [("TIC1.PV", 2.0 * k + 0.5, f"{y:g}", "192") for k, (_, y, _) in enumerate(ROWS)] + [
    ("TIC1.OP", 0.0, "0", "192"), ("TIC1.OP", 21.0, "60", "192"), ("TIC1.SP", 0.0, "55", "192"), ("spare", 3.0, "7", "192"),
]


def test_a_long_table_is_turned_and_power_and_setpoint_are_held_to_the_readings(tmp_path):
    log = _read(tmp_path, _table("tag,time_s,value,quality", LONG))
    # the power changes at 21.0, between the readings at 20.5 and 22.5
    assert [*map(list, log.signals["power"].changes)] == [[0.5, 21.0], [0.0, 60.0]]
    assert log.time_s.tolist() == [t + 0.5 for t, _, _ in ROWS]
    assert log.temperature_degC.tolist() == [y for _, y, _ in ROWS]
    rows = log.on_one_clock()
    assert rows.time_s.tolist() == sorted([*log.time_s, 21.0])
    assert rows.temperature_degC[11] == pytest.approx(22.0 + 0.25 * 0.2)  # on the line between the two
    assert rows.power_pct.tolist() == [0.0 if t < 21.0 else 60.0 for t in rows.time_s]
    assert log.power_pct.tolist() == [0.0 if t < 21.0 else 60.0 for t in log.time_s]
    assert set(log.setpoint_degC) == {55.0}
    assert "not used: 'spare'" in log.taken.line
    assert log.taken.reading["tag"] == "TIC1.PV"
    alone = _read(tmp_path, _table("tag,time_s,value,quality", LONG), power_tag="none", setpoint_tag="none")
    assert (alone.power_pct, alone.setpoint_degC) == (None, None)


@pytest.mark.parametrize(("good", "bad"), [
    ("192", "0"), ("216", "64"), ("Good", "Bad"), ("GOOD", "Uncertain last usable"), ("0xC0", "0x40"), ("gut", "schlecht"), ("true", "false"),
])
def test_readings_of_bad_quality_are_left_out_and_counted(tmp_path, good, bad):
    # OPC DA: the two high bits of the byte are 11 for good, 01 for uncertain, 00 for bad
    rows = [(tag, t, "0" if t == 40.5 else value, bad if t == 40.5 else good) for tag, t, value, _ in LONG]
    log = _read(tmp_path, _table("tag,time_s,value,quality", rows))
    assert len(log.time_s) == 59  # one of 60 readings is left out
    assert any("1 row whose quality is not good left out (line 22)" in told for told in log.repairs)
    assert log.taken.left_out == 1


@pytest.mark.parametrize(("header", "flag", "named"), [
    ("tag,time_s,value,quality", "7", "--quality-column none"), ("tag,time_s,value,quality", "", "--quality-column none"),
])
def test_flags_of_unknown_meaning_are_refused_and_may_be_passed_over(tmp_path, header, flag, named):
    text = _table(header, [(*row[:3], flag if row[0] == "TIC1.OP" else "192") for row in LONG]).replace("192", "3")
    with pytest.raises(LogError, match=named):
        _read(tmp_path, text)
    assert len(_read(tmp_path, text, quality_column="none").time_s) == 60


@pytest.mark.parametrize(("asked", "named"), [
    ({"tag": "TIC9.PV"}, "--tag, one of TIC1.PV, TIC1.OP"), ({"power_tag": "heat"}, "--power-tag, one of"),
])
def test_a_tag_that_is_not_there_is_refused_with_those_that_are(tmp_path, asked, named):
    with pytest.raises(LogError, match=named):
        _read(tmp_path, _table("tag,time_s,value,quality", LONG), **asked)


def test_tags_whose_names_tell_nothing_are_asked_for(tmp_path):
    rows = [("a" if tag == "TIC1.PV" else "b", *rest) for tag, *rest in LONG if tag in ("TIC1.PV", "TIC1.OP")]
    with pytest.raises(LogError, match=r"no tag is plainly the temperature \(a, b\).*--tag NAME"):
        _read(tmp_path, _table("tag,time_s,value,quality", rows))
    log = _read(tmp_path, _table("tag,time_s,value,quality", rows), tag="a", power_tag="b")
    assert log.power_pct.max() == 60.0


@pytest.mark.parametrize("writer", messy.WRITERS, ids=lambda writer: writer.__name__)
def test_a_messy_export_is_read_to_its_truth_or_refused_in_one_line(tmp_path, writer):
    # the truth is the writer's, which shares nothing with the reader; tests/bench/drawn_exports.py writes hundreds
    for number in range(3):
        assert messy.judged(tmp_path, writer(random.Random(f"test-{number}")), number) in ("read", "refused")


def test_a_reading_is_repeated_by_its_own_options_on_real_logs(real_logs):
    asked = {
        "reaction_curve_semicolon_no_time": {"sample_time_s": 0.1}, "tclab_step_fahrenheit_millivolt": {"temperature_unit": "degF", "power_full_scale": 255},
        "tclab_step_kelvin_pwm255": {"temperature_unit": "K", "power_full_scale": 255},
    }
    for path in sorted(real_logs.rglob("*.csv")):
        log = read_log(path, **asked.get(path.stem, {}))
        again = read_log(path, **log.taken.reading)
        assert again.taken.reading == log.taken.reading
        for name in ("time_s", "temperature_degC", "power_pct", "setpoint_degC"):
            assert np.array_equal(getattr(log, name), getattr(again, name)), (path.stem, name)


@pytest.mark.parametrize(("asked", "named"), [
    ({"power_tag": "Q1"}, "--power-tag means nothing"), ({"setpoint_tag": "none"}, "--setpoint-tag means nothing"),
    ({"tag_column": "time_s"}, "--tag-column without --tag"), ({"tag": "A"}, "no cell holds the tag 'A'"),
    ({"date_column": "time_s"}, "no time of day"), ({"tag": "20", "tag_column": "duty_pct"}, "no cell holds the tag '20'"),
])
def test_what_is_asked_for_and_cannot_be_heard_is_refused(tmp_path, asked, named):
    with pytest.raises(LogError, match=named):
        _read(tmp_path, _table("time_s,temp_C,duty_pct"), **asked)
