import threading

import pytest

from heatertune.processors import on_one, processors, threaded_list, threaded_map


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
