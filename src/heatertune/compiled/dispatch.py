"""Where machine code pays, where it is kept, and how it is found again.

A function is compiled together with all functions of heatertune that it calls, from their plain source; importing the
source needs no compiler, and calling what is kept needs none either (`heatertune.compiled.loader`). The folder bears
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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache as remember
from pathlib import Path
from threading import Lock
from types import FunctionType
from typing import Any, Final, Literal, TypeVar, cast

from heatertune.cache import folder, is_as_imported
from heatertune.compiled import plain_functions as check
from heatertune.compiled.loader import MISSED, Code, Kinds, entry, host, kinds_of, signature_text
from heatertune.compiled.plain_functions import callees, plainly
from heatertune.errors import InputError
from heatertune.writing import write_files

if sys.platform != "win32":
    import fcntl

__all__ = [
    "compile_elsewhere", "compile_function", "decide", "has_machine_code", "machine_code", "tricks_hold",
    "worth_a_second", "worth_compiling",
]

_Plain = TypeVar("_Plain", bound=Callable[..., Any])

#: scans after which a process that ran them plainly has spent as long as the compiler's start takes
_PLAIN_SCANS: Final = 80_000

#: the same where machine code of this work is kept, so that it need only be loaded, before and after the loader was
_PLAIN_SCANS_KEPT: Final = 4_000
_PLAIN_SCANS_READY: Final = 1_000

_scans_asked: Final[Counter[str]] = Counter()

#: works whose machine code was looked for on disk: once, for a look takes longer than a short run
_looked_for: Final[set[str]] = set()

#: what a process decided for all its work, see `decide`
_decided: Final[list[bool | Literal["kept"] | None]] = [None]

#: functions whose machine code was found on disk
_found: Final[set[Callable[..., Any]]] = set()

#: functions that another process compiles → what waits for it
_beside: Final[dict[Callable[..., Any], Callable[[], object]]] = {}

_ROOT: Final = Path(__file__).parents[1]
_MENTION: Final = re.compile(r"heatertune((?:\.\w+)*)(?: import (\([^)]*\)|[^\n(]*))?")

_ENDING: Final = ".code"
_PROBE_ENDING: Final = ".probe"  # of the check's machine code, which is no work's
_STALE_S: Final = 30 * 86_400.0  # folders that no process used for so long are removed
_MOST_WAIT_S: Final = 60.0  # for another process that compiles the same: it may have been stopped
_LOOK_S: Final = 0.02

#: functions → held by the thread that makes their machine code, or waits for it: others must not make it once more
_entering: Final[dict[Callable[..., Any], Lock]] = {}


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
        function: where its machine code is kept, fewer do, and fewer still where other code was loaded already.
        ahead: scans that are sure to be asked for next.
    """
    decided = _decided[0]
    if decided == "kept":
        return function is not None and has_machine_code(function)
    if decided is not None:
        return decided
    _scans_asked[work] += scans
    total = _scans_asked[work] + ahead
    most = _PLAIN_SCANS if most_plain is None else most_plain
    least = _PLAIN_SCANS_READY if "llvmlite.binding" in sys.modules else _PLAIN_SCANS_KEPT
    if least < total <= most and function is not None and work not in _looked_for:
        _looked_for.add(work)
        if has_machine_code(function):
            _scans_asked[work] = total = most + 1
    return total > most


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
    return (scans > most and _decided[0] != "kept") or has_machine_code(function)


def compile_function(function: _Plain, *, calls: bool = False) -> _Plain:
    """Return the function compiled, arguments by position only; it gives up Python's lock while it runs.

    It is compiled where it is called for the first time with arguments of new types, and kept on disk.

    Args:
        function: a plain function of numbers, tuples and arrays, in which no array is made.
        calls: whether calls stay calls, which costs little where each is long; else all is one function.
    """
    with _entering.setdefault(function, Lock()):
        return cast(_Plain, _door(function, calls))


