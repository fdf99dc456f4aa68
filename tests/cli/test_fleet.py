import json
import subprocess
import sys
from dataclasses import replace

import pyarrow.parquet
import pytest
from tests.conftest import ROOT, heater_log

from heatertune.batch.fleets import zone_row
from heatertune.errors import DocumentError, InputError
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Boost, Scaling, Words
from heatertune.proof.monte_carlo.run import sample_document
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.proof.verdict import combined_verdict, verdict_line
from heatertune.report.report_text import outcome_lines
from heatertune.settings import Conditions, FitSettings, ReadSettings, SampleSettings, TuneSettings

SAMPLES = SampleSettings(samples=20)

#: a rule instead of the optimum, and a short story: what is tested is the fleet, not the search or the proof
QUICK = ("--target", "s7-300", "--method", "simc", "--setpoint", 45, "--spec", "paper")


@pytest.fixture(scope="session")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plant") / "logs"
    (folder / "line 2").mkdir(parents=True)
    # a power that may be two rows late may be two rows more of dead time: at 5 s Ms of SIMC's τc = θ would leave its limit
    # of 2 with it; at 1 s its loop e^(−1.2·s)/(2·s), in units of θ, has 1.77
    (folder / "oven.csv").write_text(heater_log(0.5, 1, interval_s=1))
    # not noise 2: a 95 % interval misses for one noise in twenty, and of 1 to 24 for that one, by a ten-thousandth
    (folder / "line 2" / "dryer.csv").write_text(heater_log(0.7, 4, interval_s=1))
    (folder / "line 2" / "weak.csv").write_text(heater_log(0.2, 3))  # cannot hold 45 °C
    (folder / "empty.csv").write_text("")
    (folder / "torn.csv").write_text("time [s];T [°C];power [%]\n0;20;oops\n")
    (folder / "still.csv").write_text("\n".join(f"{5 * k};{20 + 0.01 * (k % 7):.2f};30" for k in range(240)))
    (folder / "notes.md").write_text("not a log")
    return folder


@pytest.fixture(scope="session")
def table(logs, tmp_path_factory):
    """The table of the fleet, by two processes, and what the command said."""
    out = tmp_path_factory.mktemp("table") / "fleet.parquet"
    ended = subprocess.run(command(logs, out, "--jobs", 2, "--json"), capture_output=True, text=True, check=True, cwd=ROOT)
    return out, json.loads(ended.stdout), ended.stderr


def command(logs, out, *others):
    return [sys.executable, "-m", "heatertune", "fleet", str(logs), "-o", str(out), *map(str, (*QUICK, *others))]


@pytest.mark.long
def test_every_log_is_a_row_and_a_bad_one_stops_no_other(table):
    out, document, _ = table
    rows = {row["name"]: row for row in pyarrow.parquet.read_table(out).to_pylist()}
    assert list(rows) == ["empty.csv", "line 2/dryer.csv", "line 2/weak.csv", "oven.csv", "still.csv", "torn.csv"]
    assert {name: row["outcome"] for name, row in rows.items()} == {
        "empty.csv": "no log", "line 2/dryer.csv": "PASS", "line 2/weak.csv": "no proof", "oven.csv": "PASS",
        "still.csv": "no fit", "torn.csv": "no log",
    }
    assert rows["torn.csv"]["reason"].startswith("torn.csv, line 2, column power [%]: no number: 'oops'")
    assert "setpoint_degC = 45.0 is out of range" in rows["line 2/weak.csv"]["reason"]
    assert rows["line 2/weak.csv"]["gain_degC_per_pct"] == pytest.approx(0.2, rel=0.03), "what was found is kept"
    assert "The power never changes" in rows["still.csv"]["reason"]
    # the heater that was written into the log, second by second
    for name, gain in (("oven.csv", 0.5), ("line 2/dryer.csv", 0.7)):
        row = rows[name]
        assert row["gain_degC_per_pct_ci95_low"] < gain < row["gain_degC_per_pct_ci95_high"]
        assert row["gain_degC_per_pct"] == pytest.approx(gain, rel=0.01)
        assert row["time_constant_s"] == pytest.approx(120.0, rel=0.03)
        assert row["dead_time_s"] == pytest.approx(10.0, abs=1.5)
        assert row["fit_outcome"] == "IDENTIFIED"
        assert row["setpoint_degC"] == 45.0
        assert json.loads(row["words"])["GAIN"] == row["word_GAIN"]
        # S. Skogestad, J. Process Control 13 (2003), eqs. 23-25 with τc = θ (+ TA/2 in θ): K·gain·2θ = T
        theta = row["dead_time_s"] + row["sample_time_s"] / 2.0
        assert row["gain_pct_per_degC"] == pytest.approx(
            row["time_constant_s"] / (row["gain_degC_per_pct"] * 2.0 * theta), rel=0.05)
    assert document["outcomes"] == {"PASS": 2, "no fit": 1, "no log": 2, "no proof": 1}
    assert document["rows"] == 6


