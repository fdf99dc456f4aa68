"""What the studio shows is what it gives, in every window and at every moment: its own server, Chromium and Playwright."""

import contextlib
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
from tests.bench.documents import DESIGN, HEATER, write_all

from heatertune.codec import to_json
from heatertune.model.model_values import model_by_hand
from heatertune.pid.design_document import to_document

PROVEN = """() => !document.documentElement.hasAttribute('data-stale')
  && /^(PASS|FAIL|NOT PROVEN)/.test(document.querySelector('[data-field=verdict]').textContent)"""
#: every 50 ms, in one breath: the controller that is chosen, whether the page is grey, the banner, and what it shows words of
WATCH = """() => { window.seen = []; const look = () => window.seen.push([
  document.querySelector('input[aria-label=Controller]').value, document.documentElement.hasAttribute('data-stale'),
  document.querySelector('[data-field=verdict]').textContent, document.querySelector('[data-field=words]').textContent]);
  look(); window.watching = setInterval(look, 50); }"""
#: moves the slider as a hand does and tells whether the page is grey when that event is done
MOVED = """(value) => { const slider = document.querySelector('input[data-field=ms]'); slider.value = value;
  slider.dispatchEvent(new Event('input', {bubbles: true}));
  return document.documentElement.hasAttribute('data-stale'); }"""

#: whether the server has heard of every move; what a page has not sent by then is gone with it when it is loaded again
HEARD = "() => studio.heard >= studio.moves"

pytestmark = pytest.mark.long


@contextlib.contextmanager
def studio(*source):
    environment = dict(os.environ)
    environment.pop("PYTEST_CURRENT_TEST", None)  # NiceGUI would start its own test server where it sees this
    with subprocess.Popen([sys.executable, "-m", "heatertune", "studio", *source, "--no-browser"], text=True,
                          stdout=subprocess.PIPE, env=environment) as server:
        try:
            yield server.stdout.readline().split(": ")[1].strip()
        finally:
            server.terminate()


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The address of a studio with a heater that is known: no fit is waited for, and no log bounds its setpoints."""
    folder = tmp_path_factory.mktemp("design")
    write_all(folder)
    (folder / "bare.json").replace(folder / "model.json")
    (folder / "pid.json").write_text(to_json(to_document(DESIGN, model_by_hand(HEATER))), encoding="utf-8")
    with studio(str(folder)) as found:
        yield found


@pytest.fixture
def context(browser):
    with browser.new_context(viewport={"width": 1280, "height": 900}) as found:
        yield found


@pytest.fixture
def windows(context, address):
    """Two windows of one user."""
    pages = context.new_page(), context.new_page()
    for page in pages:
        page.goto(address)
        proven(page)
    return pages


def proven(page):
    page.wait_for_function(PROVEN, timeout=120_000, polling=50)  # a window behind another draws no frames to poll at


def at(page, value):
    """Wait until the slider stands there: a page that is loaded puts it there after what is written."""
    page.wait_for_function("(value) => Number(document.querySelector('input[data-field=ms]').value) === value", arg=value,
                           timeout=120_000, polling=50)


def words_of(page):
    return page.locator("[data-field=words] table").first.inner_text()


def verdict_of(page):
    return page.locator("[data-field=verdict]").inner_text()


def downloaded(page):
    page.bring_to_front()
    with page.expect_download() as told:
        page.get_by_role("button", name="Download words (zip)").click()
    with zipfile.ZipFile(io.BytesIO(Path(told.value.path()).read_bytes())) as archive:
        return json.loads(archive.read("data/words.json")), json.loads(archive.read("data/proof.json"))


def choose(page, target):
    page.bring_to_front()
    page.get_by_role("combobox", name="Controller").click()
    page.get_by_role("option", name=target, exact=True).click()


def test_what_is_moved_in_one_window_is_seen_in_both_and_is_what_the_zip_of_each_holds(windows):
    one, other = windows
    before = words_of(one)
    assert one.evaluate(MOVED, 1.4), "grey within the event"
    at(other, 1.4)
    for page in windows:
        proven(page)
    assert words_of(one) == words_of(other) != before
    assert verdict_of(one) == verdict_of(other)
    for page in windows:
        words, proof = downloaded(page)
        for name in ("K", "TI"):
            assert re.search(rf"\t{name}\tKF\tKF \+0*{words['words'][name]}(Copy)?\t", words_of(page)), name
        assert verdict_of(page).startswith(proof["verdict"])


def test_no_verdict_stands_ungreyed_beside_settings_it_was_not_found_for(windows):
    for page in windows:
        page.evaluate(WATCH)
    for target, word in (("fb41", "GAIN"), ("s5-ob251", "DW")):
        choose(windows[0], target)
        for page in windows:
            page.wait_for_function(f"() => document.querySelector('[data-field=words]').textContent.includes('{word}')",
                                   timeout=120_000, polling=50)
            proven(page)
    for page in windows:
        seen = page.evaluate("() => { clearInterval(window.watching); return window.seen; }")
        assert len(seen) > 5
        assert any(grey for _, grey, *_ in seen)
        for target, grey, verdict, words in seen:
            assert grey or (verdict.startswith(("PASS", "FAIL")) and ("GAIN" in words) == (target == "fb41"))


def test_a_download_whose_design_has_changed_meanwhile_is_refused(windows):
    one, _ = windows
    one.bring_to_front()
    # as if the answer to another window's move were still on its way
    one.evaluate("() => { document.querySelector('[data-number]').dataset.number = 0; }")
    one.get_by_role("button", name="Download words (zip)").click()
    one.get_by_text("the design changed meanwhile: look at it and try again").wait_for()


def test_a_page_that_is_loaded_again_goes_on_where_it_was_and_its_address_holds_no_secret(windows):
    one, other = windows
    one.evaluate(MOVED, 1.7)
    one.wait_for_function(HEARD)
    one.reload()
    proven(one)
    proven(other)
    at(one, 1.7)
    assert words_of(one) == words_of(other)
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", one.url)
    assert "no-referrer" in one.evaluate("() => fetch('/').then(answer => answer.headers.get('referrer-policy'))")


def test_an_upload_of_sixty_megabytes_by_a_script_with_the_cookie_is_refused(windows, address):
    one, _ = windows
    url = one.evaluate("() => JSON.stringify([...document.scripts].map(s => s.textContent)).match(/_nicegui.client.[^\"]*?upload.\\d+/)[0]")
    (cookie,) = [each for each in one.context.cookies() if each["name"].startswith("heatertune_studio_")]
    asked = urllib.request.Request(address.split("?")[0] + url.replace("\\", ""), method="POST", data=bytes(60_000_000), headers={
        "Cookie": f"{cookie['name']}={cookie['value']}", "Content-Type": "multipart/form-data; boundary=x"})
    with pytest.raises(urllib.error.URLError) as refused:  # or it hangs up before all was sent
        urllib.request.urlopen(asked)
    assert getattr(refused.value, "code", 413) == 413
    assert isinstance(refused.value, urllib.error.HTTPError) or isinstance(refused.value.reason, ConnectionError)
    proven(one)
