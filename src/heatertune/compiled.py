"""Plain functions made machine code: written once, run both ways, and kept on disk.

A function is compiled together with all functions of heatertune that it calls, from their plain source; importing the
source needs no compiler. Numba's own cache does not notice a change in a function that is called, so the folder bears
the digest of heatertune's whole source: a changed program starts anew. Without a folder (see `heatertune.cache`)
nothing is kept, and every process compiles.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from functools import cache as remember
from types import FunctionType
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

from heatertune.cache import folder, source_digest

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["bound", "compiled", "decide", "runs_compiled_as", "worth_compiling"]

_Plain = TypeVar("_Plain", bound=Callable[..., Any])

#: scans after which a process that ran them plainly has spent as long as the compiler's start takes
_PLAIN_SCANS: Final = 50_000

_scans_asked: Final[Counter[str]] = Counter()

#: what a process decided for all its work; None: whatever pays
_decided: Final[list[bool | None]] = [None]

#: functions that no compiler takes → what is compiled in their place
_TWINS: Final[dict[Any, Any]] = {}


def runs_compiled_as(twin: Callable[..., Any]) -> Callable[[_Plain], _Plain]:
    """Return a decorator that names what is compiled in a function's place; both must give the same, bit for bit."""

    def register(plain: _Plain) -> _Plain:
        _TWINS[plain] = twin
        return plain

    return register


def decide(compile_all: bool | None) -> None:
    """Let this process run all its work compiled (True) or plainly (False); None, as at the start: whatever pays."""
    _decided[0] = compile_all


def worth_compiling(scans: int, work: str = "loop", most_plain: int | None = None) -> bool:
    """Return whether a process has by now asked for so many scans that the compiler's start pays, or decided so.

    Each work counts its own: what is compiled for one does not help another. `most_plain` is how many plain scans take
    as long as this start, by default of the proof's loop.

    So the short runs of one command never load the compiler, and long work takes at most twice as long as if it had
    been known from the start. Both ways give the same, bit for bit.
    """
    if _decided[0] is not None:
        return _decided[0]
    _scans_asked[work] += scans
    return _scans_asked[work] > (_PLAIN_SCANS if most_plain is None else most_plain)


@remember
def bound(function: _Plain, **given: Callable[..., Any]) -> _Plain:
    """Return a copy of a plain function in which some names of its module mean other functions.

    So a loop takes a controller's functions: Numba keeps on disk only what calls functions by global names.
    """
    assert isinstance(function, FunctionType)
    copy = _copy(function, given)
    names = "_".join(f"{each.__module__}.{each.__qualname__}" for each in given.values())
    copy.__qualname__ = f"{function.__qualname__}_{names}"  # by which Numba tells what it has on disk
    return cast(_Plain, copy)


@remember
def compiled(function: _Plain) -> _Plain:
    """Return the function compiled, arguments by position only; it gives up Python's lock while it runs.

    It is compiled where it is called for the first time with arguments of new types, and kept on disk.
    """
    kept = folder()
    if kept is None:
        return cast(_Plain, _machine(function))
    with _kept_in(str(kept / f"compiled-{source_digest()[:16]}")):
        return cast(_Plain, _machine(function, cache=True))


@contextmanager
def _kept_in(path: str) -> Iterator[None]:
    """Let Numba choose this folder while a dispatcher is made; other caches stay where they are."""
    from numba import config  # noqa: PLC0415

    before, config.CACHE_DIR = config.CACHE_DIR, path
    try:
        yield
    finally:
        config.CACHE_DIR = before


@remember
def _machine(function: Callable[..., Any], *, cache: bool = False, called: bool = False) -> Any:
    """Return a compiled copy of a plain function whose calls go to compiled copies.

    One that is only called by another needs no door to Python and no entry of its own on disk: half of the compiler's
    work.
    """
    from numba import njit  # noqa: PLC0415 - half a second, which only the compiled world needs

    function = _TWINS.get(function, function)
    assert isinstance(function, FunctionType)
    inside = {
        name: _machine(value, called=True)
        for name in function.__code__.co_names
        if isinstance(value := function.__globals__.get(name), FunctionType)
    }
    # no reference counts (nothing is allocated), no exceptions (a step is total), all calls inlined: ten times faster
    options = {"nogil": True, "cache": cache, "_nrt": False, "error_model": "numpy"}
    options |= {"forceinline": called, "no_cpython_wrapper": called, "no_cfunc_wrapper": called}
    return njit(**options)(_copy(function, inside))


def _copy(function: FunctionType, names: Mapping[str, Any]) -> FunctionType:
    scope = function.__globals__ | dict(names)
    copy = FunctionType(function.__code__, scope, function.__name__, function.__defaults__, function.__closure__)
    copy.__module__, copy.__qualname__, copy.__doc__ = function.__module__, function.__qualname__, function.__doc__
    return copy
