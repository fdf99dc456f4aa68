import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heatertune.errors import LogError, UnknownName
from heatertune.log import read_log
from heatertune.log.timestamps import is_day_or_month

ROWS = [(10.0 * k, 20.0 + 0.25 * k, 40.0 if k % 7 else 0.0) for k in range(30)]


def _write(tmp_path, text, name="log.csv", encoding="utf-8"):
    path = tmp_path / name
    path.write_bytes(text.encode(encoding))
    return path


def _table(header, rows=ROWS, separator=",", mark="."):
    lines = [separator.join(f"{cell:g}".replace(".", mark) for cell in row) for row in rows]
    return "\n".join(([header] if header else []) + lines) + "\n"


def test_the_tables_are_read_exactly_as_printed_and_only_errata_change_them():
    # the values are those printed in the paper: first, peak and last rows of Tables 3 and 4
    for name, first, peak, last in (("table3", 29.3, 51.4, 43.2), ("table4", 24.0, 58.3, 53.3)):
        printed, corrected = read_log(name), read_log(name, errata=True)
        assert len(printed.time_s) == 240
        assert (printed.temperature_degC[0], printed.temperature_degC.max(), printed.temperature_degC[-1]) == (
            first, peak, last,
        )
        assert (printed.time_s[-1], corrected.time_s[-1]) == (2936.0, 2400.0)
        assert np.array_equal(printed.temperature_degC, corrected.temperature_degC)
        assert any("2936" in doubt for doubt in printed.warnings)
        assert any("2936" in repair for repair in corrected.repairs)
        assert any("possible digit misprint" in doubt for doubt in read_log("table3").warnings)
    assert read_log("table4").same_heater == ("table3",)


@pytest.mark.parametrize("separator", [",", ";", "\t", " "], ids=["comma", "semicolon", "tab", "space"])
@pytest.mark.parametrize("mark", [".", ","], ids=["point", "decimal comma"])
def test_separators_and_decimal_marks_are_understood(tmp_path, separator, mark):
    if separator == mark:
        pytest.skip("a decimal comma in a comma-separated file needs quotes")
    path = _write(tmp_path, _table(separator.join(["time_s", "temp_C", "duty_pct"]), separator=separator, mark=mark))
    log = read_log(path)
    assert np.array_equal(np.column_stack([log.time_s, log.temperature_degC, log.power_pct]), np.array(ROWS))
    assert any("Decimal commas" in told for told in log.repairs) == (mark == ",")


def test_quoted_decimal_commas_in_a_comma_separated_file_are_understood(tmp_path):
    lines = [f'{t:g},"{y:.2f}"'.replace(".", ",") for t, y, _ in ROWS]
    log = read_log(_write(tmp_path, "time_s,temp_C\n" + "\n".join(lines)))
    assert log.temperature_degC[1] == 20.25


@pytest.mark.parametrize(
    ("header", "temperature", "expected"),
    [("time_s,T [°F],duty_pct", 68.0, 20.0), ("time_s,temperature (K),duty_pct", 293.15, 20.0),
     ("Time (sec),Temp [degC],Heater (%)", 20.0, 20.0)],
)
def test_temperature_units_are_taken_from_the_header(tmp_path, header, temperature, expected):
    rows = [(t, temperature + 0.1 * k, p) for k, (t, _, p) in enumerate(ROWS)]
    assert read_log(_write(tmp_path, _table(header, rows))).temperature_degC[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("name", "full"), [("duty_pct", 100.0), ("duty [0..1]", 1.0), ("PWM 0-255", 255.0), ("power (%)", 100.0)]
)
def test_the_power_scale_is_taken_from_the_header(tmp_path, name, full):
    rows = [(t, y, full if k > 5 else 0.0) for k, (t, y, _) in enumerate(ROWS)]
    assert read_log(_write(tmp_path, _table(f"time_s,temp_C,{name}", rows))).power_pct.max() == 100.0


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e-3), ("min", 60.0), ("h", 3600.0), ("s", 1.0)])
def test_time_units_are_taken_from_the_header(tmp_path, unit, factor):
    assert read_log(_write(tmp_path, _table(f"time [{unit}],temp_C,duty_pct"))).time_s[1] == pytest.approx(10.0 * factor)


