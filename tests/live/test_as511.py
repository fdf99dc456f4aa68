"""AS511, whose two ends share nothing: each is held to bytes written down from public descriptions of the protocol.

The bytes of the three functions stand in a description of the programming port (as511.sourceforge.net, 1999), and a
client that is used on S5-90U, 95U and 115U (FHEM, 44_S7_S5Client.pm) sends and checks the same: handshake, 10h doubled,
blocks by byte addresses, length in words with the five of the header, five zeros before what is read.
"""

import os
import random
import struct
import tty
from contextlib import contextmanager
from threading import Thread

import pytest
from tests.live.conftest import DB, LENGTH, PROTOCOLS, As511, client

from heatertune import InputError
from heatertune.errors import LinkDown, PlcRefused, ReplyLost

pytestmark = PROTOCOLS[3].marks[0]
if not pytestmark.args[0]:
    from heatertune.live import as511_server as server
    from heatertune.live.client import as511 as theirs
    from heatertune.live.client.connection import address_of, connect

_ACK = "1006"
#: what a programming unit says, and what the CPU does, for DB 30 at 1016h with 49 words, whose DW1 is 1018h
INFO = [("02", _ACK), ("1A", "02"), (_ACK, "161003"), (_ACK + "011E" + "1004", _ACK + "02"),
        (_ACK, "00 1010 16 70 70 41 1E 0000 0000 0036 1003"), (_ACK, "02"), (_ACK, "121003"), (_ACK, "")]
READ = [("02", _ACK), ("04", "02"), (_ACK, "161003"), (_ACK + "1010 18 1010 19" + "1004", _ACK + "02"),
        (_ACK, "0000000000 1010 02 1003"), (_ACK, "02"), (_ACK, "121003"), (_ACK, "")]
WRITE = [("02", _ACK), ("03", "02"), (_ACK, "161003"), (_ACK + "1010 18 1010 03" + "1004", _ACK + "02"),
         (_ACK, "121003"), (_ACK, "")]


@pytest.fixture
def quick(monkeypatch):
    """No pause after a refusal, and patience on a busy machine."""
    monkeypatch.setattr(theirs, "PAUSE_S", 0.0)
    monkeypatch.setattr(server, "SILENCE_S", 5.0)


def way(plc):
    return address_of(plc.urls["as511"])


def spoilt(plc):
    """What was written beside all blocks."""
    return plc._ends[0].__self__.spoilt


def _bytes(text):
    return bytes.fromhex(text)


@contextmanager
def _scripted(*script, then=b""):
    """A CPU that knows a script alone: it takes the bytes on the left and answers those on the right."""
    line, far = os.openpty()
    tty.setraw(far)
    heard = []

    def run():
        for due, say in script:
            wanted, found = _bytes(due), b""
            while len(found) < len(wanted):
                found += os.read(line, len(wanted) - len(found))
            heard.append(found == wanted)
            os.write(line, _bytes(say))
        os.write(line, then)

    thread = Thread(target=run, daemon=True)
    thread.start()
    try:
        yield address_of(f"as511://{os.ttyname(far)}/db30"), heard
    finally:
        os.write(far, bytes(200))  # what is still waited for
        thread.join(10)
        os.close(line)
        os.close(far)


def test_the_client_says_what_the_descriptions_say(quick):
    with _scripted(*INFO, *INFO, *READ, *INFO, *INFO, *WRITE, *INFO) as (address, heard), connect(address, 10.0) as client:
        assert client.read(DB, 2, 2) == b"\x10\x02"
        client.write(DB, 2, b"\x10\x03")
    assert heard == [True] * len(heard)
    assert len(heard) == 5 * len(INFO) + len(READ) + len(WRITE)


def test_the_server_says_what_the_descriptions_say(served, quick):
    """The same bytes at the addresses that the server has: its DB 30 is at 100Ah."""

    def there(text):
        return _bytes(text.replace("1010 16", "1010 0A").replace("1010 18", "1010 0C").replace("1010 19", "1010 0D"))

    plc = served(serve="as511")
    plc.plc.memory.write(DB, 2, b"\x10\x02")
    line = As511(*plc.addresses["as511"])
    try:
        for say, due in (*INFO, *READ, *WRITE):
            line.step(there(say), there(due))
    finally:
        line.close()
    assert plc.plc.memory.read(DB, 2, 2) == b"\x10\x03"


def test_a_block_whose_bytes_all_need_doubling_comes_whole(served, quick):
    plc, all_ten = served(serve="as511"), b"\x10" * LENGTH
    with connect(way(plc), 5.0) as asking:
        asking.write(DB, 0, all_ten)
        assert plc.plc.memory.image() == all_ten == asking.read(DB, 0, LENGTH)
    with client(plc, "as511") as third:
        assert third.read(DB, 0, LENGTH) == all_ten


