"""A kiln on WEG's block, whose manual leaves open whether it winds up, along a firing of its own."""

from dataclasses import replace

import pytest

from heatertune.chain import prove
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Scaling
from heatertune.proof.design_request import DesignRequest, plainly
from heatertune.proof.redesign import find_passing_design
from heatertune.settings import Conditions

#: the kiln of issue 13
KILN = model_by_hand(Fopdt(gain_degC_per_pct=9.0, time_constant_s=3600.0, dead_time_s=120.0, ambient_degC=20.0))

#: a block that keeps Ts itself and skips every second call cannot hold this firing: the user found out that it does not
CALLED = {"sampling": "caller"}


@pytest.mark.long(seconds=18)
def test_gains_mend_the_firing_where_it_is_known_that_nothing_winds_up_without_a_limit(tmp_path):
    # 150 °C/h as Orton's cones are fired, limits of the preset: neither other gains nor a ramp is enough alone
    firing = tmp_path / "firing.csv"
    firing.write_text("target [degC],ramp [degC/h],soak [min]\n600,150,30\n")
    asked = DesignRequest(target="weg", scaling=Scaling(low_degC=0.0, high_degC=1200.0), setpoint_ramp="none",
                  conditions=Conditions(setpoint_degC=600.0, spec="kiln", profile=str(firing), switches=CALLED))
    first = plainly(KILN, asked).proof
    broken = {each.name for each in first.criteria if not each.ok}
    assert {"ramp_overshoot_degC", "soak_deviation", "reheat_overshoot_degC"} <= broken
    # nothing mends a sum without a limit, which a night with an open circuit winds up; who knows better is told so
    open_point = find_passing_design(KILN, DesignRequest(target="weg", scaling=asked.scaling, conditions=asked.conditions)).proof
    assert open_point.verdict == "FAIL"
    assert "would pass with --assume anti_windup=clamp" in open_point.diagnostics.remarks[0]
    known = replace(asked.conditions, switches={**CALLED, "anti_windup": "clamp"})
    found = find_passing_design(KILN, DesignRequest(target="weg", scaling=asked.scaling, conditions=known)).proof
    assert found.verdict == prove(found.words, KILN, known).verdict == "PASS"
