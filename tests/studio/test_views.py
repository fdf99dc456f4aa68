"""What the page says and draws, from values that were made elsewhere."""

import io
import json
import math
import re
import zipfile
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from heatertune import chain
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.model.statistics import Interval
from heatertune.plc.keyed_entry import typed_words
from heatertune.proof.verdict import verdict_details, verdict_line
from heatertune.report.plots import LOOK
from heatertune.studio import charts, views
from heatertune.studio.background_work import export_zip, report_page
from heatertune.studio.loop_settings import StudioSettings, first_look, full_proof
from heatertune.studio.proof_picture import parts_of, picture_of
from heatertune.studio.session import FrontDesign, PinnedDesign
from heatertune.studio.sheet_card import DroppedFile


@pytest.fixture(scope="module")
def look(heater):
    return first_look(heater, StudioSettings())


@pytest.fixture(scope="module")
def proof(heater, look):
    return full_proof(heater, look)


class Cells(HTMLParser):
    """The text of a page's cells, and whether every tag that opens is closed."""

    def __init__(self, text):
        super().__init__()
        self.cells, self.open = [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):  # noqa: ARG002 - the parser's signature
        self.open.append(tag)
        if tag in ("td", "th", "li"):
            self.cells.append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if {"td", "th", "li"} & set(self.open):
            self.cells[-1] += data


def test_the_words_stand_in_the_order_in_which_they_are_typed_in(look):
    cells = Cells(views.words(look)).cells
    assert cells[:6] == ["address", "name", "type", "first (manual)", "then (automatic)", "meaning"]
    assert cells[7::6] == ["K", "R", "TI", "TD", "W", "STEU", "YH", "BGOG", "BGUG"]  # OB251's controller DB, DW1 … DW16
    assert cells[8::6] == ["KF"] * 5 + ["KM"] + ["KF"] * 3
    assert cells[9] == f"KF {look.gains.words.values['K']:+06d}Copy"  # fixed point, as STEP 5 writes it: KF +02846


def test_every_word_can_be_copied_as_its_tool_takes_it_and_all_at_once(look):
    held = chain.encode(look.gains.design, "fb41")
    found = views.words(replace(look, gains=replace(look.gains, words=held)))
    copied = dict(re.findall(r'data-copy="([^"]*)" aria-label="Copy (\w+):', found))
    assert {"TRUE", "FALSE"} <= copied.keys()  # BOOL, as a data block of STEP 7 has it
    assert any(re.fullmatch(r"T#\d+MS", text) for text in copied)  # TIME
    whole = re.search(r'data-copy="([^"]*)" aria-label="Copy all words"', found)[1]
    assert [line.split("\t")[1] for line in whole.splitlines()] == [
        row.name for row in typed_words(held)]


@pytest.mark.long
def test_rounding_is_told_as_what_became_of_each_part(look):
    rows = Cells(views.rounding(look)).cells
    words = look.gains.words.values
    realised = words["K"] / 1024 * words["R"] / 1024  # %/°C: units and percent both span 0…100 °C and 0…100 %
    change = 100.0 * (realised / look.gains.design.gain_pct_per_degC - 1.0)
    assert rows[5:8][0] == "K"
    assert rows[8] == f"{change:+.2g} %"
    assert rows[rows.index("TV") + 1] == "none"
    assert rows[rows.index("TA") + 3] == "exact"


def test_a_controller_that_is_no_pid_has_no_gains_to_compare(heater):
    found = first_look(heater, StudioSettings(target="on-off"))
    assert "no PID" in views.rounding(found)
    assert (found.margins, found.wish) == (None, None)
    lines = charts.loop_chart(found, picture_of(found.proof))["series"]
    assert [line["name"] for line in lines] == ["nominal run", "requested power"]


def test_a_first_look_bears_no_verdict(look, proof):
    assert not {"ok", "FAIL"} & set(Cells(views.criteria(look.proof)).cells)
    assert "ok" in Cells(views.criteria(proof)).cells
    assert views.verdict_text("proving…", None).startswith("Proving")
    assert views.verdict_text("no design", None).startswith("No design yet")
    assert "the last one" in views.verdict_text("no design", None, last=True)
    assert views.verdict_text("PASS", proof).startswith(f"PASS at 50 °C in {len(proof.runs)} runs on 1 plausible heater")


@pytest.mark.long
def test_a_fail_names_what_was_not_kept(heater):
    settings = StudioSettings(structure="p", setpoint_degC=60.0)
    failed = full_proof(heater, first_look(heater, settings))
    assert "steady offset" in views.verdict_text("FAIL", failed)
    assert "FAIL" in Cells(views.criteria(failed)).cells


