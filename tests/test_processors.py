import threading

import pytest

from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.pid.search.feasible import Problem, search
from heatertune.pid.search.integers import Integers, best_integers
from heatertune.processors import interruptible, on_one, processors, threaded_list, threaded_map
from heatertune.proof.runs import count_scans


def test_a_function_of_each_comes_in_turn_whoever_is_done_first():
    later, order = threading.Event(), []

    def found(number):
        if number == 0:
            assert later.wait(60.0)  # until the second is done
        order.append(number)
        later.set()
        return -number

    assert threaded_list(found, [0, 1], workers=2) == [0, -1]
    assert order == [1, 0]


def test_the_first_is_told_before_the_last_is_done():
    last, told = threading.Event(), []
    for number in threaded_map(lambda number: number == 0 or last.wait(60.0), [0, 1], workers=2):
        told.append(number)
        last.set()
    assert told == [True, True]


def test_where_others_work_too_it_is_one_processor_and_no_thread():
    with on_one():
        assert processors() == 1
        assert threaded_list(lambda _: threading.current_thread(), [1, 2, 3]) == [threading.current_thread()] * 3
    assert processors() >= 1
    assert threaded_list(abs, []) == []


@pytest.mark.parametrize("workers", [1, 2])
def test_what_goes_wrong_in_one_is_heard(workers):
    with pytest.raises(ZeroDivisionError):
        threaded_list(lambda number: 1 // number, [1, 0, 2], workers=workers)



class Ended(Exception):
    """What ends the work of a test."""


def end():
    raise Ended


HEATER = Fopdt(gain_degC_per_pct=0.6, time_constant_s=200.0, dead_time_s=20.0, ambient_degC=20.0)


def search_integers():
    def decode(words):
        return PidDesign(gain_pct_per_degC=0.1 * words[0], integral_time_s=float(words[1]), derivative_time_s=0.0,
                         sample_time_s=10.0, structure="pi", method="words")

    return best_integers(Integers(decode=decode, ranges=((1, 100), (1, 400), (0, 0)), plants=(HEATER,), ms=1.6, start=(10, 200, 0)))


@pytest.mark.parametrize("work", [
    lambda: search(Problem(plants=(HEATER,), structure="pi", ms=1.6, sample_time_s=10.0)), search_integers, lambda: count_scans(1.0),
], ids=["gains and times", "integers", "runs"])
def test_long_work_ends_where_it_is_told_to(work):
    with pytest.raises(Ended), interruptible(end):
        work()
    work()  # nothing is left behind
