import json
import subprocess
import sys
from dataclasses import asdict
from itertools import product

import pyarrow.parquet
import pytest
from tests.conftest import ROOT

from heatertune.batch.studies import KEYS, read_study
from heatertune.errors import DocumentError
from heatertune.options import options_of
from heatertune.settings import FitSettings, SampleSettings

HAND = """
[fixed]
gain_degC_per_pct = 0.37
time_constant_s = 167
dead_time_s = 12
ambient_degC = 22
method = "simc"
"""

#: the grid's eight cases, then two more; the last does not fit the words of its target
STUDY = HAND + """setpoint_degC = 40
as_is = true
[grid]
target = ["s5-ob251", "s7-300"]
pwm_period_s = [2, 10.5]
closed_loop_s = [12, 40]
[[case]]
target = "s7-200"
structure = "p"
[[case]]
target = "s5-ob251"
gain_degC_per_pct = 0.1
"""


@pytest.fixture
def study(tmp_path):
    """Write a study, return its path."""
    def write(text):
        path = tmp_path / "study.toml"
        path.write_text(text)
        return path
    return write


def test_cases_are_every_combination_then_the_listed_ones(study):
    found = read_study(study(STUDY))
    fixed = {"gain_degC_per_pct": 0.37, "time_constant_s": 167.0, "dead_time_s": 12.0, "ambient_degC": 22.0,
             "method": "simc", "setpoint_degC": 40.0, "as_is": True}
    grid = [fixed | {"target": target, "pwm_period_s": period, "closed_loop_s": tau}
            for target, period, tau in product(("s5-ob251", "s7-300"), (2.0, 10.5), (12.0, 40.0))]
    listed = [fixed | {"target": "s7-200", "structure": "p"}, fixed | {"target": "s5-ob251", "gain_degC_per_pct": 0.1}]
    assert [found.case(k) for k in range(len(found))] == grid + listed
    assert found.settings_of("target") == ["s7-200", "s5-ob251", "s7-300"]
    assert [key for key in KEYS if key in found.keys] == found.keys


@pytest.mark.parametrize(("text", "told"), [
    ("[fixed\n", "no TOML: "),
    ("", "no cases; expected [grid] with lists, or [[case]]"),
    (HAND, "no cases; expected [grid] with lists, or [[case]]"),
    ("[sweep]\nms = [1.4]\n", "unknown part 'sweep'; known: fixed, grid, case"),
    (HAND + "[grid]\ntargt = ['weg']\n", "[grid]: unknown key 'targt'; did you mean 'target'? known: log, model, gain_degC_per_pct"),
    (HAND + "Ms = 2\n[grid]\ntarget = ['weg']\n", "[fixed]: unknown key 'Ms'; known: log, model"),
    (HAND + "[grid]\ntarget = ['s5']\n", "[grid]: unknown target 's5'; known: s5-ob251, s7-200"),
    (HAND + "[grid]\ntarget = ['weg']\nms = []\n", "[grid]: ms is []; expected a list of at least one setting"),
    (HAND + "[grid]\ntarget = ['weg']\nms = 1.4\n", "[grid]: ms is 1.4; expected a list of at least one setting"),
    (HAND + "[grid]\ntarget = ['weg']\nms = [1.4, '1.6']\n", "[grid]: ms: expected a number, got \"1.6\""),
    (HAND + "[grid]\ntarget = ['weg']\nms = [nan]\n", "[grid]: ms: expected a finite number, got NaN"),
    (HAND + "[grid]\ntarget = ['weg']\nms = [true]\n", "[grid]: ms: expected a number, got true"),
    (HAND + "[grid]\ntarget = ['weg']\nsamples = [1.5]\n", "[grid]: samples: expected a whole number, got 1.5"),
    (HAND + "[grid]\ntarget = ['weg']\nsamples = [-1]\n", "[grid]: samples = -1 is out of range: must be >= 0"),
    (HAND + "[grid]\ntarget = ['weg', 'weg']\n", "[grid]: target is ['weg', 'weg']; expected each setting once"),
    (HAND + "ms = [1.4]\n[[case]]\ntarget = 'weg'\n", "[fixed]: ms is [1.4]; lists belong in [grid]"),
    (HAND + "[[case]]\ntarget = 3\n", "[[case]] 1: target: expected a text, got 3"),
    (HAND + "[[case]]\ntarget = 'weg'\nswitches = 'x'\n", "[[case]] 1: switches: expected an object, got \"x\""),
    (HAND + "[[case]]\ntarget = 'weg'\nswitches = {rails = 1}\n", "switches.rails: expected a text, got 1"),
    (HAND + "[case]\ntarget = 'weg'\n", "expected [[case]], once per case"),
    ("fixed = 3\n[[case]]\ntarget = 'weg'\n", "[fixed]: 3; expected a table of key = setting"),
    (HAND + "[[case]]\nms = 2\n", "[[case]] 1: no target; expected one of s5-ob251"),
    ("[[case]]\ntarget = 'weg'\n", "[[case]] 1: no heater; expected one of log, model, gain_degC_per_pct"),
    (HAND + "[[case]]\ntarget = 'weg'\nlog = 'table4'\n", "[[case]] 1: log and gain_degC_per_pct; expected one of log"),
    ("[[case]]\ntarget = 'weg'\ngain_degC_per_pct = 1\ntime_constant_s = 9\n",
     "[[case]] 1: no dead_time_s; a model given by its parameters needs gain_degC_per_pct, time_constant_s, dead_time_s"),
    ("[fixed]\nlog = 'table4'\n[grid]\ntarget = ['weg']\ndead_time_s = [3]\n",
     "[grid]: dead_time_s needs gain_degC_per_pct"),
    (HAND + "[[case]]\ntarget = 'weg'\nminimum_on_s = 1\n", "[[case]] 1: minimum_on_s needs pwm_period_s"),
    (HAND + "[grid]\ntarget = ['weg', 's5-ob251']\nswitches = [{}, {rails = 'x'}]\n", "[grid]: weg: unknown switch 'rails'"),
    (HAND + "input = 'rtd'\n[grid]\ntarget = ['fb41', 's5-ob251']\n", "[grid]: s5-ob251: --input rtd: an analog input 460 gives ohms"),
    (HAND + "range_high_degC = 90\ntarget = 'fb41'\n[grid]\ninput = ['4-20mA', 'rtd']\n", "[grid]: fb41: --range 0 90 beside --input rtd"),
    (HAND + "interlock = 'heater-fan'\ntarget = 'weg'\n[grid]\nsamples = [0, 20]\n", "[grid]: samples cannot be combined with an interlock"),
    ("[[case]]\ntarget = 'weg'\nlog = 'gone.csv'\n", "log 'gone.csv' cannot be read: No such file"),
    ("[[case]]\ntarget = 'weg'\nmodel = 'gone.json'\n", "gone.json: cannot be read: No such file"),
])
def test_what_is_wrong_in_a_study_is_one_line_that_names_file_key_and_what_is_right(text, told, study, run, tmp_path):
    path = study(text)
    status, out, err = run("study", path, "-o", tmp_path / "study.parquet")
    assert (status, out) == (2, "")
    assert told in err
    assert err.startswith(f"error: {tmp_path}")
    assert err.count("\n") == 1
    assert [each.name for each in tmp_path.iterdir()] == ["study.toml"]