def test_what_a_file_calls_itself_is_text_and_never_a_tag(heater, step_log):
    log = DroppedFile.of("x.csv", step_log.replace(b"power_pct", b"power_pct", 1)).log
    evil = replace(log, repairs=("<script>alert(1)</script>",), warnings=("<b>",), name="<i>/..")
    text = views.diagnosis(evil, heater)
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    look = first_look(heater, StudioSettings())
    assert views.export_name(evil, look) == "-i-----s5-ob251"


def test_designs_stand_side_by_side_column_by_column(heater, look):
    other = first_look(heater, StudioSettings(ms=1.3))
    cells = Cells(views.comparison_html([PinnedDesign(name="A", look=look, verdict="PASS"), PinnedDesign(name="B", look=other, verdict="proving…")])).cells
    assert cells[:3] == ["", "design A", "design B"]
    assert cells[cells.index("Ms wished"):][:3] == ["Ms wished", "1.6", "1.3"]
    assert cells[-3:] == ["verdict", "PASS", "proving…"]
    assert "four can stand" in views.comparison_html([])


def every_chart(heater, look, log):
    return [charts.log_chart(log, heater), charts.heater_chart(heater), charts.loop_chart(look, picture_of(look.proof))]


def test_every_axis_has_its_unit_and_every_line_its_name(heater, look, step_log):
    *plain, loop = every_chart(heater, look, DroppedFile.of("x.csv", step_log).log)
    for options in plain:
        assert options["xAxis"]["name"] == "time [s]"
        assert re.search(r"\[(°C|%)\]$", options["yAxis"]["name"])
        for line in options["series"]:
            shown = line.get("endLabel", {}).get("formatter")
            assert shown == line["name"] or line["name"].startswith("band")
    assert [axis["name"] for axis in loop["xAxis"]] == ["", "time [s]"]  # one below the other
    assert [axis["name"] for axis in loop["yAxis"]] == ["temperature [°C]", "requested power [%]"]
    named = [name for name, _, _ in charts.key_of(look, picture_of(look.proof))]
    assert named == [line["name"] for line in loop["series"]][:-1] == ["nominal run", "unrounded wish"]
    for options in (*plain, loop):
        json.dumps(options, allow_nan=False)  # a browser knows no NaN


def test_the_lines_show_the_numbers_of_the_loop(look):
    picture, nominal = picture_of(look.proof), look.proof.nominal
    words, wish, power = charts.loop_chart(look, picture)["series"]
    drawn = np.array(words["data"])
    assert len(drawn) > 400
    instants = np.linspace(0.0, picture.parts[1].begin_s / 20.0, 500)  # before anything is torn out
    assert np.interp(instants, *drawn.T) == pytest.approx(nominal.temperature_at(instants), abs=0.1)
    assert words["lineStyle"]["color"] == LOOK["realised"]["color"]
    assert wish["lineStyle"]["type"] != "solid"
    asked = np.array(power["data"])
    assert np.isin(np.round(nominal.power_asked_pct[:20], 3), asked[:, 1]).all()
    assert asked[:, 1].max() == pytest.approx(nominal.power_asked_pct.max(), abs=6e-4)


def test_a_coarse_picture_is_the_fine_one_without_the_wish_to_a_pixel_with_half_the_points(look):
    picture = picture_of(look.proof)
    fine, coarse = (charts.loop_chart(look, picture, coarse=coarse) for coarse in (False, True))
    same = [line for line in fine["series"] if line["name"] != "unrounded wish"]
    assert len(same) == len(fine["series"]) - 1
    assert [line["name"] for line in coarse["series"]] == [line["name"] for line in same]
    assert sum(len(line["data"]) for line in coarse["series"]) < 0.5 * sum(len(line["data"]) for line in same)
    axis, end = coarse["yAxis"][0], coarse["xAxis"][0]["max"]
    height = 1.5 * (axis["max"] - axis["min"]) / coarse["grid"][0]["height"]
    for line, exactly in zip(coarse["series"][:-1], same, strict=False):
        for sign in (-1.0, 1.0):  # the edges of what is seen, pixel by pixel, or in one beside it
            drawn, exact = (_edge(np.array(each["data"]), end, sign) for each in (line, exactly))
            for edge, other in ((drawn, exact), (exact, drawn)):
                near = np.max([other[:-2], other[1:-1], other[2:]], axis=0)
                assert np.all(edge[1:-1] <= near + height)


def _edge(points, end, sign, width=800):
    """Return the largest value of a line, times its sign, in each pixel of a picture."""
    across = np.union1d(np.linspace(0.0, end, 20 * width), points[:, 0])
    pixel = np.minimum((across / end * width).astype(int), width - 1)
    values = sign * np.interp(across, *points.T)
    return np.array([values[pixel == each].max() for each in range(width)])


