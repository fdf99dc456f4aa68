"""Plans are judged by experiments: twins of a heater make the proposed test and are fitted as any log is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter, lsim, lti

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.log.log_values import Log
from heatertune.model.experiment.fisher import (
    ExperimentSetup,
    Prior,
    ReadingNoise,
    Schedule,
    covariance,
    errors,
    peaks,
    prior_by_hand,
    prior_of,
    rows_of,
    sensitivities,
    shares,
)
from heatertune.model.experiment.plan import (
    RelayPlan,
    _tested,
    best_step,
    plan_doublet,
    plan_relay,
    propose,
    within_limit,
)
from heatertune.model.fit import model_by_hand
from heatertune.model.model_values import FitOutcome, FittedModel, Fopdt, TwoLag
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.power.uncertainty import intervals
from heatertune.model.relay_test import TwoLevelRelay
from heatertune.model.statistics import Interval

RANGES = {
    "gain_degC_per_pct": (0.3, 0.6), "time_constant_s": (100.0, 300.0), "dead_time_s": (5.0, 25.0),
    "ambient_degC": (18.0, 24.0),
}
PRIOR = prior_by_hand(RANGES, ambient_known=False)
NOISE = ReadingNoise(std_degC=0.2, correlation=0.7, resolution_degC=0.1, sample_time_s=4.0)
CONDITIONS = ExperimentSetup(limit_degC=60.0, noise=NOISE, longest_s=1200.0)


def _rise(model, schedule, time):
    """The temperature above the ambient, by SciPy's linear simulation on a grid on which the dead time falls."""
    fine = np.arange(0.0, time[-1] + 400.0, 0.1)
    denominator = np.array([1.0])
    for lag in model.lags_s:
        denominator = np.polymul(denominator, [lag, 1.0])
    held = schedule.at(fine - model.dead_time_s + 1e-9)
    rest = np.full(len(model.lags_s), 0.0)
    assert schedule.base_pct == 0.0, "the simulation begins at rest"
    return fine, lsim(lti([model.gain_degC_per_pct], denominator), held, fine, X0=rest, interp=False)[1]


def _coloured(n, rng):
    white = rng.normal(0.0, NOISE.std_degC * np.sqrt(1.0 - NOISE.correlation**2), n)
    first = [rng.normal(0.0, NOISE.std_degC) * NOISE.correlation]
    return lfilter([1.0], [1.0, -NOISE.correlation], white, zi=first)[0]


def _twin(model, schedule, duration, rng):
    """A log of the experiment: coloured noise, readings rounded to the sensor's digits."""
    time = np.arange(0.0, duration + 0.1, NOISE.sample_time_s)
    fine, made = _rise(model, schedule, time)
    reading = model.ambient_degC + np.interp(time, fine, made) + _coloured(len(time), rng)
    return Log(
        name="twin", source="", time_s=time, temperature_degC=np.round(reading / 0.1) * 0.1, power_pct=schedule.at(time),
    )


def _estimates(model, plan, n, seed):
    """What fits of twins find with a free initial state: a plan expects that, though a whole fit would see the rest."""
    rng = np.random.default_rng(seed)
    logs = [_twin(model, plan.schedule, plan.duration_s, rng) for _ in range(n)]
    fitted = [(problem, problem.fit()) for problem in (PowerProblem(readings=Readings.of(log)) for log in logs)]
    models = [found.model for _, found in fitted]
    rows = [(m.gain_degC_per_pct, m.time_constant_s, m.dead_time_s, m.ambient_degC) for m in models]
    return np.array(rows), fitted


@pytest.fixture(scope="module")
def doublet():
    return plan_doublet(PRIOR, CONDITIONS, 600.0)


@pytest.fixture(scope="module")
def relay():
    return plan_relay(PRIOR, CONDITIONS, 1200.0)


@pytest.mark.long
@pytest.mark.parametrize("heater", [0, 9])
def test_the_scatter_of_twins_is_the_expected_one(doublet, heater):
    model = list(PRIOR.models.values())[heater]
    found, fitted = _estimates(model, doublet, 30, seed=heater)
    truth = PRIOR.values[heater]
    # 30 estimates know their scatter to ±13 % (one standard error); the expected one is first-order
    ratio = np.std(found, axis=0, ddof=1) / doublet.errors[heater]
    assert np.all((ratio > 0.7) & (ratio < 1.35)), ratio
    assert np.all(np.abs(found.mean(axis=0) - truth) < 4.0 * doublet.errors[heater] / np.sqrt(30)), "no bias"
    # and the bootstrap of the fit agrees on what is known afterwards
    ci95s = [intervals(*each, seed=1) for each in fitted[:12]]
    for i, name in enumerate(RANGES):
        widths = [0.5 * (ci95[name].high - ci95[name].low) for ci95 in ci95s if ci95[name].low is not None]
        assert 0.5 < np.median(widths) / (1.96 * doublet.errors[heater, i]) < 1.3, name


