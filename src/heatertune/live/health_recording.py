"""Loops that run, by the addresses of their PLCs → their logs in a folder, and loops that name these.

Many running loops at once → a folder of logs, each recorded as `heatertune.live.recorder` records one.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from heatertune.errors import HeatertuneError, InputError
from heatertune.live.client.address import Address, address_of
from heatertune.live.recorder import RecordingSetup, RecordingState, record
from heatertune.live.signal_map import Places, places_given
from heatertune.loops.loop_values import LoopEntry, read_list

__all__ = ["RecordedLoop", "is_address", "record_addresses", "record_all"]


_LATE: Final = 1.1  # of the time asked for, by this machine's clock: a link that is gone does not hold up the others
_LATE_S: Final = 10.0
_BEAT_S: Final = 0.2


class RecordedLoop(NamedTuple):
    """A loop that runs: the name of its log, where its PLC is, and where that shows what (None: a simulated one)."""

    file: str
    address: Address
    places: Places | None


def record_all(
    loops: Sequence[RecordedLoop], folder: Path, settings: RecordingSetup, *,
    shown: Callable[[int], object] = lambda _: None, ended: Callable[[], bool] = lambda: False,
) -> dict[str, str]:
    """Record loops side by side, each on a connection of its own, and return what went wrong: file → why.

    A loop that cannot be reached, or shows nothing, does not stop the others.

    Args:
        loops: to record.
        folder: that the logs are written to.
        settings: how, with an end.
        shown: called now and then with the rows of all logs so far.
        ended: asked whether it is enough.
    """
    assert settings.for_s is not None
    last_s = time.monotonic() + _LATE * settings.for_s + _LATE_S
    so_far: dict[str, RecordingState] = {}
    wrong: dict[str, str] = {}

    def enough() -> bool:
        return ended() or time.monotonic() > last_s

    def one(loop: RecordedLoop) -> None:
        try:
            told = record(loop.address, folder / loop.file, loop.places, settings, ended=enough,
                          shown=lambda told: so_far.__setitem__(loop.file, told))
            if not told.rows:
                wrong[loop.file] = f"{loop.address.text}: nothing was recorded{_because(told)}"
        except HeatertuneError as problem:
            wrong[loop.file] = str(problem)

    threads = [threading.Thread(target=one, args=(loop,), daemon=True) for loop in loops]
    for thread in threads:
        thread.start()
    for thread in threads:
        while thread.is_alive():
            thread.join(_BEAT_S)
            shown(sum(told.rows for told in list(so_far.values())))
    return wrong


def _because(told: RecordingState) -> str:
    return f": {told.trouble}" if told.trouble else ""


def is_address(text: str) -> bool:
    """Return whether a text is an address, and no path."""
    return "://" in text


def record_addresses(
    addresses: Sequence[str], folder: Path, settings: RecordingSetup, *, loops: str | Path | None = None,
    shown: Callable[[int], object] = lambda _: None, ended: Callable[[], bool] = lambda: False,
) -> tuple[dict[str, LoopEntry], list[dict[str, Any]]]:
    """Record the loops at some addresses; return file → loop of those recorded, and a row for each that was not.

    Args:
        addresses: of their PLCs, which are only read.
        folder: for the logs; it is made, and must not be there.
        settings: how long, and how often.
        loops: list of the loops, in which `file` is the address; see `heatertune.loops.loop_values.read_list`.
        shown: called now and then with the rows so far.
        ended: asked whether it is enough.

    Raises:
        InputError: an address that is none, or given twice; a list that is not right, or names another address; a
            folder that is there; no loop could be recorded.
    """
    told = {} if loops is None else read_list(loops)
    for address in told:
        if address not in addresses:
            raise InputError(f"{loops}: {address!r} is none of the addresses given")
    beside = Path() if loops is None else Path(loops).parent
    found: dict[str, LoopEntry] = {}
    running, wrong = [], {}
    for address in addresses:
        loop = told.get(address, LoopEntry(name=address, file=address))
        file = _file_of(loop.name, found)
        found[file] = replace(
            loop, file=file, folder=None if loop.folder is None else str((beside / loop.folder).absolute()))
        where = address_of(address)
        try:
            running.append(RecordedLoop(file, where, _places(loop, beside)))
        except HeatertuneError as problem:
            wrong[file] = str(problem)
    if len(set(addresses)) < len(addresses):
        raise InputError("an address is given twice; each loop has one")
    try:
        folder.mkdir(parents=True)
    except OSError as problem:
        raise InputError(f"{folder}: cannot be made for the logs: {problem.strerror}") from None
    wrong |= record_all(running, folder, settings, shown=shown, ended=ended)
    if len(wrong) == len(found):
        raise InputError("no loop was recorded: " + "; ".join(dict.fromkeys(wrong.values())))
    rows = [{"name": found[file].name, "file": file, "outcome": "no log", "reason": why} for file, why in wrong.items()]
    return {file: loop for file, loop in found.items() if file not in wrong}, rows


def _file_of(name: str, taken: Mapping[str, object]) -> str:
    """Return a name for a log, none that is taken."""
    stem = re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("_.") or "loop"
    file, number = f"{stem}.csv", 2
    while file in taken:
        file, number = f"{stem}-{number}.csv", number + 1
    return file


def _places(loop: LoopEntry, beside: Path) -> Places | None:
    return places_given(design=None if loop.folder is None else beside / loop.folder,
                        map_file=None if loop.map is None else beside / loop.map)