def test_the_step_of_a_heater_is_that_of_the_textbook():
    fitted = model_by_hand(Fopdt(gain_degC_per_pct=0.6, time_constant_s=200.0, dead_time_s=20.0))
    line = dict(map(tuple, charts.heater_chart(fitted)["series"][-1]["data"]))
    for time, rise in line.items():
        assert rise == pytest.approx(6.0 * (1.0 - math.exp(-max(time - 20.0, 0.0) / 200.0)), abs=1e-3)


@pytest.mark.parametrize("second", [200.0, 199.999, 40.0])
def test_the_step_of_two_lags_solves_their_equation(second):
    # 1 − (T1·e^(−t/T1) − T2·e^(−t/T2))/(T1 − T2), for equal lags 1 − (1 + t/T)·e^(−t/T)
    model = TwoLag(gain_degC_per_pct=1.0, time_constant_s=200.0, second_time_constant_s=second, dead_time_s=0.0)
    time = np.linspace(0.0, 900.0, 20)
    x = y = 0.0
    for _ in range(30_000):  # Heun by hand, 10 ms
        dx = (10.0 - x) / 200.0
        dy = (x - y) / second
        x_end, y_end = x + 0.01 * dx, y + 0.01 * dy
        x, y = x + 0.005 * (dx + (10.0 - x_end) / 200.0), y + 0.005 * (dy + (x_end - y_end) / second)
    assert charts._rise(model, np.array([300.0]))[0] == pytest.approx(y, abs=1e-4)
    assert np.all(np.diff(charts._rise(model, time)) > 0.0)


def test_the_band_reaches_from_the_lowest_to_the_highest_of_what_the_log_leaves_open():
    fitted = model_by_hand(Fopdt(gain_degC_per_pct=0.6, time_constant_s=200.0, dead_time_s=0.0))
    wide = replace(fitted, ci95={"gain_degC_per_pct": Interval(low=0.5, high=0.9), "time_constant_s": Interval(low=None, high=None),
                                 "dead_time_s": Interval(low=0.0, high=10.0)})
    low, width, _ = charts.heater_chart(wide)["series"]
    end = 1.0 - math.exp(-4.0)
    assert low["data"][-1][1] == pytest.approx(5.0 * end, abs=2e-3)
    assert low["data"][-1][1] + width["data"][-1][1] == pytest.approx(9.0 * end, abs=2e-3)
    assert low["stack"] == width["stack"]


def luminance(color):
    """Relative luminance, WCAG 2.1."""
    parts = [int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_every_letter_has_the_contrast_of_wcag_aa(heater, look, step_log):
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)  # WebAIM's well-known near miss
    pins = [PinnedDesign(name=name, look=look, verdict="PASS") for name in "ABCD"]
    loop = charts.loop_chart(look, picture_of(look.proof), pins)
    for options in every_chart(heater, look, DroppedFile.of("x.csv", step_log).log)[:2]:
        colors = [line["endLabel"]["color"] for line in options["series"] if "endLabel" in line]
        colors += [options[axis]["axisLabel"]["color"] for axis in ("xAxis", "yAxis")]
        assert min(contrast(color, "#ffffff") for color in colors) >= 4.5
    assert {axis["axisLabel"].get("color", "#1a1a1a") for axis in (*loop["xAxis"], *loop["yAxis"])} == {"#1a1a1a"}
    names = [mark["label"]["color"] for mark in loop["series"][0]["markLine"]["data"] if "label" in mark]
    assert names
    assert min(contrast(color, "#ffffff") for color in names) >= 4.5
    assert min(contrast(color, "#ffffff") for _, color, _ in charts.key_of(look, picture_of(look.proof), pins)
               if color != LOOK["ideal"]["color"]) >= 3.0  # lines, WCAG 2.1, 1.4.11; the wish is dashed beside the words
    for light in (True, False):
        tones = page_colors(light=light)
        for ground in (tones["card"], tones["ground"]):
            assert min(contrast(tones[ink], ground) for ink in ("ink", "soft", "pass", "fail", "blue")) >= 4.5
            assert min(contrast(tones[line], ground) for line in ("line", "focus")) >= 3.0
        assert contrast(tones["ink"], tones["mark"]) >= 4.5
    assert contrast("#ffffff", "#12324a") >= 4.5  # the bar
    assert contrast("#ffffff", "#23587f") >= 4.5  # buttons on it


