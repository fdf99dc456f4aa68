"""The hold on a PLC: nothing that was sent is forgotten, and what stood there stands there again, read later than anything can arrive.

The time is the test's own. What stands in the PLC is read from the memory of `tests.live.modbus_device`, which shares nothing with heatertune.
"""

import struct
from types import SimpleNamespace

import pytest
from tests.conftest import state_with_key
from tests.live.conftest import hasty_clock, words_of
from tests.live.modbus_device import Device

from heatertune.errors import InputError, LinkError, PlcRefused, ReplyLost
from heatertune.live import hold as module
from heatertune.live.client.connection import address_of, connect
from heatertune.live.controller_block import block_for, places_of
from heatertune.live.experiment import AbortLimits, Experiment, ExperimentObserver, Steps, restore
from heatertune.live.hold import Clock, Hold, WayBackPart, new_way_back
from heatertune.live.poller import Poller
from heatertune.live.write.band import Reach
from heatertune.live.write.plc_block import LinkSettings, Peer, block_image
from heatertune.live.write.write_record import Budget, WriteRecord
from heatertune.live.write.writer import WriteOutcome, Writer
from heatertune.plc import controller_for

#: of a WEG block in the manual's order: ManualSetPoint and SelectSetPoint, Feedback
BY_HAND, FEEDBACK = slice(6, 12), 12
AUTOMATIC = struct.pack(">fH", 0.0, 0)
PLAN = Steps(steps=((0.0, 0.0), (0.2, 90.0), (600.0, 20.0)))


