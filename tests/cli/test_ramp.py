"""--setpoint-ramp from the command line."""

import json
import re

import pytest

HAND = ("--gain", 0.8, "--time-constant", 480, "--dead-time", 60, "--ambient", 22)
CONDITIONS = ("--target", "weg", "--setpoint", 40, "--assume", "order=as_printed", "--assume", "edge=output_zero",
              "--assume", "anti_windup=clamp", "--assume", "manual=limited", "--assume", "manual_return=held", "--assume", "filter=implicit",
              # what an open circuit leaves behind is mended by a holdback, which a rate of one's own has not
              "--limit", "reheat-overshoot=90%")


@pytest.fixture
def slow(tmp_path, run):
    path = tmp_path / "pid.json"
    assert run("tune", *HAND, "--target", "weg", "-o", path)[0] == 0
    return path


@pytest.mark.long
def test_words_with_a_ramp_are_exported_read_again_and_proven_again(run, slow, tmp_path):
    status, out, _ = run("verify", slow, *CONDITIONS, "--verbose")
    assert status == 1
    assert "Only the overshoot and the restart overshoot fail. --setpoint-ramp auto would mend it: with a setpoint ramp of" in out
    status, _, err = run("export-db", slow, *CONDITIONS, "-o", tmp_path)
    assert status == 1
    assert "--setpoint-ramp auto would mend it" in err
    status, out, _ = run("export-db", slow, *CONDITIONS, "-o", tmp_path, "--setpoint-ramp", "auto", "--json")
    assert status == 0
    words = json.loads(out)
    assert words["verdict"] == "PASS"
    assert words["setpoint_ramp"] == json.loads((tmp_path / "data" / "proof.json").read_text())["setpoint_ramp"]
    rate = words["setpoint_ramp"]["degC_per_min"]
    assert f"{rate:.3g} degC/min" in (tmp_path / "weg_pid_call.st").read_text().replace("°C", "degC")
    given = (tmp_path / "words.json", *CONDITIONS, *HAND)
    status, out, _ = run("verify", *given)
    assert (status, f"{rate:.3g} °C/min. The exported files contain" in " ".join(out.split())) == (0, True)
    status, out, _ = run("verify", *given, "--setpoint-ramp", "none", "--json")
    assert status == 1
    assert json.loads(out)["setpoint_ramp"] is None
    status, out, _ = run("verify", *given, "--setpoint-ramp", rate, "--json")
    assert (status, json.loads(out)["setpoint_ramp"]) == (0, words["setpoint_ramp"])


@pytest.mark.parametrize(("asked", "told"), [
    ("quickly", "--setpoint-ramp is 'quickly'; expected °C/min, auto or none"),
    ("nan", "--setpoint-ramp = nan"), ("0", "--setpoint-ramp = 0"),
])
def test_a_ramp_that_is_none_is_refused_in_one_line(run, slow, asked, told):
    status, _, err = run("verify", slow, *CONDITIONS, "--setpoint-ramp", asked)
    assert status == 2
    assert told in err
    assert err.strip().count("\n") == 0


@pytest.mark.parametrize(("ramp", "told"), [
    ({"step": 3, "calls": 1}, "ramp step = 3 is out of range"), ("fast", 'setpoint_ramp: expected an object, got "fast"'),
    ({"step": "3"}, 'setpoint_ramp.step: expected a number, got "3"'),
    ({"step": 0.5, "calls": 0.5}, "setpoint_ramp.calls: expected a whole number, got 0.5"),
])
def test_a_ramp_in_a_words_file_is_checked(run, slow, tmp_path, ramp, told):
    run("export-db", slow, *CONDITIONS, "-o", tmp_path, "--force", "--setpoint-ramp", "none")
    path = tmp_path / "data" / "words.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"setpoint_ramp": ramp}))
    status, _, err = run("verify", path, *CONDITIONS, *HAND)
    assert (status, told in err) == (2, True), err


@pytest.mark.long
def test_a_whole_design_carries_its_ramp_into_every_document_and_the_report(run, tmp_path):
    rows, temperature = [], 20.0
    for t in range(0, 1200, 5):  # one lag of 120 s, 0.5 °C/%, dead time 10 s: a step of 60 % at 60 s
        rows.append(f"{t},{temperature:.3f},{60 if t > 60 else 0}")
        temperature += (20.0 + 0.5 * (60 if t - 10 > 60 else 0) - temperature) / 24.0
    log, out = tmp_path / "own.csv", tmp_path / "out"
    log.write_text("time_s,temp_C,duty_pct\n" + "\n".join(rows))
    status, said, _ = run("design", log, "--target", "s5-ob251", "--out", out, "--setpoint", 45, "--setpoint-ramp", 6)
    led = re.search(r"setpoint ramp ([\d.]+) °C/min", " ".join(said.split()))
    assert status == 0
    assert float(led[1]) == pytest.approx(6.0, rel=0.05)
    asked = ("--setpoint", 45, "--setpoint-ramp", "auto")
    status, said, _ = run("design", log, "--target", "s5-ob251", "--out", tmp_path / "auto", *asked, "--verbose")
    assert (status, "No setpoint ramp is needed" in said) == (0, True)
    documents = {name: json.loads((out / "data" / f"{name}.json").read_text()) for name in ("words", "proof", "pictures")}
    ramp = documents["words"]["setpoint_ramp"]
    assert documents["proof"]["setpoint_ramp"] == ramp
    assert ramp["degC_per_min"] == pytest.approx(6.0, rel=0.05)
    assert "FB 33\n" in (out / "program_listing.txt").read_text()
    assert "The setpoint moves by" in (out / "report.html").read_text()
    # nominal and wish follow the ramp: half way after half of the 25 °C at 6 °C/min, give or take the lag of the loop
    assert documents["pictures"]["nominal"]["followed_degC"][-1] == pytest.approx(45.0, abs=100 / 2047)
    for name in ("nominal", "ideal"):
        series = documents["pictures"][name]
        half = next(t for t, y in zip(series["time_s"], series["temperature_degC"], strict=True) if y > 32.5)
        assert 125.0 < half < 220.0, name
