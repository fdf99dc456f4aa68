"""Compile machine code in advance, so that no move of a slider waits for a compiler.

A compiler needs seconds for each controller, and Python's lock meanwhile. It therefore runs in a process of its own,
for the current controller first, and stores the code on disk, once per version of heatertune. Until then the page runs
the loop as plain Python, with bit-identical results.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Sequence

from heatertune.cache import folder
from heatertune.compiled import decide
from heatertune.compiled.loader import host
from heatertune.errors import HeatertuneError
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import TARGETS
from heatertune.studio.loop_settings import StudioSettings, first_look

__all__ = ["compile_all", "warm"]


async def warm(targets: Sequence[str] = tuple(TARGETS)) -> None:
    """Compile the loops of controllers beside the page, and let the page run compiled what is there.

    Where nothing can be kept on disk, or the compiler fails, each loop is compiled where it pays, as anywhere else.

    Args:
        targets: the controllers, that in front first.
    """
    if folder() is None:
        return
    decide("kept")
    try:
        quiet = asyncio.subprocess.DEVNULL  # Ctrl-C reaches it too, and its traceback would be no news
        beside = await asyncio.create_subprocess_exec(
            sys.executable, "-m", __name__, *targets, stdout=quiet, stderr=quiet)
        try:
            done = await beside.wait() == 0
        finally:
            if beside.returncode is None:
                beside.terminate()
        if done:
            await asyncio.to_thread(host)  # what loads machine code: no answer shall wait for it
    except OSError:
        done = False
    decide(True if done else None)


def compile_all(targets: Sequence[str]) -> None:
    """Compile the loops that a first look at each controller runs; one that cannot hold an ordinary PI is left out."""
    decide(True)
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.4, time_constant_s=170.0, dead_time_s=15.0, ambient_degC=20.0))
    for target in targets:
        try:
            first_look(heater, StudioSettings(target=target))
        except HeatertuneError:
            continue


if __name__ == "__main__":
    compile_all(sys.argv[1:2])
    if hasattr(os, "nice"):
        os.nice(19)
    compile_all(sys.argv[2:])
