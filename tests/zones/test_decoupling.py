"""Decoupled zones: what each program adds for its neighbours' temperatures, in the proof, the CPUs and a second simulation."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from heatertune.cli import main
from heatertune.codec import DATA, to_json
from heatertune.errors import InputError
from heatertune.live.client.connection import address_of
from heatertune.live.joint.virtual_zones import virtual_zones
from heatertune.live.joint.zones_watch import ProvenZones
from heatertune.live.joint.zones_write import ZonesWriteRequest, plan_zones
from heatertune.live.serve import Simulation
from heatertune.plc import controller_for
from heatertune.plc.cpu.iec.machine import TextProgram
from heatertune.plc.cpu.iec.st_syntax import units
from heatertune.plc.cpu.s7_300.machine import S7300Cpu
from heatertune.plc.cpu.s7_300.source import as_real, bits_of, signed_number
from heatertune.plc.fb41.step import ContCAssumptions, ContCState, scan
from heatertune.plc.fb41.words import FIELDS, parameters_of
from heatertune.plc.ramp import Ramp
from heatertune.plc.single_precision import single
from heatertune.settings import Conditions
from heatertune.zones import design_zones, network_by_hand, prove_zones
from heatertune.zones.decoupling import decoupling_for
from heatertune.zones.joint_loop import ZoneEvent, ZoneLoop, run_zones
from heatertune.zones.joint_proof import specification_for
from heatertune.zones.joint_tuning import JointTuner, closed_loop_radius
from heatertune.zones.zone_export import export_zones
from heatertune.zones.zone_record import zone_record
from heatertune.zones.zones_folder import prove_again, read_zones_design, to_document
from tests.zones.networks import chain, radius

SETPOINTS = (27.0, 30.0, 55.0)  # from 22 °C: the last zone is saturated, the others are not


def proof_of(target, exchange=2.0, *, ramp=None, **changed):
    """Return the proof, up to its first failure, of three decoupled zones; what it proves does not matter to a program."""
    fitted = network_by_hand(chain(3, exchange))
    design = JointTuner(fitted, target).design_for((1.4,) * 3, decoupling_for(fitted, SETPOINTS, 0.8))
    spec = replace(specification_for(fitted, SETPOINTS, Conditions()), deviation_degC=1e-6)
    return prove_zones(design.with_ramp(ramp), fitted, replace(spec, **changed), up_to_failure=True)


def joint_run(proof, duration_s, *events):
    loop = ZoneLoop(words=proof.words, actuator=proof.actuator, offsets_s=proof.offsets_s, decoupling=proof.design.decoupling)
    begun = [event for zone, setpoint in enumerate(SETPOINTS) for event in (
        ZoneEvent(0.0, "setpoint", zone, setpoint), ZoneEvent(0.0, "on", zone))]
    return run_zones(loop, proof.fitted.network, [*begun, *events], duration_s)


class Step7:
    """The program of all zones in the emulated CPU; FB 41 is the model of the proof, with DISV as the program left it."""

    def __init__(self, proof):
        self.count = len(proof.words)
        self.cpu = S7300Cpu(str(export_zones(proof, force=True)["fb41_zones.awl"]), {"FB 41": self.cont_c})
        self.states = [ContCState()] * self.count
        self.cpu.memory["L OB 35"][10:12] = round(1000 * proof.actuator.resolution_s).to_bytes(2, "big")
        for zone in range(self.count):
            self.cpu.put(self.cpu.member(f"DB {101 + 10 * zone}", "AUTO"), 1)
        self.cpu.run("OB 100")

    def cont_c(self, cpu, words):
        zone = next(i for i in range(self.count) if words is cpu.words[f"DB {41 + 10 * i}"])
        memory = cpu.memory[f"DB {41 + 10 * zone}"]
        values = {field.name: as_real(words[field.name]) if field.format == "REAL" else words[field.name] for field in FIELDS}
        inputs = {"COM_RST": words["COM_RST"], "MAN_ON": words["MAN_ON"], "PV_PER": signed_number(words.get("PV_PER", 0), 16),
                  "SP_INT": as_real(words.get("SP_INT", 0)), "MAN": as_real(words.get("MAN", 0)),
                  "DISV": as_real(int.from_bytes(memory[68:72], "big"))}
        self.states[zone], _, lmn, _ = scan((parameters_of(values), ContCAssumptions()), self.states[zone], inputs)
        memory[72:76] = bits_of(lmn).to_bytes(4, "big")

    def tick(self, readings):
        for zone, reading in enumerate(readings):
            self.cpu.memory["P"][256 + 2 * zone : 258 + 2 * zone] = int(reading).to_bytes(2, "big")
        self.cpu.run("OB 35")

    def heats(self, zone):
        return bool(self.cpu.get(self.cpu.member(f"DB {101 + 10 * zone}", "HEAT")))

    def power(self, zone):
        return as_real(int.from_bytes(self.cpu.memory[f"DB {41 + 10 * zone}"][72:76], "big"))


def is_on(trace, zone, instant):
    return any(begin <= instant + 1e-6 < end - 1e-6 for each, begin, end in trace.pulses if each == zone)


def with_breaks(proof, duration_s, after=6, length=3):
    """Return a run in which the second zone's sensor is broken for some calls, those calls, and the calls of the run."""
    interval = proof.words[0].sample_time_s
    begin, end = (after * interval, (after + length) * interval)
    trace = joint_run(proof, duration_s, ZoneEvent(begin, "broken", 1), ZoneEvent(end, "on", 1))
    return trace, range(after, after + length)


