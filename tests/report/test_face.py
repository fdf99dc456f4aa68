"""What values say and draw of themselves: numbers against the values, pictures against what matplotlib holds."""

import io
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest

import heatertune as ht
from heatertune import errors as ht_errors

mpl.use("Agg")
plt = pytest.importorskip("matplotlib.pyplot")

HEATER = ht.Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def chain():
    model = ht.model_by_hand(HEATER)
    design = ht.tune(model, target="s5-ob251")
    words = ht.encode(design, target="s5-ob251")
    return model, design, words, ht.prove(words, model, setpoint_degC=40.0)


@pytest.fixture
def log():
    time = np.arange(0.0, 400.0, 4.0)
    power = np.where(time >= 40.0, 60.0, 0.0)
    return ht.Log(name="own", source="a test", time_s=time, power_pct=power,
                  temperature_degC=HEATER.predict(time, power))


def test_the_package_shows_its_names_and_nothing_of_the_rest():
    assert dir(ht) == sorted(ht.__all__)
    assert all(getattr(ht, name) is not None for name in ht.__all__)


def test_every_value_sums_itself_up(chain, log):
    model, design, words, proof = chain
    assert "100 in 396 s" in log.summary()
    assert "0.37" in model.summary()
    assert "TN" in design.summary()
    assert f"{words.values['K']:g}" in words.summary()
    assert proof.summary().startswith(proof.verdict)
    assert "s5-ob251 at 40 °C" in proof.nominal.summary()


def test_words_of_a_program_with_faults_tell_them(chain):
    # the fault that the paper's own figures show, see DIFFERENCES.md of s7-200-paper
    summary = ht.encode(chain[1], target="s7-200-paper").summary()
    assert "! the P part is added to the pulse width in every PWM cycle, so it integrates" in summary


def test_a_value_draws_into_the_axes_it_is_given(chain, log):
    _, design, words, proof = chain
    _, ax = plt.subplots()
    assert log.plot(ax) is ax
    assert ax.lines[0].get_ydata()[-1] == log.temperature_degC[-1]
    for value in (design, words, proof, proof.worst):
        before = len(ax.lines)
        assert value.plot(ax) is ax
        assert len(ax.lines) > before


def test_without_axes_a_figure_of_its_own_has_the_power_below(log, chain):
    ax = log.plot()
    below = ax.figure.axes[1]
    assert (ax.get_ylabel(), below.get_ylabel()) == ("temperature [°C]", "power [%]")
    assert below.lines[0].get_ydata().max() == 60.0
    with pytest.raises(ValueError, match="by hand"):
        chain[0].plot()


def test_a_table_of_pandas_goes_in_and_comes_out(log):
    pandas = pytest.importorskip("pandas")
    frame = log.to_frame()
    assert list(frame.columns) == ["time_s", "temperature_degC", "power_pct"]
    again = ht.Log.from_frame(frame)
    assert np.array_equal(again.temperature_degC, log.temperature_degC)
    assert again.setpoint_degC is None
    stamped = frame.set_index(pandas.Timestamp("2026-01-01") + pandas.to_timedelta(frame.pop("time_s"), unit="s"))
    named = stamped.rename(columns={"temperature_degC": "PV", "power_pct": "OP"})
    assert np.array_equal(ht.Log.from_frame(named, temperature="PV", power="OP").time_s, log.time_s)
    with pytest.raises(ValueError, match="no column 'CV'; there are PV, OP"):
        ht.Log.from_frame(named, temperature="PV", power="CV")


def test_a_log_is_read_from_a_table_and_from_an_open_file(log):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"time_s": log.time_s, "temp_F": 32.0 + 1.8 * log.temperature_degC, "duty_pct": log.power_pct})
    assert ht.read_log(frame).temperature_degC == pytest.approx(log.temperature_degC)
    for file in (io.StringIO(frame.to_csv(index=False)), io.BytesIO(frame.to_csv(index=False).encode())):
        assert ht.read_log(file).power_pct == pytest.approx(log.power_pct)


@pytest.mark.long
def test_a_heater_is_fitted_from_whatever_is_at_hand(log, tmp_path):
    pandas = pytest.importorskip("pandas")
    noise = np.random.default_rng(1).normal(0.0, 0.05, len(log.time_s))
    time, power = log.time_s, log.power_pct
    frame = pandas.DataFrame({"time_s": time, "temperature_degC": log.temperature_degC + noise, "power_pct": power})
    text = frame.to_csv(index=False)
    (tmp_path / "log.csv").write_text(text)
    columns = tuple(frame[name].to_numpy() for name in frame)
    for data in (ht.Log.from_frame(frame), tmp_path / "log.csv", str(tmp_path / "log.csv"), frame, io.StringIO(text),
                 columns, tuple(map(list, columns))):
        assert ht.fit(data).model.gain_degC_per_pct == pytest.approx(0.37, abs=0.05)


@pytest.mark.parametrize(("data", "told"), [
    (7, "not a log: int; expected a log, a path, an open file"),
    ((np.arange(30.0),), "not a log: tuple"),
    ((np.arange(30.0), ["warm"] * 30), "temperature_degC: not an array of numbers"),
    ((np.arange(30.0), None), r"temperature_degC: .* \(\)"),
    ((np.arange(30.0), np.ones((30, 2))), r"shape \(30, 2\)"),
    ((np.arange(30.0), np.arange(29.0), None), "of shape"),
])
def test_what_is_no_log_is_refused_in_one_line(data, told):
    with pytest.raises(ht_errors.InputError, match=told) as refused:
        ht.fit(data)
    assert "\n" not in str(refused.value)


def test_the_loop_is_simulated_for_words_and_whatever_heater(chain):
    model, _, words, proof = chain
    trace = ht.simulate(words, HEATER, proof.scenario, proof.nominal.actuator)
    assert np.array_equal(trace.temperature_degC, proof.nominal.temperature_degC)
    assert np.array_equal(ht.simulate(words, model, 40.0).temperature_degC, trace.temperature_degC)
    c, first = ht.controller(words), trace.time_s < proof.scenario.disturbances[0].time_s
    assert [c(reading, 40.0) for reading in trace.reading_degC[first] + 1e-6] == trace.power_asked_pct[first].tolist()


def test_margins_are_those_of_a_design_and_of_the_words_that_run_it(chain):
    model, design, words, proof = chain
    ms = ht.margins(HEATER, words).ms
    late = replace(HEATER, dead_time_s=HEATER.dead_time_s + 0.48)  # analog input 460
    assert ht.margins(late, words).ms == pytest.approx(next(each.value for each in proof.criteria if each.name == "ms"))
    assert ht.margins(model, words) == ht.margins(HEATER, proof.design)
    assert ht.decode(words) == proof.design
    # after a load the integral of the error is TN / K of the load, as long as it does not change sign
    assert ht.iae_load(model, design) >= design.integral_time_s / design.gain_pct_per_degC * (1.0 - 1e-6)
    assert ht.iae_load(model, words) == ht.iae_load(HEATER, proof.design)
    assert ht.margins(HEATER, design).ms == pytest.approx(ms, abs=0.05)
    with pytest.raises(ht_errors.InputError, match="of on-off are no PID constants"):
        ht.margins(HEATER, ht.encode(design, target="on-off"))
