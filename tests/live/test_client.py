"""Addresses, and the client that asks a PLC; the PLC is the virtual one, whose bytes other tests hold against `verify`."""

import random
import socket
import struct
import threading

import pytest
from tests.conftest import tried
from tests.live.conftest import DB, LENGTH, PROTOCOLS

from heatertune.errors import DocumentError, InputError, LinkDown, LinkError, PlcRefused, ReplyLost, UnknownName
from heatertune.live.block_memory import BlockSignal
from heatertune.live.client.connection import address_of, connect
from heatertune.live.controller_block import places_in, places_of
from heatertune.live.simulator_status import OWN, OWN_LENGTH, SimulatorStatus

NETWORKS = PROTOCOLS[:3]


def way(plc, protocol):
    return address_of(plc.urls[protocol])


def at(port, protocol):
    return address_of({"s7": "s7://127.0.0.1:{}/0/2", "modbus": "modbus://127.0.0.1:{}/1", "opcua": "opc.tcp://127.0.0.1:{}/db30"}[
        protocol].format(port))


@pytest.mark.parametrize(("text", "protocol", "host", "port", "how", "block"), [
    ("s7://10.0.0.1/0/2/db30", "s7", "10.0.0.1", 102, (0, 2), 30),
    ("S7://plc.local:1102/0/3", "s7", "plc.local", 1102, (0, 3), None),
    ("s7://[::1]:102/10.00/10.01/DB1", "s7", "::1", 102, (0x1000, 0x1001), 1),
    ("modbus://10.0.0.1/1", "modbus", "10.0.0.1", 502, (1,), 0),
    ("modbus://10.0.0.1:1502/7/400", "modbus", "10.0.0.1", 1502, (7,), 400),
    ("opc.tcp://10.0.0.1/db30", "opcua", "10.0.0.1", 4840, (), 30),
    ("OPC.TCP://[::1]:4841/DB12", "opcua", "::1", 4841, (), 12),
    ("as511:///dev/ttyUSB0/db30", "as511", "/dev/ttyUSB0", 0, (), 30), ("as511://COM3/DB255", "as511", "COM3", 0, (), 255)])
def test_an_address_is_read(text, protocol, host, port, how, block):
    address = address_of(text)
    assert (address.protocol, address.host, address.port, address.way, address.block) == (protocol, host, port, how, block)
    assert address.by_tsap == any(each > 255 for each in how)


@pytest.mark.parametrize(("text", "path", "node"), [
    ("opc.tcp://a/db30", "", "ns=2;s=DB30"), ("opc.tcp://a:1/ns=4;i=17", "", "ns=4;i=17"),
    ("opc.tcp://a/UA/Server/ns=3;s=Oven/Block", "/UA/Server", "ns=3;s=Oven/Block"),
    ('opc.tcp://a/ns=3;s="Oven"."Block #1?"', "", 'ns=3;s="Oven"."Block #1?"')])
def test_the_node_of_an_address_is_read(text, path, node):
    assert (address_of(text).path, address_of(text).node) == (path, node)


@pytest.mark.parametrize(("text", "parts"), [
    ("10.0.0.1", ("expected", "s7://")), ("s7://", ("no host",)), ("s7://a", ("no rack and slot", "s7://")),
    ("s7://a/0/db30", ("no rack and slot",)), ("s7://a/9/2", ("rack '9'", "0…7")), ("s7://a/0/x", ("slot 'x'",)),
    ("s7://a:99999/0/2", ("Port out of range", "expected")), ("s7://a:0/0/2", ("port 0",)), ("s7://a/0/2/db99999", ("db99999",)),
    ("s7://me@a/0/2", ("more than host",)), ("modbus://a", ("no unit",)), ("modbus://a/1/2/3", ("more than unit",)),
    ("opc.tcp://a", ("no node", "ns=3;s=NAME")), ("opc.tcp://a/ns=x;s=B", ("no node",)), ("opc.tcp:///db30", ("no host",)),
    ("opc.tcp://a:0/db30", ("port 0",)), ("opc.tcp://a/db70000", ("beyond db65535",)), ("opc.tcp://me@a/db30", ("more than host",)),
    ("as511:///dev/ttyUSB0", ("no block", "COM3")), ("as511://db30", ("no serial line",)), ("as511://COM3/db256", ("beyond db255",)),
    ("modbus://a/256", ("unit '256'", "0…255")), ("modbus://a/1/70000", ("register '70000'",)), ("s7://[a/0/2", ("expected",))])
