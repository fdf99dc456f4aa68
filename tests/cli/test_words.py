"""How words are found, from the command line."""

import json

import pytest

HAND = ("--gain", 0.8, "--time-constant", 480, "--dead-time", 60, "--ambient", 22)
CONDITIONS = ("--target", "s5-ob251", "--setpoint", 40)


@pytest.fixture
def slow(tmp_path, run):
    """A slow heater sampled fast: its TI word is small, and its integral winds up."""
    path = tmp_path / "pid.json"
    assert run("tune", *HAND, "--sample-time", 2, "-o", path)[0] == 0
    return path


def _export(run, pid, out, *options):
    return run("export-db", pid, *CONDITIONS, "-o", out, "--force", "--json", *options)


@pytest.mark.long
def test_the_best_words_are_exported_unless_rounding_is_asked_for(run, slow, tmp_path):
    best, plain = (json.loads(_export(run, slow, tmp_path / way, "--words", way)[1]) for way in ("auto", "rounded"))
    assert best["search"]["way"] == "optimum"
    assert best["search"]["rounded"]["words"] == {name: plain["words"][name] for name in ("K", "TI", "TD")}
    assert best["words"] != plain["words"]
    assert best["search"]["ms"] <= best["search"]["ms_limit"]
    assert plain["search"]["way"] == "rounded"
    told = run("export-db", slow, *CONDITIONS, "-o", tmp_path / "text", "--force")[1]
    assert f"TI = {best['words']['TI']} are the best integers" in told
    assert "one step changes the I part" in told
    assert json.loads((tmp_path / "text" / "data" / "words.json").read_text())["search"] == best["search"]


@pytest.mark.long
def test_verify_proves_the_words_that_export_would_write(run, slow, tmp_path):
    exported = json.loads(_export(run, slow, tmp_path)[1])
    ms = {}
    for name, options in (("pid", ()), ("rounded", ("--words", "rounded")), ("words", None)):
        source, extra = (slow, options) if options is not None else (tmp_path / "words.json", HAND)
        ms[name] = json.loads(run("verify", source, *CONDITIONS, *extra, "--json")[1])["criteria"]["ms"]["value"]
    assert ms["pid"] == ms["words"]
    assert ms["pid"] == exported["search"]["ms"]  # both count the 0.48 s of the input module's conversion
    assert ms["rounded"] != ms["pid"]


@pytest.mark.long
def test_refined_words_pass_where_the_optimum_winds_up(run, tmp_path):
    # at 1.21 of the power the refined words overshoot by 41.6 % after an open circuit (40 % are allowed): the subject is what
    # they mend of the optimum at the rated power
    slow, spec = tmp_path / "pid.json", tmp_path / "spec.toml"
    spec.write_text("[story]\nmains = false\n")
    at_rated = (*CONDITIONS, "--spec", spec)
    assert run("tune", *HAND, "--sample-time", 5, "-o", slow)[0] == 0
    status, _, err = run("export-db", slow, *at_rated, "-o", tmp_path / "out")
    assert (status, "overshoot" in err) == (1, True)
    status, out, _ = run("export-db", slow, *at_rated, "-o", tmp_path / "out", "--refine", "--json")
    document = json.loads(out)
    assert (status, document["verdict"], document["search"]["way"]) == (0, "PASS", "refined")
    # what the search tells of the words is what the proof finds of them
    proof = json.loads((tmp_path / "out" / "data" / "proof.json").read_text())
    assert proof["criteria"]["ms"]["value"] == document["search"]["ms"]  # both count the input module's 0.48 s
    assert run("verify", tmp_path / "out" / "words.json", *at_rated, *HAND)[0] == 0


def test_the_switch_is_told_with_its_ripple_and_its_wear(run):
    relay, ssr = (run("tune", *HAND, "--switch-kind", kind)[1] for kind in ("relay", "ssr"))
    assert "switchings an hour" in " ".join(relay.split())
    assert "PWM period" in ssr
    assert "switchings" not in ssr


def test_an_interval_by_the_words_needs_to_know_whose_words(run):
    status, out, err = run("tune", *HAND, "--sample-time", "words")
    assert (status, out) == (2, "")
    assert "--sample-time words needs --target" in err


def test_parameters_are_verified_with_the_controller_and_the_heater_that_lie_next_to_them(by_hand, run, tmp_path):
    assert run("export-db", by_hand, "--target", "s7-300", "-o", tmp_path / "out")[0] == 0
    words = tmp_path / "out" / "data" / "words.json"
    status, out, err = run("verify", words, "--verbose", "--quiet")
    assert (status, err) == (0, "")
    assert "VERDICT PASS" in out
    assert "data/pid.json has the conditions of the design, too." in out
    (tmp_path / "out" / "data" / "pid.json").unlink()
    status, _, err = run("verify", words)
    assert (status, err) == (2, "error: no model: name a model file, or add --gain, --time-constant, --dead-time\n")
    status, _, err = run("verify", by_hand)
    assert (status, err) == (2, f"error: {by_hand} names no controller: add --target NAME (see: heatertune targets)\n")
