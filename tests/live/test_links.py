"""Links and programs that end in mid-experiment or in mid-write: what is said afterwards stands in the PLC.

What stands there is read from the memory of a server that shares nothing with heatertune (`tests/bench/gateway.py`), or from the
virtual PLC's own. A WEG block stands in registers in the manual's order: SetPoint 1, ManualSetPoint 3, SelectSetPoint 5, Feedback 6.
"""

import json
import os
import pty
import random
import resource
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from tests.bench import cuts, signal_table, signals
from tests.bench.gateway import Gateway
from tests.bench.outage import Door, Experiment, Network, why_not
from tests.conftest import state_with_key
from tests.live.conftest import PROTOCOLS, words_of
from tests.live.test_client import way

from heatertune.cli import main
from heatertune.errors import InputError, LinkError
from heatertune.live import hold
from heatertune.live.client.connection import address_of, connect
from heatertune.live.controller_block import block_for
from heatertune.live.hold import Hold
from heatertune.plc import controller_for
from heatertune.proof.words_file import WORDS_SCHEMA

NETWORKED = [each for each in PROTOCOLS if each.values[0] != "as511"]
#: bytes of ManualSetPoint and SelectSetPoint; Feedback
BY_HAND, FEEDBACK = slice(6, 12), 12
AUTOMATIC = struct.pack(">fH", 0.0, 0)


def by_hand(power):
    return struct.pack(">fH", power, 1)


