"""Plain functions made machine code: written once, run both ways, and kept on disk.

A function is compiled together with all functions of heatertune that it calls, from their plain source; importing the
source needs no compiler. Numba's own cache does not notice a change in a function that is called, so the folder bears
the digest of all files that those functions can depend on: a changed program starts anew. Without a folder (see
`heatertune.cache`) nothing is kept, and every process compiles. What no process used for a month is removed.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache as remember
from functools import partial
from pathlib import Path
from threading import Lock
from types import FunctionType
from typing import TYPE_CHECKING, Any, Final, Literal, TypeVar, cast

from heatertune.cache import folder

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["bound", "compiled", "decide", "is_kept", "machine_code", "made_beside", "runs_compiled_as",
           "worth_a_second", "worth_compiling"]

_Plain = TypeVar("_Plain", bound=Callable[..., Any])

#: scans after which a process that ran them plainly has spent as long as the compiler's start takes
_PLAIN_SCANS: Final = 80_000

#: the same where machine code of this work is kept, so that it need only be loaded, before and after the compiler was
_PLAIN_SCANS_KEPT: Final = 30_000
_PLAIN_SCANS_READY: Final = 6_000

_scans_asked: Final[Counter[str]] = Counter()

#: works whose machine code was looked for on disk: once, for a look takes longer than a short run
_looked_for: Final[set[str]] = set()

#: what a process decided for all its work, see `decide`
_decided: Final[list[bool | Literal["kept"] | None]] = [None]

#: functions whose machine code was found on disk
_found: Final[set[Callable[..., Any]]] = set()

#: functions that another process compiles → what waits for it
_beside: Final[dict[Callable[..., Any], Callable[[], object]]] = {}

#: functions that no compiler takes → what is compiled in their place
_TWINS: Final[dict[Any, Any]] = {}

_ROOT: Final = Path(__file__).parent
_IMPORT: Final = re.compile(r"from (heatertune[\w.]*) import (\([^)]*\)|[^\n(]*)|\b(heatertune(?:\.\w+)+)")

_STALE_S: Final = 30 * 86_400.0  # folders that no process used for so long are removed

_choosing: Final = Lock()  # where Numba is told a folder, see `_kept_in`

#: functions → held by the thread that makes their machine code, or waits for it: others must not make it once more
_entering: Final[dict[Callable[..., Any], Lock]] = {}


def runs_compiled_as(twin: Callable[..., Any]) -> Callable[[_Plain], _Plain]:
    """Return a decorator that names what is compiled in a function's place; both must give the same, bit for bit."""

    def register(plain: _Plain) -> _Plain:
        _TWINS[plain] = twin
        return plain

    return register


def decide(compile_all: bool | Literal["kept"] | None) -> bool | Literal["kept"] | None:
    """Let this process run all its work compiled (True), plainly (False), or compiled where machine code is "kept".

    None, as at the start: whatever pays. Returns what was decided before.
    """
    before, _decided[0] = _decided[0], compile_all
    return before


def worth_compiling(
    scans: int, work: str = "loop", most_plain: int | None = None, function: Callable[..., Any] | None = None, *,
    ahead: int = 0,
) -> bool:
    """Return whether a process has by now asked for so many scans that the compiler's start pays, or decided so.

    So the short runs of one command never load the compiler, and long work takes at most twice as long as if it had
    been known from the start. Both ways give the same, bit for bit.

    Args:
        scans: that are asked for now.
        work: what they are of; each counts its own, as what is compiled for one does not help another.
        most_plain: how many plain scans take as long as the compiler's start, by default of the proof's loop.
        function: where its machine code is kept, fewer do, and fewer still where the compiler is there already.
        ahead: scans that are sure to be asked for next.
    """
    decided = _decided[0]
    if decided == "kept":
        return function is not None and is_kept(function)
    if decided is not None:
        return decided
    _scans_asked[work] += scans
    asked = _scans_asked[work] + ahead
    most = _PLAIN_SCANS if most_plain is None else most_plain
    kept = _PLAIN_SCANS_READY if "numba" in sys.modules else _PLAIN_SCANS_KEPT
    if kept < asked <= most and function is not None and work not in _looked_for:
        _looked_for.add(work)
        if is_kept(function):
            _scans_asked[work] = asked = most + 1
    return asked > most


def worth_a_second(scans: int, function: Callable[..., Any], *, most: int, most_kept: int) -> bool:
    """Return whether so many scans are worth a second, faster machine code beside what is there to run them.

    Args:
        scans: that are asked for at once.
        function: the faster one.
        most: scans that take as long as to compile it.
        most_kept: scans that take as long as to load it where its machine code is kept.
    """
    if _decided[0] is False or scans <= most_kept:
        return False
    return (scans > most and _decided[0] != "kept") or is_kept(function)


