"""The figures of `python -m tests.house.measure`, on a source whose figures can be counted by eye."""

import ast

from tests.house.measure import complexity, modules, table

FIRST = '''"""Text is no code."""

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pkg.part.second import Shape  # a circle, though for types alone


class Shape:
    # a remark
    told: dict[str, Any] = {}


def found(each):
    """Text."""
    from pkg import other
    return [a for a in each if a and a > 1 or a is None] if each else json.dumps(other)
'''


def test_a_source_is_measured_as_counted_by_eye(tmp_path):
    package = tmp_path / "pkg"
    (package / "part").mkdir(parents=True)
    (package / "first.py").write_text(FIRST)
    (package / "other.py").write_text("")
    (package / "part" / "second.py").write_text("from pkg.first import found\n\n\nclass Shape:\n    pass\n")
    (package / "part" / "first.py").write_text("")
    figures, behind = table(modules(package), [])
    assert figures["code lines in src"] == 1 + 2 + 2 + 2
    assert figures["functions"] == 1
    assert figures["classes"] == 2
    assert behind["import circles"] == [["pkg.first", "pkg.part.second"]]
    assert behind["class names in several files"] == {"Shape": ["pkg.first", "pkg.part.second"]}
    assert behind["file stems in several folders"] == {"first": ["pkg.first", "pkg.part.first"]}
    assert behind["participles and pronouns"] == {"other": 1, "told": 1, "found": 1}
    assert figures["parameters that are participles or pronouns"] == 1
    assert figures["imports inside functions"] == 1
    assert figures["dict[str, Any] and Mapping[str, Any]"] == 1
    assert figures["functions of complexity > 8"] == 0


def test_complexity_counts_branches_loops_and_logical_operators():
    function = ast.parse(FIRST).body[-1]
    assert complexity(function) == 1 + 1 + 1 + 2, "a conditional expression, a comprehension, `and` and `or`"