def test_a_study_that_is_not_there_or_no_text_is_told(tmp_path, study):
    with pytest.raises(DocumentError, match=r"none.toml: cannot be read: No such file"):
        read_study(tmp_path / "none.toml")
    path = study("")
    path.write_bytes(b"\xff\xfe\xff")
    with pytest.raises(DocumentError, match="no TOML: "):
        read_study(path)


def here(chunks, do):
    """Workers that do everything in this process."""
    for chunk in chunks:
        yield chunk, do(chunk.cases)


@pytest.mark.long(seconds=15)
def test_a_killed_study_is_resumed_to_the_same_bytes_and_its_rows_are_those_of_the_commands(study, tmp_path, run, kill):
    from heatertune.batch import studies  # noqa: PLC0415 - the slow libraries, beside their only use

    path, whole, out = study(STUDY), tmp_path / "whole.parquet", tmp_path / "study.parquet"
    command = [sys.executable, "-m", "heatertune", "study", str(path), "--quiet", "-o"]
    studies.study(path, out=whole, workers=here)
    parts = kill([*command, out, "--jobs", 1], tmp_path / "study.parquet.parts", parts=2)
    done = {part: part.stat().st_mtime_ns for part in parts}
    assert 2 <= len(done) < 10
    path.write_text(STUDY.replace("0.1\n", "0.2\n"))
    assert "parts of a run with different case; repeat the options of that run" in run("study", path, "-o", out, "--resume")[2]
    assert {part: part.stat().st_mtime_ns for part in done} == done
    path.write_text(STUDY)
    subprocess.run([*command, out, "--resume"], cwd=ROOT, check=True)
    assert out.read_bytes() == whole.read_bytes()

    rows = pyarrow.parquet.read_table(out).to_pylist()
    assert [row["case"] for row in rows] == list(range(1, 11))
    assert rows[0]["name"] == ("gain_degC_per_pct = 0.37, target = s5-ob251, closed_loop_s = 12.0, pwm_period_s = 2.0")
    assert {row["case_time_constant_s"] for row in rows} == {167.0}
    assert [row["outcome"] for row in rows[8:]] == ["no design", "no words"]
    assert "none for P" in rows[8]["reason"]
    assert "word K would be" in rows[9]["reason"]
    # case 8: the second setting of every list; the same by the commands
    hand = ("--gain", 0.37, "--time-constant", 167, "--dead-time", 12, "--ambient", 22)
    pid = tmp_path / "pid.json"
    assert run("tune", *hand, "--method", "simc", "--closed-loop", 40, "--target", "s7-300", "-o", pid, "--quiet")[0] == 0
    verdict = json.loads(
        run("verify", pid, "--target", "s7-300", "--setpoint", 40, "--pwm-period", 10.5, "--json", "--quiet")[1])
    assert (rows[7]["case_target"], rows[7]["case_pwm_period_s"], rows[7]["case_closed_loop_s"]) == ("s7-300", 10.5, 40.0)
    assert json.loads(rows[7]["words"]) == verdict["words"]
    assert rows[7]["outcome"] == verdict["verdict"]
    for column, name in (("iae_degC_s", "iae"), ("overshoot_pct", "overshoot"), ("ms", "ms"), ("pwm_ripple_degC", "pwm_ripple")):
        assert rows[7][column] == verdict["criteria"][name]["value"]


