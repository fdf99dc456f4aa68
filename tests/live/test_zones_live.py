"""n zones of one PLC: simulated, recorded, written and watched, against SciPy's network and the memory of the virtual PLC."""

import json
import math
import struct

import numpy as np
import pytest
from scipy.linalg import expm
from tests.live.conftest import hasty_clock, pymodbus, snap7
from tests.zones.networks import balance, chain

from heatertune.cli import main
from heatertune.codec import DATA, to_json
from heatertune.errors import DocumentError, ExportRefused, InputError, LinkDown, ReplyLost, UnknownName
from heatertune.live.client.connection import address_of
from heatertune.live.experiment import restore
from heatertune.live.hold import Hold
from heatertune.live.joint.virtual_zones import virtual_zones
from heatertune.live.joint.zone_blocks import zones_places
from heatertune.live.joint.zones_watch import ZonesWatch, read_proven_zones
from heatertune.live.joint.zones_write import ZonesWriteRequest, apply_zones, inspect_zones, restore_zones
from heatertune.live.poller import Snapshot
from heatertune.live.recorder import RecordingSetup, record
from heatertune.live.serve import Simulation
from heatertune.live.write.plc_block import LinkSettings, Peer
from heatertune.live.write.proven_words import Declared
from heatertune.live.write.writer import WriteOutcome
from heatertune.plc.ramp import Ramp
from heatertune.proof.proof_document import with_digest
from heatertune.zones import design_zones, network_by_hand, prove_zones, read_zones
from heatertune.zones.zones_folder import prove_again, read_zones_design, to_document

NETWORK = chain(2, 1.0)
SETPOINTS = (50.0, 55.0)
#: first byte of the GAIN of an s7-300's block; of its setpoint, reading and output, whole numbers (the manual's page of the live commands)
GAIN, SP, PV, OUT = 8, 4, 2, 6
RANGE = Declared(range_degC=(0.0, 100.0))


@pytest.fixture(scope="module")
def document():
    return dict(to_document(design_zones(network_by_hand(NETWORK), "s7-300", SETPOINTS)))


@pytest.fixture
def folder(document, tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / "state"))
    return stored(tmp_path / "oven", document)


def stored(folder, document):
    (folder / DATA).mkdir(parents=True, exist_ok=True)
    (folder / DATA / "zones.json").write_text(to_json(document), encoding="utf-8")
    return folder


@pytest.fixture
def serve(folder):
    begun = []

    def served(**settings):
        begun.append(virtual_zones(folder, Simulation(**{"serve": ("s7",), "rate": 400.0} | settings), noise_degC=0.0))
        return begun[-1]

    yield served
    for each in begun:
        each.close()


def blocks(served):
    return [part.memory.image() for part in served.plc.parts]


def set_gains(served, *values):
    for part, value in zip(served.plc.parts, values, strict=True):
        part.memory.carry_out(part.block.words["GAIN"].start, struct.pack(">f", value))


def request(folder, served, **changed):
    return ZonesWriteRequest(**{
        "proven": read_proven_zones(folder), "address": address_of(served.zone_places()[0]["urls"]["s7"]), "declared": RANGE,
        "link": LinkSettings(clock=hasty_clock()), "watch": False} | changed)


