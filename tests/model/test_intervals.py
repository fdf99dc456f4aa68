"""Intervals of drawn values."""

import numpy as np
import pytest

from heatertune.model.statistics import Interval, interval


def test_drawn_values_of_which_none_is_a_number_leave_both_ends_open():
    assert interval(np.array([np.nan, np.inf, np.nan]), 0.0, 1.0) == Interval(low=None, high=None)


def test_of_drawn_values_those_that_are_numbers_count():
    """Of 0…1000 the central 95 % ends at 25 and 975, by counting."""
    ends = interval(np.array([np.nan, *np.arange(1001.0)]), -np.inf, np.inf)
    assert (ends.low, ends.high) == pytest.approx((25.0, 975.0))
