"""The recorder: its rows are the scans of the proof's own simulation; kills, lost links and full disks lose nothing else.

What the rows should be comes from `heatertune.simulate`, which runs the compiled loop and knows of no network.
"""

import errno
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from tests.bench.kills import of_record
from tests.live.conftest import CONDITIONS, PROTOCOLS
from tests.live.test_client import way
from tests.live.test_served import _quiet

from heatertune import InputError, read_log
from heatertune.cli import main
from heatertune.errors import LinkDown, OutOfRange, PlcRefused
from heatertune.live.block_memory import BlockSignal
from heatertune.live.client.connection import address_of
from heatertune.live.controller_block import Counter, Places, places_of
from heatertune.live.poller import Poller
from heatertune.live.recorder import RecordingSetup, record
from heatertune.live.simulator_status import OWN
from heatertune.log.cells import TORN, read_sheet

#: those that can be read within a scan of the fast ones here
QUICK = PROTOCOLS[:2]
#: a scan in two milliseconds, some of which a client misses, and as fast as it goes, of which it sees a few
FAST = {"step": False, "rate": 2000.0}
SLOW = {"step": False, "rate": 1000.0}  # a busy machine still looks often enough
MAX = {"step": False, "rate": float("inf")}


@pytest.fixture
def places(words):
    return places_of(words)


def rows_of(path):
    lines = path.read_text().splitlines()
    assert lines[0].startswith("# heatertune record; ")
    return np.array([[float(cell) for cell in line.split(",")] for line in lines if line[0].isdigit() and not line.endswith(TORN)])


class Until:
    """Enough after so many looks, or when the virtual PLC has ended and was looked at again."""

    def __init__(self, plc):
        self.plc, self.more = plc, 3

    def __call__(self):
        self.more -= self.plc.plc.ended
        return self.more < 0


