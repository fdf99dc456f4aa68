"""OPC UA: what stands in the address space, index ranges as OPC 10000-4 has them, and servers that know none.

Codes of units: UNECE Recommendation 20, CEL and P1, whose letters are the numbers (OPC 10000-8, section 5.6.4.3).
"""

import struct
import time
from contextlib import contextmanager
from datetime import timedelta
from queue import Queue

import pytest
from tests.live.conftest import DB, LENGTH, PROTOCOLS, words_of

from heatertune.errors import LinkDown, PlcRefused, ReplyLost
from heatertune.live.client.connection import address_of, connect
from heatertune.live.simulator_status import OWN, OWN_LENGTH, SimulatorStatus

ua = pytest.importorskip("asyncua.ua", reason="asyncua is not installed")
sync = pytest.importorskip("asyncua.sync")
nodes = pytest.importorskip("heatertune.live.opcua_server")
opcua = pytest.importorskip("heatertune.live.opcua_server")
theirs = pytest.importorskip("heatertune.live.client.opcua")
pytestmark = PROTOCOLS[2].marks

BLOCK, ZONE = f"ns=2;s=DB{DB}", "ns=2;s=DeviceZone"
Kind = ua.VariantType


@contextmanager
def asking(plc):
    """The library's own client, which knows nothing of ours."""
    host, port = plc.addresses["opcua"]
    with sync.Client(f"opc.tcp://{host}:{port}/", timeout=10) as client:
        yield client


def put(client, node, value, kind, index_range=None):
    client.get_node(node).write_attribute(ua.AttributeIds.Value, ua.DataValue(ua.Variant(value, kind)), index_range)


def names(node):
    return {child.read_browse_name().Name for child in node.get_children()}


def test_each_word_has_its_name_its_exact_type_and_its_place(served, words):
    plc = served(serve="opcua")
    plc.release(3)
    with asking(plc) as client:
        objects = {child.nodeid.to_string() for child in client.nodes.objects.get_children()}
        assert {BLOCK, f"ns=2;s=DB{OWN}", ZONE} <= objects
        assert names(client.get_node(BLOCK)) == set(words.values)
        image = client.get_node(BLOCK).read_value()
        assert image == plc.plc.memory.image()
        for name, value in words.values.items():
            found = client.get_node(f"{BLOCK}.{name}").read_data_value().Value
            assert found.VariantType == (Kind.Byte if name == "STEU" else Kind.Int16)  # its high byte is the system's
            assert found.Value == (1023 if name == "W" else value)  # 50 °C of 0…100 °C in 2047 units
        own = SimulatorStatus(client.get_node(f"ns=2;s=DB{OWN}").read_value())
        for name in ("intervals", "scans", "released", "heartbeat", "status", "power_pct", "reading", "shown", "interval_s"):
            assert client.get_node(f"ns=2;s=DB{OWN}.{name}").read_value() == getattr(own, name)


def test_the_words_of_an_s7_200_are_floats(served):
    pid = words_of("s7-200-pid")
    plc = served(pid, serve="opcua")
    plc.release(2)
    with asking(plc) as client:
        found = client.get_node("ns=2;s=DB1.KC").read_data_value().Value
        assert (found.VariantType, found.Value) == (Kind.Float, pid.values["KC"])
        assert client.get_node(f"{ZONE}.Temperature.SetValue").read_value() == pytest.approx(50.0, abs=1e-5)


def test_a_device_zone_shows_temperature_setpoint_and_power_with_their_units(served):
    plc = served(serve="opcua")
    told = plc.release(40)
    with asking(plc) as client:
        assert names(client.get_node(f"{ZONE}.Temperature")) == {"ActualValue", "SetValue"}
        for node, expected, unit in (("Temperature.ActualValue", told.temperature_degC, 4408652), ("Temperature.SetValue", 50.0, 4408652),
                                     ("ActualRegulationRatio", told.power_pct, 20529)):
            there = client.get_node(f"{ZONE}.{node}")
            assert there.read_value() == pytest.approx(expected, abs=100.0 / 2047)
            assert there.get_child("0:EngineeringUnits").read_value().UnitId == unit
            span = there.get_child("0:EURange").read_value()
            assert (span.Low, span.High) == (0.0, 100.0)
            assert there.read_type_definition() == ua.NodeId(ua.ObjectIds.AnalogItemType)


