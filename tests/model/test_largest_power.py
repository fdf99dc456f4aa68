"""The unit of the power in a log without it: what the curve shows, what is stated, and what neither says."""

import re

import numpy as np
import pytest
from tests.bench import output_limits, whose_heater

from heatertune.chain.stages import fit
from heatertune.errors import InputError
from heatertune.log import read_log
from heatertune.log.log_values import Log
from heatertune.model.findings import KINDS
from heatertune.model.fit import fit_known
from heatertune.model.model_values import FitOutcome
from heatertune.model.temperature.closed_loop import Hypothesis, LogSegment
from heatertune.model.temperature.fit_temperature import _power_remarks
from heatertune.plc.s7_200_paper.step import LAWS


def log_of(rows):
    return Log(name="log", source="", time_s=rows[:, 0], temperature_degC=rows[:, 1])


def hypothesis(law, largest_power_pct):
    rows, *_ = output_limits.draw("full", 0)
    segment = LogSegment(log=log_of(rows), law=law, event=False, ambient_degC=(10.0, 30.0))
    return Hypothesis(segments=(segment,), two_lags=True, largest_power_pct=largest_power_pct)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_half_the_largest_power_is_twice_the_gain_and_half_the_controller_s(law):
    # by the heater's law: twice the gain with half the power is the same temperature
    whole, half = hypothesis(law, 100.0), hypothesis(law, 50.0)
    for z in whole.starts(np.random.default_rng(3), 20):
        assert half.plant(z).gain_degC_per_pct == pytest.approx(2.0 * whole.plant(z).gain_degC_per_pct)
        assert half.plant(z).lags_s == whole.plant(z).lags_s
        full, halved = whole.controller(z), half.controller(z)
        for name in full:
            assert halved[name] == pytest.approx(0.5 * full[name] if "_pct" in name else full[name])


def test_a_loop_at_its_limit_keeps_its_gain_where_the_limit_is_full_power():
    # positional P from the cold: 50 %/°C far below the setpoint is beyond 100 %
    stated, unstated = hypothesis(LAWS[0], 100.0), hypothesis(LAWS[0], None)
    z = stated.low + 0.5 * (stated.high - stated.low)
    z[stated.names.index("gain_pct_per_degC")] = np.log(50.0)
    assert stated.plant(z).gain_degC_per_pct == unstated.plant(z).gain_degC_per_pct


def test_the_largest_power_is_refused_where_the_power_is_known():
    time = np.arange(0.0, 600.0, 5.0)
    powered = (time, 20.0 + 30.0 * (1.0 - np.exp(-np.maximum(time - 60.0, 0.0) / 100.0)), np.where(time < 50.0, 0.0, 60.0))
    with pytest.raises(InputError, match="the power was logged, so --largest-power states nothing here; leave it out"):
        fit(powered, largest_power_pct=70.0)


def test_the_paper_s_tables_have_the_output_limit_of_its_program():
    # Table 2 of the paper: the pulse may be as long as the whole PWM period
    assert read_log("table3").output_limit_pct == read_log("table4").output_limit_pct == 100.0


@pytest.mark.parametrize("name", ["table3", "table4"])
def test_that_the_heater_got_what_the_paper_s_program_allows_is_an_assumption_of_the_verdict(name):
    (remark,) = _power_remarks([read_log(name)], {}, None)
    assert remark.finding == "output-limit"
    assert "taken as 100 %" in remark.sentence
    assert "does not show that the heater got it" in remark.sentence
    assert KINDS[remark.finding].is_assumption


@pytest.mark.long
def test_no_gain_is_identified_from_a_loop_whose_largest_output_is_not_known_and_the_remedy_works():
    # a PI loop that starts at 66 % and never gets more than 71 %: a gain of 2.72, where full power would mean 1.90
    drawn = whose_heater.draw("restart", "loop", 1)
    rows = np.array([(t, y) for t, y, _ in drawn.rows])
    blind = fit(log_of(rows), until_s=1190.0)
    assert blind.outcome is FitOutcome.COMBINATIONS_ONLY
    assert blind.ci95["gain_degC_per_pct"] is None
    (finding,) = [each for each in blind.findings if each.name == "largest-power-unknown"]
    assert finding.kind.effect == "blocks"
    assert re.search(r"--largest-power PCT", finding.message)
    least = blind.combinations["gain_per_time_constant_degC_per_s_pct"][1]
    assert least.high is None
    told = fit(log_of(rows), until_s=1190.0, largest_power_pct=max(u for t, _, u in drawn.rows if t < 1190.0))
    assert "largest-power-unknown" not in {each.name for each in told.findings}
    assert any(each.name == "largest-power" and each.kind.is_assumption for each in told.findings)
    gains = [each.model.gain_degC_per_pct for each in told.candidates]
    assert min(gains) <= drawn.gain <= max(gains)


def test_a_known_controller_s_power_is_computed():
    with pytest.raises(InputError, match="a known controller's power is computed; leave it out"):
        fit_known(read_log("table4"), (), setpoint_degC=50.0, largest_power_pct=70.0)


@pytest.mark.long
def test_a_dead_time_that_the_unknown_instant_of_closing_explains_is_not_identified_too_long():
    # closed at the first reading; closed one used reading earlier, as was once assumed, it would be 6 s longer
    rows, largest, truth, _ = output_limits.draw("least", 0)
    inside = fit(log_of(rows), largest_power_pct=largest).ci95["dead_time_s"]
    assert inside is None or inside.low <= truth["dead_time_s"] <= inside.high
