"""Many loops recorded at once from the addresses of their PLCs, and judged.

What a log should hold comes from the virtual PLCs, whose heater and words are known; an address at which nobody
listens, from the system.
"""

import json
import socket
from dataclasses import replace

import numpy as np
import pytest
from tests.live.conftest import CONDITIONS, PROTOCOLS
from tests.live.test_client import way
from tests.live.test_recorder import rows_of

from heatertune import InputError
from heatertune.cli import main
from heatertune.live.controller_block import places_of
from heatertune.live.recorder import RecordedLoop, RecordingSetup, record_addresses, record_all

#: so fast that 400 s pass within one
FAST = {"step": False, "rate": 600.0}
#: a scan in 40 ms: a machine that is busy elsewhere for a second loses 25 of 250 rows
JUDGED = {"step": False, "rate": 100.0}


@pytest.fixture
def nobody():
    """An address at which nobody listens: the port was free a moment ago."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    return f"modbus://127.0.0.1:{port}/1/0"


@pytest.mark.parametrize("protocol", PROTOCOLS[:2])
def test_each_loop_has_its_own_log_and_a_dead_one_stops_no_other(served, words, tmp_path, nobody, protocol):
    plcs = [served(serve=protocol, **FAST) for _ in range(3)]
    loops = [RecordedLoop(f"{number}.csv", way(plc, protocol), places_of(words)) for number, plc in enumerate(plcs)]
    dead = RecordedLoop("dead.csv", loops[0].address.__class__(text=nobody, protocol="modbus", host="127.0.0.1", port=int(
        nobody.split(":")[2].split("/")[0]), way=(1,), block=0), places_of(words))
    told = []
    wrong = record_all([*loops, dead], tmp_path, RecordingSetup(for_s=400.0), shown=told.append)
    assert list(wrong) == ["dead.csv"]
    assert not (tmp_path / "dead.csv").exists()
    for loop in loops:
        rows = rows_of(tmp_path / loop.file)
        assert np.ptp(rows[:, 0]) >= 390.0
        assert rows[-1, 1] > rows[0, 1] - 1.0  # a heat-up, or at rest
    assert told[-1] > 0


def test_when_it_is_enough_all_end(served, words, tmp_path):
    plc = served(serve="modbus", **FAST)
    loops = [RecordedLoop(f"{number}.csv", way(plc, "modbus"), places_of(words)) for number in range(2)]
    assert set(record_all(loops, tmp_path, RecordingSetup(for_s=1e6), ended=lambda: True)) <= {"0.csv", "1.csv"}


def test_what_cannot_be_recorded_is_told(tmp_path, nobody):
    with pytest.raises(InputError, match="no loop was recorded: "):
        record_addresses([nobody], tmp_path / "new", RecordingSetup(for_s=1.0, timeout_s=0.5))
    with pytest.raises(InputError, match="is given twice"):
        record_addresses([nobody, nobody], tmp_path / "other", RecordingSetup(for_s=1.0))
    with pytest.raises(InputError, match="cannot be made for the logs"):
        record_addresses([nobody], tmp_path, RecordingSetup(for_s=1.0))
    path = tmp_path / "list.csv"
    path.write_text("file,name\nmodbus://127.0.0.1/7/0,oven\n")
    with pytest.raises(InputError, match="is none of the addresses given"):
        record_addresses([nobody], tmp_path / "new2", RecordingSetup(for_s=1.0), loops=path)


@pytest.mark.parametrize(("given", "said"), [
    (["s7://127.0.0.1/0/2", "logs", "--duration", "5"], "give addresses alone, or logs alone"),
    (["s7://127.0.0.1/0/2"], "--duration S"), (["logs", "more"], "give one folder"), (["logs", "--duration", "5"], "apply to addresses"),
    (["s7://127.0.0.1/0/2", "--duration", "5", "--resume"], "give their folder in h_logs"),
])
def test_addresses_and_logs_are_told_apart(tmp_path, capsys, monkeypatch, given, said):
    monkeypatch.chdir(tmp_path)
    assert main(["health", *given, "-o", "h.html"]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.long(seconds=60)
def test_the_command_records_running_loops_and_judges_them(served, tmp_path, capsys, monkeypatch, nobody):
    monkeypatch.chdir(tmp_path)
    plcs = [served(serve="modbus", conditions=replace(CONDITIONS, noise_degC=0.1), **JUDGED) for _ in range(2)]
    urls = [plc.urls["modbus"] for plc in plcs]
    (tmp_path / "list.csv").write_text(
        "file,name,setpoint_degC,switch\n" + "".join(f"{url},oven {n},50,ssr\n" for n, url in enumerate(urls, 1)))
    assert main(["health", *urls, nobody, "--duration", "1000", "--loops", "list.csv", "-o", "health.html", "--quiet", "--json",
                 "--jobs", "1", "--target", "s5-ob251"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in told["left_out"]] == [nobody], told["left_out"]
    assert sorted(loop["name"] for loop in told["loops"]) == ["oven 1", "oven 2"]
    assert all(loop["hours"] == pytest.approx(1000.0 / 3600.0, rel=0.1) for loop in told["loops"])
    (folder,) = (tmp_path / "health_logs").iterdir()
    assert sorted(path.name for path in folder.iterdir()) == ["oven_1.csv", "oven_2.csv"]
    page = (tmp_path / "health.html").read_text(encoding="utf-8")
    assert "oven 2" in page
    assert nobody in page
