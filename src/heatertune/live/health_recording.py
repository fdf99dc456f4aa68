"""Loops that run, by the addresses of their PLCs → their logs in a folder, and loops that name these."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from heatertune.errors import HeatertuneError, InputError
from heatertune.live.client.address import address_of
from heatertune.live.multi_recorder import RecordedLoop, record_all
from heatertune.live.recorder import RecordingSetup
from heatertune.live.signal_map import Places, places_given
from heatertune.loops.inventory import read_list
from heatertune.loops.loop_values import LoopEntry

__all__ = ["is_address", "record_addresses"]


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
        loops: list of the loops, in which `file` is the address; see `heatertune.loops.inventory.read_list`.
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
