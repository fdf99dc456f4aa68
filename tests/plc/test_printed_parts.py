"""The parts of programs that are described once do in each language what one reference says, for random calls."""

import math
import random

import numpy as np
import pytest
from tests.plc.printed_machines import MACHINES, OnStructuredText

from heatertune.plc.print.parts import CELLS, setpoint_ramp
from heatertune.plc.ramp import Ramp, next_setpoint
from heatertune.plc.single_precision import single
from heatertune.plc.st.program import literal

#: of each part in each language
CALLS = 20_000
PER_RUN = 100
RAMP_CELLS = ("Asked", "Reading", "Lead", *CELLS)
#: largest reading and setpoint of a language; half of it the smallest one below zero, as an EM231 gives in 0.1 °C
FULL = {"s5": 2047, "s7-200": 32000, "s7-200 in words": 255, "s7-300": 27648, "st": 27648}


def _drawn_ramp(rng, full):
    hold = rng.choice([None, rng.randint(1, full), -rng.randint(1, full)])
    return Ramp(step=rng.choice([rng.randint(1, 60), rng.randint(1, full - 1)]), calls=rng.choice((1, 1, 2, 7)), hold=hold)


@pytest.mark.parametrize("language", MACHINES)
@pytest.mark.long
def test_the_setpoint_ramp_moves_as_the_proof_has_it(language):
    rng, full = random.Random(41), FULL[language]
    for _ in range(CALLS // PER_RUN):
        ramp = _drawn_ramp(rng, full)
        machine = MACHINES[language](setpoint_ramp(ramp), RAMP_CELLS)
        asked, reading = rng.randint(0, full), rng.randint(-full // 2, full)
        machine["Lead"], machine["Calls"], lead = reading, ramp.calls, reading
        for call in range(1, PER_RUN + 1):
            if rng.random() < 0.1:
                asked = rng.choice([0, full, rng.randint(0, full)])
            reading = rng.choice([-full // 2, full, rng.randint(-full // 2, full)]) if rng.random() < 0.1 else (
                min(max(reading + rng.randint(-40, 40), -full // 2), full))
            machine["Asked"], machine["Reading"] = asked, reading
            machine.call()
            lead = next_setpoint(lead, asked, ramp, reading, due=call % ramp.calls == 0)
            assert machine["Lead"] == lead, (ramp, call, asked, reading)


@pytest.mark.long
def test_the_setpoint_ramp_moves_reals_bit_for_bit():
    rng = random.Random(42)
    odd = [math.nan, math.inf, -math.inf, 0.0, -0.0]
    for _ in range(CALLS // PER_RUN):
        step = single(10.0 ** rng.uniform(-3.0, 2.0))
        hold = rng.choice([None, single(rng.uniform(0.01, 50.0)), -single(rng.uniform(0.01, 50.0))])
        ramp = Ramp(step=step, calls=rng.choice((1, 1, 3)), hold=hold)
        machine = OnStructuredText(setpoint_ramp(ramp, literal), RAMP_CELLS, reals={*RAMP_CELLS} - {"Calls"})
        asked, reading = single(rng.uniform(-50.0, 400.0)), single(rng.uniform(-50.0, 400.0))
        machine["Lead"], machine["Calls"], lead = reading, ramp.calls, reading
        for call in range(1, PER_RUN + 1):
            if rng.random() < 0.05:
                asked = single(rng.uniform(-50.0, 400.0))
            reading = rng.choice(odd) if rng.random() < 0.05 else single(rng.uniform(-50.0, 400.0))
            machine["Asked"], machine["Reading"] = asked, reading
            machine.call()
            lead = next_setpoint(lead, asked, ramp, reading, due=call % ramp.calls == 0)
            assert np.float32(machine["Lead"]).tobytes() == np.float32(lead).tobytes(), (ramp, call, asked, reading)
