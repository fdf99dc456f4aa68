"""The power of another heater that changes in a log leaves the fit of one heater unproven."""

import numpy as np
import pytest

from heatertune.log.read import read_log
from heatertune.model.diagnostics import neighbour_findings


def written(tmp_path, names, columns):
    rows = [",".join(map(str, row)) for row in zip(*columns, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([",".join(names), *rows]) + "\n", encoding="utf-8")
    return path


def columns_of(other_power):
    time = np.arange(0, 400, 4)
    own = np.where(time < 100, 0.0, 50.0)
    temperature = 20.0 + np.where(time < 110, 0.0, 30.0 * (1.0 - np.exp(-(time - 110.0) / 80.0)))
    return time, temperature.round(2), own, other_power(time)


@pytest.mark.parametrize(("own", "other"), [
    ("Heater 1 (%)", "Heater 2 (%)"), ("Q1", "Q2"), ("power_pct", "chamber_power_pct"), ("Heater 1", "Bed power")])
def test_another_heaters_power_that_changes_is_named(tmp_path, own, other):
    log = read_log(written(tmp_path, ["time_s", "temp_C", own, other], columns_of(
        lambda time: np.where(time < 200, 10.0, 40.0))))
    assert log.taken.moving_heaters == (other,)
    (finding,) = neighbour_findings([log])
    assert finding.name == "neighbours-moved"
    assert repr(other) in finding.message
    assert finding.kind.effect == "blocks"


@pytest.mark.parametrize(("other", "course"), [
    ("Heater 2 (%)", lambda time: np.full(len(time), 20.0)),  # at rest
    ("Output current (A)", lambda time: np.where(time < 100, 0.0, 4.1)),  # the same power in another unit
    ("I output", lambda time: np.linspace(0.0, 40.0, len(time))),  # a part of the same controller's output
])
def test_a_heater_at_rest_and_the_same_power_twice_are_no_neighbours(tmp_path, other, course):
    log = read_log(written(tmp_path, ["time_s", "temp_C", "Heater 1 (%)", other], columns_of(course)))
    assert log.taken.moving_heaters == ()
    assert neighbour_findings([log]) == ()


def test_a_neighbour_that_was_named_as_a_disturbance_is_logged_together(tmp_path):
    path = written(tmp_path, ["time_s", "temp_C", "Heater 1 (%)", "Heater 2 (%)"], columns_of(
        lambda time: np.where(time < 200, 10.0, 40.0)))
    assert read_log(path, disturbance_column="Heater 2 (%)").taken.moving_heaters == ()