@pytest.mark.long
def test_the_plan_is_better_than_the_plain_step_on_twins_too(doublet):
    step = best_step(PRIOR, CONDITIONS, 600.0)
    assert step.kind == "step"
    assert doublet.worst < 0.75 * step.worst
    heater = int(np.argmax(step.shares.max(axis=1)))
    model = list(PRIOR.models.values())[heater]
    scatter = [np.std(_estimates(model, plan, 15, seed=1)[0], axis=0) for plan in (doublet, step)]
    worst = [float((each[:3] / PRIOR.values[heater, :3]).max()) for each in scatter]
    assert worst[0] < 0.85 * worst[1]


@pytest.mark.long
def test_a_relay_test_tells_twins_what_was_expected(relay):
    # each twin on the powers that the relay sets on the working model; the fit takes them as logged
    found, _ = _estimates(PRIOR.models["centre"], relay, 20, seed=5)
    ratio = np.std(found, axis=0, ddof=1) / relay.errors[0]
    assert np.all((ratio > 0.65) & (ratio < 1.45)), ratio


@pytest.mark.long
@pytest.mark.parametrize("kind", ["doublet", "step", "relay"])
def test_no_heater_of_the_prior_passes_the_limit(kind, doublet, relay):
    plan = {"doublet": doublet, "relay": relay, "step": best_step(PRIOR, CONDITIONS, 600.0)}[kind]
    assert plan.peaks_degC.max() <= 60.0 + 1e-9
    if kind == "relay":  # each heater has powers of its own there; the schedule is that of the first
        model = PRIOR.models["centre"]
        assert model.ambient_degC + _rise(model, plan.schedule, plan.schedule.time_s)[1].max() <= plan.peaks_degC[0] + 0.02
        return
    for model, peak in zip(PRIOR.models.values(), plan.peaks_degC, strict=True):
        highest = model.ambient_degC + _rise(model, plan.schedule, plan.schedule.time_s)[1].max()
        assert highest == pytest.approx(peak, abs=0.02)
    assert plan.peaks_degC.max() > 55.0, "the limit is used"


@pytest.mark.long
def test_a_doublet_can_be_carried_out_by_hand(doublet):
    schedule = doublet.schedule
    assert np.all(np.mod(schedule.time_s, 4.0) == 0.0), "switched with a reading"
    assert schedule.power_pct * 10.0 == pytest.approx(np.rint(schedule.power_pct * 10.0)), "0.1 % is the finest power"
    assert schedule.time_s[0] >= 20.0, "five readings show the rest"
    assert (schedule.power_pct[-1], schedule.time_s[-1]) == (0.0, 600.0)
    assert np.all(schedule.steps_pct != 0.0)
    assert np.all(np.diff(schedule.time_s) > 0.0)


@pytest.mark.long
def test_the_worst_share_is_the_largest_over_heaters_and_quantities(doublet):
    expected = 1.96 * doublet.errors[:, :3] / np.maximum(
        PRIOR.values[:, :3], np.outer(PRIOR.values[:, 1], [0.0, 0.0, 0.1])
    )
    assert doublet.worst == pytest.approx(expected.max())
    assert doublet.worst < 0.15


@pytest.mark.long
def test_the_power_stays_within_its_bounds():
    narrow = replace(CONDITIONS, least_pct=10.0, most_pct=35.0, base_pct=20.0)
    plan = plan_doublet(PRIOR, narrow, 600.0)
    assert plan.schedule.power_pct.min() >= 10.0
    assert plan.schedule.power_pct.max() <= 35.0
    assert plan.schedule.base_pct == plan.schedule.power_pct[-1] == 20.0
    tested = plan_relay(PRIOR, replace(narrow, most_pct=60.0), 1200.0)
    assert tested.relay.low_pct >= 10.0
    assert tested.relay.high_pct <= 60.0


def test_a_step_waits_for_five_readings_of_the_rest():
    # left to itself the best step of 200 s comes at 8 s, its second reading
    assert best_step(PRIOR, CONDITIONS, 200.0).schedule.time_s.tolist() == [20.0, 200.0]


