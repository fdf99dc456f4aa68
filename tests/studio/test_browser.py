"""The studio as a user meets it: a server of its own, and Debian's Chromium driven by Playwright."""

import io
import json
import math
import os
import re
import subprocess
import sys
import urllib.error
import urllib.request
import zipfile
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.accessible import demand_accessible
from tests.studio.conftest import MALFORMED
from tests.zones.networks import chain, logged, steps

from heatertune import virtual_plc
from heatertune.plc import TARGETS
from heatertune.report.html import text_of
from heatertune.studio import views
from heatertune.studio.loop_settings import StudioSettings, _quick, first_look

FACTS = {"sample_time_s": "21", "pwm_period_s": "7", "setpoint_degC": "51,5", "low_degC": "-50", "high_degC": "150",
         "noise_degC": "0,1"}
PROVEN = "document.querySelector('[data-field=verdict]')?.textContent.match(/^(PASS|FAIL|NOT PROVEN)/)"
WIDTHS = (1280, 768, 390)
#: values that are cut off, wrapped or out of the window: [text, what is wrong]
CUT = """() => [...document.querySelectorAll('td, th, code, .typed, .sentence, select, .read-column b')].filter(
  e => e.offsetParent && (e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== 'inline'
    || e.getBoundingClientRect().right > innerWidth + 1
    || (e.matches('code') && e.getClientRects().length > 1))).map(e => e.textContent)"""
SMALL = """() => [...document.querySelectorAll('button, select, summary, .card input, [role=checkbox], [role=combobox]')].filter(
  e => { const box = (e.closest('label') || e).getBoundingClientRect();
    return e.offsetParent && (box.height < 24 || box.width < 24); }).map(e => e.outerHTML.slice(0, 90))"""

pytestmark = pytest.mark.long


@contextmanager
def started():
    """A studio of its own: its process, and the address that it prints."""
    environment = dict(os.environ)
    environment.pop("PYTEST_CURRENT_TEST", None)  # NiceGUI would start its own test server where it sees this
    with subprocess.Popen([sys.executable, "-m", "heatertune", "studio", "--no-browser"], stdout=subprocess.PIPE,
                          text=True, env=environment) as server:
        try:
            said = server.stdout.readline()
            assert re.fullmatch(r"heatertune studio: http://127\.0\.0\.1:\d+/\?token=[\w-]{43}\n", said)
            yield server, said.split(": ")[1].strip()
        finally:
            server.terminate()


@pytest.fixture(scope="module")
def address():
    """The address a started studio prints."""
    with started() as (_, said):
        yield said


def status(url, **headers):
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())  # the token becomes a cookie
    try:
        with browser.open(urllib.request.Request(url, headers=headers)) as answer:
            return answer.status
    except urllib.error.HTTPError as refused:
        refused.close()
        return refused.code


def test_the_real_server_answers_403_without_the_token(address):
    bare = address.split("?")[0]
    assert status(address) == 200
    assert status(bare) == 403
    assert status(f"{bare}?token=wrong") == 403
    assert status(f"{bare}_nicegui_ws/socket.io/?EIO=4&transport=polling") == 403
    assert status(f"{bare}docs") == 403
    assert status(address, Host="evil.example") == 403
    assert status(address, Origin="http://evil.example") == 403


@pytest.fixture
def page(browser, address):
    """A page that fails the test for a complaint of the console or a request that leaves this machine."""
    complaints, here = [], address.split("?")[0]
    with browser.new_context(viewport={"width": 1280, "height": 720}, permissions=["clipboard-read", "clipboard-write"]) as context:
        found = context.new_page()
        found.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
        found.on("pageerror", lambda problem: complaints.append(str(problem)))
        found.on("request", lambda asked: None if asked.url.startswith((here, "data:", "blob:")) else complaints.append(asked.url))
        found.on("filechooser", lambda _: None)  # from here on: one asked for at the time may come after the key that opens it
        found.goto(address)
        yield found
    assert complaints == []


DROP = """([name, content]) => { const data = new DataTransfer();
    data.items.add(new File([content], name, {type: 'text/csv'}));
    document.body.dispatchEvent(new DragEvent('drop', {dataTransfer: data, bubbles: true, cancelable: true})); }"""


def drop(page, name, content):
    """Let a file fall onto the page."""
    page.evaluate(DROP, [name, content.decode()])
    page.get_by_role("heading", name=f"The file as read: {name}").wait_for()