@pytest.mark.parametrize(
    "form", ["2026-03-01T10:{:02d}:00", "2026-03-01 10:{:02d}:00", "2026-03-01T10:{:02d}:00+01:00", "01.03.2026 10:{:02d}:00"]
)
def test_time_stamps_become_seconds_from_the_first_row(tmp_path, form):
    text = "timestamp;temp_C\n" + "\n".join(f"{form.format(k)};{20 + k}" for k in range(30))
    assert np.array_equal(read_log(_write(tmp_path, text)).time_s, 60.0 * np.arange(30))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_byte_order_marks_and_old_encodings_are_understood(tmp_path, encoding):
    path = _write(tmp_path, _table("time_s;T [°C];duty_pct", separator=";"), encoding=encoding)
    log = read_log(path)
    assert log.temperature_degC[1] == 20.25
    assert any("Latin-1" in told for told in log.repairs) == (encoding == "latin-1")


def test_comments_blank_lines_a_row_of_units_and_repeated_times_are_told(tmp_path):
    rows = _table("", ROWS[:5] + ROWS[4:]).replace("\n", "\n\n", 1)
    log = read_log(_write(tmp_path, "# rig 7\ntime,temp,duty\ns,°C,%\n" + rows))
    assert len(log.time_s) == 30
    told = " ".join(log.repairs)
    assert "2 lines without readings" in told
    assert "1 row at the time of the row before dropped (line 10)." in told


def test_names_above_the_readings_and_foreign_columns_are_told(tmp_path):
    log = read_log(_write(tmp_path, "# time_s,room temp_C,T1,T2\n" + _table("", [(t, 21.5, y, y + 1) for t, y, _ in ROWS])))
    assert log.temperature_degC[0] == 20.0
    told = " ".join(log.repairs)
    assert "names of the columns" in told
    assert "'T1' was taken as the temperature; T2, room temp_C not used." in told
    warm = read_log(_write(tmp_path, _table("time_s,T", [(t, y + 50) for t, y, _ in ROWS])))
    assert any("room temperature in °F" in doubt for doubt in warm.warnings)


def test_a_file_without_header_is_understood_by_its_numbers(tmp_path):
    log = read_log(_write(tmp_path, _table("")))
    assert log.power_pct.max() == 40.0
    assert any("no header" in told for told in log.repairs)