def test_every_setting_of_a_case_reaches_its_stage(monkeypatch):
    from heatertune.batch import studies  # noqa: PLC0415 - the slow libraries, beside their only use

    settings = {
        "gain_degC_per_pct": 0.5, "time_constant_s": 100.0, "second_time_constant_s": 9.0, "zero_s": 40.0, "dead_time_s": 5.0,
        "ambient_degC": 21.0, "target": "fb41", "structure": "pi", "method": "optimum", "closed_loop_s": 7.0,
        "objective": "load", "weight": 0.5, "ms": 1.5, "mt": 1.3, "mks": 30.0, "sample_time_s": 1.0, "words": "rounded",
        "as_is": True,
        "range_low_degC": 10.0, "range_high_degC": 90.0, "switches": {"a": "b"}, "setpoint_degC": 50.0,
        "noise_degC": 0.1, "tolerance_degC": 0.7, "pwm_period_s": 8.0, "pwm_resolution_s": 0.25, "minimum_on_s": 0.5,
        "minimum_off_s": 0.75, "pwm_rule": "pid-compact", "interlock": "heater-fan", "limit_degC": 80.0,
        "fan_stops_s": 99.0, "samples": 0, "spec": "oven", "robust": "none", "step_power_pct": 9.0,
        "profile": "/any/firing.csv", "input": "4-20mA", "cooling_gain": 0.4, "cooling_minimum_on_s": 0.2,
        "cooling_minimum_off_s": 0.3,
    }
    assert {*settings, "log", "model", *options_of(FitSettings)} == {*KEYS, "cooler"}, "no key is forgotten here"
    seen = {}

    def instead(name, find, asked):
        seen.update(asked=asked, heater=find().plants[0])
        return {"name": name, "outcome": "PASS", "reason": None}

    monkeypatch.setattr(studies, "zone_row", instead)
    row = studies._row(ROOT, studies.Case(4, "five", settings, None))
    assert row["case"] == 5
    assert row["case_switches"] == '{"a": "b"}'
    assert (seen["heater"].gain_degC_per_pct, *seen["heater"].lags_s) == (0.5, 100.0, 9.0)
    assert (seen["heater"].dead_time_s, seen["heater"].ambient_degC) == (5.0, 21.0)
    assert seen["heater"].zero_s == 40.0
    asked = seen["asked"]
    assert (asked.target, asked.words_by, asked.as_is, asked.sample_settings.samples) == ("fb41", "rounded", True, None)
    assert (asked.scaling.low_degC, asked.scaling.high_degC, asked.scaling.input) == (10.0, 90.0, "4-20mA")
    for part in (asked.tune_settings, asked.conditions):
        assert asdict(part) == {name: settings.get(name, ()) for name in asdict(part)}
    assert "accept" not in KEYS
    alone = {name: value for name, value in settings.items() if name not in ("interlock", "limit_degC", "fan_stops_s")}
    studies._row(ROOT, studies.Case(4, "five", alone | {"samples": 3}, None))
    assert seen["asked"].sample_settings == SampleSettings(samples=3)
    studies._row(ROOT / "any", studies.Case(5, "six", settings | {"spec": "own.toml"}, None))
    assert seen["asked"].conditions.spec == str(ROOT / "any" / "own.toml")  # beside the study, as its logs


def test_the_fit_of_a_log_is_asked_for_once_and_told_what_is_known(monkeypatch):
    from heatertune.batch import studies  # noqa: PLC0415 - the slow libraries, beside their only use

    asked = []
    monkeypatch.setattr(studies, "fit", lambda log, given: asked.append((log.name, given)))
    content = "\n".join(["time [s];T [°C];power [%]", *(f"{k};{20 + k};50" for k in range(30))]).encode()
    settings = {"log": "own.csv", "target": "weg", "ambient_degC": 19.0, "power_before_pct": 3.0, "until_s": 25.0}
    for k in range(3):
        studies._heater(studies.Case(k, "", settings | {"ms": 1.4 + k}, content))
    assert asked == [("own", FitSettings(ambient_degC=19.0, power_before_pct=3.0, until_s=25.0))]
    studies._heater(studies.Case(3, "", {"log": "table4", "target": "weg"}, None))
    assert asked[1:] == [("table4", FitSettings())]
