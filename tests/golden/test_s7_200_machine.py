"""The S7-200's machine: compiled it is what it is plainly, and both are what the interpreter before them was.

That interpreter was written separately, one Python closure for each instruction; what it made of these programs and
loops, of any words and readings, is recorded here as digests (but for MOVR, which took a NaN's signal away).
"""

import hashlib
import random
from dataclasses import replace

import numpy as np
import pytest
from tests.golden import s7_200_programs as programs

from heatertune.compiled import compile_function
from heatertune.compiled import dispatch as machine
from heatertune.errors import InputError
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.cpu.s7_200 import assemble
from heatertune.plc.cpu.s7_200.cpu import carry_out
from heatertune.plc.words import FORMATS
from heatertune.proof import Scenario
from heatertune.proof.loop import in_loop, run_loop
from heatertune.proof.scenario import PlcPower

ROOMS = ("s7-200", "s7-200-pid", "s7-200-paper")
DESIGN = PidDesign(gain_pct_per_degC=1.4, integral_time_s=150.0, derivative_time_s=4.0, sample_time_s=2.0, structure="pid",
                   method="")
HEATER = Fopdt(gain_degC_per_pct=0.4, time_constant_s=150.0, dead_time_s=10.0, ambient_degC=20.0)

PROGRAMS = "582a9b52b3d3d866"
TRAJECTORIES = {"s7-200": "e5e2c61e3232f5e3", "s7-200-pid": "0ab7beec3d60e570", "s7-200-paper": "4a4b499414e50c5e"}


def _value(field, rng):
    if field.format == "REAL":
        near = rng.uniform(max(field.low, -64.0), min(field.high, 64.0))
        return float(np.float32(rng.choice([near, rng.uniform(0.001, 3.0), 10.0 ** rng.uniform(-37.0, 37.0)])))
    return rng.choice([rng.randint(int(field.low), int(field.high)), min(max(rng.randint(-3, 250), int(field.low)), int(field.high))])


def _words(which, rng):
    """Words of any value that the controller takes."""
    legal = which.encode(DESIGN, Scaling())
    while True:
        drawn = {field.name: _value(field, rng) for field in which.fields if rng.random() < 0.6}
        values = {**legal.values, **drawn}
        words = replace(legal, values=values, sample_time_s=which.interval_s(values))
        try:
            which.check(words)
        except ValueError:
            continue
        return words


def _trajectory(target, number, scans):
    """What a controller makes of random words and readings, scan by scan."""
    which, rng = controller_for(target), random.Random(f"{target} {number}")
    running = which.start(_words(which, rng), {switch.name: rng.choice(switch.settings) for switch in which.switches})
    full = 32000 if target == "s7-200-pid" else 255
    low, high = (0, full) if target == "s7-200-pid" else map(int, FORMATS[which.inputs["PV"]])  # beyond it is told a broken wire
    setpoint, reading = rng.randint(0, full), rng.randint(0, full)
    for _ in range(scans):
        if rng.random() < 0.05:
            setpoint = rng.randint(0, full) if rng.random() < 0.9 else rng.randint(low, high)
        near = min(max(reading + rng.randint(-full // 30, full // 30), 0), full)
        reading = near if rng.random() < 0.97 else rng.randint(low, high)
        running, scan = which.step(running, setpoint, reading, cycle_start=rng.random() < 0.3)
        yield float(scan.power_pct).hex(), int(scan.output), sorted(scan.flags.items())


def _digest(seen):
    digest = hashlib.sha256()
    for one in seen:
        digest.update(repr(one).encode())
    return digest.hexdigest()[:16]


@pytest.mark.brute
@pytest.mark.long
def test_programs_of_random_instructions_leave_behind_what_they_did_in_the_interpreter_before():
    assert _digest(programs.left_behind(assemble(programs.program(seed)), seed) for seed in range(600)) == PROGRAMS


@pytest.mark.brute
@pytest.mark.long
@pytest.mark.parametrize("target", ROOMS)
def test_any_words_and_readings_give_what_they_did_in_the_interpreter_before(target):
    assert _digest(scan for number in range(20) for scan in _trajectory(target, number, 500)) == TRAJECTORIES[target]


@pytest.mark.long
def test_a_block_is_carried_out_the_same_compiled_and_plainly():
    other = compile_function(carry_out)
    for seed in range(600, 1600):
        program, state = assemble(programs.program(seed)), programs.begin(seed)
        plain, fast = bytearray(state.memory), bytearray(state.memory)
        for block in (0, 65, 0):
            carry_out(program, plain, block, seed % 2 == 0)
            other(program, fast, block, seed % 2 == 0)
            assert plain == fast, seed


@pytest.mark.long
@pytest.mark.parametrize("target", ROOMS)
def test_whole_loops_of_any_words_are_the_same_compiled_and_plainly(target, monkeypatch):
    which, rng = controller_for(target), random.Random(3)
    scenario = Scenario(setpoint_degC=45.0, duration_s=900.0, noise_degC=0.4,
                        disturbances=(PlcPower(time_s=500.0, on=False), PlcPower(time_s=520.0, on=True)))
    for _ in range(40):
        words = replace(_words(which, rng), sample_time_s=2.0)
        loop = in_loop(which, words, scenario.setpoints_degC, {switch.name: rng.choice(switch.settings) for switch in which.switches})
        loop = replace(loop, scan_s=2.0, pwm_period_s=2.0)
        traces = []
        for most_plain in (-1, 10**12):
            monkeypatch.setattr(machine, "_PLAIN_SCANS", most_plain)
            traces.append(run_loop(loop, HEATER, scenario, None))
        for name in ("temperature_degC", "power_asked_pct", "edge_time_s"):
            assert np.array_equal(*(getattr(trace, name) for trace in traces)), name
        assert traces[0].flags == traces[1].flags


def test_a_step_leaves_the_state_before_it_alone():
    for target in ROOMS:
        which = controller_for(target)
        begun = which.start(which.encode(DESIGN, Scaling()), {})
        first = [which.step(begun, 100, 90)[1] for _ in range(3)]
        assert first[0] == first[1] == first[2]


@pytest.mark.parametrize(("block", "line", "named"), [
    ("ORGANIZATION_BLOCK X:OB1", "CALL\tSBR1", "not there"), ("ORGANIZATION_BLOCK X:OB1", "ATCH\tINT0, 10", "not there"),
    ("SUBROUTINE_BLOCK X:SBR0", "CALL\tSBR0", "only OB1 and interrupts"), ("ORGANIZATION_BLOCK X:OB1", "ATCH\tINT0, 34", "no instruction"),
    ("ORGANIZATION_BLOCK X:OB2", "ENI", "no instruction"), ("ORGANIZATION_BLOCK X:OB1", "PID\tVB480, 0", "no instruction"),
    ("ORGANIZATION_BLOCK X:OB1", "PID\tVB100, 8", "no instruction"),
])
def test_a_program_that_cannot_run_is_refused_by_its_line(block, line, named):
    with pytest.raises(InputError, match=rf"^line [13]: .*{named}"):
        assemble(f"{block}\nBEGIN\n\t{line}\n")