@remember
def tricks_hold() -> bool:
    """Return whether machine code may be called directly: the check of this process, see `plain_functions`.

    Where it fails, for whatever reason, all functions take Numba's own path.
    """
    with suppress(Exception):
        if not check.addresses_are_right():
            return False
        arguments, plain = check.probe_arguments(), check.probe_arguments()
        place = _place(check.probe)
        if place is not None:
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
        code = _MachineCode(check.probe, place, calls=False, ending=_PROBE_ENDING)
        result = code.run_directly(arguments)
        expected = check.probe(*plain)
        return type(result) is type(expected) and result == expected and bool((arguments[3] == plain[3]).all())
    return False


@contextmanager
def compile_elsewhere(waits: Mapping[Callable[..., Any], Callable[[], object]]) -> Iterator[None]:
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


def machine_code(place: Path) -> list[Path]:
    """Return the files of what is kept compiled in a folder of `heatertune.cache`: one for each function and kinds."""
    return sorted(place.glob(f"compiled-*/*{_ENDING}"))


@remember
def _door(function: Callable[..., Any], calls: bool) -> _MachineCode:
    if function in _beside:
        _beside.pop(function)()
    place = _place(function)
    if place is not None:
        _remove_stale(place.parent)
        try:
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            place.mkdir(exist_ok=True)
            os.utime(place)  # in use
        except OSError:
            place = None
    return _MachineCode(function, place, calls=calls)


class _MachineCode:
    """A function as machine code: loaded, or compiled, where it is called with arguments of new kinds.

    Attributes:
        found: how many times it was on disk.
        made: how many times it was compiled.
    """

    def __init__(self, function: Callable[..., Any], place: Path | None, *, calls: bool, ending: str = _ENDING) -> None:
        """Take a function, the folder where it is kept, whether its calls stay calls, and how its files end."""
        self._function, self._place, self._calls, self._entering = function, place, calls, Lock()
        self._ending: Final = ending
        self.found, self.made = 0, 0
        self._runs: dict[Kinds, Callable[[tuple[Any, ...]], Any]] = {}
        self._last: Callable[[tuple[Any, ...]], Any] = lambda _arguments: MISSED

    def __call__(self, *arguments: Any) -> Any:
        """Run it: as for the arguments before, where these are of the same kinds."""
        result = self._last(arguments)
        if result is MISSED:
            kinds = kinds_of(arguments)
            run = self._runs.get(kinds) or self._entered(kinds, arguments)
            self._last, result = run, run(arguments)
            assert result is not MISSED, "it was found by these kinds"
        return result

    def _entered(self, kinds: Kinds, arguments: Sequence[Any]) -> Callable[[tuple[Any, ...]], Any]:
        with self._entering:
            if kinds not in self._runs:
                direct = self._direct(kinds, arguments) if tricks_hold() else None
                self._runs[kinds] = direct or self._by_numba()
        return self._runs[kinds]

    def run_directly(self, arguments: tuple[Any, ...]) -> Any:
        """Run it as machine code, unchecked: for the check itself."""
        run = self._direct(kinds_of(arguments), arguments)
        return MISSED if run is None else run(arguments)

    def _by_numba(self) -> Callable[[tuple[Any, ...]], Any]:
        """Return the function on Numba's own path, for arguments of all kinds."""
        self.made += 1
        function = check.numba_function(self._function)
        return lambda arguments: function(*arguments)

    def _direct(self, kinds: Kinds, arguments: Sequence[Any]) -> Callable[[tuple[Any, ...]], Any] | None:
        """Return the function as machine code, None where Numba calls it in a way that the loader does not know."""
        if (code := self._stored_code(kinds)) is None:
            with _compile_in_turn(None if self._place is None else self._place / self._name(kinds)):
                if (code := self._stored_code(kinds)) is None:
                    self.made += 1
                    return self._compiled(kinds, arguments)
        self.found += 1
        return code

    def _stored_code(self, kinds: Kinds) -> Callable[[tuple[Any, ...]], Any] | None:
        """Return the code on disk, None where there is none or it is torn."""
        with suppress(OSError, ValueError):
            return None if self._place is None else entry(
                Code.from_bytes((self._place / self._name(kinds)).read_bytes()), kinds)
        return None

    def _compiled(self, kinds: Kinds, arguments: Sequence[Any]) -> Callable[[tuple[Any, ...]], Any] | None:
        """Compile it, and keep it where that can be: the disk may be full, and the folder gone by now."""
        from heatertune.compiled.numba_compiler import UnknownCall, object_code

        try:
            code = object_code(self._function, arguments, calls=self._calls)
        except UnknownCall:
            return None
        if self._place is not None:
            with suppress(InputError):
                write_files(self._place, {self._name(kinds): code.to_bytes()})
        entry_code = entry(code, kinds)
        assert entry_code is not None, "what the compiler just made needs nothing that is not there"
        return entry_code

    def _name(self, kinds: Kinds) -> str:
        digest = hashlib.sha256(f"{host()} {signature_text(kinds)}".encode()).hexdigest()[:16]
        return f"{_stem(self._function)}{digest}{self._ending}"


