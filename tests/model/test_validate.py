"""One model against another log."""

from dataclasses import replace

import numpy as np
import pytest
from tests.model.twins import AMBIENT, DEAD, GAIN, LAG, doublet, logged

from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.model.validate import validate

TRUE = Fopdt(gain_degC_per_pct=GAIN, time_constant_s=LAG, dead_time_s=DEAD, ambient_degC=AMBIENT)


def _log(**changes):
    time, power = doublet()
    return logged(time, power, noise=np.random.default_rng(5).normal(0.0, 0.1, len(time)), **changes)


def _judged(log=None, **changes):
    return validate(model_by_hand(replace(TRUE, **changes)), _log() if log is None else log)


def test_the_heater_itself_holds_to_the_noise():
    found = _judged()
    (run,) = found.runs
    assert found.fails == ()
    assert run.rmse_degC == pytest.approx(0.1, rel=0.15)
    assert run.bias_degC == pytest.approx(0.0, abs=0.02)
    assert run.input_correlation.ok
    assert run.ljung_box < 45.0  # 99.9 % of χ² with 20 degrees of freedom
    assert "The model holds" in found.notes[-1]


def test_a_gain_that_is_off_fails_by_the_fit_and_the_bias_is_the_heaters_own():
    found = _judged(gain_degC_per_pct=0.8 * GAIN)
    (run,) = found.runs
    # a fifth of what the true heater rises above its ambient is missing; the free initial state takes what it can of it
    missing, decay = 0.2 * (_log().temperature_degC - AMBIENT), np.exp(-_log().time_s / LAG)
    left = missing - decay * (missing @ decay) / (decay @ decay)
    assert run.bias_degC == pytest.approx(left.mean(), rel=0.02)
    assert found.fails == ("fit", "bias")
    assert "by the fit (at least 80 %) and the bias" in found.notes[0]


def test_a_warmer_room_is_a_bias_of_its_own_size_and_is_told():
    log = _log()
    warm = replace(log, temperature_degC=log.temperature_degC + 6.0)
    found = _judged(warm)
    assert found.fails == ("fit", "bias")
    assert any("With an ambient of 26 °C instead of 20 °C" in note for note in found.notes)
    assert found.runs[0].free_ambient_degC == pytest.approx(26.0, abs=0.1)
    assert validate(model_by_hand(TRUE), warm, ambient_degC=26.0).fails == ()


def test_a_heater_that_was_warm_at_the_start_is_no_fault_of_the_model():
    time, power = doublet()
    log = logged(time, power, noise=15.0 * np.exp(-time / LAG))  # 15 °C above the ambient at the first reading
    assert _judged(log).runs[0].rmse_degC < 0.02


@pytest.mark.long
def test_every_heater_that_designs_are_made_for_is_judged_and_the_working_model_only_shown():
    time, power = doublet()
    log = logged(time, power, second=60.0, dead=5.0)
    two = TwoLag(gain_degC_per_pct=GAIN, time_constant_s=LAG, second_time_constant_s=60.0, dead_time_s=5.0,
                 ambient_degC=AMBIENT)
    fitted = model_by_hand(two)
    found = validate(fitted, log)
    assert [run.model for run in found.runs] == [two.half_rule(), two]
    assert (found.worst, found.fails) == (1, ())
    assert found.runs[1].fit_pct > 99.5 > found.runs[0].fit_pct
    assert not found.runs[0].input_correlation.ok
    # one heater that this log rules out, among those that designs are made for, is enough
    wrong = replace(fitted.candidates[0], model=replace(two, gain_degC_per_pct=10.0 * GAIN))
    other = validate(replace(fitted, candidates=(*fitted.candidates, wrong)), log)
    assert (other.worst, other.fails) == (2, ("fit", "bias"))
    assert other.runs[2].fit_pct < 0.0
    assert "does not hold" in other.notes[-1]


def test_power_on_at_the_first_reading_is_taken_as_begun_there_or_before_whichever_fits():
    time = np.arange(-60.0, 1200.0, 4.0)
    power = np.where(time < 0.0, 0.0, 60.0)
    whole = logged(time + 60.0, power, noise=np.random.default_rng(5).normal(0.0, 0.1, len(time)))
    cut = replace(whole, time_s=whole.time_s[15:], temperature_degC=whole.temperature_degC[15:], power_pct=power[15:])
    assert validate(model_by_hand(TRUE), cut).runs[0].rmse_degC == pytest.approx(0.1, rel=0.15)
    late = validate(model_by_hand(TRUE), cut, power_before_pct=60.0).runs[0]
    assert late.rmse_degC > 0.15  # the dead time of 12 s is missing


def test_what_cannot_be_judged_is_refused():
    with pytest.raises(InputError, match="--controller"):
        _judged(replace(_log(), power_pct=None))
    for name, value in (("ambient_degC", -300.0), ("power_before_pct", 120.0), ("least_fit_pct", 101.0)):
        with pytest.raises(OutOfRange, match=name):
            validate(model_by_hand(TRUE), _log(), **{name: value})
    assert validate(model_by_hand(TRUE), _log(), least_fit_pct=99.9).fails == ("fit",)