def test_a_bad_address_is_told(text, parts):
    with pytest.raises(InputError) as refused:
        address_of(text)
    assert all(part in str(refused.value) for part in (text, *parts)), refused.value


def test_an_unknown_protocol_is_told():
    with pytest.raises(UnknownName, match=r"s7, modbus, opc\.tcp, as511"):
        address_of("opc://a/1")


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_block_is_read_and_written(served, protocol):
    plc = served(serve=protocol)
    with connect(way(plc, protocol)) as client:
        before = client.read(DB, 0, LENGTH)
        client.write(DB, 2, b"\x0f\xa0")
        assert client.read(DB, 0, LENGTH) == before[:2] + b"\x0f\xa0" + before[4:]
        assert client.read(DB, 3, 2) == b"\xa0" + before[4:5]  # of a register, too, a half
        told = SimulatorStatus(client.read(OWN, 0, OWN_LENGTH))
        assert (told.marked, told.interval_s, told.shown) == (True, plc.scan_s, 0)
        plc.release(3)
        assert SimulatorStatus(client.read(OWN, 0, OWN_LENGTH)).shown == 3
        with pytest.raises(PlcRefused, match="refused"):
            client.read(DB, LENGTH, 2)
        assert client.read(DB, 0, 2) == before[:2]  # a refusal ends no connection
        with pytest.raises(PlcRefused, match="refused"):
            client.write(DB, LENGTH - 2, bytes(4))
        assert client.whole == (protocol != "as511")


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize(("fault", "arrives"), [("lost-reply", {1}), ("black-hole", {0}), ("cut", {0, 1})])
def test_a_write_without_an_answer_is_unknown_and_never_sent_twice(served, monkeypatch, protocol, fault, arrives):
    plc = served(serve=protocol, faults=f"t=0 {fault}")
    client, written, write = connect(way(plc, protocol), 0.5), [], plc.plc.memory.write
    client.write(DB, 2, b"\x0f\x9f")
    plc.release(1)
    monkeypatch.setattr(plc.plc.memory, "write", lambda *given: (written.append(given), write(*given)))
    with pytest.raises((ReplyLost, LinkDown), match="no answer") as lost:
        client.write(DB, 2, b"\x0f\xa0")
    assert isinstance(lost.value, ReplyLost) or not written  # who knows that it was not sent may say so
    with pytest.raises(LinkDown, match="closed"):  # a late answer would be taken for another's
        client.read(DB, 0, 2)
    assert len(written) in arrives


@pytest.mark.parametrize("protocol", NETWORKS)
def test_nobody_there_is_told(protocol):
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = door.getsockname()[1]
    with pytest.raises(LinkDown, match=f"127.0.0.1:{port}"):
        connect(at(port, protocol), 0.3)


