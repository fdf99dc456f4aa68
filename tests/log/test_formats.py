"""A new format is a parser of few lines: the longest, with all that it alone uses, has sixty."""

import ast
import inspect

import pytest

from heatertune.log.formats import BINARY_FORMATS, TEXT_FORMATS

_MOST = 60


def lines_of(reader):
    """Return how many lines of code a reader has, with the functions, classes and values of its module that it uses."""
    source = inspect.getsource(inspect.getmodule(reader))
    parts = {}
    for node in ast.parse(source).body:
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", node)
        parts[getattr(target, "id", getattr(target, "name", ""))] = node
    used, left = set(), [reader.__name__]
    while left:
        name = left.pop()
        if name not in used:
            used.add(name)
            left += [each.id for each in ast.walk(parts[name]) if isinstance(each, ast.Name) and each.id in parts]
    lines = source.splitlines()
    count = 0
    for node in map(parts.get, used):
        told = node.body[0] if isinstance(node, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node) else None
        written = [k for k in range(node.lineno, node.end_lineno + 1) if told is None or not told.lineno <= k <= told.end_lineno]
        count += sum(lines[k - 1].strip() != "" and not lines[k - 1].lstrip().startswith("#") for k in written)
    return count


@pytest.mark.parametrize("kind", [*BINARY_FORMATS, *TEXT_FORMATS], ids=lambda kind: kind.name)
def test_a_reader_has_at_most_sixty_lines(kind):
    assert 3 < lines_of(kind.read) <= _MOST
