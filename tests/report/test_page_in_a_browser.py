"""The report as a commissioning engineer meets it: a file opened from disk in Debian's Chromium, without a network."""

import json
import re

import numpy as np
import pytest
from tests.accessible import demand_accessible
from tests.report.conftest import DESIGN, HEATER

from heatertune import chain
from heatertune.chain.pipeline import dossier
from heatertune.log.log_values import Log
from heatertune.model.model_values import model_by_hand
from heatertune.report import render

#: A4 without the margins of the print style, 13 mm above and below, 12 mm beside, in CSS pixels of 1/96 inch
A4 = {"width": int((210 - 2 * 12) / 25.4 * 96), "height": int((297 - 2 * 13) / 25.4 * 96)}

#: what is written on any canvas, which no element of the page tells
WRITTEN = """window.written = new Set(); const write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...where) {
    window.written.add(text); write.call(this, text, ...where); };"""

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def report(documents, tmp_path_factory):
    """The page of a log with a fit, and with every picture."""
    log = documents["log"]
    measured = np.asarray(log["temperature_degC"])
    half = len(measured) // 2  # as where the rest was left out of the fit
    residuals = {"time_s": list(log["time_s"])[:half], "measured_degC": measured[:half].tolist(),
                 "simulated_degC": (measured[:half] + 0.5).tolist()}
    told = documents | {"model": documents["model"] | {"residuals": residuals}, "pid": documents["pid"] | {"ms": 1.4}}
    found = tmp_path_factory.mktemp("report") / "report.html"
    found.write_text(render(told), encoding="utf-8")
    return found


@pytest.fixture
def shown(browser, report):
    """The page, opened with the network off; a complaint of the console or a request fails the test."""
    complaints = []
    with browser.new_context(viewport={"width": 1280, "height": 720}, offline=True) as context:
        found = context.new_page()
        found.on("console", lambda said: complaints.append(said.text))
        found.on("pageerror", lambda problem: complaints.append(str(problem)))
        found.on("request", lambda asked: None if asked.url == report.as_uri() else complaints.append(asked.url))
        found.add_init_script(WRITTEN)
        found.goto(report.as_uri())
        yield found
    assert complaints == []


def under_cursor(panel):
    """Return what the legend of a panel tells, name → value."""
    rows = panel.locator(".u-legend .u-series").all()
    return {row.locator(".u-label").inner_text(): row.locator(".u-value").inner_text() for row in rows}


def at(panel, share):
    """Return the point of a panel's plotting area so far to the right, half way up."""
    box = panel.locator(".u-over").bounding_box()
    return box["x"] + share * box["width"], box["y"] + 0.5 * box["height"]


def test_the_pictures_tell_what_is_under_the_mouse_zoom_and_come_back(shown, documents):
    assert shown.locator("figure.moves").count() == 4, "loop, switching, wish, fit"
    written = set(shown.evaluate("[...window.written]"))
    assert {"time [s]", "temperature [°C]", "requested power [%]", "heater [%]", "difference [°C]", "power [%]", "residual [°C]",
            "0", "200"} <= written
    assert any(re.fullmatch(r"[1-9]\d*,000", tick) for tick in written), "a run lasts hours"
    loop = shown.locator("figure.moves").first
    loop.scroll_into_view_if_needed()
    top, low = loop.locator(".uplot").all()
    assert set(under_cursor(top).values()) == {"—"}
    nominal = documents["pictures"]["nominal"]
    end = nominal["time_s"][-1]

    shown.mouse.move(*at(top, 0.5))
    told = under_cursor(top)
    assert float(told["time [s]"]) == pytest.approx(0.5 * end, rel=0.01)
    expected = np.interp(0.5 * end, nominal["time_s"], nominal["temperature_degC"])
    assert float(told["nominal"]) == pytest.approx(expected, abs=0.2)
    assert float(told["setpoint"]) == 40.0
    assert float(under_cursor(low)["time [s]"]) == pytest.approx(0.5 * end, rel=0.01), "both panels move together"
    shown.mouse.move(*at(top, 0.1))
    assert under_cursor(top) != told
    _drag_zooms_both_panels_and_double_click_brings_all_back(shown, top, low, np.array(nominal["time_s"]))


def _drag_zooms_both_panels_and_double_click_brings_all_back(shown, top, low, instants):
    end, gap = instants[-1], np.diff(instants).max()  # the nearest instant is told, and at rest they lie apart

    shown.mouse.move(*at(top, 0.25))
    shown.mouse.down()
    shown.mouse.move(*at(top, 0.5), steps=4)
    shown.mouse.up()
    for panel in (top, low):
        shown.mouse.move(*at(panel, 0.98))
        assert float(under_cursor(panel)["time [s]"]) == pytest.approx(0.495 * end, abs=gap)
    shown.mouse.dblclick(*at(low, 0.5))
    for panel in (top, low):
        shown.mouse.move(*at(panel, 0.98))
        assert float(under_cursor(panel)["time [s]"]) == pytest.approx(0.98 * end, abs=gap)


def test_panels_of_one_figure_show_the_same_stretch_though_one_line_ends_early(shown):
    log, _, residual = shown.locator("figure.moves").last.locator(".uplot").all()
    for panel in (log, residual):
        panel.scroll_into_view_if_needed()
        shown.mouse.move(*at(panel, 0.25))
        assert float(under_cursor(panel)["time [s]"]) == pytest.approx(0.25 * 590.0, abs=6.0), "readings are 10 s apart"