@pytest.mark.parametrize(("ramp", "staggered"), [(None, False), (Ramp(step=60, calls=2), False), (None, True)])
@pytest.mark.long
def test_the_program_of_cont_c_makes_the_run_of_the_proof_call_by_call(ramp, staggered):
    """Each zone's power is that of the proof to the bit, and its heater is on when it is on there, tick by tick."""
    proof = proof_of("fb41", ramp=ramp, staggered=staggered)
    assert any(proof.offsets_s) == staggered
    trace, broken = with_breaks(proof, 60.0)
    program, per_call = Step7(proof), round(proof.words[0].sample_time_s / proof.actuator.resolution_s)
    added = False
    for k in range(11):
        readings = [trace.readings[k, zone] for zone in range(3)]
        if k in broken:
            readings[1] = 32767
        program.tick(readings)
        for zone in range(3):
            if not (zone == 1 and k in broken):
                assert program.power(zone) == pytest.approx(trace.powers_pct[k, zone], abs=0.0), (k, zone)
        added |= 0.0 < trace.powers_pct[k, 0] < 100.0
        for tick in range(per_call):
            if tick:
                program.tick(readings)
            now = (k * per_call + tick) * proof.actuator.resolution_s
            for zone in range(3):
                if zone != 1 or (k < broken.start and not staggered) or (staggered and k not in broken):
                    assert program.heats(zone) == is_on(trace, zone, now), (k, tick, zone)
    assert added
    assert ramp or trace.powers_pct[0, 2] == 100.0


@pytest.mark.parametrize("ramp", [None, Ramp(step=single(0.3), calls=2)])
@pytest.mark.long
def test_the_structured_text_makes_the_run_of_the_proof_call_by_call(ramp):
    proof = proof_of("iec-pid", ramp=ramp)
    trace, broken = with_breaks(proof, 60.0)
    whole = units(str(export_zones(proof, force=True)["iec_pid_zones.st"]))
    per_call = round(proof.words[0].sample_time_s / proof.actuator.resolution_s)
    for zone in range(3):
        program = TextProgram([whole[0], whole[1 + zone]], {}, lambda duration_ms: duration_ms / 1000.0)
        near = [other for other in (zone - 1, zone + 1) if 0 <= other < 3]
        for k in range(11):
            program["HeaterOn"] = not (zone == 1 and k in broken)
            program["HeaterTemperature"] = float(trace.readings[k, zone])
            for other in near:
                program[f"HeaterZone{other + 1}"] = float(trace.readings[k, other])
                program[f"HeaterZone{other + 1}Good"] = not (other == 1 and k in broken)
            program.scan()
            if program["HeaterOn"]:
                assert program["HeaterPower"] == pytest.approx(trace.powers_pct[k, zone], abs=2e-5), (k, zone)
            else:
                assert program["HeaterPower"] == 0.0
            for _ in range(per_call - 1):
                program.scan()


