"""What the tests of the report share: one heater, one design, its documents and its page."""

import numpy as np
import pytest

from heatertune import chain
from heatertune.chain.pipeline import dossier
from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.report import render

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
DESIGN = PidDesign(gain_pct_per_degC=9.5, integral_time_s=66.0, derivative_time_s=0.0, sample_time_s=4.0,
                   structure="pi", method="by hand")


@pytest.fixture(scope="session")
def documents():
    fitted = model_by_hand(HEATER)
    proof = chain.prove(chain.encode(DESIGN, "s5-ob251"), fitted, setpoint_degC=40.0)
    time = np.arange(0.0, 600.0, 10.0)
    log = Log(name="own </script> log", source="a file & its line", time_s=time,
              temperature_degC=22.0 + 30.0 * (1 - np.exp(-time / 167.0)), power_pct=np.full_like(time, 80.0))
    return dossier(log, fitted, DESIGN, proof, {"DB30.bin": b""})


@pytest.fixture(scope="session")
def page(documents):
    return render(documents)
