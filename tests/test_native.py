"""Machine code called without its compiler: whatever goes in comes out, of any kind, nested in any way.

The witness is Numba's own door, which takes arguments apart by itself, and Python.
"""

import gc
import math
import pickle
from array import array
from threading import Thread
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numba import njit

from heatertune.compiled import compile_function
from heatertune.compiled.loader import Code, kinds_of
from heatertune.compiled.numba_compiler import object_code


class Pair(NamedTuple):
    """Two values of any kind."""

    one: object
    other: object


class Alone(NamedTuple):
    """One."""

    value: object


class Nothing(NamedTuple):
    """None."""


def same(value):
    return value


def weighed(table, out):
    total = 0.0
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            total += table[i, j] * (i + 2.0 * j + 1.0)
    out[0] = total


def gathered(first, rest, last):
    pair, (table, flag), single = rest
    total = first + last + single + pair.one * pair.other
    for i in range(len(table)):
        total += table[i]
    return total if flag else -total


def divided(a, b):
    return a / b, a // b, a % b


WHOLE = st.integers(-(2**63), 2**63 - 1)
NUMBERS = st.one_of(
    st.floats(), WHOLE, st.booleans(), st.floats(width=32, allow_nan=False).map(np.float32), st.floats().map(np.float64),
    WHOLE.map(np.int64), st.booleans().map(np.bool_))
NESTED = st.recursive(
    NUMBERS, lambda parts: st.one_of(
        st.tuples(parts), st.tuples(parts, parts), st.tuples(parts, parts, parts), st.builds(Pair, parts, parts),
        st.builds(Alone, parts)), max_leaves=9)


def alike(one, other):
    """Whether values are the same to the bit, and tuples of the same class."""
    if isinstance(one, tuple):
        return type(one) is type(other) and len(one) == len(other) and all(map(alike, one, other))
    if isinstance(one, float | np.floating) and math.isnan(one):
        return math.isnan(other)
    return one == other and math.copysign(1.0, one) == math.copysign(1.0, other)


@pytest.mark.long
@settings(max_examples=60)
@given(NESTED)
@example((1, (True, Pair(2.5, (np.float32(0.5), False)), Alone(Alone(-0.0))), 2**62))
@example(Pair((True, 7, True), (np.float32(1.5), 3, False)))  # holes between parts of unlike size
def test_what_goes_in_comes_out(value):
    assert alike(value, compile_function(same)(value))


def _layouts():
    whole = np.arange(24.0).reshape(4, 6)
    fixed = whole.copy()
    fixed.setflags(write=False)
    return {"rows": whole, "columns": np.asfortranarray(whole), "every second": np.arange(96.0).reshape(8, 12)[::2, ::2],
            "backwards": whole[::-1, ::-1], "turned": whole.T, "fixed": fixed, "one row": whole[:1], "one column": whole[:, :1],
            "empty": np.empty((0, 3)), "spread": np.broadcast_to(np.arange(6.0), (4, 6)), "single": whole.astype(np.float32),
            "whole": whole.astype(np.int64), "odd": np.frombuffer(b"\0" + whole.tobytes(), dtype=np.float64, offset=1).reshape(4, 6)}


@pytest.mark.long
@pytest.mark.parametrize("layout", _layouts())
def test_an_array_is_read_as_it_lies(layout):
    table, out, own = _layouts()[layout], np.zeros(1), np.zeros(1)
    compile_function(weighed)(table, out)
    njit(weighed)(table, own)
    weights = np.add.outer(np.arange(table.shape[0]), 2.0 * np.arange(table.shape[1])) + 1.0
    assert out == own == pytest.approx(float(np.sum(table * weights)))


def test_an_array_from_another_process_is_one_like_any_other():
    table = pickle.loads(pickle.dumps(np.ones((2, 2))))
    assert table.dtype is not np.dtype(float), "NumPy makes it anew"
    run, out = compile_function(weighed), np.zeros(1)
    for given_ in (table, np.ones((2, 2)), table):
        run(given_, out)
        assert out == 1.0 + 3.0 + 2.0 + 4.0


def test_arrays_of_python_and_bytes_are_taken_too():
    rest = (Pair(3.0, 4.0), (array("d", [1.0, 2.0]), True), np.float32(0.5))
    assert compile_function(gathered)(10, rest, 1.0) == 26.5
    assert compile_function(gathered)(10, (Pair(3.0, 4.0), (bytearray(b"\1\2"), False), np.float32(0.5)), 1.0) == -26.5
    assert compile_function(gathered)(10, (Pair(3.0, 4.0), (bytearray(), False), np.float32(0.5)), 1.0) == -23.5


def test_nothing_comes_back_as_nothing_and_a_division_by_zero_as_numpy_has_it():
    assert compile_function(weighed)(np.ones((1, 1)), np.zeros(1)) is None
    assert compile_function(same)((1.0, Nothing())) == (1.0, Nothing())
    quotient, *_ = compile_function(divided)(1.0, 0.0)
    assert quotient == math.inf


@pytest.mark.parametrize(("value", "told"), [
    (2**63, "9223372036854775808 has more than 64 bits"), ("text", "str: a number, an array or a tuple of them expected"),
    ([1.0], "list: a number"), (None, "NoneType: a number"), (np.uint8(3), "uint8: a number"), (1 << 200, "more than 64 bits"),
])
def test_what_no_compiled_function_takes_is_refused_not_cut(value, told):
    with pytest.raises(TypeError, match=told):
        kinds_of([(1.0, value)])


def test_a_function_that_gives_back_an_array_is_refused():
    with pytest.raises(TypeError, match="same: it returns array"):
        object_code(same, [np.zeros(2)])


def test_code_that_needs_what_is_not_here_is_not_run():
    from heatertune.compiled.loader import entry  # noqa: PLC0415 - beside its only use

    code = object_code(same, [1.0])
    assert entry(code, kinds_of([1.0])) is not None
    lacking = Code(name=code.name, result=code.result, needs=("no_such_function_anywhere",), content=code.content,
                   door=code.door)
    assert entry(lacking, kinds_of([1.0])) is None


@pytest.mark.long
def test_code_stays_where_it_is_as_long_as_it_may_be_called_and_threads_may_call_it_at_once():
    run = compile_function(gathered)
    given_ = (10, (Pair(3.0, 4.0), (np.ones(1000), True), np.float32(0.5)), 1.0)
    expected, found = run(*given_), []

    def ask():
        found.extend(compile_function(gathered)(*given_) for _ in range(200))

    threads = [Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for _ in range(3):
        gc.collect()
    for thread in threads:
        thread.join()
    assert found == [expected] * 800
