"""As left: traces of loops that a few plain lines here simulate are held against a proof, and by numbers counted here."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from heatertune import chain
from heatertune.codec import decode, encode, plain
from heatertune.errors import InputError
from heatertune.log.log_values import Log, LogSignal
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.proof.as_left import AsLeft, as_left
from heatertune.proof.proof_document import ProofView

GAIN, LAG, DEAD, ROOM = 0.37, 167.0, 12.0, 22.0
K, TN, TA = 9.5, 66.0, 4.0
SETPOINT = 40.0
STEP = 0.05  # of the simulation [s]


@pytest.fixture(scope="module")
def proven():
    """The words of a PI on the FB41 and their proof, on one heater given by hand."""
    fitted = model_by_hand(Fopdt(gain_degC_per_pct=GAIN, time_constant_s=LAG, dead_time_s=DEAD, ambient_degC=ROOM))
    design = PidDesign(gain_pct_per_degC=K, integral_time_s=TN, derivative_time_s=0.0, sample_time_s=TA, structure="pi",
                       method="by hand")
    proof = chain.prove(chain.encode(design, "fb41"), fitted, setpoint_degC=SETPOINT)
    return proof.words, fitted, decode(ProofView, plain(proof.to_document()), "proof.json")


def loop(seconds, *, gain=GAIN, load_at=math.inf, asked=((0.0, SETPOINT),), k=K, tn=TN):
    """Return instants, temperature and power of a plain loop: trapezoidal PI with a held integral, PWM, Euler's steps.

    Textbook equations in floats; nothing of heatertune is used. `asked`: (instant, setpoint); a load of −10 % of full
    power comes at `load_at`.
    """
    n, per_call = round(seconds / STEP), round(TA / STEP)
    temperature, power = np.empty(n), np.zeros(n)
    late = [0.0] * round(DEAD / STEP)
    reading, integral, error, on = ROOM, 0.0, 0.0, 0.0
    for i in range(n):
        if i % per_call == 0:
            setpoint = [value for at, value in asked if at <= i * STEP]
            if setpoint:
                before, error = error, setpoint[-1] - reading
                moved = integral + k * TA / tn * (error + before) / 2.0
                integral = moved if 0.0 < k * error + moved < 100.0 else min(max(integral, 0.0), 100.0)
                on = min(max(k * error + integral, 0.0), 100.0)
        power[i] = 100.0 if i % per_call < on / 100.0 * per_call else 0.0
        late.append(power[i] - 10.0 * (i * STEP >= load_at))
        temperature[i] = reading
        reading += STEP / LAG * (ROOM + gain * late.pop(0) - reading)
    return np.arange(n) * STEP, temperature, power


def trace(seconds=900.0, *, every=2.0, rest=60.0, columns="setpoint", **of):
    """Return the log of such a loop after a rest, in steps of 0.1 °C, and what was simulated."""
    time, temperature, power = loop(seconds, **of)
    nth, before = round(every / STEP), np.arange(0.0, rest, every)
    asked = [[value for at, value in of.get("asked", ((0.0, SETPOINT),)) if at <= now][-1] for now in time[::nth]]

    def column(name, calm, values):
        return np.concatenate([np.full(len(before), calm), values]) if name in (columns, "temperature") else None

    log = Log(name="after.csv", source="a plain loop", time_s=np.concatenate([before, rest + time[::nth]]),
              temperature_degC=np.round(column("temperature", ROOM, temperature[::nth]), 1),
              setpoint_degC=column("setpoint", 0.0, asked), power_pct=column("power", 0.0, power[::nth]))
    return log, time, temperature


def by_name(found):
    return {line.name: line for line in found.measurements}


@pytest.mark.long
@pytest.mark.parametrize("columns", ["setpoint", "power", "none"])
def test_the_same_heater_is_as_proven_and_its_figures_are_those_of_the_curve(proven, columns):
    log, time, temperature = trace(columns=columns)
    found = as_left(log, *proven)
    assert (found.verdict, found.outside) == ("AS PROVEN", ())
    assert found.begins_by == {"none": "temperature"}.get(columns, columns)
    assert found.begins_s == pytest.approx(60.0, abs=4.0 if columns == "none" else 0.0)
    lines = by_name(found)
    peak = (temperature.max() - SETPOINT) / (SETPOINT - ROOM) * 100.0
    assert lines["overshoot"].measured == pytest.approx(peak, abs=0.06 / 18.0 * 100.0)
    settled = time[np.flatnonzero(np.abs(temperature - SETPOINT) > 1.0)[-1]]
    assert lines["settling_time"].measured == pytest.approx(settled, abs=6.0)
    assert all(lines[name].as_proven for name in ("overshoot", "settling_time"))
    assert decode(AsLeft, json.loads(json.dumps(encode(found))), "as_left.json") == found


def test_a_heat_up_begins_with_the_power_between_two_readings(proven):
    # switched on at 60 s, as the power's own log says to the instant; the readings come every 7 s, of which none is at 60 s
    time, temperature, power = loop(900.0)
    readings_s = np.arange(0.0, 900.0, 7.0)
    degC = np.where(readings_s < 60.0, ROOM, np.interp(readings_s - 60.0, time, temperature))
    changed = np.concatenate([[True], np.diff(power) != 0.0])
    switched = LogSignal(values=np.concatenate([[0.0], power[changed]]), time_s=np.concatenate([[0.0], 60.0 + time[changed]]))
    log = Log(name="after.csv", source="a plain loop", signals={
        "temperature": LogSignal(values=np.round(degC, 1), time_s=readings_s), "power": switched})
    found = as_left(log, *proven)
    assert (found.begins_by, found.begins_s, found.verdict) == ("power", 60.0, "AS PROVEN")
    rows = as_left(Log(name="after.csv", source="a plain loop", time_s=readings_s, temperature_degC=np.round(degC, 1),
                       power_pct=switched.at(readings_s)), *proven)
    assert (rows.begins_by, rows.begins_s) == ("power", 63.0)  # of rows the first that shows the power


@pytest.mark.long
def test_pulses_read_in_step_with_their_period_tell_nothing_against_the_power_reserve(proven):
    found = as_left(trace(2400.0, columns="power", every=TA)[0], *proven)  # every reading sees the heater just switched on
    assert by_name(found)["power_reserve"].measured is None
    assert by_name(found)["power_reserve"].message == "a reading every 4 s does not show a PWM period of 4 s"
    often = by_name(as_left(trace(2400.0, columns="power", every=0.5)[0], *proven))["power_reserve"]
    assert often.measured == pytest.approx(100.0 - (SETPOINT - ROOM) / GAIN, abs=100.0 / 8.0)  # what holds the heater there
    assert often.as_proven


def begun_late(late_s, *, every, digits, power, noise=0.0, seed=0, **of):
    """Return the log of a loop from so long after its heat-up began, in digits of so many decimals."""
    time, temperature, pulses = loop(1800.0, **of)
    nth = round(every / STEP)
    first = round(late_s / STEP)
    drawn = np.random.default_rng(seed).normal(0.0, noise, len(time)) if noise else 0.0
    return Log(name="late.csv", source="a plain loop", time_s=time[first::nth],
               temperature_degC=np.round((temperature + drawn)[first::nth], digits),
               setpoint_degC=np.full(len(time[first::nth]), SETPOINT), power_pct=pulses[first::nth] if power else None)


def judged(log, proven):
    """Return the verdict on a log, or that it cannot be judged."""
    try:
        return as_left(log, *proven).verdict
    except InputError:  # it begins at its setpoint, or beyond it
        return "NOT JUDGED"


@pytest.fixture(scope="module")
def fitted_so(proven):
    """The same proof, of a model that left 0.2 °C over of its own log: this loop's plain PI is not the FB41 to the last digit."""
    words, fitted, view = proven
    return words, replace(fitted, candidates=tuple(replace(each, rmse_degC=0.2) for each in fitted.candidates)), view


