"""What a notebook shows of the values: well-formed, with the numbers and their units, and a picture."""

import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace

import nbformat
import numpy as np
import pytest
from scipy.signal import lfilter

from heatertune import chain
from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import Margins, PidDesign
from heatertune.plc import Scaling, Words
from heatertune.report.cards import card, reaction, thinned

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
DESIGN = PidDesign(
    gain_pct_per_degC=9.5, integral_time_s=66.0, derivative_time_s=0.0, sample_time_s=4.0, structure="pi",
    method="a test & its <tags>", margins=Margins(ms=1.4, mt=1.2, gain_margin=4.75, phase_margin_deg=53.0),
)


@pytest.fixture(scope="module")
def proof():
    return chain.prove(chain.encode(DESIGN, "s5-ob251"), model_by_hand(HEATER), setpoint_degC=40.0)


@pytest.fixture
def log():
    time = np.arange(5000.0)
    rise = 30.0 * (1 - np.exp(-np.maximum(0.0, time - 60.0) / 200.0))
    return Log(name="own", source="a test", time_s=time, temperature_degC=20.0 + np.round(rise, 1),
               power_pct=np.where(time >= 50.0, 60.0, 0.0), repairs=("a < b",))


def _seen(value):
    """The card as a browser reads it: the cells of its tables, all of its text, the number of its pictures."""
    tree = ET.fromstring(value._repr_html_())  # raises where it is not well-formed
    rows = [["".join(cell.itertext()) for cell in row] for row in tree.iter("tr")]
    pictures = list(tree.iter("{http://www.w3.org/2000/svg}svg"))
    return rows, " ".join("".join(tree.itertext()).split()), len(pictures)


def test_a_log_shows_its_spans_with_units_and_what_the_reader_did(log):
    rows, text, pictures = _seen(log)
    assert ["readings", "5000", ""] in rows
    assert ["duration", "4999", "s"] in rows
    assert ["temperature", "20 … 50", "°C"] in rows
    assert ["heater power", "0 … 60", "%"] in rows
    assert ["setpoint", "not logged", ""] in rows
    assert "1 notes of the reader" in text
    assert "a < b" in text
    assert pictures == 1


@pytest.mark.long
def test_a_long_log_is_thinned_its_last_reading_kept(log):
    noisy = replace(log, temperature_degC=log.temperature_degC + np.sin(1.7 * log.time_s))
    short = noisy.window(0.0, 599.0)
    assert len(card(noisy)) < 1.3 * len(card(short)), "a picture of 5000 readings is not larger than one of 600"
    (kept,) = thinned(noisy.time_s)
    assert (kept[0], kept[-1], len(kept)) == (0.0, 4999.0, 600)


@pytest.mark.long
def test_a_model_shows_its_numbers_and_its_outcome(log):
    fitted = chain.fit(log.window(0.0, 1200.0))
    rows, text, pictures = _seen(fitted)
    gain = next(row for row in rows if row[0] == "process gain")
    assert float(gain[1]) == pytest.approx(fitted.model.gain_degC_per_pct, rel=1e-3)
    assert gain[3] == "°C/%"
    assert fitted.outcome.value in text
    assert pictures == 1
    rows, text, pictures = _seen(model_by_hand(HEATER))
    assert pictures == 0, "nothing was logged"
    assert ["time constant", "167", "not identified", "s"] in rows


def test_a_design_shows_its_constants_margins_and_reaction():
    rows, text, pictures = _seen(DESIGN)
    for row in (["K", "9.5", "%/°C"], ["TN", "66", "s"], ["TV", "0", "s"], ["TA", "4", "s"], ["Ms", "1.4", ""],
                ["gain margin", "4.75", ""], ["phase margin", "53", "°"]):
        assert row in rows
    assert "a test & its <tags>" in text
    assert pictures == 1
    bare = replace(DESIGN, integral_time_s=math.inf, structure="p", margins=None)
    rows, _, _ = _seen(bare)
    assert ["TN", "none", "s"] in rows
    assert not any(row[0] == "Ms" for row in rows)


def test_words_show_what_is_typed_in_and_what_it_realises():
    words = Words(target="s5-ob251", sample_time_s=4.0, scaling=Scaling(), values={
        "K": 9728, "R": 1024, "TI": 64, "TD": 0, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0})
    rows, text, pictures = _seen(words)
    assert next(row for row in rows if row[1:2] == ["TI"])[:3] == ["DW5", "TI", "KF +00064"]
    # S5-115U manual, section 11.2.3: TI = TA/TN and K in 1024ths, so TN = 4 s·1024/64, K = 9728/1024
    assert ["TN", "64", "s"] in rows
    assert ["K", "9.5", "%/°C"] in rows
    assert "Called every 4 s; sensor 0…100 °C." in text
    assert pictures == 1
    on_off = Words(target="on-off", values={"BAND": 20}, scaling=Scaling(), sample_time_s=1.0)
    assert _seen(on_off)[2] == 0, "no PID, no reaction"