def test_the_zones_that_are_served_move_as_the_coupled_heat_balance_says(serve):
    """SciPy's exact network, given the powers that clients read, has the temperatures that clients read."""
    served = serve(step=True, rate=1.0)
    host, port = served.addresses["s7"]
    client = snap7.Client()
    client.connect(host, 0, 2, port)
    rows = []
    for _ in range(150):
        served.release(1)
        cells = [client.db_read(number, 0, 8) for number in (100, 110)]
        rows.append([struct.unpack_from(">h", each, at)[0] for at in (PV, OUT) for each in cells])
    client.disconnect()
    counts = np.array(rows, dtype=float)
    temperatures, powers = 100.0 * counts[:, :2] / 27648.0, 100.0 * counts[:, 2:] / 27648.0
    assert temperatures[-1] == pytest.approx(SETPOINTS, abs=2.0)
    states, inputs, constant = balance(NETWORK)
    step = served.scan_s / 8.0  # dead times of 12 s are 30 of these
    block = np.zeros((4, 4))
    block[:2, :2], block[:2, 2:] = states, np.eye(2)
    exact = expm(block * step)
    degC = np.array(NETWORK.ambients_degC)
    held = np.repeat(powers, 8, axis=0)
    late = round(NETWORK.dead_times_s[0] / step)
    predicted = []
    for k in range(len(held)):
        if k % 8 == 0:
            predicted.append(degC)
        arriving = held[k - late] if k >= late else np.zeros(2)
        degC = exact[:2, :2] @ degC + exact[:2, 2:] @ (inputs @ arriving + constant)
    assert np.abs(np.array(predicted) - temperatures).max() < 0.25  # the PWM's ripple, and a tick of 0.4 s of the dead time


