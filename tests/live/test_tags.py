"""A PID_Compact by the names of its members over OPC UA, as an S7-1200 or S7-1500 shows its optimized instance.

The names are those of the function manual "S7-1200, S7-1500 PID control" (PID_Compact V2, static tags), written down here again; what stands
in the virtual PLC is read from its own memory, and over OPC UA by the library's client alone.
"""

import json
import struct

import pytest
from tests.bench.kills import told
from tests.bench.sessions import KINDS, folder_in
from tests.conftest import state_with_key
from tests.live.conftest import words_of

from heatertune import virtual_plc
from heatertune.errors import InputError, PlcRefused
from heatertune.live.client.connection import address_of, connect
from heatertune.live.serve import read_folder
from heatertune.live.simulator_status import OWN
from heatertune.live.write.plc_block import block_image

ua = pytest.importorskip("asyncua.ua", reason="asyncua is not installed")
Client = pytest.importorskip("asyncua.sync", reason="asyncua is not installed").Client

pytestmark = pytest.mark.long

#: tag → the word; a global block beside it has the words where `tests.bench.sessions` says
TAGS = {
    '"Retain"."CtrlParams"."Gain"': "Gain", '"Retain"."CtrlParams"."Ti"': "Ti", '"Retain"."CtrlParams"."Td"': "Td",
    '"Retain"."CtrlParams"."TdFiltRatio"': "TdFiltRatio", '"Retain"."CtrlParams"."PWeighting"': "PWeighting",
    '"Retain"."CtrlParams"."DWeighting"': "DWeighting", '"Retain"."CtrlParams"."Cycle"': "Cycle",
    '"Config"."OutputUpperLimit"': "OutputUpperLimit", '"Config"."OutputLowerLimit"': "OutputLowerLimit",
    '"IntegralResetMode"': "IntegralResetMode"}
#: tag → its first byte in that block
SIGNALS = {'"Setpoint"': 0, '"ScaledInput"': 4, '"Output"': 8}
PLACES = KINDS["pid-compact"].places


@pytest.fixture(autouse=True)
def own_state(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", state_with_key(tmp_path / "state"))
    monkeypatch.setattr("heatertune.live.hold.LATE_S", 0.3)


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    return folder_in(tmp_path_factory.mktemp("tags"), "pid-compact")


@pytest.fixture
def plc(made):
    words, model, conditions = read_folder(made)
    found = {**words.values, "Gain": 3.0, "Ti": 80.0}
    with virtual_plc(type(words)(**{**{name: getattr(words, name) for name in words.__dataclass_fields__}, "values": found}), model,
                     conditions, serve="opcua", rate=400.0) as plc:
        yield plc


def by_names(plc):
    host, port = plc.addresses["opcua"]
    return f'opc.tcp://{host}:{port}/ns=3;s="PID_Compact_1".*'


def stands(plc, name):
    at, form = PLACES[name]
    return struct.unpack_from(form, plc.plc.memory.image(), at)[0]


def test_each_member_is_a_node_with_its_own_type(plc):
    host, port = plc.addresses["opcua"]
    client = Client(f"opc.tcp://{host}:{port}/", timeout=10)
    client.connect()
    try:
        assert client.get_namespace_array()[3] == "http://www.siemens.com/simatic-s7-opcua"
        for tag, word in TAGS.items():
            value = client.get_node(f'ns=3;s="PID_Compact_1".{tag}').read_data_value().Value
            assert value.Value == stands(plc, word), tag
            assert value.VariantType == (ua.VariantType.Int16 if word == "IntegralResetMode" else ua.VariantType.Float)
        seen = client.get_node('ns=3;s="PID_Compact_1"."ScaledInput"').read_value()
        assert 10.0 < seen < 60.0
        client.get_node('ns=3;s="PID_Compact_1"."Retain"."CtrlParams"."Gain"').write_value(ua.Variant(2.5, ua.VariantType.Float))
        assert stands(plc, "Gain") == 2.5
    finally:
        client.disconnect()


def test_the_tags_are_read_and_written_as_the_bytes_of_the_block(plc):
    with connect(address_of(by_names(plc)), 10.0) as client:
        image = client.read(1, 0, 52)
        for word, (at, form) in PLACES.items():
            assert struct.unpack_from(form, image, at)[0] == stands(plc, word), word
        assert client.read(1, 16, 8) == image[16:24]
        assert client.sign_of_life().stamp is not None
        assert client.read(OWN, 0, 4)
        client.write(1, PLACES["Ti"][0], struct.pack(">f", 77.5))
        assert stands(plc, "Ti") == 77.5
        for start, content in ((12, bytes(8)), (13, bytes(4)), (50, b"\1"), (16, bytes(2))):
            with pytest.raises(PlcRefused, match="these are not one tag"):
                client.write(1, start, content)
        assert (stands(plc, "Gain"), stands(plc, "Ti")) == (3.0, 77.5)


def test_an_instance_that_is_not_there_is_refused_by_the_name_of_its_tag(plc):
    with connect(address_of(by_names(plc).replace("Compact_1", "Compact_2")), 10.0) as client, \
            pytest.raises(PlcRefused, match=r'"PID_Compact_2"\."\w+".* refused: BadNodeIdUnknown'):
        client.read(1, 0, 52)


def test_words_are_written_by_names_one_after_the_other_and_put_back(plc, made, tmp_path):
    given, proven = by_names(plc), read_folder(made)[0].values
    yes = told("write", made, given)[1].split("--confirm ")[1].split()[0].rstrip(".,;")
    requests, write = [], plc.plc.memory.write
    plc.plc.memory.write = lambda *sent: (requests.append(sent[1:]), write(*sent))[1]
    record = tmp_path / "r.jsonl"
    status, said = told("write", made, given, "--apply", "--confirm", yes, "--range", 0, 100, "--no-watch", "--record", record, "--quiet")
    assert (status, said[:4]) == (0, "DONE"), said
    assert (stands(plc, "Gain"), stands(plc, "Ti")) == (pytest.approx(proven["Gain"]), pytest.approx(proven["Ti"]))
    assert {(start, len(content)) for start, content in requests} == {(12, 4), (16, 4)}
    digest = json.loads(record.read_text().splitlines()[0])["sha256"]
    status, said = told("rollback", record, "--apply", "--confirm", digest[:8], "--quiet", "--unproven")
    assert (status, stands(plc, "Gain"), stands(plc, "Ti")) == (0, 3.0, 80.0), said


def test_rows_are_recorded_and_the_words_of_another_controller_refused(plc, made, tmp_path):
    log = tmp_path / "log.csv"
    status, said = told("record", by_names(plc), "--design", made, "-o", log, "--duration", 600, "--quiet")
    assert status == 0, said
    rows = [line.split(",") for line in log.read_text().splitlines() if line[:1].isdigit()]
    assert len(rows) > 3
    assert "a row may hold quantities of two scans" in log.read_text()
    assert all(len(row) == 4 and float(row[3]) == 50.0 for row in rows)
    with pytest.raises(InputError, match=r"only the tags of a PID_Compact \(pid-compact\) are known; enter its parameters manually"):
        block_image(words_of("pid-temp"), address_of(by_names(plc)), {})