def drop_before_it_is_connected(page, name, content):
    """The same as soon as there is a page, before it has talked with the server."""
    fall = f"({DROP})({json.dumps([name, content.decode()])})"
    page.add_init_script(f"document.addEventListener('DOMContentLoaded', () => {fall}, {{once: true}})")
    page.reload()
    page.get_by_role("heading", name=f"The file as read: {name}").wait_for()


def words_of(page):
    return page.locator("[data-field=words]").inner_text()


def demand_whole(page):
    """Nothing is wider than the window, no value cut off, no target too small, and no option of the command line."""
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(CUT) == [], width
        assert page.evaluate(SMALL) == [], width
    page.set_viewport_size({"width": 1280, "height": 720})
    assert not re.search(r"--[a-z]", page.locator("body").inner_text())


@pytest.mark.essential
@pytest.mark.long(seconds=60)
def test_a_user_gets_from_a_dropped_file_to_downloaded_words(page, step_log):
    demand_accessible(page)
    _the_keyboard_opens_the_upload_and_the_radios_are_one_stop(page)
    _sheet_is_read_changed_and_used(page, step_log)
    page.wait_for_function(PROVEN, timeout=120_000)
    assert "oven: 300 readings" in page.locator("header").inner_text()
    for field, typed in FACTS.items():
        _typed(page, field, typed)
    _slide(page)
    page.get_by_role("radio", name="PID").click()  # too much gain for OB251, whose K goes to 1500 beside a D part
    page.get_by_role("alert").filter(has_text=re.compile(r"error: word K would be \d+, allowed 1…1500")).wait_for()
    page.get_by_role("radio", name="PI", exact=True).click()
    page.wait_for_function(PROVEN, timeout=60_000)
    _malformed_file_is_told_in_place(page)
    page.get_by_role("button", name="Keep this design").click()
    page.get_by_text("design A", exact=True).first.wait_for()
    _picture_has_all_runs_a_crosshair_and_a_zoom(page)
    _words_are_copied(page)
    _heaters_are_drawn(page)
    _trace_is_held_against_the_design(page)
    demand_whole(page)
    demand_accessible(page)
    page.emulate_media(color_scheme="dark")
    page.locator("body.body--dark").wait_for()
    demand_accessible(page)
    force = page.get_by_role("checkbox", name="export even if the verdict is not PASS")
    if force.is_visible():
        force.click()
    with page.expect_download() as told:
        page.get_by_role("button", name="Download words (zip)").click()
    assert told.value.suggested_filename == "oven-s5-ob251.zip"
    _zip_holds_the_words_on_the_page(page, Path(told.value.path()).read_bytes())


def _the_keyboard_opens_the_upload_and_the_radios_are_one_stop(page):
    reached, unseen = [], []
    page.get_by_role("button", name="Use the paper's table 4").focus()
    page.keyboard.press("Shift+Tab")
    for _ in range(30):
        page.keyboard.press("Tab")
        name, outline = page.evaluate("""() => { const e = document.activeElement;
            const label = e.getAttribute('aria-label') || (e.labels && e.labels[0] && e.labels[0].textContent)
              || e.textContent.trim();
            const seen = [e, e.closest('.q-field__control')].some(x => { const s = x && getComputedStyle(x);
              return s && (s.outlineStyle !== 'none' && parseFloat(s.outlineWidth) >= 2 || / 5px/.test(s.boxShadow)); });
            return [e === document.body ? null : label, seen]; }""")
        if name is not None:
            reached.append(name)
            unseen += [] if outline else [name]
    assert "" not in reached
    assert unseen == []
    assert len([name for name in dict.fromkeys(reached) if name in ("P", "PI", "PID")]) == 1
    assert len(set(reached)) >= 12
    page.get_by_role("button", name="choose a file").focus()
    with page.expect_file_chooser():
        page.keyboard.press("Enter")


def _sheet_is_read_changed_and_used(page, step_log):
    drop(page, "oven.csv", step_log.replace(b"time_s,temperature_degC,power_pct", b"a title\nZeit;Ist;Stellgrad")
         .replace(b",", b";").replace(b".", b","))
    card = page.locator(".sheet")
    roles = card.get_by_label(re.compile("^role of column"))
    assert [roles.nth(k).input_value() for k in range(3)] == ["time", "temperature", "power"]
    assert "300 readings every 5 s, 20 to 38 °C" in card.inner_text()
    assert "Decimal commas were read as points." in card.inner_text()
    roles.nth(2).focus()
    roles.nth(2).select_option("ignored")
    card.get_by_label("constant power in percent, if known").wait_for()
    page.wait_for_function("e => e === document.activeElement", arg=roles.nth(2).element_handle())  # the keyboard keeps its place
    roles.nth(2).select_option("power")
    full = card.get_by_label("reading at full power")
    full.fill("20")
    full.press("Enter")
    card.get_by_role("alert").filter(has_text="power out of range").wait_for()
    assert card.get_by_role("button", name="Use this log").is_disabled()
    demand_accessible(page)
    demand_whole(page)
    full.fill("100")
    full.press("Enter")
    card.get_by_text("300 readings every 5 s").wait_for()
    _part_is_chosen_by_a_drag(page, card)
    card.get_by_role("button", name="Use this log").click()


