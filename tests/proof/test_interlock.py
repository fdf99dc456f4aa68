"""The interlock in the loop, against the heater's own formula and against a loop that runs every scan of 10 ms."""

import math
from itertools import product

import numpy as np
import pytest
from tests.witness.trace_measures import judge

from heatertune.compiled import bound
from heatertune.errors import OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt
from heatertune.plc.cpu.one_bit.machine import OneBitState
from heatertune.proof import Actuator, Interlock, Scenario, TemperatureStep, prove_models, simulate
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.kernel import LOAD, Events, ScanClock, SetpointProgram, TraceArrays, run
from heatertune.proof.meter import no_meter
from heatertune.proof.plant import plant_from
from heatertune.proof.verdict import _BITS, INTERLOCKS, _scan

HEATER = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=6.5, ambient_degC=20.0)
PWM = Actuator(pwm_period_s=2.0)
ARRAYS = ("time_s", "temperature_degC", "reading_degC", "power_asked_pct", "edge_time_s", "edge_on", "stretches")


def _interlock(limit=90.0, **kept):
    return Interlock(name="heater-fan", limit_degC=limit, **kept)


def test_a_limit_above_the_run_changes_nothing_bit_for_bit(tenths, words, any_heater):
    scenario = Scenario(setpoint_degC=40.0, duration_s=600.0, disturbances=(TemperatureStep(time_s=300.0, temperature_degC=-4.0),),
                        noise_degC=0.1, seed=3)
    free = simulate(tenths, words(), any_heater, scenario, PWM)
    watched = simulate(tenths, words(), any_heater, scenario, PWM, interlock=_interlock(60.0))
    for name in ARRAYS:
        assert np.array_equal(getattr(free, name), getattr(watched, name)), name
    assert watched.cut_s == math.inf
    assert [c for c in judge(watched, LoopLimits()) if c.name != "interlock_trips"] == list(judge(free, LoopLimits()))


def test_the_heater_is_cut_at_the_scan_that_sees_the_limit(constant, words):
    # 20 + 50·(1 − e^(−(t − 6.5)/150)) = 45 at t = 6.5 + 150·ln 2 = 110.4721 s, seen by the scan at 110.48 s
    scenario = Scenario(setpoint_degC=50.0, duration_s=400.0)
    trace = simulate(constant(100.0), words(), HEATER, scenario, PWM, interlock=_interlock(45.0))
    assert trace.cut_s == pytest.approx(110.48, abs=1e-9)
    assert trace.edge_time_s == pytest.approx([0.0, 110.48], abs=1e-9)
    assert trace.edge_on.tolist() == [True, False]
    # what was on its way arrives: the top comes the dead time later; then the heater cools towards 20 °C
    top = 20.0 + 50.0 * (1.0 - math.exp(-110.48 / 150.0))
    assert float(trace.temperature_at(116.98)) == pytest.approx(top)
    assert float(trace.temperature_at(400.0)) == pytest.approx(20.0 + (top - 20.0) * math.exp(-(400.0 - 116.98) / 150.0))


def _scan_by_scan(power, limit, fan_stops, duration):
    """The same loop in steps of 10 ms: the text of the program in Boolean terms, the heater by its exponential."""
    fan = contact = False
    y, decay, queue, edges = 20.0, math.exp(-0.01 / 150.0), [False] * 650, []
    for k in range(round(duration * 100)):
        stopped = contact and (not (fan and k * 0.01 < fan_stops - 1e-9) or y >= limit)
        fan, contact = (False, False) if stopped else (fan, contact)
        if k == 0:
            fan = contact = True
        hot = contact and k % 200 < power * 2
        if hot != queue[-1]:
            edges.append(k * 0.01)
        queue.append(hot)
        target = 70.0 if queue[-651] else 20.0
        y = target + decay * (y - target)
    return edges, y


@pytest.mark.parametrize(("limit", "fan_stops"), [(30.0, math.inf), (90.0, 61.203), (25.0, 61.203), (90.0, 0.0), (19.0, math.inf)])
@pytest.mark.parametrize("power", [60, 100])
def test_it_is_the_loop_that_runs_the_program_every_10_ms(constant, words, power, limit, fan_stops):
    edges, last = _scan_by_scan(power, limit, fan_stops, 200.0)
    interlock = _interlock(limit, fan_stops_s=None if math.isinf(fan_stops) else fan_stops)
    scenario = Scenario(setpoint_degC=50.0, duration_s=200.0)
    trace = simulate(constant(float(power)), words(), HEATER, scenario, PWM, interlock=interlock)
    assert trace.edge_time_s.tolist() == pytest.approx([edge for edge in edges if edge < 200.0 - 1e-6], abs=1e-9)
    assert float(trace.temperature_at(200.0)) == pytest.approx(last, abs=1e-6)
    assert math.isfinite(trace.cut_s)


def test_a_fan_that_fails_switches_the_heater_off_at_once_and_for_good(tenths, words, heater):
    scenario = Scenario(setpoint_degC=50.0, duration_s=1200.0)
    trace = simulate(tenths, words(), heater, scenario, PWM, interlock=_interlock(fan_stops_s=700.004))
    assert trace.cut_s == pytest.approx(700.01, abs=1e-9)
    assert trace.edge_time_s[-1] <= trace.cut_s + 1e-9
    assert not trace.edge_on[-1]
    assert trace.temperature_degC[-1] < 40.0
    late = simulate(tenths, words(), heater, scenario, PWM, interlock=_interlock(fan_stops_s=5000.0))
    assert late.cut_s == math.inf


