"""The curves that a report draws of a proof: the loop, its robustness, and the ideal design on the same heater."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.codec import construct_from, encode
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.pid.design_document import BoostView
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import frequencies, loop_response
from heatertune.plc import controller_for
from heatertune.plc.core import StepFunctions
from heatertune.plc.pwm import Actuator
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.loop import LoopController, run_loop
from heatertune.proof.proof import Proof
from heatertune.proof.proof_document import CurveView, OtherRunView, PhaseView, PicturesView, SeriesView
from heatertune.proof.scenario import Scenario, delay_heater, event_name, phases_of
from heatertune.proof.trace import Trace

__all__ = ["curve_series", "pictures", "proven_heaters", "robustness", "simulate_wish", "trace_series"]


_POINTS: Final = 1600
_AT_REST: Final = 0.05  # of the points that as long a time has elsewhere
_SEEN_PCT: Final = 0.2  # a smaller change of the power asked for is not seen in a picture
_MANY: Final = 4000  # scans or edges of a trace, from which on those are left out that no picture shows
_EVERY: Final = 25  # scans of which one is kept all the same, for whoever points at it
_NEAR_S: Final = (600.0, 1800.0)  # before and after the first disturbance, where many edges are kept


def trace_series(trace: Trace, label: str) -> dict[str, Any]:
    """Return one run as lists: temperature at instants that are sparse at rest, power asked for, switching instants.

    The setpoint that was followed is at the instants of the power asked for, and None where it never moved.
    """
    time, scans, edges = _instants(trace), _changing(trace), _edges(trace)
    return {
        "label": label,
        "setpoint_degC": trace.setpoint_degC,
        "time_s": np.round(time, 2),
        "temperature_degC": np.round(trace.temperature_at(time), 3),
        "followed_degC": np.round(trace.followed_degC[scans], 3) if np.ptp(trace.followed_degC) > 0.0 else None,
        "request_time_s": np.round(trace.time_s[scans], 3),
        "request_pct": np.round(trace.power_asked_pct[scans], 3),
        "edge_s": np.round(trace.edge_time_s[edges], 3),
        "edge_pct": trace.edge_pct[edges],
    }


def _instants(trace: Trace) -> Array:
    """Return the instants of a picture, from 0 to the end [s], shape (n,)."""
    end = float(trace.time_s[-1])
    phases = phases_of(trace.scenario, end, end)
    ends = np.array([0.0, *(instant for phase in phases for instant in (phase.rest_s, phase.end_s))])
    weights = np.tile([1.0, _AT_REST], len(phases))
    weighed = np.concatenate([[0.0], np.cumsum(weights * np.diff(ends))])
    return np.asarray(np.interp(np.linspace(0.0, weighed[-1], _POINTS), weighed, ends))


def _changing(trace: Trace) -> npt.NDArray[np.intp]:
    """Return the numbers of the scans that change something that can be seen, the first and the last one included."""
    if len(trace.time_s) <= _MANY:
        return np.arange(len(trace.time_s))
    power, followed = trace.power_asked_pct.tolist(), trace.followed_degC.tolist()
    scans, last = [0], (power[0], followed[0])
    for scan, now in enumerate(zip(power, followed, strict=True)):
        if abs(now[0] - last[0]) > _SEEN_PCT or now[1] != last[1]:
            scans.append(scan)
            last = now
    return np.unique([*scans, *range(0, len(power), _EVERY), len(power) - 1])


def _edges(trace: Trace) -> npt.NDArray[np.intp]:
    """Return the numbers of the edges that a picture shows, where there are many those about the first disturbance."""
    if len(trace.edge_time_s) <= _MANY or not trace.scenario.disturbances:
        return np.arange(len(trace.edge_time_s))
    since = trace.edge_time_s - trace.scenario.disturbances[0].time_s
    return np.flatnonzero((since >= -_NEAR_S[0]) & (since <= _NEAR_S[1]))


def curve_series(design: PidDesign, models: Sequence[tuple[str, HeaterModel]]) -> list[dict[str, Any]]:
    """Return the Nyquist curve and |S| of a design on each model, the one with the largest peak marked as worst."""
    curves: list[dict[str, Any]] = []
    peaks: list[float] = []
    for label, model in models:
        omega = frequencies(design.sample_time_s, max(*model.lags_s, model.dead_time_s), 400)
        loop = loop_response(model, design, omega)
        near = np.abs(loop) < 6.0  # the rest lies outside every picture
        curves.append({
            "label": label,
            "omega": omega,
            "sensitivity": np.round(1.0 / np.abs(1.0 + loop), 4),
            "real": np.round(loop.real[near], 4),
            "imaginary": np.round(loop.imag[near], 4),
        })
        peaks.append(float(np.max(1.0 / np.abs(1.0 + loop))))
    return [curve | {"worst": peak == max(peaks)} for curve, peak in zip(curves, peaks, strict=True)]


class _Law(NamedTuple):
    gain: float
    integral: float  # TA/TI
    past: float
    derivative: float
    within: float  # of the boost, see `heatertune.plc.ramp.Boost`
    again: float
    cooling: float  # full power of a cooler as a part of the heater's


class _IdealState(NamedTuple):
    summed: float
    filtered: float
    error: float
    enabled: bool = True


def simulate_wish(
    design: PidDesign, model: HeaterModel, scenario: Scenario, actuator: Actuator, *,
    ramp_degC_per_min: float = math.inf, hold_degC: float | None = None, boost: BoostView | None = None,
    limits: LoopLimits | None = None,
) -> Trace:
    """Return what the heater would do if the controller knew no words.

    The law is that of the sampled margins: u = K·(e + I + D), I by the backward rectangle, D filtered as the
    design says; readings and power are not rounded. While the power is at a limit, an I step that would
    drive it further is left out. With a ramp the setpoint starts at the reading and has moved once when the first
    power is asked for; see `heatertune.plc.ramp.Ramp` for the holdback.

    Args:
        design: what was meant.
        model: the heater.
        scenario: what happens.
        actuator: the switch.
        ramp_degC_per_min: of the setpoint [°C/min].
        hold_degC: how far from the reading it may be on its way [°C]; None: as far as it goes.
        boost: where it is full power that is asked for, and the sums are none; None: nowhere.
        limits: as for `simulate`.

    Raises:
        InputError, OutOfRange: as `simulate`.
    """
    ramped = math.isfinite(ramp_degC_per_min)
    controller = LoopController(
        core=_CORE, parameters=_law_of(design, boost, actuator.cooling_gain or 0.0),
        state=_IdealState(0.0, 0.0, 0.0, boost is None), sensor=0.0, setpoints=scenario.setpoints_degC,
        scan_s=design.sample_time_s, ramp_calls=int(ramped),
        ramp_step=ramp_degC_per_min / 60.0 * design.sample_time_s if ramped else 0.0, ramp_hold=hold_degC or 0.0,
    )
    return run_loop(controller, model, scenario, actuator, limits)


def _law_of(design: PidDesign, boost: BoostView | None = None, cooling: float = 0.0) -> _Law:
    past, never = design.derivative_filter, (math.inf, math.inf)
    return _Law(
        design.gain_pct_per_degC, design.sample_time_s / design.integral_time_s, past,
        (1.0 - past) * design.derivative_time_s / design.sample_time_s,
        *(never if boost is None else (boost.within_degC, boost.again_degC)), cooling,
    )


def _step(p: _Law, s: _IdealState, setpoint: float, reading: float, _begins: bool) -> tuple[_IdealState, float, float,
                                                                                            int]:
    error = setpoint - reading
    if (error if p.gain > 0.0 else -error) > (p.again if s.enabled else p.within):
        return _IdealState(0.0, 0.0, error, False), 100.0, 100.0, 0
    filtered = p.past * s.filtered + p.derivative * (error - s.error)
    demand = p.gain * (error + s.summed + p.integral * error + filtered)
    power = min(100.0, max(-100.0 * p.cooling, demand))
    summed = s.summed
    if power == demand or (demand - power) * p.gain * error < 0.0:
        summed += p.integral * error
    return _IdealState(summed, filtered, error, True), power if power >= 0.0 else power / p.cooling, demand, 0


def _as_it_is(_sensor: float, temperature_degC: float) -> float:
    return temperature_degC


_CORE: Final = StepFunctions(step=_step, measure=_as_it_is, flags=())


def robustness(fitted: FittedModel, proof: Proof) -> dict[str, Any]:
    """Return what the report draws of the words as realised without a run, a part of `pictures`."""
    curves = () if proof.design is None else curve_series(proof.design, proven_heaters(fitted, proof))
    return {"curves": curves, "ms_limit": proof.limits.ms}


def pictures(
    ideal: PidDesign, fitted: FittedModel, proof: Proof, robust: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return all series that the report draws: the runs, the wish, and what `robustness` gives, or gave."""
    robust = robust or robustness(fitted, proof)
    first_of = {run.model: number for number, run in reversed(list(enumerate(proof.runs)))}
    models, nominal = proven_heaters(fitted, proof), proof.nominal
    others = [trace_series(proof.trace(first_of[label]), label) for label, _ in models[1:]]
    wish = simulate_wish(ideal, models[0][1], nominal.scenario, nominal.actuator,
                         ramp_degC_per_min=proof.ramp_degC_per_min, hold_degC=proof.hold_degC, boost=proof.boost)
    document: dict[str, Any] = encode(PicturesView(
        phases=tuple(_phases(nominal)), ms_limit=robust["ms_limit"],
        nominal=SeriesView(**trace_series(nominal, proof.runs[0].label)),
        worst=SeriesView(**trace_series(proof.worst, proof.runs[proof.worst_run].label)),
        others=tuple(construct_from(OtherRunView, SeriesView(**run)) for run in others),
        ideal=SeriesView(**trace_series(wish, "wished")), curves=tuple(CurveView(**run) for run in robust["curves"])))
    return document


def proven_heaters(fitted: FittedModel, proof: Proof) -> list[tuple[str, HeaterModel]]:
    """Return the heaters that a proof ran, as its controller sees them, and their labels."""
    ran, words = {run.model for run in proof.runs}, proof.words
    delay_s = controller_for(words.target).delayed_s(words.scaling)
    return [(label, delay_heater(model, delay_s)) for label, model in labelled_heaters(fitted) if label in ran]


def _phases(trace: Trace) -> Iterator[PhaseView]:
    scenario, end = trace.scenario, float(trace.time_s[-1])
    for event, phase in zip((None, *scenario.disturbances), phases_of(scenario, end, end), strict=True):
        yield construct_from(PhaseView, phase, label=event_name(event))