# what, text, options, and what the one line has to name
BAD = {
    "empty": ("", {}, ["empty"]),
    "header only": ("time_s,temp_C\n", {}, ["no readings"]),
    "time backwards": (_table("time_s,temp_C,duty_pct").replace("\n50,", "\n5,"), {}, ["line 7", "'5'", "40"]),
    "too short": (_table("time_s,temp_C,duty_pct", ROWS[:19]), {}, ["19", ">= 20"]),
    "constant": (_table("time_s,temp_C", [(t, 20.0) for t, _, _ in ROWS]), {}, ["varying"]),
    "power out of range": (_table("time_s,temp_C,duty_pct").replace(",40\n", ",140\n", 1), {}, ["line 3", "'140'", "0…100"]),
    "below absolute zero": (_table("time_s,temp_C,duty_pct").replace("20,", "-300,", 1), {}, ["line 2", "absolute zero"]),
    "power without unit": (_table("time_s,temp_C,CV", [(t, y, 5 * p) for t, y, p in ROWS]), {}, ["--power-full-scale"]),
    "kelvin without unit": (_table("time_s,PV", [(t, y + 273) for t, y, _ in ROWS]), {}, ["--temperature-unit"]),
    "no time": (_table("temp_C,duty_pct", [(y, p) for _, y, p in ROWS]), {}, ["--log-interval"]),
    "no temperature": (_table("a,b,c"), {}, ["--temperature-column"]),
    "unknown column": (_table("time_s,temp_C,duty_pct"), {"power_column": "kW"}, ["'kW'", "duty_pct"]),
    "binary": ("\0\1\2" * 50, {}, ["binary"]),
    "watts": (_table("time_s,temp_C,heater [W]"), {}, ["share of full power", "--power-full-scale"]),
    "a fraction or percent": (_table("time_s,temp_C,power", [(t, y, p / 100) for t, y, p in ROWS]), {},
                              ["fraction or percent", "--power-full-scale"]),
    "clock ticks": (_table("time [ticks],temp_C,duty_pct"), {}, ["unknown unit", "--time-unit"]),
    "day or month": ("date,temp_C\n" + "\n".join(f"03/{k + 1:02d}/2026 10:00:00,{k}" for k in range(11)), {},
                     ["day first or month first"]),
    "one zone": ("timestamp,temp_C\n" + "\n".join(f"2026-03-01T10:{k:02d}:00{'Z' if k else ''},{k}" for k in range(25)), {},
                 ["line 3", "time zone"]),
    # the power of a clock alone was held from a day in 1970 on: it never changed
    "one tag has dates": ("time,tag,value\n" + "\n".join(
        f"{day}10:{k:02d}:00,{tag},{value}" for k in range(25) for day, tag, value in (
            ("2026-03-01 ", "oven_temp", 20 + k), ("", "oven_power", 40 if k > 5 else 0))), {}, ["line 3", "without a date"]),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_understood_is_refused_by_place_and_value(tmp_path, case):
    text, options, named = BAD[case]
    with pytest.raises(LogError) as caught:
        read_log(_write(tmp_path, text), **options)
    message = str(caught.value)
    assert "\n" not in message
    for part in ["log.csv", *named]:
        assert part in message


#: what a logger leaves of one row in line 6 → it is left out, and the others are read
DAMAGE = {
    "text for a number": ("40,21,40", "40,warm,40"), "infinite": ("40,21,40", "40,inf,40"), "no number": ("40,21,40", "40,nan,40"),
    "no number for the power": ("40,21,40", "40,21,nan"), "empty power": ("40,21,40", "40,21,"), "empty cell": ("40,21,40", "40,,40"),
    "short row": ("40,21,40", "40,21"), "long row": ("40,21,40", "40,21,40,3"), "open quotation": ("40,21,40", '40,"21,40'),
    "digit groups": ("40,21,40", "40,1_021,40"), "beyond all readings": ("40,21,40", "40,1e39,40"), "no time": ("40,21,40", "later,21,40"),
    "NUL bytes": ("40,21,40", "\0\0\0\0\0\0"), "a mark": ("40,21,40", "40,--.-,40"), "over range": ("40,21,40", "40,+OVER,40"),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_row_costs_this_row_and_is_counted(tmp_path, case):
    whole = _table("time_s,temp_C,duty_pct")
    assert whole.count(DAMAGE[case][0]) == 1
    log, clean = read_log(_write(tmp_path, whole.replace(*DAMAGE[case]))), read_log(_write(tmp_path, whole))
    kept = np.r_[0:4, 5:30]
    assert log.time_s.tolist() == clean.time_s[kept].tolist()
    assert log.temperature_degC.tolist() == clean.temperature_degC[kept].tolist()
    assert log.power_pct.tolist() == clean.power_pct[kept].tolist()
    assert (log.taken.rows_read, log.taken.left_out) == (30, 1)
    assert log.taken.repaired_share == 1 / 30  # more than 1 %: the verdict tells it
    assert any("left out" in told for told in log.repairs)


def test_what_stands_below_a_table_is_no_reading(tmp_path):
    whole = _table("time_s,temp_C,duty_pct")
    for below in ("Mean,25.3,38.7\n", "\nMinimum,20,0\nMaximum,27.25,40\n", "290,27.2", "EOF\n", "\0" * 512):
        log = read_log(_write(tmp_path, whole + below))
        assert log.time_s.tolist() == read_log(_write(tmp_path, whole)).time_s.tolist(), below


def test_a_log_of_which_a_seventh_is_no_reading_is_refused(tmp_path):
    for column, name, mark in ((1, "temp_C", "Err"), (2, "duty_pct", "NULL")):
        rows = [[mark if i == column and k % 7 == 3 else f"{cell:g}" for i, cell in enumerate(row)] for k, row in enumerate(ROWS)]
        with pytest.raises(LogError, match=f"line 5, column {name}"):
            read_log(_write(tmp_path, "\n".join(["time_s,temp_C,duty_pct", *map(",".join, rows)])))


def test_missing_files_and_unknown_units_are_refused(tmp_path):
    with pytest.raises(LogError, match="No such file"):
        read_log(tmp_path / "none.csv")
    with pytest.raises(LogError, match="directory"):
        read_log(tmp_path)
    with pytest.raises(UnknownName, match="degC, degF, K"):
        read_log("table3", temperature_unit="R")


@settings(max_examples=60)
@given(data=st.data())
def test_any_written_log_is_read_back(tmp_path_factory, data):
    n = data.draw(st.integers(20, 40))
    temperature = data.draw(st.lists(st.integers(-200, 2400), min_size=n, max_size=n).filter(lambda v: len(set(v)) > 1))
    power = data.draw(st.lists(st.integers(0, 1000), min_size=n, max_size=n))
    separator, mark = data.draw(st.sampled_from([(",", "."), (";", ","), (";", "."), ("\t", ",")]))
    rows = [(7.5 * k, t / 10, p / 10) for k, (t, p) in enumerate(zip(temperature, power, strict=True))]
    text = _table(separator.join(["time_s", "temp_C", "duty_pct"]), rows, separator, mark)
    log = read_log(_write(tmp_path_factory.mktemp("log"), text))
    assert np.array_equal(np.column_stack([log.time_s, log.temperature_degC, log.power_pct]), np.array(rows))


@pytest.mark.long
def test_every_real_log_with_common_columns_is_read_whole(real_logs):
    # row counts printed beside the logs
    for name, rows in {"apm_siso_doublet": 571, "box_kp4_ki01": 7537, "pidtune_dataIDFOM1": 5601, "tec_run11": 120}.items():
        assert len(read_log(real_logs / "normalised" / f"{name}.csv").time_s) == rows
    assert all(len(read_log(path).time_s) >= 120 for path in (real_logs / "normalised").glob("*.csv"))


def test_real_logs_as_published_are_read_once_their_units_are_told(real_logs):
    # the same heater, once as published (K, PWM counts) and once converted by the collection's editor
    raw = read_log(real_logs / "tclab_step_kelvin_pwm255.csv", temperature_unit="K", power_full_scale=255)
    converted = read_log(real_logs / "normalised" / "apm_siso_doublet.csv")
    assert raw.temperature_degC == pytest.approx(converted.temperature_degC, abs=0.006)
    assert raw.power_pct == pytest.approx(converted.power_pct, abs=1e-4)
    assert read_log(
        real_logs / "tclab_step_fahrenheit_millivolt.csv", temperature_unit="degF", power_full_scale=255
    ).temperature_degC[0] == pytest.approx(22.83, abs=0.01)
    two = read_log(real_logs / "tclab_two_heaters_closed_loop.csv")
    assert two.setpoint_degC[0] == 23.0
    assert any("Temperature 2" in told for told in two.repairs)
    curve = read_log(real_logs / "reaction_curve_semicolon_no_time.csv", sample_time_s=0.1)
    assert curve.power_pct.max() == 10.0


def test_minutes_and_seconds_are_not_taken_for_hours_and_minutes(tmp_path):
    rows = [f"0:{k:02d},{20 + k}" for k in range(40)]
    path = _write(tmp_path, "time,temp_C\n" + "\n".join(rows))
    with pytest.raises(LogError, match=r"line 2.*hours and minutes or minutes and seconds: '0:00'.*--time-unit mm:ss or --time-unit hh:mm"):
        read_log(path)
    assert read_log(path, time_unit="mm:ss").time_s[1] == 1.0
    assert read_log(path, time_unit="hh:mm").time_s[1] == 60.0
    assert read_log(path, **read_log(path, time_unit="hh:mm").taken.reading).time_s[1] == 60.0
    named = _write(tmp_path, "time (mm:ss),temp_C\n" + "\n".join(rows))
    assert read_log(named).time_s[1] == 1.0
    long = [f"{k // 60}:{k % 60:02d},{20 + k / 100}" for k in range(7000)]  # a kiln may be fired for 25 hours, not for 116
    assert read_log(_write(tmp_path, "time,temp_C\n" + "\n".join(long))).time_s[-1] == 6999.0
    path = _write(tmp_path, "time,temp_C\n" + "\n".join(long[600:1500]))
    with pytest.raises(LogError, match="hours and minutes or minutes and seconds"):
        read_log(path)
    assert read_log(path, time_unit="hh:mm").time_s[-1] == 60.0 * 1499.0
    dated = "date,time,temp_C\n" + "\n".join(f"2026-03-01,{row}" for row in rows)
    assert read_log(_write(tmp_path, dated)).time_s[1] == 60.0


def test_a_reading_cut_short_above_the_others_is_no_title(tmp_path):
    text = _table("time_s,temp_C,duty_pct")
    with pytest.raises(LogError, match="line 2: 2 cells"):
        read_log(_write(tmp_path, text.replace("\n0,20,0\n", "\n0,20\n")))
    with pytest.raises(LogError, match="line 1: 2 cells"):
        read_log(_write(tmp_path, _table("").replace("0,20,0\n", "0,20\n", 1)))
    for first in ("0,warm,0", "zero,20,0"):
        log = read_log(_write(tmp_path, text.replace("\n0,20,0\n", f"\n{first}\n")))
        assert (log.taken.left_out, log.time_s[0]) == (1, 10.0)
    with pytest.raises(LogError, match="line 1: 2 cells"):
        read_log(_write(tmp_path, text.replace("time_s,temp_C,duty_pct", "time_s,temp_C")))


def test_a_separator_is_what_more_than_four_lines_of_five_hold(tmp_path):
    """Remarks with semicolons on 24 lines of 30 are remarks (RFC 4180: the comma separates); a title is no row."""
    rows = "\n".join(f"{10 * k},{20 + k / 4},{'door; open' if k % 5 < 4 else ''}" for k in range(29))
    assert read_log(_write(tmp_path, f"time_s,temp_C,remark\n{rows}\n")).temperature_degC[4] == 21.0
    titles = "Furnace 3\nSerial 12\nBatch 7\nTuesday\n"  # 31 lines of 35 hold one: 89 %
    log = read_log(_write(tmp_path, titles + _table("time_s;temp_C;duty_pct", separator=";")))
    assert len(log.time_s) == len(ROWS)


@pytest.mark.parametrize(("begins", "ticks_per_s", "first_s"), [
    (94_000_000, 1, 94_000_000.0),  # a counter of almost three years: seconds since it was switched on
    (1_000_000_000, 1, 0.0),  # 9 September 2001, 01:46:40 UTC
    (1_772_359_200, 1, 0.0),  # 1 March 2026, 10:00 UTC, and the same with 13, 16 and 19 digits
    (1_772_359_200_000, 1_000, 0.0), (1_772_359_200_000_000, 1_000_000, 0.0),
    (1_772_359_200_000_000_000, 1_000_000_000, 0.0),
])
def test_seconds_since_1970_are_told_by_their_digits(tmp_path, begins, ticks_per_s, first_s):
    rows = "\n".join(f"{begins + 10 * k * ticks_per_s},{20 + k / 4}" for k in range(30))
    log = read_log(_write(tmp_path, f"time,temp_C\n{rows}\n"))
    assert log.time_s[0] == first_s
    assert np.diff(log.time_s) == pytest.approx([10.0] * 29, abs=1e-6)


@pytest.mark.parametrize(("dates", "is_either"), [
    (["03/04/2026", "03/05/2026"], True),  # 3 April and 3 May, or 4 and 5 March
    (["12/04/2026", "12/05/2026"], True),  # there is a twelfth month
    (["13/04/2026", "14/04/2026"], False),  # there is no thirteenth
    (["12/04/2026", "13/04/2026"], False),  # one date that can be read in one way alone tells how all are
    (["03/04/2026", "03/04/2026"], False),  # one day: the elapsed time is the same in either
    (["2026-04-03", "2026-05-03"], False),
])
def test_slashed_dates_are_refused_where_they_can_be_read_either_way(dates, is_either):
    assert is_day_or_month(f"{date} 10:00:00" for date in dates) is is_either


def test_a_cell_of_a_million_characters_is_not_searched_for_names_for_hours(tmp_path):
    # found by tests/bench/fuzz.py: `temp\w* ?set` tries every "temp" to the end of the cell
    path = tmp_path / "log.txt"
    path.write_text("time_s temp_C " + "temp" * 300_000 + "\n" + "".join(f"{10 * k} {20 + k} 7\n" for k in range(30)))
    log = read_log(path)
    assert log.temperature_degC.tolist() == [20.0 + k for k in range(30)]


def test_a_column_that_is_named_and_never_filled_is_left_out(tmp_path):
    # LabVIEW writes a comment's name above, and no cell below it
    rows = [f"{k}\t{22 + 0.1 * k:.2f}\t{60 if k > 20 else 0}" for k in range(60)]
    path = tmp_path / "a.tsv"
    path.write_text("\n".join(["time_s\ttemp_C\tpower_pct\tComment", *rows]))
    log = read_log(path)
    assert (len(log.time_s), log.temperature_degC[10], log.power_pct[30]) == (60, 23.0, 60.0)
    assert "No row has cells for 'Comment'." in log.repairs
    path.write_text("\n".join(["No\ttime_s\ttemp_C\tpower_pct", *rows]))  # which column lacks, nobody can tell
    with pytest.raises(LogError, match="4 cells in this row; expected 3 as in line 2"):
        read_log(path)


@pytest.mark.parametrize(("name", "content"), [
    ("a.mat", b"MATLAB 5.0 MAT-file, cut off"), ("a.xlsx", b"PK\3\4 cut off"), ("a.gz", b"\x1f\x8b\x08"), ("a.json", b'{"a":')])
def test_a_file_of_a_known_format_that_is_cut_off_is_refused(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"damaged|JSON without records|needs python-calamine"):
        read_log(path)


@pytest.mark.parametrize("end", ["", "\t"])
def test_the_table_of_a_labview_file_without_its_header_has_seconds(tmp_path, end):
    """The specification of .lvm files has X_Value as the time in seconds, and Comment as the last column of every segment."""
    path = tmp_path / "a.tsv"
    rows = [f"{4 * k}\t{22 + 0.1 * k:.2f}\t{60 if k > 20 else 0}{end}" for k in range(60)]
    path.write_text("\n".join(["X_Value\tT1\tHeater\tComment", *rows]) + "\n")
    log = read_log(path)
    assert (log.time_s[-1], log.temperature_degC[10], log.power_pct[30]) == (236.0, 23.0, 60.0)
    assert "Measurement of LabVIEW: 1 segment read, X_Value in seconds." in log.repairs
    assert "time" not in log.taken.assumed
    path.write_text("\n".join(["X_Value\tT1\tHeater", *(row.rstrip("\t") for row in rows)]) + "\n")  # any program's
    with pytest.raises(LogError, match="the file has no time column; expected --log-interval"):
        read_log(path)
