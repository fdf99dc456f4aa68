"""`tune --robust` as a user types it."""

import json
import math
from dataclasses import replace

import pytest

from heatertune.codec import to_json
from heatertune.model.model_document import to_document
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.model.statistics import Interval


@pytest.fixture
def model(tmp_path):
    heater = Fopdt(gain_degC_per_pct=0.4, time_constant_s=160.0, dead_time_s=16.0, ambient_degC=20.0)
    fitted = replace(model_by_hand(heater), ci95={"gain_degC_per_pct": Interval(low=0.3, high=0.53)})
    path = tmp_path / "model.json"
    path.write_text(to_json(to_document(fitted)), encoding="utf-8")
    return path


@pytest.mark.long
def test_the_wider_the_promise_the_smaller_the_gain(model, run):
    # 95 % have to hold on 1000 others too; all of a set is all of that set
    gains, drawn = [], {"none": 0, "p95": 1200, "worst": 200}
    for way in ("none", "p95", "worst"):
        status, out, _ = run("tune", model, "--sample-time", 0, "--robust", way, "--json", "--quiet")
        assert status == 0
        document = json.loads(out)
        gains.append(document["gain_pct_per_degC"])
        told = [note for note in document["notes"] if note.startswith(f"Robust over {drawn[way]} heaters")]
        assert bool(told) == (way != "none")
        assert document["robust"] == (None if way == "none" else {"way": way, "limits": {"ms": 1.6}})
    # only the heater's gain is open, lognormal, so K has to fall about as its 95 % quantile rises: e^(1.645·σ)
    assert gains[0] > gains[1] > gains[2]
    sigma = math.log(0.53 / 0.3) / (2.0 * 1.96)
    assert gains[1] / gains[0] == pytest.approx(math.exp(-1.645 * sigma), abs=0.04)


def test_a_model_without_intervals_is_refused_in_one_line(run):
    status, _, err = run("tune", "--gain", 0.4, "--time-constant", 160, "--dead-time", 16, "--robust", "worst", "--quiet")
    assert status == 2
    assert "needs a model with intervals" in err
    assert err.count("\n") == 1
