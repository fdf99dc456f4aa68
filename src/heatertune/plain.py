"""Plain functions as a compiler sees them: what they call, what is compiled in their place, and copies of them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from functools import cache as remember
from types import FunctionType
from typing import Any, Final, TypeVar, cast

__all__ = ["bound", "callees", "copy_function", "plainly", "runs_compiled_as"]

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