@pytest.mark.long
def test_a_row_says_what_the_single_commands_say(table, logs, tmp_path, run):
    model, pid = tmp_path / "model.json", tmp_path / "pid.json"
    assert run("fit", logs / "oven.csv", "-o", model, "--quiet")[0] == 0
    assert run("tune", model, "--method", "simc", "--target", "s7-300", "-o", pid, "--quiet")[0] == 0
    verdict = json.loads(run("verify", pid, "--target", "s7-300", "--setpoint", 45, "--spec", "paper", "--json")[1])
    fitted, tuned = json.loads(model.read_text()), json.loads(pid.read_text())
    (row,) = [row for row in pyarrow.parquet.read_table(table[0]).to_pylist() if row["name"] == "oven.csv"]
    for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC"):
        assert row[name] == fitted[name]
        assert [row[f"{name}_ci95_low"], row[f"{name}_ci95_high"]] == fitted[f"{name}_ci95"]
    for name in ("gain_pct_per_degC", "integral_time_s", "sample_time_s", "structure"):
        assert row[name] == tuned[name]
    assert json.loads(row["words"]) == verdict["words"]
    criteria = {"overshoot_pct": "overshoot", "settling_time_s": "settling_time", "steady_offset_degC": "steady_offset",
                "limit_cycle_degC": "limit_cycle", "pwm_ripple_degC": "pwm_ripple", "iae_degC_s": "iae",
                "recovery_time_s": "recovery_time", "recovery_overshoot_pct": "recovery_overshoot",
                "deviation_degC": "deviation", "saturation_pct": "saturation", "switchings_per_h": "switchings",
                "overflows": "overflow", "ms": "ms", "gain_margin": "gain_margin", "phase_margin_deg": "phase_margin"}
    assert {column: row[column] for column in criteria} == {
        column: verdict["criteria"][name]["value"] for column, name in criteria.items()}
    assert row["runs"] == len(verdict["runs"])


@pytest.mark.long
def test_killed_and_resumed_by_one_process_the_bytes_are_the_same(table, logs, tmp_path, kill):
    out = tmp_path / "fleet.parquet"
    kill(command(logs, out, "--jobs", 1, "--quiet"), tmp_path / "fleet.parquet.parts", parts=1)
    assert not out.exists()
    ended = subprocess.run(command(logs, out, "--jobs", 1, "--resume"), cwd=ROOT, capture_output=True, text=True, check=True)
    assert out.read_bytes() == table[0].read_bytes()
    assert "of 6 zones, done before" in ended.stderr
    assert "no log: empty.csv: the file is empty" in ended.stdout
    assert "PASS      2" in ended.stdout


@pytest.mark.long
def test_progress_is_told_by_lines_where_there_is_no_terminal(table):
    said = table[2].splitlines()
    assert said[0].endswith("0 of 6 zones")
    assert "6 of 6 zones, " in said[-1]
    assert said[-1].endswith("/s")
    assert not any("\r" in line or "\x1b" in line for line in said)


