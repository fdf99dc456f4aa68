"""The written-out exponentials and logarithms against 50 decimal digits, plain and compiled."""

import math
import random
from decimal import Decimal, localcontext

import pytest

from heatertune.compiled import compile_function
from heatertune.heater.exact import decay, expm1_negative, logarithm, logarithm_beside_1

DRAWN = random.Random(5)
POWERS = [-0.0, 0.0, -700.0, *(-(10.0 ** DRAWN.uniform(-12.0, 2.84)) for _ in range(1000))]
NUMBERS = [1.0, 0.5, 2.0, *(10.0 ** DRAWN.uniform(-6.0, 6.0) for _ in range(500)), *(DRAWN.uniform(0.7, 1.42) for _ in range(500))]
SHARES = [0.0, *(sign * 10.0 ** DRAWN.uniform(-12.0, -0.001) for sign in (-1, 1) for _ in range(500))]


@pytest.mark.parametrize(("function", "exact", "numbers", "ulps"), [
    (decay, lambda x: x.exp(), POWERS, 1.0),
    (expm1_negative, lambda x: x.exp() - 1, POWERS, 1.1),
    (logarithm, lambda x: x.ln(), NUMBERS, 2.0),
    (logarithm_beside_1, lambda x: (1 + x).ln(), SHARES, 2.5),
], ids=lambda value: getattr(value, "__name__", ""))
def test_it_is_right_to_the_last_digits_and_compiled_the_same(function, exact, numbers, ulps):
    machine = compile_function(function)
    with localcontext() as context:
        context.prec = 50
        for number in numbers:
            found, right = function(number), exact(Decimal(number))
            assert machine(number) == found
            assert abs(Decimal(found) - right) <= Decimal(ulps * math.ulp(float(right)))


def test_beyond_its_range_a_power_leaves_nothing():
    for power in (-1e9, -math.inf, math.nan):
        assert 0.0 < decay(power) < 1e-300
