"""The check of what is called as machine code directly; where it fails, Numba's own path gives the same."""

import builtins
from array import array

import numpy as np
import pytest

from heatertune.compiled import compile_function, dispatch, loader, numba_compiler
from heatertune.compiled import plain_functions as check
from heatertune.plc import Scaling, controller_for
from heatertune.proof import simulate
from heatertune.proof.loop import in_loop, run_loop
from tests.proof.test_compiled import HEATERS, LOOPS, PI, PWM, SCENARIO

RIGHT = check.addresses_are_right


@pytest.fixture
def anew(monkeypatch, tmp_path):
    """As in a fresh process with an empty folder: nothing is checked yet, and no machine code was found."""
    monkeypatch.setattr(dispatch, "folder", lambda: tmp_path)
    for kept in (dispatch.tricks_hold, dispatch._door):
        kept.cache_clear()
    yield
    for kept in (dispatch.tricks_hold, dispatch._door):
        kept.cache_clear()


def total(values, factor, counts, pair):
    """Return a sum of numbers of every kind, in a tuple."""
    sum_ = factor * pair[0]
    for k in range(len(values)):
        sum_ += values[k] * counts[k]
    return sum_, len(values) + pair[1]


ARGUMENTS = (np.array([0.1, 0.2, 0.3]), 1.7, array("q", [3, 5, 7]), (2.5, 4))


def test_the_check_passes_with_the_releases_that_are_installed(anew, tmp_path):
    assert dispatch.tricks_hold()
    assert [path.suffix for path in tmp_path.glob("compiled-*/*")] == [".probe"]
    assert dispatch.machine_code(tmp_path) == [], "the probe is no work's machine code"
    dispatch.tricks_hold.cache_clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numba_compiler, "object_code", None)
        assert dispatch.tricks_hold(), "the next process finds the probe and needs no compiler"


def _arrays_elsewhere(patch):
    patch.setattr(check, "addresses_are_right", lambda: False)


def _numbers_in_another_order(patch):
    patch.setattr(numba_compiler, "letters_of", lambda kinds: loader.letters_of(kinds)[::-1])


def _no_such_class_in_numba(patch):
    whole = builtins.__import__

    def without(name, *others):
        if name == "heatertune.compiled.numba_compiler":
            raise ImportError("cannot import name 'JITCodeLibrary'")
        return whole(name, *others)

    patch.setattr(builtins, "__import__", without)


def _no_such_function_in_llvm(patch):
    patch.delattr(loader._loader(), "create_mcjit_compiler")


def _another_result(patch):
    whole = loader._result

    def turned(result):
        kind, read = whole(result)
        return kind, lambda there: read(there)[::-1] if isinstance(result, list) else read(there)

    patch.setattr(loader, "_result", turned)


@pytest.mark.parametrize("broken", [_arrays_elsewhere, _numbers_in_another_order, _no_such_class_in_numba,
                                    _no_such_function_in_llvm, _another_result])
def test_whatever_trick_fails_the_results_are_those_of_the_source(broken, anew, monkeypatch, tmp_path):
    broken(monkeypatch)
    assert not dispatch.tricks_hold()
    assert compile_function(total)(*ARGUMENTS) == total(*ARGUMENTS)
    assert compile_function(total)(ARGUMENTS[0], 3, *ARGUMENTS[2:]) == total(ARGUMENTS[0], 3, *ARGUMENTS[2:])
    assert dispatch.machine_code(tmp_path) == [], "what Numba keeps for itself is not kept here"


def test_an_array_is_looked_for_where_numpy_has_its_numbers(monkeypatch):
    assert RIGHT()
    monkeypatch.setattr(check, "array_address", lambda value: value.ctypes.data + 8)
    assert not RIGHT()


@pytest.mark.long
@pytest.mark.parametrize("target", LOOPS)
def test_a_loop_on_numbas_own_path_is_the_plain_one_bit_for_bit(target, anew, monkeypatch):
    which = controller_for(target)
    words = which.encode(PI, Scaling())
    plain = simulate(which, words, HEATERS[0], SCENARIO, PWM)
    monkeypatch.setattr(dispatch, "_PLAIN_SCANS", -1)
    _arrays_elsewhere(monkeypatch)
    by_numba = run_loop(in_loop(which, words, SCENARIO.setpoints_degC, {}, direct=True), HEATERS[0], SCENARIO, PWM)
    assert dispatch.tricks_hold.cache_info().currsize, "it was run compiled"
    for name in ("time_s", "temperature_degC", "reading_degC", "power_asked_pct", "edge_time_s", "edge_on"):
        assert np.array_equal(getattr(plain, name), getattr(by_numba, name)), name
