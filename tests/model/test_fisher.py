import numpy as np
import pytest

from heatertune.errors import OutOfRange
from heatertune.model.experiment.fisher import ReadingNoise, covariance

NOISE = ReadingNoise(std_degC=0.3, correlation=0.8, resolution_degC=0.5, sample_time_s=2.0)


def _dense(noise, n):
    """The covariance of n readings, written out: rounding is uniform over one step, so its variance is step²/12."""
    index = np.arange(n)
    lags = np.abs(index[:, None] - index)
    return noise.std_degC**2 * noise.correlation**lags + noise.resolution_degC**2 / 12.0 * np.eye(n)


def test_the_covariance_is_that_of_least_squares_under_coloured_noise():
    jacobian = np.random.default_rng(0).normal(size=(3, 60, 4)) * np.array([1.0, 1e-3, 10.0, 1e3])
    for found, each in zip(covariance(jacobian, NOISE), jacobian, strict=True):
        estimator = np.linalg.solve(each.T @ each, each.T)  # θ = (JᵀJ)⁻¹Jᵀ·y
        assert found == pytest.approx(estimator @ _dense(NOISE, 60) @ estimator.T, rel=1e-8)


def test_with_white_noise_it_is_the_inverse_of_the_fisher_information():
    jacobian = np.random.default_rng(1).normal(size=(1, 40, 3))
    white = ReadingNoise(std_degC=0.3, sample_time_s=1.0)
    information = jacobian[0].T @ jacobian[0] / 0.3**2
    assert covariance(jacobian, white)[0] == pytest.approx(np.linalg.inv(information), rel=1e-9)


def test_no_estimator_beats_the_fisher_information_and_least_squares_does_not_either():
    # Gauss and Markov: the whitened estimate (JᵀR⁻¹J)⁻¹ is the smallest covariance there is
    jacobian = np.random.default_rng(2).normal(size=(1, 80, 3)).cumsum(axis=1)
    least = np.linalg.inv(jacobian[0].T @ np.linalg.solve(_dense(NOISE, 80), jacobian[0]))
    excess = np.linalg.eigvalsh(covariance(jacobian, NOISE)[0] - least)
    assert excess.min() > -1e-9
    assert excess.max() > 1e-6


def test_correlated_noise_tells_less_of_what_changes_slowly():
    slow = np.ones((1, 100, 1))
    plain = covariance(slow, ReadingNoise(std_degC=0.3, sample_time_s=1.0))[0, 0, 0]
    coloured = covariance(slow, ReadingNoise(std_degC=0.3, correlation=0.8, sample_time_s=1.0))[0, 0, 0]
    assert plain == pytest.approx(0.09 / 100)
    assert coloured / plain == pytest.approx((1 + 0.8) / (1 - 0.8), rel=0.1)  # long-run variance of an AR(1)


def test_what_is_not_identified_has_no_end():
    column = np.random.default_rng(3).normal(size=(1, 50, 1))
    assert np.all(np.isinf(covariance(np.concatenate([column, 2.0 * column], axis=2), NOISE)))
    assert np.all(np.isinf(covariance(np.concatenate([column, 0.0 * column], axis=2), NOISE)))
    assert np.all(np.isinf(covariance(np.ones((1, 2, 3)), NOISE)))


@pytest.mark.parametrize("times", [1, 3, 10])
def test_thinned_readings_have_the_noise_of_means(times):
    thin = NOISE.average(times)
    mean = np.kron(np.eye(2), np.full((1, times), 1.0 / times))  # two neighbouring means
    expected = mean @ _dense(NOISE, 2 * times) @ mean.T
    variance = thin.std_degC**2 + thin.resolution_degC**2 / 12.0
    assert variance == pytest.approx(expected[0, 0])
    assert thin.std_degC**2 * thin.correlation == pytest.approx(expected[0, 1])
    assert thin.sample_time_s == 2.0 * times


def test_an_instant_is_rounded_to_the_nearest_reading():
    assert [NOISE.nearest_reading(t) for t in (0.0, 2.9, 3.1, 7.0001)] == [0.0, 2.0, 4.0, 8.0]


@pytest.mark.parametrize(("settings", "told"), [
    ({"std_degC": 0.0}, "no sensor is perfect"), ({"std_degC": -1.0}, "std_degC"),
    ({"std_degC": 1.0, "correlation": 1.0}, "correlation"), ({"std_degC": 1.0, "sample_time_s": 0.0}, "sample_time_s"),
    ({"std_degC": 1.0, "resolution_degC": -0.1}, "resolution_degC"),
])
def test_noise_that_cannot_be_is_refused(settings, told):
    with pytest.raises(OutOfRange, match=told):
        ReadingNoise(**({"sample_time_s": 1.0} | settings))
