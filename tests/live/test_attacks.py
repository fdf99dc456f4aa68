"""What clients do to a virtual PLC that no client should, and what becomes of it."""

import gc
import random
import signal
import socket
import struct
import subprocess
import sys
import warnings
from contextlib import suppress
from threading import Semaphore, Thread

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.live.conftest import DB, FAILED, LENGTH, client

from heatertune.live.block_memory import BlockMemory, Refusal
from heatertune.live.simulator_status import OWN, OWN_LENGTH, SimulatorStatus

_REQUEST = bytes.fromhex("0300001f02f080320100000001000e00000401120a10020062001e84000000")  # S7: read 98 bytes of DB 30


def _garbage(chance, number):
    """Random bytes, or a right request with a byte changed, or its beginning."""
    kind = number % 3
    if kind == 0:
        return chance.randbytes(chance.randrange(1, 200))
    content = bytearray(_REQUEST)
    content[chance.randrange(len(content))] = chance.randrange(256)
    return bytes(content[: chance.randrange(1, len(content))] if kind == 1 else content)


@pytest.mark.long
@pytest.mark.parametrize("protocol", ["s7", "modbus", "opcua"])
def test_garbage_on_the_port_leaves_a_plc_that_answers(served, protocol):
    plc, chance = served(serve=protocol), random.Random(5)
    with client(plc, protocol) as asking:
        plc.release(3)
        before = asking.read(DB, 0, LENGTH)
        for number in range(60):
            with socket.create_connection(plc.addresses[protocol]) as door:
                door.sendall(_garbage(chance, number))
        assert asking.read(DB, 0, LENGTH) == before
        assert plc.release(3).scans == 6


@pytest.mark.long
def test_two_clients_that_write_beside_each_other_undo_nothing(served):
    plc = served(step=False, rate=float("inf"))
    places = {"s7": 2, "modbus": 6}  # K and R
    both = served(serve=("s7", "modbus"), step=False, rate=float("inf"))
    lost = []

    def write(protocol):
        with client(both, protocol) as asking:
            for number in range(1, 200):
                asking.write(DB, places[protocol], struct.pack(">h", number))
                if asking.read(DB, places[protocol], 2) != struct.pack(">h", number):
                    lost.append((protocol, number))

    threads = [Thread(target=write, args=(protocol,)) for protocol in places]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert lost == []
    assert both.status.scans > 0
    assert plc.plc.failed is None


def test_a_half_of_a_word_is_what_the_next_scan_finds(served):
    plc = served()
    with client(plc) as asking:
        plc.release(3)
        old = asking.read(DB, 2, 2)
        asking.write(DB, 2, b"\x7f")
        plc.release(1)
        assert asking.read(DB, 2, 2) == b"\x7f" + old[1:]


def test_a_fast_client_hinders_no_scan(served):
    plc = served(step=False, rate=4000.0, intervals=200)
    with client(plc) as asking:
        reads = 0
        while not plc.plc.ended:
            asking.read(DB, 0, LENGTH)
            reads += 1
    assert (plc.status.intervals, plc.status.scans) == (200, 200)
    assert reads > 5


def test_a_client_that_releases_all_scans_lets_it_run_and_the_end_still_comes(served):
    plc = served()
    with client(plc) as asking:
        asking.write(OWN, 8, b"\xff" * 4)
        while SimulatorStatus(asking.read(OWN, 0, OWN_LENGTH)).intervals < 500:
            pass
    plc.close()
    assert plc.plc.failed is None


def test_several_items_or_a_bit_in_one_write_are_refused_not_half_done(served):
    from snap7.type import Area, WordLen  # noqa: PLC0415

    plc = served()
    with client(plc) as asking:
        before = asking.read(DB, 0, 36)
        with pytest.raises(FAILED):
            asking.client.write_area(Area.DB, DB, 8 * 2, bytearray(b"\1"), WordLen.Bit)
        assert asking.read(DB, 0, 36) == before


@pytest.mark.long
def test_clients_that_come_as_it_closes_leave_no_socket_to_the_garbage_collector(served):
    with warnings.catch_warnings(record=True) as left:
        warnings.simplefilter("always")
        for _ in range(4):
            plc, came = served(serve="modbus"), Semaphore(0)

            def knock(at=plc.addresses["modbus"], came=came):
                with suppress(OSError):
                    while True:
                        socket.create_connection(at, timeout=5).close()
                        came.release()
                came.release()

            knocking = Thread(target=knock)
            knocking.start()
            came.acquire()
            plc.close()
            knocking.join()
        gc.collect()
    assert not [str(each.message) for each in left]


@given(number=st.integers(-1, 2000), start=st.integers(-5, 120), content=st.binary(max_size=120))
def test_a_write_is_whole_or_refused(number, start, content):
    memory = BlockMemory(DB, bytes(range(LENGTH)), 1.0)
    try:
        memory.write(number, start, content)
    except Refusal:
        assert memory.image() == bytes(range(LENGTH))
    else:
        assert memory.read(number, start, len(content)) == content


def test_what_a_client_writes_during_a_scan_stays():
    memory = BlockMemory(DB, bytes(LENGTH), 1.0)
    before = memory.image()
    memory.write(DB, 2, b"\1\2")
    after = bytearray(before)
    after[44:46] = b"\3\4"
    memory.write_changes(before, after)
    assert (memory.image()[2:4], memory.image()[44:46]) == (b"\1\2", b"\3\4")


@pytest.mark.long
def test_killed_it_leaves_neither_port_nor_process_nor_file(tmp_path, run_simulate):
    process, ports = run_simulate("--serve", "s7", "--serve", "modbus", "--rate", "max")
    for port in ports:
        socket.create_connection(("127.0.0.1", port)).close()
    children = subprocess.run(["ps", "--ppid", str(process.pid), "-o", "pid="], capture_output=True, text=True, check=False).stdout
    assert children.strip() == ""
    process.send_signal(signal.SIGKILL)
    process.wait()
    for port in ports:
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_interrupted_it_tells_how_far_it_was_and_ends_well(run_simulate):
    process, _ = run_simulate("--rate", "max")
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 0
    assert err.startswith("ended after ")
    assert err.count("\n") == 1


def test_it_begins_within_two_seconds_of_work(run_simulate):
    """The processor's own seconds, as the machine may be busy with other things."""
    code = ("import resource, sys; from heatertune.cli import main; status = main(sys.argv[1:]); "
            "used = resource.getrusage(resource.RUSAGE_SELF); print(used.ru_utime + used.ru_stime); sys.exit(status)")
    ran = subprocess.run([sys.executable, "-c", code, "simulate", run_simulate.folder, "--rate", "max", "--scans", "1", "--quiet"],
                         capture_output=True, text=True, check=True)
    assert float(ran.stdout.splitlines()[-1]) < 2.0