@contextmanager
def _compile_in_turn(path: Path | None) -> Iterator[None]:
    """Let one process at a time make a file of machine code; the next one finds it there.

    Where files cannot be locked, and after `_MOST_WAIT_S`, both make it.
    """
    if path is None or sys.platform == "win32":
        yield
        return
    lock, end_s = path.with_suffix(".lock"), time.monotonic() + _MOST_WAIT_S
    with ExitStack() as stack:
        with suppress(OSError):
            file = stack.enter_context(lock.open("w"))
            while time.monotonic() < end_s:
                with suppress(BlockingIOError):
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                time.sleep(_LOOK_S)
        yield
        with suppress(OSError):
            lock.unlink()


def _stem(function: Callable[..., Any]) -> str:
    """Return how the names of a function's files begin."""
    return re.sub(r"\W", "_", function.__qualname__) + "-"


def _place(function: Callable[..., Any]) -> Path | None:
    """Return the folder of a function's machine code, None where none is kept."""
    base, digest = folder(), _digest_once(function)
    return None if base is None or digest is None else base / f"compiled-{digest[:16]}"


def has_machine_code(function: Callable[..., Any]) -> bool:
    """Return whether machine code of a function is on disk, of arguments of whatever kinds, or soon will be."""
    if function not in _found and function not in _beside:
        place = _place(function)
        if place is None or not any(place.glob(f"{_stem(function)}*{_ENDING}")):
            return False
        _found.add(function)
    return True


@remember
def _remove_stale(base: Path) -> None:
    """Remove folders that no process used for a month; one is renamed first, so that nobody meets half of it."""
    for folder_path in base.glob("compiled-*"):
        with suppress(OSError):
            if time.time() - folder_path.stat().st_mtime > _STALE_S:
                shutil.rmtree(folder_path.rename(folder_path.with_name(f"removed-{folder_path.name}-{os.getpid()}")))


def _digest(function: Callable[..., Any]) -> str | None:
    """Return a digest of all on which the function's machine code can depend, None where the source is no file.

    Nor is there one where a file was replaced since this process imported it: the function is that of the old file.

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
    own = (path for path in files if path.is_relative_to(_ROOT))  # what others wrote was imported when they had
    return digest.hexdigest() if is_as_imported(own) else None


#: it takes 10 ms, and a process that works changes no constant
_digest_once = remember(_digest)


def _constants(function: FunctionType) -> str:
    by_name = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    plain = {name: value for name, value in by_name.items() if isinstance(value, int | float | complex | str | tuple)}
    return f"{function.__module__}.{function.__qualname__} {plain}\n"


@remember
def _mentioned(path: Path) -> frozenset[Path]:
    """Return the files of heatertune whose modules a file mentions, in imports or elsewhere."""
    modules = set()
    for package, names in _MENTION.findall(path.read_text(encoding="utf-8")):
        modules |= {package, *(f"{package}.{name}" for name in re.findall(r"\w+", names))} - {""}
    places = [_ROOT.joinpath(*module.split(".")[1:]) for module in modules]
    return frozenset(
        path for place in places for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()
    )


def _functions(function: Callable[..., Any]) -> set[FunctionType]:
    """Return a function and all plain functions that are compiled with it."""
    ahead, visited = [function], set[FunctionType]()
    while ahead:
        plain = ahead.pop()
        if isinstance(plain, FunctionType) and plain not in visited:
            visited.add(plain)
            ahead += [*callees(plainly(plain)).values(), plainly(plain)]
    return visited