@remember
def bound(function: _Plain, **given: Callable[..., Any]) -> _Plain:
    """Return a copy of a plain function in which some names of its module mean other functions.

    So a loop takes a controller's functions: Numba keeps on disk only what calls functions by global names.
    """
    assert isinstance(function, FunctionType)
    copy = _copy(function, given)
    names = " ".join(f"{name}={other.__module__}.{other.__qualname__}" for name, other in given.items())
    digest = hashlib.sha256(names.encode()).hexdigest()[:16]  # a file's name must not grow with what is bound in it
    copy.__qualname__ = f"{function.__qualname__}_{digest}"  # by which Numba tells what it has on disk
    return cast(_Plain, copy)


def compiled(function: _Plain, *, allocates: bool = False) -> _Plain:
    """Return the function compiled, arguments by position only; it gives up Python's lock while it runs.

    It is compiled where it is called for the first time with arguments of new types, and kept on disk.

    Args:
        function: a plain function of numbers, tuples and arrays.
        allocates: whether it, or what it calls, makes arrays. Then these are counted and calls stay calls, which costs
            little where a call is long; else nothing is counted and all is one function.
    """
    with _entering.setdefault(function, Lock()):
        return cast(_Plain, _door(function, allocates))


@contextmanager
def made_beside(waits: Mapping[Callable[..., Any], Callable[[], object]]) -> Iterator[None]:
    """Let what the block needs of some functions wait for another process that compiles them.

    What is not found on disk then is compiled.

    Args:
        waits: function → what returns when the other process has done with it.
    """
    _beside.update(waits)
    try:
        yield
    finally:
        for function in waits:
            _beside.pop(function, None)


def machine_code(place: Path, of: str = "compiled-*") -> list[Path]:
    """Return the indices of what is kept compiled in a folder of `heatertune.cache`: one file for each function.

    `of` is the pattern of the folders in it that are looked at.
    """
    return sorted(place.glob(f"{of}/**/*.nbi"))


@remember
def _door(function: Callable[..., Any], allocates: bool) -> Any:
    if function in _beside:
        _beside.pop(function)()
    kept = _place(function)
    if kept is None:
        return _machine(function, allocates=allocates)
    _remove_stale(kept.parent)
    try:
        kept.mkdir(parents=True, exist_ok=True)
        os.utime(kept)  # in use
    except OSError:
        return _machine(function, allocates=allocates)
    with _kept_in(str(kept)):
        return _machine(function, allocates=allocates, cache=True)


def _place(function: Callable[..., Any], *, again: bool = False) -> Path | None:
    """Return the folder of a function's machine code, None where none is kept; `again`: it is looked for often."""
    base, digest = folder(), (_digest_once if again else _digest)(function)
    return None if base is None or digest is None else base / f"compiled-{digest[:16]}"


def is_kept(function: Callable[..., Any]) -> bool:
    """Return whether machine code of a function is on disk, of arguments of whatever types, or soon will be."""
    if function not in _found and function not in _beside:
        place, name = _place(function, again=True), f".{function.__qualname__}-"
        if place is None or not any(name in path.name for path in machine_code(place.parent, place.name)):
            return False
        _found.add(function)
    return True


@remember
def _remove_stale(base: Path) -> None:
    """Remove folders that no process used for a month; one is renamed first, so that nobody meets half of it."""
    for kept in base.glob("compiled-*"):
        with suppress(OSError):
            if time.time() - kept.stat().st_mtime > _STALE_S:
                shutil.rmtree(kept.rename(kept.with_name(f"removed-{kept.name}-{os.getpid()}")))


def _digest(function: Callable[..., Any]) -> str | None:
    """Return a digest of all on which the function's machine code can depend, None where the source is no file.

    These are the files of the functions that are compiled with it, and of whatever they mention of heatertune, and so
    on: types of arguments are among them. Constants come in by value, wherever they are from.
    """
    functions = _functions(function)
    ahead, files = {Path(__file__), *(Path(other.__code__.co_filename) for other in functions)}, set[Path]()
    if not all(path.is_file() for path in ahead):  # typed into a notebook
        return None
    while ahead:
        path = ahead.pop()
        files.add(path)
        ahead |= _mentioned(path) - files
    digest = hashlib.sha256("".join(sorted(map(_constants, functions))).encode())
    for path in sorted(files):
        digest.update(path.read_bytes())
    return digest.hexdigest()


#: for looks again and again: it takes 10 ms, and a process that works changes no constant
_digest_once = remember(_digest)