def _part_is_chosen_by_a_drag(page, card):
    picture = card.locator(".preview svg")
    picture.scroll_into_view_if_needed()
    box = picture.bounding_box()
    across = [box["x"] + share * box["width"] for share in (0.25, 0.75)]
    down = box["y"] + 0.5 * box["height"]
    page.mouse.move(across[1], down)  # from right to left, too
    page.mouse.down()
    page.mouse.move(across[0], down)
    page.mouse.up()
    card.get_by_text(re.compile(r"\d+ of them, from 37\d(\.\d)? to 112\d s, are fitted")).wait_for()
    assert card.get_by_label("first instant that is fitted in s").input_value().startswith("37")
    picture.click()
    card.get_by_text(re.compile("of them, from")).wait_for(state="detached")
    assert card.get_by_label("last instant that is fitted in s").input_value() == ""


def _typed(page, field, text):
    fact = page.locator(f"input[data-field={field}]")
    fact.fill(text)
    fact.press("Enter")
    page.wait_for_function("([field, text]) => document.querySelector(`input[data-field=${field}]`).value == text",
                           arg=[field, text.replace(",", ".")])


#: draws the chart right after its sketch; where both have the lines of the loop goes to `window.lines`, in pixels
BOTH_DRAWN = """() => { const sketch = studio.sketch.bind(studio); studio.sketch = (id, options) => {
  const boxes = () => [...document.querySelectorAll(`.loop-chart path[stroke="${options.series[0].lineStyle.color}"]`)]
    .map(path => path.getBoundingClientRect()).map(box => [box.left, box.top, box.right, box.bottom].map(Math.round))
    .sort((a, b) => b[2] - b[0] - a[2] + a[0]).slice(0, 2).sort((a, b) => a[1] - b[1]);  // the widest two, from above
  const same = structuredClone(options); sketch(id, options);
  const chart = document.querySelector('.loop-chart > div:not(.sketch)'); chart.style.display = 'none';
  const sketched = boxes(); chart.style.display = ''; studio.draw(id, same);
  window.lines = [sketched, boxes()]; }; }"""


def _slide(page):
    page.evaluate(BOTH_DRAWN)
    slider = page.get_by_role("slider", name="Calm to brisk: largest sensitivity Ms")
    slider.focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_function("document.querySelector('input[data-field=ms]').getAttribute('aria-valuetext') == 'Ms 1.55'")
    sketched, charted = page.wait_for_function("window.lines").json_value()
    assert np.abs(np.array(sketched) - charted).max() <= 2, "temperature and power of the sketch are the chart's"
    page.wait_for_function(PROVEN, timeout=60_000)


def _malformed_file_is_told_in_place(page):
    before, verdict = words_of(page), page.locator("[data-field=verdict]").inner_text()
    drop(page, "bad.csv", MALFORMED)
    page.get_by_role("alert").filter(has_text="error: bad.csv, line 3, column temperature_degC: no number: 'warm'").wait_for()
    assert words_of(page) == before
    assert page.locator("[data-field=verdict]").inner_text() == verdict
    page.get_by_role("button", name="Put it away").click()


def _picture_has_all_runs_a_crosshair_and_a_zoom(page):
    page.locator(".key").get_by_text(re.compile(r"all \d+ runs")).wait_for(timeout=60_000)
    assert re.match(r"(Settles in|Never settles)", page.locator("[data-field=sentence]").inner_text())
    chart = page.get_by_role("img", name="Temperature of the proven loop")
    chart.scroll_into_view_if_needed()
    chart.get_by_text("temperature [°C]").wait_for()
    labels = chart.inner_text()
    number = page.get_by_role("button", name=re.compile(r"^\d+ load -")).inner_text().split()[0]
    assert number in labels.split(), "the load step stands in the picture by its number"
    page.get_by_role("button", name="1 heat-up").click()
    page.wait_for_function("before => document.querySelector('[aria-label^=\"Temperature of the proven loop\"]').innerText != before",
                           arg=labels)
    chart.hover(position={"x": 300, "y": 120})
    chart.get_by_text(re.compile(r"nominal run: \d+\.\d °C.*requested power: \d+\.\d %")).wait_for()
    page.get_by_text("The picture in numbers").click()
    assert page.locator("#loop-numbers table").is_visible()