def test_a_proof_shows_its_verdict_and_every_criterion(proof):
    rows, text, pictures = _seen(proof)
    assert f"proof of s5-ob251: {proof.verdict}" in text
    assert f"{len(proof.runs)} runs on 1 heater models" in text
    names = [row[0].replace(" ", "_") for row in rows]
    for each in proof.criteria:
        row = rows[names.index(each.name)]
        assert (row[4] == "ok") is (each.limit is not None and each.ok)
        assert row[3] == each.unit
        if math.isfinite(each.value):
            assert float(row[1]) == pytest.approx(each.value, rel=1e-3)
    assert pictures == 1


def test_a_failing_criterion_is_marked(proof):
    bad = replace(proof, criteria=tuple(replace(c, limit=0.001) if c.name == "overshoot" else c for c in proof.criteria))
    assert next(row for row in _seen(bad)[0] if row[0] == "overshoot")[2:] == ["≤ 0.001", "% of rise", "FAIL"]


def test_a_trace_shows_what_the_loop_did(proof):
    rows, text, pictures = _seen(proof.nominal)
    assert "closed loop of s5-ob251" in text
    assert ["setpoint", "40", "°C"] in rows
    assert ["scans", str(len(proof.nominal.time_s)), ""] in rows
    assert pictures == 1


def test_a_card_fetches_nothing_and_any_other_value_has_none(proof, log):
    for value in (log, DESIGN, proof, proof.nominal, proof.words):
        links = re.findall(r'(?:href|src)="([^"]*)"', card(value))
        assert all(link.startswith("#") for link in links)
    with pytest.raises(TypeError, match="float"):
        card(1.0)


@pytest.mark.parametrize(("tn", "tv", "kept"), [(66.0, 0.0, 0.5), (66.0, 10.0, 0.5), (66.0, 10.0, 0.0), (math.inf, 0.0, 0.5)])
def test_the_reaction_is_that_of_the_sampled_law(tn, tv, kept):
    # the parts of PidDesign's docstring as digital filters, run by SciPy on an error that steps at n = 0
    structure = "p" + ("i" if math.isfinite(tn) else "") + ("d" if tv else "")
    design = replace(DESIGN, integral_time_s=tn, derivative_time_s=tv, derivative_filter=kept, structure=structure)
    time, power = reaction(design)
    error = np.ones(len(time))
    integral = lfilter([4.0 / tn], [1.0, -1.0], error)
    derivative = lfilter([(1 - kept) * tv / 4.0, -(1 - kept) * tv / 4.0], [1.0, -kept], error)
    np.testing.assert_allclose(power, 9.5 * (error + integral + derivative), rtol=1e-12)
    np.testing.assert_allclose(np.diff(time), 4.0)
    assert time[-1] >= (2 * tn - 8.0 if math.isfinite(tn) else 19 * 4.0)


def test_a_continuous_design_reacts_too():
    time, power = reaction(replace(DESIGN, sample_time_s=0.0))
    assert power[0] == pytest.approx(9.5, rel=0.02)
    assert time[-1] == pytest.approx(132.0, rel=0.02)
    assert power[-1] == pytest.approx(3 * 9.5, rel=0.02), "after two TN the I part is twice the P part"


@pytest.mark.long
def test_a_notebook_cell_that_ends_in_a_value_shows_it(tmp_path):
    cells = [
        "from heatertune.pid.design_values import PidDesign\n"
        "design = PidDesign(gain_pct_per_degC=9.5, integral_time_s=66.0, derivative_time_s=0.0, sample_time_s=4.0,\n"
        "                   structure='pi', method='a test')",
        "design",
        "import heatertune as ht\nwords = ht.encode(design, target='s5-ob251')\nwords",
        "from heatertune.model.model_values import model_by_hand\nfrom heatertune.model.model_values import Fopdt\n"
        "heater = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)\n"
        "proof = ht.prove(words, model_by_hand(heater), setpoint_degC=40.0)\nproof",
        "ht.read_log('table4')",
    ]
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    path, done = tmp_path / "cards.ipynb", tmp_path / "done.ipynb"
    nbformat.write(book, path)
    # in a process of its own: the notebook machinery brings warnings that are not ours
    code = (
        "import sys, nbformat, nbclient; nb = nbformat.read(sys.argv[1], 4);"
        "nbclient.NotebookClient(nb, timeout=300, kernel_name='python3').execute(); nbformat.write(nb, sys.argv[2])"
    )
    ended = subprocess.run([sys.executable, "-c", code, str(path), str(done)], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr[-3000:]
    shown = [[o["data"].get("text/html", "") for o in cell.outputs if "data" in o] for cell in nbformat.read(done, 4).cells]
    assert shown[0] == []
    for (page,), wanted in zip(shown[1:], ("9.5</td><td>%/°C", "DW5</td><td>TI", "proof of s5-ob251: PASS", "240</td>"),
                               strict=True):
        assert wanted in page
        assert "<svg" in page
