import json
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.witness.trace_measures import judge, stays_within

from heatertune.errors import OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import Margins
from heatertune.proof import Actuator, Criterion, Load, LoopLimits, Scenario, TemperatureStep, Trace
from heatertune.proof.criteria import _strains, worst_of
from heatertune.proof.scenario import Mains, NewSetpoint, Phase, PlcPower, SetpointRampEvent
from heatertune.proof.verdict import Interlock

PERIOD = 0.05
AMBIENT, SETPOINT = 20.0, 60.0


def _trace(course, duration, *, disturbances=(), resolution=0.0, power=None, switched=(), flags=None, pwm=2.0):
    """A run whose temperature is the given function of time, as a fine staircase."""
    time = np.arange(0.0, duration + PERIOD / 2.0, PERIOD)
    temperature = np.array([course(t) for t in time])
    scenario = Scenario(setpoint_degC=SETPOINT, duration_s=duration, disturbances=disturbances)
    return Trace(
        time_s=time, temperature_degC=temperature, reading_degC=temperature,
        followed_degC=np.full(len(time), SETPOINT),
        power_asked_pct=np.full(len(time), 50.0) if power is None else np.array([power(t) for t in time]),
        edge_time_s=np.array(switched, dtype=float), edge_pct=np.where(np.arange(len(switched)) % 2 == 0, 100.0, 0.0),
        stretches=np.column_stack([time, temperature, temperature, temperature]),
        model=Fopdt(gain_degC_per_pct=1.0, time_constant_s=50.0, dead_time_s=1.0, ambient_degC=AMBIENT),
        scenario=scenario, actuator=Actuator(pwm_period_s=pwm), resolution_degC=resolution, flags=flags or {},
    )


TWO_PERCENT = 0.02 * (SETPOINT - AMBIENT)


def _judged(trace, margins=None, **limits):
    return {each.name: each for each in judge(trace, LoopLimits(**{"tolerance_degC": TWO_PERCENT} | limits), margins)}


def _first_order(t, tau=20.0):
    return SETPOINT - (SETPOINT - AMBIENT) * math.exp(-t / tau)


@pytest.mark.parametrize("damping", [0.3, 0.45, 0.6])
def test_the_overshoot_of_a_second_order_step_is_the_closed_form(damping):
    omega = 0.2
    damped = omega * math.sqrt(1.0 - damping**2)

    def course(t):
        swing = math.cos(damped * t) + damping * omega / damped * math.sin(damped * t)
        return SETPOINT - (SETPOINT - AMBIENT) * math.exp(-damping * omega * t) * swing

    found = _judged(_trace(course, 200.0))["overshoot"]
    assert found.value == pytest.approx(100.0 * math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2)), abs=0.01)
    assert found.ok == (damping > 0.456), "20 % overshoot belong to a damping of 0.456"


def test_a_first_order_step_settles_after_four_time_constants_to_two_percent():
    found = _judged(_trace(_first_order, 200.0))
    assert found["settling_time"].value == pytest.approx(20.0 * math.log(50.0), abs=PERIOD)
    assert found["overshoot"].value == 0.0
    assert found["iae"].value == pytest.approx(40.0 * 20.0, rel=2e-3)


def test_the_band_is_no_finer_than_the_sensor():
    found = _judged(_trace(_first_order, 200.0, resolution=2.0))["settling_time"]
    assert found.value == pytest.approx(20.0 * math.log(10.0), abs=PERIOD)
    assert "±4 °C" in found.what


def test_the_crossing_into_the_band_is_found_between_the_samples():
    # one lag of 50 s to 62 °C: from 57 °C at 10 s the error is −2 °C where 4 of 5 °C are left
    trace = _trace(lambda _t: 57.0, 20.0)
    trace = replace(trace, stretches=np.array([[10.0, 57.0, 57.0, 62.0]]))
    times, error = np.array([0.0, 10.0, 30.0]), np.array([-5.0, -3.0, 1.0])
    phase = Phase(begin_s=0.0, end_s=30.0, rest_s=30.0, limit_s=30.0, setpoint_degC=SETPOINT, kind="heat-up", up=True, by_power=True)
    assert stays_within(trace, phase, times, error, 2.0) == pytest.approx(10.0 + 50.0 * math.log(5.0 / 4.0))


