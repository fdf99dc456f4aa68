"""The unit of time, temperature and power: by name, by cells, by option, by the range reached; else it is assumed."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heatertune.errors import LogError
from heatertune.log import read_log
from heatertune.log.log_values import LogSignal
from heatertune.log.quantities import is_scaled, unit_in_name
from heatertune.settings import ReadSettings

#: one heater in s, °C and % of full power: at rest at 22 °C, then a rise
TIME_S = 1.0 * np.arange(60)
TEMPERATURE_DEGC = np.where(TIME_S < 10, 22.0, 22.0 + 0.3 * (TIME_S - 10))
POWER_PCT = np.where(TIME_S < 10, 0.0, 60.0)

#: unit → what one s, °C or % is in it
TIMES = {"s": lambda t: t, "ms": lambda t: 1000.0 * t, "min": lambda t: t / 60.0, "h": lambda t: t / 3600.0}
TEMPERATURES = {
    "degC": lambda y: y, "degF": lambda y: 32.0 + 1.8 * y, "0.1degC": lambda y: np.round(10.0 * y),
    "0.01degC": lambda y: np.round(100.0 * y), "0.1degF": lambda y: np.round(320.0 + 18.0 * y),
}
POWERS = {100.0: lambda u: u, 255.0: lambda u: np.round(2.55 * u), 1.0: lambda u: u / 100.0, 190.0: lambda u: 1.9 * u,
          27648.0: lambda u: np.round(276.48 * u), 1000.0: lambda u: 10.0 * u}


def log_of(time=TIME_S, temperature=TEMPERATURE_DEGC, power=POWER_PCT, head="t_s,temp_C,power_pct", form="{:.6f}", **options):
    rows = [",".join(form.format(cell) if isinstance(cell, float) else cell for cell in row)
            for row in zip(time, temperature, power, strict=True)]
    return read_log(io.StringIO("\n".join([head, *rows]) + "\n"), **options)


def is_true(log):
    """Whether a log is of the heater above."""
    return (np.allclose(log.time_s, TIME_S, atol=0.01) and np.allclose(log.temperature_degC, TEMPERATURE_DEGC, atol=0.1)
            and np.allclose(log.power_pct, POWER_PCT, atol=0.3))


@pytest.mark.parametrize(("name", "unit"), [
    *((name, unit) for unit in ("s", "ms", "min", "h") for name in (f"time [{unit}]", f"time_{unit}", f"t ({unit})", f"Time/{unit}")),
    ("millis", "ms"), ("seconds", "s"), ("Seconds since start", "s"), ("elapsedSeconds", "s"), ("timeMs", "ms"),
    ("Zeit in Minuten", "min"), ("time in hours from the start", "h"), ("Millisekunden", "ms"), ("Time (sec)", "s"),
])
def test_a_name_is_evidence_of_the_unit_of_the_time(name, unit):
    log = log_of(time=TIMES[unit](TIME_S), head=f"{name},temp_C,power_pct", form="{:.9f}")
    assert is_true(log)
    assert not log.taken.assumed


@pytest.mark.parametrize("unit", TIMES)
@pytest.mark.parametrize("name", ["Time", "Timestamp", "t", "X time", "elapsed", "time [10 ms]", "time x10"])
def test_a_time_without_evidence_is_assumed_until_its_unit_is_stated(name, unit):
    asked = {"time": TIMES[unit](TIME_S), "head": f"{name},temp_C,power_pct", "form": "{:.9f}"}
    assert set(log_of(**asked).taken.assumed) == {"time"}
    stated = log_of(**asked, time_unit=unit)
    assert is_true(stated)
    assert not stated.taken.assumed
    assert not log_of(**asked, sample_time_s=1.0).taken.assumed


@pytest.mark.parametrize(("unit", "likely"), [("s", "s"), ("ms", "ms"), ("min", "min")])
def test_the_likeliest_unit_of_the_time_is_proposed(unit, likely):
    log = log_of(time=TIMES[unit](TIME_S), head="Time,temp_C,power_pct", form="{:.9f}")
    assert log.taken.assumed == {"time": f"--time-unit {likely}"}


@pytest.mark.parametrize("time", [
    [f"2026-03-01 10:{s // 60:02d}:{s % 60:02d}" for s in range(60)], [f"10:{s // 60:02d}:{s % 60:02d}" for s in range(60)],
    [f"{1.7e9 + s:.0f}" for s in range(60)], [f"{1.7e12 + 1e3 * s:.0f}" for s in range(60)],
])
def test_stamps_and_the_digits_of_a_calendar_are_evidence(time):
    assert not log_of(time=time, head="Time,temp_C,power_pct").taken.assumed


def test_a_counter_of_milliseconds_is_no_calendar_after_weeks():
    # 1.7e9 ms are 20 days: as seconds since 1970 its rows would be 1000 s apart
    assert log_of(time=1.7e9 + 1000.0 * TIME_S, head="Time,temp_C,power_pct").taken.assumed["time"] == "--time-unit ms"


@pytest.mark.parametrize("unit", TEMPERATURES)
def test_a_temperature_is_assumed_unless_it_starts_at_a_room_s_in_one_unit_alone(unit):
    asked = {"temperature": TEMPERATURES[unit](TEMPERATURE_DEGC), "head": "t_s,T1,power_pct"}
    if unit in ("0.01degC", "0.1degF"):  # 2200 and 716: no heater begins there in °C
        with pytest.raises(LogError, match="--temperature-unit"):
            log_of(**asked)
    else:
        assumed = log_of(**asked).taken.assumed
        assert assumed == ({} if unit == "degC" else {"temperature": f"--temperature-unit {unit}"})
    stated = log_of(**asked, temperature_unit=unit)
    assert is_true(stated)
    assert not stated.taken.assumed


@pytest.mark.parametrize("first", [-20.0, 5.0, 12.0, 40.0, 72.0, 150.0, 220.0])
def test_a_temperature_that_starts_elsewhere_is_assumed(first):
    assert "temperature" in log_of(temperature=TEMPERATURE_DEGC - 22.0 + first, head="t_s,PV,power_pct").taken.assumed


@pytest.mark.parametrize("temperature", [TEMPERATURE_DEGC[::-1] - 12.0, 2.0 * TEMPERATURE_DEGC[::-1] - 20.0])
def test_a_temperature_that_falls_from_a_room_s_may_be_a_cold_store_s_in_degF(temperature):
    assert 15.0 <= temperature[0] <= 60.0
    assert "temperature" in log_of(temperature=temperature, head="t_s,PV,power_pct").taken.assumed


@pytest.mark.parametrize("name", ["Temp_x10", "T_C_x10", "PV [0.1 °C]", "TempX10", "temp /10", "temperature_decideg", "Temp x100"])
def test_a_name_of_a_multiple_contradicts_its_unit(name):
    assert is_scaled("temperature", name)
    assert "temperature" in log_of(head=f"t_s,{name},power_pct").taken.assumed
    assert not log_of(head=f"t_s,{name},power_pct", temperature_unit="degC").taken.assumed


@pytest.mark.parametrize("name", ["Temp [°C]", "T1 (C)", "Temperature (centigrade)", "temp_c", "PV [decimal]", "Box 10 temp C"])
def test_other_names_are_of_no_multiple(name):
    assert not is_scaled("temperature", name)


@pytest.mark.parametrize("full_scale", POWERS)
@pytest.mark.parametrize("name", ["power", "heater", "OP", "duty", "PWM", "Power [W]", "output raw"])
def test_a_power_without_evidence_is_assumed_or_refused_until_its_full_scale_is_stated(name, full_scale):
    asked = {"power": POWERS[full_scale](POWER_PCT), "head": f"t_s,temp_C,{name}"}
    refused = (asked["power"].max() > 100.0 or asked["power"].max() <= 1.0 or name in ("Power [W]", "output raw")
               or (name == "PWM" and not np.any(asked["power"] % 1.0)))
    if refused:
        with pytest.raises(LogError, match="--power-full-scale"):
            log_of(**asked)
    else:
        assert "power" in log_of(**asked).taken.assumed
    stated = log_of(**asked, power_full_scale=full_scale)
    assert is_true(stated)
    assert not stated.taken.assumed


@pytest.mark.parametrize(("name", "assumed"), [
    ("power", False), ("heater", False), ("OP", False), ("power_x10", True), ("power_pct_x10", True), ("power ‰", True),
])
def test_a_power_that_reaches_0_and_100_is_in_percent_unless_its_name_contradicts(name, assumed):
    # a controller that is limited at both ends; three steps to 0, 100 and 30 may be counts of 255, as of analogWrite(100)
    log = log_of(power=np.clip(130.0 - 3.0 * TIME_S, 0.0, 100.0), head=f"t_s,temp_C,{name}")
    assert ("power" in log.taken.assumed) == assumed


def test_a_column_named_in_percent_that_holds_shares_is_asked_for():
    with pytest.raises(LogError, match=r"a fraction or percent.*--power-full-scale"):
        log_of(power=POWER_PCT / 100.0)
    assert is_true(log_of(power=POWER_PCT / 100.0, power_full_scale=1.0))


@pytest.mark.parametrize("cells", [["ON" if u else "OFF" for u in POWER_PCT], [f"{u:.0f}%" for u in POWER_PCT], [f"{u:.0f} %" for u in POWER_PCT]])
def test_cells_are_evidence_of_the_power(cells):
    assert not log_of(power=cells, head="t_s,temp_C,heater").taken.assumed


def test_cells_are_evidence_of_the_temperature():
    cells = [f"{2.0 * y:.1f} °C" for y in TEMPERATURE_DEGC]
    assert not log_of(temperature=cells, head="t_s,PV,power_pct").taken.assumed


def test_a_table_of_pandas_shows_its_units_by_its_index_and_its_names():
    pandas = pytest.importorskip("pandas")
    columns = {"temperature": TEMPERATURE_DEGC, "power_pct": POWER_PCT}
    for index in (pandas.date_range("2026-03-01", periods=60, freq="s"), pandas.to_timedelta(TIME_S, unit="s")):
        log = read_log(pandas.DataFrame(columns, index=index))
        assert np.allclose(log.time_s, TIME_S)
        assert not log.taken.assumed
    assert not read_log(pandas.DataFrame({"time_s": TIME_S, **columns})).taken.assumed
    delta = pandas.DataFrame({"time": pandas.to_timedelta(TIME_S, unit="s"), **columns})
    assert np.allclose(read_log(delta).time_s, TIME_S)
    assert not read_log(delta).taken.assumed
    assert "time" in read_log(pandas.DataFrame({"time": 60.0 * TIME_S, **columns})).taken.assumed


def test_the_built_in_tables_hold_their_units():
    for name in ("table3", "table4"):
        assert not read_log(name).taken.assumed


def test_the_options_that_are_proposed_leave_nothing_assumed():
    log = log_of(time=TIMES["min"](TIME_S), temperature=TEMPERATURES["0.1degC"](TEMPERATURE_DEGC), head="Time,T,Heater")
    assert set(log.taken.assumed) == {"time", "temperature", "power"}
    words = " ".join(log.taken.assumed.values()).split()
    stated = {flag.removeprefix("--").replace("-", "_"): value for flag, value in zip(words[::2], words[1::2], strict=True)}
    stated["power_full_scale"] = float(stated["power_full_scale"])
    again = log_of(time=TIMES["min"](TIME_S), temperature=TEMPERATURES["0.1degC"](TEMPERATURE_DEGC), head="Time,T,Heater",
                   settings=ReadSettings(**stated))
    assert is_true(again)
    assert not again.taken.assumed


@settings(max_examples=60, deadline=None)
@given(st.floats(0.02, 900.0), st.sampled_from(sorted(TIMES)), st.sampled_from(["Time", "t", "Timestamp"]))
def test_no_time_without_a_unit_is_taken_in_silence(interval_s, unit, name):
    log = log_of(time=TIMES[unit](interval_s * TIME_S), head=f"{name},temp_C,power_pct", form="{:.12f}")
    assert "time" in log.taken.assumed


def test_a_unit_in_full_counts_wherever_it_stands_but_not_beside_another():
    assert unit_in_name("time", "minutes after switching on") == "min"
    assert unit_in_name("time", "time in minutes and seconds") != "min"


@pytest.mark.long
@settings(max_examples=300, deadline=None)
@given(
    st.sampled_from(["s", "ms", "min", "h", "day"]), st.sampled_from(["degC", "degF", "K", "0.1degC", "0.01degC", "0.1degF", "0..27648"]),
    st.sampled_from([100.0, 255.0, 1.0, 190.0, 1000.0, 4095.0, 27648.0, 32767.0]), st.booleans(), st.floats(15.0, 35.0),
    st.floats(5.0, 400.0), st.sampled_from([0.5, 1.0, 2.0, 10.0, 60.0]), st.floats(3.0, 95.0), st.floats(0.0, 1.0))
def test_what_is_read_is_true_or_assumed_or_refused(time_unit, temperature_unit, full_scale, named, ambient, rise, interval, level, begun):
    # a heater that heats up, from rest or in the middle of it, its columns named with their unit or without
    time = interval * np.arange(80)
    temperature = ambient + rise * (1.0 - np.exp(-np.maximum(time - 10.0 * interval, -time[-1] * (begun > 0.9)) / (20.0 * interval)))
    temperature = np.where(time < 10.0 * interval, np.maximum(temperature, ambient), temperature)
    power = np.where(time < 10.0 * interval, 0.0, level)
    times = {**TIMES, "day": lambda t: t / 86400.0}
    temperatures = {**TEMPERATURES, "K": lambda y: y + 273.15, "0..27648": lambda y: np.round(27.648 * y)}
    names = {"s": "time [s]", "ms": "time_ms", "min": "t (min)", "h": "Time [h]", "day": "time [days]", "degC": "T [°C]", "degF": "temp_F",
             "K": "T (K)", 100.0: "power [%]", 255.0: "PWM 0-255", 1.0: "power 0..1"}
    bare = ("Time", "Temperature", "Power")
    head = ",".join(names.get(unit, other) if named else other
                    for unit, other in zip((time_unit, temperature_unit, full_scale), bare, strict=True))
    try:
        log = log_of(times[time_unit](time), temperatures[temperature_unit](temperature), power / 100.0 * full_scale, head=head, form="{:.12f}")
    except LogError as refused:
        log, message = None, str(refused)
    if log is None:
        assert any(option in message for option in ("--time-unit", "--temperature-unit", "--power-full-scale"))
        return
    known = {"time", "temperature", "power"} - set(log.taken.assumed)
    assert "time" not in known or np.allclose(np.diff(log.time_s), interval, rtol=1e-3)
    assert "temperature" not in known or np.allclose(log.temperature_degC, temperature, atol=0.1)
    assert "power" not in known or np.allclose(log.power_pct, power, atol=0.1)


def test_a_heater_may_pass_the_value_that_an_open_sensor_gives():
    # 1024 is what a MAX6675 gives without a sensor; a kiln in 1 °C, or an oven in 0.1 °C, passes it on its way
    values = np.round(np.linspace(900.0, 1100.0, 101))
    values[62] = 1024.0
    head = "time [s],T [°C],power [%]"
    passed = log_of(np.arange(101.0), values, np.full(101, 50.0), head=head)
    assert np.array_equal(passed.temperature_degC, values)
    values[20:23] = 1024.0
    left = log_of(np.arange(101.0), values, np.full(101, 50.0), head=head)
    assert np.array_equal(left.temperature_degC, np.delete(values, [20, 21, 22]))
    # open while the heater goes on from 1012 to 1026 °C: 1024 lies between, but no step of this log is as large as 12 °C
    values[57:63] = 1024.0
    left = log_of(np.arange(101.0), values, np.full(101, 50.0), head=head)
    assert np.array_equal(left.temperature_degC, np.delete(values, [20, 21, 22, *range(57, 63)]))


def test_a_factor_of_the_temperature_is_the_users_and_is_repeated(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time_s,PV_x10,SP_x10,OP [%]\n" + "\n".join(f"{k},{203 + 2 * k},600,60" for k in range(40)))
    log = read_log(path, temperature_scale=0.1)
    assert log.temperature_degC.tolist() == pytest.approx([20.3 + 0.2 * k for k in range(40)])
    assert set(log.setpoint_degC) == {60.0}
    assert "temperature" not in log.taken.assumed  # it starts at a room's temperature once it is scaled
    again = read_log(path, **log.taken.reading)
    assert again.temperature_degC.tolist() == log.temperature_degC.tolist()
    fahrenheit = read_log(path, temperature_scale=0.2, temperature_unit="degF")
    assert fahrenheit.temperature_degC[0] == pytest.approx((40.6 - 32) / 1.8)


@pytest.mark.parametrize(("name", "full"), [
    ("Output (0-4095)", "4095"), ("Out [0…27648]", "27648"), ("H-bridge output [-255...255]", "255"), ("Heat (0 to 1000)", "1000"),
    ("OP [-100...50]", None), ("Heater (0-3)", None), ("Heating (0-300)", None), ("Heater [0-10 V]", None), ("out (4-20)", None),
])
def test_the_range_in_a_powers_name_is_its_full_scale_where_devices_have_such_a_one(name, full):
    assert unit_in_name("power", name) == full


@pytest.mark.parametrize(("per_second", "unit"), [(1.0, "s"), (1e3, "ms"), (1 / 60.0, "min"), (1 / 3600.0, "h"), (1 / 86400.0, "d")])
def test_a_time_whose_interval_is_round_in_one_unit_is_proposed_in_it(per_second, unit):
    rows = "\n".join(f"{2 * k * per_second!r},{25 + min(k, 60) / 4},{60 if k > 9 else 0}" for k in range(100))
    log = read_log("log.csv", content=f"elapsed,Temp [°C],Power [%]\n{rows}\n".encode(), time_column="elapsed")
    assert log.taken.assumed == {"time": f"--time-unit {unit}"}


def test_a_recorders_channel_whose_name_says_nothing_but_degrees_is_the_temperature():
    rows = "\n".join(f"{2 * k},{25 + min(k, 60) / 4},{60 if k > 9 else 0},{k % 7}" for k in range(100))
    header = "time [s],CH0001 [C],CH0002 [%],CH0003"
    log = read_log("dx.csv", content=f"{header}\n{rows}\n".encode(), power_column="CH0002")
    assert log.taken.columns["temperature"] == ("'CH0001 [C]'", "°C")
    with pytest.raises(LogError, match="no column is a temperature"):  # two of them: which is the heater's?
        read_log("dx.csv", content=f"{header} [C]\n{rows}\n".encode(), power_column="CH0002")


def test_a_signal_shows_its_unit_with_the_evidence_that_the_file_does_not_say():
    values = TIME_S
    assert LogSignal(values, "degC", "°C").written == "°C"
    assert LogSignal(values, "degC", "°C", "from a room's temperature").written == "°C, from a room's temperature"
    assert LogSignal(values, "degC", "°C", "").written == "°C, assumed"
    assert LogSignal(values, "27648.0", "0…27648").full_scale == 27648.0


@pytest.mark.parametrize(("powers", "assumed"), [
    ([0] * 40 + [100] * 160, True),  # a step to 100 counts of 255, or to full power?
    ([0] * 40 + [50] * 60 + [100] * 100, True),
    ([100 * (k // 10 % 2) for k in range(200)], False),  # a thermostat: it switches full power
    ([min(100, max(0, 130 - k)) for k in range(200)], False),  # a controller that is limited at 100 and at 0
])
def test_a_few_steps_up_to_a_hundred_are_no_evidence_of_percent(powers, assumed):
    rows = "\n".join(f"{2 * k},{25 + k / 10:.1f},{power}" for k, power in enumerate(powers))
    log = read_log("log.csv", content=f"time [s],Temp [°C],Output\n{rows}\n".encode())
    assert log.taken.assumed == ({"power": "--power-full-scale 100"} if assumed else {})


def test_an_empty_cell_beside_the_stated_word_for_on_is_no_power_that_is_off(tmp_path):
    path = tmp_path / "oven.csv"
    words = ["kalt"] * 10 + ["glut"] * 20 + [""] + ["glut"] * 20 + ["kalt"] * 49  # the heater's state in row 31 is unknown
    rows = [f"{5 * k},{20.0 + 0.2 * min(k, 50):.1f},{word}" for k, word in enumerate(words)]
    path.write_text("\n".join(["time_s,temperature_C,heizung", *rows]) + "\n", encoding="utf-8")
    log = read_log(path, ReadSettings(power_on="glut"))
    assert len(log.time_s) == 99
    assert 150.0 not in log.time_s
    assert log.power_pct[29:31].tolist() == [100.0, 100.0]
    assert "1 row without a power left out (line 32)." in log.repairs


def fahrenheit(value):
    return 32.0 + 1.8 * value


@pytest.mark.parametrize(("temperature", "power"), [
    (lambda _, y: f"{y:.2f} °C", lambda _, u: f"{u:g} %"), (lambda _, y: f"{fahrenheit(y):.2f}°F", lambda _, u: f"{u:g}%"),
    (lambda _, y: f"{y:.2f} [°C]", lambda _, u: f"{u:g} [%]"), (lambda _, y: f"{y:.2f} Celsius", lambda _, u: f"{u:g} percent"),
    (lambda _, y: f"{y:.2f} Â°C", lambda _, u: f"{u:g} Prozent"), (lambda _, y: f"{y:.2f} \ufffdC", lambda _, u: f"{u:g} %"),
    (lambda k, y: f"{y:.2f} °C" if k % 3 else f"{y:.2f}", lambda k, u: f"{u:g} %" if k % 4 else f"{u:g}"),
    (lambda k, y: f"{y:.2f} °C" if k % 2 else f"{fahrenheit(y):.2f} °F", lambda _, u: f"{u:g} %"),
    (lambda k, y: f"{y:.2f} °C" if k < 30 else f"{y + 273.15:.2f} K", lambda _, u: f"{u:g} %"),
])
def test_units_in_the_cells_are_read_in_their_notations(temperature, power):
    log = log_of(temperature=[temperature(k, y) for k, y in enumerate(TEMPERATURE_DEGC)],
                 power=[power(k, u) for k, u in enumerate(POWER_PCT)], head="t_s,Temp,Heater")
    assert is_true(log)
    assert not log.taken.assumed


def test_cells_in_two_units_and_cells_without_one_are_told():
    halves = [f"{y:.2f} °C" if k % 2 else f"{fahrenheit(y):.2f} °F" for k, y in enumerate(TEMPERATURE_DEGC)]
    assert any("in °C and °F; all were converted" in note for note in log_of(temperature=halves, head="t_s,Temp,power_pct").repairs)
    some = [f"{y:.2f} °C" if k % 2 else f"{y:.2f}" for k, y in enumerate(TEMPERATURE_DEGC)]
    assert any("30 cells of column 'Temp' without a unit read in °C" in note
               for note in log_of(temperature=some, head="t_s,Temp,power_pct").repairs)


def test_numbers_of_another_tag_have_no_unit_of_a_temperature():
    rows = [row for t, y, u in zip(TIME_S, TEMPERATURE_DEGC, POWER_PCT, strict=True)
            for row in (f"{t},Temp,{y:.2f} °C", f"{t},Heater [%],{u}")]
    assert is_true(read_log(io.StringIO("\n".join(["time_s,tag,value", *rows]) + "\n")))


def test_a_name_and_cells_of_two_units_are_a_question_whose_answer_works():
    cells = [f"{fahrenheit(y):.2f} °F" for y in TEMPERATURE_DEGC]
    with pytest.raises(LogError, match=r"named in degC whose cells are in .* --temperature-unit degF if the cells are right"):
        log_of(temperature=cells, head="t_s,Temp [°C],power_pct")
    assert is_true(log_of(temperature=cells, head="t_s,Temp [°C],power_pct", temperature_unit="degF"))


@pytest.mark.parametrize("first_row", [8, 29, 50])
def test_a_clock_that_is_set_years_later_makes_two_runs(first_row):
    """A device that begins in 1970 until it has the time: 1 January 1970 and 14 March 2026 are 56 years apart.

    The power moves at row 10 and stands from then on: of the runs from row 29 on the longer one could not be fitted.
    """
    stamps = [f"{'1970-01-01' if k < first_row else '2026-03-14'} 10:00:{k:02d}" for k in range(60)]
    log = log_of(time=stamps, head="Time,temp_C,power_pct")
    rows = slice(0, first_row) if first_row >= 10 else slice(first_row, None)
    assert log.temperature_degC == pytest.approx(TEMPERATURE_DEGC[rows], abs=1e-5)
    assert log.time_s[-1] - log.time_s[0] == len(TEMPERATURE_DEGC[rows]) - 1
    if first_row == 29:
        assert any("clock jumps by years; the file holds 2 runs" in note and "run 1 was read, the longest in which the power moves: "
                   "--run" in note for note in log.repairs)
        assert len(log_of(time=stamps, head="Time,temp_C,power_pct", run=2).time_s) == 31


def watts(power_pct):
    """Cells of a heater of 2000 W with commas in thousands."""
    return [f"{20.0 * u:,.0f} W" for u in power_pct]


def test_commas_of_thousands_that_separate_cells_are_joined_by_the_count_of_cells():
    power_pct = np.where(TIME_S < 30, POWER_PCT, 42.5)  # 0 W, 1,200 W, 850 W: 4 cells in rows 10 to 29, 3 in the others
    log = log_of(power=watts(power_pct), head="t_s,temp_C,Heater", power_full_scale=2000.0)
    assert np.allclose(log.temperature_degC, TEMPERATURE_DEGC, atol=1e-5)
    assert np.allclose(log.power_pct, power_pct)
    assert "each two cells of 20 rows were joined" in " ".join(log.repairs)


def test_a_comma_that_may_mark_decimals_joins_no_cells():
    with pytest.raises(LogError, match="4 cells in this row"):  # 0 kW and 1,125 kW, or 1125 kW
        log_of(power=["1,125 kW" if 9 < k < 20 else "0 kW" for k in range(60)], head="t_s,temp_C,Heater")


@pytest.mark.parametrize("cell", ["{:.0f} W", "{:.1f} W"])
def test_a_power_in_percent_and_watts_by_turns_needs_its_watts_at_full_power(cell):
    power = [f"{u:g} %" if k % 2 else cell.format(20.0 * u) for k, u in enumerate(POWER_PCT)]
    with pytest.raises(LogError, match=r"others in W.* --power-full-scale with the reading in W at 100 %"):
        log_of(power=power, head="t_s,temp_C,Heater")
    log = log_of(power=power, head="t_s,temp_C,Heater", power_full_scale=2000.0)
    assert is_true(log)
    assert "power" not in log.taken.assumed


@pytest.mark.parametrize("unit", [" °C", "°C", ""])
@pytest.mark.parametrize("bad", ["####", "Err", "??"])
def test_a_damaged_cell_costs_its_row_with_units_in_the_cells_as_without(unit, bad):
    cells = [bad if k == 20 else f"{y:.6f}{unit}" for k, y in enumerate(TEMPERATURE_DEGC)]
    log = log_of(temperature=cells, head="t_s,Temp [°C],power_pct")
    assert np.allclose(log.temperature_degC, np.delete(TEMPERATURE_DEGC, 20), atol=1e-5)


def test_thousands_in_groups_are_read_in_two_units():
    cells = [f"{1000.0 + y:,.2f} °C" if k % 2 else f"{32.0 + 1.8 * (1000.0 + y):,.2f} °F" for k, y in enumerate(TEMPERATURE_DEGC)]
    log = log_of(temperature=[f'"{cell}"' for cell in cells], head="t_s,Temp,power_pct")
    assert np.allclose(log.temperature_degC, 1000.0 + TEMPERATURE_DEGC, atol=0.01)


def test_words_of_a_switch_in_a_long_table_leave_the_other_cells_their_unit():
    rows = [row for k, y in enumerate(TEMPERATURE_DEGC) for row in (
        f"2026-03-14 10:00:{k:02d},Oven,{y:.3f} °C", f"2026-03-14 10:00:{k:02d},Board Temperature,41.2 °C",
        *([f"2026-03-14 10:00:{k:02d},Element,{'ON' if k else 'OFF'}"] if k in (0, 10) else []))]
    log = read_log(io.StringIO("\n".join(["time,name,value", *rows]) + "\n"))
    assert np.allclose(log.temperature_degC, TEMPERATURE_DEGC, atol=1e-3)