def test_a_setpoint_that_is_written_acts(served):
    plc = served(serve="opcua")
    plc.release(1)
    with asking(plc) as client:
        put(client, f"{ZONE}.Temperature.SetValue", 60.0, Kind.Double)
        assert plc.plc.memory.read(DB, 18, 2) == struct.pack(">h", 1228)  # 60 °C · 2047/100
        plc.release(600)
        assert client.get_node(f"{ZONE}.Temperature.ActualValue").read_value() == pytest.approx(60.0, abs=1.0)


@pytest.mark.parametrize(("node", "value", "kind", "span", "said"), [
    (f"{BLOCK}.K", 5, Kind.Int32, None, "BadTypeMismatch"), (f"{BLOCK}.K", 5.0, Kind.Double, None, "BadTypeMismatch"),
    (f"{BLOCK}.K", [5, 6], Kind.Int16, None, "BadTypeMismatch"), (f"{BLOCK}.K", None, Kind.Null, None, "BadTypeMismatch"),
    (BLOCK, b"\0" * (LENGTH - 1), Kind.ByteString, None, "BadOutOfRange"), (BLOCK, b"\0" * (LENGTH + 1), Kind.ByteString, None, "BadOutOfRange"),
    (BLOCK, b"\0\0", Kind.ByteString, "2:4", "BadIndexRangeDataMismatch"), (BLOCK, b"\0\0", Kind.ByteString, "97:98", "BadIndexRangeNoData"),
    (BLOCK, b"\0", Kind.ByteString, "x", "BadIndexRangeInvalid"), (f"{BLOCK}.K", 5, Kind.Int16, "0", "BadIndexRangeNoData"),
    (f"{ZONE}.Temperature.SetValue", 1e9, Kind.Double, None, "BadOutOfRange"),
    (f"{ZONE}.Temperature.SetValue", float("nan"), Kind.Double, None, "BadOutOfRange"),
    (f"{ZONE}.Temperature.SetValue", float("inf"), Kind.Double, None, "BadOutOfRange"),
    (f"{ZONE}.Temperature.ActualValue", 1.0, Kind.Double, None, "BadNotWritable"),
    (f"ns=2;s=DB{OWN}.scans", 1, Kind.UInt32, None, "BadNotWritable"),
    ("i=2259", 1, Kind.Int32, None, "BadUserAccessDenied")])
def test_what_is_not_to_be_written_is_refused_and_changes_nothing(one, node, value, kind, span, said):
    plc, client = one
    before = [plc.plc.memory.read(number, 0, plc.plc.memory.block_size(number)) for number in (DB, OWN)]
    with pytest.raises(ua.UaStatusCodeError) as refused:
        put(client, node, value, kind, span)
    assert type(refused.value).__name__ == said
    assert before == [plc.plc.memory.read(number, 0, plc.plc.memory.block_size(number)) for number in (DB, OWN)]


@pytest.fixture(scope="module")
def still(heater):
    """A virtual PLC that stands still, for many questions."""
    from tests.live.conftest import CONDITIONS  # noqa: PLC0415

    from heatertune import virtual_plc  # noqa: PLC0415

    with virtual_plc(words_of("s5-ob251"), heater, CONDITIONS, serve="opcua", step=True) as plc:
        yield plc


@pytest.fixture
def one(still):
    with asking(still) as client:
        yield still, client


@pytest.mark.parametrize(("text", "expected"), [
    ("0", (0, 1)), ("7", (7, 8)), ("0:1", (0, 2)), ("12:97", (12, 98)),
    *[(text, None) for text in ("", ":", "3:", ":3", "3:3", "4:3", "-1", "1:2:3", "1,2", "²", " 1")]])
def test_an_index_range_is_read_as_the_specification_has_it(text, expected):
    """OPC 10000-4, section 7.27: one number, or two of which the first is smaller."""
    if expected is None:
        with pytest.raises(ua.uaerrors.BadIndexRangeInvalid):
            nodes.range_of(text)
    else:
        assert nodes.range_of(text) == expected


def test_part_of_a_block_is_read_and_written_and_the_rest_stays(one):
    plc, client = one
    before = plc.plc.memory.image()
    for span, part in (("0", slice(0, 1)), ("3:4", slice(3, 5)), ("96:97", slice(96, 98))):
        asked = ua.ReadValueId(ua.NodeId.from_string(BLOCK), ua.AttributeIds.Value, span)
        found, = client.tloop.post(client.aio_obj.uaclient.session.read(ua.ReadParameters(NodesToRead=[asked])))
        assert found.Value.Value == before[part]
        put(client, BLOCK, bytes(~byte & 0xFF for byte in before[part]), Kind.ByteString, span)
        changed = [at for at, (old, new) in enumerate(zip(before, plc.plc.memory.image(), strict=True)) if old != new]
        assert changed == list(range(LENGTH))[part]
        put(client, BLOCK, before, Kind.ByteString)
        assert plc.plc.memory.image() == before