def test_the_limit_is_found_late_in_a_long_run(constant, words):
    slow = Fopdt(gain_degC_per_pct=0.5, time_constant_s=5000.0, dead_time_s=6.5, ambient_degC=20.0)
    trace = simulate(constant(100.0), words(), slow, Scenario(setpoint_degC=50.0, duration_s=4000.0), PWM,
                     interlock=_interlock(45.0))
    assert trace.cut_s == pytest.approx(math.ceil(100 * (6.5 + 5000.0 * math.log(2.0))) / 100, abs=1e-9)


@pytest.mark.parametrize(("temperature", "opens"), [
    (lambda t: 45.0 + 0.0 * t, 0.01),  # at the limit is hot; in the scan of the buttons the program does not look yet
    (lambda t: np.nextafter(45.0, 0.0) + 0.0 * t, math.inf),
    (lambda t: np.where((t < 0.005) | (t > 4.999), 50.0, 20.0), 5.0),  # cool again when the program first looks
    (lambda t: np.where((t > 4.001) & (t < 4.009), 50.0, 20.0), math.inf),  # between two scans
    (lambda t: np.where(t > 9.999, 50.0, 20.0), 10.0),
    (lambda t: np.where(t > 4.999, 45.0, 20.0), 5.0),
], ids=["at the limit", "just below", "hot at first", "between scans", "at the end", "at the limit later"])
def test_the_contact_opens_at_the_first_scan_that_finds_the_heater_hot(temperature, opens):
    assert _interlock(45.0).opens_s(temperature, 10.0) == opens


def test_a_limit_below_the_setpoint_fails_the_proof(tenths, words, heater):
    scenario = Scenario(setpoint_degC=50.0, duration_s=2000.0, disturbances=(TemperatureStep(time_s=1200.0, temperature_degC=-3.0),))

    def proven(limit):
        return prove_models(tenths, words(gain=6.0), [("one", heater)], scenario, PWM, interlock=_interlock(limit))

    passed, failed = proven(80.0), proven(45.0)
    assert (passed.verdict, failed.verdict) == ("PASS", "FAIL")
    trips = {proof: next(c for c in proof.criteria if c.name == "interlock_trips") for proof in (passed, failed)}
    assert (trips[passed].value, trips[passed].ok) == (0.0, True)
    assert (trips[failed].value, trips[failed].ok) == (1.0, False)
    assert failed.to_document()["interlock"] == {"name": "heater-fan", "limit_degC": 45.0, "fan_stops_s": None}
    free = prove_models(tenths, words(gain=6.0), [("one", heater)], scenario, PWM)
    assert free.to_document()["interlock"] is None
    assert "interlock_trips" not in free.to_document()["criteria"]


@pytest.mark.parametrize(("fan", "contact", "hot", "turns"), list(product([False, True], repeat=4)))
def test_the_program_rests_until_its_inputs_change(fan, contact, hot, turns):
    state = OneBitState(outputs=fan << _BITS["F"] | contact << _BITS["H"])
    after = _scan(state, pressed=False, hot=hot, turns=turns)
    assert _scan(after, pressed=False, hot=hot, turns=turns).outputs == after.outputs


def test_a_cut_ends_the_pulse_that_runs_and_switches_nothing_on_afterwards():
    def edges(cut):
        ring, none = [0.0] * 16, [0.0]
        never = Events([math.inf], [LOAD], [0.0])
        heater = plant_from(0.5, 150.0, 0.0, 1.0, 20.0)
        half = bound(run, step=lambda *_: (None, 50.0, 50.0, 0), measure=lambda _, y: y)
        record, program = TraceArrays(False, *9 * [[]]), SetpointProgram([40.0], [1], 0.0, 0, 0.0)
        switched, _ = half(None, None, None, ScanClock(1.0, 11, none, none), program, heater, 20.0, never, PWM.switches, cut, ring,
                           record, no_meter())
        return ring[:switched]

    assert edges(math.inf) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0]
    assert edges(4.25) == [0.0, 1.0, 2.0, 3.0, 4.0, 4.25]
    assert edges(5.5) == edges(6.0) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_an_interlock_that_makes_no_sense_is_refused():
    with pytest.raises(UnknownName, match="known: heater-fan"):
        Interlock(name="heater-door", limit_degC=90.0)
    with pytest.raises(OutOfRange, match="limit_degC"):
        _interlock(math.nan)
    with pytest.raises(OutOfRange, match="fan_stops_s"):
        _interlock(fan_stops_s=-1.0)
    assert INTERLOCKS == ("heater-fan",)


def test_the_first_scan_after_the_heater_was_known_to_be_cold_is_looked_at():
    # hot from 3 s on, which is a scan of 10 ms; known to be cold until just before it
    assert _interlock(45.0).opens_s(lambda t: np.where(t >= 3.0 - 1e-9, 50.0, 40.0), 10.0, 2.995) == pytest.approx(3.0)
