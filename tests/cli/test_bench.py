import json

import pytest

from heatertune.bench import Speed
from heatertune.cli.bench import _told
from heatertune.codec import decode


@pytest.mark.long
@pytest.mark.usefixtures("whatever_pays")
def test_bench_tells_times_that_agree_with_each_other(run):
    status, said, _ = run("bench", "--samples", 100, "--json", "--target", "weg")
    told = json.loads(said)
    assert (status, told["schema"], told["samples"]) == (0, "heatertune/bench/1", 100)
    loop, rate = told["loop"], told["samples_per_s"]
    # a sample is 3,000 scans of 1 s: both figures are of one run
    assert rate["one"] * loop["compiled_ns_per_scan"] * 3000.0 == pytest.approx(1e9, rel=1e-9)
    # machine code is some hundred times faster than plain Python; a tenth is left for a machine that is busy
    assert loop["plain_ns_per_scan"] > 10.0 * loop["compiled_ns_per_scan"]
    assert min(told["fit_ms"].values()) > 0.1
    said = _told(decode(Speed, told, "bench"))
    assert "fit of 100,000 rows" in said
    assert f"{loop['compiled_ns_per_scan']:.1f} ns" in said


def test_bench_refuses_what_makes_no_sense(run):
    assert run("bench", "--samples", 99)[0] == 2
    status, _, said = run("bench", "--target", "z80")
    assert status == 2
    assert "z80" in said
