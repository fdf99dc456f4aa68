"""Programs of an earlier design do not lie beside the record of a new one, which fails or is for another controller."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.zones.networks import chain, logged, steps

from heatertune.cli import main
from heatertune.codec import ZONES_FILE
from heatertune.proof.words_file import exported_names

HEATER = ("--gain", "0.9", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")


@pytest.fixture
def pid(tmp_path):
    path = tmp_path / "pid.json"
    assert main(["tune", *HEATER, "-o", str(path), "--quiet"]) == 0
    return str(path)


def _programs(folder):
    """Names of the files in a folder."""
    return {path.name for path in Path(folder).iterdir() if path.is_file()}


@pytest.mark.parametrize("moved", [False, True])
def test_an_export_for_another_controller_takes_the_programs_of_the_one_before_away(pid, tmp_path, moved, capsys):
    out = tmp_path / "out"
    assert main(["export-db", pid, "--target", "s7-300", "--setpoint", "50", "--out", str(out)]) == 0
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    if moved:  # as an earlier release laid a folder out
        for path in (out / "data").iterdir():
            path.rename(out / path.name)
        (out / "data").rmdir()
    assert {"s7_300_pid.awl", "s7_300_words.csv"} <= _programs(out)
    assert main(["export-db", pid, "--target", "fb41", "--setpoint", "50", "--out", str(out)]) == 0
    names = _programs(out)
    assert not {name for name in names if name.startswith("s7_300")}
    assert any("fb41" in name for name in names)
    assert "notes.txt" in names, "what nobody exported stays"
    capsys.readouterr()


def test_a_design_that_fails_takes_the_programs_of_one_that_passed_away(tmp_path, capsys):
    log = tmp_path / "log.csv"
    log.write_text("t_s,temp_C,power_pct\n" + "\n".join(
        f"{time},{22.0 + 0.9 * 50.0 * (1.0 - 2.718281828 ** (-max(0.0, time - 12.0) / 167.0)):.3f},50" for time in range(0, 1500, 4)), encoding="utf-8")
    out = tmp_path / "out"
    asked = ["design", str(log), "--target", "s7-300", "--setpoint", "50", "--out", str(out), "--ambient", "22", "--quiet"]
    assert main([*asked, "--force"]) in {0, 1}  # the program is there, whatever this log leaves open
    assert "s7_300_pid.awl" in _programs(out)
    assert main([*asked, "--limit", "overshoot=0.001%"]) == 1
    assert _programs(out) == {"report.html"}
    assert json.loads((out / "data" / "proof.json").read_text(encoding="utf-8"))["verdict"] != "PASS"
    capsys.readouterr()


@pytest.mark.parametrize("text", [None, "", "[]", "{}", '{"files": 3}', '{"files": ["../other", 5, "a/b", "zone1_a/../b", "zone1_a/b/c", "/zone1_a/b", "", "..", "zone1_a/..", "zone1_a/."]}', "\x00", "[" * 100_000])
def test_a_document_that_tells_no_names_takes_nothing_away(tmp_path, text):
    path = tmp_path / Path(ZONES_FILE).name
    if text is not None:
        path.write_text(text, encoding="utf-8")
    assert exported_names(path) == []


@pytest.mark.long(seconds=15)
def test_programs_in_the_folders_of_zones_go_with_their_design(tmp_path, capsys):
    network = chain(2, 1.0, lag=150.0)
    powers = np.vstack([steps(2, 4000), np.full((900, 2), 50.0)])
    instants, readings, logged_pct = logged(network, powers, 1.0, 2, np.random.default_rng(1), 0.02)
    rows = [f"{t},{','.join(map(str, [*reading, *power]))}" for t, reading, power in zip(instants, readings, logged_pct, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,a_temp_C,b_temp_C,a_power_pct,b_power_pct", *rows]), encoding="utf-8")
    out = tmp_path / "out"
    asked = ["design", str(tmp_path / "log.csv"), "--zones", "a,b", "--setpoint", "60", "--out", str(out), "--quiet"]
    assert main([*asked, "--target", "klipper"]) == 0
    program = out / "zone1_a" / "klipper_heater.cfg"
    assert program.is_file()
    (out / "zone1_a" / "notes.txt").write_text("mine", encoding="utf-8")
    assert main([*asked, "--target", "klipper", "--limit", "overshoot=0.001%"]) == 1
    assert not program.exists()
    assert (out / "zone1_a" / "notes.txt").is_file()
    capsys.readouterr()
