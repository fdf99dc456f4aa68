"""Plain functions as a compiler sees them: what they call, what is compiled in their place, and copies of them.

A loop is plain source that a compiler takes in whole, so it calls a controller's functions by global names. Stand-in
functions hold these names here; `bound` makes the copy of the loop in which they mean a controller's own.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from functools import cache as remember
from types import FunctionType
from typing import Any, Final, TypeVar, cast

__all__ = [
    "bound", "callees", "cold_state", "copy_function", "lane_parameters", "law_loaded", "law_step", "law_stored",
    "measure", "plainly", "runs_compiled_as", "setpoint_word", "step", "warm_state",
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
def bound(function: _Plain, **given: Callable[..., Any]) -> _Plain:
    """Return a copy of a plain function in which some names of its module mean other functions.

    So a loop takes a controller's functions: only what calls functions by global names can be kept on disk.
    """
    assert isinstance(function, FunctionType)
    copy = copy_function(function, given)
    names = " ".join(f"{name}={other.__module__}.{other.__qualname__}" for name, other in given.items())
    digest = hashlib.sha256(names.encode()).hexdigest()[:16]  # a file's name must not grow with what is bound in it
    copy.__qualname__ = f"{function.__qualname__}_{digest}"  # by which it is told what is on disk
    return cast(_Plain, copy)


def plainly(function: Callable[..., Any]) -> FunctionType:
    """Return what is compiled for a function: itself, or its twin."""
    plain = _TWINS.get(function, function)
    assert isinstance(plain, FunctionType)
    return plain


def callees(function: FunctionType) -> dict[str, FunctionType]:
    """Return the plain functions that a function names."""
    scope = function.__globals__
    named = {name: scope.get(name) for name in function.__code__.co_names}
    return {name: value for name, value in named.items() if isinstance(value, FunctionType)}


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
