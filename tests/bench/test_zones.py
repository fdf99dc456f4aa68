"""The zones that are timed are heaters, and the growth that is told is the growth."""

import sys

import numpy as np
import pytest

from heatertune.chain.stages import fit
from heatertune.log import read_log
from tests.bench import zones


def test_a_zone_s_log_is_its_heater_s_and_no_other_s():
    text = zones.log_text(3)
    assert text == zones.log_text(3) != zones.log_text(4)
    log = read_log("zone.csv", content=text.encode())
    assert (len(log.time_s), log.power_pct[0], len(np.unique(log.power_pct))) == (240, 0.0, 3)
    # at rest a heater stands at ambient + gain·power; after 135 rows, over three time constants, 95 % of the way
    gain, lag, dead, ambient = zones.heater(3)
    for row, share in ((14, 0.0), (149, 1.0 - np.exp(-(134 * 11.0 - dead) / lag))):
        wanted = ambient + gain * log.power_pct[row] * share
        assert log.temperature_degC[row] == pytest.approx(wanted, abs=0.25)


@pytest.mark.long
def test_the_fit_finds_the_heater_that_made_the_log(monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", "")
    for seed in (0, 1):
        found = fit(read_log("zone.csv", content=zones.log_text(seed).encode()))
        names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")
        told = dict(zip(names, zones.heater(seed), strict=True))
        assert found.model.gain_degC_per_pct == pytest.approx(told["gain_degC_per_pct"], rel=0.02)
        assert found.model.time_constant_s == pytest.approx(told["time_constant_s"], rel=0.05)
        assert found.model.dead_time_s == pytest.approx(told["dead_time_s"], abs=4.0)
        assert found.model.ambient_degC == pytest.approx(told["ambient_degC"], abs=0.2)


def test_growth_is_told_as_what_each_further_zone_costs(monkeypatch, capsys):
    # 10 s to start and 0.2 s a zone, 0.5 s of processor time
    monkeypatch.setattr(zones, "run", lambda _, many, *__: (10.0 + 0.2 * many, 0.5 * many, {"PASS": many}))
    monkeypatch.setattr(sys, "argv", ["zones.py", "10", "50", "--jobs", "2"])
    zones.main()
    out = capsys.readouterr().out
    assert "from 10 to 50 zones, each further one: 0.200 s, 0.500 CPU s" in out
    assert "50 PASS" in out
    assert "10    12.0       1.200           0.500" in out


def test_logs_without_rows_leave_what_is_neither_heater_nor_proof(tmp_path):
    zones.write_logs(tmp_path / "logs", 3, empty=True)
    assert [path.read_text(encoding="utf-8") for path in sorted((tmp_path / "logs").iterdir())] == ["", "", ""]
    assert zones.settings_of(["10000", "--dask", "--empty"]).empty
    assert not zones.settings_of(["10", "--samples", "0"]).empty