def _words_are_copied(page):
    page.get_by_role("button", name=re.compile("^Copy K: KF")).first.click()
    page.get_by_role("button", name=re.compile("^Copy K: KF")).first.filter(has_text="Copied").wait_for()
    assert re.fullmatch(r"KF \+\d{5}", page.evaluate("navigator.clipboard.readText()"))


def _heaters_are_drawn(page):
    page.get_by_role("button", name="Run 1,000 drawn heaters").click()
    told = page.locator("[data-field=drawn-sentence]").filter(has_text=re.compile(
        r"^(PASS|FAIL|NOT PROVEN): \d+ of 1000 samples keep every limit( under .*)?, (so|too) .*\. The worst is number \d+\.$"))
    told.wait_for(timeout=60_000)
    rows = page.locator("[data-field=drawn] tbody tr")
    assert rows.count() > 10
    assert page.locator("[data-field=drawn] th").first.inner_text() == "criterion"
    assert page.get_by_role("button", name="Run 1,000 drawn heaters").is_disabled(), "the same would come again"


def _trace_is_held_against_the_design(page):
    """20 °C for a minute, then a lag of 200 s to 51.5 °C: slower than any proven run, which has all of the power."""
    rise = [20.0 + 31.5 * (1.0 - math.exp(-max(5 * k - 60, 0) / 200.0)) for k in range(300)]
    rows = [f"{5 * k};{reading:.1f};{51.5 if k >= 12 else 0}" for k, reading in enumerate(rise)]
    trace = "\n".join(["time [s];T [°C];setpoint", *rows, ""]).encode()
    drop(page, "after.csv", trace)
    load = page.locator(".sheet").get_by_label("load came, in s")
    load.fill("5000")
    load.press("Enter")  # the button comes after the change, however fast the hand is
    page.get_by_role("button", name="Hold against the proven design").click()
    page.get_by_role("alert").filter(has_text="‘load came’ = 5000 s: after goes from 0 to 1495 s").wait_for()
    drop(page, "after.csv", trace)
    page.get_by_role("button", name="Hold against the proven design").click()
    page.locator("[data-field=left-sentence]").filter(has_text=re.compile("^NOT AS PROVEN: .*below the proven runs")).wait_for(
        timeout=60_000)
    heads = page.locator("[data-field=as-left] th").all_inner_texts()
    assert heads[:4] == ["criterion", "limit", "proven worst", "measured"]
    page.locator("[data-field=as-left] .chart").filter(has_text="temperature [°C]").wait_for()  # drawn after its table


def _zip_holds_the_words_on_the_page(page, content):
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert {"data/words.json", "data/proof.json"} < set(archive.namelist())
        words = json.loads(archive.read("data/words.json"))["words"]
        proof = json.loads(archive.read("data/proof.json"))
    lines = page.locator("[data-field=words] tbody tr").all()
    shown = {}
    for line in lines:
        name, *values = [line.locator("td").nth(1).inner_text(), *(each.inner_text() for each in line.locator("code").all())]
        value = [text for text in values if text][-1]
        shown[name] = int(value[3:].replace(" ", ""), 2) if value.startswith("KM") else int(value.removeprefix("KF "))
    assert len(shown) == 9
    span = proof["scaling"]["high_degC"] - proof["scaling"]["low_degC"]  # W is the program's; shown is that of the proof
    assert shown.pop("W") == int(2047 * (proof["scenario"]["setpoint_degC"] - proof["scaling"]["low_degC"]) / span)
    for name, value in shown.items():
        assert words[name] == value, name


