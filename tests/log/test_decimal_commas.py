"""Decimal commas in a file that separates its cells by commas."""

import math

import pytest

from heatertune.errors import LogError
from heatertune.log import read_log

HEADER = "Zeit [s],Temperatur [°C],Leistung [%]"
ROWS = [(2 * k, 20.0 + 30.0 * (1.0 - math.exp(-max(k - 10, 0) / 40.0)), 0 if k < 10 else 60) for k in range(120)]


def text(form, header=HEADER):
    lines = [form.format(*row).replace(".", ",") for row in ROWS]
    return ("\n".join([*([header] if header else []), *lines]) + "\n").encode()


@pytest.mark.parametrize("form", ["{:.1f},{:.1f},{:.1f}", "{},{:.2f},{:.1f}", "{},{:.2f},{}", "{:.2f},{:.1f},{}"])
def test_the_names_tell_how_many_cells_are_decimals(form):
    log = read_log("log.csv", content=text(form))
    assert log.time_s.tolist() == [row[0] for row in ROWS]
    assert max(abs(log.temperature_degC - [row[1] for row in ROWS])) <= 0.05 + 1e-9
    assert log.power_pct.tolist() == [row[2] for row in ROWS]
    assert any("also separate the cells" in repair for repair in log.repairs)


def test_without_names_they_are_asked_for_and_the_answer_works():
    content = text("{},{:.2f},{}", header="")
    with pytest.raises(LogError, match="--decimal-comma 2"):
        read_log("log.csv", content=content)
    log = read_log("log.csv", content=content, decimal_comma="2")
    assert abs(log.temperature_degC[-1] - ROWS[-1][1]) < 0.01
    again = read_log("log.csv", content=content, **log.taken.reading)
    assert again.temperature_degC.tolist() == log.temperature_degC.tolist()


def test_names_of_columns_are_as_good_as_numbers_and_others_are_refused():
    content = text("{},{:.2f},{}")
    assert read_log("log.csv", content=content, decimal_comma="Temperatur [°C]").power_pct.max() == 60.0
    with pytest.raises(LogError, match=r"no column of decimal commas.*'Druck'"):
        read_log("log.csv", content=content, decimal_comma="Druck")


def test_numbers_with_points_are_left_alone():
    content = ("\n".join([HEADER, *(f"{t},{y:.2f},{u}" for t, y, u in ROWS)]) + "\n").encode()
    log = read_log("log.csv", content=content)
    assert not any("also separate" in repair for repair in log.repairs)
