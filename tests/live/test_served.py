"""What is served is what is proven, bit for bit, whatever the protocol."""

import struct
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.live.conftest import CONDITIONS, DB, LENGTH, PROTOCOLS, client, stepped, words_of

from heatertune import InputError, Scenario
from heatertune import simulate as simulate_words
from heatertune.live.plc import FAULTS
from heatertune.live.simulator_status import OWN, OWN_LENGTH, SimulatorStatus
from heatertune.plc import controller_for
from heatertune.plc.core import Sensor, count
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.s5_ob251.export import from_image
from heatertune.proof import replay
from heatertune.proof.monte_carlo.run import drawing_for


def _quiet(heater, words, scans, noise=0.0):
    """The same run in the proof's own loop, where nobody serves anything."""
    scan_s = controller_for(words.target).timing(words).scan_s
    story = Scenario(setpoint_degC=50.0, duration_s=(scans - 1) * scan_s, noise_degC=noise)
    return simulate_words(words, heater, story)


def _as(rows, trace):
    """Whether the rows of a client are the scans of a trace: what the sensor saw, what was read, what was asked for."""
    told = [SimulatorStatus(own) for own, _ in rows]
    assert [each.intervals for each in told] == list(range(1, len(rows) + 1))
    assert [each.scans for each in told] == list(range(1, len(rows) + 1))
    np.testing.assert_array_equal([each.power_pct for each in told], trace.power_asked_pct[:len(rows)])
    unit = trace.words.scaling.span_degC / 2047
    np.testing.assert_array_equal([trace.words.scaling.low_degC + unit * each.reading for each in told], trace.reading_degC[:len(rows)])
    if not trace.scenario.noise_degC:
        np.testing.assert_array_equal([each.temperature_degC for each in told], trace.temperature_degC[:len(rows)])


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_stepped_run_is_that_of_the_proof_bit_for_bit(served, heater, words, protocol):
    with client(served(serve=protocol), protocol) as asking:
        _as(stepped(asking, 200), _quiet(heater, words, 200))


@pytest.mark.long
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_stepped_scans_twice_are_the_same_bytes_and_the_proofs(served, heater, words, protocol):
    """A thousand here; `python -m tests.bench.served` has ten thousand."""
    noisy = replace(CONDITIONS, noise_degC=0.3)
    runs = []
    for _ in range(2):
        with client(served(conditions=noisy, serve=protocol), protocol) as asking:
            runs.append(stepped(asking, 1_000))
    assert runs[0] == runs[1]
    _as(runs[0], _quiet(heater, words, 1_000, noise=0.3))


@pytest.mark.long
@pytest.mark.parametrize(("target", "seed"), [("s5-ob251", 17), ("s5-ob251", 18), ("fb41", 19), ("s7-300", 20), ("pid-compact", 21),
                                              ("weg", 22), ("iec-pid", 23), ("s7-200", 24)])
def test_a_drawn_heater_with_the_proofs_story_is_the_sample_that_verify_replays(served, heater, target, seed):
    words, switches = words_of(target), controller_for(target).switches
    under = settings_to_prove(switches)
    known = replace(CONDITIONS, switches=under[seed % len(under)])
    trace = replay(drawing_for(words, heater, {}, known), seed)
    scans = len(trace.time_s)
    assert scans > 1000
    plc = served(words, known, sample=seed, story=True, intervals=scans)
    told = [plc.release(1) for _ in range(scans)]
    on = trace.power_asked_pct > 0.0
    assert np.count_nonzero(on) > 100
    off = [each.scans == before.scans for before, each in pairwise(told)]
    assert any(off), "the story takes the PLC's supply away"
    kept = np.array([True, *(not each for each in off)])
    np.testing.assert_array_equal(np.array([each.power_pct for each in told])[kept], trace.power_asked_pct[kept])
    np.testing.assert_array_equal([each.temperature_degC for each in told], trace.temperature_degC)


