"""Several logs of one heater with power, fitted together."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from tests.model.twins import AMBIENT, DEAD, GAIN, LAG, coloured, logged

from heatertune.errors import InputError
from heatertune.model.fit import fit_together
from heatertune.model.model_document import from_document, to_document
from heatertune.model.model_values import FitOutcome, OneLog
from heatertune.model.power import fit_logs
from heatertune.model.power.candidates import Rival
from heatertune.model.power.explanation import explain_log
from heatertune.model.power.fit_logs import _joint, _rivals, disagreements
from heatertune.model.power.fit_power import WeighedFit
from heatertune.model.statistics import RATIO, Interval

TRUTH = {"gain_degC_per_pct": GAIN, "time_constant_s": LAG, "dead_time_s": DEAD}
TIME = np.arange(0.0, 900.0, 4.0)


def steps(*powers):
    """Return 15 minutes of power: none for a minute, then three levels."""
    return np.select([TIME < 60, TIME < 400, TIME < 700], [0.0, *powers[:2]], powers[2])


def quiet(**heater):
    return logged(TIME, steps(60, 10, 80), noise=coloured(10, len(TIME), 0.15), name="quiet", **heater)


def noisy(*, drift=6.0, **heater):
    """Return a log in another room: 5 °C warmer and drifting [°C/h], 8 °C above rest at the start, twice the noise."""
    others = 5.0 + drift * TIME / 3600.0 + 8.0 * np.exp(-TIME / heater.get("lag", LAG))
    return logged(TIME, steps(40, 90, 0), noise=others + coloured(20, len(TIME), 0.3), name="noisy", **heater)


@pytest.fixture(scope="module")
def pair():
    return quiet(), noisy()


@pytest.fixture(scope="module")
def together(pair):
    return fit_together(pair)


def by_scipy(logs):
    """Return the heater and the second log's drift [°C/h] by SciPy's minimiser on sums of step responses.

    The noise levels are known to it.
    """
    def left(z):
        found = []
        for i, (log, size) in enumerate(zip(logs, (0.15, 0.3), strict=True)):
            ambient, drift, start = z[3 + 3 * i : 6 + 3 * i]
            made = ambient + drift * TIME / 3600.0 + start * np.exp(-TIME / z[1])
            for j in np.flatnonzero(np.diff(log.power_pct)):
                since = np.clip(TIME - TIME[j + 1] - z[2], 0.0, None)
                made += z[0] * (log.power_pct[j + 1] - log.power_pct[j]) * -np.expm1(-since / z[1])
            found.append((made - log.temperature_degC) / size)
        return np.concatenate(found)

    found = least_squares(left, [0.4, 120.0, 10.0, 20.0, 0.0, 0.0, 20.0, 0.0, 0.0], x_scale=[0.1, 30, 5] + [1.0] * 6)
    return dict(zip(TRUTH, found.x[:3], strict=True)), found.x[7]


@pytest.mark.long
def test_two_logs_give_the_true_heater_in_narrower_intervals_than_either_alone(together):
    assert together.outcome is FitOutcome.IDENTIFIED
    for name, true in TRUTH.items():
        found = together.ci95[name]
        assert found.low <= true <= found.high
        late = 2.0 * (TIME[1] - TIME[0]) if name == "dead_time_s" else 0.0  # by which the powers of all may be late
        for log in together.logs:
            assert found.high - late - found.low < log.ci95[name].high - log.ci95[name].low
    assert together.ci95["ambient_degC"].low <= AMBIENT <= together.ci95["ambient_degC"].high
    assert [log.name for log in together.logs] == ["quiet", "noisy"]
    assert any("same heater within their intervals" in note for note in together.notes)


@pytest.mark.long
def test_the_heater_is_that_of_a_second_implementation(pair, together):
    witness, drift = by_scipy(pair)
    for name, value in witness.items():
        # the noise levels are estimated here and known there, and there the first log may drift too
        assert getattr(together.model, name) == pytest.approx(value, abs=0.2 * _reach(together.ci95[name]))
    # alone, the log asks for no drift and ends beyond its intervals; with the other's heater it asks for this one
    assert 3600.0 * together.logs[1].drift_degC_per_s == pytest.approx(drift, abs=0.6)
    told = f"noisy: The ambient drifts by {3600.0 * together.logs[1].drift_degC_per_s:.2g} °C/h"
    assert any(note.startswith(told) for note in together.notes)


@pytest.mark.long
def test_noise_and_fit_of_each_log_are_told(together):
    first, second = together.logs
    assert first.ambient_degC == pytest.approx(AMBIENT, abs=0.3)
    assert first.drift_degC_per_s == 0.0
    assert second.noise_degC == pytest.approx(0.3, rel=0.25)
    assert first.noise_degC == pytest.approx(0.15, rel=0.25)
    told = next(note for note in together.notes if note.startswith("One heater for all logs explains"))
    assert f"{second.fit_pct:.1f} % of noisy ({second.alone_fit_pct:.1f} % alone)" in told
    assert second.fit_pct <= second.alone_fit_pct
    assert together.candidates[0].fits_pct == {log.name: log.fit_pct for log in together.logs}
    assert together.candidates[0].log == "quiet + noisy"
    assert np.std(together.residuals.measured_degC - together.residuals.simulated_degC) < 0.2


@pytest.mark.long
def test_the_document_holds_what_each_log_says(together):
    document = to_document(together)
    assert document["logs"][1]["alone"]["gain_degC_per_pct"] == together.logs[1].values["gain_degC_per_pct"]
    assert from_document(document).logs == together.logs


@pytest.mark.long
def test_two_heaters_are_told_with_the_values_of_each_alone(monkeypatch):
    # the fit of one heater to two leaves much over, so its own intervals are wide; here they shall hold nothing
    between = {"gain_degC_per_pct": 0.55, "time_constant_s": 150.0, "dead_time_s": 12.0, RATIO: 0.0037}
    narrow = {name: Interval(low=value, high=value) for name, value in between.items()}
    monkeypatch.setattr(fit_logs, "joint_intervals", lambda *_, **__: narrow)
    found = fit_together([quiet(), noisy(gain=0.62, drift=0.0)])
    told = next(note for note in found.notes if "disagree beyond their intervals" in note)
    assert "process gain 0.4" in told or "process gain 0.5" in told
    assert " by quiet" in told
    assert "process gain" in told
    assert "time constant" not in told.replace("gain per time constant", ""), "only the gain was changed"
    gain = found.ci95["gain_degC_per_pct"]
    assert (gain.low, gain.high) == tuple(log.values["gain_degC_per_pct"] for log in found.logs)
    own = [each for each in found.candidates if each.law.endswith("this log alone")]
    assert [each.log for each in own] == ["quiet", "noisy"]
    assert own[1].model.gain_degC_per_pct == pytest.approx(0.62, rel=0.05)
    assert not any("same heater" in note for note in found.notes)


def one(name, value, reach, *, other=1.0):
    values = {"gain_degC_per_pct": value, "time_constant_s": other, "dead_time_s": other, RATIO: other}
    ci95 = {each: Interval(low=0.0, high=2.0) for each in values} | {
        "gain_degC_per_pct": Interval(low=value - reach[0], high=value + reach[1])}
    return OneLog(name=name, fit_pct=90.0, alone_fit_pct=91.0, ambient_degC=20.0, drift_degC_per_s=0.0,
                  noise_degC=0.1, values=values, ci95=ci95)


def test_logs_disagree_beyond_the_share_of_the_five_percent_that_falls_on_each_parameter():
    # printed normal table: Φ(1.960) = 0.975 and Φ(2.498) = 0.99375, four parameters sharing 2.5 % on either side;
    # facing reaches 3 and 4 add up to 5, so 5·2.498/1.960 = 6.372 is the most
    first = one("a", 100.0, (99.0, 3.0))
    assert disagreements([first, one("b", 106.3, (4.0, 99.0))]) == ()
    (found,) = disagreements([first, one("b", 106.45, (4.0, 99.0))])
    assert (found.parameter, found.first.name, found.second.name) == ("gain_degC_per_pct", "a", "b")
    # three logs, three pairs: Φ(2.865) = 0.99792, so 5·2.865/1.960 = 7.31
    third = one("c", 103.0, (50.0, 50.0))
    assert disagreements([first, one("b", 107.2, (4.0, 99.0)), third]) == ()
    (found,) = disagreements([first, third, one("b", 107.4, (4.0, 99.0))])
    assert (found.first.name, found.second.name) == ("a", "b")


def test_an_interval_open_towards_the_other_value_never_disagrees():
    first = one("a", 100.0, (1.0, 1.0))
    open_up = replace(first, ci95=first.ci95 | {"gain_degC_per_pct": Interval(low=99.0, high=None)})
    assert disagreements([open_up, one("b", 200.0, (1.0, 1.0))]) == ()
    assert disagreements([open_up, one("b", 50.0, (1.0, 1.0))])


@pytest.mark.long
def test_pulses_in_every_log_leave_gain_and_time_constant_a_ratio():
    # 28 s of answer to the power, a fifth of the time constant: the ratio 0.5/150 is all there is
    time = np.arange(0.0, 80.0, 1.0)
    power = np.where(time > 40.0, 100.0, 0.0)
    logs = [logged(time, power, noise=np.random.default_rng(i).normal(0.0, 0.1, len(time)), name=f"pulse{i}")
            for i in range(2)]
    found = fit_together(logs)
    assert found.outcome is FitOutcome.COMBINATIONS_ONLY
    value, ends = found.combinations[RATIO]
    assert ends.low < GAIN / LAG < ends.high
    assert value == pytest.approx(GAIN / LAG, rel=0.15)
    assert any("known only as a ratio" in note for note in found.notes)


@pytest.mark.long
def test_another_way_to_read_the_logs_stays_unless_another_log_speaks_against_it():
    logs = [explain_log(log, ambient_degC=None, power_before_pct=None) for log in (quiet(), noisy(drift=0.0))]
    best = _joint([log.problems[0] for log in logs], [log.fits[0] for log in logs], "power logged")

    def read(log, law, ambient):
        problem = replace(log.problems[0], ambient_degC=ambient)
        fit = problem.refine(log.fits[0].vector[None, :])
        return Rival(problem, fit, fit.model, law, f"told with {ambient:g}")

    first, second = logs
    weights = [WeighedFit({}, None, (read(first, "true ambient", 20.0), read(first, "cold room", 14.0))),
               WeighedFit({}, None, (read(second, "true ambient", 25.0),))]
    # 14 °C would ask for a gain a quarter too high, which the other log rules out
    (found,) = _rivals(best, logs, weights)
    assert found.law == "true ambient (quiet, noisy)"
    assert found.sentence == "quiet: told with 20 noisy: told with 25"
    assert [part.linear[1] for part in found.fit.parts] == [20.0, 25.0]
    assert found.fit.parts[0].model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.02)


def test_logs_with_and_without_power_are_not_mixed(pair):
    with pytest.raises(InputError, match="quiet contains the power and bare does not"):
        fit_together([pair[0], replace(pair[1], name="bare", power_pct=None)])
    with pytest.raises(InputError, match="twice"):
        fit_together([pair[0], pair[0]])


def _reach(found):
    return 0.5 * (found.high - found.low)
