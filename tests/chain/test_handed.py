"""What is handed to Python's functions and is none of what they take: told in one line, no traceback from below."""

import pytest

import heatertune as ht

MODEL = ht.model_by_hand(ht.Fopdt(gain_degC_per_pct=0.5, time_constant_s=200.0, dead_time_s=10.0, ambient_degC=20.0))
WORDS = ht.encode(ht.PidDesign(gain_pct_per_degC=5.0, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=5.0,
                               structure="pi", method=""), "weg")


@pytest.mark.parametrize("source", [None, 3, b"table4", ["table4"]])
def test_a_source_that_is_no_log_is_told(source):
    with pytest.raises(ht.InputError, match=f"not a log: {type(source).__name__}; expected a path"):
        ht.read_log(source)


@pytest.mark.parametrize("logs", [[], (), None, "table4"])
def test_logs_that_are_none_are_told(logs):
    with pytest.raises(ht.InputError, match="no logs: expected a list of one log or more"):
        ht.fit_together(logs)


def test_a_number_that_is_not_whole_is_told():
    with pytest.raises(ht.InputError, match=r"points = 2\.5 is out of range: must be a whole number"):
        ht.front(MODEL, points=2.5)
    with pytest.raises(ht.InputError, match=r"seed = 1\.5 is out of range: must be a whole number"):
        ht.replay_document(WORDS, MODEL, 1.5)
