"""The studio as a user meets it: a server of its own, and Debian's Chromium driven by Playwright."""

import io
import json
import os
import re
import subprocess
import sys
import urllib.error
import urllib.request
import zipfile
from pathlib import Path

import pytest
from tests.studio.conftest import MALFORMED

SLIDERS = ("ms", "sample_time_s", "pwm_period_s", "setpoint_degC", "low_degC", "high_degC", "noise_degC")
PROVEN = "document.querySelector('[data-field=verdict]')?.textContent.match(/^(PASS|FAIL)/)"

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The address a started studio prints."""
    environment = dict(os.environ)
    environment.pop("PYTEST_CURRENT_TEST", None)  # NiceGUI would start its own test server where it sees this
    with subprocess.Popen([sys.executable, "-m", "heatertune", "studio", "--no-browser"], stdout=subprocess.PIPE,
                          text=True, env=environment) as server:
        try:
            said = server.stdout.readline()
            assert re.fullmatch(r"heatertune studio: http://127\.0\.0\.1:\d+/\?token=[\w-]{43}\n", said)
            yield said.split(": ")[1].strip()
        finally:
            server.terminate()


def status(url, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
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
    with browser.new_context(viewport={"width": 1280, "height": 720}) as context:
        found = context.new_page()
        found.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
        found.on("pageerror", lambda problem: complaints.append(str(problem)))
        found.on("request", lambda asked: None if asked.url.startswith((here, "data:", "blob:")) else complaints.append(asked.url))
        found.goto(address)
        yield found
    assert complaints == []


def drop(page, name, content):
    page.set_input_files(".q-uploader input[type=file]", {"name": name, "mimeType": "text/csv", "buffer": content})


def words_of(page):
    return page.locator("[data-field=words]").inner_text()


def test_a_user_gets_from_a_dropped_file_to_downloaded_words(page, step_log):
    drop(page, "oven.csv", step_log)
    page.wait_for_function(PROVEN, timeout=120_000)
    assert "oven: 300 readings" in page.locator("header").inner_text()
    assert words_of(page).splitlines()[1].startswith("address")
    for field in SLIDERS:
        _move_by_keyboard(page, field)
    page.get_by_role("radio", name="PID").click()  # too much gain for OB251, whose K goes to 1500 beside a D part
    page.get_by_role("alert").filter(has_text=re.compile(r"error: word K would be \d+, allowed 1…1500")).wait_for()
    assert page.locator("[data-field=verdict]").inner_text() == "No design for these settings; what is seen is the last one."
    page.get_by_role("radio", name="PI", exact=True).click()
    page.wait_for_function(PROVEN, timeout=60_000)
    _malformed_file_is_told_in_place(page)
    page.get_by_role("button", name="Keep this design").click()
    page.get_by_text("design A", exact=True).wait_for()
    force = page.get_by_role("checkbox", name="export whatever the verdict")
    if force.is_visible():
        force.click()
    with page.expect_download() as told:
        page.get_by_role("button", name="Download words (zip)").click()
    assert told.value.suggested_filename == "oven-s5-ob251.zip"
    _zip_holds_the_words_on_the_page(page, Path(told.value.path()).read_bytes())
    page.set_viewport_size({"width": 768, "height": 1024})
    assert page.evaluate("document.documentElement.scrollWidth") <= 768


def _move_by_keyboard(page, field):
    slider = page.locator(f"input[data-field={field}]")
    assert slider.get_attribute("aria-label")
    before, told = float(slider.input_value()), slider.get_attribute("aria-valuetext")
    slider.focus()
    page.keyboard.press("ArrowRight" if before < float(slider.get_attribute("max")) else "ArrowLeft")
    page.wait_for_function("([field, told]) => document.querySelector(`input[data-field=${field}]`).getAttribute('aria-valuetext') != told",
                           arg=[field, told])
    assert abs(float(slider.input_value()) - before) == pytest.approx(float(slider.get_attribute("step")))
    page.wait_for_function(PROVEN, timeout=60_000)


def _malformed_file_is_told_in_place(page):
    before, verdict = words_of(page), page.locator("[data-field=verdict]").inner_text()
    drop(page, "bad.csv", MALFORMED)
    error = page.get_by_role("alert").filter(has_text="error: bad.csv, line 3, column temperature_degC: no number: 'warm'")
    error.wait_for()
    assert words_of(page) == before
    assert page.locator("[data-field=verdict]").inner_text() == verdict


def _zip_holds_the_words_on_the_page(page, content):
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert {"words.json", "proof.json"} < set(archive.namelist())
        text = archive.read("words.json").decode()
        proof = json.loads(archive.read("proof.json"))
    lines = re.findall(r"^DW\d+\t(\w+)\t([^\t]*)\t([^\t]*)\t", words_of(page), flags=re.MULTILINE)
    shown = {name: int(bits.replace(" ", ""), 2) if (bits := then.removeprefix("KM ")) != then else then or first
             for name, first, then in lines}
    assert len(shown) == 9
    span = proof["scaling"]["high_degC"] - proof["scaling"]["low_degC"]  # W is the program's; shown is that of the proof
    assert int(shown.pop("W")) == int(2047 * (proof["scenario"]["setpoint_degC"] - proof["scaling"]["low_degC"]) / span)
    for name, value in shown.items():
        assert re.search(rf'"{name}": {value}\b', text), name


def test_everything_that_can_be_reached_by_the_keyboard_has_a_name(page):
    page.get_by_role("button", name="Use the paper's table 4").wait_for()
    reached = []
    for _ in range(40):
        page.keyboard.press("Tab")
        found = page.evaluate("""() => { const e = document.activeElement;
            return e === document.body ? null : [e.tagName, e.getAttribute('aria-label') || e.textContent.trim()
            || (e.labels && e.labels[0] && e.labels[0].textContent) || '']; }""")
        if found is not None:
            reached.append(found)
    nameless = [tag for tag, name in reached if not name]
    assert nameless == []
    assert len({name for _, name in reached}) >= 12