def test_random_parts_come_and_go_as_they_are(served, quick):
    """With many bytes that the framing itself uses."""
    plc, chance = served(serve="as511"), random.Random(3)
    with connect(way(plc), 5.0) as asking:
        for _ in range(60):
            start = chance.randrange(LENGTH)
            content = bytes(chance.choice(b"\x02\x03\x04\x06\x10\x12\x15\x16\x00\xff") for _ in range(chance.randint(1, LENGTH - start)))
            before = plc.plc.memory.image()
            asking.write(DB, start, content)
            after = before[:start] + content + before[start + len(content):]
            assert plc.plc.memory.image() == after
            assert asking.read(DB, 0, LENGTH) == after
    assert spoilt(plc) == []


@pytest.mark.parametrize(("fault", "what"), [("db-missing", "read"), ("db-missing", "write"), ("write-protected", "write"), ("db-short", "read")])
def test_what_the_cpu_refuses_is_told_and_the_line_stays(served, quick, fault, what):
    plc = served(serve="as511", faults=f"t=4 {fault} until=8")
    with connect(way(plc), 5.0) as asking:
        before = asking.read(DB, 0, LENGTH)
        plc.release(2)
        with pytest.raises(PlcRefused, match="refused"):
            asking.read(DB, 0, LENGTH) if what == "read" else asking.write(DB, 0, b"\x01\x02")
        plc.release(1)
        assert asking.read(DB, 0, 2) == before[:2]


def test_after_a_refusal_it_leaves_the_cpu_alone_for_a_while(served, monkeypatch):
    waited = []
    monkeypatch.setattr(theirs.time, "sleep", waited.append)
    with connect(way(served(serve="as511")), 5.0) as asking:
        with pytest.raises(PlcRefused):
            asking.read(31, 0, 2)
        waited.clear()
        asking.read(DB, 0, 2)
    assert waited[0] == pytest.approx(0.5, abs=0.3)


def test_a_block_that_moved_before_is_found(served, quick):
    plc = served(serve="as511", faults="t=4 compressed until=8")
    with connect(way(plc), 5.0) as asking:
        for expected in (b"\x01\x02", b"\x03\x04", b"\x05\x06"):
            asking.write(DB, 2, expected)
            assert (asking.read(DB, 2, 2), plc.plc.memory.read(DB, 2, 2)) == (expected, expected)
            plc.release(1)
    assert spoilt(plc) == []


def test_a_block_that_moves_while_it_is_read_is_read_anew(served, quick, monkeypatch):
    plc = served(serve="as511", faults="t=4 compressed")
    with connect(way(plc), 5.0) as asking:
        expected, info = asking.read(DB, 0, 12), asking._info

        def moved(number):
            if plc.status.intervals < 2:
                plc.release(2)  # after the bytes were read
            return info(number)

        monkeypatch.setattr(asking, "_info", moved)
        assert asking.read(DB, 0, 12) == expected


def test_a_block_that_moves_while_it_is_written_is_told_as_not_known(served, quick, monkeypatch):
    plc = served(serve="as511", faults="t=4 compressed")
    with connect(way(plc), 5.0) as asking:
        before, exchange = plc.plc.memory.image(), asking._exchange

        def moved(function, body, **how):
            if function == 0x03:
                plc.release(2)  # after it was asked where the block is
            return exchange(function, body, **how)

        monkeypatch.setattr(asking, "_exchange", moved)
        with pytest.raises(ReplyLost, match="moved from 100A to 0E1A meanwhile"):
            asking.write(DB, 2, b"\x01\x02")
    assert plc.plc.memory.image()[:18] == before[:18]
    assert spoilt(plc) == [(0x100C, b"\x01\x02")]


#: a step of a write in which the CPU says something wrong, and whether the write may have arrived
WRONG = [("02", "1006", "1007", LinkDown), ("03", "02", "03", LinkDown), (_ACK, "161003", "161002", LinkDown),
         (_ACK + "1010 18 1010 03" + "1004", _ACK + "02", "1016", ReplyLost), (_ACK, "121003", "1210", ReplyLost)]


@pytest.mark.parametrize(("due", "right", "wrong", "error"), WRONG)
def test_a_wrong_byte_ends_it_and_tells_whether_the_write_was_sent(quick, due, right, wrong, error):
    at = WRITE.index((due, right))
    with _scripted(*INFO, *INFO, *WRITE[:at], (due, wrong)) as (address, _):
        client = connect(address, 0.5)
        with pytest.raises(error, match="no answer"):
            client.write(DB, 2, b"\x10\x03")
        with pytest.raises(LinkDown, match="closed"):
            client.read(DB, 2, 2)