@pytest.mark.long
@pytest.mark.parametrize("seed", range(30))
def test_a_log_that_begins_anywhere_in_a_heat_up_tells_nothing_against_a_loop_in_order(fitted_so, seed):
    draw = np.random.default_rng(seed)
    log = begun_late(draw.uniform(0.0, 170.0), every=draw.choice([1.0, 2.0, 5.0, 10.0, 17.0]), digits=draw.choice([1, 1, 2]),
                     power=draw.random() < 0.3, noise=draw.choice([0.0, 0.05]), seed=seed)
    assert judged(log, fitted_so) != "NOT AS PROVEN"


@pytest.mark.long
@pytest.mark.parametrize("late_s", [0.0, 4.0, 10.0, 20.0, 30.0])
@pytest.mark.parametrize("wrong", [{"gain": 2.0 * GAIN}, {"k": K / 3.0}, {"tn": TN / 4.0}], ids=str)
def test_a_wrong_loop_is_told_from_a_log_that_begins_late_too(fitted_so, late_s, wrong):
    log = begun_late(late_s, every=2.0, digits=1, power=False, **wrong)
    assert judged(log, fitted_so) == "NOT AS PROVEN"


@pytest.mark.long
def test_a_log_of_the_end_of_a_heat_up_shows_too_little(fitted_so):
    found = as_left(begun_late(90.0, every=2.0, digits=1, power=False), *fitted_so)
    assert found.verdict == "NOT SHOWN"
    assert "shows only the last" in found.messages[0]
    early = as_left(begun_late(25.0, every=2.0, digits=1, power=False), *fitted_so)
    assert early.verdict == "AS PROVEN"
    assert any("begins in the middle of a heat-up" in note for note in early.notes)


