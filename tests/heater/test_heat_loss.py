"""The heater with a loss curve against SciPy's integration of the same equations, and what its curve means."""

import numpy as np
import pytest
from scipy.constants import Stefan_Boltzmann
from scipy.integrate import solve_ivp

from heatertune.errors import OutOfRange
from heatertune.heater.heat_loss import Loss, LossCurve, loss_at, tangent_at
from heatertune.model.loss_curve import (
    LossFopdt,
    LossTwoLag,
    heater_with_loss,
    loss_numbers,
    slower_cooling,
    steady_power_pct,
    top_degC,
)
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.pwm import Actuator
from heatertune.proof import loop as loops
from heatertune.proof.loop import simulate
from heatertune.proof.scenario import Load, Scenario, TemperatureStep

ROOM = 22.0
ABSOLUTE = 273.15


def kiln(*, sensor_s: float = 0.0, at_degC: float = 500.0):
    """Return a kiln of 3 kW that loses by convection and radiation, by its physical numbers."""
    full, capacity, convection, radiation = 3000.0, 9000.0, 1.2, 0.018 * Stefan_Boltzmann
    def lost(t):
        return convection * (t - ROOM) + radiation * ((t + ABSOLUTE) ** 4 - (ROOM + ABSOLUTE) ** 4)

    chord = lost(at_degC) / (at_degC - ROOM)
    curve = LossCurve(share=1.0 - convection / chord, exponent=4.0, origin_degC=-ABSOLUTE, at_degC=at_degC)
    numbers = {"gain_degC_per_pct": full / 100.0 / chord, "time_constant_s": capacity / chord, "dead_time_s": 20.0,
               "ambient_degC": ROOM, "loss": curve}
    model = LossTwoLag(**numbers, second_time_constant_s=sensor_s) if sensor_s else LossFopdt(**numbers)
    return model, lambda t, pct: (full * pct / 100.0 - lost(t)) / capacity


def hotend(exponent: float = 1.4):
    """Return a heater of RepRapFirmware: loss = (T − room)^exponent times a constant."""
    curve = LossCurve(share=1.0, exponent=exponent, at_degC=240.0)
    model = LossFopdt(gain_degC_per_pct=3.0, time_constant_s=200.0, dead_time_s=3.0, ambient_degC=ROOM, loss=curve)
    rise = 240.0 - ROOM

    def slope(t, pct):
        lost = rise * np.sign(t - ROOM) * (abs(t - ROOM) / rise) ** exponent
        return (3.0 * pct - lost) / 200.0

    return model, slope


def test_the_chord_tells_the_power_that_holds_its_temperature_and_the_curve_that_of_others():
    model, slope = kiln()
    for degC in (100.0, 300.0, 500.0, 800.0):
        assert slope(degC, steady_power_pct(model, degC)) == pytest.approx(0.0, abs=1e-12)
    assert steady_power_pct(model, 500.0) == pytest.approx((500.0 - ROOM) / model.gain_degC_per_pct)
    top = top_degC(model)
    assert top == pytest.approx(903.0, abs=1.0)  # the kiln of issue 43 ends at 903 °C
    assert slope(top, 100.0) == pytest.approx(0.0, abs=1e-9)


def test_another_chord_is_the_same_heater():
    model, _ = kiln()
    other = heater_with_loss(heater_with_loss(model, 850.0, 200.0), 500.0)
    assert other.gain_degC_per_pct == pytest.approx(model.gain_degC_per_pct)
    assert other.time_constant_s == pytest.approx(model.time_constant_s)
    assert other.loss.share == pytest.approx(model.loss.share)
    hot = heater_with_loss(model, 850.0, 200.0)
    assert [steady_power_pct(hot, t) for t in (100.0, 600.0)] == pytest.approx(
        [steady_power_pct(model, t) for t in (100.0, 600.0)])
    assert len(hot.linear) == 2
    assert heater_with_loss(model, 10.0) is model  # below the room there is no chord
    straight = Fopdt(gain_degC_per_pct=1.0, time_constant_s=10.0, dead_time_s=1.0, ambient_degC=20.0)
    assert heater_with_loss(straight, 50.0) is straight


@pytest.mark.parametrize("heater", [kiln, hotend])
def test_the_tangent_is_that_of_the_equations(heater):
    model, slope = heater()
    tangent, *_ = model.linear
    at, step = model.loss.at_degC, 1e-3
    by_degree = (slope(at + step, 0.0) - slope(at - step, 0.0)) / (2.0 * step)
    by_percent = slope(at, 1.0) - slope(at, 0.0)
    assert tangent.time_constant_s == pytest.approx(-1.0 / by_degree, rel=1e-6)
    assert tangent.gain_degC_per_pct == pytest.approx(-by_percent / by_degree, rel=1e-6)
    assert at - tangent.ambient_degC == pytest.approx(tangent.gain_degC_per_pct * steady_power_pct(model, at))


@pytest.mark.parametrize("exponent", [0.9, 6.1])
def test_an_exponent_out_of_range_is_refused(exponent):
    with pytest.raises(OutOfRange, match="exponent"):
        LossCurve(share=1.0, exponent=exponent, at_degC=100.0)


def test_cooling_takes_no_longer_than_the_chord_times_the_least_share_of_its_loss():
    model, slope = kiln(at_degC=900.0)
    for low in (800.0, 400.0, 60.0):
        arrives = solve_ivp(lambda _, y: [slope(y[0], 0.0)], (0.0, 1e6), [900.0], rtol=1e-10, atol=1e-10,
                            events=_ends(low)).t_events[0][0]
        chord = model.time_constant_s * np.log((900.0 - ROOM) / (low - ROOM))
        assert chord < arrives < chord * slower_cooling(model, low)


