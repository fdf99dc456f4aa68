import json

import pytest

HAND = ("--gain", 0.37, "--time-constant", 167, "--dead-time", 12, "--ambient", 22)


@pytest.mark.long
def test_the_front_costs_less_the_larger_ms_may_be_and_is_drawn(run, tmp_path):
    picture = tmp_path / "front.svg"
    status, out, err = run("pareto", *HAND, "--points", 4, "--json", "--quiet", "-o", picture)
    document = json.loads(out)
    assert (status, err) == (0, "")
    assert [row["ms_limit"] for row in document["rows"]] == pytest.approx([1.2, 1.4667, 1.7333, 2.0], rel=1e-3)
    assert [row["ms"] for row in document["rows"]] == pytest.approx([1.2, 1.4667, 1.7333, 2.0], rel=1e-3)
    costs = [row["cost"] for row in document["rows"]]
    assert costs == sorted(costs, reverse=True)
    assert picture.read_text().startswith("<svg")
    again = tmp_path / "again.svg"
    assert run("pareto", *HAND, "--points", 4, "--quiet", "-o", again)[0] == 0
    assert again.read_bytes() == picture.read_bytes()
    assert run("pareto", *HAND, "--points", 2, "--quiet", "-o", tmp_path / "front.png")[0] == 0
    assert (tmp_path / "front.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_rows_that_another_limit_keeps_from_gaining_say_so(run):
    # Mks <= 12 decides from Ms = 1.3 on (the optimum under Mks alone has Ms = 1.293), so nothing is gained after it
    out = run("pareto", *HAND, "--mks", 12, "--points", 3, "--ms-range", 1.2, 2.0, "--quiet")[1]
    assert out.splitlines()[-1].endswith("no gain")
    assert not out.splitlines()[-2].endswith("no gain")


@pytest.mark.long
def test_the_front_of_a_sampled_loop_is_above_that_of_the_continuous_one(run):
    found = [json.loads(run("pareto", *HAND, "--points", 2, "--json", "--sample-time", ta)[1]) for ta in (0, 5, "auto")]
    continuous, sampled, auto = ([row["cost"] for row in document["rows"]] for document in found)
    assert all(a < b for a, b in zip(continuous, sampled, strict=True))
    assert found[2]["sample_time_s"] < 5.0
    assert all(a < b < c for a, b, c in zip(continuous, auto, sampled, strict=True))


@pytest.mark.parametrize(("arguments", "told"), [
    (("--points", 1), "points = 1"), (("--ms-range", 2, 1.5), "ms_low = 2.0"), (("--ms-range", 0.9, 1.5), "ms = 0.9"),
    (("-o", "front.pdf"), "expected a name that ends in .svg, .png or .json"), (("--mks", 1), "mks = 1.0"),
    (("--sample-time", "soon"), "expected seconds, auto or words"), (("--weight", 2), "weight = 2.0"),
])
def test_what_cannot_be_drawn_is_told_in_one_line(run, arguments, told):
    status, out, err = run("pareto", *HAND, "--quiet", *arguments)
    assert (status, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1


@pytest.mark.long
def test_the_continuous_tuning_tells_its_active_limit_and_gives_the_keys(run):
    status, out, _ = run("tune", *HAND, "--sample-time", 0, "--json", "--quiet")
    document = json.loads(out)
    assert status == 0
    assert document["sample_time_s"] == 0.0
    # the cost of the load step is never below TN/K, and the optimum hardly swings
    ie = document["integral_time_s"] / document["gain_pct_per_degC"]
    assert ie <= document["iae_load"] < 1.1 * ie
    assert document["ms"] == pytest.approx(1.6, rel=1e-3)
    assert document["mks"] > 1.0 / 0.37
    assert any("global" in note for note in document["notes"])
    assert any(note.startswith("Ms is at its limit of 1.6; with Ms <= 1.68 the cost would be 1") for note in document["notes"])
    slow = json.loads(run("tune", *HAND, "--sample-time", 0, "--mks", 12, "--structure", "pid", "--json", "--quiet")[1])
    assert any("A PI controller under the same limits costs" in note for note in slow["notes"])


@pytest.mark.parametrize(("objective", "key"), [("setpoint", "iae_setpoint"), ("load", "iae_load")])
def test_the_sampled_optimum_serves_its_objective_and_keeps_mt_and_mks(run, objective, key):
    common = ("tune", *HAND, "--sample-time", 5, "--json", "--quiet")
    best = json.loads(run(*common, "--objective", objective)[1])
    other = json.loads(run(*common, "--objective", "load" if objective == "setpoint" else "setpoint")[1])
    assert best[key] < other[key]
    limited = json.loads(run(*common, "--objective", objective, "--mt", 1.05, "--mks", 12)[1])
    assert limited["mt"] < 1.054
    assert limited["mks"] < 12.04
    assert limited[key] > best[key]
