"""Many running loops at once → a folder of logs, each recorded as `heatertune.live.recorder` records one."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from heatertune.errors import HeatertuneError
from heatertune.live.client.address import Address
from heatertune.live.recorder import RecordingSetup, RecordingState, record
from heatertune.live.signal_map import Places

__all__ = ["RecordedLoop", "record_all"]

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