def test_nobody_adds_a_node(one):
    with pytest.raises(ua.UaStatusCodeError):
        one[1].nodes.objects.add_object(2, "mine")


def test_one_request_is_of_one_instant(served):
    plc = served(serve="opcua", step=False, rate=float("inf"))
    with asking(plc) as client:
        there = [client.get_node(f"ns=2;s=DB{OWN}{name}") for name in (".intervals", "", ".shown", ".temperature_degC")]
        seen = set()
        for _ in range(60):
            intervals, own, shown, temperature = client.read_values(there)
            told = SimulatorStatus(own)
            assert (told.intervals, told.shown, told.temperature_degC) == (intervals, shown, temperature)
            seen.add(intervals)
        assert len(seen) > 1


def test_the_source_timestamp_is_the_plants_own_time(served):
    plc = served(serve="opcua")
    with asking(plc) as client:
        there = client.get_node(BLOCK)
        first = there.read_data_value()
        plc.release(25)
        last = there.read_data_value()
    assert last.SourceTimestamp - first.SourceTimestamp == timedelta(seconds=25 * plc.scan_s)
    assert timedelta(0) <= last.ServerTimestamp - first.ServerTimestamp < timedelta(seconds=25 * plc.scan_s)


def test_who_subscribes_is_told_each_change_with_the_plants_time(served):
    plc, told = served(serve="opcua"), Queue()

    class Handler:
        def datachange_notification(self, node, value, data):
            told.put((node.nodeid.Identifier, value, data.monitored_item.Value.SourceTimestamp))

    with asking(plc) as client:
        subscription = client.create_subscription(20, Handler())
        subscription.subscribe_data_change(client.get_node(f"ns=2;s=DB{OWN}.intervals"))
        seen = [told.get(timeout=30)]
        for _ in range(3):
            plc.release(2)
            seen.append(told.get(timeout=30))
        put(client, f"{BLOCK}.K", 77, Kind.Int16)  # nobody subscribed to it
        subscription.delete()
    assert [value for _, value, _ in seen] == [0, 2, 4, 6]
    assert [when - seen[0][2] for _, _, when in seen] == [timedelta(seconds=number * plc.scan_s) for number in (0, 2, 4, 6)]
    assert told.empty()


@pytest.mark.parametrize(("fault", "reads", "writes"), [
    ("db-missing", "BadNodeIdUnknown", "BadNodeIdUnknown"), ("write-protected", None, "BadNotWritable"),
    ("db-short", None, "BadIndexRangeNoData")])
def test_what_is_wrong_with_the_block_is_told(served, fault, reads, writes):
    plc = served(serve="opcua", faults=f"t=0 {fault} until=8")
    plc.release(1)
    with asking(plc) as client:
        found = client.get_node(BLOCK).read_data_value(raise_on_bad_status=False)
        assert found.StatusCode.name == (reads or "Good")
        assert reads or len(found.Value.Value) == (48 if fault == "db-short" else LENGTH)
        with pytest.raises(ua.UaStatusCodeError) as refused:
            put(client, BLOCK, b"\1\2", Kind.ByteString, "96:97")
        assert type(refused.value).__name__ == writes
        plc.release(2)
        put(client, BLOCK, b"\1\2", Kind.ByteString, "96:97")


# other servers


class _Ranges(opcua.AttributeService):
    """What a server does that heeds index ranges, for arrays alone; or says whatever status it is told to."""

    says = None

    def read(self, params):
        found, wanted = super().read(params), params.NodesToRead
        if wanted[0].IndexRange and isinstance(found[0].Value.Value, list):
            at = [int(each) for each in wanted[0].IndexRange.split(":")]
            return [ua.DataValue(ua.Variant(found[0].Value.Value[at[0]:at[-1] + 1], found[0].Value.VariantType))]
        return found

    async def write(self, params, user=None):
        wanted, = params.NodesToWrite
        if self.says is not None and wanted.IndexRange:
            return [ua.StatusCode(self.says)]
        held = self._aspace.read_attribute_value(wanted.NodeId, wanted.AttributeId).Value
        if wanted.IndexRange and isinstance(held.Value, list):
            first = int(wanted.IndexRange.split(":")[0])
            new = wanted.Value.Value.Value
            wanted.Value = ua.DataValue(ua.Variant([*held.Value[:first], *new, *held.Value[first + len(new):]], held.VariantType))
        return await super().write(params, user)


