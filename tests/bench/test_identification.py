import numpy as np
import pytest

from tests.bench import identification


@pytest.mark.long
def test_the_benchmark_runs_and_the_fit_beats_both_scripts(capsys):
    identification.main(["--heaters", "4"])  # a step, a doublet, random levels and a pulse
    out = capsys.readouterr().out
    assert "4 heaters, 0 refused" in out
    rows = {line.split("|")[1].strip(): line.split("|") for line in out.splitlines() if line.startswith("| ")}
    against = [float(v) for v in rows["curve_fit + odeint"][5].split(",")]
    assert all(ratio > 1.0 for ratio in against)
    assert rows["two points"][2].strip() == "1"  # it knows steps only


def test_the_benchmark_s_own_logs_obey_the_heater_s_equation():
    # T' = (ambient + gain·power(t − dead time) − T)/time constant, checked by differences between readings
    case = identification.make(2)
    plant, time, power = case.plant, case.log.time_s, case.log.power_pct
    fine = np.linspace(time[0], time[-1], 20_001)
    held = power[np.searchsorted(time, fine, side="right") - 1]
    y = identification.answer(plant, fine, held, 25.0)
    middle = 0.5 * (fine[1:] + fine[:-1])
    acting = power[np.clip(np.searchsorted(time, middle - plant.dead_time_s, side="right") - 1, 0, None)]
    slope = (plant.ambient_degC + plant.gain_degC_per_pct * acting - 0.5 * (y[1:] + y[:-1])) / plant.time_constant_s
    off = np.abs(np.diff(y) / np.diff(fine) - slope)
    assert np.quantile(off, 0.99) < 1e-4 * np.abs(slope).max()
    assert y[0] == 25.0
