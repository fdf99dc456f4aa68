"""A running loop recorded from the studio, without a browser: what the file holds is what the picture shows.

The rows of the file are held against the simulation in tests/live/test_recorder.py; here the file is the witness.
"""

import asyncio
import threading
from pathlib import Path

import numpy as np
import pytest
from tests.live.conftest import CONDITIONS, words_of, write_design

from heatertune import read_log, virtual_plc
from heatertune.live.poller import Snapshot
from heatertune.live.recorder import RecordingState
from heatertune.studio import background_work as module
from heatertune.studio import live_log
from heatertune.studio.charts import live_charts
from heatertune.studio.live_log import LiveLog, RecordingRequest
from heatertune.studio.wording import for_page


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("design")
    write_design(made)
    return made


@pytest.fixture
def plc(heater):
    """Serve a PLC as it is asked for; return it and its address."""
    begun = []

    def serve(**asked):
        begun.append(virtual_plc(words_of("s5-ob251"), heater, CONDITIONS, **{"serve": "s7", "rate": 2000.0} | asked))
        host, port = begun[-1].addresses["s7"]
        return begun[-1], f"s7://{host}:{port}/0/2/db30"

    yield serve
    for each in begun:
        each.close()


@pytest.fixture(autouse=True)
def often(monkeypatch):
    monkeypatch.setattr(module, "_LIVE_S", 0.01)


def open_files():
    return {str(each.readlink()) for each in Path("/proc/self/fd").iterdir() if each.is_symlink()}


def rows_of(path):
    return np.array([[float(cell) for cell in line.split(",")] for line in path.read_text().splitlines() if line[0].isdigit()])


class Window:
    """A page that ends the recording once it has seen enough, and writes down what it was shown."""

    def __init__(self, work, enough):
        self.work, self.enough, self.states = work, enough, []
        work.follow(self)

    def show_live(self):
        live = self.work.live
        if live is not None:
            self.states.append(live.state)
            if not live.is_over and self.enough(live):
                live.stop()


def test_the_picture_shows_what_the_file_holds_and_nothing_is_left_open(work, plc, folder, tmp_path):
    here, address = plc()
    threads, files = set(threading.enumerate()), open_files()
    window = Window(work, lambda live: live.rows >= 40)
    asyncio.run(work.record(RecordingRequest(address=f" {address} ", where=str(folder), log=str(tmp_path / "oven.csv"))))
    live, rows = work.live, rows_of(tmp_path / "oven.csv")
    assert live.is_over
    assert live.state == f"Ended: {len(rows)} rows{f', {live.so_far.gaps} gap' if live.so_far.gaps else ''}" + (
        "s" if live.so_far.gaps > 1 else "") + f" in {tmp_path / 'oven.csv'}."
    assert f"Recording {address} into" in "".join(window.states)
    assert (tmp_path / "oven.csv").read_text().startswith(f"# heatertune record; {address}; begun ")
    np.testing.assert_allclose(np.array(live.trace[:4]).T, rows, rtol=1e-6)
    log = read_log(tmp_path / "oven.csv")
    assert len(log.time_s) == len(rows)
    temperature, power = live_charts(live.trace)
    assert [line["name"] for line in temperature["series"]] == ["temperature", "setpoint"]
    assert power["series"][0]["data"][-1] == pytest.approx(rows[-1, [0, 2]], abs=0.01)
    here.close()
    assert {each for each in threading.enumerate() if each.is_alive()} - threads == set()
    assert {each for each in open_files() - files if each.startswith(("socket", str(tmp_path)))} == set()


@pytest.mark.long
def test_a_link_that_is_lost_is_told_and_is_a_gap_in_the_picture(work, plc, folder, tmp_path):
    _, address = plc(rate=500.0, faults=["t=400 cut until=1200"])
    window = Window(work, lambda live: live.rows and live.so_far.last.time_s > 1400.0)
    asyncio.run(work.record(RecordingRequest(address=address, where=str(folder), log=str(tmp_path / "oven.csv"))))
    [lost, *_] = [state for state in window.states if state.startswith("No answer, trying again: ")]
    assert f"What was read before stands in {tmp_path / 'oven.csv'}." in lost
    [line] = live_charts(work.live.trace)[0]["series"][:1]
    at = [place for place, point in enumerate(line["data"]) if point == [None, None]]
    across = [line["data"][place + 1][0] - line["data"][place - 1][0] for place in at]
    assert max(across) > 700.0
    marked = [text for text in (tmp_path / "oven.csv").read_text().splitlines() if text.startswith("# gap before")]
    assert len(marked) == len(at) == work.live.so_far.gaps


def test_a_plc_that_is_gone_for_good_keeps_nothing_from_its_end(work, plc, folder, tmp_path):
    here, address = plc()
    window = Window(work, lambda live: live.rows >= 10 and (here.close() or live.so_far.trouble))
    asyncio.run(work.record(RecordingRequest(address=address, where=str(folder), log=str(tmp_path / "oven.csv"))))
    assert work.live.is_over
    assert (work.live_error, window.states[-1][:6]) == ("", "Ended:")
    assert (tmp_path / "oven.csv").read_text().endswith("\n")
    assert len(rows_of(tmp_path / "oven.csv")) == work.live.rows >= 10