CONTENT = bytes(range(10))


@pytest.fixture(scope="module")
def another():
    """The library's own server, which takes no notice of the index range of a ByteString."""
    server = sync.Server()
    service = server.aio_obj.iserver.attribute_service = _Ranges(server.aio_obj.iserver.aspace)
    server.aio_obj.disable_clock()
    server.set_endpoint("opc.tcp://127.0.0.1:0/UA/")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    index = server.register_namespace("urn:another")
    held = {}
    for name, value, kind in (("Bytes", list(CONTENT), Kind.Byte), ("String", CONTENT, Kind.ByteString), ("Number", 5, Kind.Int16)):
        held[name] = server.nodes.objects.add_variable(ua.NodeId(name, index), name, value, kind)
        held[name].set_writable()
    server.start()
    port = server.aio_obj.bserver.port
    yield f"opc.tcp://127.0.0.1:{port}/UA/ns={index};s=", held, service
    server.stop()


def test_an_array_of_bytes_is_a_block_too(another):
    where, held, _ = another
    with connect(address_of(where + "Bytes"), 10.0) as client:
        assert client.read(7, 2, 3) == CONTENT[2:5]
        client.write(7, 2, b"\xfe\xff")
        client.write(7, 9, b"\x63")
        assert bytes(held["Bytes"].read_value()) == b"\x00\x01\xfe\xff\x04\x05\x06\x07\x08\x63"


def test_a_server_that_pays_no_heed_to_index_ranges_is_not_written_to(another):
    where, held, _ = another
    with connect(address_of(where + "String"), 10.0) as client:
        assert client.read(7, 2, 3) == CONTENT[2:5]
        with pytest.raises(PlcRefused, match="pays no heed to index ranges"):
            client.write(7, 2, b"\xfe\xff")
        assert held["String"].read_value() == CONTENT


def test_a_node_that_is_no_block_is_told(another):
    with connect(address_of(another[0] + "Number"), 10.0) as client:
        with pytest.raises(PlcRefused, match="holds Int16, not a ByteString"):
            client.read(7, 0, 2)
        with pytest.raises(PlcRefused, match="BadNodeIdUnknown"):  # nor a simulator
            client.read(OWN, 0, OWN_LENGTH)


@pytest.mark.parametrize(("says", "error"), [
    ("BadNotWritable", PlcRefused), ("BadUserAccessDenied", PlcRefused), ("BadWriteNotSupported", PlcRefused),
    ("BadTimeout", ReplyLost), ("BadNoCommunication", ReplyLost), ("BadUnexpectedError", ReplyLost),
    ("GoodCompletesAsynchronously", ReplyLost), ("GoodClamped", ReplyLost), ("UncertainInitialValue", ReplyLost)])
def test_only_what_says_that_nothing_was_written_is_a_refusal(another, monkeypatch, says, error):
    """A gateway that hears nothing from the PLC behind it does not know either, and what is clamped is not as asked for."""
    where, _, service = another
    monkeypatch.setattr(service, "says", getattr(ua.StatusCodes, says))
    with connect(address_of(where + "Bytes"), 10.0) as client, pytest.raises(error, match=says):
        client.write(7, 2, b"\xfe\xff")


def test_a_lost_answer_before_the_write_leaves_it_unsent(another, monkeypatch):
    """It is asked first whether it heeds index ranges."""
    with connect(address_of(another[0] + "Bytes"), 10.0) as client:
        async def silent(*_):
            raise TimeoutError("silence")

        monkeypatch.setattr(client, "_value", silent)
        with pytest.raises(LinkDown, match=r"reading byte 0.*before writing"):
            client.write(7, 2, b"\xfe\xff")


def test_a_channel_is_renewed_before_it_ends(another):
    with connect(address_of(another[0] + "Bytes"), 10.0) as client:
        client._open_since = before = time.monotonic() - 0.8 * 3600.0
        assert client.read(7, 0, 1)
        assert client._open_since > before + 1.0
        assert client.read(7, 0, 1)


def test_who_wants_encryption_is_told_as_nobody(monkeypatch):
    server = sync.Server()
    server.aio_obj.disable_clock()
    server.set_endpoint("opc.tcp://127.0.0.1:0/")
    server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
    server.start()
    try:
        with pytest.raises(LinkDown, match="no OPC UA connection"):
            connect(address_of(f"opc.tcp://127.0.0.1:{server.aio_obj.bserver.port}/db30"), 10.0)
    finally:
        server.stop()
