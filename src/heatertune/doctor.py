"""Whether this installation works: versions, solvers, caches, extras, paper tables. It changes nothing."""

from __future__ import annotations

import os
import platform
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module, metadata
from pathlib import Path
from typing import Any, Final

from heatertune.cache import folder, not_private

__all__ = ["SCHEMA", "InstallationCheck", "document", "examine", "works"]

SCHEMA: Final = "heatertune/doctor/2"

#: the oldest Python, as pyproject.toml has it
_PYTHON: Final = (3, 11)
_REQUIREMENT: Final = re.compile(r"([A-Za-z0-9._-]+)\s*([^;]*)(?:.*extra\s*==\s*['\"]([^'\"]+)['\"])?")
_OLDEST: Final = re.compile(r">=\s*([0-9.]+)")
_BEFORE: Final = re.compile(r"<\s*([0-9.]+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class InstallationCheck:
    """One thing that was looked at.

    Attributes:
        name: what it is.
        value: what was found, one line.
        ok: whether it works.
        required: whether heatertune cannot do its main job without it.
        remedy: what to do where it does not work, empty otherwise.
    """

    name: str
    value: str
    ok: bool
    required: bool = True
    remedy: str = ""


def examine() -> tuple[InstallationCheck, ...]:
    """Return all findings; nothing that is broken makes this fail."""
    return (_python(), *_packages(), _ipopt(), _tables(), _machine_code(), _results(), _compiled(), *_extras())


def works(findings: Sequence[InstallationCheck]) -> bool:
    """Return whether all that heatertune needs works."""
    return all(finding.ok for finding in findings if finding.required)


def document(findings: Sequence[InstallationCheck]) -> dict[str, Any]:
    """Return the JSON document: well, and one object per finding."""
    return {"schema": SCHEMA, "well": works(findings), "findings": [asdict(finding) for finding in findings]}


def _python() -> InstallationCheck:
    version = ".".join(map(str, _PYTHON))
    return InstallationCheck(
        name="Python", value=f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        ok=sys.version_info >= _PYTHON, remedy=f"install Python {version} or newer",
    )


def _requirements() -> Iterator[tuple[str, str, str]]:
    """Yield name, versions ("" for any) and extra ("" for none) of all that heatertune's own metadata names."""
    for line in metadata.requires("heatertune") or ():
        match = _REQUIREMENT.match(line)
        if match:
            yield match[1], match[2].strip(" ()"), match[3] or ""


def _packages() -> Iterator[InstallationCheck]:
    try:
        needed = [(name, versions) for name, versions, extra in _requirements() if not extra]
        yield InstallationCheck(name="heatertune", value=metadata.version("heatertune"), ok=True)
    except metadata.PackageNotFoundError:
        yield InstallationCheck(name="heatertune", value="runs from its source, not installed", ok=True, required=False,
                      remedy="pip install . checks and brings what it needs")
        return
    for name, versions in needed:
        yield _package(name, versions)


def _package(name: str, versions: str) -> InstallationCheck:
    """Return the finding of a package, whose versions are as in heatertune's metadata: `>=0.60,<0.69`."""
    remedy = f"pip install --upgrade '{name}{versions}'"
    try:
        version = metadata.version(name)
        import_module(name.replace("-", "_"))
    except metadata.PackageNotFoundError:
        return InstallationCheck(name=name, value="not installed", ok=False, remedy=remedy)
    except Exception as problem:  # a broken package may raise anything, and is to be told
        return InstallationCheck(name=name, value=f"{version}, but cannot be imported: {_one_line(problem)}", ok=False,
                       remedy=remedy)
    oldest, before = _OLDEST.search(versions), _BEFORE.search(versions)
    ok = (oldest is None or _numbers(version) >= _numbers(oldest[1])) and (
        before is None or _numbers(version) < _numbers(before[1]))
    return InstallationCheck(name=name, value=version, ok=ok, remedy=remedy)


def _numbers(version: str) -> tuple[int, ...]:
    """Return the leading numbers of a version: "3.6.5rc1" is (3, 6, 5)."""
    return tuple(int(part) for part in re.findall(r"(?:^|\.)(\d+)", version.partition("+")[0]))


def _guarded(name: str, remedy: str, look: Callable[[], tuple[str, bool]]) -> InstallationCheck:
    try:
        state, ok = look()
    except Exception as problem:  # as in _package
        state, ok = _one_line(problem), False
    return InstallationCheck(name=name, value=state, ok=ok, remedy=remedy)


def _one_line(problem: Exception) -> str:
    return f"{type(problem).__name__}: {' '.join(str(problem).split())}"[:200]


def _ipopt() -> InstallationCheck:
    """Solve min (x − 3)² subject to x ≤ 2, whose answer is 2."""

    def look() -> tuple[str, bool]:
        import casadi

        x = casadi.MX.sym("x")
        silent: dict[str, Any] = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}
        answer = casadi.nlpsol("doctor", "ipopt", {"x": x, "f": (x - 3.0) ** 2}, silent)(ubx=2.0)
        least = float(answer["x"])
        return f"in CasADi {metadata.version('casadi')}; solves its test problem: {least:.4f}", abs(least - 2.0) < 1e-4

    return _guarded("IPOPT", "pip install --force-reinstall casadi", look)


