import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heatertune.errors import InputError
from heatertune.pid.design_values import ideal_to_parallel, ideal_to_series, other_forms, series_to_ideal
from heatertune.report.report_text import forms_lines

gains = st.floats(1e-3, 1e3)
times = st.floats(1e-2, 1e5)
S = 1j * np.geomspace(1e-6, 1e3, 30)


def _ideal(gain, tn, tv):
    return gain * (1.0 + 1.0 / (tn * S) + tv * S)


@given(gain=gains, tn=times, tv=times)
def test_series_and_ideal_are_the_same_controller_at_every_frequency(gain, tn, tv):
    # both transfer functions as the module's head writes them
    series = gain * (1.0 + 1.0 / (tn * S)) * (1.0 + tv * S)
    assert _ideal(*series_to_ideal(gain, tn, tv)) == pytest.approx(series, rel=1e-9)


@given(gain=gains, tn=times, tv=times)
def test_parallel_and_ideal_are_the_same_controller_at_every_frequency(gain, tn, tv):
    kp, ki, kd = ideal_to_parallel(gain, tn, tv)
    assert kp + ki / S + kd * S == pytest.approx(_ideal(gain, tn, tv), rel=1e-9)


@given(gain=gains, tn=times, share=st.floats(0.0, 0.25))
def test_an_ideal_form_with_tv_up_to_a_quarter_of_tn_comes_back_from_its_series_form(gain, tn, share):
    series = ideal_to_series(gain, tn, share * tn)
    assert series_to_ideal(*series) == pytest.approx((gain, tn, share * tn), rel=1e-6)
    assert series[1] >= series[2]


def test_skogestads_printed_conversion():
    # Skogestad 2003, section 2.4: the ideal form of Kc, τI, τD has Kc(1 + τD/τI), τI(1 + τD/τI), τD/(1 + τD/τI)
    assert series_to_ideal(1.30, 2.0, 1.2) == pytest.approx((2.08, 3.2, 0.75))
    assert ideal_to_series(2.08, 3.2, 0.75) == pytest.approx((1.30, 2.0, 1.2))


def test_what_has_no_other_form_is_refused_with_the_rule():
    with pytest.raises(InputError, match=r"TV <= TN/4 = 25 s"):
        ideal_to_series(1.0, 100.0, 25.1)


def test_without_an_integral_part_the_forms_agree_too():
    assert series_to_ideal(2.0, math.inf, 5.0) == (2.0, math.inf, 5.0)
    assert ideal_to_series(2.0, math.inf, 5.0) == (2.0, math.inf, 5.0)
    assert ideal_to_parallel(2.0, math.inf, 5.0) == (2.0, 0.0, 10.0)


def test_a_design_is_told_in_the_other_forms_where_they_exist():
    # Skogestad's printed pair once more; Ki = 2.08/3.2, Kd = 2.08·0.75
    found = other_forms(2.08, 3.2, 0.75)
    assert tuple(found["series"].values()) == pytest.approx((1.30, 2.0, 1.2))
    assert found["parallel"] == pytest.approx({"kp": 2.08, "ki": 0.65, "kd": 1.56})
    lines = forms_lines(found).splitlines()
    assert lines[0] == "- the same in the series form: K 1.3 %/°C, TN 2 s, TV 1.2 s"
    assert lines[1] == "- the same in the parallel form: Kp 2.08 %/°C, Ki 0.65 %/(°C·s), Kd 1.56 %·s/°C"
    assert other_forms(1.0, 100.0, 25.0)["series"] is not None
    assert other_forms(1.0, 100.0, 25.1)["series"] is None
    assert "none: TV is above TN/4" in forms_lines(other_forms(1.0, 100.0, 25.1))
    assert "TN none, TV 0 s" in forms_lines(other_forms(1.0, math.inf, 0.0))
