"""The manual: its blocks run and print what it shows, its figures have a source, and its pages build and stay at home."""

import json
import re
import subprocess
import sys
from html.parser import HTMLParser

import pytest
from tests.bench.tasks import PAGE, row, tasks
from tests.conftest import ROOT
from tests.docs.blocks import DOCS, INSTALL, OVERVIEW, PAGES, blocks, differences, run
from tests.docs.pictures import PICTURES, events, said

from heatertune.cli import COMMANDS
from heatertune.cli.command_table import read_settings
from heatertune.codec import to_json
from heatertune.live.controller_block import places_in
from heatertune.model.findings import KINDS
from heatertune.model.model_document import to_document
from heatertune.plc import TARGETS
from heatertune.proof.redesign import on_samples, redesign_search
from heatertune.proof.repetition import files_of
from heatertune.proof.specification import read_spec
from heatertune.units import TERMS

RUNNING = [page for page in PAGES if page != OVERVIEW and blocks((DOCS / page).read_text(encoding="utf-8"))]
#: these need the fit of the paper's log, so they run in one process, which keeps it
PAPER = ("tutorial.md", "explain/no_power.md", "howto/tasks.md")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def kept_searches(monkeypatch):
    """A search for a design runs once for the same heater and request: the pages show it at the terminal and in Python."""
    searches, search = {}, redesign_search.closed_on_runs

    def kept(fitted, request, *, progress=str, stage=str, **named):
        assert not files_of(request.conditions), "they may change"
        key = to_json(to_document(fitted)), repr(request), repr(sorted(named.items()))
        if key not in searches:
            searches[key] = search(fitted, request, progress=progress, stage=stage, **named)
        return searches[key]

    for module in (redesign_search, on_samples):
        monkeypatch.setattr(module, "closed_on_runs", kept)


def _run_page(page):
    names = {"__name__": "__manual__"}
    for block in blocks((DOCS / page).read_text(encoding="utf-8")):
        printed = run(block, names)
        if block.output is not None:
            assert differences(block.output, printed) == [], (page, block.code, printed)


@pytest.mark.doc
@pytest.mark.long(seconds=15)
@pytest.mark.parametrize("page", [page for page in RUNNING if page not in PAPER])
def test_the_blocks_of_a_page_print_what_it_shows(page, folder):
    _run_page(page)


@pytest.mark.doc
@pytest.mark.long(seconds=20)
@pytest.mark.usefixtures("kept_searches")
def test_the_pages_on_the_papers_log_print_what_they_show(folder):
    for page in PAPER:
        _run_page(page)
    told = said(json.loads(next((folder / "out").rglob("proof.json")).read_text(encoding="utf-8")))
    for path in sorted({*PICTURES.iterdir()} - {PICTURES / "events.svg"}):
        text = path.read_text(encoding="utf-8")
        assert differences(text.partition("<desc>")[2].partition("</desc>")[0], told) == [], f"{path.name} is out of date"


@pytest.mark.doc
def test_the_picture_of_conditions_and_events_shows_the_tables_of_the_proof():
    assert (PICTURES / "events.svg").read_text(encoding="utf-8") == events()


#: page → what reads its files, where these are no specifications
READ = {"howto/live.md": places_in, "howto/terminal.md": read_settings}


