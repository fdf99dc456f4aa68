"""`heatertune read`, and the line that every command prints of a log."""

import json
import random
import shlex

import numpy as np
import pytest
from tests.bench import drawn_exports as messy
from tests.conftest import heater_log

from heatertune.cli import parser
from heatertune.cli.common import reading
from heatertune.log import read_log


def _write(folder, text, name="log.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def test_read_shows_rows_roles_assumptions_and_the_command_that_repeats_them(run, tmp_path):
    rows = "\n".join(f"{2 * k};{20 + 0.5 * k:.1f};{60 if k > 9 else 0};7".replace(".", ",") for k in range(40))
    path = _write(tmp_path, f"Export;;;\nZeit;Istwert;Stellgrad;Druck\n{rows}\n")
    status, out, err = run("read", path)
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == (
        "log.csv: 40 rows every 2 s; time = 'Zeit' [s, assumed], temperature = 'Istwert' [°C, from a room's temperature], power = 'Stellgrad' "
        "[0…100 %, assumed], setpoint = none; not used: 'Druck'"
    )
    assert "2              20.5          0" in out
    assert "- 1 title line above the table skipped (up to line 1)." in out
    assert out.splitlines()[-1] == (
        f"heatertune read {path} --skip-rows 1 --time-column Zeit --temperature-column Istwert --power-column Stellgrad "
        "--setpoint-column none --time-unit s --temperature-unit degC --power-full-scale 100"
    )


@pytest.mark.parametrize("writer", messy.WRITERS, ids=lambda writer: writer.__name__)
def test_the_command_it_shows_gives_the_same_log_with_nothing_assumed(run, tmp_path, writer):
    for number in range(2):
        found = writer(random.Random(f"cli-{number}"))
        path = _write(tmp_path, found.text, encoding=found.encoding)
        options = [text for name, value in found.options.items() for text in (f"--{name.replace('_', '-')}", value) if value is not True]
        options += [f"--{name.replace('_', '-')}" for name, value in found.options.items() if value is True]
        status, out, err = run("read", path, *options, "--json")
        if found.truth is None:
            assert (status, out, err.count("\n")) == (2, "", 1)
            assert found.named in err
            continue
        document = json.loads(out)
        again = shlex.split(document["command"])[1:]
        log = read_log(path, reading(parser().parse_args(again)))
        assert messy.differs(log, found.truth) == ""
        repeated = json.loads(run(*again, "--json")[1])
        assert (repeated["command"], repeated["first_rows"]) == (document["command"], document["first_rows"])
        assert "assumed" not in repeated["taken"]["line"]


@pytest.mark.long
def test_the_line_is_printed_by_every_command_that_reads_a_log_also_when_quiet(run, tmp_path):
    path = _write(tmp_path, heater_log(0.5, 3))
    line = "[log] log.csv: 240 rows every 5 s; time = 'time [s]' [s], temperature = 'T [°C]' [°C], power = 'power [%]' [0…100 %], setpoint = none"
    model = tmp_path / "model.json"
    assert run("fit", path, "-o", model, "--quiet")[2] == line + "\n"
    assert json.loads(model.read_text())["log_summary"] == [line.removeprefix("[log] ")]
    assert run("validate", model, path, "--quiet")[2] == line + "\n"
    _, _, err = run("design", path, "--target", "s5-ob251", "--setpoint", 40, "--out", tmp_path / "out", "--quiet")
    assert err == line + "\n"
    assert json.loads((tmp_path / "out" / "data" / "log.json").read_text())["taken"]["line"] == line.removeprefix("[log] ")
    assert "log.csv: 240 rows every 5 s" in (tmp_path / "out" / "report.html").read_text()
    assert run("fit", path, "--quiet", "--json")[2] == ""
    assert line in run("fit", path, "--json")[2]


@pytest.mark.long
def test_repairs_of_more_than_a_hundredth_of_the_rows_are_a_finding(run, tmp_path):
    lines = heater_log(0.5, 3).splitlines()
    for share, found in ((2, []), (3, ["log.csv: 1.25% of 240 rows were left out or repaired"])):
        for k in range(share):
            cells = lines[50 + 40 * k].split(";")
            lines[50 + 40 * k] = f"{cells[0]};;{cells[2]}"
        path = _write(tmp_path, "\n".join(lines) + "\n")
        document = json.loads(run("fit", path, "--skip-empty", "--json")[1])
        assert [each["message"] for each in document["findings"] if each["name"] == "repaired"] == found


def test_a_log_may_be_cut_before_it_is_shown(run):
    document = json.loads(run("read", "table4", "--until", 300, "--json")[1])
    assert document["taken"]["rows"] == 240, "what was taken of the file"
    assert np.isclose(document["first_rows"][0]["time_s"], 10.0)
