"""`heatertune advise` as a user types it."""

import json
import math

import pytest

KNOWN = ("--assume", "anti_windup=clamp")
HAND = ("--gain", 0.37, "--time-constant", 167, "--dead-time", 12, "--ambient", 22)


@pytest.fixture
def response(tmp_path):
    """Write a log with the second-order response 22 → 35 °C of a damping ratio, setpoint logged or not."""

    def write(damping=0.3, lag_s=None, setpoint=True):
        wn = 2.0 * math.pi / 150.0
        rows = []
        for t in range(0, 900, 3):
            if lag_s is None:
                root = math.sqrt(1.0 - damping**2)
                share = 1.0 - math.exp(-damping * wn * t) / root * math.sin(wn * root * t + math.acos(damping))
            else:
                share = 1.0 - math.exp(-t / lag_s)
            rows.append(f"{t},{22.0 + 13.0 * share:.3f}" + (",35.0" if setpoint else ""))
        path = tmp_path / "response.csv"
        path.write_text("time_s,temp_C" + (",setpoint_C" if setpoint else "") + "\n" + "\n".join(rows))
        return path

    return write


@pytest.fixture
def pid(tmp_path, run):
    """A calm PID design: it passes on WEG's block where that holds its integral part while the heater is cut off."""
    path = tmp_path / "calm.json"
    assert run("tune", *HAND, "-o", path)[0] == 0
    calm = {"gain_pct_per_degC": 4.5, "integral_time_s": 200.0, "derivative_time_s": 4.0, "sample_time_s": 2.0,
            "structure": "pid"}
    path.write_text(json.dumps(json.loads(path.read_text()) | calm))
    return path


def _cases(document):
    return {case["step"]: case for case in document["cases"]}


@pytest.mark.long
def test_overshoot_is_answered_by_smaller_gains_proven_before_and_after(run, response, pid):
    status, out, err = run("advise", response(), "--pid", pid, *KNOWN, "--json", "--quiet")
    document = json.loads(out)
    assert (status, err, document["symptom"], document["target"]) == (0, "", "OVERSHOOT", "weg")
    assert document["response"]["overshoot_pct"] == pytest.approx(37.2, abs=0.2)  # exp(−π·0.3/√0.91)
    cases = _cases(document)
    before, kp, ki, kd, whole = cases.values()
    design = json.loads(pid.read_text())
    assert before["kp"] == design["gain_pct_per_degC"]
    assert before["ki"] == pytest.approx(1.0 / design["integral_time_s"])
    assert [case["kp"] / before["kp"] for case in (kp, ki, kd, whole)] == pytest.approx([0.8, 1.0, 1.0, 0.8])
    assert [case["ki"] / before["ki"] for case in (kp, ki, kd, whole)] == pytest.approx([1.0, 0.8, 1.0, 0.8])
    assert [case["kd"] / before["kd"] for case in (kp, ki, kd, whole)] == pytest.approx([1.0, 1.0, 0.5, 0.5])
    # the words proven are those of the gains
    assert [case["words"]["Kp"] for case in (before, kp)] == pytest.approx([before["kp"], 0.8 * before["kp"]])
    assert [case["words"]["Ki"] for case in (before, ki)] == pytest.approx([before["ki"], 0.8 * before["ki"]])
    assert [case["words"]["Kd"] for case in (before, kd)] == pytest.approx([before["kd"], 0.5 * before["kd"]])
    # less Kp takes less of the sum away after an open circuit: a plain loop of this heater at 1.21 of the power, whose sum is
    # kept so that P + I stays within the output's range, overshoots by 31 % at Kp 4.5 after 220 s and by 39 % at 3.6 after
    # 300 s, with 0.8 of Ki as well by 37 %; the limit is 40 %, and WEG's block keeps a little more of its sum. A step that
    # costs the PASS is no help, whatever its overshoot in the heat-up
    assert [case["verdict"] for case in cases.values()] == ["PASS", "NOT PROVEN", "PASS", "PASS", "PASS"]
    assert (kp["fails"], kp["effect"]) == (["briefly-open"], "worse: no longer PASS")
    for case in cases.values():
        assert case["overshoot"] >= 0.0
        assert case["iae"] > 0.0
    for case in (kp, ki, kd, whole):
        told = case["effect"].split(":")[0]
        if case["verdict"] == before["verdict"] and told != "no difference":
            assert told == ("better" if case["overshoot"] < before["overshoot"] else "worse")
    # the best is the step that leaves the least overshoot of those that pass and help; this calm design leaves none to mend
    helping = [case for case in (kp, ki, kd, whole) if case["verdict"] == "PASS" and case["effect"].startswith("better")]
    assert document["best"] == (min(helping, key=lambda case: case["overshoot"])["step"] if helping else None)
    assert document["best"] != kp["step"]