@pytest.fixture(autouse=True)
def own_state(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", state_with_key(tmp_path / "state"))
    monkeypatch.setattr(hold, "LATE_S", 60.0)


@pytest.fixture
def weg(tmp_path):
    """A folder with the words of a WEG block."""
    words = words_of("weg")
    (tmp_path / "weg").mkdir()
    (tmp_path / "weg" / "words.json").write_text(json.dumps({
        "schema": WORDS_SCHEMA, "target": "weg", "words": dict(words.values), "sample_time_s": words.sample_time_s,
        "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "setpoint_ramp": None}))
    return tmp_path / "weg"


@pytest.fixture
def gateway():
    """A gateway with a WEG block behind it, in automatic at 40 °C."""
    words = words_of("weg")
    image = bytearray(block_for(controller_for("weg"), words, {}).image())
    image[2:6] = struct.pack(">f", 40.0)
    image[BY_HAND] = AUTOMATIC
    one = Gateway(bytes(image) + bytes(64), moves=FEEDBACK)
    yield one
    one.close()


def line_of(gateway, folder, name="log", plan=((0, 0), (1, 90), (60, 20)), unit="1/0", host="127.0.0.1"):
    """Return the arguments of an experiment; its plan sets 90 % after a second."""
    path = folder.with_name(f"{name}_plan.csv")
    path.write_text("time_s,power_pct\n" + "".join(f"{at},{power}\n" for at, power in plan))
    return ["experiment", str(path), f"modbus://{host}:{gateway.port}/{unit}", "--design", str(folder), "--limit-temperature", "80",
            "-o", str(folder.with_name(f"{name}.csv")), "--yes", "--without-dead-man", "--quiet"]


def _deaf_to_nothing(**more):
    """Return what a process begins with that heeds all signals, whatever the shell behind the tests has it ignore."""
    def begin():
        for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM, signal.SIGQUIT):
            signal.signal(number, signal.SIG_DFL)
        for which, limit in more.items():
            resource.setrlimit(getattr(resource, which), (limit, limit))
    return begin


@contextmanager
def running(line, **more):
    """Run a command in a process of its own."""
    limits = {name: more.pop(name) for name in list(more) if name.startswith("RLIMIT")}
    asked = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "preexec_fn": _deaf_to_nothing(**limits)} | more
    with subprocess.Popen([sys.executable, "-m", "heatertune", *line], **asked) as process:
        try:
            yield process
        finally:
            process.kill()


def waited(true, seconds=60.0):
    """Wait until something is true."""
    ends = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < ends
        time.sleep(0.005)


def said_by(process):
    return " ".join(" ".join(process.communicate(timeout=60)).split())


def test_an_s7_connection_that_nobody_answers_is_ended_by_reset():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = address_of(f"s7://127.0.0.1:{silent.getsockname()[1]}/0/2/db30")
        with pytest.raises(LinkError, match="no S7 connection"):
            connect(address, timeout_s=0.05)
        taken, _ = silent.accept()
        with taken:
            assert taken.recv(100)[:4] == bytes([3, 0, 0, 22])  # its request for a connection: RFC 1006, 22 bytes
            with pytest.raises(ConnectionResetError):
                taken.recv(100)


@pytest.mark.parametrize("protocol", NETWORKED)
def test_every_link_ends_by_reset(served, protocol):
    """Closed, given up or killed: the system sends nothing again."""
    plc = served(serve=protocol)
    door = Door(socket.create_server(("127.0.0.1", 0)), plc.addresses[protocol])
    text = way(plc, protocol).text.replace(str(plc.addresses[protocol][1]), str(door.port))
    with connect(address_of(text)) as client:
        client.read(30, 0, 4)
    waited(lambda: len(door.ends) == 1)
    lost = connect(address_of(text), 0.3)
    door.deaf = True
    with pytest.raises(LinkError):
        lost.write(30, 22, bytes(4))
    waited(lambda: len(door.ends) == 2)
    door.deaf = False
    program = (f"from heatertune.live.client.connection import *; from heatertune.live.client.connection import *\n"
               f"client = connect(address_of({text!r})); client.read(30, 0, 4); print(1, flush=True); input()")
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline()
        process.kill()
    waited(lambda: len(door.ends) == 3)
    door.close()
    assert door.ends == ["reset"] * 3


def test_a_serial_line_sends_nothing_more_of_what_was_given_up():
    as511 = pytest.importorskip("heatertune.live.client.as511")
    done = []
    line = SimpleNamespace(timeout=0.1, write=lambda _: None, read=lambda _: b"", close=lambda: done.append("close"),
                           reset_output_buffer=lambda: done.append("discard"))
    given_up = as511.As511Client(address_of("as511://COM1/db30"), line)
    with pytest.raises(LinkError, match="silence"):
        given_up.read(30, 0, 2)
    assert done == ["discard", "close"]
    done.clear()
    as511.As511Client(address_of("as511://COM1/db30"), line).close()  # its last answer may still be on the way
    assert done == ["close"]


@pytest.mark.long
@pytest.mark.parametrize("asked", ["SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGUSR1", "SIGALRM"])
def test_a_signal_ends_an_experiment_like_ctrl_c(gateway, weg, asked):
    with running(line_of(gateway, weg)) as process:
        waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0))
        process.send_signal(getattr(signal, asked))
        said = said_by(process)
    assert gateway.memory[BY_HAND] == AUTOMATIC
    assert process.returncode == 1
    assert "stand there as before" in said
    assert Hold(address_of(f"modbus://127.0.0.1:{gateway.port}/1/0")).way_back() is None


@pytest.mark.long
@pytest.mark.parametrize("which", ["the first look", "the first put", "the second put", "the way back"])
def test_a_signal_at_any_step_leaves_the_plc_as_it_was(gateway, weg, which):
    """At a request the signal is there before the answer; the second one comes while the controller is given back."""
    number = {"the first look": 1, "the first put": 1, "the second put": 2, "the way back": 3}[which]
    with running(line_of(gateway, weg)) as process:
        def ask(request):
            if request == number:
                process.send_signal(signal.SIGHUP)
                time.sleep(0.2)

        if which == "the first look":
            gateway.looked = ask
        else:
            gateway.seen = ask
        if which == "the way back":
            waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0))
            process.send_signal(signal.SIGTERM)
        said_by(process)
    assert gateway.memory[BY_HAND] == AUTOMATIC
    assert Hold(address_of(f"modbus://127.0.0.1:{gateway.port}/1/0")).way_back() is None


@pytest.mark.long
def test_a_hang_up_that_is_to_be_ignored_is_ignored(gateway, weg):
    """As `nohup` has it."""
    line = line_of(gateway, weg, plan=((0, 0), (1, 90), (3, 20)))
    with running(line, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)) as process:
        waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0))
        process.send_signal(signal.SIGHUP)
        said = said_by(process)
    assert (process.returncode, gateway.memory[BY_HAND]) == (0, AUTOMATIC), said