def _ends(level):
    def reached(_, y):
        return y[0] - level

    reached.terminal = True
    return reached


def closed_loop(model, setpoint, *, gain, tn, ta, span):
    controller, scaling = controller_for("fb41"), Scaling(low_degC=0.0, high_degC=span)
    words = controller.encode(PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=0.0,
                                        sample_time_s=ta, structure="pi", method=""), scaling)
    lasts = 6.0 * model.time_constant_s
    scenario = Scenario(setpoint_degC=setpoint, duration_s=lasts, disturbances=(
        TemperatureStep(time_s=0.4 * lasts, temperature_degC=-0.1 * setpoint),
        Load(time_s=0.6 * lasts, power_pct=-10.0)))
    return simulate(controller, words, model, scenario, Actuator(pwm_period_s=2.0 * ta))


def integrated(trace, slope, sensor_s):
    """Return the temperature at the scans by SciPy, from the edges of the switch alone."""
    model, scenario = trace.model, trace.scenario
    edges = sorted([(time + model.dead_time_s, pct) for time, pct in zip(trace.edge_time_s, trace.edge_pct, strict=True)]
                   + [(event.time_s + model.dead_time_s * isinstance(event, Load), event)  # a load acts as power does
                      for event in scenario.disturbances], key=lambda each: each[0])
    times, y, now, heat, load = trace.time_s, [ROOM, ROOM], 0.0, 0.0, 0.0
    found = np.full(len(times), np.nan)
    end = times[-1] + 1e-9
    for instant, what in [*edges, (end, 0.0)]:
        inside, until = np.flatnonzero((times >= now) & (times < instant)), min(instant, end)
        if until > now:
            whole = solve_ivp(
                lambda _, z, pct: [slope(z[0], pct), (z[0] - z[1]) / sensor_s if sensor_s else 0.0], (now, until), y,
                args=(heat + load,), t_eval=np.append(times[inside], until), rtol=1e-10, atol=1e-9)
            found[inside], y = whole.y[1 if sensor_s else 0, :-1], list(whole.y[:, -1])
        now = until
        if isinstance(what, TemperatureStep):
            y = [each + what.temperature_degC for each in y]
        elif isinstance(what, Load):
            load += what.power_pct
        else:
            heat = what
    return found


@pytest.mark.parametrize(("heater", "sensor_s", "loop"), [
    (kiln, 0.0, {"setpoint": 650.0, "gain": 0.8, "tn": 900.0, "ta": 20.0, "span": 1300.0}),
    (kiln, 40.0, {"setpoint": 650.0, "gain": 0.8, "tn": 900.0, "ta": 20.0, "span": 1300.0}),
    (hotend, 0.0, {"setpoint": 240.0, "gain": 2.0, "tn": 60.0, "ta": 1.0, "span": 400.0}),
])
def test_a_loop_is_as_scipy_integrates_it_within_a_hundred_thousandth_of_the_rise(heater, sensor_s, loop):
    model, slope = heater(sensor_s=sensor_s) if sensor_s else heater()
    trace = closed_loop(model, **loop)
    rise = loop["setpoint"] - ROOM
    own = integrated(trace, slope, sensor_s)
    assert np.nanmax(np.abs(trace.temperature_degC - own)) < 1e-5 * rise
    # between the scans, too
    assert trace.temperature_at(trace.time_s) == pytest.approx(trace.temperature_degC, abs=1e-9)


def test_half_the_step_leaves_a_quarter_of_the_error():
    model, slope = kiln(at_degC=900.0)
    loss, exact = model.loss.loss(ROOM), solve_ivp(
        lambda _, y: [slope(y[0], 100.0)], (0.0, 3000.0), [ROOM], rtol=1e-12, atol=1e-10).y[0, -1]
    errors = []
    for steps in (32, 64, 128):
        y, seconds = ROOM, 3000.0 / steps
        for _ in range(steps):
            line = tangent_at(y, model.gain_degC_per_pct, model.time_constant_s, ROOM, loss)
            target = line.ambient + 100.0 * line.gain
            y = target + np.exp(-seconds / line.lag) * (y - target)
        errors.append(abs(y - exact))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)


def test_a_straight_curve_is_the_linear_heater():
    straight = Fopdt(gain_degC_per_pct=9.0, time_constant_s=900.0, dead_time_s=20.0, ambient_degC=ROOM)
    numbers = loss_numbers(straight, ROOM)
    assert loss_at(321.0, ROOM, Loss(*numbers[:5])) == pytest.approx((321.0 - ROOM, 1.0))
    curve = LossCurve(share=0.0, exponent=4.0, origin_degC=-ABSOLUTE, at_degC=600.0)
    bent = LossFopdt(gain_degC_per_pct=9.0, time_constant_s=900.0, dead_time_s=20.0, ambient_degC=ROOM, loss=curve)
    asked = {"setpoint": 600.0, "gain": 0.4, "tn": 900.0, "ta": 10.0, "span": 1300.0}
    assert closed_loop(bent, **asked).temperature_degC == pytest.approx(closed_loop(straight, **asked).temperature_degC,
                                                                        abs=1e-6)


@pytest.mark.parametrize("heater", [kiln, hotend])
def test_compiled_and_plain_give_the_same_bits(heater, monkeypatch):
    model, _ = heater()
    asked = {"setpoint": 240.0, "gain": 1.0, "tn": 300.0, "ta": 2.0, "span": 400.0}
    runs = []
    for compiled in (False, True):
        monkeypatch.setattr(loops, "worth_compiling", lambda *_, compiled=compiled, **__: compiled)
        runs.append(closed_loop(model, **asked))
    assert np.array_equal(runs[0].temperature_degC, runs[1].temperature_degC)
    assert np.array_equal(runs[0].stretches, runs[1].stretches)