@pytest.mark.parametrize(("arguments", "told"), [
    (("nothing/",), "nothing: cannot be read; expected a folder, a pattern, or a list of paths"),
    (("nothing/*.csv",), "nothing/*.csv: no log found; expected files that match"),
    ((".",), ".: no log found; expected files that end in .csv, .tsv, .txt, .log, .dat"),
    ((".", "--target", "s5"), "unknown target 's5'; known: s5-ob251"),
    ((".", "--jobs", 0), "jobs = 0 is out of range: must be >= 1"),
    ((".", "--jobs", 2, "--scheduler", "tcp://127.0.0.1:1"), "give --jobs or --scheduler, not both"),
])
def test_what_cannot_be_done_is_one_line(arguments, told, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    target = () if "--target" in arguments else ("--target", "s7-300")
    status, out, err = run("fleet", *arguments, *target, "-o", "fleet.parquet")
    assert (status, out) == (2, "")
    assert err.startswith(f"error: {told}")
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_logs_are_found_in_folders_by_patterns_and_by_lists(logs, tmp_path, monkeypatch):
    from heatertune.batch.fleets import find_logs  # noqa: PLC0415 - the slow libraries, beside their only use

    below = ["empty.csv", "line 2/dryer.csv", "line 2/weak.csv", "oven.csv", "still.csv", "torn.csv"]
    assert find_logs(logs) == (str(logs), below)
    assert find_logs(f"{logs}/**/*.csv") == (str(logs), below)
    assert find_logs(f"{logs}/line*/*.csv") == (str(logs / "line 2"), ["dryer.csv", "weak.csv"])
    listed = logs.parent / "list"
    listed.write_text(f"# two of them\nlogs/oven.csv\n\n{logs}/line 2/weak.csv\nlogs/line 2/../oven.csv\n")
    assert find_logs(listed) == (str(logs), ["line 2/weak.csv", "oven.csv"])
    monkeypatch.chdir(logs)
    assert find_logs(".") == (str(logs), below)
    listed.write_bytes(b"\xff\xfe\xff")
    with pytest.raises(InputError, match="expected a folder, a pattern, or a list of paths"):
        find_logs(listed)


def test_a_link_that_leads_nowhere_is_a_log_that_cannot_be_read(tmp_path):
    from heatertune.batch.fleets import _sent, find_logs  # noqa: PLC0415 - the slow libraries, beside their only use

    (tmp_path / "share.csv").symlink_to(tmp_path / "not mounted" / "share.csv")
    (tmp_path / "folder.csv").mkdir()
    for logs in (tmp_path, f"{tmp_path}/*.csv"):
        assert find_logs(logs) == (str(tmp_path), ["share.csv"])
    assert _sent(str(tmp_path), "share.csv").problem == "cannot be read: No such file or directory"


def test_a_log_that_vanished_is_a_row(logs):
    from heatertune.batch.fleets import (  # noqa: PLC0415 - the slow libraries, beside their only use
        _fitted,
        _sent,
        zone_row,
    )

    row = zone_row("gone.csv", lambda: _fitted({"read": ReadSettings(), "fitted_with": FitSettings()}, _sent(str(logs), "gone.csv")), DesignRequest(target="weg"))
    assert row == {"name": "gone.csv", "outcome": "no log", "reason": "gone.csv: cannot be read: No such file or directory"}


def test_a_log_of_any_name_is_a_row_and_one_that_changed_is_done_again(tmp_path):
    """The names hold U+2028, which ends a line for `str.splitlines`, and a byte that is no UTF-8."""
    from heatertune.batch.fleets import ZoneSettings, fleet  # noqa: PLC0415 - the slow libraries, beside their only use

    folder, out = tmp_path / "logs", tmp_path / "fleet.parquet"
    folder.mkdir()
    for name in ("a\u2028b.csv", "c\udcff.csv", "d.csv"):
        (folder / name).write_text("no log")

    def stopped(chunks, do):
        for chunk in chunks:
            yield chunk, do(chunk.cases)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fleet(folder, ZoneSettings(request=DesignRequest(target="s7-300")), out=out, workers=stopped)
    (folder / "d.csv").write_text("")

    def here(chunks, do):
        yield from ((chunk, do(chunk.cases)) for chunk in chunks)

    summary = fleet(folder, ZoneSettings(request=DesignRequest(target="s7-300")), out=out, workers=here, resume=True)
    assert summary["done_again"] == 1
    assert "changed since the interrupted run: 1" in outcome_lines(summary)
    rows = pyarrow.parquet.read_table(out).to_pylist()
    assert [row["name"] for row in rows] == ["a\u2028b.csv", "c\\udcff.csv", "d.csv"]
    assert rows[2]["reason"] == "d.csv: the file is empty; expected rows of time and temperature"
    assert rows[0]["reason"] != rows[2]["reason"]


def test_a_fleet_is_not_resumed_under_a_specification_that_has_changed_and_a_missing_one_is_refused_at_once(tmp_path):
    from heatertune.batch.fleets import ZoneSettings, fleet  # noqa: PLC0415 - the slow libraries, beside their only use

    (tmp_path / "a.csv").write_text("no log")
    spec = tmp_path / "spec.toml"
    asked, out = DesignRequest(target="s7-300", conditions=Conditions(spec=str(spec))), tmp_path / "fleet.parquet"

    def stopped(chunks, do):
        for chunk in chunks:
            yield chunk, do(chunk.cases)
        raise KeyboardInterrupt

    with pytest.raises(DocumentError, match=r"spec\.toml: cannot be read"):
        fleet(tmp_path / "a.csv", ZoneSettings(request=asked), out=out, workers=stopped)
    spec.write_text('[limits]\novershoot = "5 %"\n')
    with pytest.raises(KeyboardInterrupt):
        fleet(tmp_path / "a.csv", ZoneSettings(request=asked), out=out, workers=stopped)
    spec.write_text('[limits]\novershoot = "50 %"\n')
    with pytest.raises(InputError, match="specification"):
        fleet(tmp_path / "a.csv", ZoneSettings(request=asked), out=out, workers=stopped, resume=True)


def test_a_fleet_and_a_study_are_not_resumed_along_a_profile_that_has_changed(tmp_path, monkeypatch):
    from heatertune.batch import fleets, studies  # noqa: PLC0415 - the slow libraries, beside their only use

    seen = []
    for module in (fleets, studies):
        monkeypatch.setattr(module, "run", lambda batch, *_, **__: seen.append(batch.identity) or {})
    log, firing, cases = tmp_path / "a.csv", tmp_path / "firing.csv", tmp_path / "study.toml"
    log.write_text("no log")
    cases.write_text("[fixed]\ngain_degC_per_pct = 1\ntime_constant_s = 100\ndead_time_s = 5\ntarget = 'weg'\n"
                     f"[grid]\nprofile = ['{firing.as_posix()}']\n")
    asked = DesignRequest(target="s7-300", conditions=Conditions(profile=str(firing)))
    with pytest.raises(DocumentError, match=r"firing\.csv: cannot be read"):
        fleets.fleet(log, fleets.ZoneSettings(request=asked), out=tmp_path / "fleet.parquet", workers=None)
    for soak in (10, 10, 11):
        firing.write_text(f"target [degC],ramp [degC/h],soak [min]\n60,100,{soak}\n")
        fleets.fleet(log, fleets.ZoneSettings(request=asked), out=tmp_path / "fleet.parquet", workers=None)
        studies.study(cases, out=tmp_path / "study.parquet", workers=None)
    assert seen[:2] == seen[2:4]
    assert seen[0] != seen[4]
    assert seen[1] != seen[5]


@pytest.mark.long
def test_a_zone_is_proven_on_drawn_heaters_too():
    # the samples of `verify --samples` on the same words: chain.samples, whose figures tests/proof/test_compiled.py holds
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.5, time_constant_s=120.0, dead_time_s=10.0, ambient_degC=20.0))
    asked = DesignRequest(target="weg", tune_settings=TuneSettings(method="simc"), setpoint_ramp="none")
    plain, row = zone_row("zone", lambda: heater, asked), zone_row("zone", lambda: heater, replace(asked, sample_settings=SAMPLES))
    boost = Boost(within_degC=row["boost_within_degC"], again_degC=row["boost_again_degC"])  # of words, its switch's, too
    words = Words(target="weg", values=json.loads(row["words"]), scaling=Scaling(), sample_time_s=row["sample_time_s"], boost=boost)
    found = sample_document(words, heater, 20)
    assert row["samples"] == 20
    assert row["samples_passing_pct"] == 100.0 * found["passing"]
    assert row["samples_worst_seed"] == found["worst_seed"]
    assert row["outcome"] == combined_verdict([plain["outcome"], found["verdict"]])
    assert "samples" not in plain
    # a load nobody can hold: power goes with the square of a mains voltage that is far too low on most samples
    weak = model_by_hand(Fopdt(gain_degC_per_pct=0.26, time_constant_s=120.0, dead_time_s=10.0, ambient_degC=20.0))
    failed = zone_row("weak", lambda: weak, replace(asked, conditions=Conditions(setpoint_degC=44.0), sample_settings=SAMPLES))
    assert failed["outcome"] == "FAIL"
    assert "13 of 20 samples keep every limit under every setting, so at most 82.27 % of all do" in failed["reason"]


