"""How fast the studio answers: `python tests/bench/studio.py [TARGET…] [--moves N]`, in Debian's Chromium, on the paper's table 4.

For each controller: from choosing it to its first verdict, and from the event of the slider that is moved to the frame
in which the loop's picture has changed, as the browser itself clocks both. Beside them, on the same settings and in
this process: what the first look at the loop and the whole proof take of the processor, so that server, browser and a
machine that has other things to do can be told apart. It reports and never fails.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time

from playwright.sync_api import sync_playwright

from heatertune.compiled import decide
from heatertune.plc import TARGETS
from heatertune.studio.loop_settings import first_look, full_proof
from heatertune.studio.session import Session, fit_log, read_source

CHROMIUM = "/usr/bin/chromium"
PROVEN = """() => !document.documentElement.hasAttribute('data-stale')
  && /^(PASS|FAIL|NOT PROVEN)/.test(document.querySelector('[data-field=verdict]').textContent)"""
#: sets the slider as a hand does and tells after how many milliseconds the loop's chart had changed on the screen
MOVE = """(value) => new Promise((told) => {
  const slider = document.querySelector('input[data-field=ms]');
  const chart = document.querySelector('[aria-label^="Temperature of the proven loop"]');
  const begun = performance.now();
  const seen = new MutationObserver(() => { seen.disconnect();
    requestAnimationFrame(() => setTimeout(() => told(performance.now() - begun))); });
  seen.observe(chart, {childList: true, subtree: true, attributes: true});
  setTimeout(() => { seen.disconnect(); told(null); }, 3000);
  slider.value = value;
  slider.dispatchEvent(new Event('input', {bubbles: true}));
})"""
#: tells after how many milliseconds from now the banner's verdict is true again
VERDICT = """() => new Promise((told) => { const begun = performance.now();
  const look = () => document.documentElement.hasAttribute('data-stale') || document.querySelector('[data-field=verdict]')
    .textContent.startsWith('Proving') ? setTimeout(look, 5) : told(performance.now() - begun); look(); })"""
#: milliseconds from the navigation to the first line drawn in a chart
FIRST = """() => new Promise((told) => { const look = () => document.querySelector('[role=img] svg path[stroke]')
    ? told(performance.now()) : requestAnimationFrame(look); look(); })"""


def spots(count):
    """Return so many places of the slider, no two of them the same."""
    return [1.3 + 0.05 * (7 * turn % 13) + 0.001 * (turn // 13) for turn in range(count)]


def beside(session, target, places):
    """Return the milliseconds of processor that each first look takes, and the whole proof of the last one."""
    looks = []
    session.change(target=target)
    for ms in places:
        session.change(ms=round(ms, 6))
        begun = time.process_time()
        look = first_look(session.fitted, session.settings)
        looks.append(1e3 * (time.process_time() - begun))
    begun = time.process_time()
    full_proof(session.fitted, look)
    return looks, 1e3 * (time.process_time() - begun)


def in_browser(page, target, places):
    """Return milliseconds to the verdict of a controller that is chosen, and of each move."""
    page.get_by_role("combobox", name="Controller").click()
    option = page.get_by_role("option", name=target, exact=True)
    option.wait_for()
    page.evaluate("() => { document.addEventListener('click', () => { window.chosen = performance.now(); }, "
                  "{capture: true, once: true}); }")
    option.click()
    page.evaluate(VERDICT)
    verdict = page.evaluate("() => performance.now() - window.chosen")
    times = []
    for ms in places:
        times.append(page.evaluate(MOVE, round(ms, 6)))
        page.wait_for_timeout(700)
    return verdict, [each for each in times if each is not None]


def report(page, session, settings):
    places = spots(settings.moves + 1)
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    print("                first verdict   slider to picture [ms]               processor alone [ms]")
    print(f"{'controller':14} {'[ms]':>14} {'n':>4} {'least':>6} {'median':>6} {'95 %':>6} {'worst':>6} {'look':>10} {'proof':>6}")
    for target in settings.targets or TARGETS:
        verdict, times = in_browser(page, target, places)
        looks, proof = beside(session, target, places)
        seen = sorted(times[1:])  # the first one loads machine code
        print(f"{target:14} {verdict:14.0f} {len(seen):4} {seen[0]:6.0f} {statistics.median(seen):6.0f} "
              f"{seen[int(0.95 * (len(seen) - 1))]:6.0f} {seen[-1]:6.0f} {statistics.median(looks[1:]):10.0f} {proof:6.0f}",
              flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="controllers (default: all)")
    parser.add_argument("--moves", type=int, default=20, help="moves of the slider for each (default 20)")
    parser.add_argument("--warm", type=float, default=5.0, metavar="S",
                        help="seconds to wait for the compiler beside the page (default 5; without a cache 60)")
    settings = parser.parse_args()
    decide(True)
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
                for turn in ("first", "second"):
                    page.goto(address)
                    page.wait_for_function(PROVEN, timeout=120_000)
                    print(f"page to first picture, {turn} time: {page.evaluate(FIRST):.0f} ms")
                page.wait_for_timeout(1e3 * settings.warm)  # the compiler works beside the page, once for each version
                report(page, session, settings)
                browser.close()
            finally:
                server.terminate()


if __name__ == "__main__":
    main()
