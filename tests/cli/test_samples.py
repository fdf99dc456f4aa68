"""`verify --samples` and `--replay`: both run the same sample, so each is the other's witness."""

import json

import pytest
from scipy.stats import beta

HAND = ("--gain", 0.37, "--time-constant", 167, "--dead-time", 12, "--ambient", 22)
#: all that the manual leaves open: one setting, so all samples are of one controller
KNOWN = tuple(part for setting in ("sum=unlimited", "integral_off=previous_call", "integral_inward=off", "rounding=fraction_kept")
              for part in ("--assume", setting))
PROOF = ("--target", "s5-ob251", "--setpoint", 40, "--noise", 0.05, *HAND, "--json")


@pytest.mark.long
def test_the_worst_of_the_samples_comes_back_by_its_seed(run, by_hand):
    status, out, _ = run("verify", by_hand, *PROOF, "--samples", 12, "--seed", 100)
    document = json.loads(out)
    found = document["samples"]
    assert (status == 0) == (document["verdict"] == "PASS") == (found["verdict"] == "PASS")
    assert found["count"] == 12
    assert 100 <= found["worst_seed"] < 112
    status, out, _ = run("verify", by_hand, *PROOF, "--replay", found["worst_seed"])
    sample = json.loads(out)
    assert (status == 0) == (sample["verdict"] == "PASS")
    assert sample["seed"] == found["worst_seed"]
    for name, criterion in sample["criteria"].items():
        least, most = sorted((criterion["value"], found["criteria"][name]["worst"]), reverse=criterion["bound"] == ">=")
        assert criterion["value"] == pytest.approx(least, rel=1e-9), (name, most)
        if not name.endswith("_time"):  # of several like parts the worst stands there, with its own limit
            assert criterion["limit"] == found["criteria"][name]["limit"], name
    # a heater given by hand has no intervals: mains and ambient alone differ
    assert sample["heater"]["lags_s"] == [167.0]
    assert 0.37 * 0.81 <= sample["heater"]["gain_degC_per_pct"] <= 0.37 * 1.21
    assert 17.0 <= sample["heater"]["ambient_degC"] <= 27.0
    assert len(sample["trace"]["time_s"]) == len(sample["trace"]["temperature_degC"]) > 100


def test_without_spread_every_sample_is_the_nominal_run(run, by_hand):
    calm = ("--mains", 0, "--ambient-spread", 0, "--disturbance-spread", 0)
    quiet = tuple(0 if each == 0.05 else each for each in PROOF)
    document = json.loads(run("verify", by_hand, *quiet, *calm, *KNOWN, "--samples", 3)[1])
    nominal = document["runs"][0]["criteria"]
    for name, spot in document["samples"]["criteria"].items():
        assert spot["median"] == spot["worst"], name
        assert abs(spot["worst"] - nominal[name]["value"]) <= 1e-9 * max(1.0, abs(spot["worst"])), name


@pytest.mark.long
def test_a_share_too_small_fails_and_the_text_tells_it(run, by_hand):
    # at ±60 % of the voltage some heaters cannot hold 40 °C: 22 + 37 · 0.16 = 28 °C; with up to 2.56 times the power
    # others overshoot by more than 65 % of a small change. The replays count those that pass, Clopper and Pearson
    # (Biometrika 26, 1934) bound the share by the 95 % quantile of Beta(passed + 1, failed)
    given = tuple(each for each in PROOF if each != "--json")
    status, out, _ = run("verify", by_hand, *given, "--samples", 12, "--mains", 60, "--verbose")
    assert status == 1
    replays = [json.loads(run("verify", by_hand, *PROOF, "--mains", 60, "--replay", seed)[1]) for seed in range(12)]
    weak = [each for each in replays
            if each["heater"]["ambient_degC"] + 100.0 * each["heater"]["gain_degC_per_pct"] < 40.0]
    passed = sum(each["verdict"] == "PASS" for each in replays)
    assert 0 < len(weak) < 12 - passed < 12, "the draw holds weak heaters, strong ones and some between"
    assert {each["verdict"] for each in weak} == {"FAIL"}
    share = 100.0 * beta.ppf(0.95, passed + 1, 12 - passed)
    assert (f"samples from seed 0 on: {passed} of 12 samples keep every limit under every setting, "
            f"so at most {share:.4g} % of all do") in out
    assert "never" in out
    last = out.rstrip().splitlines()[-1]
    assert last.startswith("VERDICT FAIL at 40 °C in 18 runs on 1 plausible heater")
    few = (*given, *KNOWN, "--samples", 12, "--mains", 60, "--quantile")
    brief = run("verify", by_hand, *few, 0.9)[1]
    assert brief.startswith("FAIL")
    assert "some heaters lack the power for this setpoint" in " ".join(brief.split())
    assert not run("verify", by_hand, *few, 0.2)[1].startswith("FAIL")


@pytest.mark.long
def test_what_makes_no_sense_is_refused(run, by_hand):
    for wrong, named in ((("--samples", 0), "samples"), (("--samples", 3, "--quantile", 0), "quantile"),
                         (("--samples", 3, "--mains", 120), "--mains"), (("--replay", -1), "--replay"),
                         (("--samples", 3, "--ambient-spread", 30), "spread of the ambient"),
                         (("--samples", 3, "--jitter", 1e9), "jitter_s"), (("--samples", 3, "--replay", 1), "give one of them"),
                         (("--limit", "ms=0.9"), "limit ms = 0.9 is out of range: must be >= 1"),
                         (("--samples", 3, "--interlock", "heater-fan"), "without an interlock")):
        status, _, err = run("verify", by_hand, *PROOF, *wrong)
        assert status == 2, wrong
        assert named in err


@pytest.mark.long
def test_a_sample_runs_under_the_switches_that_are_named(run, by_hand):
    given = tuple("weg" if each == "s5-ob251" else each for each in PROOF)
    found = []
    for way in ("clamp", "none"):
        each = (*given, "--assume", f"anti_windup={way}")
        sampled = json.loads(run("verify", by_hand, *each, "--samples", 1, "--seed", 7)[1])["samples"]["criteria"]
        replayed = json.loads(run("verify", by_hand, *each, "--replay", 7)[1])["criteria"]
        assert abs(sampled["iae"]["worst"] - replayed["iae"]["value"]) <= 1e-9 * replayed["iae"]["value"]
        found.append(sampled["overshoot"]["worst"])
    # what the integral part gathers while the heater is at full power is what the temperature overshoots by
    assert found[1] > 2.0 * found[0] > 0.0
