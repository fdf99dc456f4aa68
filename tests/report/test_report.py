import json
from dataclasses import replace

import numpy as np
import pytest

from heatertune import chain
from heatertune.chain.documents import without_curves
from heatertune.codec import plain
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Ramp
from heatertune.proof.report_curves import pictures
from heatertune.proof.verdict import verdict_first
from heatertune.proof.words_file import export_first
from heatertune.report import plots
from heatertune.report.layout import table
from heatertune.report.plots import LOOK, to_svg
from heatertune.report.report_text import criteria_table, criterion_value, design_lines, ramp_note

LABELS = {"temperature [°C]", "residual [°C]", "requested power [%]", "difference [°C]", "heater [%]", "Re L [1]",
          "|S| [1]"}


@pytest.fixture(scope="module")
def shown():
    fitted = model_by_hand(Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0))
    from heatertune.pid.tune import tune  # noqa: PLC0415 - the chain's tune would use the user's cache

    wished = tune(fitted, sample_time_s=5.0)
    proof = chain.prove(chain.encode(wished, "s5-ob251"), fitted, setpoint_degC=40.0)
    return plain(pictures(wished, fitted, proof)), proof


def test_the_loop_is_drawn_from_the_numbers_of_the_trace(shown):
    series, proof = shown
    top, low = plots.plot_loop(series["nominal"], series["worst"], series["others"]).axes
    drawn = next(line for line in top.lines if line.get_label() == "nominal")
    at = np.asarray(drawn.get_xdata())
    assert np.asarray(drawn.get_ydata()) == pytest.approx(proof.nominal.temperature_at(at), abs=5e-3)
    assert (top.get_ylabel(), low.get_ylabel()) == ("temperature [°C]", "requested power [%]")


def test_wished_and_realised_are_drawn_with_their_difference(shown):
    series, _ = shown
    _, low = plots.plot_wish(series["nominal"], series["ideal"]).axes
    expected = np.array(series["nominal"]["temperature_degC"]) - np.array(series["ideal"]["temperature_degC"])
    assert low.lines[0].get_ydata() == pytest.approx(expected, abs=1e-9)


def test_the_sensitivity_is_drawn_below_its_limit(shown):
    series, proof = shown
    left, right = plots.plot_robustness(series["curves"], series["ms_limit"]).axes
    peak = max(float(np.max(line.get_ydata())) for line in right.lines if len(line.get_xdata()) > 2)
    ms = next(c.value for c in proof.criteria if c.name == "ms")
    assert peak == pytest.approx(ms, rel=0.01)
    assert left.patches[0].radius == pytest.approx(1.0 / series["ms_limit"])


def test_every_axis_has_its_unit(shown):
    series, _ = shown
    figures = [
        plots.plot_loop(series["nominal"], series["worst"], series["others"]),
        plots.plot_wish(series["nominal"], series["ideal"]), plots.plot_robustness(series["curves"], 2.0),
        plots.plot_pwm(series["nominal"], 1600.0, 1700.0),
    ]
    for figure in figures:
        assert {ax.get_ylabel() for ax in figure.axes} <= LABELS | {"Im L [1]"}
        assert figure.axes[-1].get_xlabel() in ("time [s]", "frequency [rad/s]")


def test_the_pwm_picture_shows_each_edge_of_its_stretch(shown):
    series, proof = shown
    jump = proof.scenario.disturbances[0].time_s
    (ax,) = plots.plot_pwm(series["nominal"], jump - 20.0, jump + 80.0).axes
    edges = [t for t in proof.nominal.edge_time_s if jump - 20.0 <= t <= jump + 80.0]
    assert list(ax.lines[0].get_xdata())[1:-1] == pytest.approx(edges, abs=1e-3)


def test_the_same_figure_is_the_same_text(shown):
    series, _ = shown
    assert len({to_svg(plots.plot_pwm(series["nominal"], 1600.0, 1700.0)) for _ in range(2)}) == 1


#: what stands side by side in some picture
PAIRS = [("log", "model"), ("ideal", "realised"), ("realised", "worst"), ("worst", "other"), ("realised", "other"),
         ("log", "worst"), ("log", "realised")]
#: G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, IEEE Trans. Vis. Comput. Graph. 15(6), 2009, severity 1.0
BLIND = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}


def _lab(colour, seen_as):
    """CIE L*a*b* (D65) of a colour as an eye sees it; IEC 61966-2-1 for sRGB, CIE 15 for L*a*b*."""
    coded = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.array(seen_as) @ linear, 0.0, 1.0)
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ linear
    f = np.array([v ** (1 / 3) if v > 216 / 24389 else (24389 / 27 * v + 16) / 116
                  for v in xyz / np.array([0.9505, 1.0, 1.089])])
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("eye", [*BLIND, "normal"])
def test_lines_that_stand_side_by_side_are_told_apart_by_every_eye(eye):
    seen_as = BLIND.get(eye, np.eye(3))
    for one, two in PAIRS:
        apart = np.linalg.norm(_lab(LOOK[one]["color"], seen_as) - _lab(LOOK[two]["color"], seen_as))
        assert apart > 20.0, (eye, one, two, apart)  # 2.3 is just noticeable (CIE 1976)


def test_lines_that_stand_side_by_side_differ_when_printed_grey():
    for one, two in PAIRS:
        lightness = [_lab(LOOK[name]["color"], np.eye(3))[0] for name in (one, two)]
        dashes = [LOOK[name].get("linestyle") for name in (one, two)]
        assert abs(lightness[0] - lightness[1]) > 12.0 or dashes[0] != dashes[1], (one, two, lightness)


