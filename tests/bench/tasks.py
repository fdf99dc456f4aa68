"""The ten tasks of docs/howto/tasks.md, done as the page says: python -m tests.bench.tasks.

Prints the rows of the page's table. Steps and keys are counted on the page itself; the seconds are elapsed, of the second time.
Commands run as processes in one folder, the cells of the notebook in one process, the clicks in Debian's Chromium.
"""

import re
import subprocess
import sys
import tempfile
import time
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import NamedTuple

from tests.docs.blocks import DOCS, blocks

PAGE = DOCS / "howto" / "tasks.md"
CHROMIUM = "/usr/bin/chromium"
PROVEN = """() => !document.documentElement.hasAttribute('data-stale')
  && /^(PASS|FAIL|NOT PROVEN)/.test(document.querySelector('[data-field=verdict]').textContent)"""
_PLACES = {"sh": "terminal", "python": "notebook"}


class Task(NamedTuple):
    """A task as the page has it; `clicks` are the steps in the studio."""

    number: int
    title: str
    place: str
    code: str
    clicks: tuple[str, ...]

    @property
    def anchor(self):
        return re.sub(r"[^a-z0-9 -]", "", self.title.lower()).replace(" ", "-")

    @property
    def steps(self):
        """Commands, cells or clicks."""
        return len(self.clicks) or (1 if self.place == "notebook" else len(self.code.splitlines()))

    @property
    def keys(self):
        """What is typed, Enter included; in the studio the arrow key of a slider."""
        return sum("arrow key" in click for click in self.clicks) if self.clicks else len(self.code)


def tasks(text):
    """Return the tasks of the page."""
    found = []
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        block = next(iter(blocks(body)), None)
        clicks = tuple(re.findall(r"^\d+\. (.*(?:\n   .*)*)", body, re.MULTILINE)) if block is None else ()
        found.append(Task(int(title.partition(".")[0]), title, "studio" if block is None else _PLACES[block.kind],
                          "" if block is None else block.code, clicks))
    return found


def row(task, seconds):
    """Return the table's row of a task."""
    return f"| [{task.title}](#{task.anchor}) | {task.place} | {task.steps} | {task.keys} | {seconds} |"


def _elapsed(do):
    begun = time.perf_counter()
    do()
    return time.perf_counter() - begun


def _command(task, folder):
    for line in task.code.splitlines():
        subprocess.run([sys.executable, "-m", *line.split()], cwd=folder, check=True, capture_output=True)


def _cell(task, folder, names):
    with chdir(folder), redirect_stdout(StringIO()):
        exec(compile(task.code, task.title, "exec"), names)


def first_parameters(page):
    """From the empty studio to the files: the clicks of the page."""
    page.get_by_role("button", name="Use the paper's table 4").click()
    page.get_by_role("button", name="Show the nearest design that passes").click(timeout=240_000)
    with page.expect_download(timeout=240_000) as download:
        page.get_by_role("button", name="Download words (zip)").click(timeout=240_000)
    assert download.value.suggested_filename == "table4-s5-ob251.zip"


def calmer_design(page):
    """Two designs side by side: the clicks of the page."""
    kept = page.get_by_text(re.compile("^design [A-D]$"))
    before = kept.count()
    page.get_by_role("button", name="Keep this design").click()
    page.get_by_role("slider", name="Calm to brisk: largest sensitivity Ms").focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_timeout(100)
    page.wait_for_function(PROVEN, timeout=240_000)
    page.get_by_role("button", name="Keep this design").click()
    page.wait_for_function("([count]) => [...document.querySelectorAll('*')].filter(e => !e.children.length && "
                           "/^design [A-D]$/.test(e.textContent.trim())).length > count", arg=[before])


def _in_studio(chosen):
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - a test of the manual counts without a browser

    with subprocess.Popen([sys.executable, "-m", "heatertune", "studio", "--no-browser"], stdout=subprocess.PIPE,
                          text=True) as server, sync_playwright() as driver:
        try:
            address = server.stdout.readline().split(": ")[1].strip()
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
            page = browser.new_context(viewport={"width": 1280, "height": 720}, accept_downloads=True).new_page()
            page.goto(address)
            return [(task, _elapsed(lambda do=do: do(page))) for task, do in chosen]
        finally:
            server.terminate()


def main():
    chosen = tasks(PAGE.read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as folder:
        for task in chosen:
            if task.place == "terminal":
                _command(task, folder)
                print(row(task, f"{_elapsed(lambda task=task: _command(task, folder)):.1f}"), flush=True)
        names = {}
        for task in chosen:
            if task.place == "notebook":
                _cell(task, Path(folder), names)
                print(row(task, f"{_elapsed(lambda task=task: _cell(task, Path(folder), names)):.1f}"), flush=True)
    studio = [(task, first_parameters if task.number == 9 else calmer_design) for task in chosen if task.place == "studio"]
    _in_studio(studio)
    for task, seconds in _in_studio(studio):
        print(row(task, f"{seconds:.1f}"))


if __name__ == "__main__":
    main()