@pytest.mark.long
def test_drawn_heaters_are_switched_as_the_proof_was():
    # one lag: at the plain PWM period the ripple alone is beyond the band (tests/chain/test_closing.py has its formula)
    heater = model_by_hand(Fopdt(gain_degC_per_pct=1.0, time_constant_s=38.0, dead_time_s=11.0, ambient_degC=20.0))
    conditions = Conditions(setpoint_degC=60.0, tolerance_degC=0.8)
    # no ramp, which Words below would have to hold, too
    asked = DesignRequest(target="s7-300", conditions=conditions, tune_settings=TuneSettings(sample_time_s=2.0), setpoint_ramp="none")
    row = zone_row("zone", lambda: heater, replace(asked, sample_settings=SAMPLES))
    assert row["pwm_period_s"] < row["sample_time_s"] == 2.0
    words = Words(target="s7-300", values=json.loads(row["words"]), scaling=Scaling(), sample_time_s=row["sample_time_s"])
    assert sample_document(words, heater, 20, conditions)["passing"] == 0.0
    its = replace(conditions, pwm_period_s=row["pwm_period_s"])
    assert row["samples_passing_pct"] == 100.0 * sample_document(words, heater, 20, its)["passing"] > 0.0


@pytest.mark.long
@pytest.mark.parametrize(("heater", "target", "conditions", "outcome", "says"), [
    (Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=15.0, ambient_degC=22.0), "weg", Conditions(
        setpoint_degC=46.0, switches={"anti_windup": "none", "manual": "limited", "manual_return": "held"}),
     "PASS", "with a boost (full power until 7.37 °C from the setpoint"),
    (Fopdt(gain_degC_per_pct=1.0, time_constant_s=38.0, dead_time_s=6.0, ambient_degC=20.0), "s7-300", Conditions(
        setpoint_degC=60.0, tolerance_degC=0.9, pwm_period_s=2.0), "FAIL", "would pass at --sample-time auto"),
])
def test_a_row_says_what_the_single_command_says(heater, target, conditions, outcome, says):
    # the witness is the verdict's line as `design` prints it of the same question
    asked = DesignRequest(target=target, conditions=conditions, tune_settings=TuneSettings(sample_time_s=6.0 if target == "weg" else 2.0))
    row = zone_row("zone", lambda: model_by_hand(heater), asked)
    single = find_passing_design(model_by_hand(heater), asked).proof.to_document()
    line = verdict_line(single)
    assert (row["outcome"], single["verdict"]) == (outcome, outcome)
    assert says in row["remarks"]
    if outcome == "FAIL":  # what it names passes when it is followed
        assert find_passing_design(model_by_hand(heater), replace(asked, tune_settings=TuneSettings())).proof.verdict == "PASS"
    assert all(remark in line for remark in row["remarks"].split("; "))
    ramp = single["setpoint_ramp"]
    assert (row["ramp_degC_per_min"], row["hold_degC"]) == (
        (None, None) if ramp is None else (ramp["degC_per_min"], ramp["hold_degC"]))


