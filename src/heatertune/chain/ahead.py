"""The compiler's work done beside the fit: in a process of its own, for the controller of the design that follows.

The proof needs machine code of its own, which takes the compiler as long as a fit takes. Where none is kept yet, a
second process compiles it while the first one fits the log, and leaves it on disk. It gives no result, so whatever ends
it changes none; where nothing can be kept on disk, nothing is begun.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

from heatertune.cache import folder
from heatertune.compiled import decide
from heatertune.errors import HeatertuneError
from heatertune.model.values import Fopdt
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.pwm import Actuator
from heatertune.proof.loop import is_compiled, simulate
from heatertune.proof.scenario import Scenario

__all__ = ["Beside", "compile_for", "compiling"]

_HEATER: Final = Fopdt(gain_degC_per_pct=0.4, time_constant_s=170.0, dead_time_s=15.0, ambient_degC=20.0)
_DESIGN: Final = PidDesign(gain_pct_per_degC=3.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=5.0,
                           structure="pi", method="")
_PATIENCE_S: Final = 60.0  # a compiler that takes longer is not waited for


class Beside:
    """The process, once it is begun."""

    def __init__(self, target: str) -> None:
        self._target = target
        self._process: subprocess.Popen[bytes] | None = None

    def begin(self) -> None:
        """Begin the process, where it is of use and can be."""
        if self._process is not None or folder() is None or is_compiled(controller_for(self._target).core):
            return
        with suppress(OSError):
            self._process = subprocess.Popen([sys.executable, "-m", __name__, self._target], stdin=subprocess.DEVNULL,
                                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def wait(self) -> None:
        """Wait until all is compiled, or cannot be."""
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_PATIENCE_S)

    def end(self) -> None:
        """End the process, whatever it is at."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()


@contextmanager
def compiling(target: str) -> Iterator[Beside]:
    """Give what compiles the loop of a controller, to be begun and waited for; it ends with the block at the latest."""
    beside = Beside(target)
    try:
        yield beside
    finally:
        beside.end()


def compile_for(target: str) -> None:
    """Compile the proof's loop with a controller, by running it for a short time."""
    decide(True)
    which = controller_for(target)
    with suppress(HeatertuneError):  # one that cannot hold an ordinary PI is compiled where it is needed
        words = which.encode(_DESIGN, Scaling())
        simulate(which, words, _HEATER, Scenario(setpoint_degC=40.0, duration_s=60.0), Actuator(pwm_period_s=10.0),
                 direct=True)


if __name__ == "__main__":
    compile_for(sys.argv[1])
