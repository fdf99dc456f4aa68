"""Each fault of the timetable does what it says, and what was before it stays as it was."""

import struct
from dataclasses import replace
from threading import Thread

import pytest
from tests.live.conftest import DB, FAILED, LENGTH, PROTOCOLS, S7, client

from heatertune.live.block_memory import Access, Refusal
from heatertune.live.plc import ScheduledFault, fault_of, heater_events
from heatertune.live.simulator_status import DEAD_MAN, FAULTY, OWN, RUNS
from heatertune.proof.kernel import LOAD, MAINS

_MANUAL = 32  # STEU: no Z, not automatic


@pytest.fixture
def by_hand(words):
    """40 % power in manual: 22 °C + 0.9 °C/% · 40 % = 58 °C at rest."""
    return replace(words, values={**words.values, "STEU": _MANUAL, "YH": 819})


@pytest.mark.parametrize(("fault", "rest_degC"), [
    ("heater-open", 22.0), ("half-power", 40.0), ("stuck-on", 112.0), ("polarity", -14.0),
    ("mains=-10", 22.0 + 36.0 * 0.81), ("ambient=5", 63.0),
])
def test_a_fault_of_the_heater_brings_it_to_another_rest_and_back(served, by_hand, fault, rest_degC):
    plc = served(by_hand, faults=f"t=2400 {fault} until=4800")
    assert plc.release(600).temperature_degC == pytest.approx(58.0, abs=0.5)
    assert not plc.status.status & FAULTY
    told = plc.release(600)
    assert (told.temperature_degC, told.status & FAULTY) == (pytest.approx(rest_degC, abs=0.5), FAULTY)
    assert plc.release(600).temperature_degC == pytest.approx(58.0, abs=0.5)


def test_a_fault_of_the_heater_acts_after_the_dead_time_and_not_before(served, by_hand):
    well, ill = served(by_hand), served(by_hand, faults="t=1001.5 heater-open")
    same = [well.release(1).temperature_degC == ill.release(1).temperature_degC for _ in range(300)]
    # dead time 12 s and 0.48 s of the module: 1013.98 s lies between the scans at 1012 s and 1016 s
    assert same.index(False) * 4.0 == 1016.0


def test_faults_of_the_heater_add_up(served):
    faults = [fault_of(text) for text in ("t=1 half-power until=9", "t=3 mains=-10 until=5", "t=3 ambient=9", "t=4 sensor-off")]
    assert heater_events(faults, 0.9, 2.0) == [
        (3.0, MAINS, 0.5), (5.0, LOAD, 10.0), (5.0, MAINS, pytest.approx(0.405)), (7.0, MAINS, 0.5), (11.0, MAINS, 1.0)]


@pytest.mark.parametrize(("fault", "seen"), [
    ("sensor-off", lambda _: 2047), ("sensor-half", lambda x: 22 + (x - 22) / 2), ("sensor-reversed", lambda x: 44 - x),
])
def test_a_fault_of_the_sensor_is_what_the_controller_reads(served, by_hand, fault, seen):
    well, ill = served(by_hand), served(by_hand, faults=f"t=400 {fault} until=480")
    for scan in range(140):
        told, other = well.release(1), ill.release(1)
        if 100 <= scan < 120:
            expected = seen(told.temperature_degC)
            assert other.reading == (2047 if fault == "sensor-off" else max(int(expected * 20.47), 0)), scan
        else:
            assert other.reading == told.reading, scan


def test_a_frozen_sensor_stands_still(served):
    plc = served(faults="t=80 sensor-frozen until=200")
    readings = [plc.release(1).reading for _ in range(52)]
    assert set(readings[20:50]) == {readings[20]}
    assert readings[50] > readings[20] + 10


def test_somebody_writes_a_word_once(served):
    plc = served(faults="t=40 word K=100")
    with client(plc) as asking:
        plc.release(10)
        before = asking.read(DB, 2, 2)
        plc.release(1)
        assert (struct.unpack(">h", before)[0] != 100, asking.read(DB, 2, 2)) == (True, struct.pack(">h", 100))
        asking.write(DB, 2, before)
        plc.release(5)
        assert asking.read(DB, 2, 2) == before


