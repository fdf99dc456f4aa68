"""The PID instruction: NumPy's float32 on the manual's equations, python-control where nothing is limited."""

import json
import math
import struct
from dataclasses import replace

import control
import numpy as np
import pytest

from heatertune.cli import main
from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.cpu.s7_200 import COLD, assemble, run
from heatertune.plc.s7_200_pid.export import pid_program, to_image
from heatertune.plc.s7_200_pid.words import NO_INTEGRAL
from heatertune.proof import Scenario, simulate

ROOM = controller_for("s7-200-pid")
F = np.float32


def _design(gain=3.0, tn=300.0, tv=0.0, ta=7.0):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="")


class Loop:
    """System Manual C79000-G7076-C233-01, pp. 9-86 and 9-91, one rounding after each operation; times in minutes."""

    def __init__(self, words):
        self.kc, self.ts, self.ti, self.td = (F(words.values[name]) for name in ("KC", "TS", "TI", "TD"))
        self.mx, self.before = F(0), None

    def output(self, setpoint, reading):
        sp, pv = F(setpoint) / F(32000), F(reading) / F(32000)
        if self.before is None:
            self.before = pv  # SBR0 writes the reading at the start
        factor = self.kc if self.kc else F(1)
        mp = self.kc * (sp - pv)
        with np.errstate(over="ignore"):  # no integral part: Ti is infinite
            mi = factor * (self.ts / (F(60) * self.ti)) * (sp - pv) + self.mx
        md = factor * (F(60) * self.td / self.ts) * (self.before - pv)
        m = mp + mi + md
        self.mx = F(1) - (mp + md) if m > 1 else -(mp + md) if m < 0 else mi
        self.mx = min(max(self.mx, F(0)), F(1))
        self.before = pv
        return min(max(m, F(0)), F(1))


@pytest.mark.parametrize("values", [
    {"KC": 3.0, "TS": 7.0, "TI": 5.0, "TD": 0.0}, {"KC": 2.5, "TS": 7.0, "TI": 5.0, "TD": 0.25},
    {"KC": 0.0, "TS": 7.0, "TI": 0.5, "TD": 0.0}, {"KC": -4.0, "TS": 7.0, "TI": NO_INTEGRAL, "TD": 0.125},
])
def test_the_exported_program_computes_the_manuals_equations_to_the_last_bit(values):
    words = Words(target="s7-200-pid", values=values | {"TICK": 250, "TICKS": 28}, scaling=Scaling(), sample_time_s=7.0)
    ROOM.check(words)
    state, loop, random = ROOM.start(words, {}), Loop(words), np.random.default_rng(3)
    reading, outputs = 16000, set()
    for _ in range(3000):
        reading = int(np.clip(reading + random.integers(-900, 901), 0, 32000))
        setpoint = int(random.integers(8000, 24001))
        state, scan = ROOM.step(state, setpoint, reading)
        m = loop.output(setpoint, reading)
        bits = [struct.unpack(">f", state.state.read(name).to_bytes(4, "big", signed=True))[0] for name in ("VD108", "VD128")]
        assert bits == [float(m), float(loop.mx)]
        assert scan.output == math.floor(float(F(7000) * m) + 0.5)
        outputs.add(scan.output)
    assert {0, 7000} < outputs


def test_where_nothing_is_limited_it_is_the_linear_pid():
    ta, tn, tv = 5.0, 60.0, 10.0
    words = ROOM.encode(_design(gain=1.0, tn=tn, tv=tv, ta=ta), Scaling())
    z = control.tf([1, 0], [1], ta)
    on_error = 1 + ta / tn * z / (z - 1)
    on_pv = tv / ta * (z - 1) / z
    rng = np.random.default_rng(5)
    readings = 8 * rng.integers(1480, 1521, 60)
    time = ta * np.arange(60)
    errors, pvs = (16000 - readings) / 32000, (readings - readings[0]) / 32000
    expected = (control.forced_response(on_error, time, errors).outputs
                - control.forced_response(on_pv, time, pvs).outputs)
    state = ROOM.start(words, {})
    for reading, wanted in zip(readings.tolist(), expected, strict=True):
        state, scan = ROOM.step(state, 16000, reading)
        assert 0.0 < wanted < 1.0
        assert scan.output == pytest.approx(5000 * wanted, abs=0.51)


def test_a_loop_settles():
    words = ROOM.encode(_design(), Scaling())
    heater = Fopdt(gain_degC_per_pct=0.4, time_constant_s=150.0, dead_time_s=10.0, ambient_degC=20.0)
    trace = simulate(ROOM, words, heater, Scenario(setpoint_degC=45.0, duration_s=2500.0))
    assert trace.power_asked_pct[0] > 0.0
    assert trace.temperature_degC[-1] == pytest.approx(45.0, abs=0.1)