def page_colors(*, light):
    """Colours of the page, as its style has them."""
    style = Path(charts.__file__).with_name("look.css").read_text(encoding="utf-8")
    block = re.search((":root" if light else "body.body--dark") + r" \{([^}]*)\}", style)[1]
    return dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", block))


def test_the_zip_holds_what_export_db_writes_and_is_always_the_same(heater, look, proof):
    files = chain.export(look.gains.words, proof)
    standing = FrontDesign(log=None, fitted=heater, look=look, proof=proof)
    packed = export_zip(standing, force=False)
    assert packed == export_zip(standing, force=False)
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        assert set(archive.namelist()) == {*files, "data/words.json", "data/proof.json"}
        for name, content in files.items():
            assert archive.read(name) == (content if isinstance(content, bytes) else content.encode())
        assert json.loads(archive.read("data/words.json"))["words"] == dict(look.gains.words.values)
        assert json.loads(archive.read("data/proof.json"))["verdict"] == "PASS"


@pytest.mark.long
def test_the_report_names_the_words_and_the_files_that_were_downloaded(heater, look, proof, step_log):
    files = chain.export(look.gains.words, proof)
    log = DroppedFile.of("step.csv", step_log).log
    page = report_page(FrontDesign(log=log, fitted=heater, look=look, proof=proof), files)
    assert '<p class="verdict pass">PASS at 50 °C</p>' in page
    assert f"<td class=\"value\">KF {look.gains.words.values['K']:+06d}</td>" in page
    assert all(f"<code>{name}</code>" in page for name in files)
    assert "step.csv" in page


@pytest.mark.parametrize(("seconds", "said"), [(95.0, "95 s"), (1380.0, "23 min"), (8280.0, "2.3 h")])
def test_a_time_is_told_as_people_say_it(seconds, said):
    assert views.duration_text(seconds) == said


def test_one_sentence_says_what_the_loop_does(look, proof):
    worst = {criterion.name: criterion.value for criterion in proof.criteria}
    told = views.sentence(proof, "ssr")
    assert told.startswith(f"Settles in {worst['settling_time'] / 60.0:.0f} min, overshoots {worst['overshoot']:.2g} % at worst")
    assert told.endswith(f"{worst['switchings']:.0f} switchings an hour (SSR).")
    assert "(contactor, which lasts " in views.sentence(proof, "contactor")
    assert "nominal run" in views.sentence(look.proof, "ssr")


def test_what_differs_from_the_first_design_is_marked(heater, look):
    other = first_look(heater, StudioSettings(ms=1.3))
    text = views.comparison_html([PinnedDesign(name="A", look=look, verdict="PASS"), PinnedDesign(name="B", look=other, verdict="PASS")])
    assert "<td>1.6</td><td><mark>1.3</mark></td>" in text
    assert "<td>PI</td><td>PI</td>" in text


def test_the_banner_is_short_and_nothing_of_the_verdict_is_lost_under_it(proof):
    assert len(views.verdict_text("PASS", proof)) < 160  # two lines of the page
    line, folded = verdict_line(proof.to_document()), " ".join(Cells(views.conditions(proof)).cells)
    parts = verdict_details(proof.to_document())
    assert parts
    assert line.endswith("; ".join(parts))
    assert all(views.for_page(part)[1:] in folded for part in parts)
    assert views.conditions(None) == ""


def test_each_event_has_a_number_and_no_two_numbers_of_a_line_meet(proof):
    picture = picture_of(proof)
    names = [name for name, *_ in charts.zooms(picture)]
    assert len(set(names)) == len(names)
    lines = charts._lines_of_numbers(picture)
    width = float(picture.place(picture.parts[-1].end_s))
    for line in set(lines.values()):
        places = [float(picture.place(picture.parts[number - 1].begin_s)) for number in lines if lines[number] == line]
        assert all(later - earlier >= 0.05 * width for earlier, later in pairwise(places))


def test_a_kept_design_has_its_events_where_the_picture_has_them(heater, look, proof):
    slow = first_look(heater, StudioSettings(ms=1.2))
    pin, picture = PinnedDesign(name="A", look=slow, verdict="proving…"), picture_of(proof)
    time, temperature = charts._aligned(pin, picture)
    assert np.all(np.diff(time) >= 0.0)
    own = parts_of(slow.proof.nominal, slow.proof)
    assert [part.name for part in own] == [part.name for part in picture.parts]
    for mine, there in zip(own, picture.parts, strict=True):
        inside = (time >= there.begin_s) & (time < there.end_s)
        begins = slow.proof.nominal.temperature_at(np.array([mine.begin_s]), before=True)[0]
        assert temperature[inside][0] == pytest.approx(begins, abs=0.1)
