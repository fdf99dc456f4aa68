"""`heatertune supervise`: its page, its document, and that it never trips for nothing."""

import json
import re

import numpy as np
import pytest
from tests.bench import supervise
from tests.bench.second_monitor import Monitors

from heatertune.codec import encode
from heatertune.errors import DocumentError
from heatertune.supervision.monitor_design import read_supervision

WARNING = "does not replace a thermal cut-out"
HOT = ("--gain", 4, "--time-constant", 120, "--dead-time", 2, "--ambient", 22, "--target", "s5-ob251", "--setpoint", 200, "--range", 0, 300,
       "--noise", 0.1)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A hot end's design and its supervision."""
    from heatertune.cli import main  # noqa: PLC0415

    folder = tmp_path_factory.mktemp("hot")
    assert main([str(word) for word in ("tune", *HOT, "--quiet", "-o", folder / "pid.json")]) == 0
    assert main([str(word) for word in ("supervise", folder / "pid.json", "--target", "s5-ob251", "--least-noise", 0.05, "--samples", 100,
                                        "--faults-per-kind", 20, "--quiet", "-o", folder)]) == 0
    return json.loads((folder / "pid.json").read_text()), json.loads((folder / "supervision.json").read_text()), folder


@pytest.mark.long(seconds=30)
def test_it_tells_a_stuck_switch_in_time_and_says_that_it_replaces_no_cut_out(made):
    _, document, folder = made
    page = (folder / "supervision.txt").read_text()
    assert page.count(WARNING) == 2
    assert WARNING in document["warning"]
    faults = {fault["name"]: fault for fault in document["faults"]}
    stuck = faults["switch stuck on"]
    assert stuck["detected"] == stuck["heaters"] == 20
    assert stuck["detection_s"]["worst"] <= 14.0
    assert stuck["peak_degC"]["worst"] <= 220.0
    assert all(isinstance(number, int) and abs(number) < 2**31 for number in document["numbers"].values())
    for fault in document["faults"]:
        assert (fault["missed_because"] is None) == (fault["detected"] == fault["heaters"]), fault
        assert fault["name"] in page


@pytest.mark.long(seconds=10)
def test_another_plant_and_another_monitor_see_no_false_trip_and_every_stuck_switch(made):
    design, document, _ = made
    heater = supervise.HEATERS["hot-end"]
    assert supervise.false_trips(heater, document, design, 100) == (0, {})
    late, hottest = supervise.broken(heater, document, design, 100, {"mains": 0.0, "stuck": 100.0})
    assert np.nanmax(late) <= 14.0
    assert not np.isnan(late).any()
    assert hottest.max() <= 220.0


@pytest.mark.long(seconds=10)
def test_the_judge_can_tell_a_monitor_that_trips_for_nothing(made):
    design, document, _ = made
    heater = supervise.HEATERS["hot-end"]
    tight = document | {"numbers": document["numbers"] | {"fast_rest": document["numbers"]["fast_rest"] // 4}}
    trips, why = supervise.false_trips(heater, tight, design, 20)
    assert trips > 10
    assert "too hot for its power" in why


@pytest.mark.parametrize(("arguments", "said"), [
    (("--gain", -0.3, "--time-constant", 100, "--dead-time", 5, "--ambient", 30, "--setpoint", 10, "--range", -20, 50), "cool"),
    (("--gain", 1, "--time-constant", 100, "--dead-time", 5, "--ambient", 20, "--setpoint", 50, "--spread", 90), "--spread"),
    (("--gain", 1, "--time-constant", 100, "--dead-time", 5, "--ambient", 20, "--setpoint", 50, "--least-noise", 3), "--least-noise"),
    (("--gain", 1, "--time-constant", 100, "--dead-time", 5, "--ambient", 20, "--setpoint", 50, "--samples", 0), "--samples"),
    (("nowhere.json",), "nowhere.json"),
    ((), "no model"),
])
@pytest.mark.long(seconds=5)
def test_what_it_cannot_supervise_is_told_in_one_line(run, arguments, said):
    status, out, err = run("supervise", *arguments, "--target", "s5-ob251", "--quiet")
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert said in err


def test_marlin_s_rule_stops_a_heater_that_falls_and_lets_one_in_order_be():
    times = np.arange(0.0, 300.0, 1.0)
    warm = np.minimum(20.0 + 2.0 * times, 200.0)
    assert np.isnan(supervise.marlin_trips(False, times, warm, 200.0, 285.0))
    falls = np.where(times > 150.0, 190.0, warm)
    assert supervise.marlin_trips(False, times, falls, 200.0, 285.0) == 191.0  # 40 s after it was within 4 °C last, at 150 s


def test_the_second_monitor_starts_without_a_memory():
    assert Monitors({"block": 1}, 2).last is None


@pytest.mark.long(seconds=10)
def test_it_writes_the_program_and_a_page_to_print_whose_every_sheet_says_that_it_replaces_no_cut_out(made):
    _, document, folder = made
    program = document["program"]
    assert program["why"] is None
    assert (folder / program["file"]).read_text() == program["text"]
    assert WARNING in program["text"]
    html = (folder / "supervision.html").read_text()
    assert html.count(WARNING) >= 1
    foot = re.search(r'@bottom-left \{ content: "([^"]*)"', html)[1]
    assert WARNING in re.sub(r"\\([0-9a-f]+) ", lambda found: chr(int(found[1], 16)), foot)
    for fault in document["faults"]:
        assert fault["name"] in html
    view = read_supervision(folder / "supervision.json")
    assert encode(view) == document


@pytest.mark.long(seconds=10)
@pytest.mark.parametrize(("change", "said"), [
    ({"numbers": {}}, "numbers"), ({"checked": "many"}, "checked"), ({"schema": "heatertune/pid/2"}, "schema"),
    ({"faults": [{"name": "x"}]}, r"faults\[0\]"),
])
def test_a_document_that_does_not_hold_together_is_refused_by_its_field(made, tmp_path, change, said):
    (tmp_path / "supervision.json").write_text(json.dumps(made[1] | change))
    with pytest.raises(DocumentError, match=said):
        read_supervision(tmp_path / "supervision.json")