def test_a_factor_on_the_powers_meets_the_limit_exactly():
    schedule = Schedule(base_pct=5.0, time_s=np.array([0.0, 2000.0]), power_pct=np.array([100.0, 5.0]))
    found = within_limit(PRIOR, replace(CONDITIONS, base_pct=5.0), schedule)
    # the strongest heater in the warmest room rests at 24 + 0.6·u: 60 °C at 60 %, less what is missing after 2000 s
    assert peaks(PRIOR, found).max() == pytest.approx(60.0)
    assert found.power_pct[0] == pytest.approx(60.0, abs=0.1)
    low = within_limit(PRIOR, CONDITIONS, replace(schedule, base_pct=0.0, power_pct=np.array([30.0, 0.0])))
    assert low.power_pct[0] == 30.0, "nothing is enlarged"


def test_a_known_ambient_makes_more_known_and_has_no_error():
    schedule = Schedule(base_pct=0.0, time_s=np.array([40.0, 400.0]), power_pct=np.array([50.0, 0.0]))
    free = errors(PRIOR, schedule, NOISE, 400.0)
    known = errors(replace(PRIOR, ambient_known=True), schedule, NOISE, 400.0)
    assert np.all(known[:, 3] == 0.0)
    assert np.all(free[:, 3] > 0.0)
    assert np.all(known[:, [0, 2]] < free[:, [0, 2]])
    # the fit still has to find gain, dead time, lag and initial state: columns 0, 1, 2 and 4 of the sensitivities
    jacobian = sensitivities(rows_of(list(PRIOR.models.values())), schedule, np.arange(0.0, 401.0, 4.0))
    left = np.sqrt(np.einsum("gqq->gq", covariance(jacobian[:, :, [0, 1, 2, 4]], NOISE)))
    assert known[:, :3] == pytest.approx(left[:, [0, 2, 1]])
    # after one step gain and dead time take up any constant and any decay, so the ambient does not matter to the lag
    assert known[:, 1] == pytest.approx(free[:, 1])


def test_two_lags_are_judged_by_their_sum():
    two = TwoLag(gain_degC_per_pct=0.4, time_constant_s=150.0, second_time_constant_s=150.0, dead_time_s=10.0, ambient_degC=20.0)
    one = Fopdt(gain_degC_per_pct=0.4, time_constant_s=300.0, dead_time_s=10.0, ambient_degC=20.0)
    prior = Prior(models={"two": two, "one": one}, ambient_known=False)
    assert prior.values[:, 1].tolist() == [300.0, 300.0]
    schedule = Schedule(base_pct=0.0, time_s=np.array([40.0, 1000.0, 2000.0]), power_pct=np.array([50.0, 0.0, 0.0]))
    found = errors(prior, schedule, NOISE, 2000.0)
    assert np.all(np.isfinite(found)), "equal lags have a sum, though no one can tell them apart"
    assert 0.3 < found[0, 1] / found[1, 1] < 3.0
    assert found[0, 2] > 2.0 * found[1, 2], "a second lag hides the dead time"
    assert np.array_equal(shares(prior, found)[:, 0], 1.96 * found[:, 0] / 0.4)


def test_the_prior_of_a_fit_holds_candidates_and_ends_of_intervals():
    model = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=10.0)
    fitted = FittedModel(
        model=model, outcome=FitOutcome.IDENTIFIED, method="", candidates=model_by_hand(replace(model, dead_time_s=20.0)).candidates,
        ci95={"gain_degC_per_pct": Interval(low=0.4, high=None), "time_constant_s": None, "dead_time_s": Interval(low=0.0, high=30.0)},
    )
    prior = prior_of(fitted, ambient_degC=None, assumed_degC=21.0)
    rows = [[0.5, 150, 10, 21], [0.5, 150, 20, 21], [0.4, 150, 10, 21], [0.5, 150, 0, 21], [0.5, 150, 30, 21]]
    assert prior.values.tolist() == rows
    assert not prior.ambient_known
    told = prior_of(fitted, ambient_degC=25.0, assumed_degC=21.0)
    assert told.ambient_known
    assert set(told.values[:, 3]) == {25.0}


def test_a_prior_by_hand_has_every_corner():
    values = PRIOR.values
    assert len(values) == 10  # centre, weakest, 2³ corners
    for i, (low, high) in enumerate(RANGES.values()):
        assert (values[:, i].min(), values[:, i].max()) == (low, high)
    assert len(np.unique(values[2:], axis=0)) == 8
    point = prior_by_hand({name: (low, low) for name, (low, _) in RANGES.items()}, ambient_known=True)
    assert len(point.models) == 3
    with pytest.raises(InputError, match="dead_time_s"):
        prior_by_hand({name: RANGES[name] for name in RANGES if name != "dead_time_s"}, ambient_known=False)
    with pytest.raises(OutOfRange, match="gain"):
        prior_by_hand(RANGES | {"gain_degC_per_pct": (0.6, 0.3)}, ambient_known=False)


