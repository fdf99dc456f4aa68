"""A kiln on WEG's block, whose manual leaves open whether it winds up, along a firing of its own."""

import pytest

from heatertune.chain import prove
from heatertune.model.by_hand import model_by_hand
from heatertune.model.values import Fopdt
from heatertune.plc import Scaling
from heatertune.proof.closing import Asked, closed, plainly
from heatertune.settings import Conditions

#: the kiln of issue 13
KILN = model_by_hand(Fopdt(gain_degC_per_pct=9.0, time_constant_s=3600.0, dead_time_s=120.0, ambient_degC=20.0))

#: a block that keeps Ts itself and skips every second call cannot hold this firing: the user found out that it does not
CALLED = {"sampling": "caller"}


@pytest.mark.long
def test_gains_mend_the_firing_and_a_ramp_with_holdback_the_windup(tmp_path):
    # 150 °C/h as Orton's cones are fired, limits of the preset: neither other gains nor a ramp is enough alone
    firing = tmp_path / "firing.csv"
    firing.write_text("target [degC],ramp [degC/h],soak [min]\n600,150,30\n")
    asked = Asked(target="weg", scaling=Scaling(low_degC=0.0, high_degC=1200.0), setpoint_ramp="none",
                  conditions=Conditions(setpoint_degC=600.0, spec="kiln", profile=str(firing), switches=CALLED))
    first = plainly(KILN, asked).proof
    broken = {each.name for each in first.criteria if not each.ok}
    assert {"ramp_overshoot_degC", "soak_deviation", "reheat_overshoot_degC"} <= broken
    found = closed(KILN, Asked(target="weg", scaling=asked.scaling, conditions=asked.conditions)).proof
    assert found.verdict == prove(found.words, KILN, asked.conditions).verdict == "PASS"
    assert found.words.ramp is not None
    # the kiln at its own setpoint led along the firing: what the program leads must not be slower than the firing
    assert found.ramp_degC_per_min > 150.0 / 60.0
