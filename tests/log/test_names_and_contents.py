"""Columns told by a name together with their contents: row names, the thing that is heated, an element, two of one name."""

import numpy as np
import pytest
from tests.bench import hostile_devices, hostile_exports, tool_exports

from heatertune.errors import LogError
from heatertune.log import read_log

ROWS = 60
TIME = 2.0 * np.arange(ROWS)
TEMPERATURE = 20.0 + 0.25 * np.maximum(np.arange(ROWS) - 10, 0) + 0.1 * (np.arange(ROWS) % 3)
POWER = np.where(np.arange(ROWS) < 10, 0, 60)
ARABIC = str.maketrans("0123456789.", "٠١٢٣٤٥٦٧٨٩٫")  # Unicode: U+0660 to U+0669, decimal separator U+066B
PERSIAN = str.maketrans("0123456789.", "۰۱۲۳۴۵۶۷۸۹٫")  # U+06F0 to U+06F9


def written(header, *columns):
    rows = (",".join(f"{cell:g}" for cell in row) for row in zip(*columns, strict=True))
    return "\n".join([header, *rows, ""])


def read(tmp_path, header, *columns, **options):
    path = tmp_path / "log.csv"
    path.write_text(written(header, *columns), encoding="utf-8")
    return read_log(path, **options)


@pytest.mark.parametrize("first", [0, 1])
def test_the_numbers_of_the_rows_need_no_name(tmp_path, first):
    # "If there is a header and the first row contains one fewer field than the number of columns, the first column in
    # the input is used for the row names": the manual of R, read.table
    log = read(tmp_path, "time [s],Temp [°C],Heater [%]", first + np.arange(ROWS), TIME, TEMPERATURE, POWER)
    assert log.time_s == pytest.approx(TIME)
    assert log.temperature_degC == pytest.approx(TEMPERATURE)
    assert log.power_pct == pytest.approx(POWER)


def test_a_name_that_is_missing_at_the_end_moves_no_column(tmp_path):
    # the first column counts the rows and is the time: what stands behind it is no clock
    with pytest.raises(LogError, match="3 cells in this row; expected 4"):
        read(tmp_path, "time [s],Temp [°C],Heater [%]", np.arange(ROWS), TEMPERATURE, POWER, np.full(ROWS, 3.5))


@pytest.mark.parametrize("name", ["oven", "Zone 1", "Ofen 2", "kiln"])
def test_the_only_other_column_with_the_name_of_what_is_heated_is_its_temperature(tmp_path, name):
    room = 21.0 + 0.1 * (np.arange(ROWS) % 2)
    log = read(tmp_path, f"Time [s],Ambient temp [°C],{name},Heater [%]", TIME, room, TEMPERATURE, POWER)
    assert log.temperature_degC == pytest.approx(TEMPERATURE)
    assert log.ambient_degC == pytest.approx(room)


def test_two_columns_that_may_be_the_temperature_are_a_question(tmp_path):
    with pytest.raises(LogError, match=r"no column is a temperature .*; expected --temperature-column"):
        read(tmp_path, "Time [s],Oven,CH2,Heater [%]", TIME, 45.0 - 0.4 * TEMPERATURE, TEMPERATURE, POWER)


@pytest.mark.parametrize(("header", "option"), [
    ("time [s],Temp [°C],Temp [°C],Heater [%]", "temperature_column"), ("time [s],Heater [%],Heater [%],Temp [°C]", "power_column")])
def test_two_columns_of_one_name_are_a_question_whose_answers_work(tmp_path, header, option):
    other = 50.0 - 10.0 * (np.arange(ROWS) % 5)
    columns = (TIME, TEMPERATURE, other, POWER) if option == "temperature_column" else (TIME, POWER, other, TEMPERATURE)
    with pytest.raises(LogError, match=f"--{option.replace('_', '-')} 2 or --{option.replace('_', '-')} 3"):
        read(tmp_path, header, *columns)
    for number in (2, 3):
        log = read(tmp_path, header, *columns, **{option: str(number)})
        taken = log.temperature_degC if option == "temperature_column" else log.power_pct
        assert taken == pytest.approx(columns[number - 1])


def test_two_equal_columns_of_one_name_are_one(tmp_path):
    log = read(tmp_path, "time [s],Temp [°C],Temp [°C],Heater [%]", TIME, TEMPERATURE, TEMPERATURE, POWER)
    assert log.temperature_degC == pytest.approx(TEMPERATURE)


def test_an_element_is_a_heater(tmp_path):
    log = read(tmp_path, "time [s],Temp [°C],Element", TIME, TEMPERATURE, POWER / 60, power_full_scale=1.0)
    assert log.power_pct == pytest.approx(100.0 * POWER / 60)


@pytest.mark.long
@pytest.mark.parametrize("export", [
    *hostile_exports.exports(), *hostile_exports.exports(writers=hostile_devices.WRITERS)], ids=lambda export: export.tool)
def test_no_hostile_export_is_read_into_another_heater(tmp_path, export):
    outcome, said = hostile_exports.outcome_of(export, tmp_path)
    assert outcome not in (hostile_exports.WRONG, hostile_exports.ACCUSED), said
    assert export.heater == tool_exports.OVEN


@pytest.mark.parametrize("header", [
    "data.time_s,data.temp_C,data.heater_pct",  # fields of a structure of MATLAB; "data" alone is Portuguese for a date
    "time [s],炉内温度(℃),ヒーター出力(％)",  # a percent sign of full width
    "time [s],PLC_PRG.rTemp,PLC_PRG.rHeatPct",
], ids=["fields of a structure", "full width", "names of a program"])
def test_names_of_tools_tell_roles_and_units(tmp_path, header):
    log = read(tmp_path, header, TIME, TEMPERATURE, POWER)
    assert log.time_s == pytest.approx(TIME)
    assert log.temperature_degC == pytest.approx(TEMPERATURE)
    assert log.power_pct == pytest.approx(POWER)
    assert "power" not in log.taken.assumed


def test_the_input_of_pid_compact_is_the_temperature_and_its_output_is_in_percent(tmp_path):
    # "Input: a variable of the user program is used as source for the process value", "Output: output value in REAL
    # format", limited to OutputUpperLimit [%]: Siemens, PID control, function manual
    log = read(tmp_path, "time [s],PID_Compact_1.Input,PID_Compact_1.Output", TIME, TEMPERATURE, POWER)
    assert log.temperature_degC == pytest.approx(TEMPERATURE)
    assert log.power_pct == pytest.approx(POWER)
    assert "power" not in log.taken.assumed


@pytest.mark.parametrize(("instant", "number"), [
    (lambda t: f"0.00:{int(t) // 60:02d}:{int(t) % 60:02d}", str),  # Microsoft, TimeSpan's constant format: d.hh:mm:ss
    (lambda t: str(t).translate(ARABIC), lambda value: str(value).translate(ARABIC)),
    (lambda t: str(t).translate(PERSIAN), lambda value: str(value).translate(PERSIAN)),
], ids=["days before a point", "Arabic digits", "Persian digits"])
def test_lengths_of_time_and_digits_of_other_writers_are_read(tmp_path, instant, number):
    rows = [",".join([instant(t), number(y), number(u)]) for t, y, u in zip(TIME, TEMPERATURE, POWER, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time [s],Temp [°C],Heater [%]", *rows, ""]), encoding="utf-8")
    log = read_log(path)
    assert log.time_s == pytest.approx(np.asarray(TIME) - TIME[0])
    assert log.temperature_degC == pytest.approx(TEMPERATURE)
    assert log.power_pct == pytest.approx(POWER)