@pytest.mark.parametrize(("asked", "told"), [
    ({"address": ""}, "address '': expected s7://"), ({"address": "s7://oven"}, "no rack and slot"),
    ({"log": " "}, "the log to write: expected a file's name"), ({"every": "often"}, "least time between two rows: 'often'"),
    ({"every": "-1"}, "every_s"), ({"where": "nowhere.toml"}, "nowhere.toml: cannot be read"),
    ({"address": "s7://127.0.0.1:9/0/2/db30"}, "no S7 connection to 127.0.0.1:9"),
    ({"log": "there.csv"}, "there.csv: is there already; tick that it is continued, or take another name"),
    ({"log": "missing/log.csv"}, "log.csv: cannot be written: No such file"), ({"where": ""}, ""),
])
def test_what_cannot_be_recorded_is_told_and_nothing_is_lost(work, plc, folder, tmp_path, monkeypatch, asked, told):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.csv").write_text("mine")
    _, address = plc()
    Window(work, lambda live: live.rows >= 2)
    asyncio.run(work.record(RecordingRequest(**{"address": address, "where": str(folder), "log": "log.csv"} | asked)))
    shown = for_page(work.live_error)
    assert told in shown
    assert "--" not in shown
    assert bool(told) == bool(shown), "a simulator tells itself where everything stands"
    assert (tmp_path / "there.csv").read_text() == "mine"
    if told:
        assert not (tmp_path / "log.csv").exists()
        work.put_recording_away()
        assert (work.live, work.live_error) == (None, "")


def test_a_real_plc_without_places_and_a_missing_library_are_told(work, plc, monkeypatch, tmp_path):
    here, address = plc()
    monkeypatch.setattr(here.plc.memory, "tell", lambda *_: None)
    here.plc.memory.write(1000, 48, b"NONE")
    asked = RecordingRequest(address=address, log=str(tmp_path / "log.csv"))
    asyncio.run(work.record(asked))
    assert "Type the folder of its design, or the map that says it" in for_page(work.live_error)
    monkeypatch.setattr("heatertune.live.client.connection.find_spec", lambda _: None)
    asyncio.run(work.record(asked))
    assert work.live_error == 's7 needs snap7: pip install "heatertune[s7]"'


def test_a_fault_inside_is_told_as_one_and_the_file_stays_whole(work, plc, folder, tmp_path, monkeypatch, caplog):
    _, address = plc()

    def broken(self, so_far):
        if so_far.rows >= 3:
            raise ZeroDivisionError

    monkeypatch.setattr(LiveLog, "_shown", broken)
    asyncio.run(work.record(RecordingRequest(address=address, where=str(folder), log=str(tmp_path / "log.csv"))))
    assert work.live_error.startswith("Something went wrong inside heatertune (ZeroDivisionError)")
    assert "unexpected fault" in caplog.text
    assert len(rows_of(tmp_path / "log.csv")) == 3


def test_another_window_neither_begins_a_second_one_nor_puts_it_away(work, plc, folder, tmp_path):
    _, address = plc()

    async def story():
        first = asyncio.create_task(work.record(RecordingRequest(address=address, where=str(folder), log=str(tmp_path / "one.csv"))))
        while work.live is None or work.live.rows < 3:
            await asyncio.sleep(0.01)
        await work.record(RecordingRequest(address=address, where=str(folder), log=str(tmp_path / "two.csv")))
        work.put_recording_away()
        live = work.live
        await work.end_recording()
        over = live.is_over
        await first
        return live, over

    live, over = asyncio.run(story())
    assert live.path == tmp_path / "one.csv"
    assert over, "whoever waits for the end has the file whole"
    assert not (tmp_path / "two.csv").exists()
    asyncio.run(work.end_recording())  # nothing runs: harmless


def test_a_log_is_continued_where_that_is_ticked(work, plc, folder, tmp_path):
    _, address = plc()
    Window(work, lambda live: live.rows >= 3)
    asked = {"address": address, "where": str(folder), "log": str(tmp_path / "log.csv"), "every": "8,5"}
    asyncio.run(work.record(RecordingRequest(**asked)))
    before = (tmp_path / "log.csv").read_text()
    asyncio.run(work.record(RecordingRequest(**asked, append=True)))
    after = (tmp_path / "log.csv").read_text()
    assert after.startswith(before + "# continued ")
    assert np.all(np.diff(rows_of(tmp_path / "log.csv")[:, 0]) >= 8.5 - 1e-6)


def test_a_long_recording_keeps_its_ends_and_peaks_in_the_picture(folder, monkeypatch):
    monkeypatch.setattr(live_log, "_MOST_ROWS", 4000)
    live = LiveLog(RecordingRequest(address="s7://127.0.0.1/0/2/db30", where=str(folder), log="log.csv"))
    for number in range(1, 30_001):
        seen = {"temperature": 99.0 if number == 5_432 else 20.0 + 0.001 * number, "power": 50.0}
        look = Snapshot(float(number), seen)
        live._shown(RecordingState(rows=number, last=look))
    assert len(live._rows) <= 4000
    trace = live.trace
    assert (trace.time_s[0], trace.time_s[-1], trace.temperature_degC.max()) == (1.0, 30_000.0, 99.0)
    temperature, power = live_charts(trace)
    assert [line["name"] for line in temperature["series"]] == ["temperature"]
    assert power is not None
    assert len(temperature["series"][0]["data"]) < 4000
    assert live.latest == "30000 s: 50.00 °C, 50.0 %; 30000 rows"
