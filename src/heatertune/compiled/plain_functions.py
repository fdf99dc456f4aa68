"""Plain functions as a compiler sees them: what they call, what is compiled in their place, and copies of them.

A loop is plain source that a compiler takes in whole, so it calls a controller's functions by global names. Stand-in
functions hold these names here; `bound` makes the copy of the loop in which they mean a controller's own.

The check of the tricks, made once in a process before machine code is called directly.

A probe function with every kind of argument and of result goes the whole way, from Numba's compiler or from the disk
through LLVM's loader, and has to give what its plain source gives. Before it is called, the places that are read are
compared with what NumPy and LLVM say of them: nothing wrong is ever called.

Where the check fails Numba's own path is taken: public functions of Numba alone, the same results. It is slower: each
process compiles anew what it needs, with doors to Python for every function.
"""

from __future__ import annotations

import ctypes
import hashlib
from array import array
from collections.abc import Callable, Mapping
from functools import cache as remember
from types import FunctionType
from typing import Any, Final, NamedTuple, TypeVar, cast

import numpy as np
import numpy.typing as npt

from heatertune.compiled.loader import array_address

__all__ = [
    "ProbeResult", "addresses_are_right", "bound", "callees", "cold_state", "copy_function", "disturbance_step",
    "lane_parameters",
    "law_loaded", "law_step", "law_stored", "measure", "numba_function", "plainly", "probe", "probe_arguments",
    "runs_compiled_as", "setpoint_word", "step", "warm_state",
]


_Plain = TypeVar("_Plain", bound=Callable[..., Any])

#: functions that no compiler takes → what is compiled in their place
_TWINS: Final[dict[Any, Any]] = {}


def runs_compiled_as(twin: Callable[..., Any]) -> Callable[[_Plain], _Plain]:
    """Return a decorator that names what is compiled in a function's place; both must give the same, bit for bit."""

    def register(plain: _Plain) -> _Plain:
        _TWINS[plain] = twin
        return plain

    return register


@remember
def bound(function: _Plain, **compiled_function: Callable[..., Any]) -> _Plain:
    """Return a copy of a plain function in which some names of its module mean other functions.

    So a loop takes a controller's functions: only what calls functions by global names can be kept on disk.
    """
    assert isinstance(function, FunctionType)
    copy = copy_function(function, compiled_function)
    names = " ".join(f"{name}={other.__module__}.{other.__qualname__}" for name, other in compiled_function.items())
    digest = hashlib.sha256(names.encode()).hexdigest()[:16]  # a file's name must not grow with what is bound in it
    copy.__qualname__ = f"{function.__qualname__}_{digest}"  # by which it is told what is on disk
    return cast(_Plain, copy)


def plainly(function: Callable[..., Any]) -> FunctionType:
    """Return the function to compile for a function: itself, or its twin."""
    plain = _TWINS.get(function, function)
    assert isinstance(plain, FunctionType)
    return plain


def callees(function: FunctionType) -> dict[str, FunctionType]:
    """Return the plain functions that a function names."""
    scope = function.__globals__
    by_name = {name: scope.get(name) for name in function.__code__.co_names}
    return {name: value for name, value in by_name.items() if isinstance(value, FunctionType)}


def copy_function(function: FunctionType, names: Mapping[str, Any]) -> FunctionType:
    """Return a copy of a function in which some names of its module mean something else."""
    scope = function.__globals__ | dict(names)
    copy = FunctionType(function.__code__, scope, function.__name__, function.__defaults__, function.__closure__)
    copy.__module__, copy.__qualname__, copy.__doc__ = function.__module__, function.__qualname__, function.__doc__
    return copy


def step(_parameters: Any, _state: Any, _setpoint: Any, _reading: Any, _cycle_start: bool) -> tuple[Any, ...]:
    """Stand in for a controller's step, see `StepFunctions`.

    Args:
        _parameters: of the controller.
        _state: before the scan.
        _setpoint: in its units.
        _reading: likewise.
        _cycle_start: whether a PWM period begins.
    """
    raise NotImplementedError