@pytest.mark.parametrize("target", ["fb41", "iec-pid"])
def test_what_is_added_is_minus_factor_times_the_neighbours_distance(target):
    """By NumPy, of a run in which nothing but the P part and what is added is left: K·e + Σ F·(y − r)."""
    proof = proof_of(target)
    design = proof.design
    trace = joint_run(proof, 1.0)
    away = trace.temperatures_degC[0] - SETPOINTS
    for zone in (0, 1):
        power = -design.designs[zone].gain_pct_per_degC * away[zone] + design.decoupling.matrix[zone] @ away
        integral = design.designs[zone].gain_pct_per_degC * 4.0 / design.designs[zone].integral_time_s * -away[zone]
        assert power < trace.powers_pct[0, zone] < power + integral + 0.1
    assert design.decoupling.matrix[0] @ away > 5.0


def test_the_robustness_of_decoupled_zones_is_that_of_a_simulated_linear_loop():
    """The largest eigenvalue by Euler's steps of the same loop, which shares no matrix with heatertune's."""
    proof = proof_of("fb41", exchange=8.0)
    design, network = proof.design, proof.fitted.network
    interval, parts = design.designs[0].sample_time_s, 64
    late = round((network.dead_times_s[0] + controller_for("fb41").delayed_s(proof.words[0].scaling)) / interval * parts)
    temperature, sums, errors = np.array([1.0, -2.0, 3.0]), np.zeros(3), []
    matrix = (network.exchange - np.diag(1.0 + network.exchange.sum(axis=1))) / 240.0
    queue = [np.zeros(3)] * (late + 1)
    power = np.zeros(3)
    gains = np.array([each.gain_pct_per_degC for each in design.designs])
    shares = interval / np.array([each.integral_time_s for each in design.designs])
    for k in range(600 * parts):
        if k % parts == 0:
            sums = sums - temperature
            power = gains * (shares * sums - temperature) + design.decoupling.matrix @ temperature
            errors.append(np.abs(temperature).max())
        queue.append(power)
        temperature = temperature + interval / parts * (matrix @ temperature + 1.2 / 240.0 * queue.pop(0))
    decay = (errors[-1] / errors[-101]) ** 0.01
    assert decay == pytest.approx(design.radius, abs=2e-4)
    assert closed_loop_radius(network, design.designs, 0.3) != pytest.approx(design.radius, abs=1e-3)  # without decoupling


@pytest.fixture(scope="module")
def designed():
    """Return a PASS of two decoupled zones."""
    fitted = network_by_hand(chain(2, 2.0))
    return design_zones(fitted, "fb41", specification=replace(
        specification_for(fitted, (50.0, 55.0), Conditions()), decouple=True))


def stored(folder, proof):
    (folder / DATA).mkdir(parents=True)
    (folder / DATA / "zones.json").write_text(to_json(to_document(proof, [])), encoding="utf-8")
    return folder


def test_a_design_of_decoupled_zones_moves_its_neighbours_less_and_says_by_how_much(designed):
    assert designed.verdict == "PASS", designed.summary()
    plain = design_zones(designed.fitted, "fb41", (50.0, 55.0))
    assert designed.neighbour_deviation_degC < 0.6 * plain.neighbour_deviation_degC
    line = designed.brief().splitlines()[-1]
    assert f"by up to {designed.neighbour_deviation_degC:.3g} °C, without decoupling by {plain.neighbour_deviation_degC:.3g} °C" in line
    assert "a sensor that breaks" in plain.not_tested
    assert "a sensor that breaks" not in designed.not_tested
    decoupling, network = designed.design.decoupling, designed.fitted.network
    assert decoupling.matrix == pytest.approx(-decoupling.share * network.exchange / 1.2)
    size = radius(network, designed.design.designs, designed.words[0].sample_time_s,
                  controller_for("fb41").delayed_s(designed.words[0].scaling), decoupling.matrix)
    assert size < 1.0