def test_what_never_settles_fails_and_is_null_in_json():
    found = _judged(_trace(lambda _t: 50.0, 200.0))["settling_time"]
    assert (found.value, found.ok, found.strain) == (math.inf, False, math.inf)
    assert json.loads(json.dumps(found.to_document(), allow_nan=False))["value"] is None


@pytest.mark.parametrize(("degC", "settles_s"), [(56.0, 0.0), (64.0, 0.0), (55.999, math.inf), (64.001, math.inf)])
def test_the_edge_of_the_band_is_within_it(degC, settles_s):
    assert _judged(_trace(lambda _t: degC, 20.0), tolerance_degC=4.0)["settling_time"].value == settles_s


@pytest.mark.parametrize(("offset", "ok"), [(0.79, True), (-0.79, True), (0.81, False), (-0.81, False)])
def test_the_steady_offset_is_the_mean_distance_from_the_setpoint(offset, ok):
    found = _judged(_trace(lambda t: _first_order(t, 5.0) + offset, 200.0))["steady_offset"]
    assert found.value == pytest.approx(abs(offset), abs=1e-6)
    assert (found.limit, found.ok) == (pytest.approx(0.8), ok)


def test_a_slow_swing_is_a_limit_cycle_and_neither_an_offset_nor_a_ripple():
    found = _judged(_trace(lambda t: _first_order(t, 5.0) + 1.5 * math.sin(2.0 * math.pi * t / 40.0), 200.0))
    assert found["limit_cycle"].value == pytest.approx(1.5, abs=1e-3)
    assert not found["limit_cycle"].ok
    assert found["steady_offset"].value == pytest.approx(0.0, abs=2e-3)
    assert found["pwm_ripple"].value < 0.5


def test_a_swing_within_the_pwm_period_is_a_ripple():
    found = _judged(_trace(lambda t: _first_order(t, 5.0) + 0.3 * math.sin(math.pi * t), 200.0))
    assert found["pwm_ripple"].value == pytest.approx(0.6, abs=1e-3)
    assert found["limit_cycle"].value == pytest.approx(0.3, abs=1e-3)


