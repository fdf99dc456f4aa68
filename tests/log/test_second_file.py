"""A power in a file of its own; the instants expected are those that the test writes."""

import numpy as np
import pytest

from heatertune.errors import LogError
from heatertune.log import read_log

TIMES = 10.0 * np.arange(40)
READINGS = 20.0 + 0.5 * np.arange(40)
POWERS = [(0.0, 0.0), (13.0, 60.0), (205.0, 20.0)]


def _stamp(at_s, zone="Z"):
    return f"2026-03-09T{20 + int(at_s) // 3600}:{int(at_s) // 60 % 60:02}:{int(at_s) % 60:02}{zone}"


def _long(rows):
    return "entity_id,state,last_changed\n" + "".join(f"{name},{value:g},{_stamp(at)}\n" for name, value, at in rows)


#: files of temperature and power, options
WAYS = {
    "seconds": ("time_s,temp_C\n" + "".join(f"{t:g},{y:g}\n" for t, y in zip(TIMES, READINGS, strict=True)),
                "time_s,power_pct\n" + "".join(f"{t:g},{u:g}\n" for t, u in POWERS), {}),
    "names that say nothing": ("Time;Value\n" + "".join(f"{_stamp(t)};{y:g}\n" for t, y in zip(TIMES, READINGS, strict=True)),
                               "Time;Value\n" + "".join(f"{_stamp(t)};{u:g}\n" for t, u in POWERS), {"temperature_column": "Value"}),
    "home automation": (_long([("sensor.oven_temperature", y, t) for t, y in zip(TIMES, READINGS, strict=True)]),
                        _long([("number.heater_power", u, t) for t, u in POWERS]), {}),
    "other columns": ("time,temp_C\n" + "".join(f"{_stamp(t)},{y:g}\n" for t, y in zip(TIMES, READINGS, strict=True)),
                      _long([("number.heater_power", u, t) for t, u in POWERS]), {}),
    "date and time": ("Date,Time,Temp [°C]\n" + "".join(
        f"2026-03-09,{_stamp(t, '')[11:]},{y:g}\n" for t, y in zip(TIMES, READINGS, strict=True)),
        "Date,Time,Power [%]\n" + "".join(f"2026-03-09,{_stamp(t, '')[11:]},{u:g}\n" for t, u in POWERS), {}),
}


@pytest.mark.parametrize("way", WAYS)
def test_the_power_of_another_file_keeps_its_instants(way, tmp_path):
    temperatures, powers, options = WAYS[way]
    (tmp_path / "t.csv").write_text(temperatures, encoding="utf-8")
    (tmp_path / "p.csv").write_text(powers, encoding="utf-8")
    log = read_log(tmp_path / "t.csv", power_log=str(tmp_path / "p.csv"), power_full_scale=100.0, **options)
    assert list(zip(*log.signals["power"].changes, strict=True)) == POWERS
    assert np.interp(TIMES, log.time_s, log.temperature_degC) == pytest.approx(READINGS)
    again = {name: value for name, value in log.taken.reading.items() if name not in ("time_column", "temperature_column")}
    assert again["power_log"] == str(tmp_path / "p.csv")


@pytest.mark.parametrize(("powers", "options", "message"), [
    ("time_s,power_pct\n9000,0\n9100,50\n", {}, "a log from another time than the first one"),
    ("time_min,power_pct\n0,0\n3,50\n", {}, "expected --time-unit s, if both are in s"),
    ("time,power_pct\n2026-03-09 20:00:00,0\n2026-03-09 20:00:13,50\n", {}, "expected as '0'"),
    ("time_s,power_pct,output\n0,0,1\n13,50,2\n", {}, "several columns may be the power (power_pct, output)"),
    ("time_s,state\n0,idle\n13,busy\n", {}, "no column is a power (time_s, state)"),
    ("time_s,power_pct\n", {}, "a header and no readings"),
])
def test_powers_that_cannot_be_placed_are_refused_by_the_name_of_their_file(powers, options, message, tmp_path):
    (tmp_path / "t.csv").write_text(WAYS["seconds"][0], encoding="utf-8")
    (tmp_path / "p.csv").write_text(powers, encoding="utf-8")
    with pytest.raises(LogError, match=r"p\.csv") as refused:
        read_log(tmp_path / "t.csv", power_log=str(tmp_path / "p.csv"), **options)
    assert message in str(refused.value)


def test_a_time_zone_in_one_file_alone_is_refused(tmp_path):
    (tmp_path / "t.csv").write_text(WAYS["other columns"][0], encoding="utf-8")
    (tmp_path / "p.csv").write_text("time,power_pct\n2026-03-09T20:00:00,0\n2026-03-09T20:00:13,50\n", encoding="utf-8")
    with pytest.raises(LogError, match="a time zone in both files or in none"):
        read_log(tmp_path / "t.csv", power_log=str(tmp_path / "p.csv"))


def test_rows_of_one_second_are_all_kept_and_a_second_run_is_refused(tmp_path):
    times = [k // 2 for k in range(80)]  # two readings in each second of a coarse clock
    (tmp_path / "t.csv").write_text("time_s,temp_C\n" + "".join(f"{t},{20 + 0.5 * k}\n" for k, t in enumerate(times)), encoding="utf-8")
    (tmp_path / "p.csv").write_text("time_s,power_pct\n0,0\n5,60\n", encoding="utf-8")
    log = read_log(tmp_path / "t.csv", power_log=str(tmp_path / "p.csv"))
    assert {20 + 0.5 * k for k in range(80)} <= set(log.temperature_degC.tolist())
    # line 42 is the first of the second run: the names, 40 rows, and it
    (tmp_path / "t.csv").write_text(WAYS["seconds"][0] + WAYS["seconds"][0].partition("\n")[2], encoding="utf-8")
    with pytest.raises(LogError, match=r"t\.csv, line 42.*backwards.*one run in each"):
        read_log(tmp_path / "t.csv", power_log=str(tmp_path / "p.csv"))
