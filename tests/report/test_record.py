"""The commissioning record: self-contained, well-formed, with the numbers, their units and sources, and boxes to tick."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from tests.report.conftest import DESIGN, HEATER

from heatertune import chain
from heatertune.chain.pipeline import dossier
from heatertune.codec import encode
from heatertune.errors import UnknownName
from heatertune.log.log_values import Log
from heatertune.model.model_values import model_by_hand
from heatertune.plc import TARGETS, controller_for
from heatertune.plc.targets import commissioning
from heatertune.proof.specification import in_force
from heatertune.report import render
from heatertune.report.html import panels, panels_json, table, text_of, tick, with_code
from heatertune.report.page import head, record, specification
from heatertune.report.plots import plot_fit, plot_loop, plot_pwm, plot_robustness, plot_wish
from heatertune.report.verdict_summary import design_brief

VOID = {"meta", "input", "br", "path", "use", "line"}


class _Seen(HTMLParser):
    """Elements in their order, cells of the tables by row, what is left open, what would be fetched."""

    def __init__(self, page):
        super().__init__()
        self.open, self.rows, self.fetched, self.inputs, self.captions, self.tables = [], [], [], [], [], 0
        self._cell = self._caption = None
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.fetched += [found[name] for name in ("src", "href", "xlink:href", "data") if found.get(name)]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "input":
            self.inputs.append(found)
        if tag == "tr":
            self.rows.append([])
        if tag == "table":
            self.tables += 1
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag == "br" and "tr" in self.open:
            self.rows[-1][-1] += " "
        if tag == "caption":
            self.captions.append("")

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag, tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "caption":
            self.captions[-1] += data
        elif {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data


@pytest.fixture(scope="module")
def seen(page):
    return _Seen(page)


@pytest.mark.long
def test_the_page_is_well_formed_and_fetches_nothing(page, seen):
    assert seen.open == []
    assert all(each.startswith("#") for each in seen.fetched), seen.fetched
    styles = re.findall(r"<style[^>]*>(.*?)</style>", page, re.DOTALL)
    assert not [each for each in styles if re.search(r"@import|url\((?!#)", each)]
    for forbidden in ("fetch(", "XMLHttpRequest", "WebSocket", "sendBeacon", "import("):
        assert forbidden not in page, forbidden


def test_every_word_stands_in_typing_order_with_its_address_and_format_and_a_box(documents, seen):
    fields = controller_for("s5-ob251").fields
    rows = [row for row in seen.rows if len(row) == 4 and row[1].startswith("DW")]
    assert [row[1] for row in rows] == [f"{f.address} {f.name}" for f in fields]
    assert {row[1]: row[2] for row in rows}["DW1 K"] == f"KF {documents['words']['words']['K']:+06d}"
    boxes = [each["id"] for each in seen.inputs]
    assert boxes[: len(fields)] == [f"word-{f.name}" for f in fields]
    assert len(boxes) == len(set(boxes))
    assert sum(box.startswith("step-") for box in boxes) == sum(map(len, commissioning("s5-ob251").steps.values()))


def test_a_block_that_keeps_its_interval_is_called_as_often_as_the_terminal_says():
    fitted, design = model_by_hand(HEATER), DESIGN  # its TA is 4 s
    proof = chain.prove(chain.encode(design, "pid-compact"), fitted, setpoint_degC=40.0)
    log = Log(name="own", source="own", time_s=np.arange(30.0), temperature_degC=22.0 + np.arange(30.0))
    documents = dossier(log, fitted, design, proof, {"words.scl": b""})
    called = re.search(r"call every [\d.]+ s", design_brief(documents, "out")).group()
    assert called != "call every 4 s"
    assert called in record(documents)


def test_every_criterion_stands_with_value_unit_and_run(documents, seen):
    for name, each in documents["proof"]["criteria"].items():
        row = next(row for row in seen.rows if len(row) == 7 and row[0] == name.replace("_", " "))
        assert row[3] == each["unit"]
        assert row[5] == each["where"]
        if each["value"] is not None:
            assert float(row[1]) == pytest.approx(each["value"], rel=1e-3)


def test_what_was_logged_assumed_chosen_and_rounded_stands_with_its_unit(documents, seen):
    real = documents["words"]["realised"]
    expected = [
        ["temperature", f"22 … {22 + 30 * (1 - np.exp(-590 / 167)):.4g}", "°C"], ["heater power", "80 … 80", "%"],
        ["K", "9.5", f"{real['gain_pct_per_degC']:.4g}", "%/°C"], ["TN", "66", f"{real['integral_time_s']:.4g}", "s"],
        ["sensor at the highest reading", "100", "°C", "--range"], ["setpoint", "not logged", "°C"],
        ["PWM period", f"{documents['proof']['actuator']['pwm_period_s']:.4g}", "s", "--pwm-period, else from TA"],
    ]
    for row in expected:
        assert row in seen.rows, row


def test_every_table_of_the_appendix_names_its_source(page):
    appendix = _Seen(page[page.index('<div class="appendix">'):page.index("</main>")])
    assert len(appendix.captions) == appendix.tables
    assert all(each.startswith("Source: ") and len(each) > 12 for each in appendix.captions)
    assert "Source: a file & its line" in appendix.captions


def test_the_record_has_limit_and_proven_worst_and_room_for_what_is_measured_by_hand(documents, page):
    rows = {row[1]: row for row in _Seen(page[:page.index('<div class="appendix">')]).rows if len(row) == 6}
    overshoot = documents["proof"]["criteria"]["overshoot"]
    assert rows["overshoot"][2:] == ["at most 20 %", f"{overshoot['value']:.4g} % of rise", "", ""]
    assert "Ms" not in rows, "no plant shows it"
    assert documents["proof"]["digest"] in page
    for name in ("prepared", "checked", "accepted"):
        assert f"<td>{name}</td>" in page


def test_words_that_are_not_proven_are_not_to_be_typed_in(documents):
    words = documents["words"] | {"verdict": "FAIL", "files": []}
    assert "Do not enter: these parameters are not proven." in record(documents | {"words": words})
    assert "Do not enter" not in record(documents)


@pytest.mark.long
def test_what_the_plant_is_called_stands_at_the_foot_of_each_page_and_breaks_out_of_nothing(documents):
    named = documents | {"record": {"plant_tag": '</style>"; x', "document": "HT-0815", "revision": None}}
    assert head(named).startswith('HT-0815 · </style>"; x · s5-ob251 · proof ')
    styles = re.findall(r"<style>(.*?)</style>", render(named), re.DOTALL)
    assert len(styles) == 1
    said = re.search(r'@bottom-left \{ content: "([^"]*)"', styles[0])[1]
    read = re.sub(r"\\([0-9a-f]+) ", lambda each: chr(int(each[1], 16)), said)
    assert read == head(named)
    assert 'counter(page) "\xa0of\xa0" counter(pages)' in styles[0]


def test_a_head_stands_over_its_numbers():
    told = table(["name", "value"], [["K", "1"]], numeric=(1,))
    assert '<th scope="col">name</th><th scope="col" class="n">value</th>' in told
    assert '<td>K</td><td class="n">1</td>' in told


def test_verdict_steps_and_what_was_not_proven_stand_in_the_page(page):
    heads = re.findall(r"<h2>(.*?)</h2>", page)
    assert heads == ["Parameters for s5-ob251", "Commissioning", "Safety", "Acceptance test", "As found, as left", "Signed",
                     "Specification", "Proof", "What was not proven", "Troubleshooting", "Design and rounding", "Model", "Log", "Assumptions", "Comparison with other designs", "Terms"]
    assert 'class="verdict pass"' in page
    assert "a jittering timer (see <code>heatertune verify --samples</code>" in page
    assert "Not run: a second event before the loop is at rest" in page


@pytest.mark.long
def test_the_same_documents_give_the_same_page_and_other_words_other_ticks(documents, page):
    assert render(documents) == page
    other = json.loads(json.dumps(documents))
    other["words"]["words"]["K"] += 1
    marks = [re.search(r'data-words="(\w{16})"', each)[1] for each in (page, render(other))]
    assert marks[0] != marks[1]


@pytest.mark.long
def test_the_data_of_a_live_picture_are_the_lines_of_the_printed_one(documents, page):
    series = documents["pictures"]
    found = panels(plot_loop(series["nominal"], series["worst"], series["others"]))
    assert [panel["y"] for panel in found] == ["temperature [°C]", "requested power [%]"]
    assert all(panel["x"] == "time [s]" for panel in found)
    nominal = next(line for line in found[0]["lines"] if line["label"] == "nominal")
    assert nominal["y"] == pytest.approx(series["nominal"]["temperature_degC"], abs=1e-4)
    assert nominal["x"] == pytest.approx(series["nominal"]["time_s"], abs=1e-4)
    level = next(line for line in found[0]["lines"] if line["label"] == "setpoint")
    assert level["y"] == [40.0, 40.0]
    assert level["x"] == [nominal["x"][0], nominal["x"][-1]]
    assert [line["step"] for line in found[1]["lines"]] == [True, True]
    assert page.count("<figure id=") == page.count('<script type="application/json">') == 3
    for block in re.findall(r'<script type="application/json">(.*?)</script>', page):
        assert json.loads(block)


@pytest.mark.long
def test_every_line_that_can_be_read_under_the_cursor_has_a_name(documents):
    series = documents["pictures"]
    log = documents["log"]
    residuals = {"time_s": [0.0, 10.0], "measured_degC": [22.0, 24.0], "simulated_degC": [22.5, 23.0]}
    for figure in (plot_loop(series["nominal"], series["worst"], [series["nominal"]]),
                   plot_wish(series["nominal"], series["ideal"]), plot_pwm(series["nominal"], 1600.0, 1700.0),
                   plot_fit(log, residuals)):
        for panel in panels(figure):
            assert all(line["label"] and not line["label"].startswith("_") for line in panel["lines"])
            assert re.search(r"\[.+\]$", panel["y"])


def test_power_is_a_panel_of_its_own(documents):
    residuals = {"time_s": [0.0, 10.0], "measured_degC": [22.0, 24.0], "simulated_degC": [22.5, 23.0]}
    top, power, low = panels(plot_fit(documents["log"], residuals))
    assert [panel["y"] for panel in (top, power, low)] == ["temperature [°C]", "power [%]", "residual [°C]"]
    assert [line["label"] for line in top["lines"] + power["lines"]] == ["log", "model", "power"]
    assert power["lines"][0]["y"] == [80.0] * 60
    assert low["lines"][0]["y"] == [-0.5, 1.0]


@pytest.mark.long
def test_the_ms_of_the_design_stands_in_the_picture_beside_the_limit(documents, page):
    assert ">design 1.37<" not in page, "a design by hand promised none"
    promised = documents | {"pid": documents["pid"] | {"ms": 1.37}}
    told = render(promised)
    assert ">design 1.37<" in told
    assert ">Ms, design 1.37<" in told
    assert told.count(f">limit {documents['pictures']['ms_limit']:g}<") == 1


def test_a_curve_that_runs_back_stays_a_picture(documents):
    series = documents["pictures"]
    assert panels_json(plot_robustness(series["curves"], 2.0)) == "[]"


def test_data_cannot_end_their_script_and_text_cannot_be_markup():
    import matplotlib.figure  # noqa: PLC0415 - beside its only use

    ax = matplotlib.figure.Figure().subplots()
    ax.plot([0.0, 1.0], [1.0, 2.0], label="</script><b>")
    assert "<" not in panels_json(ax.figure)
    assert json.loads(panels_json(ax.figure))[0]["lines"][0]["label"] == "</script><b>"
    assert "&lt;/script&gt;" in table(["a"], [["</script>"]], source="x & y")
    assert text_of(tick("a", "b")).startswith("<input")
    assert with_code("`<a>` & b") == "<code>&lt;a&gt;</code> &amp; b"


@pytest.mark.parametrize("target", TARGETS)
def test_every_room_tells_how_it_is_put_into_service(target):
    told = commissioning(target)
    assert tuple(told.steps) == (
        "Entering the parameters", "The first minutes", "If it oscillates", "If it is sluggish", "If it does not heat",
        "Restoring the old parameters")
    assert all(items and all(re.fullmatch(r".{15,}[.?]", each) for each in items) for items in told.steps.values())
    assert re.search(r"\d", told.facts), "a source with its number"


@pytest.mark.parametrize("target", TARGETS)
def test_the_files_and_addresses_that_the_steps_name_are_those_of_the_export(target):
    found = controller_for(target)
    told = " ".join(step for items in commissioning(target).steps.values() for step in items)
    words = chain.encode(replace(DESIGN, sample_time_s=found.timer.round(DESIGN.sample_time_s)), target)
    from heatertune.plc import Certificate  # noqa: PLC0415 - beside its only use

    files = found.export(words, Certificate(verdict="PASS"))
    named = set(re.findall(r"`([\w]+\.(?:awl|st|txt|hex|csv))`", told))
    named -= {"feed_forward.awl"}  # of `heatertune feed-forward`
    assert named <= set(files), named - set(files)
    # "DW5 (TI)", "TI (DW5)", "W (DW9)": whichever stands first, it is the room's own address of that word
    address = {each.name.upper(): each.address for each in found.fields}
    pairs = re.findall(r"\b(\w+) \((\w+(?:\.\d)?)\)", told)
    for pair in pairs + [(two, one) for one, two in pairs]:
        name, place = (each.upper() for each in pair)
        if name in address and re.fullmatch(r"(V[WD]|SMB|DW|DB[DWX])[\d.]+", place):
            assert place == address[name], (name, place)


def test_an_unknown_controller_has_no_steps():
    with pytest.raises(UnknownName, match="s5-ob251"):
        commissioning("s5")


def test_a_profile_that_was_proven_is_named_among_what_was_asked(tmp_path):
    file = tmp_path / "firing.csv"
    file.write_text("target [degC],ramp [degC/h],soak [min]\n600,150,10\n")
    asked = encode(in_force("kiln", [], str(file)))
    assert "firing.csv (1 segment, sha256 " in specification({"proof": {"specification": asked}})
