"""Which heater a virtual PLC has behind it, and what it lives through: the proof's own, or one drawn as samples are."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from heatertune.errors import InputError
from heatertune.live.fault_schedule import ScheduledFault, heater_events, touch_mains
from heatertune.model.values import FittedModel
from heatertune.plc import Words, controller_for
from heatertune.plc.pwm import Actuator
from heatertune.proof.event_table import events_of
from heatertune.proof.events import SetpointRampEvent
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.kernel import LOAD, MAINS
from heatertune.proof.loop import LoopController, actuator_of, check_words, in_loop, plant_row
from heatertune.proof.monte_carlo.run import drawing_for
from heatertune.proof.monte_carlo.scan_noise import BLOCK, block_of
from heatertune.proof.prove_words import actuator_for, course_for, setpoints_for
from heatertune.proof.scenario import Mains, PlcPower, Scenario, delay_heater
from heatertune.settings import Conditions
from heatertune.units import check

__all__ = ["SensorNoise", "VirtualPlant", "plan_for"]


class SensorNoise:
    """The noise of a sensor, scan by scan without an end [°C]; the same numbers as an array of them has."""

    def __init__(self, block: Callable[[int], list[float]], sigma_degC: float) -> None:
        """Take what blocks of numbers give.

        Args:
            block: number of a block → standard normal numbers of its `BLOCK` scans; asked for in order.
            sigma_degC: standard deviation [°C].
        """
        self._block, self._sigma = block, sigma_degC
        self._number, self._drawn = -1, list[float]()

    def __len__(self) -> int:
        return sys.maxsize

    def __getitem__(self, scan: int) -> float:
        """Return the noise of a scan; scans are asked for in order, each as often as it is wanted."""
        while scan >= BLOCK * (self._number + 1):
            self._number += 1
            self._drawn = [self._sigma * number for number in self._block(self._number)]
        return self._drawn[scan - BLOCK * self._number]


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualPlant:
    """A heater, a controller and what happens, as the proof's kernel takes them.

    Attributes:
        loop: the words, running, with the settings of what the manual leaves open.
        row: of `Batch.plants`.
        events: instants [s], kinds and values, in order, the last instant infinite.
        noise: of the readings [°C].
        scenario: what is asked for, and what happens but for the faults.
        actuator: the switch.
        faults: the timetable.
    """

    loop: LoopController
    row: Sequence[float]
    events: tuple[list[float], list[int], list[float]]
    noise: SensorNoise | list[float]
    scenario: Scenario
    actuator: Actuator
    faults: tuple[ScheduledFault, ...]


def plan_for(
    words: Words, fitted: FittedModel, conditions: Conditions, *, sample: int | None = None, story: bool = False,
    spread: Mapping[str, float] | None = None, faults: Sequence[ScheduledFault] = (),
) -> VirtualPlant:
    """Return what a virtual PLC runs: at rest at the ambient first, and then the setpoint.

    Args:
        words: that the PLC holds at the beginning.
        fitted: the heater.
        conditions: setpoint, switch, noise, settings of what the manual leaves open.
        sample: seed of the heater that is drawn, as `heatertune verify --replay` does; None: the working model.
        story: whether the proof's story happens; else nothing does but the faults.
        spread: as for `heatertune.proof.monte_carlo.run.replay_document`.
        faults: the timetable.

    Raises:
        InputError: a profile, which is not served; a story whose mains change beside faults that change them too.
        OutOfRange, UnknownName: as `heatertune.proof.monte_carlo.run.replay_document`.
    """
    controller = controller_for(words.target)
    setpoint, farthest = setpoints_for(fitted, conditions)
    family = [model for _, model in holding_heaters(fitted, farthest)]
    scenario = course_for(words, family, conditions, setpoint).scenario
    factors, switches = np.ones(len(scenario.disturbances)), dict(conditions.switches)
    if sample is None:
        model = delay_heater(fitted.model, controller.delayed_s(words.scaling))
        row = plant_row(model, scenario)
        block = partial(_next_block, np.random.default_rng(scenario.seed))
    else:
        check("sample", sample, least=0)
        drawing = drawing_for(words, fitted, spread or {}, conditions)
        (row,), (factors,) = (part.tolist() for part in drawing.heaters_of([sample]))
        block = partial(block_of, sample)
        switches = dict(drawing.controllers[0].switches)
        scenario = replace(drawing.scenario, ambient_degC=row[4], start_degC=row[5], seed=sample)
    if not story:
        scenario, factors = replace(scenario, disturbances=(), rests_s=()), np.ones(0)
    _demand_served(scenario, faults)
    check_words(controller, words, scenario)
    loop = in_loop(controller, words, scenario.setpoints_degC, switches)
    return VirtualPlant(
        loop=loop, row=[float(number) for number in row], events=_events(scenario, row, factors, faults),
        noise=SensorNoise(block, scenario.noise_degC) if scenario.noise_degC > 0.0 else [0.0], scenario=scenario,
        actuator=actuator_of(loop, actuator_for(conditions, words)), faults=tuple(faults))


def _next_block(generator: np.random.Generator, _number: int) -> list[float]:
    return [float(number) for number in generator.standard_normal(BLOCK)]


def _demand_served(scenario: Scenario, faults: Sequence[ScheduledFault]) -> None:
    if any(isinstance(event, SetpointRampEvent) for event in scenario.disturbances):
        raise InputError("simulate does not run profiles: leave out --profile, or --story")
    if touch_mains(faults) and any(isinstance(event, Mains | PlcPower) for event in scenario.disturbances):
        raise InputError("the test sequence switches the mains itself: leave out --story, or such faults")


def _events(
    scenario: Scenario, row: Sequence[float], factors: Any, faults: Sequence[ScheduledFault]
) -> tuple[list[float], list[int], list[float]]:
    """Return the events of a scenario, sizes drawn, with those of the faults among them."""
    own = zip(*(column[0].tolist() for column in events_of(scenario, [row[3]], np.array([factors]))), strict=True)
    merged = sorted([*own, *heater_events(faults, row[0], row[3])])
    times, kinds, values = (list(column) for column in zip(*merged, strict=True))
    assert math.isinf(times[-1])
    assert {LOAD, MAINS}.issuperset(kinds[-1:])
    return times, kinds, values