def test_rest_lasts_at_least_three_pwm_periods():
    found = _judged(_trace(lambda t: _first_order(t, 5.0) + 3.0 * (95.0 < t < 105.0), 150.0, pwm=20.0))
    assert found["limit_cycle"].value == pytest.approx(1.5, abs=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_recovery_from_a_jump_is_the_closed_form(sign):
    def course(t):
        return _first_order(t, 5.0) + (sign * 8.0 * math.exp(-(t - 100.0) / 15.0) if t >= 100.0 else 0.0)

    found = _judged(_trace(course, 200.0, disturbances=(TemperatureStep(time_s=100.0, temperature_degC=sign * 8.0),)))
    assert found["recovery_time"].value == pytest.approx(15.0 * math.log(10.0), abs=PERIOD)
    assert found["recovery_time"].limit == pytest.approx(100.0)
    assert found["deviation"].value == pytest.approx(8.0)
    assert found["recovery_overshoot"].value == pytest.approx(0.0, abs=1e-6)
    assert found["settling_time"].limit == pytest.approx(100.0)
    assert found["overshoot"].value == 0.0, "the jump is not part of the heat-up"


@pytest.mark.parametrize("disturbance", [
    TemperatureStep(time_s=100.0, temperature_degC=-8.0), Load(time_s=100.0, power_pct=-20.0),
])
def test_overshoot_after_a_disturbance_is_on_its_other_side(disturbance):
    def course(t):
        return _first_order(t, 5.0) - (8.0 * math.exp(-(t - 100.0) / 15.0) * math.cos((t - 100.0) / 15.0)
                                       if t >= 100.0 else 0.0)

    found = _judged(_trace(course, 200.0, disturbances=(disturbance,)))["recovery_overshoot"]
    # first extreme of e^(−x)·cos x: x = 3π/4
    assert found.value == pytest.approx(8.0 * math.exp(-0.75 * math.pi) * math.sqrt(0.5) / 40.0 * 100.0, abs=0.01)


def test_of_several_disturbances_the_worst_counts():
    both = (TemperatureStep(time_s=80.0, temperature_degC=-4.0), TemperatureStep(time_s=160.0, temperature_degC=5.0))

    def course(t):
        return _first_order(t, 5.0) + sum(
            each.temperature_degC * math.exp(-(t - each.time_s) / 10.0) for each in both if t >= each.time_s
        )

    found = _judged(_trace(course, 200.0, disturbances=both))
    assert found["deviation"].value == pytest.approx(5.0, abs=0.01)
    assert found["recovery_time"].limit == pytest.approx(40.0), "the second has less time"


def test_without_disturbance_nothing_is_said_about_recovery():
    assert not {"recovery_time", "recovery_overshoot", "deviation"} & set(_judged(_trace(_first_order, 200.0)))


def test_saturation_and_switchings_are_counted():
    switched = [0.0, 10.0, 50.0, 60.0, 70.0]
    found = _judged(_trace(_first_order, 200.0, power=lambda t: 100.0 if t < 50.0 else 40.0, switched=switched),
                    switchings_per_h=50.0)
    assert found["saturation"].value == pytest.approx(25.0, abs=0.05)
    assert found["saturation"].ok
    assert found["switchings"].value == pytest.approx(3 / 150.0 * 3600.0, rel=1e-3), "50 s at full power need no switching"
    assert not found["switchings"].ok


def test_switchings_are_not_thinned_by_an_open_circuit():
    # a pulse every 5 s where there is something to hold; the time without heater, at full power, makes nothing of that
    for off_s in (50.0, 500.0):
        end = 200.0 + off_s
        found = _judged(_trace(
            _first_order, end, disturbances=(Mains(time_s=100.0, share=0.0), Mains(time_s=100.0 + off_s, share=1.0)),
            power=lambda t, off_s=off_s: 100.0 if 100.0 <= t < 100.0 + off_s else 40.0, pwm=5.0,
            switched=[edge for on in np.arange(0.0, end, 5.0) if not 100.0 <= on < 100.0 + off_s for edge in (on, on + 2.0)]))
        assert found["switchings"].value == pytest.approx(720.0, rel=5e-3)


def test_switchings_of_a_controller_that_knows_on_and_off_are_counted_while_the_circuit_is_closed():
    found = _judged(_trace(
        _first_order, 300.0, disturbances=(Mains(time_s=100.0, share=0.0), Mains(time_s=200.0, share=1.0)),
        power=lambda t: 100.0 * (t % 20.0 < 10.0), switched=[edge for on in np.arange(0.0, 300.0, 20.0) if not 100.0 <= on < 200.0
                                                            for edge in (on, on + 10.0)]))
    assert found["switchings"].value == pytest.approx(180.0)


def test_only_the_flags_of_an_overflow_count():
    found = _judged(_trace(_first_order, 200.0, flags={"SM1.1": 2, "SM1.3": 1, "SM1.0": 7}))["overflow"]
    assert (found.value, found.ok) == (3.0, False)
    assert _judged(_trace(_first_order, 200.0, flags={"SM1.0": 7}))["overflow"].ok


@pytest.mark.parametrize(("margins", "fails"), [
    (Margins(ms=1.6, mt=1.0, gain_margin=3.1, phase_margin_deg=61.0), set()),
    (Margins(ms=2.0, mt=1.0, gain_margin=1.7, phase_margin_deg=30.0), set()),
    (Margins(ms=2.01, mt=1.0, gain_margin=3.1, phase_margin_deg=61.0), {"ms"}),
    (Margins(ms=1.6, mt=1.0, gain_margin=1.69, phase_margin_deg=29.9), {"gain_margin", "phase_margin"}),
    (Margins(ms=1.6, mt=1.0, gain_margin=math.inf, phase_margin_deg=math.inf), set()),
    (Margins(ms=math.inf, mt=math.inf, gain_margin=0.8, phase_margin_deg=-10.0),
     {"stability", "ms", "gain_margin", "phase_margin"}),
])
def test_margins_are_judged(margins, fails):
    found = _judged(_trace(_first_order, 200.0), margins)
    assert {name for name, each in found.items() if not each.ok} == fails


@pytest.mark.parametrize(("cut_s", "trips"), [(math.inf, 0.0), (70.0, 1.0)])
def test_an_interlock_that_switches_off_for_good_fails_and_one_that_never_does_passes(cut_s, trips):
    guarded = replace(_trace(_first_order, 200.0), interlock=Interlock(name="heater-fan", limit_degC=90.0), cut_s=cut_s)
    found = _judged(guarded)["interlock_trips"]
    assert (found.value, found.limit, found.ok) == (trips, 0.0, trips == 0.0)


def test_without_a_limit_a_number_is_told_and_not_judged():
    margins = Margins(ms=5.0, mt=4.0, gain_margin=1.1, phase_margin_deg=5.0)
    found = _judged(_trace(_first_order, 200.0), margins, ms=None, gain_margin=None, phase_margin_deg=None)
    assert (found["ms"].value, found["ms"].ok, found["ms"].strain) == (5.0, True, 0.0)


@pytest.mark.parametrize(("value", "limit", "at_least", "strain"), [
    (1.0, 2.0, False, 0.5), (3.0, 2.0, False, 1.5), (0.25, 0.5, False, 0.5), (0.75, 0.5, False, 1.5), (-1.0, 2.0, False, 0.0),
    (1.0, 0.0, False, math.inf), (0.0, 0.0, False, 0.0), (math.inf, 2.0, False, math.inf), (math.inf, None, False, 0.0),
    (4.0, 2.0, True, 0.5), (1.0, 2.0, True, 2.0), (0.5, 0.25, True, 0.5), (0.0, 2.0, True, math.inf), (-1.0, 2.0, True, math.inf),
    (math.inf, 2.0, True, 0.0), (0.0, 0.0, True, 0.0), (math.nan, None, False, math.inf), (math.nan, None, True, math.inf),
])
def test_the_strain_is_the_share_of_the_limit_that_is_used(value, limit, at_least, strain):
    assert Criterion(name="x", value=value, limit=limit, unit="1", what="", at_least=at_least).strain == strain


@pytest.mark.parametrize(("limit", "at_least", "worst"), [(None, False, 3.0), (None, True, -1.0), (2.0, False, 3.0), (2.0, True, -1.0)])
def test_the_worst_is_the_largest_or_where_it_should_reach_something_the_smallest(limit, at_least, worst):
    found = [Criterion(name="x", value=value, limit=limit, unit="1", what="", at_least=at_least) for value in (1.0, 3.0, -1.0)]
    assert worst_of(found).value == worst
    for one in found:
        assert one.view.keeps(one.value) is one.ok


@pytest.mark.parametrize(("given", "settles_s"), [
    ({}, 45.0), ({"soak_settling_s": 20.0}, 20.0), ({"soak_settling_pct": 10.0}, 9.0), ({"soak_settling_s": 20.0, "soak_settling_pct": 10.0}, 9.0),
    ({"soak_settling_s": 7.0, "soak_settling_pct": 10.0}, 7.0), ({"soak_settling_pct": 0.0}, 0.0), ({"soak_settling_s": 80.0}, 80.0),
])
def test_a_soak_of_90_s_settles_in_the_sooner_of_what_is_given_else_in_half_of_it(given, settles_s):
    assert LoopLimits(**given).soak_settles_s(90.0) == settles_s


numbers = st.one_of(st.floats(-1e3, 1e3), st.just(math.inf))


@given(value=numbers, limit=st.floats(0.0, 1e3), at_least=st.booleans())
def test_a_limit_is_strained_beyond_one_where_it_is_not_kept(value, limit, at_least):
    found = Criterion(name="x", value=value, limit=limit, unit="1", what="", at_least=at_least)
    assert found.ok == (value >= limit if at_least else value <= limit)
    assert found.strain <= 1.0 if found.ok else found.strain >= 1.0


@given(values=st.lists(numbers, min_size=1), limit=st.floats(0.0, 1e3), at_least=st.booleans())
def test_the_worst_is_not_ok_where_one_is_not(values, limit, at_least):
    found = [Criterion(name="x", value=v, limit=limit, unit="1", what="", at_least=at_least) for v in values]
    assert worst_of(found).ok == all(each.ok for each in found)
    assert worst_of(found).strain == max(each.strain for each in found)


@pytest.mark.parametrize(("field", "value"), [
    ("overshoot_pct", -1.0), ("ms", math.nan), ("tolerance_degC", -2.0), ("steady_share", 0.0), ("steady_share", 1.1),
])
def test_limits_without_meaning_are_refused(field, value):
    with pytest.raises(OutOfRange, match=field):
        LoopLimits(**{field: value})


def test_a_ramp_is_judged_against_the_setpoint_asked_for():
    # 40 °C in 20 s, followed without any error: the area of the triangle, and the time the ramp takes to the band
    trace = _trace(lambda t: min(AMBIENT + 2.0 * t, SETPOINT), 200.0)
    ramped = replace(trace, followed_degC=np.minimum(AMBIENT + 2.0 * trace.time_s, SETPOINT))
    found = _judged(ramped)
    assert found["iae"].value == pytest.approx(40.0 * 20.0 / 2.0, rel=0.01)
    assert found["settling_time"].value == pytest.approx(20.0 - TWO_PERCENT / 2.0, abs=0.1)
    assert found["overshoot"].value == 0.0


TAU = 10.0
STORY = (Mains(time_s=120.0, share=0.0), Mains(time_s=150.0, share=1.0), TemperatureStep(time_s=210.0, temperature_degC=-6.0),
         NewSetpoint(time_s=260.0, setpoint_degC=70.0), PlcPower(time_s=300.0, on=False), PlcPower(time_s=320.0, on=True),
         SetpointRampEvent(time_s=380.0, from_degC=70.0, setpoint_degC=80.0, duration_s=10.0),
         SetpointRampEvent(time_s=420.0, from_degC=80.0, setpoint_degC=80.0, duration_s=60.0))
#: of each phase of the story: its end, how long it rests at the end, and its setpoint
PHASES = {"heat-up": (120, 30, 60), "open": (150, 0, 60), "reheat": (210, 25, 60), "recovery": (260, 20, 60), "change": (300, 15, 70),
          "unsupplied": (320, 0, 70), "restart": (380, 25, 70), "ramp": (420, 0, 80), "soak": (480, 20, 80)}


def _any_run(chance):
    """A run of the story along random exponentials, near the setpoints from 30 s on, and powers at and beside the limits."""
    scans = np.arange(0.0, 481.0, 2.0)
    starts = np.unique(np.concatenate([[0.0], np.cumsum(chance.uniform(0.5, 4.0, 230)), [event.time_s for event in STORY]]))
    starts, rows, temperature = starts[starts < 480.0], [], AMBIENT
    for start, end in pairwise([*starts, 480.0]):
        setpoint = next(setpoint for end_s, _, setpoint in PHASES.values() if start < end_s)
        temperature += -6.0 if start == 210.0 else 0.0
        target = setpoint + chance.uniform(-9.0, 9.0) * (1.0 if start > 30.0 else 4.0)
        rows.append((start, temperature, temperature, target))
        temperature = target + (temperature - target) * math.exp((start - end) / TAU)
    asked = chance.choice([-0.5, 0.0, 0.4, 50.0, 99.6, 100.0, 100.4, math.nan], len(scans))
    return Trace(
        time_s=scans, temperature_degC=scans, reading_degC=scans, followed_degC=scans, power_asked_pct=asked,
        edge_time_s=np.arange(9.0), edge_pct=np.where(np.arange(9) % 2 == 0, 100.0, 0.0), stretches=np.array(rows),
        model=Fopdt(gain_degC_per_pct=1.0, time_constant_s=TAU, dead_time_s=1.0, ambient_degC=AMBIENT),
        scenario=Scenario(setpoint_degC=SETPOINT, duration_s=480.0, disturbances=STORY, rests_s=tuple(rest for _, rest, _ in PHASES.values())),
        actuator=Actuator(pwm_period_s=4.0), flags={"SM1.1": 2, "running": 5})


def _often(supplied):
    """5 pulses: in 460 s with supply, less those at a limit; a pulse in 4 s at most; 430 s of them with a heater."""
    between_s = 460.0 * sum(not (power <= 0.0 or power >= 100.0) for power in supplied) / len(supplied)
    return min(max(5 / 430.0, 5 / between_s), 1 / 4.0)


def _sampled(trace, band):
    """What the words of each criterion say, on samples a millisecond apart."""
    starts, first, _, target = trace.stretches.T

    def at(times):
        row = np.searchsorted(starts, times, "right") - 1
        return target[row] + (first[row] - target[row]) * np.exp((starts[row] - times) / TAU)

    def error(begin, end, setpoint):
        return at(np.arange(begin, end, 0.001)) - setpoint

    seen, found, begin, iae, rest_of = {}, {}, 0, 0.0, []
    for kind, (end, rest, setpoint) in PHASES.items():
        seen[kind] = error(begin, end, setpoint)
        outside = np.flatnonzero(np.abs(seen[kind]) > band)
        settled = 0.0 if len(outside) == 0 else math.inf if outside[-1] == len(seen[kind]) - 1 else (outside[-1] + 1) * 0.001
        name = {"heat-up": "settling"}.get(kind, kind)
        found |= {f"{name}_time": settled, "overshoot" if kind == "heat-up" else f"{kind}_overshoot": max(0.0, seen[kind].max()) / 40.0 * 100.0}
        if kind not in ("open", "unsupplied", "ramp", "soak"):
            rest_of.append(error(end - rest, end, setpoint))
            iae += np.abs(seen[kind]).sum() * 0.001
        begin = end
    line = seen["ramp"] + np.maximum(10.0 - np.arange(0.0, 40.0, 0.001), 0.0)
    nodes = np.union1d(trace.time_s, starts)
    cycles = [at(nodes[(nodes >= 90 + 4 * n) & (nodes < 94 + 4 * n + 2.001 * (n == 6))]) for n in range(7)]
    supplied = trace.power_asked_pct[(trace.time_s < 300.0) | (trace.time_s >= 320.0)]
    return found | {
        "iae": iae, "steady_offset": max(abs(e.mean()) for e in rest_of), "limit_cycle": max(np.ptp(e) for e in rest_of) / 2.0,
        "pwm_ripple": float(np.median([np.ptp(cycle) for cycle in cycles])), "deviation": -min(0.0, seen["recovery"].min()),
        "ramp_overshoot": max(0.0, seen["ramp"].max(), seen["soak"].max()) / 10.0 * 100.0, "ramp_deviation": np.abs(line).max(),
        "peak": 80.0 + max(seen["ramp"].max(), seen["soak"].max()), "soak_deviation": np.abs(error(460, 480, 80)).max(),
        "saturation": 100.0 * sum(power <= 0.0 or power >= 100.0 for power in supplied) / len(supplied), "switchings": _often(supplied) * 3600.0,
        "overflow": 2 + sum(map(math.isnan, supplied)),
    }


@pytest.mark.parametrize("seed", range(8))
def test_any_course_through_a_whole_story_measures_what_its_samples_show(seed):
    trace, band = _any_run(np.random.default_rng(seed)), 4.0 + 1.5 * (seed % 3)
    expected = _sampled(trace, band)
    found = {name: each.value for name, each in _judged(trace, tolerance_degC=band).items()}
    assert found.pop("power_reserve") == 100.0 - (80.0 - AMBIENT)
    assert found == pytest.approx({name: expected[name] for name in found}, rel=1e-3, abs=0.01)


@pytest.mark.parametrize("at_least", [False, True])
def test_many_values_use_of_their_limits_what_each_of_them_does(at_least):
    ends = (-2.0, 0.0, 0.5, 1.0, 3.0, math.inf, math.nan)
    pairs = [(value, limit) for value in ends for limit in (-1.0, 0.0, 0.5, 2.0)]
    values, limits = np.array(pairs).T
    one_by_one = [Criterion(name="x", value=value, limit=limit, unit="", what="", at_least=at_least).strain for value, limit in pairs]
    assert _strains(values, limits, at_least=at_least).tolist() == one_by_one
    assert _strains(np.array(ends), None, at_least=at_least).tolist() == [0.0] * 6 + [math.inf]
