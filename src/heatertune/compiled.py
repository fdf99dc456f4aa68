"""Plain functions made machine code: written once, run both ways, and kept on disk.

A function is compiled together with all functions of heatertune that it calls, from their plain source; importing the
source needs no compiler. Numba's own cache does not notice a change in a function that is called, so the folder bears
the digest of heatertune's whole source: a changed program starts anew. Without a folder (see `heatertune.cache`)
nothing is kept, and every process compiles.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from functools import cache as remember
from types import FunctionType
from typing import TYPE_CHECKING, Any, Final, TypeVar

from heatertune.cache import folder, source_digest

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["compiled", "runs_compiled_as", "worth_compiling"]

_Plain = TypeVar("_Plain", bound=Callable[..., Any])

#: scans after which a process that ran them plainly has spent as long as the compiler's start takes
_PLAIN_SCANS: Final = 50_000

_scans_asked = [0]

#: functions that no compiler takes → what is compiled in their place
_TWINS: Final[dict[Any, Any]] = {}


def runs_compiled_as(twin: Callable[..., Any]) -> Callable[[_Plain], _Plain]:
    """Return a decorator that names what is compiled in a function's place; both must give the same, bit for bit."""

    def register(plain: _Plain) -> _Plain:
        _TWINS[plain] = twin
        return plain

    return register


def worth_compiling(scans: int) -> bool:
    """Return whether a process has by now asked for so many scans that the compiler's start pays.

    So the short runs of one command never load the compiler, and long work takes at most twice as long as if it had
    been known from the start. Both ways give the same, bit for bit.
    """
    _scans_asked[0] += scans
    return _scans_asked[0] > _PLAIN_SCANS


@remember
def compiled(function: Callable[..., Any], *first: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function compiled, its first arguments, functions themselves, being already given.

    It takes the remaining arguments by position, gives up Python's lock while it runs, and is kept on disk for each
    combination of functions. It is compiled where it is called for the first time.
    """
    from numba import njit  # noqa: PLC0415 - half a second, which only the compiled world needs

    # functions as arguments would keep Numba from caching; as globals of a copy they do not
    given = {f"_{number}": _machine(each) for number, each in enumerate(first)}
    source = f"def bound(*rest):\n    return function({''.join(f'{name}, ' for name in given)}*rest)\n"
    scope: dict[str, Any] = {"function": _machine(function), "__name__": __name__, **given}
    exec(compile(source, __file__, "exec"), scope)  # our own two lines, their names counted
    bound = scope["bound"]
    bound.__qualname__ = "_".join(f"{each.__module__}.{each.__qualname__}" for each in (function, *first))
    kept = folder()
    if kept is None:
        return _as_callable(njit(nogil=True)(bound))
    with _kept_in(str(kept / f"compiled-{source_digest()[:16]}")):
        return _as_callable(njit(nogil=True, cache=True)(bound))


def _as_callable(dispatcher: Any) -> Callable[..., Any]:
    return dispatcher  # type: ignore[no-any-return]


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
def _machine(function: Callable[..., Any]) -> Any:
    """Return a compiled copy of a plain function whose calls go to compiled copies."""
    from numba import njit  # noqa: PLC0415

    if function in _TWINS:
        return _machine(_TWINS[function])
    assert isinstance(function, FunctionType)
    inside = {
        name: _machine(value)
        for name in function.__code__.co_names
        if isinstance(value := function.__globals__.get(name), FunctionType) and _is_ours(value)
    }
    scope = function.__globals__ | inside
    copy = FunctionType(function.__code__, scope, function.__name__, function.__defaults__, function.__closure__)
    copy.__kwdefaults__ = function.__kwdefaults__
    copy.__module__ = function.__module__
    return njit(nogil=True)(copy)


def _is_ours(function: FunctionType) -> bool:
    return function.__module__.partition(".")[0] == __name__.partition(".")[0]
