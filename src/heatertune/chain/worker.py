"""The second process of a design: it compiles and draws at the request of the first (`heatertune.chain.precompile`)."""

from __future__ import annotations

import gc
import json
import os
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from queue import SimpleQueue
from threading import Thread
from typing import IO, Any, Final

from heatertune.chain.precompile import text_for
from heatertune.codec import Document
from heatertune.compiled import decide
from heatertune.errors import HeatertuneError
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.controller import Controller
from heatertune.plc.pwm import Actuator
from heatertune.proof.loop import in_loop, run_of, simulate
from heatertune.proof.scenario import Scenario

__all__ = ["loops"]

#: any design on any heater: machine code is made for types, not for numbers
_DESIGN: Final = PidDesign(gain_pct_per_degC=3.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=5.0,
                           structure="pi", method="")
_HEATER: Final = Fopdt(gain_degC_per_pct=0.4, time_constant_s=170.0, dead_time_s=15.0, ambient_degC=20.0)
_SCENARIO: Final = Scenario(setpoint_degC=40.0, duration_s=60.0)


def loops(target: str) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Return the loops of a controller and of the two-level control for comparison, by target.

    Raises:
        InputError: no such controller.
    """
    for name in filter(None, (target, controller_for(target).baseline)):
        with suppress(HeatertuneError):  # a controller that cannot hold such a design is compiled on demand
            which = controller_for(name)
            core = in_loop(which, _words(which), _SCENARIO.setpoints_degC, {}, direct=True).core
            if core.compiles:
                yield name, run_of(core)


def _words(controller: Controller) -> Words:
    return controller.encode(replace(_DESIGN, sample_time_s=controller.timer.round(_DESIGN.sample_time_s)), Scaling())


def _compile(target: str) -> None:
    """Compile the proof's loop with a controller, by running it for a short time."""
    which = controller_for(target)
    simulate(which, _words(which), _HEATER, _SCENARIO, Actuator(pwm_period_s=10.0), direct=True)


def _receive(first: IO[bytes], requests: SimpleQueue[Any], drawn: set[int]) -> None:
    """Receive requests and cancellations; end this process as soon as the first one has ended."""
    with suppress(EOFError, OSError, pickle.UnpicklingError):
        while True:
            message = pickle.load(first)  # from the process that began this one
            if isinstance(message, int):
                drawn.add(message)
            else:
                requests.put(message)
    os._exit(1)


def _work(requests: SimpleQueue[Any], drawn: set[int], compiles: bool) -> None:
    """Compile as requested, then draw sections that the first process has not drawn, until the process ends."""
    if compiles:
        import numba  # noqa: F401
    else:
        _draw_first()
    targets: Sequence[str] = requests.get()
    decide(True)
    for target in targets:
        _compile(target)
        print(json.dumps(target), flush=True)
    if compiles:
        _draw_first()
    with suppress(ImportError):  # what the second opinion needs, while nothing is asked for
        import control  # noqa: F401
    documents: Mapping[str, Document]
    while True:
        request, documents, name = requests.get()
        if request not in drawn:
            print(json.dumps([request, name, text_for(documents, name)]), flush=True)


def _draw_first() -> None:
    """Draw nothing: the first picture takes longest."""
    from heatertune.report.plots import new_figure, to_svg

    to_svg(new_figure(1, 1.0)[0])


if __name__ == "__main__":
    gc.set_threshold(100_000)  # of all that a compiler makes, little is to be freed
    _asked = SimpleQueue[Any]()
    _drawn = set[int]()
    Thread(target=_receive, args=(sys.stdin.buffer, _asked, _drawn), daemon=True).start()
    _work(_asked, _drawn, "compiles" in sys.argv)
