"""A unit without evidence, or one that the fit contradicts, keeps a verdict from PASS until the user states or accepts it."""

import io

import numpy as np
import pytest

from heatertune.chain import stages
from heatertune.log import read_log
from heatertune.model.diagnostics import unit_change_findings
from heatertune.model.fit import fit, fit_together

GAIN, TIME_CONSTANT, DEAD_TIME, AMBIENT = 0.6, 60.0, 4, 22.0


def heater_rows(head, time=1.0, temperature=1.0, power=1.0, offset=0.0):
    """Rows of a known heater, one a second, each column multiplied as another unit would."""
    y, rows = AMBIENT, [head]
    u = [0.0 if k < 20 else 50.0 if k < 300 else 20.0 for k in range(520)]
    noise = np.random.default_rng(4).normal(0.0, 0.05, len(u))
    for k, power_pct in enumerate(u):
        rows.append(f"{k * time:.6f},{(y + noise[k]) * temperature + offset:.4f},{power_pct * power:.4f}")
        y += (AMBIENT + GAIN * u[max(0, k - DEAD_TIME)] - y) / TIME_CONSTANT
    return "\n".join(rows) + "\n"


def read(text, **options):
    return read_log(io.StringIO(text), **options)


def findings_of(fitted):
    return {finding.name: finding.message for finding in fitted.findings}


def test_every_unit_without_evidence_stands_in_one_finding_with_the_options_that_state_them():
    fitted = fit(read(heater_rows("Time,T,Heater", time=1 / 60, temperature=10.0, power=1.9)))
    told = findings_of(fitted)["unit-assumed"]
    for part in ("the time ('Time', s, assumed)", "the temperature ('T', °C, assumed)", "the power ('Heater', 0…100 %, assumed)",
                 "an ambient of 220 °C is no room's", "--time-unit min --temperature-unit 0.1degC --power-full-scale 100"):
        assert part in told


@pytest.mark.parametrize(("head", "scales", "options"), [
    ("Time,Temperature,Heater", {"time": 1 / 60}, {"time_unit": "min", "power_full_scale": 100}),
    ("millis,Temperature,PWM", {"time": 1000.0, "power": 2.55 * 0.6}, {"power_full_scale": 153.0}),
    ("time_s,Temperature,Power", {"power": 1.9}, {"power_full_scale": 190.0}),
    ("Timestamp,Temperature,Heater", {"time": 1000.0}, {"time_unit": "ms", "power_full_scale": 100.0}),
    ("time_s,Temperature,Heater", {"temperature": 10.0}, {"temperature_unit": "0.1degC", "power_full_scale": 100.0}),
    ("time_s,Temperature,Heater", {"temperature": 1.8, "offset": 32.0}, {"temperature_unit": "degF", "power_full_scale": 100.0}),
])
def test_the_true_units_give_the_true_heater_and_no_finding(head, scales, options):
    text = heater_rows(head, **scales)
    assert "unit-assumed" in findings_of(fit(read(text)))
    fitted = fit(read(text, **options))
    assert "unit-assumed" not in findings_of(fitted)
    assert fitted.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.03)
    assert fitted.model.time_constant_s == pytest.approx(TIME_CONSTANT, rel=0.05)
    assert fitted.model.dead_time_s == pytest.approx(DEAD_TIME, abs=1.0)
    assert fitted.model.ambient_degC == pytest.approx(AMBIENT, abs=0.2)


@pytest.mark.parametrize(("scales", "part"), [
    ({"temperature": 10.0}, "an ambient of 220 °C is no room's: 22 °C if the readings are in tenths of a degree"),
    ({"temperature": 1.8, "offset": 32.0}, "an ambient of 71.6 °C is no room's: 22 °C if the readings are in °F"), ({"time": 1 / 3600}, "is hardly a heater's"),
    ({"time": 5000.0}, "h is hardly a heater's"), ({"temperature": 2.0, "power": 0.022}, "full power would heat by 5"),
])
def test_a_fit_that_contradicts_a_name_asks_for_the_unit_until_it_is_stated(scales, part):
    text = heater_rows("time_s,temp_C,power_pct", **scales)
    assert part in findings_of(fit(read(text)))["unit-assumed"]
    stated = {"time_unit": "s", "temperature_unit": "degC", "power_full_scale": 100.0}
    assert "unit-assumed" not in findings_of(fit(read(text, **stated)))


@pytest.mark.parametrize(("scales", "stated", "part"), [
    ({"power": 0.01}, {"power_full_scale": 100.0}, "full power would heat by 6"),  # 100 times the gain, 6000 °C
    ({"temperature": 10.0}, {"temperature_unit": "degC"}, "an ambient of 220 °C is no room's: 22 °C if the readings are in tenths of a degree"),
    ({"offset": 273.15}, {"temperature_unit": "degC"}, "an ambient of 295 °C is no room's"),
])
def test_a_stated_unit_that_no_heater_can_have_blocks_until_another_is_stated(scales, stated, part):
    """The heater is known: 60 °C at full power, in a room of 22 °C."""
    text = heater_rows("Time,Temperature,Heater", **scales)
    fitted = fit(read(text, **{"time_unit": "s", "power_full_scale": 100.0, **stated}))
    found = findings_of(fitted)
    assert part in found["unit-contradicted"]
    assert any(part in f"{note[0].lower()}{note[1:]}" for note in fitted.notes)
    assert all(f"--{name.replace('_', '-')} " in found["unit-contradicted"] for name in stated)
    right = {"power": {"power_full_scale": 1.0}, "temperature": {"temperature_unit": "0.1degC"}, "offset": {"temperature_unit": "K"}}[next(iter(scales))]
    assert "unit-contradicted" not in findings_of(fit(read(text, **{"time_unit": "s", "power_full_scale": 100.0, **right})))