@pytest.mark.long
def test_a_closed_terminal_and_a_broken_pipe_end_it_like_ctrl_c(gateway, weg):
    master, slave = pty.openpty()
    line = [each for each in line_of(gateway, weg, "terminal") if each != "--quiet"]
    with running(line, stdin=slave, stdout=slave, stderr=slave, start_new_session=True) as process:
        os.close(slave)
        waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0))  # nobody reads what it shows, as behind a Ctrl-S
        time.sleep(2.0)
        reads = gateway.reads
        waited(lambda: gateway.reads > reads + 5, 10.0)
        process.send_signal(signal.SIGHUP)
        os.close(master)
        process.wait(60)
    assert gateway.memory[BY_HAND] == AUTOMATIC
    with running([each for each in line_of(gateway, weg, "pipe", ((0, 0), (1, 90), (3, 20))) if each != "--quiet"]) as process:
        waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0))
        process.stdout.close()
        process.stderr.close()
        process.wait(60)
    assert gateway.memory[BY_HAND] == AUTOMATIC


@pytest.mark.long
def test_a_disk_that_is_full_ends_it_like_ctrl_c(gateway, weg):
    """From a moment on no file may grow beyond the size that the log has."""
    with running(line_of(gateway, weg)) as process:
        waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0))
        time.sleep(0.3)
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (weg.with_name("log.csv").stat().st_size,) * 2)
        said = said_by(process)
    assert gateway.memory[BY_HAND] == AUTOMATIC
    assert process.returncode == 1
    assert "log.csv: cannot be written on: File too large" in said
    assert "stand there as before" in said


def test_without_room_for_the_way_back_nothing_is_begun(gateway, weg):
    with running(line_of(gateway, weg), RLIMIT_FSIZE=100) as process:
        said = said_by(process)
    assert process.returncode == 2
    assert "cannot be written" in said
    assert not gateway.writes


@pytest.mark.long
def test_two_at_once_are_refused_whatever_the_address_looks_like(gateway, weg, capsys):
    with running(line_of(gateway, weg)) as process:
        waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0))
        for unit, host in (("1/0", "127.0.0.1"), ("1", "localhost"), ("1/0", "LOCALHOST")):
            assert main(line_of(gateway, weg, "second", unit=unit, host=host)) == 2
            said = capsys.readouterr().err
            assert f"another command works on this PLC (process {process.pid}: heatertune experiment, begun " in said
        assert gateway.memory[BY_HAND] == by_hand(90.0)
        process.send_signal(signal.SIGINT)
        said_by(process)
    assert gateway.memory[BY_HAND] == AUTOMATIC


@pytest.mark.long
def test_what_a_kill_leaves_is_not_taken_for_before_and_the_named_command_brings_it_back(gateway, weg, capsys):
    with running(line_of(gateway, weg)) as process:
        waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0))
        time.sleep(0.3)  # the answer is there, too: nothing can arrive late
        process.kill()
        process.wait()
    time.sleep(0.1)
    assert main(line_of(gateway, weg, "second")) == 2
    said = capsys.readouterr().err
    assert "has not ended: the controller may be in manual at up to 90 %" in said
    assert gateway.memory[BY_HAND] == by_hand(90.0)
    command = said.strip().rpartition("heatertune ")[2].split()
    assert main(command) == 0
    assert "stand there as before" in capsys.readouterr().out
    assert gateway.memory[BY_HAND] == AUTOMATIC
    assert main(command) == 2
    assert "nothing to bring back" in capsys.readouterr().err
    assert main(line_of(gateway, weg, "third", ((0, 0), (1, 90), (2, 20)))) == 0
    assert gateway.memory[BY_HAND] == AUTOMATIC


@pytest.mark.long
def test_a_controller_in_manual_is_not_taken_for_automatic(gateway, weg, capsys):
    """An experiment from another machine, whose state is not here."""
    gateway.memory[BY_HAND] = by_hand(90.0)
    line = line_of(gateway, weg, plan=((0, 0), (1, 50), (2, 20)))
    assert main(line) == 2
    assert "is in manual already" in capsys.readouterr().err
    assert not gateway.writes
    assert main([*line, "--in-manual"]) == 0
    assert gateway.memory[BY_HAND] == by_hand(90.0)
    gateway.memory[BY_HAND] = AUTOMATIC
    assert main([*line_of(gateway, weg, "other"), "--in-manual"]) == 2
    assert "is in automatic" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize("held_s", [0.5, 3.0])