@pytest.mark.long
def test_durations_grow_until_the_aim_is_reached():
    prior = Prior(models={"centre": PRIOR.models["centre"]}, ambient_known=False)
    reached = propose(prior, replace(CONDITIONS, aim=0.5), kind="doublet")
    assert [plan.duration_s for plan in reached] == [300.0]
    missed = propose(prior, replace(CONDITIONS, aim=1e-4), kind="relay")
    assert [plan.duration_s for plan in missed] == [600.0, 900.0, 1200.0], "300 s are too short for two periods"
    assert missed[-1].worst < missed[0].worst


@pytest.mark.long
@pytest.mark.parametrize("longest", [1200.0, 3600.0])
def test_the_better_kind_is_proposed(longest):
    prior = Prior(models={"centre": PRIOR.models["centre"]}, ambient_known=False)
    (found,) = propose(prior, replace(CONDITIONS, longest_s=longest, aim=1.0))
    rivals = [plan_doublet(prior, CONDITIONS, 0.25 * longest), plan_relay(prior, CONDITIONS, 0.25 * longest)]
    assert found.worst == pytest.approx(min(rival.worst for rival in rivals if rival is not None))


@pytest.mark.long
def test_a_relay_plan_has_what_it_needs(relay):
    assert isinstance(relay, RelayPlan)
    assert relay.relay.hysteresis_degC == pytest.approx(0.6), "three standard deviations of the noise"
    assert relay.rest_s == 60.0
    assert relay.schedule.time_s[0] == 60.0
    assert np.all(np.mod(relay.schedule.time_s, 4.0) == 0.0), "a relay sees readings"
    assert relay.periods_s.shape == (10,)
    for model in PRIOR.models.values():  # it swings on every one
        for power, side in ((relay.relay.high_pct, 1.0), (relay.relay.low_pct, -1.0)):
            rest = model.ambient_degC + model.gain_degC_per_pct * power
            assert side * (rest - relay.relay.setpoint_degC) > relay.relay.hysteresis_degC


@pytest.mark.parametrize(("limit", "kept"), [(32.0, False), (32.5, True)])
def test_a_relay_that_swings_beyond_the_limit_is_left_out(limit, kept):
    # the closed form of the peak: 29 + 37·(1 − e^(−15/200)) + 0.6·e^(−15/200) = 32.23 °C
    prior = Prior(models={"centre": PRIOR.models["centre"]}, ambient_known=False)
    relay = TwoLevelRelay(setpoint_degC=29.0, hysteresis_degC=0.6, high_pct=100.0)
    assert (_tested(prior, replace(CONDITIONS, limit_degC=limit), relay, 1200.0) is not None) == kept


@pytest.mark.long
def test_coarse_digits_widen_the_hysteresis():
    coarse = replace(CONDITIONS, noise=replace(NOISE, resolution_degC=1.5))
    assert plan_relay(PRIOR, coarse, 1200.0).relay.hysteresis_degC == 1.5


@pytest.mark.long
def test_what_cannot_be_planned_is_refused():
    with pytest.raises(OutOfRange, match="limit_degC"):
        propose(PRIOR, replace(CONDITIONS, limit_degC=23.0))
    with pytest.raises(OutOfRange, match="limit_degC"):
        propose(PRIOR, replace(CONDITIONS, limit_degC=24.01))
    with pytest.raises(InputError, match="swings"):
        propose(PRIOR, replace(CONDITIONS, limit_degC=26.0), kind="relay")
    with pytest.raises(UnknownName, match="doublet"):
        propose(PRIOR, CONDITIONS, kind="ramp")
    assert plan_relay(PRIOR, CONDITIONS, 200.0) is None, "too short for two periods"


@pytest.mark.parametrize(("settings", "told"), [
    ({"longest_s": 100.0}, "longest_s"), ({"most_pct": 0.0}, "most_pct"), ({"base_pct": 101.0}, "base_pct"),
    ({"least_pct": 10.0}, "base_pct"), ({"aim": 0.0}, "aim"), ({"limit_degC": float("nan")}, "limit_degC"),
])
def test_conditions_that_cannot_be_are_refused(settings, told):
    with pytest.raises(OutOfRange, match=told):
        replace(CONDITIONS, **settings)
