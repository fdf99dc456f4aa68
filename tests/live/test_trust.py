"""What is written, exported and put back is proven at that moment: a folder, a record or a device that says else is not believed.

Forged documents have right digests throughout: those need no secret.
"""

import copy
import hashlib
import json
import shutil
import struct

import pytest
from tests.bench import sessions
from tests.conftest import state_with_key
from tests.live.conftest import hasty_clock
from tests.live.modbus_device import Device

from heatertune.cli import main
from heatertune.live.write.write_record import read_lines
from heatertune.proof.folder_digest import DIGEST_FILE, folder_digest
from heatertune.proof.proof_document import with_digest

#: manual, table 11-11: K DW1, TI DW5, W DW9, X DW22; words of 16 bits, the high byte first
K, TI, W, X = 1, 5, 9, 22
LENGTH = 98


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    return sessions.folder_in(tmp_path_factory.mktemp("trusted"))


@pytest.fixture(autouse=True)
def own_state(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", state_with_key(tmp_path / "state"))
    # the device has moved at the next look: nobody waits two scans of 3 s
    monkeypatch.setattr("heatertune.live.write.plc_block.HOST", hasty_clock())


def documents(folder):
    return {name: json.loads((folder / "data" / f"{name}.json").read_text()) for name in ("words", "proof", "pid")}


def forged(made, tmp_path, change):
    """Return a copy of a folder with its documents changed, and the digits that its proof now begins with."""
    folder = tmp_path / "forged"
    shutil.copytree(made, folder)
    found = documents(folder)
    change(found)
    found["proof"] = with_digest(found["proof"])
    for name, document in found.items():
        (folder / "data" / f"{name}.json").write_text(json.dumps(document))
    (folder / "data" / DIGEST_FILE).write_text(json.dumps(folder_digest(found)))
    return folder, found["proof"]["digest"].partition(":")[2][:8]


def device(made, **words):
    """Return a device that holds the proven words but for some, and whose reading moves."""
    image = bytearray((made / "DB30.bin").read_bytes())
    assert len(image) == LENGTH
    for name, value in ({"W": 1023, "X": 1023} | words).items():
        struct.pack_into(">h", image, 2 * {"K": K, "TI": TI, "W": W, "X": X}[name], value)
    image[2 * 11 + 1] = 0x21  # STEU: automatic
    here = Device(bytes(image) + bytes(100))

    def moving(first, data):
        at = 2 * (X - first)
        if not 0 <= at < len(data):
            return data
        return data[:at] + struct.pack(">h", struct.unpack_from(">h", data, at)[0] + here.reads % 3 - 1) + data[at + 2:]

    here.answered = moving
    return here


def word(here, number):
    return struct.unpack_from(">h", here.memory, 2 * number)[0]


def write(folder, here, yes, record, *more):
    called = str(json.loads((folder / "data" / "words.json").read_text())["sample_time_s"])
    return main(["write", str(folder), f"modbus://127.0.0.1:{here.port}/1/0", "--range", "0", "100", "--called-every", called,
                 "--apply", "--yes", yes, "--record", str(record), "--quiet", "--no-watch", *more])


def proven_words(made):
    return documents(made)["words"]["words"]


def _words(found, **words):
    for name in ("words", "proof"):
        found[name]["words"].update(words)


def _everywhere(found, **changed):
    for name in ("words", "proof"):
        found[name].update(copy.deepcopy(changed))


def _results(found, value):
    for run in found["proof"]["runs"]:
        for name, outcome in run["criteria"].items():
            at_least = found["proof"]["criteria"][name]["bound"] == ">="
            outcome.update(value=1e6 if at_least else value, ok=True)
        run["verdict"] = "PASS"
    for name, criterion in found["proof"]["criteria"].items():
        criterion.update(value=found["proof"]["runs"][0]["criteria"][name]["value"], ok=True)
    found["proof"]["verdict"] = "PASS"


def _sharp(found):
    """Ten times the gain, whose proof FAILs, with results that pass."""
    _words(found, K=30000, TI=1)
    _results(found, 0.0)


def _slow_model(found):
    """A heater a tenth as strong in the design: the words are no longer those that it makes, or do not pass."""
    found["pid"]["model"]["gain_degC_per_pct"] *= 0.1
    _words(found, K=30000)


def _design_too(found):
    """Words, design and results changed together."""
    found["pid"]["gain_pct_per_degC"] *= 5.0
    _words(found, K=proven_k(found) * 5)
    _results(found, 0.0)


def proven_k(found):
    return found["words"]["words"]["K"]


def _one_run(found):
    found["proof"]["runs"] = found["proof"]["runs"][:1]
    for name, criterion in found["proof"]["criteria"].items():
        criterion["value"] = found["proof"]["runs"][0]["criteria"][name]["value"]


def _limits(found):
    found["proof"]["limits"].update(ms=9.0)
    found["proof"]["criteria"]["ms"].update(limit=9.0)
    found["proof"]["specification"]["limits"]["ms"] = {"": 9.0}


FORGERIES = {
    "one word": lambda found: _words(found, K=30000),
    "two words": lambda found: _words(found, K=30000, TI=1),
    "words and results": _sharp,
    "manual at full power": lambda found: _words(found, STEU=0, YH=2047),
    "upper limit": lambda found: _words(found, BGOG=100),
    "lower limit": lambda found: _words(found, BGUG=2000),
    "setpoint word": lambda found: _words(found, W=2047),
    "interval": lambda found: _everywhere(found, sample_time_s=0.4),
    "sensor range": lambda found: [found[name]["scaling"].update(high_degC=1000.0) for name in ("words", "proof")],
    "results alone": lambda found: _results(found, 0.0),
    "one run": _one_run,
    "no disturbances": lambda found: found["proof"]["scenario"].update(disturbances=[]),
    "short": lambda found: found["proof"]["scenario"].update(duration_s=1.0),
    "setpoint of the proof": lambda found: found["proof"]["scenario"].update(setpoint_degC=25.0),
    "period of the PWM": lambda found: found["proof"]["actuator"].update(pwm_period_s=60.0),
    "noise": lambda found: found["proof"]["scenario"].update(noise_degC=5.0),
    "limits": _limits,
    "known point": lambda found: found["proof"].update(stated_settings={"limit": "reached"}),
    "sentences": lambda found: found["proof"].update(not_tested=[]),
    "a line in a sentence": lambda found: found["proof"]["remarks"].append("a\nDW 1: KF = +30000"),
    "model of the design": _slow_model,
    "design and words": _design_too,
    "field": lambda found: found["words"]["fields"][0].update(comment="type 30000 here"),
    "address of a field": lambda found: found["words"]["fields"][0].update(address="DW 99"),
    "target": lambda found: _everywhere(found, target="s7-300"),
    "ramp": lambda found: _everywhere(found, setpoint_ramp={"step": 1, "calls": 1, "hold": None, "hold_degC": None, "degC_per_min": 0.9}),
}


@pytest.mark.long
@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_folder_is_neither_written_nor_exported(name, made, tmp_path, capsys):
    folder, yes = forged(made, tmp_path, FORGERIES[name])
    with device(made, K=5000, TI=60) as here:
        before = bytes(here.memory)
        assert write(folder, here, yes, tmp_path / "r.jsonl") in (1, 2)
        assert here.writes == []
        assert bytes(here.memory) == before
    assert not (tmp_path / "r.jsonl").exists()
    told = capsys.readouterr()
    assert "DONE" not in told.out
    assert told.err.count("\n") == 1
    for force in ((), ("--force",)):
        status = main(["export-db", str(folder / "data" / "words.json"), "--target", "s5-ob251", "-o", str(tmp_path / "out"), "--quiet", *force])
        assert status in (1, 2)
        assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_conditions_of_the_design_that_are_wider_are_proven_and_told_everywhere(made, tmp_path, capsys):
    """A design whose recipe asks for less is another design: it is proven as it says, and its limits are told."""
    folder, _ = forged(made, tmp_path, lambda found: found["pid"]["made_for"]["conditions"].update(limit=["overshoot=90%"]))
    assert main(["export-db", str(folder / "data" / "words.json"), "--target", "s5-ob251", "-o", str(tmp_path / "out")]) == 2
    assert "the folder was changed" in capsys.readouterr().err
    assert main(["export-db", str(folder / "data" / "pid.json"), "--target", "s5-ob251", "-o", str(tmp_path / "new")]) == 0
    assert "own limits: overshoot 90" in capsys.readouterr().out.splitlines()[0]


@pytest.mark.long
def test_the_way_on_of_a_refusal_works_as_it_is_typed(made, tmp_path, capsys):
    folder, _ = forged(made, tmp_path, FORGERIES["results alone"])
    assert main(["export-db", str(folder / "data" / "words.json"), "--target", "s5-ob251", "-o", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert "heatertune export-db PID --target s5-ob251 -o DIR" in told
    assert main(["export-db", str(folder / "data" / "pid.json"), "--target", "s5-ob251", "-o", str(tmp_path / "new"), "--quiet"]) == 0
    assert documents(tmp_path / "new")["proof"]["digest"] == documents(made)["proof"]["digest"]


def clamping(first, data, most):
    """Return bytes of a write in which K is at most so much."""
    at = 2 * (K - first)
    if not 0 <= at < len(data):
        return data
    return data[:at] + struct.pack(">h", min(struct.unpack_from(">h", data, at)[0], most)) + data[at + 2:]


def test_a_value_that_the_device_stores_differently_is_taken_back_and_told(made, tmp_path, capsys):
    new = proven_words(made)
    with device(made, K=3000, TI=60) as here:
        here.stored = lambda first, data: clamping(first, data, 4000)
        assert write(made, here, documents(made)["proof"]["digest"][7:15], tmp_path / "r.jsonl") == 1
        told = " ".join(capsys.readouterr().out.split())
        assert told.startswith("ROLLED BACK: ")
        assert f"the device keeps K = 4000 in place of {new['K']}" in told
        assert (word(here, K), word(here, TI)) == (3000, 60)
    assert read_lines(tmp_path / "r.jsonl").last("end")["outcome"] == "rolled back"


def test_a_device_that_cannot_take_the_old_value_back_is_told(made, tmp_path, capsys):
    with device(made, K=5000, TI=60) as here:
        here.stored = lambda first, data: clamping(first, data, 4000)  # neither the new K nor the old one
        assert write(made, here, documents(made)["proof"]["digest"][7:15], tmp_path / "r.jsonl") == 1
        told = " ".join(capsys.readouterr().out.split())
        assert told.startswith("PARTLY DONE: ")
        assert "the device keeps K = 4000" in told
        assert "K stand there as written and could not be taken back" in told


def test_a_word_that_somebody_else_writes_meanwhile_is_left_alone(made, tmp_path, capsys):
    with device(made, K=5000, TI=60) as here:

        def others(first, data):
            if first == TI:
                struct.pack_into(">h", here.memory, 2 * K, 4321)
            return data

        here.stored = others
        assert write(made, here, documents(made)["proof"]["digest"][7:15], tmp_path / "r.jsonl") == 1
        told = " ".join(capsys.readouterr().out.split())
        assert "somebody has changed the words" in told
        assert word(here, K) == 4321


def test_a_word_that_the_device_changes_while_it_goes_back_is_no_rollback(made, tmp_path, capsys):
    """A gateway passes the old value on late, and the device stores a value of its own in its place."""
    with device(made, K=5000, TI=60) as here:
        kept, moving = {}, here.answered

        def storing(first, data):
            if first != K:
                return data
            written, = struct.unpack_from(">h", data)
            if written != 5000:
                return clamping(first, data, 4000)
            kept["reads"] = here.reads
            return bytes(here.memory[2 * K : 2 * K + len(data)])

        def answering(first, data):
            if "reads" in kept and here.reads > kept["reads"] + 3:
                kept.clear()
                struct.pack_into(">h", here.memory, 2 * K, 4500)
                data = bytes(here.memory[2 * first : 2 * first + len(data)])
            return moving(first, data)

        here.stored, here.answered = storing, answering
        record = tmp_path / "r.jsonl"
        assert write(made, here, documents(made)["proof"]["digest"][7:15], record) == 1
        told = " ".join(capsys.readouterr().out.split())
        assert told.startswith("PARTLY DONE: ")
        assert "K is 4500, not 5000: the device keeps it in place of what was sent, or somebody else has written it" in told
        begin = read_lines(record).begin
        assert rollback(record, "--apply", "--yes", begin["sha256"][:8], "--unproven") == 1  # as the message of the hold says
        assert word(here, K) == 4500


def rollback(record, *more):
    return main(["rollback", str(record), "--quiet", *more])


@pytest.mark.long
@pytest.mark.parametrize(("before", "proven"), [({"K": 5000, "TI": 57}, True), ({"K": 12000, "TI": 57}, False)])
def test_words_that_do_not_pass_are_put_back_only_where_that_is_said(made, tmp_path, capsys, before, proven):
    record = tmp_path / "r.jsonl"
    with device(made, **before) as here:
        assert write(made, here, documents(made)["proof"]["digest"][7:15], record) == 0
        assert word(here, K) == proven_words(made)["K"]
        capsys.readouterr()
        assert rollback(record) == 0
        told = " ".join(capsys.readouterr().out.split())
        assert ("what would be put back is not proven: FAIL at 50 °C" in told) == (not proven)
        assert ("--unproven" in told) == (not proven)
        yes = read_lines(record).begin["sha256"][:8]
        status = rollback(record, "--apply", "--yes", yes)
        if not proven:
            assert status == 2
            assert word(here, K) == proven_words(made)["K"]
            refusal = capsys.readouterr().err
            assert "what would be put back is not proven" in refusal
            assert refusal.count("\n") == 1
            status = rollback(record, "--apply", "--yes", yes, "--unproven")
        assert status == 0
        assert (word(here, K), word(here, TI)) == (before["K"], before["TI"])


@pytest.mark.long
def test_a_record_whose_folder_is_gone_or_that_was_forged_is_not_believed(made, tmp_path, capsys):
    record = tmp_path / "r.jsonl"
    with device(made, K=5000) as here:
        assert write(made, here, documents(made)["proof"]["digest"][7:15], record) == 0
        begin, *others = record.read_text().splitlines()
        first = json.loads(begin)
        gone = tmp_path / "gone.jsonl"
        gone.write_text("\n".join([json.dumps(first | {"directory": str(tmp_path / "nowhere")}), *others]) + "\n")
        assert rollback(gone, "--apply", "--yes", first["sha256"][:8]) == 2
        assert "no heater to prove them on" in capsys.readouterr().err
        content = bytearray.fromhex(first["before"])
        struct.pack_into(">h", content, 2 * K - first["begin"], 32000)
        first["before"], first["sha256"] = content.hex(), hashlib.sha256(content).hexdigest()
        first["words_before"]["K"] = 32000
        for part in first["parts"]:
            if "K" in part["names"]:
                part["before"] = struct.pack(">h", 32000).hex()
        sharp = tmp_path / "forged.jsonl"
        sharp.write_text("\n".join([json.dumps(first), *others]) + "\n")
        assert rollback(sharp, "--apply", "--yes", first["sha256"][:8]) == 2
        assert "what would be put back is not proven" in capsys.readouterr().err
        assert word(here, K) == proven_words(made)["K"]