@pytest.mark.long
@pytest.mark.parametrize("pace", [SLOW, MAX], ids=["slow", "max"])
@pytest.mark.parametrize("protocol", QUICK)
def test_each_row_is_a_scan_of_the_simulation(served, heater, words, places, tmp_path, protocol, pace):
    noisy = replace(CONDITIONS, noise_degC=0.3)
    plc = served(conditions=noisy, serve=protocol, intervals=1500, **pace)
    told = record(way(plc, protocol), tmp_path / "log.csv", places, ended=Until(plc))
    rows = rows_of(tmp_path / "log.csv")
    assert told.rows == len(rows) > (10 if pace is SLOW else 0)
    trace = _quiet(heater, words, 1500, noise=0.3)
    scans = np.rint(rows[:, 0] / plc.scan_s).astype(int)
    np.testing.assert_allclose(rows[:, 0], scans * plc.scan_s, rtol=1e-8)
    np.testing.assert_allclose(rows[:, 1], trace.reading_degC[scans], rtol=1e-6)
    limited = np.clip(trace.power_asked_pct[scans], 0.0, 100.0)
    np.testing.assert_allclose(rows[:, 2], limited, atol=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("protocol", PROTOCOLS[2:])
def test_each_row_of_a_slower_protocol_is_a_scan_of_the_simulation(served, heater, words, places, tmp_path, protocol):
    plc = served(serve=protocol, intervals=60, step=False, rate=40.0)  # a scan in 100 milliseconds
    record(way(plc, protocol), tmp_path / "log.csv", places, RecordingSetup(timeout_s=10.0), ended=Until(plc))
    rows = rows_of(tmp_path / "log.csv")
    assert len(rows) > 10
    head = (tmp_path / "log.csv").read_text().splitlines()[0]
    assert head.endswith("a row may hold quantities of two scans") == (protocol == "as511")
    trace = _quiet(heater, words, 60)
    scans = np.rint(rows[:, 0] / plc.scan_s).astype(int)
    np.testing.assert_allclose(rows[:, 1], trace.reading_degC[scans], rtol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("protocol", PROTOCOLS[2:])
def test_a_link_of_a_slower_protocol_that_is_cut_is_a_marked_gap_and_the_log_goes_on(served, places, tmp_path, protocol):
    plc = served(serve=protocol, faults="t=80 cut until=160", intervals=80, step=False, rate=80.0)
    told = record(way(plc, protocol), tmp_path / "log.csv", places, RecordingSetup(timeout_s=1.0), ended=Until(plc))
    rows = rows_of(tmp_path / "log.csv")
    assert told.gaps >= 1
    assert not np.any((rows[:, 0] > 90.0) & (rows[:, 0] < 150.0))
    assert rows[0, 0] < 80.0
    assert rows[-1, 0] > 160.0


@pytest.mark.long
def test_without_places_a_simulated_plc_tells_itself(served, tmp_path):
    plc = served(intervals=600, **SLOW)
    record(way(plc, "s7"), tmp_path / "log.csv", ended=Until(plc))
    log = read_log(tmp_path / "log.csv")
    assert log.setpoint_degC is None
    assert log.temperature_degC[-1] == pytest.approx(50.0, abs=0.5)


def test_a_real_plc_needs_places(served, monkeypatch, tmp_path):
    plc = served()
    plc.plc.memory.write(OWN, 48, b"NONE")
    monkeypatch.setattr(plc.plc.memory, "tell", lambda *_: None)
    with pytest.raises(InputError, match=r"--design DIR .* or --map FILE"):
        record(way(plc, "s7"), tmp_path / "log.csv")
    assert not (tmp_path / "log.csv").exists()


def test_without_a_number_of_a_block_it_is_asked_for(served, places, tmp_path):
    plc = served()
    host, port = plc.addresses["s7"]
    with pytest.raises(InputError, match="which block"):
        record(address_of(f"s7://{host}:{port}/0/2"), tmp_path / "log.csv", replace(places, block=None))


def test_places_too_far_apart_for_one_request_are_told(served, tmp_path):
    far = Places(block=30, signals={"temperature": BlockSignal(0, "INT"), "power": BlockSignal(300, "INT")}, summary="far.toml")
    plc = served()
    with pytest.raises(InputError, match=r"far.toml: 302 bytes .* one request reads 212"):
        record(way(plc, "s7"), tmp_path / "log.csv", far)


def test_this_machines_clock_where_nothing_counts(served, monkeypatch, places, tmp_path):
    """A real PLC: no block of the simulator's, no counter; 1 s apart by this machine's clock, which the test turns."""
    plc, now = served(), [0.0]
    plc.release(5)
    plc.plc.memory.write(OWN, 48, b"NONE")

    def slept(seconds):
        now[0] += max(seconds, 0.01)

    monkeypatch.setattr("time.monotonic", lambda: now[0])
    monkeypatch.setattr("time.sleep", slept)
    told = record(way(plc, "s7"), tmp_path / "log.csv", places, RecordingSetup(for_s=20.0))
    rows = rows_of(tmp_path / "log.csv")
    assert told.interval_s is None
    assert "time: this machine's clock" in (tmp_path / "log.csv").read_text().splitlines()[0]
    assert np.all(np.diff(rows[:, 0]) >= 1.0 - 1e-6)
    assert np.all(np.diff(rows[:, 0]) < 1.5)
    assert rows[-1, 0] - rows[0, 0] >= 20.0 - 1e-6


def test_a_counter_of_the_program_is_the_clock_and_wraps(monkeypatch, tmp_path):
    """16 bits that turn, one look that finds nothing new, and a PLC that begins anew."""
    counts = [65533, 65535, 65535, 3, 4, 0, 1]
    places = Places(block=5, signals={"temperature": BlockSignal(2, "INT")}, counter=Counter(signal=BlockSignal(0, "UINT"), interval_s=0.5))

    class Fake:
        most, whole = 200, True

        def read(self, number, start, count):
            if number == OWN:
                raise PlcRefused("no such block")
            assert (number, start, count) == (5, 0, 4)
            return counts.pop(0).to_bytes(2, "big") + (20).to_bytes(2, "big")

        def close(self):
            pass

    monkeypatch.setattr("heatertune.live.poller.connect", lambda *_: Fake())
    record(address_of("s7://10.0.0.1/0/2/db5"), tmp_path / "log.csv", places, ended=lambda: not counts)
    text = (tmp_path / "log.csv").read_text()
    assert rows_of(tmp_path / "log.csv")[:, 0].tolist() == [0.0, 1.0, 3.0, 3.5, 4.0, 4.5]
    assert re.findall(r"# gap before (\S+) s: the PLC has restarted its count; the length of the gap is not known", text) == ["4"]


def test_a_small_counter_that_turned_while_nobody_looked_is_as_far_as_this_machines_clock_says(monkeypatch):
    """A byte, each 0.5 s: 129 s after 10 it shows 12 again, which is 258 scans and not 2."""
    now, counts = [0.0], [10, 11, 12]

    class Fake:
        most, whole = 200, True

        def read(self, number, *_):
            if number == OWN:
                raise PlcRefused("no such block")
            return counts.pop(0).to_bytes(1, "big") + (20).to_bytes(2, "big")

        def close(self):
            pass

    monkeypatch.setattr("time.monotonic", lambda: now[0])
    monkeypatch.setattr("heatertune.live.poller.connect", lambda *_: Fake())
    places = Places(block=5, signals={"temperature": BlockSignal(1, "INT")}, counter=Counter(signal=BlockSignal(0, "BYTE"), interval_s=0.5))
    looking, times = Poller(address_of("s7://10.0.0.1/0/2/db5"), places), []
    for at in (0.2, 0.9, 129.4):
        now[0] = at
        times.append(looking.look().time_s)
    assert times == [0.0, 0.5, 129.0]


def test_a_simulator_that_tells_no_scans_any_more_is_a_lost_link_and_no_other_clock(served, places):
    plc = served()
    plc.release(3)
    with Poller(way(plc, "s7"), places) as looking:
        assert looking.look().time_s == 2.0 * plc.scan_s
        plc.plc.memory.write(OWN, 48, b"NONE")
        with pytest.raises(LinkDown, match="no longer tells its scans"):
            looking.look()


@pytest.mark.long
@pytest.mark.parametrize("protocol", QUICK)
@pytest.mark.parametrize("fault", ["cut", "lost-reply", "black-hole"])
def test_a_lost_link_is_a_marked_gap_and_the_log_goes_on(served, places, tmp_path, protocol, fault):
    plc = served(serve=protocol, faults=f"t=1200 {fault} until=2400", intervals=1200, **SLOW)
    told = record(way(plc, protocol), tmp_path / "log.csv", places, RecordingSetup(timeout_s=0.6), ended=Until(plc))
    text, rows = (tmp_path / "log.csv").read_text(), rows_of(tmp_path / "log.csv")
    gaps = re.findall(r"# gap before (\S+) s: (.*)", text)
    assert told.gaps == len(gaps) >= 1
    marked = [float(at) for at, why in gaps if "no answer" in why or "connection" in why]
    assert any(at > 2390.0 for at in marked)
    assert not np.any((rows[:, 0] > 1250.0) & (rows[:, 0] < 2390.0))
    assert rows[-1, 0] > 2400.0
    log = read_log(tmp_path / "log.csv")
    assert any(f"The recording marks {len(gaps)} gap" in repair for repair in log.repairs)
    assert any("gap" in doubt for doubt in log.warnings)


@pytest.mark.long
def test_in_stop_there_are_no_rows(served, places, tmp_path):
    plc = served(faults="t=1000 cpu-stop until=2000", intervals=1000, **FAST)
    record(way(plc, "s7"), tmp_path / "log.csv", places, ended=Until(plc))
    rows = rows_of(tmp_path / "log.csv")
    assert not np.any((rows[:, 0] > 1010.0) & (rows[:, 0] < 1990.0))
    assert "# gap before" in (tmp_path / "log.csv").read_text()


def test_every_is_the_least_time_between_rows(served, places, tmp_path):
    plc = served(intervals=900, **FAST)
    record(way(plc, "s7"), tmp_path / "log.csv", places, RecordingSetup(every_s=60.0), ended=Until(plc))
    assert np.diff(rows_of(tmp_path / "log.csv")[:, 0]).min() >= 60.0 - 1e-6


def test_a_log_that_is_there_is_not_touched(served, places, tmp_path):
    plc = served()
    (tmp_path / "log.csv").write_text("mine")
    with pytest.raises(InputError, match="--append continues it"):
        record(way(plc, "s7"), tmp_path / "log.csv", places)
    with pytest.raises(InputError, match="was not begun by heatertune record"):
        record(way(plc, "s7"), tmp_path / "log.csv", places, RecordingSetup(append=True))
    assert (tmp_path / "log.csv").read_text() == "mine"


@pytest.mark.long
def test_a_torn_log_is_read_without_its_torn_line_and_continued(served, places, tmp_path):
    """Cut after each of its last bytes, as a kill does it; some of these logs are continued, too."""
    plc, path = served(intervals=1000, **FAST), tmp_path / "log.csv"
    record(way(plc, "s7"), path, places, RecordingSetup(for_s=300.0), ended=Until(plc))
    whole = path.read_bytes()
    heads = whole.index(b"\n", whole.index(b"\n") + 1)
    for cut in [*range(min(80, len(whole) // 2)), len(whole) - heads, len(whole) - heads + 3]:
        left = whole[:len(whole) - cut]
        path.write_bytes(left)
        last = left.decode().split("\n")[-1]
        begun = len(left) > heads + 1  # else there is nothing to be read yet
        assert not begun or _read(path).endswith(f"{last!r}.") == bool(last)
        if cut % 8 == 3 or not begun:
            record(way(plc, "s7"), path, places, RecordingSetup(append=True), ended=Until(plc))
            assert path.read_bytes().startswith(left)  # appended only
            assert (last + "#torn\n" in path.read_text()) == bool(last)
            _read(path)


def _read(path):
    """Return what is said of a torn line; the log has each whole row, and no other."""
    sheet = read_sheet(path)
    assert [sheet.row(k) for k in range(len(sheet))] == [line.split(",") for line in whole_rows(path)]
    return next((repair for repair in sheet.repairs if "was torn" in repair), "")


def whole_rows(path):
    return [line for line in path.read_text().split("\n")[:-1] if line[:1].isdigit() and not line.endswith("#torn")]


def test_a_log_whose_last_row_is_damaged_is_not_continued(served, places, tmp_path):
    plc, path = served(intervals=300, **FAST), tmp_path / "log.csv"
    record(way(plc, "s7"), path, places, ended=Until(plc))
    path.write_text(damaged := path.read_text() + "oh,1,2,3\n")
    with pytest.raises(InputError, match="ends in 'oh,1,2,3'; expected a row"):
        record(way(plc, "s7"), path, places, RecordingSetup(append=True))
    assert path.read_text() == damaged


def test_other_columns_are_not_mixed_in(served, places, tmp_path):
    plc = served(intervals=300, **FAST)
    record(way(plc, "s7"), tmp_path / "log.csv", places, ended=Until(plc))
    with pytest.raises(InputError, match="has the columns time_s,temperature_degC,power_pct,setpoint_degC; now they would be"):
        record(way(plc, "s7"), tmp_path / "log.csv", None, RecordingSetup(append=True))


def test_a_full_disk_is_told_and_what_is_there_stays(served, places, monkeypatch, tmp_path):
    plc, write, left = served(intervals=1200, **FAST), os.write, [700]

    def filling(number, content):
        if not left[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        taken = bytes(content)[:left[0]]
        left[0] -= len(taken)
        return write(number, taken)

    monkeypatch.setattr("heatertune.live.recorder.os.write", filling)
    with pytest.raises(InputError, match="No space left on device; what is there stays"):
        record(way(plc, "s7"), tmp_path / "log.csv", places, ended=Until(plc))
    content = (tmp_path / "log.csv").read_bytes()
    assert len(content) == 700
    assert content.endswith(b"\n") or "was torn" in _read(tmp_path / "log.csv")


def _moved(path):
    path.rename(path.with_name("moved.csv"))


def _saved_by_an_editor(path):
    """As editors do that write beside and rename: another file with what was there when it was opened."""
    beside = path.with_name("beside")
    beside.write_text("".join(path.read_text().splitlines(keepends=True)[:6]))
    beside.replace(path)


def _rotated(path):
    path.rename(path.with_name("moved.csv"))
    path.write_text("")


def _cut(path):
    path.write_bytes(path.read_bytes()[:-3])


CHANGES = {"removed or moved": [lambda path: path.unlink(), _moved], "replaced by another file": [_saved_by_an_editor, _rotated],
           "emptied or cut": [lambda path: path.write_text(""), _cut]}


@pytest.mark.long
@pytest.mark.parametrize(("what", "change"), [(what, change) for what, changes in CHANGES.items() for change in changes])
def test_a_log_that_others_change_goes_on_in_the_file_of_its_name(served, places, tmp_path, what, change):
    plc, path, changed_at, seen = served(intervals=1200, **FAST), tmp_path / "log.csv", [], []

    def shown(so_far):
        if so_far.rows > 20 and not changed_at:
            changed_at.append(so_far.last.time_s)
            change(path)
        if so_far.last is not None and so_far.last.time_s not in seen:
            seen.append(so_far.last.time_s)

    recorded = record(way(plc, "s7"), path, places, shown=shown, ended=Until(plc))
    rows = rows_of(path)
    after = [float(f"{at:.9g}") for at in seen if at > changed_at[0]]
    assert len(after) > 20
    assert list(rows[rows[:, 0] > changed_at[0], 0]) == after  # none of them is lost
    assert list(rows[:, 0]) == sorted(set(rows[:, 0]))
    log = read_log(path)  # leaves out rows that a busy machine left far from all others, and says how many
    assert len(log.time_s) == len(rows) - sum(int(each.split()[0]) for each in log.repairs if "far from all others, left out" in each)
    assert [what in note for note in recorded.notes] == [True]
    if (moved := path.with_name("moved.csv")).exists():
        assert {*rows_of(moved)[:, 0], *rows[:, 0]} == {float(f"{at:.9g}") for at in seen}


@pytest.mark.long
def test_a_log_that_is_changed_again_and_again_goes_on(served, places, tmp_path):
    plc, path, seen = served(intervals=1200, **FAST), tmp_path / "log.csv", set()
    chance, changes = random.Random(4), [each for some in CHANGES.values() for each in some]

    def shown(so_far):
        if so_far.last is not None:
            seen.add(so_far.last.time_s)
            if chance.random() < 0.02 and path.exists() and path.stat().st_size > 400:  # not in its first line
                chance.choice(changes)(path)

    recorded = record(way(plc, "s7"), path, places, shown=shown, ended=Until(plc))
    assert len(recorded.notes) > 3
    if "before the recording ended" not in recorded.notes[-1]:  # else what is left was changed after the last row
        assert {float(f"{at:.9g}") for at in seen} >= set(rows_of(path)[:, 0])


@pytest.mark.parametrize(("what", "change"), [(what, change) for what, changes in CHANGES.items() for change in changes])
def test_a_log_that_others_change_after_its_last_row_is_told(served, places, tmp_path, what, change):
    plc, path, changed = served(intervals=2000, **SLOW), tmp_path / "log.csv", []

    def shown(so_far):
        if so_far.rows >= 20:
            change(path)
            changed.append(path)

    recorded = record(way(plc, "s7"), path, places, shown=shown, ended=lambda: bool(changed))
    assert len(recorded.notes) == 1
    assert recorded.notes[0].startswith(f"{path}: was ")
    assert what in recorded.notes[0]
    assert recorded.notes[0].endswith(" before the recording ended")


def test_a_comment_that_somebody_adds_stays_and_rows_of_another_recorder_end_it(served, places, tmp_path):
    plc, path = served(intervals=2000, **SLOW), tmp_path / "log.csv"

    def add(text, at):
        def shown(so_far):
            if so_far.rows == at:
                with path.open("a") as file:
                    file.write(text)
        return shown

    recorded = record(way(plc, "s7"), path, places, RecordingSetup(for_s=4000.0), shown=add("# door opened\n", 20))
    assert not recorded.notes
    assert "# door opened\n" in path.read_text()
    assert len(read_log(path).time_s) == recorded.rows
    other = tmp_path / "other.csv"
    path = other
    with pytest.raises(InputError, match="another program writes rows into it"):
        record(way(plc, "s7"), other, places, shown=add("1e6,50,0,50\n", 20), ended=Until(plc))


def test_readings_that_a_recorder_missed_are_not_put_back_as_if_nothing_had_changed(tmp_path):
    """At rest each reading differs by one count of the input; of 80 scans of 4 s the recorder missed every tenth."""
    rows = [f"{4 * scan},{49.9 + 0.05 * (scan % 2):.2f},{31 + scan % 3}" for scan in range(80) if scan % 10 != 5]
    text = "\n".join(["time_s,temperature_degC,power_pct", *rows, ""])
    recorded, other = tmp_path / "recorded.csv", tmp_path / "other.csv"
    recorded.write_text("# heatertune record; s7://192.0.2.1/0/2/db30\n" + text)
    other.write_text(text)
    assert len(read_log(recorded).time_s) == len(rows) == 72
    assert len(read_log(other).time_s) > 72, "any other file like it is taken as written on change"


def test_a_folder_that_is_gone_is_told(served, places, tmp_path):
    plc, folder = served(intervals=1200, **FAST), tmp_path / "logs"
    folder.mkdir()

    def shown(so_far):
        if so_far.rows >= 20 and folder.exists():
            folder.rename(tmp_path / "moved")

    with pytest.raises(InputError, match="log\\.csv: cannot be written"):
        record(way(plc, "s7"), folder / "log.csv", places, shown=shown, ended=Until(plc))
    assert len(rows_of(tmp_path / "moved" / "log.csv")) >= 20


def test_the_command_says_that_the_log_was_removed(served, design_folder, tmp_path, capsys, monkeypatch):
    plc, path, looked = served(**FAST), tmp_path / "log.csv", []
    monkeypatch.setattr("heatertune.live.commands.record_watch.LINE.show", lambda _: (looked.append(1), len(looked) == 30 and path.unlink()))
    line = ["record", plc.urls["s7"], "--design", str(design_folder), "-o", str(path), "--duration", "2000"]
    assert main(line) == 1
    said = capsys.readouterr()
    assert said.err.count("was removed or moved while it was recorded into; the log goes on in a new file") == 1
    assert "was removed or moved" in said.out


def test_a_disk_that_fails_at_the_end_is_told(served, places, monkeypatch, tmp_path):
    plc = served(intervals=1200, **FAST)

    def failing(_number):
        raise OSError(errno.EIO, "Input/output error")

    def enough():
        monkeypatch.setattr("heatertune.live.recorder.os.fsync", failing)
        return True

    with pytest.raises(InputError, match="Input/output error; what is there stays"):
        record(way(plc, "s7"), tmp_path / "log.csv", places, ended=enough)


@pytest.mark.parametrize("field", ["every_s", "for_s", "timeout_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_time_that_is_none_is_told(field, value):
    with pytest.raises(OutOfRange, match=field):
        RecordingSetup(**{field: value})


def test_nobody_there_leaves_no_file(tmp_path):
    with pytest.raises(LinkDown):
        record(address_of("modbus://127.0.0.1:1/1"), tmp_path / "log.csv")
    assert not list(tmp_path.iterdir())


def _recording(plc, folder, path, *more):
    host, port = plc.addresses["s7"]
    return [sys.executable, "-m", "heatertune", "record", f"s7://{host}:{port}/0/2/db30", "--design", str(folder), "-o", str(path), *more]


def test_the_command_says_what_it_has(served, design_folder, tmp_path, capsys):
    plc = served(intervals=None, step=False, rate=3000.0)
    arguments = _recording(plc, design_folder, tmp_path / "log.csv", "--duration", "900", "--quiet")[3:]
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert re.search(r"log.csv: \d+ rows, until \d+(\.\d+)? s; time is the PLC's own count of scans, each 4 s", said)
    assert f"next: heatertune read {tmp_path / 'log.csv'}" in said
    assert main([*arguments, "--append", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["schema"], document["clock"], document["interval_s"]) == ("heatertune/record/1", "scans of the PLC", 4.0)
    assert main(["read", str(tmp_path / "log.csv")]) == 0


def test_ctrl_c_ends_it_and_says_what_it_has(served, design_folder, tmp_path):
    plc = served(intervals=None, step=False, rate=1000.0)
    command = _recording(plc, design_folder, tmp_path / "log.csv")
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        while not (tmp_path / "log.csv").exists() or len(whole_rows(tmp_path / "log.csv")) < 10:
            assert running.poll() is None
            time.sleep(0.001)
        running.send_signal(signal.SIGINT)
        said, _ = running.communicate()
    assert running.returncode == 0
    assert "next: heatertune read" in said
    assert len(whole_rows(tmp_path / "log.csv")) > 5


@pytest.mark.skipif(signal.getsignal(getattr(signal, "SIGHUP", signal.SIGINT)) is signal.SIG_IGN, reason="SIGHUP is ignored here")
@pytest.mark.long
def test_a_service_goes_on_in_a_new_file_behind_a_rotation(served, design_folder, tmp_path):
    """As logrotate does it: the file is moved, then SIGHUP; and a start continues what is there."""
    plc, path = served(intervals=None, step=False, rate=1000.0), tmp_path / "log.csv"
    command = _recording(plc, design_folder, path, "--service", "--quiet")

    def grown(running, rows):
        while not path.exists() or len(whole_rows(path)) < rows:
            assert running.poll() is None
            time.sleep(0.001)

    for old in ("log.1", "log.2"):
        before = len(whole_rows(path)) if path.exists() else 0
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
            grown(running, before + 10)
            path.rename(tmp_path / old)
            running.send_signal(signal.SIGHUP)
            grown(running, 10)
            running.send_signal(signal.SIGTERM)
            said, _ = running.communicate()
        assert "rows" in said
        assert running.returncode in (0, 1)  # 1: a row came between the two, and found the file moved
        assert len(whole_rows(tmp_path / old)) >= before + 10
    times = [row.split(",")[0] for name in ("log.1", "log.2") for row in whole_rows(tmp_path / name)]
    assert len(times) == len(set(times))


@pytest.mark.long
def test_killed_at_any_moment_it_has_one_torn_line_at_most(served, design_folder, tmp_path):
    """`python -m tests.bench.kills` makes thirty."""
    of_record(served(step=False, rate=2000.0), design_folder, tmp_path / "log.csv", 4, random.Random(7))
