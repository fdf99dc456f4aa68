"""Loops measured by the kernel while they run: no trace is kept, so many of them take little time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from heatertune.plc.pwm import Actuator
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.criterion_table import CriterionTable, band_of, periods_at_rest, phases_measured
from heatertune.proof.event_table import events_of
from heatertune.proof.kernel import REST, LoopBatch, TraceArrays
from heatertune.proof.loop import LoopController, program_of, pulses_of, ring_size, run_with, scans_of
from heatertune.proof.meter import COLUMNS, TOTALS, Meter
from heatertune.proof.scenario import Scenario
from heatertune.proof.switch_edges import AS_TOLD

__all__ = ["measure_runs"]

Array = npt.NDArray[np.float64]


def measure_runs(  # noqa: PLR0913 - what differs from loop to loop stands in arrays of its own
    controller: LoopController, rows: Array, scenario: Scenario, actuator: Actuator, limits: LoopLimits,
    noise_degC: Array,
    late_s: Array, sizes: Array | None = None, *, cooling: Array = AS_TOLD, side_by_side: bool = False, ahead: int = 0,
) -> CriterionTable:
    """Run a controller on heaters and return what the kernel's meter found.

    Args:
        controller: the words, running.
        rows: of `Batch.plants`, shape (n, 6).
        scenario: what happens.
        actuator: the switch.
        limits: what is right, and when the time at rest begins.
        noise_degC: of the readings, see `Clock`; a row for each heater, or one for all.
        late_s: of the scans, likewise.
        sizes: by what each disturbance is multiplied, a row for each heater; None: by nothing.
        cooling: by what the power of the cooler is multiplied, see `Batch`.
        side_by_side: whether they run so, all of them fitting (`heatertune.proof.lanes`); it changes no bit.
        ahead: how many such loops are sure to follow.

    Raises:
        ValueError: noise or delay of fewer scans than there are: compiled code would read what lies behind them.
    """
    scans, period, count = scans_of(controller, scenario), actuator.pwm_period_s, len(rows)
    if shorter := [given.shape[1] for given in (noise_degC, late_s) if 1 < given.shape[1] < scans]:
        raise ValueError(f"noise_degC, late_s: of {scans} scans, got {shorter[0]}")
    phases = phases_measured(scenario, limits, (scans - 1) * controller.scan_s, period)
    marks = [(phase.rest_s, REST) for phase in phases if phase.rest_s < phase.end_s]
    periods = periods_at_rest(phases[0], period)
    dead = rows[:, 3].tolist()
    table, totals = np.zeros((count, len(phases) * COLUMNS)), np.zeros((count, TOTALS))
    high, low = np.empty((count, periods)), np.empty((count, periods))
    band = band_of(limits, controller.resolution_degC)
    wrong = sum(1 << place for place, name in enumerate(controller.core.flags) if name in limits.overflow_flags)
    leads = np.array(scenario.leads)
    meter = Meter(True, np.array(scenario.setpoints_degC), band, period, wrong, table, totals, high, low, leads)
    program = program_of(controller, scenario)
    batch = LoopBatch(scans, noise_degC, late_s, rows, *events_of(scenario, dead, sizes, marks), leads, cooling)
    if side_by_side:
        from heatertune.proof.lanes.choice import run_side_by_side  # noqa: PLC0415 - a proof alone must not wait for it

        run_side_by_side(controller, program, batch, actuator, meter)
    else:
        edges = np.empty(ring_size(pulses_of(max(dead) + 3.0 * controller.scan_s + period, actuator)))  # under way
        none = np.empty(0)
        record = TraceArrays(False, none, none, none, none, np.empty(0, dtype=np.int64), none, none, none, none)
        given = (program, batch, actuator.switches, np.inf, edges, record, meter)
        run_with(controller, given, 2 * count * scans, ahead=2 * ahead * scans)  # plain, a measured scan takes two
    ripple = _medians(np.where(high >= low, high - low, np.nan))
    return CriterionTable(
        scenario=scenario, period_s=period, band_degC=band, phases=phases, rows=rows,
        table=table.reshape(count, -1, COLUMNS), totals=totals, ripple=ripple,
    )


def _medians(table: Array) -> Array:
    """Return the median of each row, what is not a number left out: `nanmedian` takes longer than a third of a run."""
    ordered, rows = np.sort(table, axis=1), np.arange(len(table))  # what is not a number comes last
    numbers = np.count_nonzero(~np.isnan(table), axis=1)
    below, above = ordered[rows, np.maximum(numbers - 1, 0) // 2], ordered[rows, numbers // 2]
    return np.asarray((below + above) / 2.0)
