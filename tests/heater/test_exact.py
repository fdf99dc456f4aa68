"""The one equation of the heater against sixty decimal digits, equal and nearly equal lags above all."""

import random
from decimal import Decimal, localcontext

import numpy as np
import pytest

from heatertune.compiled import compile_function
from heatertune.heater.exact import (
    Factors,
    advance,
    advance_step,
    apart,
    factors,
    since_step,
    slopes_by_lag,
    turning_time,
    turning_times,
)

CASES = 10_000
ONE = Decimal(1)


def _case(chance):
    """(t, outer, inner): one inner lag in five far off, the others 1 ± 1e-16…1e-2 of the outer one, or it."""
    outer = 10.0 ** chance.uniform(-1.0, 4.0)
    apart_by = chance.choice((0.0, *(10.0 ** chance.uniform(-16.0, -2.0) for _ in range(3)), None))
    inner = outer * (10.0 ** chance.uniform(-4.0, 3.0) if apart_by is None else 1.0 + chance.choice((-1, 1)) * apart_by)
    return max(outer, inner) * 10.0 ** chance.uniform(-6.0, 1.3), outer, inner


def _truth(t, outer, inner):
    """e^(−t/outer), e^(−t/inner), D of `exact`, and ∫₀ᵗ s·e^(−s/outer)·e^(−(t − s)/inner) ds, by their definitions."""
    t, p, q = Decimal(t), ONE / Decimal(outer), ONE / Decimal(inner)
    left, other = (-p * t).exp(), (-q * t).exp()
    if p == q:
        return left, other, t * left, t * t / 2 * left
    passed = (left - other) / (q - p)
    return left, other, passed, (t * left - passed) / (q - p)


@pytest.fixture(scope="module")
def cases():
    chance = random.Random(12)
    given = [_case(chance) for _ in range(CASES)]
    with localcontext() as context:
        context.prec = 60
        truth = np.array([[float(value) for value in _truth(*case)] for case in given])
    return np.array(given).T, truth.T


def test_numbers_are_those_of_sixty_digits(cases):
    (t, outer, inner), (left, other, passed, _) = cases
    ours = np.array([factors(*case) for case in zip(t, outer, inner, strict=True)]).T
    # the rounding of an exponent counts as often as the exponent is large: 20 times here, more where nothing is left
    np.testing.assert_allclose(ours[0], left, rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(ours[1], passed / outer, rtol=2e-14)
    np.testing.assert_allclose(ours[2], other, rtol=1e-14, atol=1e-16)


def test_arrays_are_those_of_sixty_digits(cases):
    (t, outer, inner), (left, _, passed, moment) = cases
    covered, slope = since_step(t, outer, inner)
    np.testing.assert_allclose(covered, 1.0 - left - passed / outer, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(slope, passed / outer / inner, rtol=2e-14)
    np.testing.assert_allclose(slopes_by_lag(t, outer, inner), -moment / outer**2 / inner, rtol=1e-12)


def test_one_lag_is_an_exponential():
    t, lag = np.array([0.0, 3.0, 700.0]), 50.0
    left = np.exp(-t / lag)
    covered, slope = since_step(t, lag)
    assert covered == pytest.approx(1.0 - left)
    assert slope == pytest.approx(left / lag)
    assert slopes_by_lag(t, lag) == pytest.approx(-t / lag**2 * left)
    assert advance(np.full(3, 90.0), np.zeros(3), np.full(3, 20.0), t, lag, 0.0) == pytest.approx(20.0 + 70.0 * left)
    assert factors(3.0, lag, 0.0) == Factors(left[1], 0.0, 1.0)


@pytest.mark.parametrize("case", [(3.0, 50.0, 0.0), (3.0, 50.0, 50.0), (3.0, 50.0, 20.0), (3.0, 20.0, 50.0)])
def test_numbers_are_the_same_plain_and_compiled_bit_for_bit(case):
    assert compile_function(factors)(*case) == factors(*case)
    step = (90.0, 30.0, 40.0, factors(*case))
    assert compile_function(advance_step)(*step) == advance_step(*step)


@pytest.mark.parametrize(("outer", "inner"), [(100.0, 40.0), (40.0, 100.0), (100.0, 100.0), (100.0, 100.0 * (1 - 1e-13))])
def test_the_temperature_turns_where_both_lags_meet(outer, inner):
    turns = turning_time(50.0, 60.0, 20.0, outer, inner)
    assert turning_times(*map(np.array, (50.0, 60.0, 20.0)), outer, inner) == pytest.approx(turns, rel=1e-12)
    y, x = advance_step(50.0, 60.0, 20.0, factors(turns, outer, inner))
    assert y == pytest.approx(x, abs=1e-9)


@pytest.mark.parametrize("share", [1.0, 1.0 - 1e-9, 1.0 - 9e-5])
def test_lags_that_are_moved_apart_for_their_modes_answer_alike(share):
    first, second = apart(100.0, share * 100.0)
    t = np.linspace(0.0, 1000.0, 500)
    modes = 1.0 - (first * np.exp(-t / first) - second * np.exp(-t / second)) / (first - second)
    assert modes == pytest.approx(since_step(t, 100.0, share * 100.0)[0], abs=2e-9)
    assert apart(100.0, 99.0) == (100.0, 99.0), "no change where there is no need"
