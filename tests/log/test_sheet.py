"""Columns of cells against lists of texts, which hold the same without sparing memory; and how much a long log takes."""

import random
import sys
import tracemalloc

import numpy as np
import pytest

from heatertune.cli import main
from heatertune.errors import LogError
from heatertune.log import read_log
from heatertune.log.sheet import CellColumn, Grid


def drawn(chance, number):
    """Draw cells: few different ones, all different, some of them empty, of many characters, with an end of line."""
    kind = chance.randrange(4)
    if kind == 0:
        return [chance.choice(["ON", "OFF", "", "20.5"]) for _ in range(number)]
    if kind == 1:
        return [f"{k}.{chance.randrange(100)}" for k in range(number)]
    if kind == 2:
        return [chance.choice(["", "°C", "温度", "a\nb", f"{chance.random()}"]) for _ in range(number)]
    return [f"{k // 3000}" if k < number // 2 else f"x{k}" for k in range(number)]


@pytest.mark.parametrize("seed", range(12))
def test_a_column_is_the_list_of_its_cells(seed):
    chance = random.Random(seed)
    cells = drawn(chance, chance.choice([1, 2, 50, 5000, 9000]))
    column = CellColumn.of(cells)
    assert list(column) == cells
    assert len(column) == len(cells)
    assert column[-3:] == cells[-3:]
    assert column[0] == cells[0]
    assert set(column.kinds()) == set(cells)
    assert column.levels() == len(set(cells))
    assert column.has_text().tolist() == [cell != "" for cell in cells]
    assert column.holds(".") == any("." in cell for cell in cells)
    places = np.array([chance.randrange(len(cells)) for _ in range(100)])
    some = column.at_rows(places)
    assert list(some) == [cells[k] for k in places]
    assert some.levels() == len({cells[k] for k in places})
    assert list(some.map(str.upper)) == [cells[k].upper() for k in places]
    assert list(column.at_rows(slice(None, None, -1))) == cells[::-1]
    assert column.where(str.isdigit).tolist() == [cell.isdigit() for cell in cells]


def test_numbers_are_those_that_python_reads_in_a_log():
    assert CellColumn.of(["1", "2.5", "1e3"]).floats().tolist() == [1.0, 2.5, 1000.0]
    assert CellColumn.of(["1", "1_000"]).floats() is None
    assert CellColumn.of(["1", "Err"]).floats() is None


@pytest.mark.parametrize("seed", range(12))
def test_a_grid_is_the_list_of_its_rows(seed):
    chance = random.Random(seed)
    number, width = chance.choice([3, 60, 9000]), chance.randrange(1, 5)
    rows = [[f" {k}"] * (width if chance.random() < 0.9 else chance.randrange(1, 7)) for k in range(number)]
    plain = [[cell.strip() for cell in row] for row in rows]
    grid = Grid(iter(rows), width)
    assert list(grid) == plain
    assert grid[-5:] == plain[-5:]
    assert grid.whole().tolist() == [len(row) == width for row in plain]
    assert grid.find(plain[1]) == [1]
    kept = grid.whole() & (np.arange(number) > 0)
    assert [list(row) for row in zip(*grid.at_rows(kept), strict=True)] == [row for row in plain[1:] if len(row) == width]
    grid.cut(2)
    assert list(grid) == [row[:2] for row in plain]


def test_rows_that_become_as_wide_as_most_by_their_empty_ends_are_rows_like_others(tmp_path):
    lines = ["time [s],temperature [°C],power [%]"] + [f"{k},{20 + k},50" + ("," if k % 3 == 0 else "") for k in range(90)]
    log = read_log("log.csv", content="\n".join(lines).encode())
    assert log.time_s.tolist() == list(range(90))
    assert log.temperature_degC.tolist() == [20.0 + k for k in range(90)]


def long_log(columns):
    """Write 100,000 rows of a heater that steps."""
    header = ["time [s],temperature [°C],power [%]", *(f"x{i}" for i in range(columns))]
    lines = [",".join(header)]
    for k in range(100_000):
        more = "".join(f",{(k * 7919 + i) % 9973 / 100:.2f}" for i in range(columns))
        lines.append(f"{k},{40 + (k % 1200 if k % 1200 < 600 else 1200 - k % 1200) / 30:.2f},{60 if k % 1200 < 600 else 20}{more}")
    return ("\n".join(lines) + "\n").encode()


@pytest.mark.parametrize("columns", [0, 20])
@pytest.mark.long(20)
def test_a_long_log_takes_twelve_times_its_size_and_few_calls_for_a_row(columns):
    content = long_log(columns)
    read_log("short.csv", content=content[:20_000])  # what is imported at the first reading is not the file's
    tracemalloc.start()
    try:
        log = read_log("long.csv", content=content)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(log.time_s) == 100_000
    assert most < 11 * len(content)  # the file itself is the twelfth
    # calls, which are the same on every machine, stand for the time, which is not; measured: 14.8 and 17.7
    assert calls_of(lambda: read_log("long.csv", content=content)) < 20 * 100_000


def calls_of(run):
    """Return how many functions of Python and of C a run calls."""
    calls = 0

    def count(frame, event, value):
        nonlocal calls
        calls += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        run()
    finally:
        sys.setprofile(before)
    return calls


def two_files(folder, damage):
    """Write a temperature and the power of the same heater in a file of its own."""
    first = ["time [s],temperature [°C]", *(f"{2 * k},{20 + min(k, 300) / 10:.1f}" for k in range(400))]
    second = ["time [s],power [%]", *(f"{20 * k},{40 if k % 7 else 10}" for k in range(40))]
    second[11] = damage
    (folder / "temperature.csv").write_text("\n".join(first) + "\n", encoding="utf-8")
    (folder / "power.csv").write_text("\n".join(second) + "\n", encoding="utf-8")
    return folder / "temperature.csv", folder / "power.csv"


def test_a_bad_cell_of_the_powers_file_is_told_with_that_file_and_its_line(tmp_path, capsys):
    temperature, power = two_files(tmp_path, "200,140")
    with pytest.raises(LogError) as refused:
        read_log(temperature, power_log=str(power))
    assert refused.value.file == str(power)
    assert refused.value.line == 12
    assert main(["read", str(temperature), "--power-log", str(power)]) == 2
    assert f"{power}, line 12" in capsys.readouterr().err


def test_a_row_whose_power_is_no_power_is_left_out_and_told_with_its_file(tmp_path):
    temperature, power = two_files(tmp_path, "201,4x")
    log = read_log(temperature, power_log=str(power))
    assert any(f"line 12 of {power}" in repair for repair in log.repairs), log.repairs


def test_a_power_that_its_file_samples_is_held_and_may_have_changed_since_the_sample_before(tmp_path):
    temperature, power = two_files(tmp_path, "200,40")
    log = read_log(temperature, power_log=str(power))
    # rows of 2 s; the power is 10 % for one sample of 20 s in seven, the first at 0 s
    assert log.power_pct.tolist() == [10.0 if (t // 20) % 7 == 0 else 40.0 for t in log.time_s]
    assert log.signals["power"].late_s == 20.0


def test_a_bad_power_of_a_long_table_is_told_with_its_own_line():
    rows = ["time,tag,value", *(f"2026-03-14 10:{k // 30:02}:{2 * (k % 30):02},{tag},{value}" for k in range(300)
                                for tag, value in (("oven temperature", f"{20 + k / 10:.1f}"), ("heater power", f"{40 + k % 3}")))]
    rows[200] = rows[200].replace(",40", ",400").replace(",41", ",400").replace(",42", ",400")
    with pytest.raises(LogError) as refused:
        read_log("tags.csv", content="\n".join(rows).encode(), power_full_scale=100.0)
    assert "heater power,400" in rows[200]
    assert refused.value.line == 201
