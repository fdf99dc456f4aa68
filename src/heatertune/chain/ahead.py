"""The compiler's work done beside the fit: in a process of its own, for the design that follows.

Tuning and proof need machine code of their own, which takes the compiler as long as a fit takes. Where none is kept
yet, a second process carries the same design out for a heater given by hand while the first one fits the log, and what
it compiled is found on disk. It gives no result, so whatever ends it changes none; where nothing can be kept on disk,
nothing is begun.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Final

from heatertune.cache import folder
from heatertune.compiled import decide
from heatertune.errors import HeatertuneError
from heatertune.model.by_hand import model_by_hand
from heatertune.model.values import Fopdt
from heatertune.plc import controller_for
from heatertune.proof.closing import Asked, closed
from heatertune.proof.loop import is_compiled

__all__ = ["Beside", "compile_for", "compiling"]

_HEATER: Final = Fopdt(gain_degC_per_pct=0.4, time_constant_s=170.0, dead_time_s=15.0, ambient_degC=20.0)
_PATIENCE_S: Final = 60.0  # a compiler that takes longer is not waited for


class Beside:
    """The process, once it is begun."""

    def __init__(self, asked: Asked) -> None:
        self._asked = asked
        self._process: subprocess.Popen[bytes] | None = None

    def begin(self) -> None:
        """Begin the process, where it is of use and can be."""
        if self._process is not None or folder() is None or is_compiled(controller_for(self._asked.target).core):
            return
        quiet = subprocess.DEVNULL
        with suppress(OSError):
            self._process = subprocess.Popen([sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=quiet,
                                             stderr=quiet)
            assert self._process.stdin is not None
            with self._process.stdin as asked:
                asked.write(pickle.dumps(self._asked))

    def wait(self) -> None:
        """Wait until all is compiled, or cannot be."""
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_PATIENCE_S)


@contextmanager
def compiling(asked: Asked) -> Iterator[Beside]:
    """Give what compiles for a design, to be begun and waited for; it ends with the block at the latest."""
    beside = Beside(asked)
    try:
        yield beside
    finally:
        if beside._process is not None:
            beside._process.kill()
            beside._process.wait()


def compile_for(asked: Asked) -> None:
    """Carry a design out on a heater given by hand, with all of it compiled."""
    decide(True)
    setpoint = asked.conditions.setpoint_degC
    asked = replace(asked, as_is=True, conditions=replace(asked.conditions, setpoint_degC=setpoint or 40.0))
    with suppress(HeatertuneError):  # a heater that these conditions do not suit; what was reached is compiled
        closed(model_by_hand(_HEATER), asked)


if __name__ == "__main__":
    compile_for(pickle.load(sys.stdin.buffer))