@pytest.mark.long
def test_the_proof_of_each_step_is_the_one_of_verify(run, response, pid, tmp_path):
    document = json.loads(run("advise", response(), "--pid", pid, "--json", "--quiet")[1])
    case = _cases(document)["(1) Kp -20 %"]
    design = json.loads(pid.read_text())
    design["gain_pct_per_degC"] *= 0.8
    (tmp_path / "after.json").write_text(json.dumps(design))
    proof = json.loads(run("verify", tmp_path / "after.json", "--target", "weg", "--setpoint", 35, "--json")[1])
    assert case["verdict"] == proof["verdict"]
    for name in ("overshoot", "settling_time", "iae"):
        assert case[name] == pytest.approx(proof["criteria"][name]["value"], rel=1e-6)


def test_advice_that_makes_it_worse_is_said_to(run, response, by_hand):
    # far from the setpoint: Kp +50 % on a design with Ms = 1.6 leaves the limit of 2
    document = json.loads(run("advise", response(lag_s=900.0), "--pid", by_hand, "--target", "s5-ob251", "--json", "--quiet")[1])
    assert document["symptom"] == "FAR"
    before, *steps = document["cases"]
    assert len(steps) == 4
    kp, ki, kd, whole = steps
    assert (before["verdict"], kp["verdict"], kp["effect"]) == ("PASS", "FAIL", "worse: no longer PASS")
    assert "ms" in kp["fails"]
    assert whole["effect"].startswith("worse")
    assert kd["effect"] == "none"
    assert document["best"] in (None, ki["step"])


def test_status_1_says_that_nothing_passes(run, by_hand):
    # at Ms = 1.6 the block without anti-windup overshoots by more than 20 %, and the response itself shows nothing
    status, out, _ = run("advise", "proof", "--pid", by_hand, "--quiet")
    assert status == 1
    assert "FAIL" in out


@pytest.mark.long
def test_a_step_that_raises_what_it_should_lower_is_worse(run, response, by_hand):
    # without an anti-windup, a faster I part winds up more: the IAE of a design that fails already grows
    _, out, _ = run("advise", response(lag_s=900.0), "--pid", by_hand, "--json", "--quiet")
    document = json.loads(out)
    before, _, ki, *_ = document["cases"]
    assert (document["aim"], before["verdict"], ki["effect"]) == ("iae", "FAIL", "worse")
    assert ki["iae"] > 1.01 * before["iae"]


@pytest.mark.long
def test_a_failure_that_hangs_on_what_the_manual_leaves_open_says_what_to_find_out(run, response, pid):
    # the same design passes above, where --assume says how the block's I part behaves at a limit
    status, out, _ = run("advise", response(), "--pid", pid, "--quiet")
    assert status == 1
    assert "find out what this controller does, and state it with --assume anti_windup=clamp." in out


@pytest.mark.long
def test_a_step_that_helps_but_fails_is_not_the_best(run, response, by_hand):
    known = ("--assume", "sampling=caller")
    document = json.loads(run("advise", response(lag_s=280.0), "--pid", by_hand, *known, "--json", "--quiet")[1])
    assert document["symptom"] == "SLOW"
    before, kp, ki, *_ = document["cases"]
    # at -10 % of the voltage full power limits the heat-up, so Kp changes the worst settling time by less than 0.5 %
    assert (kp["verdict"], kp["effect"], ki["verdict"], ki["effect"]) == ("FAIL", "no difference", "FAIL", "better")
    assert 0.995 * before["settling_time"] < kp["settling_time"]
    assert ki["settling_time"] < 0.995 * before["settling_time"]
    assert document["best"] is None


@pytest.mark.long
def test_what_is_right_is_a_matter_of_the_tolerance(run, by_hand):
    # Table 4 goes 1.7 °C beyond 53.3 °C, printed: 55.0 °C
    named = [
        json.loads(run("advise", "table4", "--pid", by_hand, "--setpoint", 53.3, "--tolerance", each, "--json", "--quiet")[1])
        for each in (1.6, 1.8)
    ]
    assert [document["symptom"] == "OVERSHOOT" for document in named] == [True, False]


