"""The loop that is tuned is the loop that is judged: the input module's delay is part of both."""

import cmath
import math

import pytest

from heatertune.model.model_values import Candidate, FitOutcome, FittedModel, Fopdt, model_by_hand
from heatertune.model.statistics import Interval
from heatertune.plc import Scaling
from heatertune.proof import prove
from heatertune.proof.design_request import DesignRequest, made_for
from heatertune.proof.redesign import find_passing_design
from heatertune.settings import Conditions, TuneSettings

HEATER = Fopdt(gain_degC_per_pct=0.8, time_constant_s=60.0, dead_time_s=1.5, ambient_degC=20.0)
RANGE = Scaling(low_degC=0.0, high_degC=100.0)
#: delay of input module and output by the makers' manuals, see each controller's DIFFERENCES.md [s]
DELAY_S = {"fb41": 0.256, "s7-300": 0.256, "s5-ob251": 0.48, "klipper": 0.308, "weg": 0.0, "eurotherm-3200": 0.0}


def peak_sensitivity(design, dead_time_s):
    """Return max |1/(1 + L)| of the sampled PI loop, from the heater's step-invariant model on a grid of its own."""
    ta, gain, lag = design.sample_time_s, HEATER.gain_degC_per_pct, HEATER.time_constant_s
    whole = math.floor(dead_time_s / ta)
    rest = dead_time_s - whole * ta
    pole = math.exp(-ta / lag)
    first, second = gain * (1.0 - math.exp(-(ta - rest) / lag)), gain * (math.exp(-(ta - rest) / lag) - pole)
    peak = 0.0
    for k in range(4000):
        z = cmath.exp(1j * math.pi * (k + 1) / 4000.0)
        heater = (first / z + second / z**2) / (1.0 - pole / z) / z**whole
        controller = design.gain_pct_per_degC * (1.0 + ta / design.integral_time_s / (1.0 - 1.0 / z))
        peak = max(peak, 1.0 / abs(1.0 + heater * controller))
    return peak


@pytest.mark.parametrize("ms", [1.4, pytest.param(2.0, marks=pytest.mark.sample), 2.5])
@pytest.mark.parametrize("target", DELAY_S)
def test_words_tuned_for_a_target_keep_ms_in_their_proof(target, ms):
    fitted = model_by_hand(HEATER)
    design, choice = made_for(fitted, DesignRequest(target=target, scaling=RANGE, tune_settings=TuneSettings(ms=ms)), str, str)
    proof = prove(choice.words, fitted, first_look=True)
    judged = next(criterion for criterion in proof.criteria if criterion.name == "ms")
    assert judged.limit == 2.0
    assert judged.ok
    assert judged.value <= min(ms, 2.0) * (1.0 + 1e-3)
    assert proof.design is not None
    assert judged.value == pytest.approx(peak_sensitivity(proof.design, HEATER.dead_time_s + DELAY_S[target]), rel=1e-3)
    assert design.margins.ms == pytest.approx(peak_sensitivity(design, HEATER.dead_time_s + DELAY_S[target]), rel=1e-3)


@pytest.mark.long
def test_a_closed_design_says_the_ms_that_its_proof_finds():
    asked = DesignRequest(target="fb41", scaling=RANGE, tune_settings=TuneSettings(ms=2.0), conditions=Conditions(setpoint_degC=60.0))
    found = find_passing_design(model_by_hand(HEATER), asked)
    judged = next(criterion for criterion in found.proof.criteria if criterion.name == "ms")
    assert judged.ok
    assert found.ideal.margins.ms == pytest.approx(judged.value, rel=2e-3)


def test_a_delay_moves_every_dead_time_and_its_interval_and_no_believed_least_is_lost():
    candidates = tuple(
        Candidate(model=Fopdt(gain_degC_per_pct=1.0, time_constant_s=50.0, dead_time_s=dead), log="log",
                  window_s=(0.0, 1.0), law="", fit_pct=99.0, rmse_degC=0.1, delta_bic=0.0) for dead in (0.5, 4.0))
    fitted = FittedModel(
        model=candidates[1].model, outcome=FitOutcome.BY_HAND, method="", candidates=candidates, least_dead_time_s=1.0,
        ci95={"dead_time_s": Interval(low=None, high=5.0), "time_constant_s": Interval(low=40.0, high=60.0)})
    late = fitted.with_delay(0.25)
    assert [plant.dead_time_s for plant in fitted.plants] == [1.0, 4.0]
    assert [plant.dead_time_s for plant in late.plants] == [1.25, 4.25]
    assert late.ci95["dead_time_s"] == Interval(low=None, high=5.25)
    assert late.ci95["time_constant_s"] == fitted.ci95["time_constant_s"]
    assert late.model.dead_time_s == 4.25
    assert fitted.with_delay(0.0) is fitted
