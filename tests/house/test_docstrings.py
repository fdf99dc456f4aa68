"""What the docstrings of public functions say: shapes of arrays, meanings of many parameters, errors raised.

Read from the sources alone. Public is what a module's `__all__` names, and the methods of such a class without an
underscore. A method without a docstring has that of the method it overrides.
"""

import ast
import re
from dataclasses import dataclass

import pytest
from tests.conftest import ROOT

from heatertune import errors

SOURCE = ROOT / "src" / "heatertune"
ARRAYS = re.compile(r"\b(Array|NDArray|ArrayLike|Complex)\b")
MANY = 5


@dataclass(frozen=True, kw_only=True)
class Public:
    """A public function or method: where it stands, its docstring, and those of its module and class."""

    place: str
    node: ast.FunctionDef
    doc: str
    around: tuple[str, ...]

    @property
    def parameters(self):
        """The parameters but for self and cls."""
        spec = self.node.args
        given = [*spec.posonlyargs, *spec.args, spec.vararg, *spec.kwonlyargs, spec.kwarg]
        return [parameter for parameter in given if parameter and parameter.arg not in ("self", "cls")]

    @property
    def raised(self):
        """Names of our errors that the body itself raises."""
        return {name for name in _raised(self.node.body) if name in errors.__all__}

    def explains(self, section, name):
        """Return whether a section of the docstring has an entry of that name."""
        (text,) = re.findall(rf"^{section}:\n((?: .*\n?)+)", self.doc, re.MULTILINE) or [""]
        return bool(re.search(rf"^ +([\w, ]+, )?{name}(, [\w, ]+)?: ", text, re.MULTILINE))


def _raised(nodes):
    for node in nodes:
        if isinstance(node, ast.Raise) and node.exc:
            yield ast.unparse(node.exc.func if isinstance(node.exc, ast.Call) else node.exc).rpartition(".")[2]
        elif not isinstance(node, ast.FunctionDef | ast.Lambda):
            yield from _raised(ast.iter_child_nodes(node))


def _exported(tree):
    """Return what the module's `__all__` names."""
    lists = [node for node in tree.body if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"]
    return {name for node in lists for name in ast.literal_eval(node.value)}


def _methods(node):
    return [part for part in node.body if isinstance(part, ast.FunctionDef) and not part.name.startswith("_")]


def _doc(classes, owner, name):
    """Return the docstring of a class's method, or of the one it overrides."""
    own = next((ast.get_docstring(part) for part in _methods(owner) if part.name == name), None)
    bases = [classes.get(re.split(r"[.\[]", ast.unparse(base))[0]) for base in owner.bases]
    return own or next(filter(None, (_doc(classes, base, name) for base in bases if base)), "")


def _public():
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(SOURCE.rglob("*.py"))}
    classes = {node.name: node for tree in trees.values() for node in tree.body if isinstance(node, ast.ClassDef)}
    for path, tree in trees.items():
        file, module = path.relative_to(SOURCE).as_posix(), ast.get_docstring(tree) or ""
        names = _exported(tree)
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name in names:
                own = ast.get_docstring(node) or ""
                yield Public(place=f"{file}: {node.name}", node=node, doc=own, around=(module,))
            elif isinstance(node, ast.ClassDef) and node.name in names:
                around = (module, ast.get_docstring(node) or "")
                for part in _methods(node):
                    doc = _doc(classes, node, part.name)
                    yield Public(place=f"{file}: {node.name}.{part.name}", node=part, doc=doc, around=around)


PUBLIC = tuple(_public())


def _tells_shapes(public):
    """Return whether "shape" stands in the docstring, or the class or module lists the shapes of all its arrays."""
    notes = [public.node.returns, *(parameter.annotation for parameter in public.parameters)]
    if not any(note and ARRAYS.search(ast.unparse(note)) for note in notes):
        return True
    listed = any("Shapes of the arrays: " in " ".join(text.split()) for text in public.around)
    return listed or bool(re.search(r"\bshapes?\b", public.doc, re.IGNORECASE))


def _tells_parameters(public):
    names = [parameter.arg for parameter in public.parameters]
    return len(names) < MANY or all(public.explains("Args", name) for name in names)


def _tells_errors(public):
    return all(public.explains("Raises", name) for name in public.raised)


RULES = (_tells_shapes, _tells_parameters, _tells_errors)


def _silent(rule):
    return [public.place for public in PUBLIC if not rule(public)]


@pytest.mark.parametrize("rule", RULES, ids=["shapes", "parameters", "errors"])
def test_docstrings_tell_the_shapes_of_arrays_many_parameters_and_the_errors_raised(rule):
    assert _silent(rule) == []


def _of(text):
    """Return the one function of a text as public."""
    (node,) = ast.parse(text).body
    return Public(place="", node=node, doc=ast.get_docstring(node) or "", around=())


@pytest.mark.parametrize("text", [
    'def f(a: Array):\n    """Return the mean."""',
    'def f(a, b, c, d, *e):\n    """Add.\n\n    Args:\n        a: 1.\n        b: 2.\n        c: 3.\n        d: 4.\n    """',
    'def f(a):\n    """Check, raise OutOfRange else."""\n    if a:\n        raise OutOfRange("a", a, "0")',
])
def test_a_docstring_that_leaves_something_out_is_seen(text):
    assert [rule(_of(text)) for rule in RULES].count(False) == 1


def test_a_docstring_that_leaves_nothing_out_passes():
    text = ('def f(a: Array, b, *, c, d, e):\n    """Add.\n\n    Args:\n        a: shape (n,).\n        b, c: 2.\n'
            '        d: 4.\n        e: 5.\n\n    Raises:\n        InputError, OutOfRange: never.\n    """\n'
            '    raise OutOfRange("a", a, "0")')
    assert all(rule(_of(text)) for rule in RULES)