@pytest.mark.long
def test_a_sensor_that_freezes_at_the_setpoint_is_not_as_proven(fitted_so):
    log, _, temperature = trace(1800.0, columns="setpoint", every=1.0)
    fine = replace(log, temperature_degC=np.round(np.concatenate([np.full(60, ROOM), temperature[::20]]), 2))
    assert as_left(fine, *fitted_so).verdict == "AS PROVEN"
    rest = fine.time_s > 700.0
    assert np.ptp(fine.temperature_degC[rest]) > 0.2, "the ripple of the PWM"
    frozen = as_left(replace(fine, temperature_degC=np.where(rest, 40.0, fine.temperature_degC)), *fitted_so)
    assert frozen.verdict == "NOT SHOWN"
    assert frozen.messages[0].endswith("the sensor or its reading is frozen.")
    # one that comes in steps of 0.5 °C stands still at rest, and is none
    coarse = replace(log, temperature_degC=np.round(2.0 * log.temperature_degC) / 2.0)
    assert as_left(coarse, *fitted_so).verdict == "AS PROVEN"


@pytest.mark.long
@pytest.mark.parametrize("gain", [0.6 * GAIN, 1.6 * GAIN])
def test_another_heater_is_told_outside_and_where(proven, gain):
    found = as_left(trace(gain=gain)[0], *proven)
    assert found.verdict == "NOT AS PROVEN"
    worst = max(found.outside, key=lambda stretch: abs(stretch.most_degC))
    _, same, _ = loop(900.0)
    time, other, _ = loop(900.0, gain=gain)
    farthest = np.abs(other - same).argmax()
    assert worst.begin_s < time[farthest] < worst.end_s
    # the heat-up may have begun a reading earlier, or a call later: 6 s at 0.2 °C/s
    assert worst.most_degC == pytest.approx((other - same)[farthest], abs=1.2)


@pytest.mark.long
def test_a_load_and_a_change_of_the_setpoint_are_measured_where_the_trace_shows_them(proven):
    log, time, temperature = trace(1800.0, load_at=700.0, asked=((0.0, SETPOINT), (1300.0, 36.0)))
    lines = by_name(as_left(log, *proven, load_at_s=760.0))
    fallen = (SETPOINT - temperature)[(time > 700.0) & (time < 1300.0)].max()
    assert lines["deviation"].measured == pytest.approx(fallen, abs=0.1)
    assert lines["change_time"].measured == pytest.approx(
        time[np.flatnonzero(np.abs(temperature - 36.0) > 1.0)[-1]] - 1300.0, abs=6.0)
    untold = by_name(as_left(log, *proven))
    assert untold["deviation"].measured is None
    assert "--load-at" in untold["deviation"].message


def test_what_a_short_trace_does_not_show_is_told_as_not_measured(proven):
    whole = as_left(trace(60.0)[0], *proven)
    assert whole.verdict == "NOT SHOWN"
    assert whole.messages == ("The loop does not settle within the trace (not yet within ±1 °C after 58 s, where it ends): log until it is at rest. "
                          "So far it agrees with the proof.",)  # the last of its readings, one each 2 s
    found = by_name(whole)
    for name in ("overshoot", "settling_time", "steady_offset", "recovery_time", "ms", "iae"):
        assert found[name].measured is None, name
        assert found[name].message, name
        assert found[name].keeps is None, name
    assert "the trace ends after" in found["overshoot"].message


@pytest.mark.long
def test_pulses_are_counted_where_the_readings_show_them(proven):
    every = proven[2].actuator.pwm_period_s / 8.0
    log, _, _ = trace(300.0, every=every, columns="power")
    rises = np.count_nonzero(np.diff(log.power_pct) > 0.0)
    found = by_name(as_left(log, *proven))["switchings"]
    assert found.measured == pytest.approx(rises / ((log.time_s[-1] - log.time_s[0]) / 3600.0))
    slow = by_name(as_left(trace(300.0, every=2.0, columns="power")[0], *proven))["switchings"]
    assert (slow.measured, "does not show" in slow.message) == (None, True)


@pytest.mark.parametrize(("given", "message"), [
    ({"setpoint_degC": ROOM}, "after.csv: begins at 22 °C, at its setpoint of 22 °C"),
    ({"setpoint_degC": 10.0}, "after.csv: begins at 22 °C, beyond its setpoint of 10 °C"),
    ({"begins_s": 5000.0}, "--begins-at = 5000 s: after.csv goes from 0 to"),
    ({"load_at_s": 5000.0}, "--load-at = 5000 s: after.csv goes from 0 to"),
    ({"load_at_s": 20.0}, "--load-at = 20 s: the heat-up of after.csv begins at 60 s"),
])
def test_a_trace_in_which_nothing_can_be_judged_is_refused(proven, given, message):
    with pytest.raises(InputError, match=message):
        as_left(trace(60.0)[0], *proven, **given)


@pytest.mark.parametrize("seconds", [150.0, 190.0])
def test_what_may_still_leave_the_band_is_not_measured(proven, seconds):
    """A trace that ends where the temperature first comes to its setpoint shows no overshoot, and has not settled."""
    log, time, temperature = trace(seconds)
    into = time[np.flatnonzero(temperature > SETPOINT - 1.0)[0]]
    assert into < seconds < 1.5 * into
    found = by_name(as_left(log, *proven))
    assert found["overshoot"].measured is None
    assert found["settling_time"].measured is None
