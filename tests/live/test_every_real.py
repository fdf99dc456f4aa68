"""Each REAL of a block without a number, infinite, frozen or clamped, for each command: no heater left on, no false DONE or WELL.

Judged by the memory of `tests.live.modbus_device`. Time does not wait here.
"""

import math
import random
import struct
from types import SimpleNamespace

import pytest
from tests.bench import sessions
from tests.conftest import state_with_key
from tests.live.conftest import hasty_clock
from tests.live.modbus_device import Device

from heatertune.errors import HeatertuneError
from heatertune.live import hold
from heatertune.live.client.connection import address_of
from heatertune.live.experiment import AbortLimits, Experiment, Steps
from heatertune.live.write.apply import WriteRequest, apply_write
from heatertune.live.write.plc_block import LinkSettings
from heatertune.live.write.proven_words import Declared, read_proven

#: of a WEG block in the manual's order, bytes
REALS = {"SetPoint": 2, "ManualSetPoint": 6, "Feedback": 12, "MinimumOutput": 16, "MaximumOutput": 20, "Kp": 24, "Ki": 28, "Kd": 32,
         "TauSetPoint": 36, "Output": 48}
BY_HAND, AUTOMATIC = slice(6, 12), struct.pack(">fH", 0.0, 0)
#: what a write cannot see: it reads nothing of the manual value
UNSEEN = {"ManualSetPoint"}


@pytest.fixture(scope="session")
def proven(tmp_path_factory):
    return read_proven(sessions.folder_in(tmp_path_factory.mktemp("reals"), "weg"))


@pytest.fixture(autouse=True)
def own_state(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", state_with_key(tmp_path / "state"))


@pytest.fixture
def device(proven):
    """The proven words with another Kp, in automatic, at rest at 50 °C, with noise."""
    image = bytearray(52)
    words, draw = proven.words.values, random.Random(3)
    for name, at in REALS.items():
        struct.pack_into(">f", image, at, words.get(name, {"SetPoint": 50.0, "Feedback": 50.0, "Output": 31.0}.get(name, 0.0)))
    for name, at in (("Type", 40), ("Action", 42), ("Ts", 44)):
        struct.pack_into(">H", image, at, int(words[name]))
    struct.pack_into(">f", image, REALS["Kp"], 0.9 * words["Kp"])
    with Device(bytes(image)) as here:
        def moving(first, data):
            data = bytearray(data)
            for name, around, by in (("Feedback", 50.0, 0.05), ("Output", 31.0, 0.5)):
                at = REALS[name] - 2 * first
                if 0 <= at <= len(data) - 4:
                    struct.pack_into(">f", data, at, around + draw.uniform(-by, by))
            return bytes(data)

        here.answered = moving
        yield here


def attacked(device, name, value, after):
    """Have reads show a value of a REAL from one of them on; a text: what stood there then, or a limit of what is kept."""
    moving, reads, kept = device.answered, [0], {}

    def answered(first, data):
        reads[0] += 1
        data = moving(first, data)
        at = REALS[name] - 2 * first
        if reads[0] < after or not 0 <= at <= len(data) - 4 or value == "clamped":
            return data
        if value == "frozen":
            return kept.setdefault((first, len(data)), data)
        return data[:at] + struct.pack(">f", value) + data[at + 4:]

    def stored(first, data):
        at = REALS[name] - 2 * first
        if value != "clamped" or not 0 <= at <= len(data) - 4:
            return data
        return data[:at] + struct.pack(">f", min(struct.unpack_from(">f", data, at)[0], 0.5)) + data[at + 4:]

    device.answered, device.stored = answered, stored


VALUES = (math.nan, math.inf, -math.inf, "frozen", "clamped")


def every_real(*reads):
    """Return each REAL with each value from one of some reads on: each two of the three in a run of all tests, all as samples."""
    return pytest.mark.parametrize(("name", "value", "after"), [
        pytest.param(name, value, after, marks=[pytest.mark.sample] * ((row + column - number) % len(reads) != 0))
        for row, name in enumerate(REALS) for column, value in enumerate(VALUES) for number, after in enumerate(reads)])


@pytest.mark.brute
@pytest.mark.long
@every_real(1, 5, 8)
def test_a_write_is_not_done_on_it(proven, device, tmp_path, name, value, after):
    before, words = bytes(device.memory), proven.words.values
    attacked(device, name, value, after)
    address = address_of(f"modbus://127.0.0.1:{device.port}/1/0")
    clock = hasty_clock()
    wanted = WriteRequest(proven_words=proven, address=address, record=tmp_path / "r.jsonl", link=LinkSettings(clock=clock),
                          declared=Declared(called_every_s=proven.words.sample_time_s, range_degC=(0.0, 100.0)))
    try:
        outcome = apply_write(wanted, proven.yes).end.outcome.value
    except HeatertuneError:
        outcome = "refused"
    kp = struct.unpack_from(">f", device.memory, REALS["Kp"])[0]
    if outcome == "done":
        assert name in UNSEEN or (value == "clamped" and name != "Kp"), name
        assert kp == pytest.approx(words["Kp"])
    if outcome in ("not done", "rolled back", "refused"):
        assert bytes(device.memory)[24:28] == before[24:28]
    if outcome == "done, not watched":
        assert kp == pytest.approx(words["Kp"])


@pytest.mark.brute
@pytest.mark.long
@every_real(4, 9, 12)
def test_an_experiment_leaves_no_heater_on(proven, device, tmp_path, monkeypatch, name, value, after):
    clock = hasty_clock()
    monkeypatch.setattr(hold, "HOST", clock)
    for module in ("recorder", "poller"):
        monkeypatch.setattr(f"heatertune.live.{module}.time", SimpleNamespace(monotonic=clock.now_s, sleep=clock.sleep))
    struct.pack_into(">f", device.memory, REALS["Kp"], proven.words.values["Kp"])
    attacked(device, name, value, after)
    address = address_of(f"modbus://127.0.0.1:{device.port}/1/0")
    plan = Steps(steps=((0.0, 90.0), (1.0, 70.0), (3.0, 20.0)))
    whole = Experiment(plan, address, proven.words, AbortLimits(temperature_degC=80.0), timeout_s=0.5)
    whole.check()
    try:
        ended = whole.run(tmp_path / "log.csv")
    except HeatertuneError:
        assert not device.writes
        return
    assert bytes(device.memory[BY_HAND]) == AUTOMATIC
    if ended.restored:
        assert not whole.hold.path.exists()
    else:  # a read that shows another manual value for ever: nobody can see that it is back
        assert ended.restored is None
        assert name == "ManualSetPoint" or value == "frozen"
        assert whole.hold.way_back() is not None
    if name == "Feedback" and isinstance(value, float):
        assert ended.reason == "sensor"
