"""What a design needs later, done in a second process while the first one is busy: machine code, and pictures.

Where no machine code of a controller's loop is kept, the compiler needs as long for it as a fit takes. The second
process leaves it on disk and says so, and whoever needs it waits for that. Then it draws the sections of the report
that have pictures, as the first one would. Whatever ends it, the first process compiles what it does not find, and
draws what it was not given.
"""

from __future__ import annotations

import gc
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from queue import SimpleQueue
from threading import Event, Thread
from time import monotonic
from typing import IO, Any, Final

from heatertune.cache import folder
from heatertune.compiled import decide, is_kept, made_beside
from heatertune.errors import HeatertuneError
from heatertune.model.values import Fopdt
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.controller import Controller
from heatertune.plc.pwm import Actuator
from heatertune.processors import processors
from heatertune.proof.loop import in_loop, run_of, simulate
from heatertune.proof.scenario import Scenario

__all__ = ["Beside", "beside"]

#: any design on any heater: machine code is made for types, not for numbers
_DESIGN: Final = PidDesign(gain_pct_per_degC=3.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=5.0,
                           structure="pi", method="")
_HEATER: Final = Fopdt(gain_degC_per_pct=0.4, time_constant_s=170.0, dead_time_s=15.0, ambient_degC=20.0)
_SCENARIO: Final = Scenario(setpoint_degC=40.0, duration_s=60.0)

_PATIENCE_S: Final = 60.0  # who waits longer compiles on his own
_PATIENCE_FOR_PICTURES_S: Final = 10.0  # likewise

_Documents = Mapping[str, Mapping[str, Any]]


class Beside:
    """The second process as the first one sees it; where there is none, nothing is ever drawn by it."""

    def __init__(self, process: subprocess.Popen[bytes] | None, loops: Sequence[str] = ()) -> None:
        self._process = process
        self._made = {name: Event() for name in loops}
        self._asked = dict[str, Event]()
        self._drawn = dict[str, str]()

    def draw(self, documents: _Documents, *names: str) -> None:
        """Have sections of the report drawn, see `heatertune.report.sections`."""
        pipe = None if self._process is None else self._process.stdin
        if pipe is not None:
            asked = {name: Event() for name in names}
            self._asked = self._asked | asked
            Thread(target=_send, args=(pipe, (dict(documents), names)), daemon=True).start()
            if self._process is None:  # by now
                for drawn in asked.values():
                    drawn.set()

    def sections(self) -> dict[str, str]:
        """Return those that were drawn, and wait for those that are still to come."""
        until = monotonic() + _PATIENCE_FOR_PICTURES_S
        for drawn in self._asked.values():
            drawn.wait(max(0.0, until - monotonic()))
        return dict(self._drawn)

    def waits(self, name: str) -> bool:
        """Wait until a loop is compiled, or no more will be."""
        return self._made[name].wait(_PATIENCE_S)

    def listen(self, lines: IO[bytes]) -> None:
        """Take what is made, and in the end that no more will be."""
        for line in lines:
            with suppress(ValueError, TypeError):
                told = json.loads(line)
                if isinstance(told, dict):
                    self._drawn |= {name: text for name, text in told.items()
                                    if name in self._asked and isinstance(text, str)}
                for name in told if isinstance(told, dict) else [told]:
                    for events in (self._made, self._asked):
                        if name in events:
                            events[name].set()
        self._process = None
        for event in (*self._made.values(), *self._asked.values()):
            event.set()


@contextmanager
def beside(target: str) -> Iterator[Beside]:
    """Work beside what is done in the block for a controller's design, and no longer.

    What is compiled are its own loop and that of the two-level control it is compared with. Nothing is begun where
    there is no second processor, or nothing to do: machine code is kept, or cannot be, and this process has drawn
    pictures before, so that it does so at once, and as it may have been told to.
    """
    missing = {name: loop for name, loop in _loops(target) if not is_kept(loop)} if folder() is not None else {}
    wanted = processors() > 1 and (missing or not _has_drawn())
    process = _begun(list(missing)) if wanted else None
    if process is None:
        yield Beside(None)
        return
    second = Beside(process, list(missing))
    listener = Thread(target=second.listen, args=(process.stdout,), daemon=True)
    listener.start()
    try:
        with made_beside({loop: partial(second.waits, name) for name, loop in missing.items()}):
            yield second
    finally:
        process.kill()
        process.wait()
        listener.join()
        with suppress(OSError):  # what it did not read
            process.communicate()


def _has_drawn() -> bool:
    return "matplotlib" in sys.modules


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


def _begun(targets: list[str]) -> subprocess.Popen[bytes] | None:
    """Begin the second process, with the modules of this one; None where that cannot be."""
    if not sys.executable or getattr(sys, "frozen", False):  # no interpreter but a program of its own
        return None
    with suppress(OSError):
        return subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, *targets], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, sys.path))})
    return None


def _send(pipe: IO[bytes], asked: tuple[_Documents, Sequence[str]]) -> None:
    with suppress(OSError, ValueError):  # it has ended
        pipe.write(pickle.dumps(asked))
        pipe.flush()


def _receive(first: IO[bytes], asked: SimpleQueue[tuple[_Documents, Sequence[str]]]) -> None:
    """Take what is asked for, and end this process as soon as the first one has ended."""
    with suppress(EOFError, OSError, pickle.UnpicklingError):
        while True:
            asked.put(pickle.load(first))  # from the process that began this one
    os._exit(1)


def _compile(target: str) -> None:
    """Compile the proof's loop with a controller, by running it for a short time."""
    which = controller_for(target)
    simulate(which, _words(which), _HEATER, _SCENARIO, Actuator(pwm_period_s=10.0), direct=True)


def _work(targets: Sequence[str], asked: SimpleQueue[tuple[_Documents, Sequence[str]]]) -> None:
    """Compile, then draw what is asked for, without end."""
    decide(True)
    for target in targets:
        _compile(target)
        print(json.dumps(target), flush=True)
    from heatertune.report import sections  # noqa: PLC0415 - after what is waited for first
    from heatertune.report.style import new_figure, to_svg  # noqa: PLC0415

    to_svg(new_figure(1, 1.0)[0])  # the first picture takes longest
    while True:
        documents, names = asked.get()
        print(json.dumps(sections(documents, names)), flush=True)


if __name__ == "__main__":
    gc.set_threshold(100_000)  # of all that a compiler makes, little is to be freed
    _asked = SimpleQueue[tuple[_Documents, Sequence[str]]]()
    Thread(target=_receive, args=(sys.stdin.buffer, _asked), daemon=True).start()
    _work(sys.argv[1:], _asked)