def test_ticks_are_kept_when_the_page_is_opened_again(shown):
    boxes = shown.get_by_role("checkbox")
    assert boxes.count() > 9
    for i in (0, 3):
        boxes.nth(i).check()
    boxes.nth(3).uncheck()
    shown.reload()
    assert [i for i in range(boxes.count()) if boxes.nth(i).is_checked()] == [0]


def _no_heading_stands_at_the_foot_of_a_page(printed, headings):
    """The outline of a PDF tells where each heading stands, from the foot of its page on."""
    heights = [float(each) for each in re.findall(rb"/XYZ [\d.]+ ([\d.]+)", printed)]
    assert len(heights) >= headings
    foot = 15 / 25.4 * 72  # the margin, in points
    assert min(heights) > foot + 3 * 8.6 * 1.32, "a heading and two lines below it"


def test_a_log_named_as_the_begin_of_a_comment_and_a_script_changes_nothing(browser, report, tmp_path, documents):
    """HTML's parser reads on behind a script's end where "<!--<script" stood in it."""
    shown = {}
    for name in ("plain", "<!--<script>"):
        text = json.dumps(documents).replace(json.dumps(documents["log"]["name"])[1:-1], name)
        path = tmp_path / f"{len(shown)}.html"
        path.write_text(render(json.loads(text.replace("by hand", name))), encoding="utf-8")
        with browser.new_context(offline=True) as context:
            found = context.new_page()
            problems = []
            found.on("pageerror", lambda problem, kept=problems: kept.append(str(problem)))
            found.goto(path.as_uri())
            shown[name] = [found.locator(each).count() for each in ("h2", "table", "figure.moves", "canvas", "script")]
            assert problems == []
            assert name in found.locator("h1").first.inner_text()
    assert shown["plain"] == shown["<!--<script>"]


def test_the_words_show_their_values_on_a_telephone_without_scrolling_sideways(shown):
    shown.set_viewport_size({"width": 390, "height": 800})
    shown.wait_for_function("document.documentElement.scrollWidth <= 390")
    values = shown.locator(".words td.value").all()
    assert len(values) == 9
    for value in values:
        box = value.bounding_box()
        assert 0.0 <= box["x"] <= box["x"] + box["width"] <= 390.0
        assert value.evaluate("(cell) => cell.scrollWidth <= cell.clientWidth")


@pytest.mark.parametrize("target", ["pid-compact", "esphome", "simple-pid", "fb41"])
def test_no_word_stands_on_another_nor_beyond_the_page(target, browser, tmp_path, documents):
    fitted = model_by_hand(HEATER)
    proof = chain.prove(chain.encode(DESIGN, target), fitted, setpoint_degC=40.0)
    log = Log(name="own", source="own", **{name: documents["log"][name] for name in ("time_s", "temperature_degC")})
    page = tmp_path / "report.html"
    page.write_text(render(dossier(log, fitted, DESIGN, proof, {"words.txt": b""})), encoding="utf-8")
    with browser.new_context(viewport={"width": 1280, "height": 720}, offline=True) as context:
        shown = context.new_page()
        shown.goto(page.as_uri())
        room = [table.evaluate("one => [one.scrollWidth, one.offsetWidth, one.parentElement.clientWidth / (one.parentElement"
                               ".className == 'two' ? 2 : 1)]") for table in shown.locator("table.words").all()]
    assert room
    assert all(wide <= drawn <= most for wide, drawn, most in room), room


def test_it_prints_on_eight_pages_of_a4_with_nothing_cut(shown):
    for width in (1280, 768, 480):
        shown.set_viewport_size({"width": width, "height": 900})
        # a picture draws itself anew once the page has its width
        shown.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=width)
    printed = shown.pdf(prefer_css_page_size=True, outline=True, tagged=True)
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 8
    _no_heading_stands_at_the_foot_of_a_page(printed, shown.locator("h1, h2, h3").count())
    assert re.findall(rb"/MediaBox \[0 0 (\d+)", printed)[0] in (b"594", b"595"), "A4 is 210 mm, 595 points wide"

    shown.emulate_media(media="print")
    shown.set_viewport_size(A4)
    boxes = shown.evaluate("""() => [...document.querySelectorAll('body *')].filter((e) => e.checkVisibility())
        .map((e) => [e.tagName, e.getBoundingClientRect().right, e.getBoundingClientRect().height])""")
    assert [box for box in boxes if box[1] > A4["width"] + 1] == []
    whole = {"svg", "FIGURE", "TR", "LI", "H2", "H3"}  # what is never broken has to fit on one page
    assert [box for box in boxes if box[0] in whole and box[2] > A4["height"]] == []
    assert shown.locator(".live:visible").count() == 0, "on paper the SVG stands for the canvas"
    assert shown.locator("figure > svg:visible").count() == 5


def test_axe_finds_nothing_in_the_report_on_any_screen(shown):
    shown.evaluate("() => { for (const folded of document.querySelectorAll('details')) folded.open = true; }")
    for width in (1280, 768, 390):
        shown.set_viewport_size({"width": width, "height": 900})
        shown.wait_for_timeout(200)
        demand_accessible(shown)
        assert shown.evaluate("document.documentElement.scrollWidth") <= width