def test_tables_are_aligned_and_tell_what_never_happened():
    assert table([("a", "1"), ("bb", "22")], right=(1,)) == "a    1\nbb  22"
    assert criterion_value({"value": None, "ok": False}) == "never"
    assert criterion_value({"value": None, "ok": True}) == "unlimited"


FIRST = ["verdict", "relaxed_limits", "target", "setpoint_degC", "specification", "words", "criteria"]


def _curves(document):
    """Every list of more than a hundred numbers, by its path."""
    if isinstance(document, dict):
        return [f"{name}.{path}" for name, part in document.items() for path in _curves(part)]
    if isinstance(document, list | tuple):
        return ["[]"] if len(document) > 100 else [path for part in document for path in _curves(part)]
    return []


def test_programs_get_first_what_is_asked_first_and_no_curves(documents):
    design = without_curves(documents, ["heatertune", "design"])
    assert list(design)[:8] == [*FIRST, "files"]
    assert design["words"] == documents["words"]["words"]
    assert design["files"] == documents["words"]["files"]
    assert (_curves(plain(design)), bool(_curves(plain(dict(documents))))) == ([], True)
    assert list(verdict_first(documents["proof"]))[:7] == FIRST
    exported = export_first(documents["words"], documents["proof"])
    assert list(exported)[:8] == [*FIRST, "files"]
    assert set(documents["words"]) < set(exported)


def test_the_criteria_table_names_what_fails(shown):
    _, proof = shown
    document = json.loads(json.dumps(plain(proof.to_document())))
    document["criteria"]["ms"] |= {"ok": False, "value": 3.0}
    line = next(line for line in criteria_table(document).splitlines() if line.startswith("ms"))
    assert "FAIL" in line


def test_a_design_without_integral_action_says_none():
    document = {"gain_pct_per_degC": 2.0, "integral_time_s": None, "derivative_time_s": 0.0, "sample_time_s": 5.0,
                "structure": "p", "method": "by hand"}
    assert "TN  none" in design_lines(document)


def test_a_ramp_is_drawn_as_it_was_followed(shown):
    _, proof = shown
    words = replace(proof.words, ramp=Ramp(step=9, calls=2))
    fitted = model_by_hand(replace(proof.nominal.model, dead_time_s=12.0))
    ramped = chain.prove(words, fitted, setpoint_degC=40.0)
    series = plain(pictures(proof.design, fitted, ramped))
    top = plots.plot_loop(series["nominal"], series["worst"], series["others"]).axes[0]
    drawn = next(line for line in top.lines if line.get_label() == "setpoint on its ramp")
    scans = np.searchsorted(ramped.nominal.time_s, np.asarray(drawn.get_xdata()) - 1e-3)
    assert drawn.get_ydata() == pytest.approx(ramped.nominal.followed_degC[scans], abs=1e-3)
    left_out = np.setdiff1d(np.arange(len(ramped.nominal.time_s)), scans)
    assert np.all(np.diff(ramped.nominal.followed_degC)[left_out - 1] == 0.0), "only what does not move it"
    assert drawn.get_drawstyle() == "steps-post"


def test_a_ramp_is_told_with_its_rate():
    ramp = {"step": 9, "calls": 2, "degC_per_min": 2.6377}
    assert ramp_note({"setpoint_ramp": ramp})[0].startswith("The setpoint moves by 9 units every 2 calls, 2.64 °C/min. The exported files")
    assert ramp_note({"setpoint_ramp": ramp | {"calls": 1}})[0].startswith("The setpoint moves by 9 units every call,")
    held = "and stays within 2 °C of the temperature while it ramps. After a start-up it begins at the temperature"
    assert held in ramp_note({"setpoint_ramp": ramp | {"hold_degC": 2.0}})[0]
    assert ramp_note({"setpoint_ramp": None}) == ramp_note({}) == []


def test_every_hypothesis_and_what_it_is_worth_stands_in_the_page_where_the_power_was_not_logged():
    from heatertune.report.page import _checks, _hypotheses  # noqa: PLC0415 - parts of the page, beside their only use

    names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")
    one = {"law": "positional <P>", "gain_degC_per_pct": 0.4, "time_constant_s": 166.0, "dead_time_s": 14.4,
           "ambient_degC": 24.0, "fits_pct": {}, "fit_pct": 93.5, "delta_bic": 0.0, "rmse_degC": 0.31,
           "hold_out_rmse_degC": 0.7, "cross_rmse_degC": None, "on_bound": ["dead_time_s"]}
    two = one | {"law": "PI", "second_time_constant_s": 20.0, "delta_bic": 112.0}
    model = {"hypotheses": [one, two]} | dict.fromkeys(names, 1.0) | {"time_constant_s_ci95": [145.0, 208.0]}
    page = _hypotheses(model)
    assert "2 compared" in page
    assert "Known within the intervals above: time constant." in page
    for cell in ("positional &lt;P&gt;", "166 + 20", "93.5", "112", "0.31", "0.7", "dead_time_s", "foretold"):
        assert cell in page, cell
    assert "No parameter is identified" in _hypotheses(model | {"time_constant_s_ci95": None})
    assert _hypotheses({}) == _checks({}) == ""
    checked = _checks({"fit_pct": 96.6, "held_out": {"fit_pct": 94.3}, "whiteness": {
        "ljung_box": 4766.0, "limit": 31.41, "ok": False}, "input_crosscorrelation": {
        "largest": 0.1, "at_lag_s": 12.0, "limit": 0.17, "ok": True}})
    for cell in ("94.3", "4766", "not by chance", "12 s before", ">ok<"):
        assert cell in checked, cell