@pytest.mark.long(seconds=30)
def test_a_running_loop_is_recorded_read_and_left_whole_by_a_server_that_ends(browser, heater, tmp_path):
    pytest.importorskip("snap7.client", reason="python-snap7 is not installed")
    from tests.live.conftest import CONDITIONS, words_of, write_design  # noqa: PLC0415 - skips where a library is missing

    write_design(tmp_path)
    with virtual_plc(words_of("s5-ob251"), heater, CONDITIONS, serve="s7", rate=200.0) as plc, started() as (server, here), \
            browser.new_context(viewport={"width": 1280, "height": 720}) as context:
        page, (host, port) = context.new_page(), plc.addresses["s7"]
        page.goto(here)
        page.get_by_role("button", name="Record a running loop").click()
        demand_accessible(page)
        demand_whole(page)
        page.get_by_label("Address of the PLC").fill("s7://oven")
        page.get_by_label("Log to write").fill(str(tmp_path / "one.csv"))
        page.get_by_label("Folder of its design, or map (TOML)").fill(str(tmp_path))
        page.get_by_role("button", name="Start").click()
        page.get_by_role("alert").filter(has_text="no rack and slot; expected s7://").wait_for()
        page.get_by_label("Address of the PLC").fill(f"s7://{host}:{port}/0/2/db30")
        page.get_by_role("button", name="Start").click()
        page.locator("[data-field=live-state]").filter(has_text="the PLC is only read").wait_for()
        page.locator("[data-field=live-now]").filter(has_text=re.compile(r"setpoint .*; \d\d+ rows")).wait_for()
        demand_accessible(page)
        demand_whole(page)
        page.locator(".live .chart").filter(has_text="temperature [°C]").first.wait_for()
        page.reload()  # another window, which finds it running
        page.get_by_role("button", name="Stop and read the log").click()
        page.get_by_role("heading", name="The file as read: one.csv").wait_for()
        page.locator("[data-field=live-state]").filter(has_text="Ended: ").wait_for()
        assert page.locator(".sheet").get_by_label(re.compile("^role of column")).count() == 4
        page.get_by_role("button", name="Use this log").wait_for()
        page.get_by_label("Address of the PLC").fill(f"s7://{host}:{port}/0/2/db30")
        page.get_by_label("Folder of its design, or map (TOML)").fill(str(tmp_path))
        page.get_by_label("Log to write").fill(str(tmp_path / "two.csv"))
        page.get_by_role("button", name="Start").click()
        page.locator("[data-field=live-now]").filter(has_text="rows").wait_for()
        server.terminate()
        server.wait(timeout=30)
    for name in ("one.csv", "two.csv"):
        content = (tmp_path / name).read_text()
        assert content.startswith("# heatertune record; ")
        assert content.endswith("\n")


def test_every_word_of_every_controller_stands_whole_in_its_cell(browser, heater):
    """The panels as the page has them, without a server."""
    style = Path(views.__file__).with_name("look.css").read_text(encoding="utf-8")
    look = first_look(heater, StudioSettings())
    panels = []
    for target in TARGETS:
        held = replace(look, gains=_quick(heater, StudioSettings(target=target)))
        panels.append(f'<section class="card wide"><h2>{text_of(target)}</h2>{views.words(held)}</section>')
    with browser.new_context() as context:
        page = context.new_page()
        page.set_content(f"<style>*{{box-sizing: border-box}} body{{margin:0}} {style}</style>"
                         f'<div class="studio"><div class="controls"></div><div class="results">{"".join(panels)}</div></div>')
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate(CUT) == [], width
            assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.long(seconds=90)
def test_a_log_of_two_zones_becomes_one_page_with_both(page):
    network, random = chain(2, 1.0), np.random.default_rng(1)
    time, readings, powers = logged(network, steps(2, 3600, 15.0, 60.0), 1.0, 4, random, 0.03)
    rows = [f"{t:g},{a:.2f},{b:.2f},{p:g},{q:g}" for t, (a, b), (p, q) in zip(time, readings, powers, strict=True)]
    heads = "time [s],front temperature [°C],back temperature [°C],front power [%],back power [%]"
    drop_before_it_is_connected(page, "ovens.csv", "\n".join([heads, *rows]).encode())
    demand_accessible(page)
    assert page.get_by_label("Names of the zones").input_value() == "front, back"
    page.get_by_label("Setpoints, in °C").fill("60; 55")
    page.get_by_role("button", name="Design all zones").click()
    page.get_by_text("error: setpoints 60; 55: expected numbers with commas between them, such as 180,190").wait_for()
    page.get_by_label("Setpoints, in °C").fill("60, 55")
    page.get_by_role("button", name="Design all zones").click()
    page.locator("[data-field=zones-verdict]", has_text="PASS: 2 zones together at 60, 55 °C").wait_for(timeout=120_000)
    demand_whole(page)
    demand_accessible(page)
    page.emulate_media(color_scheme="dark")
    page.locator("body.body--dark").wait_for()
    demand_accessible(page)
    with page.expect_download() as told:
        page.get_by_role("button", name="Download programs (zip)").click()
    assert {"record.html", "data/zones.json", "program_listing.txt"} <= set(zipfile.ZipFile(told.value.path()).namelist())
    page.get_by_role("region", name="Zones: heaters that belong together").get_by_role("button", name="Put it away").click()
    page.get_by_role("heading", name="Zones: heaters that belong together").wait_for(state="hidden")
