"""A fit that leaves something open: NOT PROVEN at the terminal, with the way on, until it is closed or accepted."""

import json
import shlex
from dataclasses import replace

import pytest

from heatertune.codec import to_json
from heatertune.model import model_document as document
from heatertune.model.findings import Finding
from heatertune.model.model_values import FitOutcome, Fopdt, model_by_hand

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)


@pytest.fixture
def pid(tmp_path, run):
    """A design for a heater whose fit leaves the dead time open, as `tune` writes it."""
    fitted = replace(
        model_by_hand(HEATER), outcome=FitOutcome.IDENTIFIED, setpoint_degC=40.0, log_interval_s=2.0,
        least_dead_time_s=1.0, assumed={"sensor_delay_s": 0.5},
        findings=(Finding(name="dead-time-open", message="With one lag, the dead time has no upper end within the log."),),
    )
    model, path = tmp_path / "model.json", tmp_path / "pid.json"
    model.write_text(to_json(document.to_document(fitted)), encoding="utf-8")
    assert run("tune", model, "--target", "s5-ob251", "--ms", 1.4, "-o", path, "--quiet")[0] == 0
    return path


def test_verify_says_not_proven_in_its_first_line_with_the_way_on_and_ends_with_1(pid, run):
    status, out, _ = run("verify", pid, "--target", "s5-ob251")
    whole = run("verify", pid, "--target", "s5-ob251", "--verbose")[1]
    first, last = whole.splitlines()[0], whole.rstrip().splitlines()[-1]
    assert status == 1
    assert first.startswith("NOT PROVEN at 40 °C in 18 runs on 1 plausible heater; the log does not bound the dead time")
    assert last == f"VERDICT {first}"
    for told in (" ".join(out.split()), first):
        assert told.startswith("NOT PROVEN")
        assert "the log does not bound the dead time" in told
        assert "heatertune plan" in told
        assert "--dead-time-at-most" in told
        assert "--accept dead-time-open" in told


@pytest.mark.long
def test_what_is_accepted_is_pass_and_stands_in_the_files(pid, run, tmp_path):
    asked = ("--target", "s5-ob251", "-o", tmp_path / "out")
    status, _, err = run("export-db", pid, *asked)
    assert status == 1
    assert err.startswith("error: NOT PROVEN at 40 °C")
    assert not (tmp_path / "out").exists()
    assert run("export-db", pid, *asked, "--accept", "dead-time-open")[0] == 0
    listing = (tmp_path / "out" / "DB30_listing.txt").read_text(encoding="utf-8")
    assert "// verdict of the proof: PASS\n// proven at 40 °C in 18 runs on 1 plausible heater\n" in listing
    assert "// accepted: the log does not bound the dead time\n" in listing
    assert "// assumed: sensor delay of 0.5 s\n" in listing
    proof = json.loads((tmp_path / "out" / "data" / "proof.json").read_text(encoding="utf-8"))
    assert proof["findings"][0] == {"name": "dead-time-open", "effect": "blocks", "accepted": True,
                                    "message": "With one lag, the dead time has no upper end within the log."}


@pytest.mark.long
def test_forced_words_say_that_they_are_not_proven_and_can_be_accepted_later(pid, run, tmp_path):
    assert run("export-db", pid, "--target", "s5-ob251", "-o", tmp_path, "--force")[0] == 0
    assert "NOT PROVEN - FORCED" in (tmp_path / "DB30_listing.txt").read_text(encoding="utf-8")
    words = tmp_path / "words.json"
    again = ("export-db", words, "--target", "s5-ob251", "-o", tmp_path / "again")
    assert run(*again)[0] == 1
    assert run(*again, "--accept", "dead-time-open")[0] == 0
    assert "verdict of the proof: PASS" in (tmp_path / "again" / "DB30_listing.txt").read_text(encoding="utf-8")


def test_a_model_of_before_the_verdict_heard_the_fit_is_refused(pid, run):
    found = json.loads(pid.read_text(encoding="utf-8"))
    found["model"]["schema"] = "heatertune/model/1"
    pid.write_text(json.dumps(found), encoding="utf-8")
    status, _, err = run("verify", pid, "--target", "s5-ob251")
    assert status == 2
    assert err.rstrip().endswith("expected 'heatertune/model/3': fit and tune again")