@pytest.mark.parametrize("protocol", NETWORKS)
@pytest.mark.parametrize("says", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\x03\x00\x00\x04", b"\x00" * 64])
def test_somebody_else_there_is_told(protocol, says):
    with socket.create_server(("127.0.0.1", 0)) as door:
        def answer():
            one, _ = door.accept()
            with one:
                one.recv(64)
                one.sendall(says)

        thread = threading.Thread(target=answer)
        thread.start()
        port = door.getsockname()[1]
        with pytest.raises(LinkError), connect(
                at(port, protocol), 0.5) as client:
            client.read(DB, 0, 2)
        thread.join()


def test_the_places_of_the_block_show_what_the_plc_sees(served, words):
    plc, places = served(), places_of(words)
    told = plc.release(40)
    begin, count = places.span
    content = plc.plc.memory.image()[begin:begin + count]
    seen = {role: signal.of(content, begin) for role, signal in places.signals.items()}
    assert seen["temperature"] == pytest.approx(told.temperature_degC, abs=100.0 / 2047)
    assert seen["power"] == pytest.approx(told.power_pct)
    assert seen["setpoint"] == pytest.approx(50.0, abs=100.0 / 2047)


GOOD = """
block = 12
[temperature]
byte = 4
format = "INT"
raw = [0, 27648]
range = [-50, 150.0]
[power]
register = 5
format = "REAL"
raw = [0, 1]
range = [0, 100]
[counter]
byte = 0
format = "UDINT"
interval_s = 0.5
"""


def test_a_file_says_the_places(tmp_path):
    path = tmp_path / "oven.toml"
    path.write_text(GOOD)
    places = places_in(path)
    assert (places.block, places.span, places.counter.interval_s, places.counter.turn) == (12, (0, 14), 0.5, 1 << 32)
    content = struct.pack(">Ihxxxxf", 7, 13824, 0.25)
    assert places.signals["temperature"].of(content) == 50.0
    assert places.signals["power"] == BlockSignal(10, "REAL", (0.0, 1.0), (0.0, 100.0))
    assert places.signals["power"].of(content) == 25.0


@pytest.mark.parametrize(("find", "put", "parts"), [
    ("block = 12", "block = 0", ("block = 0", "1…65535")), ("block = 12", "blok = 12", ("'blok'",)),
    ("block = 12", "block =", ("no TOML",)), ("byte = 4\n", "", ("[temperature]", "no byte")),
    ("byte = 4\n", "byte = 4\nregister = 2\n", ("byte and register",)), ("byte = 4", "byte = -1", ("byte = -1",)),
    ('"INT"', '"int16"', ("format = 'int16'", "INT")), ("raw = [0, 27648]", "raw = [1, 1]", ("raw = [1, 1]",)),
    ("raw = [0, 27648]", "raw = 5", ("raw = 5",)), ("range = [-50, 150.0]", "range = [nan, 1]", ("range",)),
    ("[temperature]", "[temp]", ("'temp'",)), ("interval_s = 0.5", "interval_s = 0", ("interval_s = 0",)),
    ('"UDINT"', '"REAL"', ("[counter]", "whole")), ("raw = [0, 27648]", "raws = [0, 1]", ("'raws'",)),
    ('"INT"', '["INT"]', ("format = ['INT']", "INT")), ('"INT"', "{a = 1}", ("format = {'a': 1}", "INT")),
    ("byte = 4", f"byte = {'9' * 4400}", ("no TOML",)), ("raw = [0, 27648]", f"raw = {'[' * 3000}", ("no TOML",)),
    ("raw = [0, 27648]", f"raw = [0, {'9' * 350}]", ("raw",)), ("raw = [0, 27648]", "raw = [0, 1e-320]", ("raw",)),
    ("interval_s = 0.5", f"interval_s = {'9' * 350}", ("interval_s",)),
    ("interval_s = 0.5", "interval_s = nan", ("interval_s = nan",)),
    ("[power]\n", "[power]\nhigh = 3\n", ("'high'", "[power]"))])
def test_a_bad_entry_is_told(tmp_path, find, put, parts):
    path = tmp_path / "oven.toml"
    assert find in GOOD
    path.write_text(GOOD.replace(find, put, 1))
    with pytest.raises(DocumentError) as refused:
        places_in(path)
    assert all(part in str(refused.value) for part in ("oven.toml", *parts)), refused.value


def test_no_file_is_told(tmp_path):
    with pytest.raises(DocumentError, match="cannot be read"):
        places_in(tmp_path / "none.toml")


_JUNK = ["[", "]", "{}", "nan", "-1", "1e400", '""', "[]", "[1, 2, 3]", "true", "=", "\0", "é", "[[temperature]]",
         "2020-01-01", "[[0, 1], [1, 2]]", "9" * 350, "1e-320", "\n"]


@pytest.mark.law
def test_a_damaged_map_is_read_or_refused_in_one_line_whatever_the_damage(tmp_path):
    path, rng, words = tmp_path / "oven.toml", random.Random(4), GOOD.replace("\n", " \n ").split(" ")
    for _ in range(tried(400, 1200)):
        damaged = list(words)
        for place in rng.sample(range(len(words)), rng.randint(1, 3)):
            damaged[place] = rng.choice([*_JUNK, "", rng.choice(words)])
        path.write_text(" ".join(damaged), encoding="utf-8")
        try:
            places = places_in(path)
        except DocumentError as problem:
            refused = str(problem)
        else:
            refused = "oven.toml"
            assert all(isinstance(signal.of(bytes(200_000)), float) for signal in places.signals.values())
        assert "oven.toml" in refused