def test_real_instructions_round_halves_away_and_flag_what_is_no_number():
    text = ("ORGANIZATION_BLOCK MAIN:OB1\nBEGIN\nNetwork 1\n\tLD\tSM0.0\n\tMOVR\t2.5, AC0\n\tROUND\tAC0, VD0\n"
            "\tMOVR\t-2.5, AC0\n\tROUND\tAC0, VD4\n\tMOVR\t7.0, VD8\n\t/R\t0.0, VD8\nEND_ORGANIZATION_BLOCK\n")
    after = run(assemble(text), "OB1", COLD)
    assert (after.read("VD0"), after.read("VD4"), after.overflow) == (3, -3, True)
    assert struct.pack(">i", after.read("VD8")) == struct.pack(">f", 7.0)


def test_a_loop_goes_on_from_what_its_table_holds():
    # manual p. 9-92: without a 0 → 1 of its power flow the instruction initialises nothing: bias 0.3 and PV_{n−1} 0.4 act;
    # MP = 2·0.1, MI = 2·(1/60)·0.1 + 0.3, MD = 2·(60·0.01/1)·(0.4 − 0.5)
    values = {0: 0.5, 4: 0.6, 8: 0.9, 12: 2.0, 16: 1.0, 20: 1.0, 24: 0.01, 28: 0.3, 32: 0.4}
    moves = "".join(f"\tMOVR\t{value}, VD{100 + at}\n" for at, value in values.items())
    text = f"ORGANIZATION_BLOCK MAIN:OB1\nBEGIN\nNetwork 1\n\tLD\tSM0.0\n{moves}\tPID\tVB100, 3\nEND_ORGANIZATION_BLOCK\n"
    after = run(assemble(text), "OB1", COLD)
    found = [struct.unpack(">f", after.read(name).to_bytes(4, "big"))[0] for name in ("VD108", "VD128", "VD132")]
    assert found == pytest.approx([0.2 + 0.2 / 60 + 0.3 - 0.12, 0.2 / 60 + 0.3, 0.5])


@pytest.mark.parametrize("broken", [32767, -32767, -32768])
@pytest.mark.parametrize("ramp", [None, 400.0])
def test_a_broken_wire_leaves_the_heater_off_and_its_end_begins_the_loop_anew(broken, ramp):
    # EM231: ±32767 where the wire is broken; then as after a start: no bias, no jump of the derivative, the ramp at the reading
    words = ROOM.encode(_design(gain=1.0, tv=20.0), Scaling())
    words = words if ramp is None else replace(words, ramp=ROOM.ramp(words, ramp))
    program = assemble(pid_program(words))

    def call(cpu, reading):
        return run(program, "INT0", cpu.written({"AIW0": reading, "VW90": 1}))

    def begun(reading):
        return run(program, "OB1", COLD.written({"AIW0": reading, "SM0.1": 1, "VW80": 16000})).written({"VD104": 0x3F000000})

    cpu = begun(8000)
    for _ in range(40):
        cpu = call(cpu, 8000)
    assert cpu.width > 0
    blind = call(cpu, broken)
    assert (blind.width, blind.pulsed, blind.read("VD108"), blind.read("VD128"), blind.read("SMB67")) == (0, True, 0, 0, 0xDA)
    assert call(call(blind, broken), broken).width == 0
    again, anew = call(blind, 12000), call(begun(12000), 12000)
    assert (again.width, again.read("VD128"), again.read("VW82")) == (anew.width, anew.read("VD128"), anew.read("VW82"))


@pytest.mark.parametrize(("asked", "kept"), [(1.5, 1.0), (-0.25, 0.0), (math.inf, 1.0), (0.625, 0.625), (1.0, 1.0)])
def test_a_setpoint_that_a_panel_writes_stays_in_the_range(asked, kept):
    program = assemble(pid_program(ROOM.encode(_design(), Scaling())))
    cpu = run(program, "OB1", COLD.written({"AIW0": 8000, "SM0.1": 1}))
    bits = int.from_bytes(struct.pack(">f", asked), "big")
    assert struct.pack(">i", run(program, "INT0", cpu.written({"VD104": bits})).read("VD104")) == struct.pack(">f", kept)


@pytest.mark.parametrize(("asked", "kept"), [(32700, 32000), (-5, 0), (16000, 16000)])
def test_a_setpoint_asked_of_a_ramp_stays_in_the_range(asked, kept):
    words = ROOM.encode(_design(), Scaling())
    program = assemble(pid_program(replace(words, ramp=ROOM.ramp(words, 400.0))))
    cpu = run(program, "OB1", COLD.written({"AIW0": 8000, "SM0.1": 1}))
    assert run(program, "INT0", cpu.written({"VW80": asked})).read("VW80") == kept


