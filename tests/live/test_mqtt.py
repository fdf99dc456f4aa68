"""Logs from a broker: as Home Assistant, Tasmota and controllers of kilns publish them, and what is no reading.

The broker is `tests.live.mqtt_broker`; what is published comes from the test, or from the library's own client.
"""

import math
import threading

import pytest
from tests.conftest import state_with_key
from tests.live.mqtt_broker import Broker

from heatertune import read_log
from heatertune.cli import main
from heatertune.errors import DocumentError, InputError, LinkDown
from heatertune.live import recorder
from heatertune.live.client.connection import address_of
from heatertune.live.controller_block import Topic, places_in
from heatertune.live.poller import Poller
from heatertune.live.recorder import RecordingSetup, record

mqtt = pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed")
MqttSource = pytest.importorskip("heatertune.live.mqtt_source").MqttSource

KILN = """
[temperature]
topic = "kiln/status"
path = "temps.0"
raw = [32, 212]
range = [0, 100]
[power]
topic = "kiln/ssr"
[setpoint]
topic = "kiln/status"
path = "target"
raw = [32, 212]
range = [0, 100]
"""


@pytest.fixture(autouse=True)
def own_state(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", state_with_key(tmp_path / "state"))
    monkeypatch.setattr(recorder, "_PAUSES_S", (0.0, 0.01))


@pytest.fixture
def broker():
    with Broker() as here:
        yield here


def mapped(tmp_path, text=KILN):
    path = tmp_path / "kiln.toml"
    path.write_text(text)
    return places_in(path)


def recorded(broker, tmp_path, deeds, text=KILN, address="mqtt://127.0.0.1:{}"):
    """Record while things are done one after the other, each once the one before is a row or a comment; return the log's lines."""
    path, deeds = tmp_path / "log.csv", iter(deeds)
    seen = []

    def shown(so_far):
        lines = [line for line in path.read_text().splitlines() if line[:1].isdigit() or (line.startswith("# ") and line[2:3].isdigit())]
        if not so_far.trouble and (not seen or len(lines) > seen[-1] or seen[-1] < 0):
            broker.await_listener("kiln/status")
            seen.append(len(lines) if next(deeds, lambda: ended.append(1))() is not True else -1)

    ended = []
    record(address_of(address.format(broker.port)), path, mapped(tmp_path, text), RecordingSetup(every_s=0.001, timeout_s=10.0),
           shown=shown, ended=lambda: bool(ended))
    return path.read_text().splitlines()


def says(broker, topic, payload, retain=False):
    return lambda: broker.publish(topic, payload, retain)


def test_the_topics_of_a_kiln_make_rows_in_degrees_and_percent(broker, tmp_path):
    broker.publish("kiln/ssr", b"OFF", retain=True)
    broker.publish("kiln/status", b'{"temps": [500], "target": 212}', retain=True)  # kept by the broker: of whenever
    lines = recorded(broker, tmp_path, [
        says(broker, "kiln/status", b'{"temps": [212.0, 1], "target": 392}'),
        lambda: [broker.publish("kiln/ssr", b"ON"), broker.publish("kiln/status", b'{"temps": ["68"], "target": 392}')],
        says(broker, "kiln/status", b'{"temps": [122], "target": 212}')])
    assert lines[1] == "time_s,temperature_degC,power_pct,setpoint_degC"
    assert "a row may hold quantities of two scans" in lines[0]
    rows = [tuple(map(float, line.split(",")[1:])) for line in lines if line[:1].isdigit()]
    assert rows == [(100.0, 0.0, 200.0), (20.0, 100.0, 200.0), (50.0, 100.0, 100.0)]


@pytest.mark.parametrize("payload", [b"unavailable", b"{", b'{"temps": []}', b'{"temps": {"0": null}}', b"", b"\xff", b'{"temps": [NaN]}',
                                     b'{"temps": [1e999]}', b'{"temps": ["x"]}', b"[" * 5000, b'{"temps": [[1]]}'])
def test_what_is_no_number_is_a_gap_and_no_row(broker, tmp_path, payload):
    broker.publish("kiln/ssr", b"37.5", retain=True)
    good = b'{"temps": [212], "target": 212}'
    lines = recorded(broker, tmp_path, [says(broker, "kiln/status", good), says(broker, "kiln/status", payload), says(broker, "kiln/status", good)])
    assert [line.split(",")[1:3] for line in lines if line[:1].isdigit()] == [["100", "37.5"]] * 2
    assert sum("no number for temperature" in line for line in lines) == 1


def test_a_broker_that_goes_and_comes_back_is_a_gap(broker, tmp_path):
    good = b'{"temps": [212], "target": 212}'
    broker.publish("kiln/ssr", b"1", retain=True)
    lines = recorded(broker, tmp_path, [says(broker, "kiln/status", good), lambda: broker.cut() or True, says(broker, "kiln/status", good)])
    assert sum(line[:1].isdigit() for line in lines) == 2
    assert any(line.startswith("# gap before") and "the broker has gone" in line for line in lines)


def test_a_user_is_asked_for_and_a_topic_refused(tmp_path, monkeypatch):
    places = mapped(tmp_path)
    with Broker(users={"ha": "secret"}) as broker:
        for address, password in (("mqtt://127.0.0.1:{}", None), ("mqtt://ha@127.0.0.1:{}", "wrong")):
            monkeypatch.setenv("HEATERTUNE_MQTT_PASSWORD", password or "")
            with pytest.raises(LinkDown, match="the broker refuses the connection: Not authorized") as refused:
                MqttSource(address_of(address.format(broker.port)), places, 10.0)
            assert ("mqtt://USER@HOST, and HEATERTUNE_MQTT_PASSWORD" in str(refused.value)) == (password is None)
        monkeypatch.setenv("HEATERTUNE_MQTT_PASSWORD", "secret")
        MqttSource(address_of(f"mqtt://ha@127.0.0.1:{broker.port}"), places, 10.0).close()
    with Broker(refused=("kiln/ssr",)) as broker, pytest.raises(LinkDown, match="the broker refuses the topics"):
        MqttSource(address_of(f"mqtt://127.0.0.1:{broker.port}"), places, 10.0)


def test_nobody_there_and_a_door_without_a_broker_are_told(tmp_path):
    places = mapped(tmp_path)
    with Broker() as broker:
        port = broker.port
    with pytest.raises(LinkDown, match="no connection"):
        MqttSource(address_of(f"mqtt://127.0.0.1:{port}"), places, 1.0)


def test_the_command_records_what_the_librarys_own_client_publishes(broker, tmp_path, capsys):
    mapped(tmp_path, '[temperature]\ntopic = "tele/kiln/SENSOR"\npath = "DS18B20.Temperature"\n[power]\ntopic = "stat/kiln/POWER"\n')
    done = threading.Event()

    def publish():
        broker.await_listener("tele/kiln/SENSOR")
        client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        client.connect("127.0.0.1", broker.port)
        client.loop_start()
        client.publish("stat/kiln/POWER", "ON").wait_for_publish(10)
        number = 0
        while not done.wait(0.02):
            number += 1
            client.publish("tele/kiln/SENSOR", f'{{"DS18B20": {{"Temperature": {20 + number / 8}}}, "TempUnit": "C"}}').wait_for_publish(10)
        client.loop_stop()
        client.disconnect()

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        status = main(["record", f"mqtt://127.0.0.1:{broker.port}", "--map", str(tmp_path / "kiln.toml"), "-o", str(tmp_path / "log.csv"),
                       "--interval", "0.01", "--duration", "2", "--quiet"])
    finally:
        done.set()
        thread.join()
    assert status == 0
    assert "time is this machine's clock" in capsys.readouterr().out
    rows = [line.split(",") for line in (tmp_path / "log.csv").read_text().splitlines() if line[:1].isdigit()]
    assert len(rows) > 3
    assert {power for _, _, power in rows} == {"100"}
    assert read_log(tmp_path / "log.csv").temperature_degC.tolist() == [float(row[1]) for row in rows]
    assert sorted(float(row[1]) for row in rows) == [float(row[1]) for row in rows]


@pytest.mark.parametrize(("text", "part"), [
    ("mqtt://", "no host"), ("mqtt://host/topic", "'/topic' behind the host"), ("mqtt://@host", "no user before @"), ("mqtt://host:0", "port 0"),
    ("mqtt://me:secret@host", "a password in the address; say it in HEATERTUNE_MQTT_PASSWORD")])
def test_an_address_that_is_none_is_told(text, part):
    with pytest.raises(InputError) as refused:
        address_of(text)
    assert part in str(refused.value)
    assert "secret" not in str(refused.value)


@pytest.mark.parametrize(("text", "part"), [
    ('[temperature]\ntopic = ""\n', "[temperature] topic = ''"), ('[temperature]\ntopic = "a/#"\n', "one topic without + and #"),
    ('[temperature]\ntopic = "a"\npath = "x..y"\n', "path = 'x..y'"), ('[temperature]\ntopic = "a"\nbyte = 3\n', "a table with topic, path"),
    ('[temperature]\ntopic = "a"\n[counter]\ntopic = "b"\n', "entry 'counter'"), ('[temperature]\ntopic = "a"\nraw = [1, 1]\n', "two different numbers"),
    ('[temperature]\ntopic = "a"\nraw = [0, 1]\n', "range = None"), ('[temperature]\ntopic = 3\n', "topic = 3")])
def test_a_map_that_is_none_is_told(tmp_path, text, part):
    with pytest.raises(DocumentError) as refused:
        mapped(tmp_path, text)
    assert part in str(refused.value)


def test_a_broker_is_for_recording_alone_and_topics_for_a_broker(tmp_path):
    with pytest.raises(InputError, match=r"topics, and .* is no broker"):
        Poller(address_of("modbus://127.0.0.1/1/0"), mapped(tmp_path))
    with pytest.raises(InputError, match="is for heatertune record alone"):
        Poller(address_of("mqtt://127.0.0.1"), None)
    with pytest.raises(InputError, match="which topics hold temperature and power"):
        MqttSource(address_of("mqtt://127.0.0.1"), None)


@pytest.mark.parametrize(("payload", "path", "value"), [
    (b"21.5", "", 21.5), (b'"21.5"', "", 21.5), (b"on", "", 100.0), (b"false", "", 0.0), (b'{"a": true}', "a", 100.0), (b'{"a": [1, {"b": 2}]}', "a.1.b", 2.0),
    (b'{"a": 1}', "b", math.nan), (b"3", "a", math.nan), (b"nan", "", math.nan), (b"inf", "", math.nan), (b"1e400", "", math.nan), (b"null", "", math.nan)])
def test_a_payload_is_a_number_or_none(payload, path, value):
    assert Topic(topic="t", path=path).of(payload) == pytest.approx(value, nan_ok=True)
