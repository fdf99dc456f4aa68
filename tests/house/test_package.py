"""The files around the package agree with it: citation, security, workflow, table of sizes, hashes of the lock."""

import re
import tomllib

import pytest
from tests.conftest import ROOT
from tests.docs.sizes import EXTRAS, OTHERS, PAGE, megabytes, packages

import heatertune
from heatertune.cli.command_table import COMMAND_MODULES

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_citation_names_the_newest_release():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    heading = re.search(r"## ([\d.]+) – ([\d-]+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    assert f"version: {heatertune.__version__}\n" in citation
    assert f'date-released: "{heading[2]}"' in citation
    assert heading[1] == heatertune.__version__


def test_the_classifiers_name_every_python_that_is_allowed_and_tried():
    named = {each.rpartition(" ")[2] for each in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", each)}
    assert named == {"3.11", "3.12", "3.13"}
    assert PROJECT["requires-python"] == f">={min(named)}"
    run = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert all(f"python_of {version}" in run for version in ("3.11", "3.13"))


def test_security_names_every_command_that_reaches_a_plc():
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    reaching = [name for name, module in COMMAND_MODULES.items() if module.startswith("live.commands")]
    assert [name for name in reaching if f"`{name}" not in text] == []


def test_the_workflow_of_a_public_forge_does_what_ci_does():
    assert "- run: .ci/run\n" in (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")


def test_the_table_of_sizes_has_every_extra_and_its_largest_figures_are_right():
    table = dict(re.findall(r"^\| `([\w\[\]]+)`.*\| (?:about )?(\d+) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    assert list(table) == ["heatertune", *(f"heatertune[{extra}]" for extra in EXTRAS if f"heatertune[{extra}]" in table), *OTHERS]
    assert {f"heatertune[{extra}]" for extra in EXTRAS} <= set(table)
    # other releases, other sizes: half as large again is another statement
    assert megabytes(packages(PROJECT["dependencies"])) == pytest.approx(float(table["heatertune"]), rel=0.5)


def test_every_digest_is_of_a_release_of_the_lock():
    lock = {line.lower().replace("_", "-") for line in (ROOT / "constraints" / "lock.txt").read_text(encoding="utf-8").splitlines()}
    lines = [line for line in (ROOT / "constraints" / "hashes.txt").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+ --hash=sha256:[0-9a-f]{64}", line) for line in lines)
    assert {line.partition(" ")[0] for line in lines} <= lock
    needed = {f"{name}==" for name in packages(PROJECT["dependencies"])}
    assert [each for each in needed if not any(line.startswith(each) for line in lines)] == []