def test_in_stop_no_scan_is_run_and_a_start_up_clears_the_controller(served, words):
    plc = served(faults="t=400 cpu-stop until=600")
    before = plc.release(100)
    for number in range(50):
        told = plc.release(1)
        assert (told.scans, told.power_pct, told.status & RUNS) == (100, 0.0, 0), number
    assert told.temperature_degC < before.temperature_degC
    told = plc.release(1)
    assert (told.scans, told.status & RUNS) == (101, RUNS)
    # the first call from the cold state: K·(R + TI)·XW alone
    error, v = 1023 - told.reading, words.values
    assert round(20.47 * told.power_pct) == min(int(v["K"] / 1024 * (1 + v["TI"] / 1024) * error), 2047)


def test_a_client_stops_and_starts_the_cpu(served):
    plc = served()
    plc.release(5)
    with client(plc) as asking:
        asking.client.plc_stop()
        assert plc.release(5).scans == 5
        asking.client.plc_hot_start()
        assert plc.release(5).scans == 10


@pytest.mark.parametrize(("fault", "why"), [("db-missing", Access.MISSING), ("db-short", Access.OUTSIDE)])
def test_a_block_that_is_missing_or_short_stops_the_cpu(served, fault, why):
    plc = served(faults=f"t=40 {fault} until=80")
    with client(plc) as asking:
        plc.release(15)
        assert plc.status.scans == 10
        with pytest.raises(Exception, match=r"0x0a|0x05|exist|range"):
            asking.read(DB, 0, LENGTH)
        with pytest.raises(Refusal) as refused:
            plc.plc.memory.read(DB, 0, LENGTH)
        assert refused.value.why is why
        if fault == "db-short":
            assert len(asking.read(DB, 0, 48)) == 48
        plc.release(10)
        assert (plc.status.scans, len(asking.read(DB, 0, LENGTH))) == (15, LENGTH)


@pytest.mark.parametrize("protocol", ["s7", "modbus"])
def test_a_block_that_is_write_protected_keeps_its_words(served, protocol):
    plc = served(serve=protocol, faults="t=40 write-protected until=80")
    with client(plc, protocol) as asking:
        plc.release(11)
        before = asking.read(DB, 0, 36)
        with pytest.raises(FAILED):
            asking.write(DB, 2, b"\0\1")
        assert asking.read(DB, 0, 36) == before
        plc.release(10)
        asking.write(DB, 2, b"\0\1")
        assert asking.read(DB, 2, 2) == b"\0\1"


def test_a_link_that_is_cut_comes_back(served):
    plc = served(faults="t=40 cut until=80")
    with client(plc) as asking:
        plc.release(10)
        assert len(asking.read(DB, 0, LENGTH)) == LENGTH
        plc.release(1)
        with pytest.raises(FAILED):
            asking.read(DB, 0, LENGTH)
    with pytest.raises(FAILED):
        S7(*plc.addresses["s7"])
    plc.release(10)
    with client(plc) as asking:
        assert len(asking.read(DB, 0, LENGTH)) == LENGTH


@pytest.mark.parametrize(("fault", "arrives"), [("black-hole", False), ("lost-reply", True)])
def test_without_a_reply_nobody_knows_whether_a_write_arrived(served, fault, arrives):
    plc = served(faults=f"t=40 {fault} until=80")
    with client(plc) as asking:
        plc.release(11)
        asking.timeout(0.3)
        with pytest.raises(FAILED):
            asking.write(DB, 2, b"\0\7")
    plc.release(10)
    with client(plc) as asking:
        assert (asking.read(DB, 2, 2) == b"\0\7") is arrives


def test_a_late_reply_comes_so_many_scans_later(served):
    plc = served(faults="t=40 late-reply=3 until=400")
    memory = plc.plc.memory
    with client(plc) as asking:
        plc.release(11)
        writing = Thread(target=asking.write, args=(DB, 2, b"\0\7"))
        writing.start()
        with memory.changed:
            memory.changed.wait_for(lambda: memory.image()[2:4] == b"\0\7")
        passed = 0
        while writing.is_alive():
            plc.release(1)
            passed += 1
        assert passed >= 3


def test_a_late_request_arrives_though_its_client_has_gone(served):
    plc = served(faults="t=40 late-request=5 until=44")
    with client(plc) as asking:
        plc.release(11)
        before = plc.plc.memory.image()[2:4]
        asking.timeout(0.3)
        with pytest.raises(FAILED):
            asking.write(DB, 2, b"\0\7")
    assert plc.plc.memory.image()[2:4] == before
    plc.release(4)
    assert plc.plc.memory.image()[2:4] == before
    plc.release(2)
    assert plc.plc.memory.image()[2:4] == b"\0\7"


