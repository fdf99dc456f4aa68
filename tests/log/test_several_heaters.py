"""Tables with rows of several heaters in turns: which of them is a question, and the answer reads that heater alone."""

import random

import pytest

from heatertune.errors import LogError
from heatertune.log import read_log

ROWS = 200
#: two heaters of one lag each, by their step responses
TRUE = {"A": [20.0 + 30.0 * (1.0 - 0.98 ** max(k - 20, 0)) for k in range(ROWS)],
        "B": [25.0 + 12.0 * (1.0 - 0.95 ** max(k - 60, 0)) for k in range(ROWS)]}


def rows(late_s=0.7, lose=()):
    """Return rows of time, name, temperature and power, of A and B in turns."""
    both = [(2.0 * k + late_s * (name == "B"), name, TRUE[name][k], 50 if k >= begin else 0)
            for k in range(ROWS) for name, begin in (("A", 20), ("B", 60))]
    return [row for k, row in enumerate(both) if k not in lose]


def table(path, head, lines):
    path.write_text("\n".join([head, *(",".join(map(str, line)) for line in lines)]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("late_s", [0.0, 0.7])
@pytest.mark.parametrize("column", ["heater", "zone", "device", "Heizung", "side"])
def test_a_column_that_names_the_heater_is_a_choice(tmp_path, column, late_s):
    path = table(tmp_path / "log.csv", f"time_s,{column},temp_C,power_pct", rows(late_s))
    with pytest.raises(LogError, match=rf"column '{column}' tells them apart \(A, B\); expected --tag A --tag-column {column} "):
        read_log(path)
    for name, true in TRUE.items():
        log = read_log(path, tag=name, tag_column=column)
        assert log.temperature_degC == pytest.approx(true)
        assert log.power_pct[[0, 199]].tolist() == [0.0, 50.0]


def test_a_long_table_of_two_devices_names_the_device_in_its_tags(tmp_path):
    lines = [line for t, name, y, u in rows(0.0) for line in ((t, name, "temperature_C", y), (t, name, "power_pct", u))]
    path = table(tmp_path / "log.csv", "time_s,device,field,value", lines)
    with pytest.raises(LogError, match=r"\(A/temperature_C, B/temperature_C\); expected --tag NAME"):
        read_log(path)
    assert read_log(path, tag="B/temperature_C", power_tag="B/power_pct").temperature_degC == pytest.approx(TRUE["B"])


def test_rows_in_turns_without_a_name_are_a_choice_and_a_lost_row_shifts_no_heater(tmp_path):
    path = table(tmp_path / "log.csv", "time_s,temp_C,power_pct", [(t, y, u) for t, _, y, u in rows(lose=(301, 350))])
    with pytest.raises(LogError, match=r'2 heaters .* in turns; expected --tag "1 of 2" .* or --tag-column none'):
        read_log(path)
    log = read_log(path, tag="1 of 2")
    assert log.temperature_degC == pytest.approx([y for k, y in enumerate(TRUE["A"]) if k != 175])
    assert any("rows are missing in 2 turns" in repair for repair in log.repairs)
    assert len(read_log(path, tag_column="none").time_s) == 2 * ROWS - 2


@pytest.mark.parametrize("seed", range(6))
def test_one_heater_is_no_several(tmp_path, seed):
    """Noise, wild readings, a relay's state and a setpoint of few levels name no second heater."""
    chance = random.Random(seed)
    lines = [(2 * k, ("idle", "heating")[k % 7 < 3], round(y + chance.gauss(0.0, 0.3), 1) if k % 31 else 999, 50 if k >= 20 else 0,
              (40, 50)[k > 90]) for k, y in enumerate(TRUE["A"])]
    log = read_log(table(tmp_path / "log.csv", "time_s,state,temp_C,power_pct,setpoint_C", lines))
    assert len(log.time_s) == ROWS - 7
