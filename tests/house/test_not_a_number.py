"""In `live`, a value that is not a number never counts as good.

Every comparison with NaN is false. So a refusal, an end or a complaint must not hang on `a > b`: it is written `not a <= b`. What
compares numbers that cannot be NaN (counts, times of the clock) is listed, with the reason.
"""

import ast

import pytest
from tests.house.measure import ROOT

LIVE = sorted((ROOT / "src" / "heatertune" / "live").rglob("*.py"))
_ORDER = (ast.Lt, ast.Gt, ast.LtE, ast.GtE)
#: names of whole numbers, of lengths and of times that this program has measured itself
_WHOLE = {"count", "number", "start", "port", "length", "begin", "end", "size", "tries", "rounds", "row", "rows", "at", "scans", "shown", "bit",
          "byte", "most", "least", "first", "last", "intervals", "place", "registers", "unit", "step", "left_s", "now", "now_s", "passed_s",
          "ends", "stop", "st_size", "_size", "upto"}
#: file, comparison → why no number is missing there
KNOWN = {
    ("recorder.py", "time.monotonic() > last_s"): "this machine's clock",
    ("recorder.py", "self.last_s > self._latest_s"): "read from rows that were written as numbers",
    ("experiment.py", "now_s > first_s"): "times of looks, which are counted or of this machine's clock",
    ("poller.py", "self._places.span[1] > self._client.most"): "bytes",
}


def _is_whole(node):
    """Return whether an expression is a whole number, a length, or a time of this machine's clock."""
    text = ast.unparse(node)
    if isinstance(node, ast.Constant):
        return type(node.value) is int
    if isinstance(node, ast.Call):
        return text.startswith(("len(", "int(", "time.monotonic(")) or text.endswith("now_s()") or ".count(" in text or "_size(" in text or (
            text.startswith("max(") and all(map(_is_whole, node.args)))
    if isinstance(node, ast.BinOp):
        return _is_whole(node.left) and _is_whole(node.right)
    return text.rpartition(".")[2] in _WHOLE or text.partition("[")[0].isupper()


def _complains(body):
    """Return whether statements refuse, end or complain: raise, return a text, or call what ends something."""
    for statement in body:
        for node in ast.walk(statement):
            if isinstance(node, ast.Raise) or (isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in ("end", "ended", "restore")):
                return True
            if isinstance(node, ast.Return) and any(isinstance(part, ast.JoinedStr) for part in ast.walk(node)):
                return True
    return False


def _bare(test):
    """Yield comparisons by order in a condition that are not under `not`."""
    if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
        return
    if isinstance(test, ast.Compare) and any(isinstance(op, _ORDER) for op in test.ops):
        yield test
    for part in ast.iter_child_nodes(test):
        yield from _bare(part)


def found(tree):
    """Yield comparisons that let a missing number pass."""
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and _complains(node.body) and not node.orelse:
            for compare in _bare(node.test):
                if not all(map(_is_whole, (compare.left, *compare.comparators))):
                    yield ast.unparse(compare)


@pytest.mark.parametrize("path", LIVE, ids=lambda path: path.stem)
def test_no_complaint_hangs_on_a_comparison_that_not_a_number_passes(path):
    new = [text for text in found(ast.parse(path.read_text(encoding="utf-8"))) if (path.name, text) not in KNOWN]
    assert not new, f"{path}: write the good case, under `not`"


def test_a_comparison_that_not_a_number_passes_is_found():
    tree = ast.parse("def f(degC):\n    if degC > 90.0:\n        raise ValueError\n    if not degC <= 90.0:\n        raise ValueError\n")
    assert list(found(tree)) == ["degC > 90.0"]