def test_a_duplicate_arrives_again_over_what_was_written_since(served):
    plc = served(faults="t=40 duplicate=3 until=44")
    with client(plc) as asking:
        plc.release(11)
        writing = Thread(target=asking.write, args=(DB, 2, b"\0\7"))
        writing.start()
        with plc.plc.memory.changed:
            plc.plc.memory.changed.wait_for(lambda: plc.plc.memory.image()[2:4] == b"\0\7")
        plc.plc.memory.carry_out(2, b"\0\1")
        plc.release(4)
        writing.join()
        assert asking.read(DB, 2, 2) == b"\0\7"


def test_a_write_is_overtaken_by_the_next_one_or_comes_late(served):
    plc = served(faults="t=40 reordered=5 until=400")
    with client(plc) as asking:
        plc.release(11)
        old = asking.read(DB, 2, 2)
        asking.write(DB, 2, b"\0\1")  # answered
        assert asking.read(DB, 2, 2) == old
        asking.write(DB, 2, b"\0\2")
        assert asking.read(DB, 2, 2) == b"\0\1"  # the second came first
        asking.write(DB, 2, b"\0\3")
        plc.release(6)
        assert asking.read(DB, 2, 2) == b"\0\3"


def test_a_copy_is_as_old_as_it_may_be(served):
    plc = served(faults="t=40 cached=3 until=400")
    with client(plc) as asking:
        plc.release(11)
        old = asking.read(DB, 2, 2)
        asking.write(DB, 2, b"\0\7")
        found = []
        for _ in range(4):
            found.append(asking.read(DB, 2, 2) == old)
            plc.release(1)
        assert found == [True, True, True, False]


def test_a_device_takes_half_or_less_than_was_written_and_answers(served, words):
    plc = served(faults=("t=40 half-taken until=80", "t=80 clamped=3000 until=120"))
    with client(plc) as asking:
        plc.release(11)
        old = asking.read(DB, 2, 2)
        asking.write(DB, 2, b"\x7f\x7f")
        assert asking.read(DB, 2, 2) == b"\x7f" + old[1:]
        plc.release(10)
        asking.write(DB, 2, struct.pack(">h", 5000))
        assert asking.read(DB, 2, 2) == struct.pack(">h", 3000)
        asking.write(DB, 2, struct.pack(">h", 2000))
        assert asking.read(DB, 2, 2) == struct.pack(">h", 2000)


@pytest.mark.parametrize("protocol", PROTOCOLS[3:])
def test_a_compressed_memory_has_its_blocks_elsewhere(served, protocol):
    plc = served(serve=protocol, faults="t=4 compressed until=8")
    with client(plc, protocol) as asking:
        found = []
        for _ in range(3):
            found.append((asking.function(0x1A, bytes([1, DB]), True)[1:3].hex(), asking.read(DB, 0, LENGTH) == plc.plc.memory.image()))
            plc.release(1)
    assert found == [("100a", True), ("100a", True), ("0e1a", True)]


def test_a_torn_block_has_halves_of_two_scans(served):
    well, torn = served(), served(faults="t=40 torn until=200")
    blocks = []
    for plc in (well, torn):
        with client(plc) as asking:
            plc.release(10)
            rows = []
            for _ in range(20):
                plc.release(1)
                rows.append(asking.read(DB, 0, LENGTH))
            blocks.append(rows)
    half = LENGTH // 2
    for number in range(1, 20):
        assert blocks[1][number][:half] == blocks[0][number][:half]
        assert blocks[1][number][half:] == blocks[0][number - 1][half:]


def test_without_a_heartbeat_the_controller_goes_back_to_automatic(served, by_hand):
    plc = served(by_hand, dead_man=30)
    with client(plc) as asking:
        for beat in range(1, 5):
            asking.write(OWN, 12, struct.pack(">H", beat))
            assert plc.release(29).power_pct == pytest.approx(40.0, abs=0.1), beat
            assert not asking.read(DB, 23, 1)[0] & 1
        told = plc.release(2)
        assert asking.read(DB, 23, 1)[0] & 1
        assert told.status & DEAD_MAN
        asking.write(OWN, 12, struct.pack(">H", 9))
        assert not plc.release(1).status & DEAD_MAN


def test_a_fault_is_there_from_its_begin_to_before_its_end():
    fault = fault_of("t=900  mains=-10   until=1200")
    assert fault == ScheduledFault(name="mains", begins_s=900.0, ends_s=1200.0, value=-10.0)
    assert [fault.at(time) for time in (899.9, 900.0, 1199.9, 1200.0)] == [False, True, True, False]
