"""Two of each command at once, and each command while another one holds the PLC: one acts, the other says so in a line, and nothing is lost.

Judged by the memory of a virtual PLC, which is read without a client. Places of the words: manual, as in `tests.bench.sessions`.
"""

import os
import shlex
import socket
import subprocess
import sys

import pytest
from tests.bench.kills import CELLS, OLD, Written, told
from tests.bench.sessions import folder_in
from tests.conftest import state_with_key

from heatertune.live import hold
from heatertune.live.client.connection import address_of
from heatertune.live.hold import Hold, WayBackPart, new_way_back
from heatertune.live.write.write_record import read_lines

pytestmark = pytest.mark.long

AUTOMATIC, MANUAL = bytes.fromhex("002100c8"), bytes.fromhex("00200732")  # YH stands at 200 (`OLD`); 90 % of 2047 are 1842
CHANGING = ("experiment", "restore", "write", "rollback")


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    return folder_in(tmp_path_factory.mktemp("at-once"))


@pytest.fixture
def here(made, tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", state_with_key(tmp_path / "state"))
    monkeypatch.setattr(hold, "LATE_S", 0.3)
    (tmp_path / "plan.csv").write_text("time_s,power_pct\n" + "".join(f"{at},{90 - 60 * (at % 2)}\n" for at in range(400)))
    written = Written(made)
    yield written
    written.plc.close()


def line_of(command, here, place, number=0):
    """Return a command line; both of two share the log or the record where a user would."""
    log = place / f"log{number}.csv"
    if command in ("record", "watch"):
        return [command, here.address, "--design", here.made, "-o", place / "log.csv", "--duration", 60, "--quiet"]
    return {
        "experiment": ["experiment", place / "plan.csv", here.address, "--design", here.made, "--limit-temperature", 95, "-o", log, "--yes",
                       "--without-dead-man", "--quiet"],
        "restore": ["experiment", "--restore", here.address, "--quiet"],
        "write": [*here.line, "--no-watch", "--record", place / f"r{number}.jsonl"],
        "rollback": ["rollback", place / "r.jsonl", "--apply", "--yes", "00000000", "--unproven", "--quiet"]}[command]


def prepared(command, here, place):
    """Bring the PLC to where a command begins."""
    memory = here.plc.plc.memory
    if command == "experiment":  # the words that run are those of its folder
        assert told(*here.line, "--no-watch", "--record", place / "first.jsonl")[0] == 0
    if command == "restore":
        where = address_of(here.address)
        Hold(where).open(new_way_back("experiment", where, 30, [WayBackPart(CELLS.start, AUTOMATIC, {MANUAL})], "log.csv", 90.0))
        memory.write(30, CELLS.start, MANUAL)
    if command == "rollback":
        assert told(*here.line, "--no-watch", "--record", place / "r.jsonl")[0] == 0


def digits(line, place):
    """Return a line with the digits that confirm a rollback."""
    return [read_lines(place / "r.jsonl").begin["sha256"][:8] if each == "00000000" else each for each in line]


@pytest.mark.parametrize("command", ["record", "watch", *CHANGING])
def test_two_of_a_command_at_once_leave_what_one_leaves(here, tmp_path, command):
    prepared(command, here, tmp_path)
    before, found = here.plc.plc.memory.image(), here.words
    lines = [[sys.executable, "-m", "heatertune", *map(str, digits(line_of(command, here, tmp_path, number), tmp_path)
              if command == "rollback" else line_of(command, here, tmp_path, number))] for number in (1, 2)]
    running = [subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=dict(os.environ)) for line in lines]
    said = [each.communicate(timeout=120)[0] for each in running]
    statuses = sorted(each.returncode for each in running)
    assert not any("Traceback" in each for each in said), said
    told_more = command in ("watch", "experiment")  # of other words than the proven ones; of a machine that stood for seconds
    assert statuses[0] in ((0, 1) if told_more else (0,)), said
    after, words = here.plc.plc.memory.image(), here.words
    if command in ("record", "watch"):
        assert words == found
        assert (tmp_path / "log.csv").read_bytes()[-1:] == b"\n"
    else:
        # the second one began behind the first, or was refused; on a busy machine an experiment may reach the sensor's end
        assert statuses[1] in (0, 2) or (command == "experiment" and any("BROKEN OFF" in each for each in said)), said
    if command == "experiment":
        assert after[CELLS] == before[CELLS]
    if command == "restore":
        assert after[CELLS] == AUTOMATIC
    if command == "write":
        assert {name: words[name] for name in OLD} == {name: here.new[name] for name in OLD}
    if command == "rollback":
        assert {name: words[name] for name in OLD} == OLD
    assert Hold(address_of(here.address)).way_back() is None


@pytest.mark.parametrize("second", CHANGING)
@pytest.mark.parametrize("first", CHANGING)
def test_none_that_changes_something_begins_while_another_works(here, tmp_path, first, second):
    prepared(second, here, tmp_path)
    line = line_of(second, here, tmp_path)
    line = digits(line, tmp_path) if second == "rollback" else line
    before = here.words, here.plc.plc.memory.image()[CELLS]
    with Hold(address_of(here.address)).lock({"restore": "experiment --restore"}.get(first, first)):
        status, said = told(*line)
    assert status == 2
    assert "another command works on this PLC" in said
    assert (here.words, here.plc.plc.memory.image()[CELLS]) == before


def test_two_simulators_at_one_port_are_told_apart(made):
    with socket.create_server(("127.0.0.1", 0)) as other:
        status, said = told("simulate", made, "--serve", "s7", "--port", other.getsockname()[1], "--scans", 3)
    assert status == 2
    assert "cannot be served on" in said


def command_in(said):
    """Return the command line that a report ends in."""
    return shlex.split(said.rpartition("heatertune ")[2])


def test_what_a_rollback_prints_ends_a_write_that_has_not_ended_from_any_folder(here, tmp_path, monkeypatch):
    """A write from a folder named relatively; its program died before it sent anything, and, once more, behind its last request."""
    monkeypatch.chdir(here.made.parent)
    record, where = tmp_path / "a record.jsonl", address_of(here.address)
    assert told("write", here.made.name, *here.line[2:], "--no-watch", "--record", record)[0] == 0
    new, memory = {name: here.new[name] for name in OLD}, here.plc.plc.memory
    parts = [WayBackPart(part["start"], bytes.fromhex(part["before"]), {bytes.fromhex(part["after"])})
             for part in read_lines(record).begin["parts"]]
    monkeypatch.chdir("/")
    for stands, due in ((OLD, "nothing to put back to end the write: heatertune"), (new, "to put back")):
        Hold(where).open(new_way_back("write", where, 30, parts, record.absolute()))
        for part in parts:
            (after,) = part.own
            memory.write(30, part.start, after if stands == new else part.before)
        assert {name: here.words[name] for name in OLD} == stands
        status, said = told(*shlex.split(Hold(where).way_back().remedy)[1:])
        assert status == 0
        assert due in said
        assert "--unproven" in said if stands == new else "--unproven" not in said  # these old words were found, not proven
        assert "no heater to prove them on" not in said
        assert told(*command_in(said))[0] == 0
        assert Hold(where).way_back() is None
        assert {name: here.words[name] for name in OLD} == OLD