@pytest.mark.parametrize("at", range(len(WRITE)))
def test_silence_at_any_step_ends_it_and_tells_whether_the_write_was_sent(quick, at):
    error = LinkDown if at < 3 else ReplyLost
    with (_scripted(*INFO, *INFO, *WRITE[:at]) as (address, _), connect(address, 0.3) as client,
          pytest.raises(error, match="silence")):
        client.write(DB, 2, b"\x10\x03")


def test_a_refusal_where_a_write_was_accepted_is_none(quick):
    """From then on it may have been written."""
    with (_scripted(*INFO, *INFO, *WRITE[:3], (WRITE[3][0], _ACK + "1015")) as (address, _),
          connect(address, 0.5) as client, pytest.raises(ReplyLost, match="10 came, 02 was due")):
        client.write(DB, 2, b"\x10\x03")


@pytest.mark.parametrize("reply", ["00 1010 16 70 70 41 1F 0000 0000 0036 1003", "00 1003", "1005"])
def test_an_answer_that_is_not_about_the_block_is_told(quick, reply):
    with (_scripted(*INFO, *INFO[:4], (_ACK, reply), *INFO[5:]) as (address, _), connect(address, 0.5) as client,
          pytest.raises(ReplyLost, match=r"is not where DB30 is|10 05 came")):
        client.read(DB, 2, 2)


def test_nobody_at_the_line_is_told(quick):
    with _scripted() as (address, _), pytest.raises(LinkDown, match=r"as511:///.*silence for 0\.1 s"):
        connect(address, 0.1)


def test_a_line_that_is_not_there_or_anothers_is_told(served, quick):
    with pytest.raises(LinkDown, match="no serial line /dev/nowhere"):
        connect(address_of("as511:///dev/nowhere/db30"))
    plc = served(serve="as511")
    with connect(way(plc), 5.0), pytest.raises(LinkDown, match="no serial line"):
        connect(way(plc), 5.0)


def test_a_line_that_is_no_pseudo_terminal_has_even_parity(quick, monkeypatch):
    opened = {}

    def serial(device, *rate, **how):
        opened.update(how, device=device, rate=rate)
        raise OSError("no such device")

    monkeypatch.setattr(theirs.serial, "Serial", serial)
    with pytest.raises(LinkDown, match="no such device"):
        connect(address_of("as511:///dev/ttyUSB0/db30"), 2.0)
    assert (opened["rate"], opened["bytesize"], opened["parity"], opened["stopbits"]) == ((9600,), 8, "E", 1)


def test_garbage_at_the_line_leaves_a_cpu_that_answers(served, monkeypatch):
    monkeypatch.setattr(server, "SILENCE_S", 0.02)
    plc, chance = served(serve="as511"), random.Random(4)
    before = plc.plc.memory.image()
    line = os.open(plc.addresses["as511"][0], os.O_RDWR | os.O_NOCTTY)
    for _ in range(60):
        os.write(line, chance.randbytes(chance.randint(1, 60)) if chance.random() < 0.5 else
                 _bytes(WRITE[0][0] + WRITE[1][0] + WRITE[2][0] + WRITE[3][0])[:chance.randint(1, 12)])
    os.close(line)
    monkeypatch.setattr(server, "SILENCE_S", 0.5)
    for _ in range(20):
        try:
            with connect(way(plc), 1.0) as asking:
                assert asking.read(DB, 0, LENGTH) == before
            break
        except (LinkDown, ReplyLost):  # until it has begun anew
            continue
    else:
        pytest.fail("it answers no more")


def test_a_write_over_the_end_of_a_block_or_into_its_header_is_refused(served, quick):
    plc = served(serve="as511")
    before = plc.plc.memory.image()
    with client(plc, "as511") as third:
        for first, content in ((0x100A - 2, bytes(4)), (0x100A + LENGTH - 2, bytes(4)), (0x100A - 10, b"\0")):
            with pytest.raises(AssertionError):
                third.function(0x03, struct.pack(">H", first) + content, False)
    assert plc.plc.memory.image() == before


def test_a_port_is_none_for_a_line(served):
    with pytest.raises(InputError, match="served at a line, not at port 5000"):
        served(serve="as511", ports=5000)


def test_where_there_is_no_pseudo_terminal_it_is_told(served, monkeypatch):
    monkeypatch.delattr(server.os, "openpty")
    with pytest.raises(InputError, match="as511 needs a pseudo-terminal"):
        served(serve="as511")
