import math

import numpy as np
import pytest

from heatertune.errors import OutOfRange
from heatertune.model.model_document import from_document, to_document
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.model.statistics import Interval


def test_the_half_rule_gives_skogestads_worked_example():
    # Skogestad 2003, example E1: 1/((s+1)(0.2s+1)) becomes a time constant of 1.1 and a dead time of 0.1
    reduced = TwoLag(
        gain_degC_per_pct=1.0, time_constant_s=1.0, second_time_constant_s=0.2, dead_time_s=0.0
    ).half_rule()
    assert (reduced.time_constant_s, reduced.dead_time_s) == pytest.approx((1.1, 0.1))


def test_the_frequency_response_of_a_first_order_lag_at_its_corner_is_minus_45_degrees_and_the_dead_time():
    plant = Fopdt(gain_degC_per_pct=2.0, time_constant_s=10.0, dead_time_s=3.0)
    at_corner = plant.frequency_response(np.array([0.1]))[0]
    assert abs(at_corner) == pytest.approx(2.0 / math.sqrt(2.0))
    assert np.angle(at_corner) == pytest.approx(-math.pi / 4.0 - 0.3)


@pytest.mark.parametrize(
    ("field", "value"),
    [("gain_degC_per_pct", 0.0), ("gain_degC_per_pct", math.nan), ("time_constant_s", -1.0), ("dead_time_s", -0.1),
     ("ambient_degC", -300.0), ("time_constant_s", math.inf)],
)
def test_a_heater_that_cannot_be_is_refused_by_field_and_value(field, value):
    settings = {"gain_degC_per_pct": 1.0, "time_constant_s": 1.0, "dead_time_s": 0.0} | {field: value}
    with pytest.raises(OutOfRange, match=field):
        Fopdt(**settings)


def test_lags_in_the_wrong_order_are_refused():
    with pytest.raises(OutOfRange, match="second_time_constant_s"):
        TwoLag(gain_degC_per_pct=1.0, time_constant_s=1.0, second_time_constant_s=2.0, dead_time_s=0.0)


def test_an_interval_upside_down_is_refused():
    with pytest.raises(OutOfRange):
        Interval(low=2.0, high=1.0)


def test_a_model_by_hand_survives_its_document():
    model = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
    document = to_document(model_by_hand(model))
    assert document["gain_degC_per_pct_ci95"] is None
    assert from_document(document).model == model
