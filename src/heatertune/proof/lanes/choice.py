"""Which loops are run side by side, and how."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import bound, compile_function, worth_a_second
from heatertune.plc.core import as_it_is, started_as_it_is
from heatertune.plc.pwm import INSTANT_S, Actuator
from heatertune.plc.single_precision import to_single
from heatertune.proof.kernel import LoopBatch, SetpointProgram, setpoint_word_now
from heatertune.proof.lanes import passes as one
from heatertune.proof.lanes import two_lags as two
from heatertune.proof.lanes.passes import LANES, ROWS, constant_function, ring_for, rows_of, run_scan
from heatertune.proof.lanes.side_by_side import group, run_in_lanes, started_up
from heatertune.proof.loop import LoopController
from heatertune.proof.meter import Meter
from heatertune.proof.scenario import Scenario

__all__ = ["fits", "order_by_edges", "pays", "run_side_by_side"]


#: scans from which on it pays to compile the loop once more: one after the other they take as long; and to load it
_MOST: Final = 100_000_000
_MOST_KEPT: Final = 600_000
_PER_PERIOD: Final = 3.0  # a PWM period takes as long as so many scans
_MOST_FLAGS: Final = 8  # of which `meter.faults` counts

#: scans that this process asked for so far, of each loop
_asked: Final[Counter[str]] = Counter()


def pays(controller: LoopController, actuator: Actuator, scans: int, *, two_lags: bool) -> bool:
    """Return whether a process has by now asked for so much that machine code pays which runs loops side by side.

    It is compiled where one after the other takes as long, so no work takes more than twice as long for it.

    Args:
        controller: the words, running.
        actuator: the switch.
        scans: that one processor is to run now.
        two_lags: whether their heaters have two lags, which is machine code of its own.
    """
    if not _has_rows(controller):
        return False
    run, _ = _loop_and_rows(controller, two_lags=two_lags)
    _asked[run.__qualname__] += int(scans * (1.0 + _PER_PERIOD * controller.scan_s / actuator.pwm_period_s))
    return worth_a_second(_asked[run.__qualname__], run, most=_MOST, most_kept=_MOST_KEPT)


def fits(controller: LoopController, scenario: Scenario, actuator: Actuator, late_s: Array) -> bool:
    """Return whether loops can be among those that run side by side, see `run_in_lanes`.

    Args:
        controller: the words, running.
        scenario: what happens.
        actuator: the switch.
        late_s: delays of the scans, shape (n, scans), or (1, 1) where all have the same.
    """
    calm = late_s.shape[1] == 1 and not late_s.any()
    alike = not any(scenario.leads[2::4]) and actuator.cooling_gain is None
    return calm and alike and _has_rows(controller)


def order_by_edges(plants: Array, setpoint_degC: float, period_s: float) -> npt.NDArray[np.intp]:
    """Return an order, shape (n,), in which heaters stand together that feel a PWM period's edges in the same scans.

    Switched on they are a dead time after its begin, switched off by as much later as they need to stay at the
    setpoint: slices of like dead times are ordered by that, so many that both lie about as far apart in a group.

    Args:
        plants: rows of `Batch.plants`, shape (n, 6).
        setpoint_degC: at which they are for the most part.
        period_s: PWM period [s].
    """
    dead, on = plants[:, 3], period_s * np.clip((setpoint_degC - plants[:, 4]) / (100.0 * plants[:, 0]), 0.0, 1.0)
    groups = max(len(plants) / LANES, 1.0)
    slices = min(max(math.sqrt(groups * float(np.std(dead)) / max(float(np.std(on)), INSTANT_S)), 1.0), groups)
    places = np.empty(len(plants), dtype=np.intp)
    places[np.argsort(dead, kind="stable")] = np.arange(len(plants))
    return np.lexsort((on, places // (LANES * math.ceil(groups / slices))))


def run_side_by_side(controller: LoopController, program: SetpointProgram, batch: LoopBatch, actuator: Actuator,
                     meter: Meter) -> None:
    """Run loops that fit; what they amount to is in the meter. Like heaters should stand together, see `alike`.

    Args:
        controller: the words, running.
        program: around the controllers.
        batch: what differs from loop to loop; either all heaters have one lag, or all have two.
        actuator: the switch.
        meter: what is measured.
    """
    run, end = _loop_and_rows(controller, two_lags=bool(batch.plants[0, 2]))
    parameters, state = _in_precision(controller, controller.parameters), _in_precision(controller, controller.state)
    run_compiled = compile_function(run)
    restarts = int(np.count_nonzero(np.diff(program.supplied) > 0))
    ring = ring_for(float(batch.plants[:, 3].max()), controller.scan_s, actuator.pwm_period_s, restarts)
    run_compiled(parameters, state, controller.sensor, controller.scan_s, _in_precision(controller, program), batch,
                 actuator.switches, np.zeros((end + 1) * LANES), ring, meter)


def _in_precision(controller: LoopController, value: Any) -> Any:
    return to_single(value) if controller.core.singles else value


def _has_rows(controller: LoopController) -> bool:
    """Return whether a controller is one of those whose scan a compiler makes vector instructions of."""
    core = controller.core
    if not (core.compiles and core.own is as_it_is and core.cold_start is started_as_it_is
            and len(core.flags) <= _MOST_FLAGS):
        return False
    try:
        rows_of(controller.state)
    except TypeError:
        return False
    return True


def _loop_and_rows(controller: LoopController, *, two_lags: bool) -> tuple[Callable[..., None], int]:
    """Return the loop for a controller, and how many rows it needs."""
    core = controller.core
    setpoint = _in_precision(controller, np.array(controller.setpoints))[0]
    law = rows_of((_in_precision(controller, controller.state), setpoint if core.singles else setpoint.item()), ROWS)
    scan = bound(run_scan, step=core.step, measure=core.measure, law_loaded=law.loaded, law_stored=law.stored,
                 lane_parameters=constant_function(_in_precision(controller, controller.parameters)),
                 setpoint_word_now=bound(setpoint_word_now, setpoint_word=core.store_setpoint))
    again = bound(started_up, law_loaded=law.loaded, law_stored=law.stored, warm_state=core.warm_start)
    loops = bound(group, run_scan=scan, quickly=two.quickly if two_lags else one.quickly, law_stored=law.stored,
                  started_up=again)
    return bound(run_in_lanes, group=loops), law.end
