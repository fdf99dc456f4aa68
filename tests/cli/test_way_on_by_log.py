"""Where no design serves all heaters that a log leaves open, and each end has one: a longer log is the way on."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from heatertune.errors import InputError
from heatertune.model.model_values import FitOutcome, Fopdt, model_by_hand
from heatertune.proof.design_request import DesignRequest
from heatertune.proof.redesign.suggestion import Suggestion

BY_LOG = "log until the temperature is steady"
DIAGNOSTICS = SimpleNamespace(findings=(), views=(), accepted=())


def _heater(gain):
    return Fopdt(gain_degC_per_pct=gain, time_constant_s=100.0 * gain, dead_time_s=10.0, ambient_degC=20.0)


def _suggestion(gains, passing, outcome=FitOutcome.COMBINATIONS_ONLY):
    """Return a search whose designs pass for the heaters of these gains alone."""
    first = model_by_hand(_heater(gains[0]))
    candidates = tuple(replace(first.candidates[0], model=_heater(gain), log=f"end {gain}") for gain in gains)
    proof = SimpleNamespace(scenario=SimpleNamespace(setpoint_degC=60.0), broken_criteria=("overshoot",), criteria=(), diagnostics=DIAGNOSTICS)

    def close(fitted, request, *, progress):
        assert request.conditions.setpoint_degC == 60.0, "that of the design that fails, not one of the heater's own"
        gain = fitted.model.gain_degC_per_pct
        if gain < 0.1:
            raise InputError("it cannot be held at the setpoint")
        verdict = "PASS" if gain in passing else "FAIL"
        return SimpleNamespace(proof=SimpleNamespace(verdict=verdict, diagnostics=DIAGNOSTICS))

    return Suggestion(fitted_model=replace(first, candidates=candidates, outcome=outcome), request=DesignRequest(target="fb41"),
                      first=SimpleNamespace(proof=proof), progress=str, close=close)


@pytest.mark.parametrize(("suggestion", "is_told"), [
    (_suggestion((1.0, 0.5, 2.0), {0.5, 2.0}), True),
    (_suggestion((1.0, 0.5, 2.0), {0.5, 1.0}), False),  # the heater of the largest gain has no design
    (_suggestion((1.0, 0.05, 2.0), {1.0, 2.0}), False),  # the smallest cannot be held there
    (_suggestion((1.0,), {1.0}), False),  # nothing is open
    (_suggestion((1.0, 0.5, 2.0), {0.5, 2.0}, FitOutcome.IDENTIFIED), False),
])
def test_a_longer_log_is_named_only_where_each_end_of_the_gain_has_a_design(suggestion, is_told):
    assert (BY_LOG in suggestion._hopeless(whole=True)) == is_told