@pytest.mark.long
def test_the_papers_tables_are_told_apart(run, by_hand):
    _, out, _ = run("advise", "table3", "--pid", by_hand, "--setpoint", 53.3, "--quiet")
    assert out.startswith("table3: bad: creeps")
    assert "(1) Kp +50 %" in out
    status, out, _ = run("advise", "table4", "--pid", by_hand, "--setpoint", 53.3, "--assume", "anti_windup=clamp")
    assert out.startswith("table4: almost good, but the overshoot is a bit high")
    assert "nothing changes" in out, "the design has no D part that step (3) could change"
    assert "settled: 900 s" in out
    assert "step of 29.3 °C to 53.3 °C, overshoot 5.8 %" in out
    model = json.loads(by_hand.read_text())["model"]
    # 3 lags and the dead time of the heater given by hand
    assert f"expected within {3 * model['time_constant_s'] + model['dead_time_s']:.0f} s" in out
    assert status == 0


def test_the_proof_itself_can_be_the_response(run, by_hand):
    # on OB251, whose anti-windup is known, the tuned design has nothing to be advised on; its overshoot is the proof's
    status, out, _ = run("advise", "proof", "--pid", by_hand, "--target", "s5-ob251", "--setpoint", 30, "--json", "--quiet")
    document = json.loads(out)
    assert (document["log"], document["symptom"], document["best"]) == (None, "NONE", None)
    (before,) = document["cases"]
    assert (status == 0) == (before["verdict"] == "PASS")
    assert document["response"]["overshoot_pct"] <= before["overshoot"]


@pytest.mark.long
def test_other_targets_are_advised_too(run, response, by_hand):
    document = json.loads(run("advise", response(), "--pid", by_hand, "--target", "s5-ob251", "--json", "--quiet")[1])
    assert set(document["cases"][0]["words"]) >= {"K", "R", "TI"}
    assert _cases(document)["(3) Kd -50 %"]["verdict"] == "nothing changes"


def test_a_step_that_does_not_fit_the_target_says_so(run, response, tmp_path):
    design = {"schema": "heatertune/pid/2", "gain_pct_per_degC": 29.0, "integral_time_s": 300.0, "derivative_time_s": 0.0,
              "sample_time_s": 5.0}
    model = json.loads(_model(run, tmp_path))
    (tmp_path / "pid.json").write_text(json.dumps(design | {"model": model}))
    document = json.loads(run("advise", response(lag_s=900.0), "--pid", tmp_path / "pid.json", "--target", "s5-ob251",
                              "--json", "--quiet")[1])
    case = _cases(document)["(1) Kp +50 %"]
    assert case["verdict"] == "not representable"
    assert "word K" in case["why"]


def _model(run, folder):
    assert run("tune", *HAND, "-o", folder / "tuned.json")[0] == 0
    return json.dumps(json.loads((folder / "tuned.json").read_text())["model"])


def test_until_and_the_last_setpoint_step_choose_what_is_looked_at(run, tmp_path, by_hand):
    rows = [f"{t},{22.0 + (t > 0) * 8.0 * (1 - math.exp(-t / 40.0)):.3f},30" for t in range(0, 600, 3)]
    rows += [f"{600 + t},{30.0 + 15.0 * (1 - math.exp(-t / 40.0)):.3f},45" for t in range(0, 600, 3)]
    path = tmp_path / "two.csv"
    path.write_text("time_s,temp_C,setpoint_C\n" + "\n".join(rows))
    seen = json.loads(run("advise", path, "--pid", by_hand, "--json", "--quiet")[1])["response"]
    assert (seen["setpoint_degC"], round(seen["step_degC"], 1)) == (45.0, 15.0)
    seen = json.loads(run("advise", path, "--pid", by_hand, "--until", 590, "--json", "--quiet")[1])["response"]
    assert (seen["setpoint_degC"], round(seen["step_degC"], 1)) == (30.0, 8.0)


@pytest.mark.parametrize(("arguments", "named"), [
    (("none.csv", "--pid", "PID"), "none.csv"), (("LOG", "--pid", "no.json"), "no.json"), (("LOG", "--pid", "PID"), "--setpoint"),
    (("LOG", "--pid", "BARE", "--setpoint", 45), "holds no model"), (("LOG", "--pid", "PID", "--setpoint", 22.3), "a step to judge"),
    (("LOG", "--pid", "PID", "--target", "plc", "--setpoint", 45), "plc"), (("LOG",), "--pid"),
])
def test_bad_input_gets_one_line_and_status_2(run, response, by_hand, tmp_path, arguments, named):
    bare = {k: v for k, v in json.loads(by_hand.read_text()).items() if k != "model"}
    (tmp_path / "bare.json").write_text(json.dumps(bare))
    places = {"LOG": response(setpoint=False), "PID": by_hand, "BARE": tmp_path / "bare.json"}
    status, out, err = run("advise", *(places.get(each, each) for each in arguments), "--quiet")
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert named in err
