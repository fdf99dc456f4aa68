"""Noisy coolers, mirrored from exact heaters: no ambient of −100 °C and no endless dead time makes heaters of them."""

import numpy as np
import pytest
from tests.bench.identification import answer

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt
from heatertune.model.power.explanation import explain_log

NOISE = {150.0: 2.0, 600.0: 1.0, 3000.0: 0.3}  # time constant → deviation [°C]: the effect is seen, and little more
TIME = np.arange(0.0, 1200.0, 4.0)


def _log(levels, lag, seed, *, cools):
    power = np.select([TIME < 300, TIME < 600, TIME < 900], levels, 30.0)
    plant = Fopdt(gain_degC_per_pct=0.3, time_constant_s=lag, dead_time_s=10.0, ambient_degC=25.0)
    rise = answer(plant, TIME, power, 25.0) - 25.0
    shaken = np.random.default_rng(seed).normal(0.0, NOISE[lag], len(TIME))
    temperature = 25.0 + (-rise if cools else rise) + shaken
    return Log(name="made", source="", time_s=TIME, temperature_degC=temperature, power_pct=power)


def _explained(log):
    return explain_log(log, ambient_degC=None, power_before_pct=None)


CASES = [([60, 60, 80], 3000.0), ([60, 60, 80], 150.0), ([20, 20, 60], 150.0), ([20, 40, 20], 150.0),
         ([40, 40, 80], 600.0), ([60, 40, 60], 600.0), ([80, 60, 80], 3000.0)]


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("levels", "lag"), CASES)
def test_a_noisy_cooler_is_refused_by_its_sign(levels, lag, seed):
    with pytest.raises(InputError, match="a cooler"):
        _explained(_log(levels, lag, seed, cools=True))


@pytest.mark.parametrize(("levels", "lag"), CASES)
def test_a_heater_under_the_same_noise_is_none(levels, lag):
    assert _explained(_log(levels, lag, 1, cools=False)).model.gain_degC_per_pct > 0.0