def test_only_what_blocks_can_be_accepted(pid, run):
    for name in ("closed-loop", "nonsense"):
        status, _, err = run("verify", pid, "--target", "s5-ob251", "--accept", name)
        assert status == 2
        assert name in err
        assert "dead-time-open" in err
        assert err.count("\n") == 1


def test_a_sampled_design_without_dead_time_is_refused_as_the_continuous_one_is(run, tmp_path):
    heater = ("--gain", 0.37, "--time-constant", 167, "--dead-time", 0, "--ambient", 22, "--quiet")
    said = [run("tune", *heater, "--sample-time", ta, "-o", tmp_path / "x.json") for ta in (0, 5)]
    assert [status for status, _, _ in said] == [2, 2]
    assert said[0][2] == said[1][2]
    assert "every real heater has" in said[1][2]


def test_no_design_goes_beyond_what_a_log_can_support(run, tmp_path):
    # T 20 s and L 0.3 s, logged every 2 s: the truth allows a far faster loop than this log can show
    time = [2.0 * k for k in range(120)]
    rows = ["time [s],T [°C],heater [%]"]
    for t in time:
        held = max(0.0, t - 20.3)
        rows.append(f"{t},{20.0 + 40.0 * (1.0 - 2.718281828 ** (-held / 20.0)):.2f},{80 if t >= 20 else 0}")
    log = tmp_path / "fast.csv"
    log.write_text("\n".join(rows), encoding="utf-8")
    assert run("fit", log, "-o", tmp_path / "model.json", "--quiet")[0] == 0
    status, out, _ = run("tune", tmp_path / "model.json", "--target", "s5-ob251", "--json", "--quiet")
    found = json.loads(out)
    assert status == 0
    assert found["sample_time_s"] >= 2.0
    assert any("not shorter than the log's own interval" in note for note in found["notes"])
    assert min(each["dead_time_s"] for each in found["model"]["candidates"]) < 1.0 <= found["model"]["least_dead_time_s"]
    # a fast TA is the user's own word, and then it is told
    status, out, _ = run("tune", tmp_path / "model.json", "--sample-time", 0.5, "--json", "--quiet")
    assert any("shorter than the log's own interval" in note for note in json.loads(out)["notes"])


@pytest.mark.long
def test_the_command_that_states_assumed_units_ends_in_pass_when_it_is_typed_and_so_does_accepting_them(run, tmp_path):
    # a heater of 0.6 °C/%, 60 s and 4 s in °C and %, its time in minutes without a unit
    power, rows, reading = [0.0 if k < 20 else 50.0 if k < 300 else 20.0 for k in range(520)], ["Time,Temperature,Heater"], 22.0
    for k, held in enumerate(power):
        rows.append(f"{k / 60:.5f},{reading:.2f},{held:g}")
        reading += (22.0 + 0.6 * power[max(0, k - 4)] - reading) / 60.0
    log = tmp_path / "log.csv"
    log.write_text("\n".join(rows), encoding="utf-8")
    asked = ("design", log, "--target", "simple-pid", "--setpoint", 45, "--out")
    status, out, err = run(*asked, tmp_path / "blocked")
    assert status == 1
    assert out.startswith("NOT PROVEN")
    assert "--accept unit-assumed" in " ".join(out.split())
    assert not list((tmp_path / "blocked").glob("*.py"))
    typed = next(line.partition("state them: heatertune ")[2] for line in err.splitlines() if "units assumed" in line)
    status, out, _ = run(*shlex.split(typed))
    assert (status, out[:4]) == (0, "PASS")
    assert "time constant 59" in out
    assert run(*asked, tmp_path / "accepted", "--accept", "unit-assumed", "--quiet")[0] == 0
    exported = next((tmp_path / "accepted").glob("*.py")).read_text(encoding="utf-8")
    assert "accepted: a unit is assumed for which the log has no evidence" in exported
