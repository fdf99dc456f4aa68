"""What a file shows of its units without saying it: a live zero, small units of time, an output of two directions."""

import io
import math

import pytest

from heatertune.errors import LogError
from heatertune.log import read_log

ROOM, LAG = 21.0, 120.0


def _rows(signal, before=ROOM, gain=0.8, number=200):
    """Write a heater at rest for 10 rows of 2 s and then at 60 %: `signal` writes a power."""
    end = ROOM + 60.0 * gain
    for k in range(number):
        y = before if k < 10 else end + (before - end) * math.exp(-2.0 * (k - 10) / LAG)
        yield f"{2 * k},{y:.2f},{signal(0.0 if k < 10 else 60.0)}"


def _read(header, rows):
    return read_log(io.StringIO("\n".join([header, *rows]) + "\n"))


def test_a_signal_that_begins_at_4_mA_in_a_room_has_a_live_zero():
    log = _read("time_s,temperature_degC,Heater [mA]", _rows(lambda power: f"{4 + 0.16 * power:.2f}"))
    assert log.taken.reading["power_levels"] == (4.0, 20.0)
    assert [round(level) for level in log.signals["power"].changes[1]] == [0, 60]
    assert "off at 4 mA" in log.taken.line


@pytest.mark.parametrize(("header", "rows"), [
    # 0…20 mA: at rest under a fifth of full power, 16 °C above a room of 21 °C, and of 12 °C
    ("Heater [mA]", [*_rows(lambda power: "12.0" if power else "4.0", before=ROOM + 16.0)]),
    ("Heater [mA]", [*_rows(lambda power: "7.0" if power else "4.0", gain=0.1)]),  # its room may be 8 °C colder
    ("Heater", [*_rows(lambda power: "20.0" if power else "4.0")]),  # nothing says milliamperes
    ("Heater [mA]", [*_rows("13.6".format)]),  # never without power
])
def test_any_other_signal_of_4_to_20_is_asked_for(header, rows):
    with pytest.raises(LogError, match=r"--power-levels 4 20|--power-full-scale"):
        _read(f"time_s,temperature_degC,{header}", rows)


@pytest.mark.parametrize(("name", "per_s"), [
    ("t_ns", 1e9), ("time [us]", 1e6), ("timestamp_ns", 1e9), ("ts_us", 1e6), ("time [µs]", 1e6)])
@pytest.mark.parametrize("begin_s", [0.0, 1.7e9])
def test_a_time_in_small_units_is_read_by_its_name(name, per_s, begin_s):
    rows = (row.partition(",")[2] for row in _rows(lambda power: power))
    log = _read(f"{name},temperature_degC,power_pct", (
        f"{round((begin_s + 2.0 * k) * per_s)},{row}" for k, row in enumerate(rows)))
    assert log.time_s[:4].tolist() == pytest.approx([0.0, 2.0, 4.0, 6.0])
    assert "time" not in log.taken.assumed


def test_a_multiple_of_a_small_unit_is_asked_for():
    rows = (row.partition(",")[2] for row in _rows(lambda power: power))
    log = _read("time [100 ns],temperature_degC,power_pct", (f"{20_000_000 * k},{row}" for k, row in enumerate(rows)))
    assert "time" in log.taken.assumed


def test_a_bridge_has_two_directions_by_its_name_and_another_output_is_asked_for():
    rows = [f"{2 * k},{20 + 0.1 * k:.1f},{100 if k % 40 < 20 else -60}" for k in range(200)]
    assert "power" not in _read("time_s,temperature_degC,H-bridge output [-255...255]", rows).taken.assumed
    assert "power" in _read("time_s,temperature_degC,output [-255...255]", rows).taken.assumed


def _controlled(full, limit=None, number=400):
    """Write a loop whose power starts at its limit, falls to 0 and wanders below, in counts of `full`."""
    for k in range(number):
        share = 1.0 if k < 60 else 0.0 if k < 100 else 0.3 + 0.2 * math.sin(0.11 * k)
        yield f"{2 * k},{ROOM + 0.2 * k:.2f},{round(share * full) if limit is None else min(round(share * full), limit)}"


@pytest.mark.parametrize("full", [255, 1023, 4095, 27648, 32767, 65535])
def test_counts_that_a_controller_takes_to_both_ends_show_their_full_scale(full):
    log = _read("time_s,temperature_degC,output", _controlled(full))
    assert log.taken.reading["power_full_scale"] == full
    assert "power" not in log.taken.assumed
    assert "both reached" in log.taken.line


@pytest.mark.parametrize(("header", "rows"), [
    ("output", [*_controlled(1000)]),  # tenths of a percent, or a limit of counts
    ("output", [*_controlled(4095, limit=3000)]),  # a limited output
    ("power [W]", [*_controlled(255)]),
    ("output [V]", [*_controlled(255)]),
    ("output", [*_rows(lambda power: f"{255 if power else 0}")]),  # two levels of a test by hand
])
def test_the_full_scale_of_any_other_counts_is_asked_for(header, rows):
    with pytest.raises(LogError, match="--power-full-scale"):
        _read(f"time_s,temperature_degC,{header}", rows)
