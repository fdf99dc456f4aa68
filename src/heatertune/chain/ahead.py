"""The proof's loop compiled in a second process while the first one fits the log.

Where no machine code of a controller's loop is kept, the compiler needs as long for it as a fit takes. The second
process leaves it on disk and says so, and whoever needs it waits for that. It gives no result: whatever ends it, the
first process compiles what it does not find.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from threading import Event, Thread
from typing import IO, Any, Final

from heatertune.cache import folder
from heatertune.compiled import decide, is_kept, made_beside
from heatertune.errors import HeatertuneError
from heatertune.model.values import Fopdt
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.controller import Controller
from heatertune.plc.pwm import Actuator
from heatertune.proof.loop import in_loop, run_of, simulate
from heatertune.proof.scenario import Scenario

__all__ = ["compiling", "processors"]

#: any design on any heater: machine code is made for types, not for numbers
_DESIGN: Final = PidDesign(gain_pct_per_degC=3.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=5.0,
                           structure="pi", method="")
_HEATER: Final = Fopdt(gain_degC_per_pct=0.4, time_constant_s=170.0, dead_time_s=15.0, ambient_degC=20.0)
_SCENARIO: Final = Scenario(setpoint_degC=40.0, duration_s=60.0)

_PATIENCE_S: Final = 60.0  # who waits longer compiles on his own


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def compiling(target: str) -> Iterator[None]:
    """Compile the loops that a design for a controller needs beside what is done in the block, and no longer.

    They are its own and that of the two-level control it is compared with. Nothing is begun where they are kept, where
    nothing can be kept, or where there is no second processor.
    """
    missing = {name: loop for name, loop in _loops(target) if not is_kept(loop)}
    process = _begun(list(missing)) if missing and folder() is not None and processors() > 1 else None
    if process is None:
        yield
        return
    made = {name: Event() for name in missing}
    listener = Thread(target=_listen, args=(process.stdout, made), daemon=True)
    listener.start()
    with process, made_beside({loop: partial(made[name].wait, _PATIENCE_S) for name, loop in missing.items()}):
        try:
            yield
        finally:
            process.kill()
            listener.join()


def _loops(target: str) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Give the loops of a controller and of what it is compared with, by target."""
    for name in filter(None, (target, controller_for(target).baseline)):
        with suppress(HeatertuneError):  # one that cannot hold such a design is compiled where it is needed
            which = controller_for(name)
            core = in_loop(which, _words(which), _SCENARIO.setpoints_degC, {}, direct=True).core
            if core.compiles:
                yield name, run_of(core)


def _words(controller: Controller) -> Words:
    return controller.encode(replace(_DESIGN, sample_time_s=controller.timer.round(_DESIGN.sample_time_s)), Scaling())


def _begun(targets: list[str]) -> subprocess.Popen[str] | None:
    """Begin the second process, with the modules of this one; None where that cannot be."""
    if not sys.executable or getattr(sys, "frozen", False):  # no interpreter but a program of its own
        return None
    with suppress(OSError):
        return subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, *targets], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True, env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, sys.path))})
    return None


def _listen(lines: IO[str], made: Mapping[str, Event]) -> None:
    """Pass on what is made, and in the end that no more will be."""
    for line in lines:
        if line.strip() in made:
            made[line.strip()].set()
    for event in made.values():
        event.set()


def _end_with(first: IO[str]) -> None:
    """End this process as soon as the first one has ended."""
    first.read()
    os._exit(1)


def _compile(target: str) -> None:
    """Compile the proof's loop with a controller, by running it for a short time, and say so."""
    which = controller_for(target)
    simulate(which, _words(which), _HEATER, _SCENARIO, Actuator(pwm_period_s=10.0), direct=True)
    print(target, flush=True)


if __name__ == "__main__":
    Thread(target=_end_with, args=(sys.stdin,), daemon=True).start()
    decide(True)
    for _name in sys.argv[1:]:
        _compile(_name)