def test_both_protocols_serve_one_memory(served):
    plc = served(serve=("s7", "modbus"))
    with client(plc, "s7") as one, client(plc, "modbus") as other:
        one.write(DB, 2, struct.pack(">h", 1234))
        assert other.read(DB, 2, 2) == struct.pack(">h", 1234)
        other.write(OWN, 8, struct.pack(">I", 3))
        assert plc.wait(0.0) is False
        while SimulatorStatus(one.read(OWN, 0, OWN_LENGTH)).intervals < 3:
            pass
        assert one.read(DB, 0, LENGTH) == other.read(DB, 0, LENGTH)


@pytest.mark.long
def test_all_protocols_that_are_there_serve_one_memory(served):
    there = [each.values[0] for each in PROTOCOLS if not each.marks[0].args[0]]
    plc = served(serve=there)
    assert list(plc.addresses) == list(plc.urls) == there
    for number, writer in enumerate(there):
        with client(plc, writer) as one:
            one.write(DB, 2, struct.pack(">h", 1000 + number))
        for reader in there:
            with client(plc, reader) as other:
                assert other.read(DB, 2, 2) == struct.pack(">h", 1000 + number), (writer, reader)


def test_the_block_is_the_exported_one_and_x_w_and_ya_stand_in_their_cells(served, words):
    plc = served()
    with client(plc) as asking:
        image = asking.read(DB, 0, LENGTH)
        assert from_image(image, 4.0, "served") == words.values
        told = plc.release(1)
        image = asking.read(DB, 0, LENGTH)
        # 50 °C and 22 °C of 0…100 °C in 2047 units
        assert [struct.unpack_from(">h", image, 2 * dw)[0] for dw in (9, 22)] == [1023, 450]
        ya = struct.unpack_from(">h", image, 96)[0]
        assert told.power_pct == 100.0 * ya / 2047


def test_words_written_by_a_client_act_from_the_next_scan_on(served, words):
    plc, other = served(), replace(words, values={**words.values, "K": 2 * words.values["K"]})
    controller = controller_for("s5-ob251")
    sensor = Sensor(0.0, 100.0, 2047)
    running = controller.start(words, {})
    with client(plc) as asking:
        for scan in range(40):
            if scan == 20:
                asking.write(DB, 2, struct.pack(">h", other.values["K"]))
                running = controller.start(other, {})._replace(state=running.state)
            told = plc.release(1)
            running, expected = controller.step(running, 1023, count(sensor, told.temperature_degC))
            assert told.power_pct == expected.power_pct, scan


def test_a_setpoint_written_by_a_client_stays(served):
    plc = served()
    plc.release(1)
    with client(plc) as asking:
        asking.write(DB, 18, struct.pack(">h", 1228))
        plc.release(600)
        assert struct.unpack(">h", asking.read(DB, 18, 2))[0] == 1228
        assert plc.status.temperature_degC == pytest.approx(60.0, abs=1.0)


def test_the_state_lives_in_the_block(served):
    plc = served()
    before = plc.release(150)
    with client(plc) as asking:
        asking.write(DB, 2 * 34, bytes(8))  # Y before the limiter
        asking.write(DB, 2 * 48, bytes(2))  # YA
        after = plc.release(1)
    assert before.power_pct > 20.0
    assert after.power_pct < 1.0


def test_the_loop_table_of_an_s7_200_is_found_by_tsap(served):
    pid = words_of("s7-200-pid")
    plc = served(pid)
    plc.release(5)
    from snap7.logo import Logo  # noqa: PLC0415 - the client of an S7-200

    logo = Logo()
    logo.connect(plc.addresses["s7"][0], 0x1000, 0x1001, plc.addresses["s7"][1])
    try:
        table = struct.unpack(">9f", logo.db_read(1, 100, 36))
        kc, ts, ti, td = table[3:7]
        assert {"KC": kc, "TS": ts, "TI": ti, "TD": td}.items() <= pid.values.items()
        assert table[1] == pytest.approx(0.5)
        before = plc.release(1).power_pct
        logo.db_write(1, 104, bytearray(struct.pack(">f", 0.2)))  # 20 °C, below the ambient
        assert before > plc.release(2).power_pct
    finally:
        logo.disconnect()


def test_as_fast_as_it_can_it_ends_where_it_is_told_to(served, heater, words):
    plc = served(step=False, rate=float("inf"), intervals=500)
    assert plc.wait(60.0)
    trace = _quiet(heater, words, 500)
    assert (plc.status.intervals, plc.status.power_pct, plc.status.temperature_degC) == (
        500, trace.power_asked_pct[499], trace.temperature_degC[499])