def test_a_put_that_a_gateway_kept_is_taken_back_when_it_arrives(gateway, weg, capsys, monkeypatch, held_s):
    monkeypatch.setattr(hold, "LATE_S", held_s + 2.0)
    gateway.hold_s[2] = held_s  # 90 %
    begun = time.monotonic()
    assert main(line_of(gateway, weg)) == 1
    assert "stand there as before" in capsys.readouterr().out
    assert time.monotonic() - begun > held_s
    assert (6, by_hand(90.0)) in gateway.writes
    assert gateway.memory[BY_HAND] == AUTOMATIC


@pytest.mark.long
def test_a_put_that_a_gateway_kept_is_taken_back_though_somebody_else_was_there_meanwhile(gateway, weg, capsys, monkeypatch):
    """It has undone the other's change by then; what stood there before is safer than 90 %."""
    monkeypatch.setattr(hold, "LATE_S", 5.0)
    gateway.hold_s[2] = 3.0  # 90 %
    other = threading.Timer(2.0, lambda: gateway.memory.__setitem__(BY_HAND, by_hand(7.0)))
    gateway.seen = lambda number: other.start() if number == 2 else None
    assert main(line_of(gateway, weg)) == 1
    assert gateway.memory[BY_HAND] == AUTOMATIC
    assert "stand there as before" in capsys.readouterr().out


def test_the_time_since_a_request_is_never_taken_for_longer_than_it_is():
    now = [100.0]
    clock = hold.Clock(lambda: now[0])
    for sent_s, passed_s in ((99.0, 1.0), (30.0, 70.0), (100.0, 0.0), (5000.0, 100.0)):  # the last one: the machine was rebooted since
        assert clock.passed_s(sent_s) == passed_s