def test_every_page_is_in_the_navigation_and_every_fence_is_one_that_is_looked_at(tmp_path):
    assert set(PAGES) == {str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md")}
    config = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert all(f": {page}\n" in config + "\n" for page in PAGES)
    for page in PAGES:
        text = (DOCS / page).read_text(encoding="utf-8")
        fences = re.findall(r"^[ >]*```.*$", text, re.MULTILINE)
        opened = fences[::2]
        assert set(opened) <= {"```sh", "```python", "```text", "```toml", "```ini"}, page
        for number, file in enumerate(re.findall(r"^```toml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)):
            (tmp_path / f"{number}.toml").write_text(file, encoding="utf-8")
            READ.get(page, read_spec)(tmp_path / f"{number}.toml")
        assert opened.count("```sh") + opened.count("```python") == len(blocks(text)), page
        shown = sum(block.output is not None for block in blocks(text))
        assert opened.count("```text") == shown, f"{page}: a text block that is nobody's output"


def test_only_installs_are_left_to_the_ci():
    lines = [line for page in PAGES for block in blocks((DOCS / page).read_text(encoding="utf-8"))
             if block.kind == "sh" for line in block.code.splitlines()]
    assert [line for line in lines if INSTALL.match(line)] == ["pip install ."]


FIGURE = re.compile(r"(?<![\w.-])(\d+\.\d+|\d{3,})(?![\w-])")


@pytest.mark.parametrize("page", PAGES)
def test_every_figure_in_the_text_stands_in_a_block_or_names_its_source(page):
    text = (DOCS / page).read_text(encoding="utf-8")
    known = set(FIGURE.findall("\n".join(re.findall(r"^```.*?^```$", text, re.MULTILINE | re.DOTALL))))
    prose = re.sub(r"^```.*?^```$|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL)
    if page in ("sources.md", "reference/speed.md", "reference/install_size.md", "howto/tasks.md"):
        return  # sources themselves: the others name the command that measures each row
    for part in re.split(r"\n\s*\n|\n(?=- |\| |\d\. )", prose):
        if "sources.md" not in part:
            missing = [each for each in FIGURE.findall(part) if each not in known]
            assert not missing, (page, missing, part)


def test_steps_and_keys_of_the_ten_tasks_are_those_of_their_commands_cells_and_clicks():
    text = PAGE.read_text(encoding="utf-8")
    found = tasks(text)
    assert [task.number for task in found] == list(range(1, 11))
    for task in found:
        rows = [line for line in text.splitlines() if line.startswith(row(task, "").removesuffix(" |"))]
        assert len(rows) == 1, row(task, "…")


class _Links(HTMLParser):
    """What a browser would fetch on its own to show a page, and the text of the page."""

    def __init__(self):
        super().__init__()
        self.fetched, self.words = [], []

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        if tag in ("img", "script", "iframe", "source", "video", "audio", "embed"):
            self.fetched.append(found.get("src") or "")
        if tag == "link" and found.get("rel") != "canonical":
            self.fetched.append(found.get("href") or "")

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built manual; a warning is an error."""
    place = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(place)]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return place


@pytest.mark.doc
@pytest.mark.long(seconds=15)
def test_the_manual_builds_without_a_warning_and_fetches_nothing(site):
    for path in site.rglob("*.html"):
        page = _Links()
        page.feed(path.read_text(encoding="utf-8"))
        assert not [each for each in page.fetched if re.match(r"(https?:)?//", each)], path
    for path in [*site.rglob("*.css")]:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"(url\(|@import)\s*['\"]?(https?:)?//", text), path
    assert not (site / "hooks.py").exists()


@pytest.mark.doc
@pytest.mark.long
def test_the_reference_is_what_the_program_says_of_itself(site):
    def words(name):
        page = _Links()
        page.feed((site / "reference" / name).read_text(encoding="utf-8"))
        return "".join(page.words)

    commands = words("commands.html")
    for command in COMMANDS.values():
        assert " ".join(command.example.split()) in " ".join(commands.split())
    for name in ("chain.stages.fit", "log.log_values.Log", "plc.controller.Controller", "proof.proof.Proof", "units.check"):
        page = site / "reference" / f"python_{'common' if name == 'units.check' else name.partition('.')[0]}.html"
        assert f'id="heatertune.{name}"' in page.read_text(encoding="utf-8")
    assert max(path.stat().st_size for path in site.rglob("*.html")) < 1_100_000, "a page that loads at once"
    controllers, ob251 = words("controllers.html"), words("../controllers/s5-ob251.html")
    nomenclature = (site / "reference" / "nomenclature.html").read_text(encoding="utf-8")
    assert all(f"\n{name}\n" in controllers or name in controllers for name in TARGETS)
    assert "integral_inward" in ob251, "a switch of OB251's DIFFERENCES.md"
    for term in TERMS:
        assert f'<a id="{term.anchor}"></a>{term.names[0]}' in nomenclature
        assert term.field in nomenclature
    assert "<!-- generate" not in "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.html"))


@pytest.mark.doc
@pytest.mark.long
def test_the_search_finds_short_terms_in_the_manual_opened_from_files(site, browser):
    page = browser.new_page()
    for asked, first in (("TA", "TA, "), ("TN", "TN, "), ("Ms", "Ms, "), ("plausible heater", "plausible heater")):
        page.goto(f"{(site / 'tutorial.html').as_uri()}?q={asked}")
        link = page.locator("#mkdocs-search-results a").first
        link.wait_for()
        assert link.inner_text().startswith(first)
        link.click()
        page.wait_for_url("**/nomenclature.html#*")
        assert page.locator(":target").evaluate("each => each.closest('tr').innerText").startswith(asked)


def test_the_table_of_findings_is_what_the_verdict_hears():
    page = (DOCS / "explain/verdict.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    assert rows == [f"| `{name}` | {kind.effect} | {kind.short} | {kind.remedy} |" for name, kind in KINDS.items()]