def test_a_rate_keeps_the_clock(served):
    plc = served(step=False, rate=4000.0, intervals=300)  # a scan each millisecond
    assert plc.wait(60.0)
    assert plc.status.intervals == 300


def test_time_in_which_the_machine_slept_is_not_made_up_for(served, monkeypatch):
    ahead_s, real = [0.0], time.monotonic
    monkeypatch.setattr("heatertune.live.plc.time", SimpleNamespace(monotonic=lambda: real() + ahead_s[0]))
    plc = served(step=False, rate=100.0)  # a scan in 40 milliseconds
    changed = plc.plc.memory.changed

    def after(intervals):
        with changed:
            assert changed.wait_for(lambda: plc.status.intervals >= intervals, 60.0)
        return real()

    after(2)
    ahead_s[0] = 1000.0  # 25,000 scans
    begun, at = real(), plc.status.intervals
    assert after(at + 6) - begun > 0.1


@pytest.mark.parametrize(("changed", "said"), [
    ({"serve": "profinet"}, "unknown protocol 'profinet'; known: s7, modbus, opcua, as511"),
    ({"serve": ("s7", "s7")}, "each protocol once"),
    ({"ports": (1, 2)}, "2 ports for 1 protocols"),
    ({"ports": 70000}, "port = 70000 is out of range"),
    ({"rate": 0.0}, "rate = 0.0 is out of range"),
    ({"rate": 10.0, "step": True}, "leave out --rate"),
    ({"intervals": 0}, "intervals = 0 is out of range"),
    ({"sample": -1}, "sample = -1 is out of range"),
    ({"dead_man": -1}, "dead_man = -1 is out of range"),
    ({"faults": "t=9 nonsense"}, "unknown fault 'nonsense'"),
    ({"faults": "sensor-off"}, "expected t=SECONDS NAME"),
    ({"faults": "t=x sensor-off"}, "'x' is no number"),
    ({"faults": "t=9 sensor-off until=3"}, "before it begins"),
    ({"faults": "t=9 sensor-off=3"}, "takes no number"),
    ({"faults": "t=9 mains"}, "needs =NUMBER"),
    ({"faults": "t=9 mains=nan"}, "'nan' is no number"),
    ({"faults": "t=9 mains=-200"}, "-100…50 %"),
    ({"faults": "t=9 late-reply=1.5"}, "whole number of scans"),
    ({"faults": "t=9 word Q=1"}, "unknown word 'Q'"),
    ({"faults": "t=9 word K=1e9"}, "word K = 1000000000.0 is out of range"),
    ({"faults": "t=9 heater-open", "story": True}, "leave out --story"),
])
def test_what_cannot_be_served_is_told_in_one_line(served, changed, said):
    with pytest.raises(InputError) as told:
        served(**{"step": False} | changed)
    assert said in str(told.value)


def test_a_port_that_is_taken_is_told(served):
    taken = served().addresses["s7"][1]
    with pytest.raises(InputError, match=f"port {taken} of 127.0.0.1 cannot be served on"):
        served(ports=taken)


def test_a_controller_that_is_not_served_is_told(served):
    with pytest.raises(InputError, match=r"simulate serves s5-ob251, .*; klipper is not among them"):
        served(words_of("klipper"))


@pytest.mark.parametrize(("protocol", "library", "extra"), [
    ("s7", "snap7", "s7"), ("modbus", "pymodbus", "modbus"), ("opcua", "asyncua", "opcua"), ("as511", "serial", "serial")])
def test_without_its_library_a_protocol_names_the_extra(served, monkeypatch, protocol, library, extra):
    monkeypatch.setattr("heatertune.live.client.connection.find_spec", lambda _: None)
    with pytest.raises(InputError, match=rf'{protocol} needs {library}: pip install "heatertune\[{extra}\]"'):
        served(serve=protocol)


def test_each_fault_is_one_that_some_test_has():
    text = Path(__file__).with_name("test_faults.py").read_text(encoding="utf-8")
    assert not [name for name in FAULTS if name.replace("word NAME=", "word K=").rstrip("=") not in text]
