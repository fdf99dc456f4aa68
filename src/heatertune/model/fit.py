"""Log → FittedModel: classify the experiment, find all models that explain it, and report what it does not identify."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import MOST_REPAIRED, Log
from heatertune.model.circumstances import DelaysKnown, with_neighbours, with_power_a_row_late
from heatertune.model.diagnostics import Remark, findings_of, neighbour_findings, unit_change_findings, unit_findings
from heatertune.model.disturbance import DisturbanceEffect, LossEffect
from heatertune.model.findings import Finding
from heatertune.model.model_values import FitOutcome, FittedModel, model_by_hand
from heatertune.model.power.candidates import second_is_seen
from heatertune.model.power.disturbance_fit import is_sensible
from heatertune.model.power.explanation import Explanation, explain_log
from heatertune.model.power.feedback import explains, follows_temperature, is_feedback, loop_remarks
from heatertune.model.power.fit_checks import checks_in_place
from heatertune.model.power.fit_logs import fit_logs, two_scales_of_logs
from heatertune.model.power.fit_power import fit_extended, fit_power, share_remarks, weigh_fit
from heatertune.model.power.known_controller import KnownController, compare, offset_degC, rate, records, replay_notes
from heatertune.model.power.regressors import AMBIENT
from heatertune.model.power.side_effects import cleared, fit_two_way, in_its_room, with_loss
from heatertune.model.reduction import FIELDS, middle_degC, mirror_heater, mirrored_log
from heatertune.model.relay_test import with_relay
from heatertune.model.statistics import autocorrelation, envelope, holds, identified_interval, undisturbed_part
from heatertune.model.temperature.closed_loop import Bounds, ControllerLaw
from heatertune.model.temperature.evidence import AS_WELL, Thermostat, is_faster_than_rows
from heatertune.model.temperature.fit_temperature import fit_temperature, room_bounds
from heatertune.model.temperature.two_level import fit_logged_switchings, fit_manual_switching, fit_two_level
from heatertune.model.temperature.two_level_result import two_level_model
from heatertune.options import merge_options
from heatertune.settings import FitSettings
from heatertune.units import check

if TYPE_CHECKING:
    from typing import Unpack

    from heatertune.keywords import FitOptions

_SWING_ROWS, _SWINGS = 5, -0.4  # half a period of a swing [rows], and the correlation after it
_BEHIND = 10.0  # BIC points behind which one lag does not explain a log

__all__ = ["fit", "fit_known", "fit_together", "model_by_hand"]


def fit(
    log: Log,
    settings: FitSettings | None = None,
    *,
    laws: Sequence[ControllerLaw] = (),
    thorough: bool = False,
    seed: int = 1,
    progress: Callable[[str], object] = str,
    **changed: Unpack[FitOptions],
) -> FittedModel:
    """Identify the heater of a log.

    A measured disturbance is first fitted together with the heater; its effect is then removed from the readings.

    Args:
        log: if it has no power, the fit simulates the control laws.
        settings: additional knowledge about the heater and the log; None: nothing.
        laws: hypotheses about the controller, required if the power was not logged.
        thorough: fit every controller hypothesis completely, even if it is far behind.
        seed: of the random starts and the bootstrap.
        progress: called with a short message when a stage begins.
        changed: fields of `FitSettings` that are other than in `settings`.

    Raises:
        InputError: the power never changes, or there are neither power nor laws, or power_before without power; a
            disturbance without power, or one that never changes.
        OutOfRange: fewer than 20 readings are left, an ambient above all readings, a power outside 0…100 %.
    """
    options = merge_options(FitSettings, settings, changed)
    if options.cooler:
        return _of_cooler(log, options, seed, progress)
    bounds, delays = _bounds(options.ambient_degC), _delays(options)
    _check_given(log, bounds, options.power_before_pct)
    _refuse_largest_power(log, options)
    used, notes = _used(log, options)
    if used.power_pct is None:
        _refuse_disturbance(log)
        _demand_laws(log, laws)
        _refuse_bound(log, delays)
        fitted, notes = _fit_unlogged(log, laws, bounds, options, seed, thorough, progress)
    else:
        thermostat = Thermostat.stated(options.thermostat)
        used, bounds, side_notes = in_its_room(used, bounds)
        used, effect, loss = _cleared(used, progress)
        progress(f"{log.name}: fitting one and two lags to the logged power")
        refit = partial(_fit_logged, bounds=bounds, power_before_pct=options.power_before_pct, seed=seed, delays=delays)
        if used.cooling_pct is None:
            fitted = _with_switchings(used, with_loss(refit(used), loss), bounds)
            fitted = with_relay(used, fitted, ambient_degC=_single(bounds), thermostat=thermostat)
        else:
            if thermostat is not None:
                raise InputError(f"{log.name} has a cooler, which no thermostat switches; leave out --thermostat")
            fitted, (used,) = fit_two_way([used], lambda logs: refit(logs[0]))
        loop = loop_remarks(used)
        fitted = _with_better_order(fitted) if loop else fitted
        notes += side_notes
        notes += tuple(remark.sentence for remark in loop)
        notes += () if effect is None else (effect.sentence,)
        fitted = replace(fitted, findings=(*fitted.findings, *findings_of(loop)), disturbance=effect)
    fitted = with_neighbours(delays.apply_to(replace(fitted, notes=notes + fitted.notes), [used]), alone=options.alone)
    return _of_files(fitted, [log], [used])


def _fit_unlogged(
    log: Log, laws: Sequence[ControllerLaw], bounds: Bounds | None, settings: FitSettings, seed: int, thorough: bool,
    progress: Callable[[str], object],
) -> tuple[FittedModel, tuple[str, ...]]:
    """Return the fit of a log without power, of two-level control if that is stated or explains it best, and notes."""
    used, notes = _used(log, settings)
    if settings.from_s is not None and bounds is None:
        bounds = room_bounds(log)  # the part that is used may begin warm
        notes += (f"The room is that of the log's first reading, {log.temperature_degC[0]:.4g} °C, before --from; "
                  "--ambient LOW HIGH states another.",)
    whole = log if settings.from_s is settings.until_s is None else used  # a quick heat-up may look like a jump
    thermostat = Thermostat.stated(settings.thermostat)
    progress(f"{log.name}: fitting the switchings of two-level control")
    switched = fit_two_level(
        whole, ambient_degC=bounds, thermostat=thermostat, largest_power_pct=settings.largest_power_pct)
    if thermostat is not None:
        few = switched is None or not switched.has_many_rows or is_faster_than_rows(whole)
        if switched is None or (few and not switched.explains):
            raise InputError(f"{log.name}: its rows do not show the switchings at {thermostat.low_degC:g} and "
                             f"{thermostat.high_degC:g} °C; log at a shorter interval, ten rows or more to a period")
        return two_level_model(switched, bounds), ()
    progress(f"{log.name}: fitting {len(laws)} controller laws inside the loop")
    fitted = fit_temperature([used], laws, ambient_degC=bounds, seed=seed, thorough=thorough,
                             largest_power_pct=settings.largest_power_pct)
    best, readings = fitted.hypotheses[0], len(fitted.residuals.time_s) if fitted.residuals else len(used.time_s)
    if switched is None or not switched.explains or not switched.shows_levels or not switched.is_better(
            best.rmse_degC, readings):
        return _switched_manually(_with_faster_swing(fitted, used), whole, bounds, settings.largest_power_pct), notes
    return two_level_model(switched, bounds, fitted.hypotheses), ()


def _switched_manually(fitted: FittedModel, log: Log, bounds: Bounds | None, largest_power_pct: float | None
                       ) -> FittedModel:
    """Return the fit of constant power that was switched manually, where no controller made the log.

    A controller that reduces its power on the way looks like a constant power and a quicker heater: nothing is
    identified where the log only heats, or where the initial state moves it more than the power of a controller does.
    """
    finding_names = {finding.name for finding in fitted.findings}
    if "not-regulated" not in finding_names:
        return fitted
    manual = fit_manual_switching(log, ambient_degC=bounds, largest_power_pct=largest_power_pct)
    if manual is None:
        return fitted
    ratio = manual.rmse_degC / max(fitted.hypotheses[0].rmse_degC, 1e-9)
    if ratio > AS_WELL or ("unexplained-by-power" in finding_names and ratio > 1.0 / AS_WELL):
        return fitted
    model = two_level_model(manual, bounds, fitted.hypotheses)
    return model if manual.shows_cooling else _of_unknown_law(model)


def _of_unknown_law(fitted: FittedModel) -> FittedModel:
    """Return a fit of which nothing is identified."""
    return replace(fitted, outcome=FitOutcome.LAW_UNKNOWN, combinations={}, ci95=dict.fromkeys(fitted.ci95))


def _with_faster_swing(fitted: FittedModel, log: Log) -> FittedModel:
    """Return a fit with the finding that the rows are too far apart to show the swing, where they are.

    Any controller explains a lasting swing of a few rows; what it identifies is then not the heater.
    """
    is_unknown = fitted.outcome is FitOutcome.LAW_UNKNOWN
    if is_unknown and not is_faster_than_rows(log):
        return fitted
    if not is_unknown and not _swings_by_rows(log):
        return fitted
    message = (f"{log.name} goes up and down from row to row: its rows are too far apart to show how it is switched; "
               "log at a shorter interval, ten rows or more to a swing.")
    findings = tuple(each for each in fitted.findings if each.name not in ("not-regulated", "two-level"))
    return _of_unknown_law(replace(fitted, findings=(*findings, Finding(name="faster-than-log", message=message)),
                                   notes=(message, *fitted.notes)))


def _swings_by_rows(log: Log) -> bool:
    """Return whether the later readings swing with a period of a few rows."""
    late = log.temperature_degC[len(log.time_s) // 2 :]
    late = late - late.mean()
    return bool(np.ptp(late) > 0.0 and float(np.min(autocorrelation(late, _SWING_ROWS))) < _SWINGS)


def _with_switchings(log: Log, fitted: FittedModel, bounds: Bounds | None) -> FittedModel:
    """Return the fit of a power that switches between rows instead, if it explains the log better."""
    best = fitted.candidates[0]  # the working model: where two lags explain the log better, it is not that
    switched = fit_logged_switchings(log.on_one_clock(), fitted.model.dead_time_s, ambient_degC=bounds)
    if switched is None or not (switched.explains and switched.follows_rows):
        return fitted
    if not switched.is_better(best.rmse_degC, len(log.time_s)):
        return fitted
    findings = tuple(finding for finding in fitted.findings if finding.name in ("one-level", "alias"))
    model = two_level_model(switched, bounds)
    return replace(model, findings=(*findings, *model.findings))


def _with_better_order(fitted: FittedModel) -> FittedModel:
    """Return the fit of a closed loop with intervals that hold what two lags say, if they explain it better than one.

    A loop excites the heater where a second lag matters, and little at rest: one lag may then have any gain.
    """
    one = fitted.candidates[0]
    two = [each for each in fitted.candidates if len(each.model.lags_s) > 1]
    gain = fitted.ci95.get("gain_degC_per_pct")
    if not two or one.delta_bic <= _BEHIND or gain is None:
        return fitted
    if all(holds(gain, each.model.gain_degC_per_pct) for each in two):
        return fitted
    wider = {name: None if inside is None or name not in FIELDS else identified_interval(envelope(
        inside, [FIELDS[name](each.model) for each in two])) for name, inside in fitted.ci95.items()}
    note = ("Two lags explain the log better, with another gain, so one lag does not identify it: the intervals hold "
            "both, and the plausible heaters too.")
    is_open = any(wider.get(name) is None for name in ("gain_degC_per_pct", "time_constant_s"))
    is_identified = fitted.outcome is FitOutcome.IDENTIFIED and not is_open
    return replace(fitted, ci95=wider, notes=(*fitted.notes, note), outcome=fitted.outcome if is_identified
                   or fitted.outcome is not FitOutcome.IDENTIFIED else FitOutcome.COMBINATIONS_ONLY)


def _of_cooler(log: Log, settings: FitSettings, seed: int, progress: Callable[[str], object]) -> FittedModel:
    """Return the cooler behind a log with power: the mirror image of the heater behind the mirrored log."""
    if log.power_pct is None:
        raise InputError(f"{log.name}: the power was not logged, and no law is known by which a controller cools; log "
                         "the power")
    log.demand_heater_alone("next to that of a heater: fit both, without --cooler")
    about, bounds = middle_degC(log), _bounds(settings.ambient_degC)
    _check_given(mirrored_log(log, about), None, settings.power_before_pct)
    turned = None if bounds is None else (2.0 * about - bounds[1], 2.0 * about - bounds[0])
    heater = fit(mirrored_log(log, about), replace(settings, cooler=False, ambient_degC=turned), seed=seed,
                 progress=progress)
    note = (f"{log.name}: of a cooler, and fitted as a heater, mirrored at {about:.4g} °C; a temperature in the notes "
            "of the fit is that of the mirror image.")
    return replace(mirror_heater(heater, about), notes=(note, *heater.notes))


def _refuse_cooler(settings: FitSettings) -> None:
    if settings.thermostat is not None:
        raise InputError("--thermostat needs a single log, and no other controller; leave it out")
    if settings.cooler:
        raise InputError("--cooler needs a single log that contains the power; fit it separately")


def fit_known(
    log: Log,
    controllers: Sequence[KnownController],
    settings: FitSettings | None = None,
    *,
    setpoint_degC: float | None = None,
    seed: int = 1,
    progress: Callable[[str], object] = str,
    **changed: Unpack[FitOptions],
) -> FittedModel:
    """Identify the heater of a log without power but with a known controller; see `known_controller`.

    Args:
        log: without power, its first reading at the controller's first scan.
        controllers: the controller under each setting of its open points, at least one.
        settings: as in `fit`; if no power before the first reading is given it was 0: the controller starts cold.
        setpoint_degC: constant setpoint [°C]; None: as logged.
        seed: as in `fit`.
        progress: as in `fit`.
        changed: as in `fit`.

    Raises:
        InputError: as `known_controller.replayed`, or the power never changes.
        OutOfRange: as `fit`.
    """
    options = merge_options(FitSettings, settings, changed)
    _refuse_cooler(options)
    if options.largest_power_pct is not None:
        raise InputError("--largest-power: a known controller's power is computed; leave it out")
    bounds, delays, power_before = _bounds(options.ambient_degC), _delays(options), options.power_before_pct or 0.0
    _check_given(log, bounds, None)
    _refuse_disturbance(log)
    used, notes = _used(log, options)
    progress(f"{log.name}: running {controllers[0].name.partition(',')[0]} on the logged readings")
    ambient = _single(bounds)
    rate_all = partial(rate, ambient_degC=ambient, power_before_pct=power_before)
    rated = rate_all(records(used, controllers, setpoint_degC))
    if not rated:
        raise InputError(f"{log.name}: on these readings the controller's power never changes; is the setpoint "
                         "correct?")
    leader = next(controller for controller in controllers if controller.name == rated[0].name)
    progress(f"{log.name}: fitting one and two lags to each record of its power")
    offset = offset_degC(used, leader, setpoint_degC, ambient_degC=ambient, power_before_pct=power_before)
    if offset != 0.0:
        rated = rate_all(records(used, controllers, setpoint_degC, offset))
    candidates, hypotheses = compare(rated)
    fitted = _fit_logged(rated[0].log, bounds, power_before, seed, delays, believed=True)
    loop = loop_remarks(rated[0].log)
    replay = replay_notes(used, controllers, hypotheses, offset)
    family = (*candidates, *(replace(part, law=hypotheses[0].law) for part in fitted.candidates if part.part))
    return _of_files(delays.apply_to(replace(
        fitted, candidates=family, hypotheses=tuple(hypotheses),
        method=f"power by {hypotheses[0].law} on the logged readings; {fitted.method}",
        notes=(*notes, *replay, *(remark.sentence for remark in loop), *fitted.notes),
        findings=(*fitted.findings, *findings_of(loop)),
    ), [used]), [log], [used])


def fit_together(
    logs: Sequence[Log],
    settings: FitSettings | None = None,
    *,
    laws: Sequence[ControllerLaw] = (),
    seed: int = 1,
    progress: Callable[[str], object] = str,
    **changed: Unpack[FitOptions],
) -> FittedModel:
    """Identify the common heater of several logs, all with power or all without; arguments as in `fit`.

    Each log has its own ambient and initial state, and without power its own controller and setpoint; they share the
    one.

    Args:
        logs: of one heater, each with a unique name.
        settings: additional knowledge about the heater and the logs; None: nothing.
        laws: hypotheses about the controllers, required if the power was not logged.
        seed: of the random starts and the bootstrap.
        progress: called with a short message when a stage begins.
        changed: fields of `FitSettings` that are other than in `settings`.

    Raises:
        InputError: some logs with power and some without, two logs of one name; without power: no laws, or
            power_before; with power: as `fit`.
        OutOfRange: as `fit`.
    """
    options = merge_options(FitSettings, settings, changed)
    _refuse_cooler(options)
    bounds, delays = _bounds(options.ambient_degC), _delays(options)
    powered = [log for log in logs if log.power_pct is not None]
    if powered and len(powered) < len(logs):
        other = next(log for log in logs if log.power_pct is None)
        raise InputError(f"{powered[0].name} contains the power and {other.name} does not: fit them separately; only "
                         "logs that all contain it, or none, are fitted together")
    parts, notes = [], []
    for log in logs:
        _check_given(log, bounds, options.power_before_pct)
        _refuse_largest_power(log, options)
        _refuse_disturbance(log)
        used, own_notes = _used(log, options)
        parts.append(used)
        notes += [f"{log.name}: {note}" for note in own_notes]
    names = [log.name for log in logs]
    if len(set(names)) < len(names):
        raise InputError(f"{', '.join(names)}: the same log twice adds nothing; name different ones")
    progress(f"fitting one heater to {' and '.join(names)}")
    if powered:
        fit_all = partial(_together, bounds=bounds, power_before_pct=options.power_before_pct, seed=seed, delays=delays)
        if any("cooling" in log.signals for log in parts):
            joint, parts = fit_two_way(parts, fit_all)
        else:
            joint = fit_all(parts)
    else:
        for log in logs:
            _demand_laws(log, laws)
            _refuse_bound(log, delays)
        joint = fit_temperature(
            parts, laws, ambient_degC=bounds, seed=seed, largest_power_pct=options.largest_power_pct)
    joint = with_neighbours(delays.apply_to(replace(joint, notes=(*notes, *joint.notes)), parts), alone=options.alone)
    return _of_files(joint, logs, parts)


def _of_files(fitted: FittedModel, logs: Sequence[Log], used: Sequence[Log]) -> FittedModel:
    """Return the fit with the read summary of each file, and its findings; `used`: the part of each that was fitted."""
    summaries = [log.taken for log in logs if log.taken is not None]
    repaired = [f"{reading.file}: {reading.repaired_share:.2%} of {reading.rows_read} rows were left out or repaired"
                for reading in summaries if reading.repaired_share > MOST_REPAIRED]
    units = unit_findings(fitted, logs)
    wrong = [f"{each.message[0].upper()}{each.message[1:]}." for each in units if each.name == "unit-contradicted"]
    return replace(
        fitted, log_summary=tuple(reading.line for reading in summaries), notes=(*fitted.notes, *wrong),
        findings=(*fitted.findings, *(Finding(name="repaired", message=sentence) for sentence in repaired),
                  *units, *unit_change_findings(used), *neighbour_findings(logs)),
    )


def _together(
    parts: Sequence[Log], bounds: Bounds | None, power_before_pct: float | None, seed: int, delays: DelaysKnown
) -> FittedModel:
    explanations, notes = [], []
    loops: list[Remark] = []
    for log in parts:
        explanation, own_notes = _explained(log, bounds, power_before_pct, delays)
        explanations.append(explanation)
        notes += [f"{log.name}: {note}" for note in own_notes]
        loops += loop_remarks(log)
    notes += [remark.sentence for remark in loops]
    two_scales = two_scales_of_logs(explanations)
    fitted = fit_extended(explanations, two_scales) if two_scales else fit_logs(
        explanations, open_start=power_before_pct is None, seed=seed, least_dead_time_s=delays.least_dead_time_s(parts))
    return replace(fitted, notes=(*notes, *fitted.notes), findings=(*fitted.findings, *findings_of(loops)))


def _delays(settings: FitSettings) -> DelaysKnown:
    return DelaysKnown(dead_time_at_most_s=settings.dead_time_at_most_s, sensor_delay_s=settings.sensor_delay_s,
                       pwm_period_s=settings.log_pwm_period_s)


def _bounds(ambient_degC: float | Bounds | None) -> Bounds | None:
    """Return lowest and highest ambient; equal if it is known."""
    if ambient_degC is None or not isinstance(ambient_degC, int | float):
        return ambient_degC
    return float(ambient_degC), float(ambient_degC)


def _check_given(log: Log, ambient_degC: Bounds | None, power_before_pct: float | None) -> None:
    if ambient_degC is not None:
        low, high = ambient_degC
        check("ambient_degC", low, least=-273.15)
        check("ambient_degC", high)
        if low > high:
            raise OutOfRange("ambient_degC", low, f"<= its highest value, {high:g}")
        highest = float(log.temperature_degC.max())
        if high >= highest:
            raise OutOfRange("ambient_degC", high, f"< {highest:g}, the highest reading of {log.name}")
    if power_before_pct is not None:
        check("power_before_pct", power_before_pct, least=0.0, most=100.0)
        if log.power_pct is None:
            raise InputError(f"{log.name}: the power was not logged, so power_before_pct means nothing here")


def _used(log: Log, settings: FitSettings) -> tuple[Log, tuple[str, ...]]:
    """Return the part of a log to explain, and a sentence about any omitted part."""
    begin, end = settings.from_s, settings.until_s
    notes = () if begin is None else (f"Readings before {begin:g} s were not used.",)
    if begin is not None or end is not None:
        first, last = float(log.time_s[0]), float(log.time_s[-1])
        log = log.window(first if begin is None else begin, last if end is None else end)
    if end is not None:
        return log, (*notes, f"Readings after {end:g} s were not used.")
    if log.power_pct is not None:  # it is fitted in segments
        return log, notes
    used, part_notes = undisturbed_part(log)
    return used, (*notes, *part_notes)


def _cleared(
    log: Log, progress: Callable[[str], object]
) -> tuple[Log, DisturbanceEffect | None, LossEffect | None]:
    """Return a log without the effect of its disturbance, and this effect: as power, or on the heat loss."""
    if log.disturbance is None:
        return log, None, None
    progress(f"{log.name}: fitting heater and disturbance together")
    return cleared(log)


def _refuse_disturbance(log: Log) -> None:
    if log.disturbance is not None:
        raise InputError(f"{log.name}: the effect of a disturbance can only be fitted from a single log that contains "
                         "the power; leave it out with --disturbance-column none, or log the power")


def _demand_laws(log: Log, laws: Sequence[ControllerLaw]) -> None:
    if not laws:
        raise InputError(f"{log.name}: the power was not logged and no controller law was given to run in the fit")


def _refuse_largest_power(log: Log, settings: FitSettings) -> None:
    if log.power_pct is not None and settings.largest_power_pct is not None:
        raise InputError(f"{log.name}: the power was logged, so --largest-power states nothing here; leave it out")


def _refuse_bound(log: Log, delays: DelaysKnown) -> None:
    if delays.dead_time_at_most_s is not None:
        raise InputError(f"{log.name}: the power was not logged, so dead_time_at_most_s bounds nothing here: the "
                         "plausible heaters span the dead time")


def _single(bounds: Bounds | None) -> float | None:
    """Return the ambient where it is one value."""
    return None if bounds is None or bounds[0] < bounds[1] else bounds[0]


def _fit_logged(
    log: Log, bounds: Bounds | None, power_before_pct: float | None, seed: int, delays: DelaysKnown, *,
    believed: bool = False,
) -> FittedModel:
    """Return the fit of a log with power."""
    explain = partial(_explained, log, bounds, power_before_pct, delays, believed=believed)
    explanation, notes = explain()
    if explanation.extended:
        return fit_extended([explanation], explanation.extended)
    row_s = float(np.median(np.diff(log.time_s)))
    late = None if believed else _power_a_row_late(log, explanation, partial(explain, power_late_s=row_s))
    explanation, notes = late or (explanation, notes)
    fitted = fit_power(explanation, weigh_fit(explanation, open_start=power_before_pct is None, seed=seed),
                       least_dead_time_s=delays.least_dead_time_s([log]), seed=seed)
    fitted = replace(fitted, notes=notes + fitted.notes)
    return fitted if late is None else with_power_a_row_late(fitted, row_s)


def _power_a_row_late(
    log: Log, explanation: Explanation, explain: Callable[[], tuple[Explanation, tuple[str, ...]]]
) -> tuple[Explanation, tuple[str, ...]] | None:
    """Return the explanation by a power column that is a row late, where a log else needs loads in its place."""
    if not _answers_early(log, explanation):
        return None
    try:
        late, notes = explain()
    except InputError:
        return None
    if late.has_events or late.extended or _is_doubtful(log, late):
        return None
    explained = all(map(explains, late.problems, late.fits)) or late.bic < explanation.bic - _BEHIND
    return (late, notes) if explained else None


def _answers_early(log: Log, explanation: Explanation) -> bool:
    """Return whether a log shows no dead time and loads that leave it open whether the power acts, without feedback."""
    is_early = any("dead_time_s" in fit.on_bound for fit in explanation.fits)
    return (is_early and explanation.has_events and _is_doubtful(log, explanation)
            and not (is_feedback(log) or follows_temperature(log)))


def _is_doubtful(log: Log, explanation: Explanation) -> bool:
    """Return whether an explanation leaves it open that the power moves the temperature."""
    return any(share_remarks(log.name, explanation.problems, explanation.fits, explanation.doubt))


def _explained(
    log: Log, bounds: Bounds | None, power_before_pct: float | None, delays: DelaysKnown, *, believed: bool = False,
    power_late_s: float = 0.0,
) -> tuple[Explanation, tuple[str, ...]]:
    """Explain a log with power; a free ambient outside its interval is set to the nearest end."""
    ambient = _single(bounds)
    _demand_excitation(log, ambient)
    explain = partial(explain_log, log, power_before_pct=power_before_pct, believed=believed,
                      most_dead_time_s=delays.dead_time_at_most_s, power_late_s=power_late_s)
    explanation = explain(ambient_degC=ambient)
    if explanation.extended and bounds is None:
        return explanation, ()
    end = _begun_at_degC(log, explanation) if bounds is None else _nearest_end(explanation, bounds)
    if end is None:
        return explanation, ()
    note = f"Fitted freely, the ambient temperature leaves the stated interval; its end of {end:g} °C was used."
    if bounds is None:
        note = (f"Left free, the ambient comes out at {explanation.fits[0].linear[AMBIENT]:.3g} °C, but {log.name} "
                f"begins without power at {end:.3g} °C, and no heater is colder than its room; that was taken; "
                "--ambient would settle it.")
    return explain(ambient_degC=end), (note,)


def _begun_at_degC(log: Log, explanation: Explanation) -> float | None:
    """Return the temperature at which a log begins without power, where the free ambient lies above it."""
    assert log.power_pct is not None
    on = np.flatnonzero(log.power_pct != 0.0)
    first = log.temperature_degC[: on[0] if len(on) else 0]
    if not len(first) or is_sensible(explanation.problems[0], explanation.fits[0]) or _two_lags_explain(explanation):
        return None
    initial_degC = float(np.median(first))
    return initial_degC if explanation.fits[0].linear[AMBIENT] > initial_degC else None


def _two_lags_explain(explanation: Explanation) -> bool:
    """Return whether two lags, which may take one lag's place, explain a log whose room one lag finds too warm."""
    one_lag, two = zip(explanation.problems, explanation.fits, strict=True)
    return second_is_seen(two[1]) and is_sensible(*two) and checks_in_place(*two, one_lag) is not None


def _nearest_end(explanation: Explanation, ambient_degC: Bounds) -> float | None:
    """Return the end of the interval that a free ambient exceeds, None if it lies inside."""
    free = explanation.model.ambient_degC
    assert free is not None
    end = min(max(free, ambient_degC[0]), ambient_degC[1])
    return None if end == free else end


def _demand_excitation(log: Log, ambient_degC: float | None) -> None:
    """Refuse constant power: gain and ambient, and step response and initial state, would be indistinguishable."""
    power = log.signals["power"].values
    if float(np.ptp(power)) == 0.0 and ambient_degC is None:
        raise InputError(
            f"{log.name}: {FitOutcome.NO_POWER_CHANGE.value} The power is {power[0]:g} % throughout; or give the "
            "temperature of the heater without power as --ambient, the first reading if it was at rest and cold there: "
            f"--ambient {log.temperature_degC[0]:.4g}"
        )
