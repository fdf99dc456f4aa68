"""Two windows of the studio, moved at random: `python tests/bench/studio_windows.py [--minutes N] [--seed N]`.

Before a move, in its middle or after it one window's words and verdict are read and its download is clicked, in one
breath. What is wrong: a zip with other words or another verdict than stood beside the button, or one that left while
the page was grey. It reports, and ends with 1 where anything was wrong.
"""

import argparse
import io
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

from playwright.sync_api import TimeoutError as NoDownload
from playwright.sync_api import sync_playwright

from tests.bench.documents import write_all

CHROMIUM = "/usr/bin/chromium"
#: the words and the verdict at the very moment of the click, and whether the page is grey
CLICK = """() => { const shown = [document.querySelector('[data-field=words]').textContent,
    document.querySelector('[data-field=verdict]').textContent, document.documentElement.hasAttribute('data-stale')];
  const button = [...document.querySelectorAll('button')].find(e => e.textContent.includes('Download words'));
  if (!button.disabled) button.click(); return [...shown, button.disabled]; }"""
RESTS = "() => !document.documentElement.hasAttribute('data-stale')"
MOVE = """(value) => { const slider = document.querySelector('input[data-field=ms]'); slider.value = value;
  slider.dispatchEvent(new Event('input', {bubbles: true})); }"""


def held(shown, words):
    """Return whether whole numbers of a zip (words of OB251) all stand on the page."""
    found = dict(re.findall(r"DW\d+([A-Z]+)KFKF ([+-]\d+)", shown))
    return bool(found) and all(int(found[name]) == words[name] for name in ("K", "R", "TI", "TD"))


def attack(pages, chance, until):
    told = {"moves": 0, "downloads": 0, "refused or late": 0, "wrong": 0}
    clicked = {page: [] for page in pages}
    while time.monotonic() < until:
        mover, reader = chance.choice(pages), chance.choice(pages)
        if chance.random() < 0.8:  # else the click comes in the middle of what was moved before
            reader.wait_for_function(RESTS, polling=20, timeout=60_000)
        if chance.random() < 0.7:
            mover.evaluate(MOVE, round(chance.uniform(1.3, 1.9), 2))
            told["moves"] += 1
            reader.wait_for_timeout(chance.choice((0, 0, 5, 20, 60, 200)))
        try:
            with reader.expect_download(timeout=1500) as download:
                clicked[reader].append(reader.evaluate(CLICK))
            with zipfile.ZipFile(io.BytesIO(Path(download.value.path()).read_bytes())) as archive:
                words, proof = (json.loads(archive.read(name)) for name in ("data/words.json", "data/proof.json"))
            told["downloads"] += 1
            # on a busy machine it may be that of an earlier click
            if not any(held(shown, words["words"]) and verdict.startswith(proof["verdict"]) and not grey and not disabled
                       for shown, verdict, grey, disabled in clicked[reader][-3:]):
                told["wrong"] += 1
                print("wrong:", proof["verdict"], words["words"], clicked[reader][-3:])
        except NoDownload:
            told["refused or late"] += 1
    return told


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=1)
    settings = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        write_all(Path(folder))
        with subprocess.Popen([sys.executable, "-m", "heatertune", "studio", folder, "--no-browser"], text=True,
                              stdout=subprocess.PIPE, env=dict(os.environ)) as server, sync_playwright() as driver:
            try:
                address = server.stdout.readline().split(": ")[1].strip()
                browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
                context = browser.new_context(viewport={"width": 1280, "height": 720})
                pages = [context.new_page(), context.new_page()]
                for page in pages:
                    page.goto(address)
                    page.locator("[data-field=words] td").first.wait_for()
                told = attack(pages, random.Random(settings.seed), time.monotonic() + 60.0 * settings.minutes)
                browser.close()
            finally:
                server.terminate()
    print(told)
    return 1 if told["wrong"] else 0


if __name__ == "__main__":
    sys.exit(main())
