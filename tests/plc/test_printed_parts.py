"""The parts of programs that are described once do in each language what one reference says, for random calls."""

import math
import random

import numpy as np
import pytest
from tests.plc.printed_machines import MACHINES, OnStructuredText

from heatertune.plc.print.statements import CELLS, Group, if_, pulse_staircase, setpoint_ramp
from heatertune.plc.pwm import Actuator, on_time, pulse_ends
from heatertune.plc.ramp import Ramp, next_setpoint
from heatertune.plc.single_precision import single
from heatertune.plc.st.program_text import literal

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


#: cells of the PWM, and whether the heater is on
PWM_CELLS = ("Power", "Held", "Stair", "Rest", "On")


@pytest.mark.parametrize("language", ["s5", "s7-200", "s7-300", "st"])
@pytest.mark.long
def test_the_staircase_makes_the_pulses_of_the_proof(language):
    rng, ticks_run = random.Random(43), 0
    while ticks_run < CALLS:
        ticks = rng.choice((1, 2, 3, 7, 10, 50, 85, 333))
        full = 2047 if language == "s5" else rng.choice((2047, 27648, 100))
        least_on, least_off = rng.choice([(0.0, 0.0), (1.0, 0.0), (2.0, 2.0), (0.0, 3.0)])
        if least_on + least_off >= ticks:
            least_on = least_off = 0.0
        switch = Actuator(pwm_period_s=float(ticks), resolution_s=1.0, minimum_on_s=least_on, minimum_off_s=least_off)
        least, most = pulse_ends(switch, lambda power, full=full: 100.0 * power / full, full)
        switched = Group("on in the first ticks", "On := 0;\n" + if_("Held >= Stair", "On := 1"))
        machine = MACHINES[language]([*pulse_staircase(ticks, full, least, most), switched], PWM_CELLS)
        machine["Stair"] = full + 1
        ties = [full * (2 * j + 1) // (2 * ticks) for j in range(ticks) if full * (2 * j + 1) % (2 * ticks) == 0]
        for power in [0, full, least - 1, least, most, min(most + 1, full), *ties[:3], *(rng.randint(0, full) for _ in range(9))]:
            wanted = round(on_time(100.0 * power / full, 0.0, switch.numbers)[0])
            on = []
            for tick in range(ticks):
                machine["Power"] = power if tick == 0 else rng.randint(0, full)  # taken over where a period begins
                machine.call()
                on.append(machine["On"])
            assert on == [1] * wanted + [0] * (ticks - wanted), (ticks, full, power, least, most)
            ticks_run += ticks
