"""The best whole numbers, against brute force that knows nothing of boxes and bounds."""

import itertools
import math
from dataclasses import replace

import control
import numpy as np
import pytest

from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import control_margins, iae_load, loop_transfer_function, margins
from heatertune.pid.search.integers import Integers, best_integers, bounds_of, norms
from heatertune.plc import Scaling, controller_for

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0)
OTHER = TwoLag(gain_degC_per_pct=0.83, time_constant_s=378.0, second_time_constant_s=108.0, dead_time_s=9.2)
NAMES = {"s5-ob251": ("K", "TI", "TD"), "s7-200": ("KP", "KI", "KD")}


def _pid(gain, tn, tv=0.0, ta=4.0, past=0.5):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure="pid" if tv else "pi", method="", derivative_filter=past)


def _problem(target, design, plants, ranges, ms=1.6):
    """Return the search over a room's whole numbers; ranges of those that are not 0."""
    found, names = controller_for(target), NAMES[target]
    words = found.encode(design, Scaling())

    def decode(values):
        try:
            return found.decode(replace(words, values=dict(words.values) | dict(zip(names, values, strict=True))))
        except OutOfRange:
            return None

    start = tuple(words.values[name] for name in names)
    return Integers(decode=decode, plants=plants, ms=ms, start=start,
                    ranges=tuple(r if value else (0, 0) for r, value in zip(ranges, start, strict=True)))


def _brute(problem, box):
    """Return the least cost in a box of words, each judged alone by the margins and the simulated load response."""
    costs = {}
    for words in itertools.product(*(range(low, high + 1) for low, high in box)):
        design = problem.decode(words)
        if design is not None and max(margins(p, design).ms for p in problem.plants) <= problem.ms:
            costs[words] = np.mean([iae_load(p, design) for p in problem.plants])
    return min(costs.values(), default=math.inf)


S5 = ((1, 32767), (1, 9999), (1, 999))