def test_comparisons_of_reals_hold_for_no_nan():
    for relation, held in (("=", 0), ("<", 1), (">", 0), ("<=", 1), (">=", 0)):
        for other, wanted in (("2.0", held), ("VD0", 0)):
            text = f"ORGANIZATION_BLOCK M:OB1\nBEGIN\n\tLDR{relation}\t1.5, {other}\n\t=\tV8.0\n"
            assert run(assemble(text), "OB1", COLD.written({"VD0": 0x7FC00000})).read("VB8") == wanted


def test_the_loop_table_has_the_manuals_offsets_and_comes_back():
    words = ROOM.encode(_design(gain=2.5, tn=240.0, tv=30.0, ta=2.0), Scaling(low_degC=0.0, high_degC=200.0))
    short, long = to_image(words), to_image(words, extended=True)
    assert (len(short), len(long), long[36:40]) == (36, 80, b"PIDA")
    # Table 9-19: gain at 12, sample time at 16 [s], integral time at 20 and derivative time at 24 [min]
    assert struct.unpack(">9f", short) == (0.0, 0.0, 0.0, 5.0, 2.0, 4.0, 0.5, 0.0, 0.0)
    # auto-tune part: DEV 44, HYS 48 (DEV/HYS at least 4), STEP 52, WDOG 56 (60…7200 s)
    dev, hys, step, wdog = struct.unpack_from(">4f", long, 44)
    assert (0.025 <= dev <= 0.25, dev / hys >= 4.0, 0.05 <= step <= 0.4, 60 <= wdog <= 7200) == (True,) * 4
    for image in (short, long):
        back = ROOM.read_image(image, sample_time_s=2.0, scaling=words.scaling, source="dump")
        assert back == words
        assert ROOM.oddities(back) == ()


@pytest.mark.parametrize(("at", "value", "named"), [
    (12, 0.0, "KC is 0"), (12, -1.0, "cools"), (16, 5.0, "called every 2 s"), (20, math.inf, "no integral action"),
    (20, 0.05, "meant in seconds"),
])
def test_what_is_odd_about_a_running_loop_is_said(at, value, named):
    image = bytearray(to_image(ROOM.encode(_design(ta=2.0), Scaling())))
    struct.pack_into(">f", image, at, value)
    words = ROOM.read_image(bytes(image), sample_time_s=2.0, scaling=Scaling(), source="dump")
    (told,) = ROOM.oddities(words)
    assert named in told


@pytest.mark.parametrize(("image", "named"), [
    (bytes(35), "35 bytes"), (bytes(80), "PIDA"), (struct.pack(">9f", *[math.nan] * 9), "word KC"),
    (struct.pack(">9f", 0, 0, 0, 1, 1, 0, 0, 0, 0), "word TI"),
])
def test_what_is_no_loop_table_is_refused(image, named):
    with pytest.raises((InputError, OutOfRange), match=named):
        ROOM.read_image(image, sample_time_s=2.0, scaling=Scaling(), source="dump")


def test_decode_reads_a_dumped_loop_table(tmp_path, capsys):
    dump = tmp_path / "loop.bin"
    dump.write_bytes(ROOM.export(ROOM.encode(_design(), Scaling()), Certificate(verdict="PASS"))["VB100_36.bin"])
    plant = ["--gain", "0.4", "--time-constant", "150", "--dead-time", "10", "--setpoint", "40", "--spec", "paper"]
    status = main(["decode", str(dump), "--target", "s7-200-pid", "--called-every", "7", "--json", *plant])
    document = json.loads(capsys.readouterr().out)
    assert document["realised"]["integral_time_s"] == pytest.approx(300.0)
    assert (status == 0) == (document["proof"]["verdict"] == "PASS")


@pytest.mark.parametrize("ramp", [None, 400.0])
def test_a_start_up_finds_nothing_of_what_v_memory_retained(ramp):
    # manual p. 9-92: after STOP → RUN the instruction itself initialises neither M nor MX nor PV_{n−1}
    words = ROOM.encode(_design(tv=9.0), Scaling())
    words = words if ramp is None else replace(words, ramp=ROOM.ramp(words, ramp))
    program = assemble(pid_program(words))
    retained = {f"VD{100 + at}": 0x40490FDB for at in (8, 28, 32)}  # a REAL of 3.14
    kept = [run(program, "OB1", COLD.written({"AIW0": 8000, "SM0.1": 1} | before)) for before in ({}, retained)]
    begun = [[cpu.read(f"VD{100 + at}") for at in (8, 28, 32)] for cpu in kept]
    assert begun[0] == begun[1] == [0, 0, int.from_bytes(struct.pack(">f", 0.25), "big")]
