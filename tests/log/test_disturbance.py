"""A column that the user names as a measured load: read in its own unit, told, and repeated by the options."""

import numpy as np
import pytest

from heatertune.errors import LogError
from heatertune.log import read_log

ROWS = [(2.0 * k, round(20.0 + 0.2 * k, 1), 60.0 if k > 9 else 0.0, 3.5 if k > 30 else 1.25) for k in range(60)]


def _read(tmp_path, cells, **options):
    path = tmp_path / "log.csv"
    lines = ["time [s],temp [degC],power [%],flow [l/min]", *(",".join(map(str, (*row[:3], cell)))
                                                               for row, cell in zip(ROWS, cells, strict=True))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_log(path, **options)


def test_a_disturbance_is_read_where_the_user_or_its_name_says_so(tmp_path):
    # a flow carries heat away: passed over, as before, its effect went into the heater (issue 42: never a silent error)
    numbers = [row[3] for row in ROWS]
    assert _read(tmp_path, numbers, disturbance_column="none").disturbance is None
    assert _read(tmp_path, [1.0] * 60).disturbance is None  # it stands still
    for column in (None, "flow [l/min]", 4):
        log = _read(tmp_path, numbers, disturbance_column=column)
        np.testing.assert_array_equal(log.disturbance, numbers)
        assert log.taken.line.endswith("setpoint = none, disturbance = 'flow [l/min]'")
        assert log.taken.reading["disturbance_column"] == "flow [l/min]"
    np.testing.assert_array_equal(log.window(50.0, 100.0).disturbance, numbers[25:51])


def test_empty_cells_hold_the_last_value_and_are_told(tmp_path):
    log = _read(tmp_path, ["", 2, "", 3, *[1] * 56], disturbance_column="flow [l/min]")
    assert log.disturbance[:5].tolist() == [2.0, 2.0, 2.0, 3.0, 1.0]
    assert "The disturbance is empty in 2 rows; the last one was held there." in log.repairs
    assert log.taken.repaired == 2


def test_a_fan_that_is_on_or_off_is_1_or_0(tmp_path):
    log = _read(tmp_path, ["on" if k > 30 else "off" for k in range(60)], disturbance_column=4)
    assert set(log.disturbance[:31]) == {0.0}
    assert set(log.disturbance[31:]) == {1.0}


@pytest.mark.parametrize(("cells", "column", "match"), [
    ([*[1.0] * 30, "x", *[1.0] * 29], "flow [l/min]", r"line 32.*flow"),
    ([""] * 60, "flow [l/min]", "the column of the disturbance is empty"),
    ([1.0] * 60, "door", "no disturbance column.*door"),
    ([1.0] * 60, "temp [degC]", r"disturbance|temperature"),
])
def test_a_disturbance_that_cannot_be_read_is_refused_by_its_place(tmp_path, cells, column, match):
    with pytest.raises(LogError, match=match):
        _read(tmp_path, cells, disturbance_column=column)


def test_a_table_of_tags_has_no_column_of_a_disturbance(tmp_path):
    path = tmp_path / "tags.csv"
    path.write_text("time,tag,value\n" + "".join(f"{2 * k},{tag},{20 + k + n}\n" for k in range(40)
                                                 for n, tag in enumerate(("temp", "power"))), encoding="utf-8")
    with pytest.raises(LogError, match="a row for each tag has no column of a disturbance"):
        read_log(path, tag="temp", power_tag="none", disturbance_column="value")