@pytest.mark.long
@pytest.mark.parametrize(("ta", "plants"), [(1.0, (HEATER, OTHER)), (4.0, (HEATER, OTHER)), (0.5, (HEATER,))])
def test_no_words_in_the_neighbourhood_are_better(ta, plants):
    problem = _problem("s5-ob251", _pid(3.4, 290.0 if len(plants) > 1 else 60.0, ta=ta), plants, S5)
    found = best_integers(problem)
    assert found.proven
    assert found.cost == problem.cost(found.words)
    k, ti, _ = found.words
    # a coarse net over all gains, and every word near the best
    near = _brute(problem, ((k - 10, k + 10), (max(1, ti - 3), ti + 3), (0, 0)))
    far = min(_brute(problem, ((g, g), (t, t), (0, 0))) for g in range(200, 2 * k, k // 25) for t in range(1, 3 * ti + 3, 1 + ti // 20))
    assert found.cost <= near * (1.0 + 1e-5)
    assert found.cost <= far * (1.0 + 1e-5)
    assert near < 1.01 * found.cost, "the neighbourhood holds words that come close"


@pytest.mark.long
def test_every_word_is_tried_where_there_are_few():
    # all 30·30·4 words of a PID with a coarse K: what is found is the least of all of them
    problem = _problem("s5-ob251", _pid(0.02, 500.0, 20.0, ta=10.0), (OTHER,), ((1, 30), (1, 30), (1, 4)), ms=1.3)
    found = best_integers(problem)
    everything = _brute(problem, ((1, 30), (1, 30), (1, 4)))
    assert math.isfinite(everything)
    assert found.cost == pytest.approx(everything, rel=1e-5)
    assert found.proven


def test_words_of_other_rooms_and_their_other_form():
    # KP is the sum of the P and half the I part: the gains are no plain products of the words
    problem = _problem("s7-200", _pid(13.0, 62.0, past=0.0), (HEATER,), ((1, 32767),) * 3)
    found = best_integers(problem)
    k, i, _ = found.words
    assert found.proven
    assert found.cost <= _brute(problem, ((k - 30, k + 30), (i - 5, i + 5), (0, 0))) * (1.0 + 1e-5)


@pytest.mark.parametrize(("target", "past"), [("s5-ob251", 0.5), ("s7-200", 0.0)])
def test_the_gains_at_the_corners_are_those_of_the_decoded_words(target, past):
    problem = _problem(target, _pid(0.9, 250.0, 40.0, ta=10.0, past=past), (OTHER,), ((1, 32767),) * 3 if past == 0.0 else ((1, 1500), (1, 9999), (1, 999)))
    box = tuple((max(1, s // 3), s + s // 4 + 1) for s in problem.start)
    found = problem.corners(box)
    assert found.shape == (8, 3)
    for words, gains in zip(itertools.product(*box), found, strict=True):
        design = problem.decode(words)
        gain, ta = design.gain_pct_per_degC, design.sample_time_s
        expected = [gain, gain * ta / design.integral_time_s, gain * design.derivative_time_s / ta]
        assert gains == pytest.approx(expected, rel=1e-9)


def test_words_of_a_loop_sampled_slower_than_its_reset():
    # KP halved with KI doubled would leave no P part, so the two are tried the other way round
    problem = _problem("s7-200", _pid(0.5, 12.0, ta=10.0, past=0.0), (HEATER,), ((1, 32767),) * 3)
    kp, ki, _ = problem.start
    assert kp // 2 - 2 * ki < 0
    assert best_integers(problem).proven


def test_words_that_are_not_allowed_to_begin_with_are_refused():
    problem = _problem("s7-200", _pid(13.0, 62.0, past=0.0), (HEATER,), ((1, 32767),) * 3)
    with pytest.raises(InputError, match="does not allow the initial words"):
        best_integers(replace(problem, start=(5, 5, 0)))


def test_a_limit_nothing_keeps_gives_no_words():
    problem = _problem("s5-ob251", _pid(3.4, 290.0), (HEATER, OTHER), ((2000, 32767), (10, 9999), (0, 0)), ms=1.1)
    found = best_integers(problem)
    assert found.words is None
    assert math.isinf(found.cost)


def test_a_search_cut_short_says_what_it_leaves_open():
    problem = _problem("s7-200", _pid(13.0, 62.0, past=0.0), (HEATER,), ((1, 32767),) * 3)
    short, whole = best_integers(problem, most_boxes=60), best_integers(problem)
    assert not short.proven
    assert whole.proven
    assert short.least <= whole.cost <= short.cost


def _box(rng, ta, structure):
    gain, tn = rng.uniform(1.0, 12.0), rng.uniform(60.0, 600.0)
    tv = rng.uniform(5.0, 40.0) if structure == "pid" else 0.0
    at = np.array([gain, gain * ta / tn, gain * tv / ta])
    low, high = at * rng.uniform(0.5, 1.0, 3), at * rng.uniform(1.0, 2.0, 3)
    return low, high


@pytest.mark.long
@pytest.mark.parametrize("structure", ["pi", "pid"])
def test_no_controller_inside_a_box_costs_less_than_its_bound(structure):
    # 60 random boxes, 20 random controllers in each, judged alone by the margins and the simulated response
    rng, ta = np.random.default_rng(5), 10.0
    plants = (HEATER, OTHER)
    bounds = bounds_of(plants, ms=1.8, sample_time_s=ta, derivative_filter=0.5)
    closest, none_inside = math.inf, 0
    for _ in range(60):
        low, high = _box(rng, ta, structure)
        bound = bounds.least_cost(np.array(list(itertools.product(*zip(low, high, strict=True)))), math.inf)
        none_inside += math.isinf(bound)
        for gains in rng.uniform(low, high, (20, 3)):
            design = _pid(gains[0], ta * gains[0] / gains[1], ta * gains[2] / gains[0], ta=ta)
            if max(margins(plant, design).ms for plant in plants) > 1.8:
                continue
            cost = np.mean([iae_load(plant, design) for plant in plants])
            assert bound <= cost * (1.0 + 1e-6)
            closest = min(closest, cost / bound)
    assert closest < 1.6, "the bounds say something"
    assert none_inside > 5


@pytest.mark.long
def test_a_box_of_unstable_controllers_is_ruled_out_though_all_keep_their_distance():
    # python-control's poles say that every corner is unstable; none comes near −1
    ta = 10.0
    low, high = np.array([195.0, 195.0 * ta / 300.0, 0.0]), np.array([200.0, 200.0 * ta / 300.0, 0.0])
    for gain in (low[0], high[0]):
        design = _pid(float(gain), 300.0, ta=ta)
        assert math.isinf(control_margins(HEATER, design).ms)
        omega = np.geomspace(1e-5, math.pi / ta, 3000)
        assert np.min(np.abs(1.0 + loop_transfer_function(HEATER, design)(np.exp(1j * omega * ta)))) > 1.0 / 1.6
    bounds = bounds_of((HEATER,), ms=1.6, sample_time_s=ta, derivative_filter=0.5)
    assert bounds.least_cost(np.array([low, high]), math.inf) == math.inf


def test_a_box_whose_middle_is_unstable_is_kept_for_the_good_controller_at_its_corner():
    good = _pid(3.0, 300.0, ta=10.0)
    assert margins(HEATER, good).ms < 1.6
    assert control_margins(HEATER, _pid(201.5, 300.0, ta=10.0)).ms == math.inf
    corners = np.array([[k, k * 10.0 / 300.0, 0.0] for k in (3.0, 400.0)])
    bounds = bounds_of((HEATER,), ms=1.6, sample_time_s=10.0, derivative_filter=0.5)
    assert bounds.least_cost(corners, math.inf) <= iae_load(HEATER, good)


@pytest.mark.parametrize("past", [0.0, 0.5])
def test_the_sizes_of_the_parts_are_those_of_python_controls_impulse_responses(past):
    # G by python-control, the loop closed by its feedback; the D part counts as the others do
    ta, gains = 5.0, np.array([3.0, 0.05, 12.0])
    plant = loop_transfer_function(HEATER, PidDesign(gain_pct_per_degC=1.0, integral_time_s=math.inf, derivative_time_s=0.0,
                                                     sample_time_s=ta, structure="p", method=""))
    z = control.tf([1.0, 0.0], [1.0], ta)
    parts = [control.tf([1.0], [1.0], ta), z / (z - 1.0), (1.0 - past) * (z - 1.0) / (z - past)]
    law = sum(gain * part for gain, part in zip(gains, parts, strict=True))
    # the impulse is 1 at the first sample: TA times a discrete impulse of python-control's area 1
    times = np.arange(800) * ta
    expected = [float(np.sum(np.abs(np.asarray(control.impulse_response(control.feedback(plant * part, law / part), times).outputs)))) * ta
                for part in parts]
    heater = bounds_of((HEATER,), ms=1.6, sample_time_s=ta, derivative_filter=past).heaters[0]
    assert norms(*heater.modes, gains, past, 800)[:3] == pytest.approx(expected, rel=1e-3)


def test_of_a_single_controller_the_bound_is_its_cost():
    design = _pid(3.0, 300.0, 20.0, ta=5.0)
    bounds = bounds_of((HEATER, OTHER), ms=3.0, sample_time_s=5.0, derivative_filter=0.5)
    found = bounds.least_cost(np.array([[3.0, 0.05, 12.0]]), math.inf)
    assert found == pytest.approx(np.mean([iae_load(HEATER, design), iae_load(OTHER, design)]), rel=1e-3)
