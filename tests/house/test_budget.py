"""What the source may hold, package by package: growth is a decision."""

import tomllib
from functools import cache
from pathlib import Path

import pytest
from tests.house.measure import ROOT, modules, table

BUDGET = tomllib.loads(Path(__file__).with_name("budget.toml").read_text(encoding="utf-8"))


@cache
def figures():
    return table(modules(ROOT / "src" / "heatertune"), [])[0]


def test_every_package_has_a_budget():
    assert {name.strip() for name in figures() if name.startswith("  ")} == set(BUDGET["code_lines"])


@pytest.mark.parametrize("package", BUDGET["code_lines"])
def test_a_package_holds_no_more_code_lines_than_its_budget(package):
    assert figures()[f"  {package}"] <= BUDGET["code_lines"][package]


@pytest.mark.parametrize("figure", BUDGET["figures"])
def test_a_figure_of_disorder_is_no_larger_than_its_limit(figure):
    assert figures()[figure] <= BUDGET["figures"][figure]
