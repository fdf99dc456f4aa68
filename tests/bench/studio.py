"""How fast the studio answers: `python tests/bench/studio.py [--moves N] [--drag]`, in Debian's Chromium, on the paper's table 4.

From the event of a slider that is moved to the frame in which the loop's picture has changed, as the browser itself
clocks it; and from asking for the page to its first picture. Beside it, on the same settings and in this process: what
the first look at the loop takes, so that server and browser can be told apart. It reports and never fails.
"""

import argparse
import itertools
import os
import statistics
import subprocess
import sys
import tempfile
import time

from playwright.sync_api import sync_playwright

from heatertune.compiled import decide
from heatertune.studio.loop import first_look
from heatertune.studio.session import Session
from heatertune.studio.settings import SLIDERS, sliders_for
from heatertune.studio.sources import fit_log, read_source

CHROMIUM = "/usr/bin/chromium"
PROVEN = "document.querySelector('[data-field=verdict]')?.textContent.match(/^(PASS|FAIL)/)"
#: sets a slider as a hand does and tells after how many milliseconds the loop's chart had changed on the screen
MOVE = """([field, value]) => new Promise((told, failed) => {
  const slider = document.querySelector(`input[data-field=${field}]`);
  const chart = document.querySelector('[aria-label^="Temperature of the proven loop"]');
  const begun = performance.now();
  const seen = new MutationObserver(() => { seen.disconnect();
    requestAnimationFrame(() => setTimeout(() => told(performance.now() - begun))); });
  seen.observe(chart, {childList: true, subtree: true, attributes: true});
  setTimeout(() => { seen.disconnect(); told(null); }, 3000);
  slider.value = value;
  slider.dispatchEvent(new Event('input', {bubbles: true}));
})"""
#: milliseconds from the navigation to the first line drawn in a chart
FIRST = """() => new Promise((told) => { const look = () => document.querySelector('[role=img] svg path[stroke]')
    ? told(performance.now()) : requestAnimationFrame(look); look(); })"""


def moves(session, count):
    """Return slider and value of so many moves, round robin over the sliders and to and fro over each one's middle."""
    spots = (0.35, 0.6, 0.45, 0.7, 0.5, 0.65, 0.4, 0.55)
    placed = []
    for turn in range(count):
        for slider in sliders_for(session.fitted):
            low, high = slider.low, slider.high
            if slider.field in ("sample_time_s", "pwm_period_s"):
                low, high = 1.0, low + 0.3 * (high - low)
            if slider.field == "noise_degC":
                high = 0.5
            value = low + spots[turn % len(spots)] * (high - low) + 0.001 * (turn // len(spots))
            placed.append((slider.field, round(low + round((value - low) / slider.step) * slider.step, 6)))
    return placed


def beside(session, placed):
    """Return the milliseconds that the first look takes on the settings of each move, by slider."""
    told = {}
    for field, value in placed:
        session.change(**{field: value})
        begun = time.perf_counter()
        try:
            session.look_done(session.ticket, first_look(session.fitted, session.settings, session.gains()))
        except ValueError:
            continue
        told.setdefault(field, []).append(1e3 * (time.perf_counter() - begun))
    return told


def in_browser(page, placed, *, pause_s):
    """Return the milliseconds of each move by slider; None where the picture did not change."""
    told = {}
    for field, value in placed:
        told.setdefault(field, []).append(page.evaluate(MOVE, [field, value]))
        page.wait_for_timeout(1e3 * pause_s)
    return told


def row(name, times, server):
    """Return a line of the table."""
    seen = sorted(each for each in times if each is not None)
    if not seen:
        return f"{name:20} {0:3} moves drew nothing new"
    late = sum(each > 100.0 for each in seen)
    alone = f"{statistics.median(server):6.0f} {max(server):6.0f}" if server else ""
    return (f"{name:20} {len(seen):3} {statistics.median(seen):7.0f} {seen[int(0.95 * (len(seen) - 1))]:7.0f} {seen[-1]:7.0f} "
            f"{late:8} {alone}")


def report(page, session, settings):
    placed = moves(session, settings.moves)
    page.wait_for_function(PROVEN, timeout=120_000)
    page.wait_for_timeout(1e3 * settings.warm)  # the compiler works beside the page, once for each version
    in_browser(page, placed[: len(SLIDERS)], pause_s=1.0)  # first loads, first proof
    page.wait_for_function(PROVEN, timeout=120_000)
    told = in_browser(page, placed[len(SLIDERS) :], pause_s=0.05 if settings.drag else 1.0)
    decide(True)
    server = beside(session, placed)
    print("ms from slider to picture                                    first look alone")
    print(f"{'slider':20} {'n':>3} {'median':>7} {'95 %':>7} {'worst':>7} {'> 100 ms':>8} {'median':>6} {'worst':>6}")
    for field in told:
        print(row(field, told[field], server.get(field, [])[1:]))
    print(row("all", list(itertools.chain(*told.values())), list(itertools.chain(*server.values()))))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moves", type=int, default=8, help="moves of each slider, the first to warm up (default 8)")
    parser.add_argument("--drag", action="store_true", help="move on at once, while the proof of the last move runs")
    parser.add_argument("--warm", type=float, default=5.0, metavar="S",
                        help="seconds to wait for the compiler beside the page (default 5; without a cache 60)")
    settings = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        environment = {"HEATERTUNE_CACHE": folder} | os.environ
        log, session = read_source("table4").log, Session()
        session.load(read_source("table4"))
        session.fit_done(session.begin(log), fit_log(log, lambda _: None))
        with subprocess.Popen([sys.executable, "-m", "heatertune", "studio", "table4", "--no-browser"],
                              stdout=subprocess.PIPE, text=True, env=environment) as server, sync_playwright() as driver:
            try:
                address = server.stdout.readline().split(": ")[1].strip()
                browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
                page = browser.new_page(viewport={"width": 1280, "height": 720})
                page.goto(address)
                page.wait_for_function(PROVEN, timeout=120_000)
                for turn in ("first", "second"):
                    page.goto(address)
                    print(f"page to first picture, {turn} time: {page.evaluate(FIRST):.0f} ms")
                report(page, session, settings)
                browser.close()
            finally:
                server.terminate()


if __name__ == "__main__":
    main()