@pytest.mark.long(seconds=20)
def test_zones_on_a_ramp_are_served_on_it(tmp_path):
    fitted = network_by_hand(NETWORK)
    proof = design_zones(fitted, "s7-300", SETPOINTS)
    ramped = prove_zones(proof.design.with_ramp(Ramp(step=70, calls=2)), fitted, proof.specification, up_to_failure=True)
    place = stored(tmp_path / "ramped", to_document(ramped))
    with virtual_zones(place, Simulation(serve=("s7",), step=True, rate=1.0), noise_degC=0.0) as served:
        asked = []
        for _ in range(130):
            served.release(1)
            asked.append([struct.unpack_from(">h", cells, SP)[0] for cells in blocks(served)])
        begun = struct.unpack_from(">h", blocks(served)[0], PV)[0]
    rows = np.array(asked)
    ambient = 22 * 27648 // 100  # the first reading; then 70 counts every second call, up to the setpoint
    for zone, setpoint in enumerate(SETPOINTS):
        wanted = [min(ambient + 70 * ((k + 1) // 2), int(setpoint * 276.48)) for k in range(130)]
        assert rows[:, zone].tolist() == wanted
    assert begun > ambient


@pytest.mark.parametrize("protocol", ["s7", "modbus"])
def test_a_record_of_all_zones_is_a_log_of_zones_again(serve, folder, tmp_path, protocol):
    served = serve(serve=(protocol,))
    address = address_of(served.zone_places()[0]["urls"][protocol])
    so_far = record(address, tmp_path / "log.csv", zones_places(folder, address), RecordingSetup(for_s=400.0))
    text = (tmp_path / "log.csv").read_text()
    assert "a_temperature_degC,a_power_pct,a_setpoint_degC,b_temperature_degC,b_power_pct,b_setpoint_degC" in text
    log = read_zones(tmp_path / "log.csv", ["a", "b"])
    assert len(log.time_s) == so_far.rows
    assert np.allclose(log.setpoints_degC, SETPOINTS, atol=0.01)
    assert log.temperatures_degC[-1] == pytest.approx(list(so_far.last.signals.values())[::3])
    scans = log.time_s / served.scan_s
    assert scans == pytest.approx(np.round(scans))


def test_the_second_zone_is_ten_blocks_or_a_hundred_registers_further(serve):
    served = serve(serve=("s7", "modbus"))
    (s7_host, s7_port), (host, port) = served.addresses.values()
    client = pymodbus.ModbusTcpClient(host, port=port)
    assert client.connect()
    other = snap7.Client()
    other.connect(s7_host, 0, 2, s7_port)
    for _ in range(10_000):  # until the first scan
        if client.read_holding_registers(2, count=1, device_id=1).registers[0]:
            break
    for number, first, zone in ((100, 0, 0), (110, 100, 1)):
        registers = client.read_holding_registers(first, count=18, device_id=1).registers
        cells = other.db_read(number, 0, 36)
        assert registers[2] == int.from_bytes(cells[4:6], "big") == round(276.48 * SETPOINTS[zone])
    assert client.read_holding_registers(50, count=4, device_id=1).isError()
    client.close()
    other.disconnect()


def test_a_fault_is_of_one_zone_or_of_the_plc(serve):
    served = serve(faults=("zone=b t=0 heater-open", "zone=a t=0 sensor-off"), rate=math.inf, intervals=100)
    served.wait()
    first, second = (part.block.signals["temperature"].of(image) for part, image in zip(
        served.plc.parts, blocks(served), strict=True))
    assert first == pytest.approx(100.0, abs=0.01)  # the end of the card
    assert second == pytest.approx(22.0, abs=0.5)  # its neighbour gets no power either, as its sensor reads too much
    for text, wrong in (("t=0 heater-open", InputError), ("zone=b t=0 cut", InputError), ("zone=z t=0 sensor-off", UnknownName),
                        ("zone=b t=0 mains=-10", InputError)):
        with pytest.raises(wrong):
            serve(faults=(text,))


def test_a_write_puts_all_zones_and_a_rollback_brings_all_back(serve, folder):
    served = serve()
    set_gains(served, 4.0, 4.5)
    before = blocks(served)
    wanted = request(folder, served)
    with pytest.raises(InputError, match="--confirm"):
        apply_zones(wanted, "123456")
    done = apply_zones(wanted, wanted.proven.yes)
    assert (done.outcome, list(done.ends)) == (WriteOutcome.DONE, ["a", "b"])
    gains = [struct.unpack_from(">f", image, part.block.words["GAIN"].start)[0] for part, image in zip(
        served.plc.parts, blocks(served), strict=True)]
    assert gains == [words.values["GAIN"] for words in wanted.proven.design.words]
    assert Hold(wanted.address).way_back() is None
    ends, digits = inspect_zones(done.record)
    assert set(ends) == {"a", "b"}
    assert restore_zones(done.record, digits, LinkSettings(clock=hasty_clock())).is_done
    for part, image, was in zip(served.plc.parts, blocks(served), before, strict=True):
        at = part.block.words["GAIN"].start
        assert image[at : at + 4] == was[at : at + 4]


def test_a_zone_that_refuses_takes_the_others_back(serve, folder):
    served = serve(faults=("zone=b t=0 write-protected",))
    set_gains(served, 4.0, 4.5)
    wanted = request(folder, served)
    done = apply_zones(wanted, wanted.proven.yes)
    assert done.outcome is WriteOutcome.ROLLED_BACK, done
    assert {zone: end.outcome for zone, end in done.ends.items()} == {"a": WriteOutcome.ROLLED_BACK, "b": WriteOutcome.NOT_DONE}
    assert struct.unpack_from(">f", blocks(served)[0], served.plc.parts[0].block.words["GAIN"].start)[0] == 4.0
    assert Hold(wanted.address).way_back() is None


def test_a_link_that_breaks_between_two_zones_leaves_one_way_back_of_all(serve, folder, monkeypatch):
    served = serve()
    set_gains(served, 4.0, 4.5)
    wanted, down, write, look = request(folder, served), [False], Peer.write, Peer._look

    def broken_write(peer, part, content):
        if peer.address.block == 110:
            write(peer, part, content)
            down[0] = True
            raise ReplyLost("the link is down")
        write(peer, part, content)

    def broken_look(peer):
        if down[0]:
            raise LinkDown("the link is down")
        return look(peer)

    monkeypatch.setattr(Peer, "write", broken_write)
    monkeypatch.setattr(Peer, "_look", broken_look)
    done = apply_zones(wanted, wanted.proven.yes)
    assert done.outcome is WriteOutcome.UNKNOWN
    assert "experiment --restore" in done.message
    way_back = Hold(wanted.address).way_back()
    assert {part.address.rpartition("/")[2] for part in way_back.parts} == {"db100", "db110"}
    with pytest.raises(InputError, match="has not ended"):
        apply_zones(wanted, wanted.proven.yes)
    monkeypatch.setattr("heatertune.live.hold.LATE_S", 0.0)
    assert restore(wanted.address) is True
    gains = [struct.unpack_from(">f", image, part.block.words["GAIN"].start)[0] for part, image in zip(
        served.plc.parts, blocks(served), strict=True)]
    assert gains == [4.0, 4.5]


def test_a_fault_of_the_program_itself_takes_back_the_zone_that_it_was_writing_too(serve, folder, monkeypatch):
    served = serve()
    set_gains(served, 4.0, 4.5)
    wanted, write = request(folder, served), Peer.write

    def faulty_write(peer, part, content):
        write(peer, part, content)
        if peer.address.block == 110:
            monkeypatch.setattr(Peer, "write", write)
            raise ZeroDivisionError

    monkeypatch.setattr(Peer, "write", faulty_write)
    with pytest.raises(ZeroDivisionError):
        apply_zones(wanted, wanted.proven.yes)
    gains = [struct.unpack_from(">f", image, part.block.words["GAIN"].start)[0] for part, image in zip(
        served.plc.parts, blocks(served), strict=True)]
    assert gains == [4.0, 4.5]
    assert Hold(wanted.address).way_back() is None


def test_words_that_swing_together_in_between_are_not_written(serve, folder):
    served = serve(faults=("t=0 cpu-stop",))
    set_gains(served, 90.0, 90.0)
    proven = read_proven_zones(folder)
    own = [dict(words.values) for words in proven.design.words]
    assert not proven.open_in_between(own)
    assert "swing together" in proven.open_in_between([own[0], {**own[1], "GAIN": 90.0}])
    assert "no PID" in proven.open_in_between([own[0], {**own[1], "GAIN": 0.0}])
    done = apply_zones(request(folder, served), proven.yes)
    assert done.outcome is WriteOutcome.NOT_DONE
    assert "no order of writing is proven" in done.message
    assert "CPU is in STOP" in done.message


def test_a_design_that_was_changed_or_does_not_pass_is_not_written(document, tmp_path):
    changed = json.loads(to_json(document))
    changed["zones"][1]["words"]["GAIN"] *= 1.5
    with pytest.raises(DocumentError, match="changed"):
        read_proven_zones(stored(tmp_path / "1", changed))
    with pytest.raises(ExportRefused, match="zone b"):  # with a digest that fits
        read_proven_zones(stored(tmp_path / "2", with_digest(changed)))
    failed = with_digest({**document, "verdict": "FAIL"})
    with pytest.raises(ExportRefused, match="FAIL"):
        read_proven_zones(stored(tmp_path / "3", failed))
    narrow = json.loads(to_json(document))
    narrow["provenance"]["specification"]["limits"]["tolerance_degC"] = 1e-4
    with pytest.raises(ExportRefused, match="FAIL"):
        read_proven_zones(stored(tmp_path / "4", with_digest(narrow)))
    whole = read_zones_design(stored(tmp_path / "5", document))
    assert prove_again(whole).verdict == "PASS"


def test_a_watch_has_a_line_for_each_zone_and_finds_the_one_that_leaves(serve, folder, tmp_path, capsys):
    served = serve(rate=4000.0)
    where = served.zone_places()[0]["urls"]["s7"]
    served.plc.wait(0.5)
    assert main(["watch", where, "--design", str(folder), "-o", str(tmp_path / "w.csv"), "--duration", "300", "--quiet"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("WELL")
    assert [line.partition(",")[0] for line in lines[1:3]] == ["a: WELL", "b: WELL"]


@pytest.mark.parametrize("options", [["--refit"], ["--monitor", "monitor"]], ids=lambda options: options[0])
def test_a_watch_of_zones_refuses_what_is_of_one_heater_with_a_way_on(folder, tmp_path, capsys, options):
    address, log = "s7://127.0.0.1:1/0/2/db100", tmp_path / "w.csv"  # nobody is asked: port 1 has no PLC
    assert main(["watch", address, "--design", str(folder), "-o", str(log), *options]) == 2
    told = capsys.readouterr().err
    assert f"{options[0]}: not for zones" in told
    assert "leave it out" in told
    assert not log.exists()


def test_a_swing_of_all_zones_is_outside_the_limits_of_the_proof(folder):
    """±2.5 °C, as three zones swing that pass alone; an offset beyond the tolerance; a reading that is none."""
    proven = read_proven_zones(folder)

    def watched(course, setpoints=SETPOINTS):
        watch = ZonesWatch(proven)
        for k in range(400):
            degC = course(4.0 * k)
            watch.see(Snapshot(4.0 * k, {"a temperature": degC[0], "a setpoint": setpoints[0], "b temperature": degC[1],
                                         "b setpoint": setpoints[1]}))
        return [each.well for each in watch.zones]

    assert watched(lambda _: SETPOINTS) == [True, True]
    assert watched(lambda t: (50.0 + 2.5 * math.sin(t / 20.0), 55.0 - 2.5 * math.sin(t / 20.0))) == [False, False]
    assert watched(lambda _: (50.0, 57.0)) == [True, False]
    assert watched(lambda t: (math.nan if t > 1000.0 else 50.0, 55.0)) == [False, True]
    assert watched(lambda t: (22.0 + 28.0 * -math.expm1(-t / 60.0), 22.0 + 33.0 * -math.expm1(-t / 60.0))) == [True, True]


def test_what_is_wrong_with_one_zone_is_told_of_it_alone(folder):
    """Courses of zone b in 700 scans of 4 s: at rest, frozen, drifted, swinging, jumping; zone a holds its setpoint."""
    proven, k = read_proven_zones(folder), np.arange(700)
    held, rest = NETWORK.holding_pct(SETPOINTS), np.zeros(700)

    def watched(degC, more_pct, at_a=rest):
        watch = ZonesWatch(proven)
        for scan in range(700):
            watch.see(Snapshot(4.0 * scan, {
                "a temperature": SETPOINTS[0] + at_a[scan], "a setpoint": SETPOINTS[0], "a power": held[0],
                "b temperature": SETPOINTS[1] + degC[scan], "b setpoint": SETPOINTS[1], "b power": held[1] + more_pct[scan]}))
        return [" ".join(each.notes()) for each in watch.zones]

    noise = np.random.default_rng(1).normal(0.0, 0.02, 700).round(2)
    assert watched(noise, rest) == ["", ""]
    warmer = 0.8 * (k > 300)  # a neighbour that heats b by as much less power as its controller gives: no frozen sensor
    assert watched(rest, -warmer / 1.2, warmer) == ["", ""]
    for degC, more_pct, told in ((rest, 8.0 * (k > 300), "the sensor is frozen"), (noise, 15.0 * (k > 400), "at rest, at first"),
                                 (2.5 * np.sin(k / 1.5), rest, "swings by")):
        quiet, found = watched(degC, more_pct)
        assert told in found
        assert quiet == ""
    quiet, found = watched(38.0 * (k > 500), rest)
    assert "has risen from" in found
    assert "the sensor is frozen" in quiet  # as so hot a neighbour would move it


def test_the_command_shows_what_it_would_write_and_the_line_that_writes_it(serve, folder, capsys):
    served = serve()
    set_gains(served, 4.0, 4.5)
    assert main(["write", str(folder), served.zone_places()[0]["urls"]["s7"], "--range", "0", "100"]) == 0
    out = capsys.readouterr().out
    digits = read_zones_design(folder).digest[:8]
    assert "1. zone a: GAIN 4 -> " in out
    assert "2. zone b: GAIN 4.5 -> " in out
    assert out.splitlines()[-1].endswith(f"--range 0 100 --apply --confirm {digits}")


def test_a_folder_with_two_designs_is_refused(folder, capsys):
    (folder / DATA / "words.json").write_text("{}")
    for command in (["simulate", str(folder)], ["write", str(folder), "s7://127.0.0.1:1/0/2/db100"],
                    ["record", "s7://127.0.0.1:1/0/2/db100", "--design", str(folder), "-o", "x.csv"]):
        assert main(command) == 2
        assert "give each a folder of its own" in capsys.readouterr().err


def test_simulate_refuses_what_zones_do_not_have(folder):
    for changed in ({"story": True}, {"sample": 1}, {"serve": ("opcua",)}, {"dead_man": 3}):
        with pytest.raises(InputError):
            virtual_zones(folder, Simulation(**changed))
