"""NumPy's float32 is the second implementation of IEEE 754 single precision."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from heatertune.plc.core import Sensor
from heatertune.plc.single_precision import divide_single, exponential, is_single, single, to_single
from heatertune.plc.words import holds

singles = st.floats(width=32, allow_nan=False)


def _same(found, expected):
    return np.float32(found).tobytes() == expected.tobytes() or (math.isnan(found) and np.isnan(expected))


@given(a=singles, b=singles)
def test_one_rounding_after_each_operation(a, b):
    x, y = np.float32(a), np.float32(b)
    with np.errstate(all="ignore"):
        assert _same(single(a + b), x + y)
        assert _same(single(a - b), x - y)
        assert _same(single(a * b), x * y)
        assert _same(divide_single(a, b), x / y)


@given(power=singles | st.floats(-110.0, 95.0, width=32))
def test_an_exponential_beyond_the_largest_single_is_infinite(power):
    with np.errstate(all="ignore"):
        assert _same(exponential(power), np.float32(np.exp(np.float64(power))))


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_is_single_where_rounding_leaves_it(value):
    with np.errstate(over="ignore"):
        assert is_single(value) == (np.float64(np.float32(value)) == value)


def test_a_format_holds_whole_numbers_of_its_range_or_singles():
    assert [holds("INT", value) for value in (32767, 32768, -32768, -32769, 1.0, True, None)] == [
        True, False, True, False, False, False, False,
    ]
    assert [holds("REAL", value) for value in (0.5, 0.1, 3, math.inf, math.nan)] == [True, False, True, False, False]


def test_narrowed_leaves_every_number_and_makes_single_precision_of_the_floats_alone():
    given_ = (Sensor(0.5, single(-1e38), 4095), (True, 2.0**-149), 16777217)
    found = to_single(given_)
    assert found == given_
    assert isinstance(found[0], Sensor)
    assert [type(each) for each in (*found[0], *found[1], found[2])] == [
        np.float32, np.float32, int, int, np.float32, bool, np.float32, int,
    ]
    whole = np.array([16777217])  # 2^24 + 1, which single precision does not hold
    assert to_single(whole).tolist() == whole.tolist()
    assert to_single(np.array([0.1])).dtype == np.float32
