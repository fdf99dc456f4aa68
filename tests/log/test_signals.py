"""A log's signals, each with instants of its own, and the rows that are derived of them."""

import io
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from heatertune.chain.documents import load, log_document, to_dict
from heatertune.errors import DocumentError, OutOfRange
from heatertune.log import read_log
from heatertune.log.log_values import Log, LogSignal
from heatertune.model.fit import fit
from heatertune.model.power.regressors import Readings

#: instants between two readings at which the power changes, two of them within one interval
POWERS = [(0.5, 0.0), (31.3, 60.0), (33.1, 0.0), (33.7, 60.0), (151.2, 40.0)]


def _log():
    rows = [(float(t), f"{20 + 0.1 * max(0, t - 31):.1f}", "") for t in range(0, 200, 2)]
    rows += [(at, "", f"{power:g}") for at, power in POWERS]
    return read_log(io.StringIO("\n".join(["time_s,temp_C,power_pct", *(f"{t},{y},{u}" for t, y, u in sorted(rows))])))


def _plain(**more):
    time = np.arange(60.0)
    return Log(name="plain", source="here", time_s=time, temperature_degC=20.0 + np.sqrt(time),
               power_pct=np.where(time < 10.0, 0.0, 50.0), **more)


def test_each_signal_keeps_its_instants_and_no_reading_is_made_up():
    log = _log()
    assert [*zip(*log.signals["power"].changes, strict=True)][1:] == POWERS[1:]
    assert set(log.time_s) == set(np.arange(2.0, 200.0, 2.0))  # from the first known power on
    assert log.power_pct[log.time_s == 32.0] == 60.0  # the row sees what is held there
    assert log.power_pct[log.time_s == 34.0] == 60.0  # and nothing of the pulse before
    readings = Readings.of(log)
    assert readings.edge_s.tolist()[1:] == [at for at, _ in POWERS[1:]]
    assert len(readings.time_s) == len(log.time_s)


def test_one_clock_has_a_row_at_each_instant_and_a_plain_log_is_its_own():
    log = _log()
    rows = log.on_one_clock()
    assert rows.time_s.tolist() == sorted({*log.time_s, *(at for at, _ in POWERS[1:])})
    assert rows.power_pct[np.isin(rows.time_s, [33.1, 33.7])].tolist() == [0.0, 60.0]
    plain = _plain()
    assert plain.on_one_clock() is plain


def test_a_window_begins_with_what_is_held_there():
    part = _log().window(40.0, 160.0)
    assert [*map(list, part.signals["power"].changes)] == [[40.0, 151.2], [60.0, 40.0]]
    assert (part.time_s[0], part.time_s[-1]) == (40.0, 160.0)


def test_a_window_without_readings_is_refused_and_a_log_goes_to_a_worker():
    log = _log()
    with pytest.raises(OutOfRange, match="number of readings"):
        log.window(1e6, 2e6)
    again = pickle.loads(pickle.dumps(log))
    assert [*map(list, again.signals["power"].changes)] == [*map(list, log.signals["power"].changes)]
    assert again.on_one_clock().time_s.tolist() == log.on_one_clock().time_s.tolist()
    plain = pickle.loads(pickle.dumps(_plain()))
    assert plain.on_one_clock() is plain


def test_rows_take_the_place_of_a_signal_and_a_signal_stays_where_only_readings_change():
    log = _log()
    assert log.with_rows(power_pct=np.full(len(log.time_s), 5.0)).signals["power"].changes[1].tolist() == [5.0]
    assert log.with_rows(power_pct=None).power_pct is None
    thin = log.with_rows(time_s=log.time_s[::3], temperature_degC=log.temperature_degC[::3])
    assert thin.signals["power"].changes[0].tolist() == log.signals["power"].changes[0].tolist()
    assert replace(log, name="other").signals["power"].changes[0].tolist() == log.signals["power"].changes[0].tolist()
    with pytest.raises(TypeError, match="power_percent"):
        log.with_rows(power_percent=None)


@pytest.mark.parametrize(("time", "values", "problem"), [
    ([0.0, 0.0], [1.0, 2.0], "increasing"), ([0.0, 1.0], [1.0], "shape"), ([0.0, 1.0], [1.0, 101.0], "power_pct"),
    ([0.0, np.nan], [1.0, 2.0], "finite")])
def test_a_signal_with_impossible_instants_or_values_is_refused(time, values, problem):
    plain = _plain()
    signal = LogSignal(np.array(values), time_s=np.array(time))
    with pytest.raises(OutOfRange, match=problem):
        replace(plain, signals=dict(plain.signals) | {"power": signal})


def test_the_integral_is_that_of_what_is_held():
    power = _log().signals["power"]
    # 1.8 s and 117.5 s of 60 %, then 40 %: summed by hand
    assert power.integral(np.array([33.1, 151.2, 161.2])).tolist() == pytest.approx([108.0, 108.0 + 7050.0, 7558.0])


def test_a_document_gives_back_the_instants_and_one_of_a_plain_log_has_none(tmp_path):
    log, path = _log(), tmp_path / "log.json"
    path.write_text(json.dumps(to_dict(log)), encoding="utf-8")
    again = load(path)
    assert [*map(list, again.signals["power"].changes)] == [*map(list, log.signals["power"].changes)]
    assert fit(again).model == fit(log).model
    assert "signals" in log_document(log)
    assert not {"signals"} & (to_dict(_plain()).keys() | log_document(_plain()).keys())
    path.write_text(json.dumps(to_dict(log) | {"signals": {"pressure": [[0.0], [1.0]]}}), encoding="utf-8")
    with pytest.raises(DocumentError, match="pressure"):
        load(path)
