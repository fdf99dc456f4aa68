"""Where a manual leaves late calls open, any call may be missed: the one that ends full power, too."""

import math
import shutil
from dataclasses import replace
from types import SimpleNamespace

import pytest
from tests.bench import second_opinion
from tests.bench.false_passes import _limits
from tests.bench.outages import bench_of

from heatertune.model.model_values import Fopdt
from heatertune.plc import Boost, Scaling, Words, controller_for
from heatertune.plc.pwm import Actuator
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.proof import prove_models
from heatertune.proof.runs import Runs
from heatertune.proof.scenario import Scenario
from heatertune.proof.verdict import Acceptance, Coverage
from heatertune.settings import Conditions

#: at 121 % of its rated power
HEATER = Fopdt(gain_degC_per_pct=1.21 * 0.9, time_constant_s=300.0, dead_time_s=20.0, ambient_degC=20.0)
WORDS = Words(
    target="simple-pid", scaling=Scaling(low_degC=0.0, high_degC=100.0), sample_time_s=20.0,
    values={"Kp": 4.0, "Ki": 4.0 / 300.0, "Kd": 0.0, "output_max": 100.0, "proportional_on_measurement": 0,
            "differential_on_measurement": 1, "PERIOD_MS": 20000}, boost=Boost(within_degC=8.0, again_degC=12.0))
SIMPLE = controller_for("simple-pid")
SWITCH = Actuator(pwm_period_s=10.0, resolution_s=0.02)
HEAT_UP = Scenario(setpoint_degC=60.0, duration_s=4000.0)


def _proven(overshoot_pct, **stated):
    acceptance = Acceptance(limits=LoopLimits(overshoot_pct=overshoot_pct))
    return prove_models(SIMPLE, WORDS, [("heater", HEATER)], HEAT_UP, SWITCH, acceptance, Coverage(stated_settings=stated))


def _by_the_judge(folder, proof, missed):
    """Return the overshoot of a heat-up [% of rise], as the judge in C sees it."""
    design = SimpleNamespace(proof=proof, conditions=Conditions(setpoint_degC=60.0))
    bench = replace(bench_of(HEATER, design, {"calls": "late"}), missed=missed)
    seen = second_opinion.opinion(second_opinion.compiled(folder), bench, _limits(proof.limits) | {"iae": math.inf}, longer=0.0).seen
    return 100.0 * seen[0]["highest"] / 40.0


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler, cc")
def test_a_limit_that_is_kept_unless_the_call_that_ends_full_power_is_missed_is_broken(tmp_path):
    proof = _proven(8.0)
    assert proof.broken_criteria == ("overshoot",)
    worst = next(each for each in proof.criteria if each.name == "overshoot")
    assert "calls = late" in worst.where
    seen = [_by_the_judge(tmp_path, proof, missed) for missed in range(10)]
    assert seen[0] < 3.0, "as every proof had it: the tenth call after a start-up is missed"
    assert worst.value == pytest.approx(max(seen), rel=1e-4)
    (remark,) = (each for each in proof.diagnostics.remarks if "missed" in each)
    assert remark.startswith(f"calls missed at any scan: {100.0 * worst.value / 8.0:.4g} % of a limit is used, ")


@pytest.mark.parametrize(("overshoot_pct", "stated"), [(20.0, {}), (8.0, {"calls": "on_time"})])
def test_what_keeps_its_limits_or_is_called_on_time_passes(overshoot_pct, stated):
    proof = _proven(overshoot_pct, **stated)
    assert proof.verdict == "PASS"
    assert not any("missed" in each for each in proof.diagnostics.remarks)


def test_a_run_far_from_its_limits_has_no_other_call_missed(monkeypatch):
    # one interval of 20 s at full power heats by 109 °C·20/300 at most, 18 % of the rise
    def refuse(*_, start, **__):
        raise AssertionError(f"start {start}")

    monkeypatch.setattr(Runs, "again", refuse)
    assert _proven(40.0).verdict == "PASS"
    with pytest.raises(AssertionError, match="start 1"):
        _proven(20.0)


def test_each_of_ten_calls_is_missed_from_one_of_the_starts_and_none_of_what_is_called_on_time():
    for calls, number in (("on_time", 0), ("late", 9)):
        running = SIMPLE.start(WORDS, {"calls": calls})
        starts = SIMPLE.core.other_starts(running.parameters, running.state)
        assert len(starts) == number
    missed = set()
    for state in (running.state, *starts):
        outputs, now = [], running._replace(state=state)
        for call in range(10):
            now, scan = SIMPLE.step(now, 60.0, 58.0 - 0.1 * call)
            outputs.append(scan.output)
        (held,) = (call for call in range(10) if outputs[call] == (outputs[call - 1] if call else 0.0))
        missed.add(held)
    assert missed == set(range(10))