def _constants(function: FunctionType) -> str:
    named = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    plain = {name: value for name, value in named.items() if isinstance(value, int | float | complex | str | tuple)}
    return f"{function.__module__}.{function.__qualname__} {plain}\n"


@remember
def _mentioned(path: Path) -> frozenset[Path]:
    """Return the files of heatertune whose modules a file mentions, in imports or elsewhere."""
    modules = set()
    for package, names, dotted in _IMPORT.findall(path.read_text(encoding="utf-8")):
        modules |= {dotted} if dotted else {package, *(f"{package}.{name}" for name in re.findall(r"\w+", names))}
    places = [_ROOT.joinpath(*module.split(".")[1:]) for module in modules]
    return frozenset(
        path for place in places for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()
    )


def _functions(function: Callable[..., Any]) -> set[FunctionType]:
    """Return a function and all plain functions that are compiled with it."""
    ahead, seen = [function], set[FunctionType]()
    while ahead:
        plain = ahead.pop()
        if isinstance(plain, FunctionType) and plain not in seen:
            seen.add(plain)
            ahead += [*_called(_plain(plain)).values(), _plain(plain)]
    return seen


def _plain(function: Callable[..., Any]) -> FunctionType:
    """Return what is compiled for a function: itself, or its twin."""
    plain = _TWINS.get(function, function)
    assert isinstance(plain, FunctionType)
    return plain


def _called(function: FunctionType) -> dict[str, FunctionType]:
    """Return the plain functions that a function names."""
    scope = function.__globals__
    named = {name: scope.get(name) for name in function.__code__.co_names}
    return {name: value for name, value in named.items() if isinstance(value, FunctionType)}


@contextmanager
def _kept_in(path: str) -> Iterator[None]:
    """Let Numba choose this folder while a dispatcher is made; other caches stay where they are."""
    from numba import config  # noqa: PLC0415

    with _choosing:
        before, config.CACHE_DIR = config.CACHE_DIR, path
        try:
            yield
        finally:
            config.CACHE_DIR = before


@remember
def _machine(function: Callable[..., Any], *, allocates: bool, cache: bool = False, called: bool = False) -> Any:
    """Return a compiled copy of a plain function whose calls go to compiled copies.

    One that is only called by another needs no door to Python and no entry of its own on disk: half of the compiler's
    work.
    """
    from numba import njit  # noqa: PLC0415 - half a second, which only the compiled world needs

    from heatertune.inlined import Inlined  # noqa: PLC0415 - likewise

    plain = _plain(function)
    inside = {name: _machine(value, allocates=allocates, called=True) for name, value in _called(plain).items()}
    # no exceptions (a step is total), and where nothing is allocated no reference counts and all calls inlined: ten
    # times faster
    options = {"nogil": True, "cache": cache, "_nrt": allocates, "error_model": "numpy"}
    options |= {"forceinline": called and not allocates, "no_cpython_wrapper": called, "no_cfunc_wrapper": called}
    if called:
        options["pipeline_class"] = Inlined
    machine = njit(**options)(_copy(plain, inside))
    if cache:
        kept = machine._cache
        kept.load_overload = partial(_loaded, kept, kept.load_overload)
        kept.save_overload = partial(_saved, kept.save_overload)
    if called:
        machine.get_call_template = partial(_of_types_alone, machine.get_call_template)
    return machine


def _loaded(kept: Any, load: Callable[..., Any], signature: Any, target: Any) -> Any:
    """Load machine code that is kept, without all that the compiler would have to know first: it takes 0.2 s."""
    from numba.core.runtime import rtsys  # noqa: PLC0415 - with the compiler

    target.refresh = partial(rtsys.initialize, target)  # who compiles refreshes the target himself, beside it
    try:
        return load(signature, target)
    except Exception:
        with suppress(OSError):
            kept.flush()
        return None
    finally:
        del target.refresh


def _saved(save: Callable[..., Any], signature: Any, made: Any) -> None:
    """Keep machine code where that can be: the disk may be full, and the folder gone by now."""
    with suppress(OSError):
        save(signature, made)


def _of_types_alone(template: Callable[..., Any], args: Sequence[Any], named: Mapping[str, Any]) -> Any:
    """Choose a called function by the types of its arguments: Numba would compile it anew where one is a constant."""
    from numba.core.types.misc import unliteral  # noqa: PLC0415

    return template(tuple(map(unliteral, args)), {name: unliteral(value) for name, value in named.items()})


def _copy(function: FunctionType, names: Mapping[str, Any]) -> FunctionType:
    scope = function.__globals__ | dict(names)
    copy = FunctionType(function.__code__, scope, function.__name__, function.__defaults__, function.__closure__)
    copy.__module__, copy.__qualname__, copy.__doc__ = function.__module__, function.__qualname__, function.__doc__
    return copy
