import pytest

from tests.bench import exhaustive


@pytest.mark.parametrize("two_lags", [False, pytest.param(True, marks=pytest.mark.long)], ids=["one lag", "two lags"])
def test_a_fit_ends_where_a_search_of_everything_ends(two_lags):
    # descents end where a step promises no more than 1e-6 of the sum of squares (1e-9 for the log itself)
    fitted, *drawn = exhaustive.above(exhaustive.make(1, two_lags=two_lags))
    assert fitted < 1e-6
    assert max(drawn) < 1e-5