def disturbance_step(
    _parameters: Any, _state: Any, _setpoint: Any, _reading: Any, _cycle_start: bool, _disturbance_pct: float
) -> tuple[Any, ...]:
    """Stand in for a controller's step with a disturbance variable, see `StepFunctions`.

    Args:
        _parameters: of the controller.
        _state: before the scan.
        _setpoint: in its units.
        _reading: likewise.
        _cycle_start: whether a PWM period begins.
        _disturbance_pct: power that is added [%].
    """
    raise NotImplementedError


def measure(_sensor: Any, _temperature: float) -> Any:
    """Stand in for what the input module reads of a temperature."""
    raise NotImplementedError


def cold_state(_parameters: Any, _state: Any) -> Any:
    """Stand in for the controller's state after it was switched on."""
    raise NotImplementedError


def warm_state(_parameters: Any, _cold: Any, _state: Any) -> Any:
    """Stand in for the controller's state after a start-up."""
    raise NotImplementedError


def setpoint_word(_setpoint: Any) -> Any:
    """Stand in for a sum as the setpoint word holds it."""
    raise NotImplementedError


def law_loaded(_rows: Any, _lane: int) -> Any:
    """Stand in for what loads a controller's state and setpoint word."""
    raise NotImplementedError


def law_stored(_rows: Any, _lane: int, _law: Any) -> None:
    """Stand in for what stores a controller's state and setpoint word."""
    raise NotImplementedError


def lane_parameters(_parameters: Any) -> Any:
    """Stand in for what gives a controller's parameters."""
    raise NotImplementedError


def law_step(_form: int, _constants: Any, _memory: Any, _error: float, _h: float) -> float:
    """Stand in for a controller's law in a fit of temperatures.

    Args:
        _form: of the controller.
        _constants: of the law.
        _memory: it, which the law changes.
        _error: setpoint less temperature [°C].
        _h: sampling interval [s].
    """
    raise NotImplementedError


class ProbeResult(NamedTuple):
    """What the probe returns: a number of each kind, and a tuple."""

    total: float
    number: int
    positive: bool
    pair: tuple[float, int]


def probe(  # noqa: PLR0913 - one of each kind
    number: float, whole: int, flag: bool, row: Any, table: Any, column: Any, words: Any, cells: Any,
    pair: tuple[float, tuple[int, float]],
) -> ProbeResult:
    """Compute with each argument, and write into an array, so that one in a wrong place shows.

    Args:
        number: any.
        whole: any.
        flag: whether the total may be positive.
        row: array, shape (n,); its first number is written.
        table: array, shape (n, m).
        column: array, shape (n,), whose numbers do not stand side by side.
        words: two whole numbers at least, as an `array`.
        cells: bytes.
        pair: nested tuples.
    """
    total = number + 2.0 * pair[0] + 3.0 * pair[1][1]
    for k in range(len(row)):
        total += (k + 1) * row[k]
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            total += (10 * i + j) * table[i, j]
    for k in range(len(column)):
        total += (k + 1) * column[k]
    row[0] = total
    count = whole + 5 * pair[1][0] + words[1] + cells[0]
    return ProbeResult(total, count, flag and total > 0.0, (total - number, count - whole))


def probe_arguments() -> tuple[Any, ...]:
    """Return the probe's arguments, made anew: it writes into one."""
    table: npt.NDArray[np.float64] = np.arange(6.0).reshape(2, 3) + 0.25
    return (0.5, 7, True, np.array([1.5, -2.25, 4.0]), table, table[:, 1], array("q", [3, 1 << 40]),
            bytearray(b"\x11\x22"), (1.125, (9, -3.5)))


def addresses_are_right() -> bool:
    """Return whether an array's numbers stand where they are looked for, see `loader.array_address`."""
    table = np.arange(24.0).reshape(2, 3, 4)
    views = (table, table[1], table[:, 1:, ::2], table.T, np.array(3.5), np.zeros(0), np.array([True, False]))
    return all(array_address(view) == view.ctypes.data for view in views) and ctypes.sizeof(ctypes.c_void_p) == 8


@remember
def numba_function(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a plain function as Numba compiles it, with all that it calls; arguments by position only."""
    from numba import njit

    plain = plainly(function)
    inside = {name: numba_function(value) for name, value in callees(plain).items()}
    native: Callable[..., Any] = njit(nogil=True, error_model="numpy")(copy_function(plain, inside))
    return native
