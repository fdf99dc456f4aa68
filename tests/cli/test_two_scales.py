"""A heater of two time scales by its numbers; the witness is a sampled loop of two lags in parallel, see tests.bench.truth."""

import json

import numpy as np
import pytest
from tests.bench import truth

GAIN, SHARE, ELEMENT_S, MASS_S, DEAD_S = 0.6, 0.3, 15.0, 900.0, 6.0
#: of two lags in parallel, the zero is where their fast and slow parts meet: share·slow + (1 − share)·fast
NUMBERS = ("--gain", GAIN, "--time-constant", MASS_S, "--second-time-constant", ELEMENT_S, "--dead-time", DEAD_S,
           "--zero", SHARE * MASS_S + (1.0 - SHARE) * ELEMENT_S)


def test_a_heater_by_its_numbers_is_tuned_for_its_zero(run):
    status, text, _ = run("tune", *NUMBERS, "--structure", "pi", "--ms", 1.6, "--json", "--quiet")
    assert status == 0
    found = json.loads(text)
    interval = found["sample_time_s"]
    law = truth.Law(k=found["gain_pct_per_degC"], i_now=interval / found["integral_time_s"], i_before=0.0, d=0.0,
                    past=0.0, interval=interval)
    # each lag a state; the sensor, the last state, adds them up within a hundredth of a second
    a = np.array([[-1.0 / ELEMENT_S, 0.0, 0.0], [0.0, -1.0 / MASS_S, 0.0], [100.0, 100.0, -100.0]])
    plant = truth.sampled(a, np.array([GAIN * SHARE / ELEMENT_S, GAIN * (1.0 - SHARE) / MASS_S, 0.0]), DEAD_S, interval)
    assert truth.stable(plant, law)
    assert truth.peak(plant, law, MASS_S) == pytest.approx(1.6, abs=0.01)
    candidate, = found["model"]["candidates"]
    assert candidate["fast_share"] == pytest.approx(NUMBERS[-1] / MASS_S)