def test_the_folder_of_decoupled_zones_is_proven_again_simulated_and_recorded(designed, tmp_path):
    design = read_zones_design(stored(tmp_path / "oven", designed))
    assert design.decoupling == designed.design.decoupling
    assert prove_again(design).summary() == designed.summary()
    page = zone_record(designed, to_document(designed, []), ["fb41_zones.awl"])
    assert "Power for the neighbours" in page
    served = virtual_zones(tmp_path / "oven", Simulation(serve=("s7",), rate=1.0, step=True), noise_degC=0.0)
    try:
        loop = ZoneLoop(words=designed.words, actuator=designed.actuator, decoupling=design.decoupling)
        events = [event for zone, degC in enumerate((50.0, 55.0)) for event in (
            ZoneEvent(0.0, "setpoint", zone, degC), ZoneEvent(0.0, "on", zone))]
        trace = run_zones(loop, designed.fitted.network, events, 60 * loop.sample_time_s)
        for scan in range(60):
            served.release(1)
            cells = [part.memory.image() for part in served.plc.parts]
            lmn, disv = ([struct.unpack_from(">f", each, at)[0] for each in cells] for at in (72, 68))
            assert lmn == pytest.approx(trace.powers_pct[scan], abs=1e-6), scan
            away = [50.0 - trace.temperatures_degC[scan, 0], 55.0 - trace.temperatures_degC[scan, 1]]
            assert disv == pytest.approx([-design.decoupling.matrix[0, 1] * away[1], -design.decoupling.matrix[1, 0] * away[0]], abs=0.02)
    finally:
        served.close()


def test_what_cannot_carry_decoupling_says_so(designed, tmp_path, capsys):
    folder = stored(tmp_path / "oven", designed)
    request = ZonesWriteRequest(proven=ProvenZones(design=read_zones_design(folder), proof=designed),
                                address=address_of("s7://127.0.0.1:1/0/2/db41"))
    with pytest.raises(InputError, match="load the exported program, or design without --decouple"):
        plan_zones(request, [])
    with pytest.raises(InputError, match=r"sensor-off.*not for decoupled zones"):
        virtual_zones(folder, Simulation(serve=("s7",), faults=("zone=a t=3 sensor-off",)))
    text = proof_of("iec-pid")
    with pytest.raises(InputError, match="design with --target fb41, or without --decouple"):
        virtual_zones(stored(tmp_path / "text", text))
    for target, reason in (("s5-ob251", "its Z takes whole numbers"), ("s7-300", "no input"), ("klipper", "no input")):
        assert main(["design", str(tmp_path / "no.csv"), "--zones", "a,b", "--target", target, "--setpoint", "50", "--decouple"]) == 2
        told = capsys.readouterr().err
        assert reason in told
        assert "take --target fb41 or iec-pid" in told
    assert main(["design", "table4", "--target", "fb41", "--decouple"]) == 2
    assert "--decouple: for zones designed together" in capsys.readouterr().err


def test_zones_that_exchange_no_heat_are_not_decoupled():
    fitted = network_by_hand(chain(2, 0.0))
    spec = replace(specification_for(fitted, 50.0, Conditions()), decouple=True)
    proof = design_zones(fitted, "fb41", specification=spec)
    assert proof.design.decoupling is None
    assert proof.remarks == ("not decoupled: the log shows no exchange of heat between zones",)
    assert "DISV :=" in str(export_zones(proof, force=True)["fb41_zones.awl"])
    assert "power for the neighbours" not in str(export_zones(proof, force=True)["fb41_zones.awl"])