@pytest.fixture(autouse=True)
def own_state(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", state_with_key(tmp_path / "state"))


@pytest.fixture
def weg():
    """A WEG block in automatic at 40 °C, whose reading moves."""
    image = bytearray(block_for(controller_for("weg"), words_of("weg"), {}).image())
    image[2:6], image[BY_HAND] = struct.pack(">f", 40.0), AUTOMATIC
    with Device(bytes(image) + bytes(300)) as device:
        def moving(first, data):
            at = FEEDBACK - 2 * first
            if not 0 <= at <= len(data) - 4:
                return data
            return data[:at] + struct.pack(">f", 40.0 + 0.3 * (device.reads % 5)) + data[at + 4:]

        device.answered = moving
        yield device


def address(device, more=""):
    return address_of(f"modbus://127.0.0.1:{device.port}/1/0{more}")


def way_back(device):
    part = WayBackPart(BY_HAND.start, AUTOMATIC, {struct.pack(">fH", 90.0, 1)})
    return new_way_back("experiment", address(device), 1, [part], "log.csv", 90.0)


class Answers:
    """A request that ends as it is told to."""

    def __init__(self, problem=None):
        self.problem = problem

    def __call__(self):
        if self.problem is not None:
            raise self.problem("no")


def test_what_is_sent_may_arrive_until_it_is_seen_or_can_arrive_no_longer(weg):
    now = [1000.0]
    held = Hold(address(weg), Clock(lambda: now[0], lambda _: None))
    held.open(way_back(weg))
    assert held.left_s == 0.0
    held.note_request()
    held.send(Answers())
    now[0] += 10.0
    assert held.left_s == module.LATE_S - 10.0  # answered, and not seen
    held.note_stored()
    assert held.left_s == 0.0
    held.note_request()
    with pytest.raises(ReplyLost):
        held.send(Answers(ReplyLost))
    held.note_request()
    with pytest.raises(PlcRefused):
        held.send(Answers(PlcRefused))
    now[0] += 1.0
    assert held.left_s == module.LATE_S - 1.0  # of the one without an answer: a later one that was refused changes nothing
    held.note_stored()
    assert held.left_s == module.LATE_S - 1.0
    other = Hold(address(weg), held.clock)
    assert other.stored_left_s == module.LATE_S - 1.0
    held.close()
    assert held.path.exists()  # something may arrive
    assert other.message() == ""
    with pytest.raises(InputError, match="again in 59 s"):
        other.demand_free()
    now[0] = 10.0  # the machine was rebooted: 10 s at least have passed
    assert other.stored_left_s == module.LATE_S - 10.0
    now[0] = 2000.0
    assert other.demand_free() is None


@pytest.mark.parametrize("stage", ["opened", "noted", "sent", "answered"])
def test_a_program_that_died_at_any_step_leaves_what_brings_it_back(weg, stage, monkeypatch):
    monkeypatch.setattr(module, "HOST", hasty_clock())
    died = Hold(address(weg))
    died.open(way_back(weg))
    if stage != "opened":
        died.note_request()
    if stage in ("sent", "answered"):
        weg.memory[BY_HAND] = struct.pack(">fH", 90.0, 1)
    if stage == "answered":
        died.note_answer()
    with pytest.raises(InputError, match=r"an experiment begun .* has not ended: the controller may be in manual at up to 90 %") as told:
        Hold(address(weg)).demand_free()
    assert f"heatertune experiment --restore {address(weg).text}" in str(told.value)
    assert restore(address(weg)) is True
    assert weg.memory[BY_HAND] == AUTOMATIC
    assert not died.path.exists()


def test_the_way_back_is_looked_at_after_the_last_instant_at_which_something_can_arrive(weg):
    """The put comes at every instant until then, and once after the way back was written."""
    for comes_s in (0.5, 30.0, 58.0):
        clock = hasty_clock()
        held = Hold(address(weg), clock)
        held.open(way_back(weg))
        held.note_request()
        due, begun_s = [comes_s], clock.now_s()

        def late(request, due=due, begun_s=begun_s, clock=clock):
            if due and clock.now_s() - begun_s >= due[0]:
                due.clear()
                weg.memory[BY_HAND] = struct.pack(">fH", 90.0, 1)
            return request

        held.clock = Clock(clock.now_s, lambda seconds, clock=clock, late=late: (clock.sleep(seconds), late(None)))
        assert held.bring_back(0.5) is True
        assert clock.now_s() - begun_s >= module.LATE_S
        assert not due
        assert weg.memory[BY_HAND] == AUTOMATIC
        assert not held.path.exists()


def run(weg, tmp_path, plan=PLAN, limits=None, more="", **observed):
    """Run an experiment on time that does not wait; return its end."""
    limits = limits or AbortLimits(temperature_degC=80.0)
    whole = Experiment(plan, address(weg, more), words_of("weg"), limits, timeout_s=0.5)
    whole.hold.clock = hasty_clock()
    whole.check()
    return whole.run(tmp_path / "log.csv", watching=ExperimentObserver(**observed)), whole


@pytest.mark.long
@pytest.mark.parametrize("kind", ["half", "clamped", "ignored"])
def test_a_power_that_the_device_keeps_otherwise_is_ours_and_is_taken_back(weg, tmp_path, kind):
    def stored(first, data):
        old = bytes(weg.memory[2 * first:2 * first + len(data)])
        mode = first <= BY_HAND.start // 2 and len(data) == 6
        if not mode or data == AUTOMATIC:
            return data
        if kind == "half":
            return data[:3] + old[3:]
        return old if kind == "ignored" else struct.pack(">fH", min(struct.unpack(">f", data[:4])[0], 60.0), 1)

    weg.stored = stored
    ended, whole = run(weg, tmp_path, Steps(steps=((0.0, 90.0), (600.0, 20.0))))
    assert ended.reason == "hand"
    assert ("does not stand there" if kind == "ignored" else "keeps other values") in ended.message
    assert ended.restored is True
    assert weg.memory[BY_HAND] == AUTOMATIC
    assert not whole.hold.path.exists()


@pytest.mark.long
def test_a_machine_that_slept_ends_it(weg, tmp_path):
    def sleeps(so_far, _):
        if so_far.rows == 2:
            whole[0].hold.clock.sleep(30.0)

    whole = []
    limits = AbortLimits(temperature_degC=80.0)
    experiment = Experiment(Steps(steps=((0.0, 90.0), (600.0, 20.0))), address(weg), words_of("weg"), limits, timeout_s=0.5)
    experiment.hold.clock = hasty_clock()
    whole.append(experiment)
    experiment.check()
    ended = experiment.run(tmp_path / "log.csv", watching=ExperimentObserver(on_row=sleeps))
    assert ended.reason == "silence"
    assert "this machine was asleep" in ended.message
    assert weg.memory[BY_HAND] == AUTOMATIC


def test_a_fault_of_the_program_gives_the_controller_back(weg, tmp_path):
    def breaks(*_):
        raise ZeroDivisionError

    whole = Experiment(Steps(steps=((0.0, 90.0), (600.0, 20.0))), address(weg), words_of("weg"), AbortLimits(temperature_degC=80.0),
                       timeout_s=0.5)
    whole.hold.clock = hasty_clock()
    whole.check()
    with pytest.raises(ZeroDivisionError):
        whole.run(tmp_path / "log.csv", watching=ExperimentObserver(on_row=breaks))
    assert weg.memory[BY_HAND] == AUTOMATIC
    assert not whole.hold.path.exists()


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf"), 150.0, -5.0])
@pytest.mark.long
def test_a_reading_that_is_none_ends_it(weg, tmp_path, value):
    moving, number = weg.answered, [0]

    def bad(first, data):
        number[0] += len(data) > 8
        data = moving(first, data)
        at = FEEDBACK - 2 * first
        if number[0] < 6 or not 0 <= at <= len(data) - 4:
            return data
        return data[:at] + struct.pack(">f", value) + data[at + 4:]

    weg.answered = bad
    ended, _ = run(weg, tmp_path, Steps(steps=((0.0, 90.0), (600.0, 20.0))))
    assert ended.reason == "sensor", ended
    assert weg.memory[BY_HAND] == AUTOMATIC


HEARTBEAT = 100  # register


def beats(device, to=10 ** 9):
    moving, number = device.answered, [0]

    def answered(first, data):
        if first == HEARTBEAT:
            number[0] = min(number[0] + 1, to)
            return struct.pack(">H", number[0])
        return moving(first, data)

    device.answered = answered


def test_a_heartbeat_that_stands_still_is_no_new_reading(weg):
    beats(weg, to=3)
    with Poller(address(weg, f"?heartbeat={HEARTBEAT}"), places_of(words_of("weg")), 0.5) as looking:
        assert [looking.look() is not None for _ in range(5)] == [True, True, True, False, False]
        assert looking.tells_new


@pytest.mark.long
def test_a_program_that_stands_ends_an_experiment(weg, tmp_path):
    beats(weg, to=5)
    limits = AbortLimits(temperature_degC=80.0, silence_s=3.0)
    whole = Experiment(Steps(steps=((0.0, 90.0), (600.0, 20.0))), address(weg, f"?heartbeat={HEARTBEAT}"), words_of("weg"), limits,
                       timeout_s=0.5)
    whole.check()
    ended = whole.run(tmp_path / "log.csv")
    assert ended.reason == "silence"
    assert weg.memory[BY_HAND] == AUTOMATIC


def test_a_heartbeat_that_is_none_is_told(weg):
    with pytest.raises(InputError, match="heartbeat '70000' is no whole number"):
        address(weg, "?heartbeat=70000")
    with connect(address(weg, "?heartbeat=9999"), 0.5) as client, pytest.raises(LinkError):
        client.sign_of_life()


def test_an_s7_cpu_in_stop_is_seen_by_its_system_status_list(served):
    plc = served()
    plc.release(1)
    with connect(address_of(plc.urls["s7"])) as client:
        assert client.sign_of_life().runs is True
        plc.plc.stop_cpu(True)
        assert client.sign_of_life().runs is False
        client._library.read_szl = lambda *_: SimpleNamespace(Header=SimpleNamespace(LengthDR=0), Data=b"")
        assert client.sign_of_life().runs is None  # it tells nothing


@pytest.mark.long
def test_an_opcua_block_has_the_time_of_its_source(served):
    pytest.importorskip("asyncua")
    plc = served(serve="opcua")
    plc.release(1)
    with connect(address_of(plc.urls["opcua"])) as client:
        client.read(30, 0, 4)
        first = client.sign_of_life()
        client.read(30, 0, 4)
        assert client.sign_of_life().is_new(first) is False
        plc.release(1)
        client.read(30, 0, 4)
        assert client.sign_of_life().is_new(first) is True


@pytest.mark.parametrize("second", ["experiment", "restore"])
@pytest.mark.parametrize("first", ["experiment", "write", "rollback"])
def test_two_commands_at_once_are_refused_before_the_first_byte(weg, tmp_path, first, second):
    """That two writes, and a rollback beside a write, are refused is seen in `test_write`."""
    with Hold(address(weg)).lock(first), pytest.raises(InputError, match=f"another command works on this PLC .*heatertune {first}"):
        restore(address(weg)) if second == "restore" else run(weg, tmp_path)
    assert weg.writes == []


@pytest.mark.parametrize("kind", ["write", "rollback"])
def test_what_a_dead_write_left_is_named_with_its_record_or_brought_back_without_one(weg, tmp_path, kind, monkeypatch):
    monkeypatch.setattr(module, "HOST", hasty_clock())
    record, died = tmp_path / "r.jsonl", Hold(address(weg))
    record.write_text("")
    part = WayBackPart(24, bytes(weg.memory[24:28]), {struct.pack(">f", 9.0)})
    died.open(new_way_back(kind, address(weg), 1, [part], record))
    weg.memory[24:28] = struct.pack(">f", 9.0)
    assert f"a {kind} begun" in died.message()
    assert died.message().endswith(f"heatertune rollback {record}")
    with pytest.raises(InputError, match="heatertune rollback"):
        restore(address(weg))
    record.unlink()
    assert died.message().endswith(f"heatertune experiment --restore {address(weg).text}")
    assert restore(address(weg)) is True
    assert bytes(weg.memory[24:28]) == part.before


def test_words_on_both_sides_of_one_that_somebody_has_changed_go_back_one_by_one_each_after_a_look(weg, tmp_path):
    """Kp, Ki and Kd went in one request; Ki is somebody's since, and Kd becomes so while Kp goes back (session 176 of seed 17)."""
    places = {"Kp": 24, "Ki": 28, "Kd": 32}  # bytes of the manual's order, a REAL each
    words, clock, where = words_of("weg"), hasty_clock(), address(weg)
    image = block_image(words, where, {})
    before = dict.fromkeys(places, 1.0)
    with Peer(where, image, words.sample_time_s, LinkSettings(clock=clock)) as peer, WriteRecord(tmp_path / "r.jsonl") as record:
        for at in places.values():
            weg.memory[at:at + 4] = struct.pack(">f", 1.0)
        content = peer.look().content
        after = image.values(content) | dict.fromkeys(places, 2.0)
        part, = image.parts(content, after)
        assert (part.names, part.start) == (tuple(places), 24)
        weg.memory[24:36] = part.after
        weg.memory[28:32] = struct.pack(">f", 77.0)
        looks = []

        def stored(first, data):
            looks.append(weg.reads)
            weg.memory[32:36] = struct.pack(">f", 88.0)
            return data

        weg.stored = stored
        hold = Hold(where, clock)
        hold.open(new_way_back("write", where, 1, [WayBackPart(part.start, part.before, {part.after})], "r.jsonl"))
        ended = Writer(peer, hold, record, Budget(where, 1)).restore([part], {**after, **before}, after, "asked for")
    assert struct.unpack_from(">3f", weg.memory, 24) == (1.0, 77.0, 88.0)
    assert [(2 * first, len(data)) for first, data in weg.writes] == [(24, 4)]
    assert ended.outcome is WriteOutcome.ROLLED_BACK
    assert "somebody has changed the words: Ki is 77, not 1, Kd is 88, not 1" in ended.message


def test_a_rise_that_no_plausible_heater_makes_ends_an_experiment_and_its_writes_are_counted(weg, heater, tmp_path):
    """At full power twice the heater rises by 2 · 0.9 · 121 / 167 = 1.3 °C/s at most; here by more at some looks a second."""
    reads = []

    def rising(first, data):
        at = FEEDBACK - 2 * first
        if not 0 <= at <= len(data) - 4:
            return data
        reads.append(1)
        return data[:at] + struct.pack(">f", min(40.0 + 0.2 * len(reads) ** 1.5, 79.0)) + data[at + 4:]

    weg.answered = rising
    limits = AbortLimits(temperature_degC=80.0)
    whole = Experiment(PLAN, address(weg), words_of("weg"), limits, timeout_s=0.5, reach=Reach(words_of("weg"), heater, 0.0))
    ended = whole.run(tmp_path / "log.csv")
    assert (ended.reason, ended.restored) == ("rate", True)
    assert "2 times as fast as the fastest plausible heater, at full power" in ended.message
    assert weg.memory[BY_HAND] == AUTOMATIC
    assert whole.budget.counts()["manual"] >= 1
    del reads[:]
    assert any("manual was written" in found for found in whole.check())
