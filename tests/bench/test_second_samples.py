"""Drawn heaters are drawn and judged as a second draw and the judge in C have them, and what is drawn otherwise is seen."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from heatertune.proof.monte_carlo.draw import SampleRequest
from heatertune.proof.scenario import Load
from tests.bench import second_samples
from tests.bench.second_draw import given
from tests.bench.second_opinion import compiled
from tests.bench.second_samples import (
    compared,
    drawing_of,
    inputs_alike,
    judged,
    objections,
    plain_of,
    programs,
    subject,
    theirs_of,
)

pytestmark = [pytest.mark.long, pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler, cc")]

SAMPLES = 12


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return compiled(tmp_path_factory.mktemp("judge"))


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return subject(0, "weg", SAMPLES, tmp_path_factory.mktemp("zone"))


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(second_samples, "MORE", 200)
    monkeypatch.setattr(second_samples, "INPUTS", 8000)


def test_the_second_draw_and_the_second_judge_say_the_same(library, case):
    found = judged(library, case, SAMPLES, np.random.default_rng(1))
    assert sum(found.ends.values()) == SAMPLES * len(case.settings)
    assert not found.unexplained
    assert not objections(found.tests)
    assert all(theirs == mine for theirs, mine, _ in found.shares), "of the same heaters"


def test_late_scans_are_late_for_both(library, tmp_path):
    # PWM periods shorter than a scan is late: so it was seen that the first scan decided on those before it
    late = subject(2001, "iec-pid", 4, tmp_path)
    drawing, plain = drawing_of(late), plain_of(late)
    values, kept = programs(late, drawing, 4, late.seed)
    theirs = theirs_of(drawing, range(late.seed, late.seed + 4))
    assert late.jitter > plain.period
    for number in range(4):
        its = {name: float(value[0, number]) for name, value in values.items()}
        b = given(plain, *theirs[number])
        assert compared(library, b, late.limits, its, bool(kept[0, number]))[1] == "same"
        assert compared(library, replace(b, lates=0.9 * b.lates), late.limits, its, bool(kept[0, number]))[1] == "apart"


def _with_loads_of_the_drawn_mains(self, seeds, of=SampleRequest.heaters_of):
    rows, sizes = of(self, seeds)
    power = rows[:, 0] / np.array(self.rows)[[seed % len(self.rows) for seed in seeds], 0]
    for number, event in enumerate(self.scenario.disturbances):
        if isinstance(event, Load):
            sizes[:, number] *= power
    return rows, sizes


@pytest.mark.parametrize(("spread", "seen"), [
    ({"mains_pct": 5.0}, "drawn gain"),  # ±10 % of the power and not of the voltage: not squared
    ({"ambient_degC": 4.0}, "drawn ambient"),
    ({"disturbance_pct": 40.0}, "drawn temperature-step 0"),
    ({"heater": (0.0, 0.0, 0.0)}, "drawn lag"),
    ({"least_dead_time_s": 0.0}, "drawn dead time"),
])
def test_what_is_drawn_otherwise_is_objected_to(case, spread, seen):
    drawing = drawing_of(case)
    tests = inputs_alike(replace(drawing, spread=replace(drawing.spread, **spread)), plain_of(case), case.document,
                         np.random.default_rng(1))
    assert seen in [what for _, what in objections(tests)]


def test_a_load_that_goes_with_the_drawn_mains_is_objected_to(case, monkeypatch):
    # as it was, until this program was there
    monkeypatch.setattr(SampleRequest, "heaters_of", _with_loads_of_the_drawn_mains)
    tests = inputs_alike(drawing_of(case), plain_of(case), case.document, np.random.default_rng(1))
    assert {"drawn load 1", "drawn load 2"} == {what for _, what in objections(tests)}


@pytest.mark.parametrize("change", [
    lambda b: {"gain": 1.01 * b.gain}, lambda b: {"dead": b.dead + 0.5}, lambda b: {"ambient": b.ambient + 0.2},
    lambda b: {"sizes": b.sizes[::-1]}, lambda b: {"lags": tuple(1.01 * lag for lag in b.lags)}])
def test_the_second_judge_sees_a_heater_that_is_other(library, case, change):
    drawing = drawing_of(case)
    values, kept = programs(case, drawing, 1, case.seed)
    b = given(plain_of(case), *theirs_of(drawing, [case.seed])[0])
    its = {name: float(value[0, 0]) for name, value in values.items()}
    assert compared(library, b, case.limits, its, bool(kept[0, 0]))[1] == "same"
    assert compared(library, replace(b, **change(b)), case.limits, its, bool(kept[0, 0]))[1] == "apart"