def test_a_state_folder_that_cannot_be_read_is_told_in_one_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / "file" / "within"))
    state = Hold(address_of("modbus://127.0.0.1:1/1/0"))
    assert state.message() == ""
    with pytest.raises(InputError, match="cannot be written"), state.lock("write"):
        pass
    monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / ("x" * 300)))
    assert main(["experiment", "--restore", "modbus://127.0.0.1:1/1/0"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.long
def test_a_link_that_stays_dead_is_said_to_be_unknown_with_the_command_that_works(gateway, weg, capsys, monkeypatch):
    monkeypatch.setattr("heatertune.live.hold.RETRY_S", 2.0)
    monkeypatch.setattr(hold, "LATE_S", 3.0)

    def seen(number):
        gateway.silent = number == 3  # 90 % stands there: no more answers

    gateway.seen = seen
    ends = threading.Timer(0.0, lambda: waited(lambda: gateway.memory[BY_HAND] == by_hand(90.0)) or setattr(gateway, "silent", True))
    ends.start()
    assert main(line_of(gateway, weg)) == 1
    said = " ".join(capsys.readouterr().out.split())
    ends.join()
    assert "as before" not in said
    assert "UNKNOWN what stands there" in said
    assert "may be in manual at 90 %" in said
    assert gateway.memory[BY_HAND] == by_hand(90.0)
    gateway.silent, gateway.seen = False, lambda _: None
    command = said.partition("once it answers: heatertune ")[2].split()[:3]
    assert main(command) == 0
    assert gateway.memory[BY_HAND] == AUTOMATIC


def test_a_lock_ends_with_its_process(tmp_path):
    where = "modbus://127.0.0.1:1502/1/0"
    program = (f"import time; from heatertune.live.hold import Hold; from heatertune.live.client.connection import address_of\n"
               f"with Hold(address_of({where!r})).lock('experiment'): print(1, flush=True); input()")
    state = Hold(address_of(where))
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline()
        with pytest.raises(InputError, match=f"process {process.pid}: heatertune experiment, begun 20"), state.lock("write"):
            pass
        process.kill()
    with state.lock("write"):
        pass


@pytest.mark.skipif(bool(why_not()), reason=why_not() or "none")
@pytest.mark.long(seconds=100)
@pytest.mark.parametrize(("protocol", "tail"), [("modbus", "/1/0"), ("s7", "/0/2/db30")])
def test_a_put_that_an_outage_swallowed_never_arrives(served, words, design_folder, tmp_path, protocol, tail):
    """`python -m tests.bench.outage` makes more. With an orderly end the system sends it again, a few seconds after the report."""
    plc = served(serve=protocol, step=False, rate=20.0)
    with Network() as network:
        ran = Experiment(network, plc, slice(22, 26), protocol, tail, design_folder, tmp_path, hole_at=2, outage_s=4.0, seconds=8.0)
    assert not list(ran.wrong)
    assert ran.status == 1


@pytest.mark.long(seconds=40)
def test_signals_at_random_moments_leave_the_plc_as_it_was_or_to_the_named_command(tmp_path):
    """`python -m tests.bench.signals` makes more."""
    for number in range(5):
        place = tmp_path / str(number)
        place.mkdir()
        sent, wrong = signals.run(random.Random(number), place)
        assert not wrong, sent


@pytest.mark.long(seconds=40)
def test_a_network_that_is_cut_at_a_request_leaves_what_is_reported(tmp_path, monkeypatch):
    """`python -m tests.bench.cuts` makes 500, over OPC UA, too."""
    for name in ("LATE_S", "RETRY_S", "_PAUSES_S"):
        monkeypatch.setattr(hold, name, getattr(hold, name))
    monkeypatch.setattr(cuts.recorder, "_PAUSES_S", cuts.recorder._PAUSES_S)
    monkeypatch.setattr(cuts.writer, "_PAUSE_S", cuts.writer._PAUSE_S)
    made, hit = cuts.prepared(tmp_path), 0
    # with an orderly end, and without looking later, these five leave what is not reported: a write each of K, TI, YH, and two powers
    chosen = [cuts.Cut(command, "modbus", at, 0.4, True) for command, at in (
        ("write", 9), ("write", 14), ("write", 19), ("experiment", 10), ("experiment", 21))]
    drawn = cuts.sweep(6, random.Random(3), ("modbus", "s7"), {"experiment": 16, "write": 20, "rollback": 8})
    for number, cut in enumerate([*chosen, *drawn]):
        place = tmp_path / str(number)
        place.mkdir()
        wrong, at = cuts.run(made, cut, place)
        assert not wrong, cut
        hit += bool(at)
    assert hit >= 8


@pytest.mark.long(seconds=90)
def test_each_way_to_end_a_live_command_at_some_step_leaves_what_was_there_or_the_command_that_brings_it_back(tmp_path):
    """`python -m tests.bench.signal_table` makes 470: each step, SIGINT, SIGTERM, SIGHUP, a closed terminal and a closed pipe."""
    drawn = [one for command in signal_table.STEPS
             for one in random.Random(4).sample([each for each in signal_table.cases() if each[0] == command], 3)]
    folders = {target: signals.folder_in(tmp_path / target, target) for target in ("weg", "s5-ob251")}
    struck = 0
    for index, drawn_case in enumerate(drawn):
        (place := tmp_path / str(index)).mkdir()
        wrong, hit = signal_table.case(*drawn_case, folders, place)
        assert not wrong, drawn_case
        struck += hit
    assert len(drawn) == 21
    assert struck >= 12


@pytest.mark.long(seconds=40)
def test_a_signal_at_a_request_of_a_write_or_a_rollback_leaves_one_side_or_the_other(tmp_path):
    """`python -m tests.bench.signals steps` makes every one: 50 requests, three signals."""
    made, begun, hit = signals.folder_in(tmp_path / "made"), [], 0

    def begin(*given, **asked):
        begun.append(signals.virtual_plc(*given, **asked))
        return begun[-1]

    for command, number, name in (("write", 12, "SIGHUP"), ("write", 21, "SIGTERM"), ("rollback", 9, "SIGINT")):
        said, wrong, in_time = signals.at_a_step(made, command, number, name, begin)
        assert not wrong
        hit += in_time
        for left in made.glob("write_*"):
            left.unlink()
    assert hit >= 2, said
