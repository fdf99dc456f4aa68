from dataclasses import replace

import numpy as np
import pytest

from heatertune.chain import compare, prove
from heatertune.codec import plain
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import TARGETS
from heatertune.plc.design import encode
from heatertune.proof import comparison
from heatertune.report.controller_comparison import plot_targets, render_targets, targets_table
from heatertune.settings import Conditions

HEATER = model_by_hand(Fopdt(gain_degC_per_pct=0.4, time_constant_s=150.0, dead_time_s=10.0, ambient_degC=20.0))


def _design(tn=150.0):
    return PidDesign(gain_pct_per_degC=5.0, integral_time_s=tn, derivative_time_s=0.0, sample_time_s=5.0,
                     structure=structure_of(tn, 0.0), method="")


@pytest.fixture(scope="module")
def document():
    return plain(compare(_design(), HEATER, Conditions(setpoint_degC=40.0)))


@pytest.mark.long(seconds=20)
def test_every_target_has_a_row_with_the_figures_of_its_own_proof(document):
    assert [row["target"] for row in document["rows"]] == list(TARGETS)
    # Klipper's report comes each 0.3 s, Marlin's PID each 0.16 s: a design of 5 s is taken at these
    own = {row["target"]: row["sample_time_s"] for row in document["rows"] if "sample_time_s" in row}
    assert own == {"klipper": 0.3, "marlin": 0.16}
    for row in document["rows"]:
        design = replace(_design(), sample_time_s=own.get(row["target"], 5.0))
        proof = prove(encode(design, row["target"]), HEATER, setpoint_degC=40.0)
        nominal = {criterion.name: criterion.value for criterion in proof.runs[0].criteria}
        assert (row["verdict"], row["realised"]["iae"]) == (proof.verdict, pytest.approx(nominal["iae"]))


@pytest.mark.long
def test_what_rounding_costs_is_told_apart_from_what_the_arithmetic_costs(document):
    rows = {row["target"]: row for row in document["rows"]}
    for target in ("s7-300", "fb41", "weg", "s7-200-pid"):  # REAL words hardly round
        assert rows[target]["rounded"]["iae"] == pytest.approx(rows[target]["wished"]["iae"], rel=1e-4)
    coarse = rows["s5-ob251"]  # TI = 34 of 1/1024
    assert coarse["words"]["TI"] == 34
    assert coarse["rounded"]["iae"] != pytest.approx(coarse["wished"]["iae"], rel=1e-6)
    assert rows["on-off"]["rounded"] is None
    assert rows["on-off"]["realised"]["iae"] > 1.2 * rows["on-off"]["wished"]["iae"]


@pytest.mark.long
def test_the_table_and_the_picture_show_every_controller(document):
    table = targets_table(document)
    assert all(target in table for target in TARGETS)
    shown = [row for row in document["rows"] if "series" in row]
    drawn = plot_targets(shown)
    for row, left, right in zip(shown, drawn.axes[::2], drawn.axes[1::2], strict=True):
        assert left.get_title(loc="left") == row["target"]
        realised = left.get_lines()[1].get_ydata()
        assert list(realised) == row["series"]["temperature_degC"]
        wished = np.interp(row["series"]["time_s"], row["ideal"]["time_s"], row["ideal"]["temperature_degC"])
        assert np.asarray(right.get_lines()[0].get_ydata()) == pytest.approx(realised - wished)
    page = render_targets(document)
    assert page.count("<svg") == 1
    assert "http" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "").replace("http://creativecommons.org", "")


@pytest.mark.long
def test_a_controller_that_cannot_hold_the_design_stays_in_the_table_with_its_reason(monkeypatch):
    monkeypatch.setattr(comparison, "TARGETS", ["s7-200", "s7-300"])  # all of them stand in the document above
    rows = {row["target"]: row for row in compare(_design(tn=np.inf), HEATER, Conditions(setpoint_degC=40.0))["rows"]}
    assert rows["s7-200"]["verdict"] == "not representable"
    assert "--structure pi" in rows["s7-200"]["why"]
    assert "realised" in rows["s7-300"]
    told = targets_table({"model": "by hand", "setpoint_degC": 40.0, "rows": list(rows.values())})
    assert "s7-200: integral-action time TN" in told


@pytest.mark.long
def test_where_no_controller_holds_the_design_there_is_no_picture(document):
    refused = [{"target": "weg", "title": "a controller", "verdict": "not representable", "why": "too large"}]
    assert "<svg" in render_targets(document)
    shown = render_targets({**document, "rows": refused})
    assert "<svg" not in shown
    assert "too large" in shown
