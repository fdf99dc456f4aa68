"""Of logs without power that no tried law made, only the heater under constant power is identified; no verdict PASS."""

import numpy as np
import pytest

from heatertune.chain.stages import fit
from heatertune.log import read_log
from heatertune.model.model_values import FitOutcome
from tests.bench import blind

THERMOSTATS = ["thermostat", "slow thermostat"]
SWITCHED_MANUALLY = ["pulse", "long pulse", "part pulse", "rest pulse", "firings"]
OTHERS = [kind for kind, (_, law_is_tried) in blind.KINDS.items()
          if not law_is_tried and kind not in (*THERMOSTATS, *SWITCHED_MANUALLY)]


def _fitted(case, folder):
    path = folder / "blind.csv"
    path.write_text(blind.without_power(case), encoding="utf-8")
    return fit(read_log(path))


@pytest.mark.long
@pytest.mark.parametrize("kind", OTHERS)
def test_no_parameter_is_identified_and_the_verdict_is_blocked(kind, tmp_path):
    fitted = _fitted(blind.make(kind, 7), tmp_path)
    assert fitted.outcome is FitOutcome.LAW_UNKNOWN
    assert all(interval is None for interval in fitted.ci95.values())
    assert not fitted.combinations
    assert any(finding.kind.effect == "blocks" for finding in fitted.findings)


@pytest.mark.long
@pytest.mark.parametrize("kind", SWITCHED_MANUALLY)
def test_of_constant_power_that_was_switched_only_what_it_shows_is_identified_and_the_verdict_is_blocked(kind, tmp_path):
    # power times gain is shown, not each of them: the power may be less than full, and the gain then more than fitted
    case = blind.make(kind, 7)
    fitted = _fitted(case, tmp_path)
    assert fitted.outcome is FitOutcome.COMBINATIONS_ONLY
    assert fitted.ci95["gain_degC_per_pct"] is None
    assert blind.outside(case, fitted) == []
    product = fitted.combinations["gain_per_time_constant_degC_per_s_pct"][1]
    total_lag = case.heater.lags[0] + sum(case.heater.lags[1:]) / 2.0  # the half rule (Skogestad 2003) for two lags
    assert product.low <= 1.02 * case.heater.gain / total_lag
    assert product.high is None
    dead = fitted.combinations["effective_dead_time_s"][1]
    assert dead.low <= case.heater.dead + sum(case.heater.lags[1:]) / 2.0 <= dead.high
    assert any(finding.kind.effect == "blocks" for finding in fitted.findings)


@pytest.mark.long
@pytest.mark.parametrize("kind", THERMOSTATS)
def test_what_is_said_of_a_thermostat_s_heater_is_true_and_the_verdict_is_blocked(kind, tmp_path):
    # two-level control is a law of its own: its switchings are fitted, and full power is an assumption until stated
    case = blind.make(kind, 7)
    fitted = _fitted(case, tmp_path)
    assert blind.outside(case, fitted) == []
    assert any(finding.name == "two-level" for finding in fitted.findings)


@pytest.mark.long
def test_a_loop_of_a_tried_law_is_not_taken_for_another(tmp_path):
    case = blind.make("PI", 1)
    fitted = _fitted(case, tmp_path)
    assert not {"not-regulated", "two-level", "on-bound"} & {finding.name for finding in fitted.findings}
    assert blind.outside(case, fitted) == []


def test_the_bench_s_logs_obey_the_heater_s_equation():
    # one lag: T' = (ambient + gain·power(t − dead time) − T)/lag, by differences between noisy readings on the average
    case = next(case for case in (blind.make("long pulse", seed) for seed in range(20)) if len(case.heater.lags) == 1)
    heater, (time, y, u) = case.heater, case.columns.values()
    cooling = np.flatnonzero((u == 0.0) & (time > time[np.argmax(y)] + heater.dead + heater.lags[0] / 10.0))
    first, last = y[cooling[0]] - heater.ambient, y[cooling[-1]] - heater.ambient
    fallen = np.exp(-(time[cooling[-1]] - time[cooling[0]]) / heater.lags[0])
    assert last / first == pytest.approx(fallen, abs=0.03)


@pytest.mark.long
def test_the_bench_prints_its_table_and_finds_nothing_wrong(capsys):
    assert blind.main(["--kinds", "pulse", "thermostat", "--count", "1", "--targets"]) == 0
    out = capsys.readouterr().out
    assert "not-regulated" in out
    assert "two-level" in out
