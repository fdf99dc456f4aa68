"""Comparisons of readings are written as what is good: a value that is no number fails each of them, and must not pass.

`if degC > limit: bad` lets NaN pass; `if not degC <= limit: bad` does not. Where a quantity that a PLC shows is compared so that
NaN ends on the good side, this test fails.
"""

import ast
from pathlib import Path

import pytest

import heatertune

SOURCE = Path(heatertune.__file__).parent
#: what is read from a running loop, or made of it, as it is called where it is judged
READINGS = {"degC", "seen", "reading", "rate", "used", "measured", "power_pct", "asked", "found_degC", "temperature", "moved"}
FILES = sorted([*SOURCE.glob("live/**/*.py"), *SOURCE.glob("proof/as_left*.py"), *SOURCE.glob("supervision/monitor.py")])


def named(node):
    """Return the name that a comparison's side is, or is of."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "abs" and node.args:
        return named(node.args[0])
    if isinstance(node, ast.BinOp):
        return named(node.left) or named(node.right)
    name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
    return name if name in READINGS else ""


def is_bare(test):
    """Return whether a condition is an order of a reading that is not denied, or has one in it that decides."""
    if isinstance(test, ast.BoolOp):
        return any(map(is_bare, test.values))
    if not isinstance(test, ast.Compare):
        return False
    ordered = all(isinstance(op, ast.Lt | ast.LtE | ast.Gt | ast.GtE) for op in test.ops)
    return ordered and any(named(side) for side in (test.left, *test.comparators))


def ends_badly(body):
    """Return whether statements tell something bad: raise, or return or note a text."""
    for node in (inner for statement in body for inner in ast.walk(statement)):
        if isinstance(node, ast.Raise):
            return True
        if isinstance(node, ast.Return) and isinstance(node.value, ast.JoinedStr | ast.Tuple):
            return True
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("append", "_end", "_outside"):
            return True
    return False


def lenient(tree):
    """Yield function and line of each condition that NaN passes."""
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        for node in ast.walk(function):
            if isinstance(node, ast.If) and is_bare(node.test) and ends_badly(node.body):
                yield function.name, node.lineno
            if isinstance(node, ast.IfExp) and is_bare(node.test) and _is_text(node.body):
                yield function.name, node.lineno


def _is_text(node):
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str) and bool(node.value))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_no_reading_passes_for_good_because_it_is_no_number(path):
    place = path.relative_to(SOURCE).as_posix()
    found = list(lenient(ast.parse(path.read_text(encoding="utf-8"))))
    assert not found, f"{place}: NaN passes the conditions of {found}: write what is good"


@pytest.mark.parametrize(("text", "lets"), [
    ("if degC > limit:\n        raise ValueError", True), ("if not degC <= limit:\n        raise ValueError", False),
    ("if abs(rate) > limit:\n        return 'rate', f'{rate}'", True), ("if low < degC < high:\n        return ''", False),
    ("if ready and degC >= 3.0:\n        self._end('limit')", True), ("return 'bad' if used > 1.0 else ''", True),
    ("return '' if used <= 1.0 else 'bad'", False),
])
def test_the_rule_tells_both_kinds_apart(text, lets):
    assert bool(list(lenient(ast.parse(f"def judge(self):\n    {text}\n")))) == lets