def test_a_fault_of_the_program_is_a_row():
    from heatertune.batch.fleets import zone_row  # noqa: PLC0415 - the slow libraries, beside their only use

    def broken():
        raise ZeroDivisionError("float division by zero")

    assert zone_row("oven.csv", broken, DesignRequest(target="weg")) == {
        "name": "oven.csv", "outcome": "crashed", "reason": "no fit: ZeroDivisionError: float division by zero"}


@pytest.mark.parametrize("moving", [True, False])
def test_the_bar_tells_rate_and_time_left(moving, monkeypatch, capsys):
    import argparse  # noqa: PLC0415 - beside its only use

    from heatertune.batch import command as table_options  # noqa: PLC0415

    now = [100.0]
    monkeypatch.setattr(table_options.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(sys.stderr, "isatty", lambda: moving, raising=False)
    bar = table_options.Bar(argparse.Namespace(quiet=False), "zones")
    for seconds, done in ((0.0, 100), (0.1, 101), (50.0, 200), (250.0, 400), (450.0, 1000)):
        now[0] = 100.0 + seconds
        bar(done, 1000)
    raw = capsys.readouterr().err
    assert (raw.count("\r"), raw.count("\n")) == ((4, 1) if moving else (0, 4))
    said = [line.strip() for line in raw.replace("\r", "\n").splitlines() if line.strip()]
    assert said == [
        "[  0.0 s] 100 of 1000 zones, done before",
        "[ 50.0 s] 200 of 1000 zones, 2/s, 6.7 min left",
        "[250.0 s] 400 of 1000 zones, 1.2/s, 8.3 min left",
        "[450.0 s] 1000 of 1000 zones, 2/s",
    ]
    quiet = table_options.Bar(argparse.Namespace(quiet=True), "zones")
    quiet(1, 1)
    assert capsys.readouterr().err == ""


def test_a_fleet_of_nothing_readable_is_bad_input_and_its_table_has_the_reasons(run, tmp_path):
    (tmp_path / "logs").mkdir()
    for name in ("a.csv", "b.csv"):
        (tmp_path / "logs" / name).write_text("no log at all\n", encoding="utf-8")
    status, _, err = run("fleet", tmp_path / "logs", "--target", "weg", "-o", tmp_path / "table.csv", "--quiet")
    assert status == 2
    assert err == f"error: {tmp_path / 'logs'}: no log that can be read; {tmp_path / 'table.csv'} has the reason of each\n"
    assert b"a.csv" in (tmp_path / "table.csv").read_bytes()