def _tables() -> InstallationCheck:
    def look() -> tuple[str, bool]:
        from heatertune.log import read_log
        from heatertune.log.log_values import BUILT_IN

        return ", ".join(f"{name}: {len(read_log(name).time_s)} readings" for name in BUILT_IN), True

    return _guarded("paper tables", "install heatertune again", look)


def _machine_code() -> InstallationCheck:
    """Make the check of the tricks with which machine code is called."""
    from heatertune.compiled import tricks_hold

    holds = tricks_hold()
    return InstallationCheck(
        name="machine code", value="called directly" if holds else "on Numba's own path: right, but each run compiles",
        ok=holds, required=False, remedy="install the releases of Numba and llvmlite that heatertune asks for")


_PRIVATE: Final = "set HEATERTUNE_CACHE to a folder of your own that other users may not write"


def _results() -> InstallationCheck:
    place = folder()
    if (why := not_private()) is not None:
        return InstallationCheck(name="cache of results", value=why, ok=False, required=False, remedy=_PRIVATE)
    if place is None:
        return InstallationCheck(name="cache of results", value="switched off", ok=True, required=False)
    files = list(place.glob("*.json")) if place.is_dir() else []
    megabytes = sum(file.stat().st_size for file in files) / 1e6
    return InstallationCheck(
        name="cache of results", value=f"{place}: {len(files)} results, {megabytes:.1f} MB", ok=_writable(place),
        required=False, remedy="set HEATERTUNE_CACHE to a writable folder; without it every fit is repeated",
    )


def _compiled() -> InstallationCheck:
    """Tell where machine code is kept, and how much of it is there."""
    from heatertune.compiled import machine_code

    place = folder()
    if place is None:
        off = "switched off: every process compiles"
        return InstallationCheck(name="cache of compiled code", value=off, ok=True, required=False)
    code = machine_code(place)
    megabytes = sum(path.stat().st_size for path in code) / 1e6
    state = f"warm, {len(code)} functions, {megabytes:.1f} MB" if code else "cold: the first run compiles some seconds"
    return InstallationCheck(
        name="cache of compiled code", value=f"{place}; {state}", ok=_writable(place), required=False,
        remedy="set HEATERTUNE_CACHE to a folder that can be written; without it every process compiles",
    )


def _writable(place: Path) -> bool:
    """Return whether a folder can be written, or made where it is missing."""
    while not place.exists() and place != place.parent:
        place = place.parent
    return place.is_dir() and os.access(place, os.W_OK | os.X_OK)


def _extras() -> Iterator[InstallationCheck]:
    try:
        pairs = [(name, extra) for name, _, extra in _requirements() if extra]
    except metadata.PackageNotFoundError:
        return
    for extra in sorted({extra for _, extra in pairs}):
        missing = [name for name, of in pairs if of == extra and not _installed(name)]
        yield InstallationCheck(
            name=f"extra {extra}", value=f"missing: {', '.join(missing)}" if missing else "complete", ok=not missing,
            required=False, remedy=f"pip install 'heatertune[{extra}]'",
        )


def _installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True