@pytest.mark.parametrize("stated", [{"temperature_unit": "degC"}, {"time_unit": "s"}, {"power_full_scale": 100.0}])
def test_a_stated_unit_of_a_rare_heater_is_not_questioned(stated):
    """A heater in a machine at 72 °C, or with a time constant of 83 h: rare, but possible."""
    text = heater_rows("time_s,temp_C,power_pct", offset=50.0, time=5000.0 if "time_unit" in stated else 1.0)
    assert "unit-contradicted" not in findings_of(fit(read(text, **stated)))


def test_a_fit_kept_from_before_the_unit_was_stated_is_not_taken_again(monkeypatch, tmp_path):
    # the same numbers either way: what the message asks for must not end at the file of the cache
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path))
    text = heater_rows("time_s,temp_C,power_pct", time=5000.0)
    assert "unit-assumed" in findings_of(stages.fit(read(text)))
    assert list(tmp_path.rglob("*fit*"))
    assert "unit-assumed" not in findings_of(stages.fit(read(text, time_unit="s")))
    unnamed = heater_rows("Time,temp_C,power_pct")
    assert "unit-assumed" in findings_of(stages.fit(read(unnamed)))
    assert "unit-assumed" not in findings_of(stages.fit(read(unnamed, time_unit="s")))


def test_a_heater_as_heaters_are_is_not_asked_about():
    assert "unit-assumed" not in findings_of(fit(read(heater_rows("time_s,temp_C,power_pct"))))


def test_logs_fitted_together_are_asked_about_one_by_one():
    good, other = (read(heater_rows(head)) for head in ("time_s,temp_C,power_pct", "Time,temp_C,power_pct"))
    object.__setattr__(other, "name", "other")
    told = [finding for finding in fit_together([good, other]).findings if finding.name == "unit-assumed"]
    assert len(told) == 1
    assert "the time ('Time'" in told[0].message


def test_an_ambient_that_the_log_never_comes_near_is_not_asked_about():
    # a chamber at 300 °C in a loop of its own: what the model calls its ambient is an extrapolation
    y, rows = 270.0, ["time_s,temp_C,power_pct"]
    u = [60.0 if (k // 60) % 2 else 40.0 for k in range(520)]
    for k in range(520):
        rows.append(f"{k},{y:.2f},{u[k]:g}")
        y += (240.0 + GAIN * u[max(0, k - DEAD_TIME)] - y) / TIME_CONSTANT
    fitted = fit(read("\n".join(rows[:1] + rows[101:])))
    assert fitted.model.ambient_degC == pytest.approx(240.0, abs=3.0)
    assert "unit-assumed" not in findings_of(fitted)


@pytest.mark.parametrize(("other", "both"), [(lambda degC: 1.8 * degC + 32.0, True), (lambda degC: degC + 273.15, False)], ids=["°F", "K"])
@pytest.mark.parametrize("first", [True, False], ids=["before", "after"])
@pytest.mark.parametrize("row", [60, 250, 400])
def test_a_temperature_that_goes_on_in_another_unit_is_asked_about(other, both, first, row):
    lines = [line.split(",") for line in heater_rows("time_s,temp_C,power_pct").split()]
    for line in lines[1:row + 1] if first else lines[row + 1:]:
        line[1] = f"{other(float(line[1])):.4f}"
    log = read("\n".join(",".join(line) for line in lines), power_full_scale=100.0)
    message = next(finding.message for finding in unit_change_findings([log]))
    until, begin = f": --until {row - 1}", f" --from {row}"
    assert message.endswith(f"{until} or{begin}" if both else f":{begin}" if first else until), "no part in K can be read beside °C"
    assert unit_change_findings([log.window(0.0, row - 1.0), log.window(float(row), 519.0)]) == ()


@pytest.mark.parametrize(("other", "unit", "part"), [
    (lambda degC: 1.8 * degC + 32.0, "degF", {"until_s": 99.0}), (lambda degC: 1.8 * degC + 32.0, None, {"from_s": 100.0}),
    (lambda degC: degC + 273.15, None, {"from_s": 100.0})], ids=["°F", "after °F", "after K"])
def test_a_part_in_one_unit_is_the_true_heater(other, unit, part):
    lines = [line.split(",") for line in heater_rows("time_s,temp_C,power_pct").split()]
    for line in lines[1:101]:
        line[1] = f"{other(float(line[1])):.4f}"
    log = read("\n".join(",".join(line) for line in lines), power_full_scale=100.0, temperature_unit=unit or "degC")
    fitted = fit(log, **part)
    assert "unit-assumed" not in findings_of(fitted)
    assert fitted.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.03)


@pytest.mark.parametrize("drop_degC", [3.0, 8.0, 12.0, 25.0])
def test_cold_goods_are_no_other_unit(drop_degC):
    lines = [line.split(",") for line in heater_rows("time_s,temp_C,power_pct").split()]
    for line in lines[270:]:
        line[1] = f"{float(line[1]) - drop_degC:.4f}"
    assert unit_change_findings([read("\n".join(",".join(line) for line in lines), power_full_scale=100.0)]) == ()
