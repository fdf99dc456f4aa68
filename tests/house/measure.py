"""The size and order of the source in figures.

    python -m tests.house.measure            print the table
    python -m tests.house.measure --list     name also what is counted: doubled names, circles, the most complex functions

Code lines are those with code but for imports, docstrings, comments and blank lines. The complexity of a function is 1 and
one for each if, loop, exception handler, case, assert, conditional expression, `and`, `or`, and each `for` of
a comprehension.
A circle is a set of modules that import each other at module level, imports for type checking included.
"""

import ast
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
#: words that are no names on their own, by the language standard's first rule
WORDS = frozenset(Path(__file__).with_name("names_by_grammar.txt").read_text(encoding="utf-8").split())
MANY = 8
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_ANY = ("dict[str, Any]", "Mapping[str, Any]")
#: fields of a node that hold statements, or what holds them
_BODIES = ("body", "orelse", "finalbody", "handlers", "cases")
_BRANCHES = (ast.If, ast.For, ast.AsyncFor, ast.While, ast.ExceptHandler, ast.match_case, ast.IfExp, ast.Assert)


class Module(NamedTuple):
    """A source file: its dotted name, path, text and syntax tree."""

    name: str
    path: Path
    text: str
    tree: ast.Module

    @property
    def package(self) -> str:
        """The part of the source to which it belongs."""
        parts = self.name.split(".")
        return parts[1] if len(parts) > 2 or (len(parts) == 2 and self.path.name == "__init__.py") else "top level"


def modules(folder: Path) -> list[Module]:
    """Read all Python files below a folder."""
    return [_module(folder, path) for path in sorted(folder.rglob("*.py"))]


def _module(folder: Path, path: Path) -> Module:
    parts = path.relative_to(folder.parent).with_suffix("").parts
    text = path.read_text(encoding="utf-8")
    return Module(".".join(parts[:-1] if parts[-1] == "__init__" else parts), path, text, ast.parse(text))


def code_lines(module: Module) -> int:
    """Count the lines with code."""
    without = set[int]()
    for node in ast.walk(module.tree):
        text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        if text or isinstance(node, ast.Import | ast.ImportFrom):
            without.update(range(node.lineno, node.end_lineno + 1))
    lines = enumerate(map(str.strip, module.text.splitlines()), 1)
    return sum(bool(line) and not line.startswith("#") and number not in without for number, line in lines)


def complexity(function: ast.AST) -> int:
    """Count the ways through a function, those of its inner functions included."""
    nodes = list(ast.walk(function))
    return (1 + sum(isinstance(node, _BRANCHES) for node in nodes)
            + sum(len(node.values) - 1 for node in nodes if isinstance(node, ast.BoolOp))
            + sum(isinstance(node, ast.comprehension) for node in nodes))


def imports(module: Module, names: set[str], nodes: list[ast.AST]) -> set[str]:
    """Return the modules of the source that some of a module's nodes import."""
    targets = set[str]()
    for node in nodes:
        if isinstance(node, ast.Import):
            targets.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = (f"{node.module}.{alias.name}" for alias in node.names)
            targets.update(name if name in names else node.module for name in whole)
    return (targets & names) - {module.name}


def inside_functions(module: Module) -> list[ast.AST]:
    """Return the import statements that stand in functions."""
    return sorted(_late_imports(module.tree, inside=False), key=lambda node: node.lineno)


def _late_imports(node: ast.AST, *, inside: bool) -> Iterator[ast.AST]:
    """Yield those below a node. Imports are statements: the expressions, most of a tree, need no look."""
    for part in (part for name in _BODIES for part in getattr(node, name, ())):
        if inside and isinstance(part, ast.Import | ast.ImportFrom):
            yield part
        yield from _late_imports(part, inside=inside or isinstance(part, FUNCTIONS))


def circles(source: list[Module]) -> list[list[str]]:
    """Return the sets of modules that reach each other by imports at module level."""
    names = {module.name for module in source}
    graph = {}
    for module in source:
        late = set(inside_functions(module))
        graph[module.name] = imports(module, names, [node for node in ast.walk(module.tree) if node not in late])
    reached = {name: _reached(graph, name) for name in graph}
    groups = {tuple(sorted({name, *(other for other in reached[name] if name in reached[other])}))
              for name in graph if name in reached[name]}
    return sorted(map(list, groups))


def _reached(graph: dict[str, set[str]], start: str) -> set[str]:
    reached, waiting = set[str](), [*graph[start]]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting.extend(graph[name])
    return reached


def in_several_files(source: list[Module], kinds: type) -> dict[str, list[str]]:
    """Return the names of definitions of a kind that are in more than one file, each with its modules."""
    places = defaultdict(set)
    for module in source:
        for node in ast.walk(module.tree):
            if isinstance(node, kinds):
                places[node.name].add(module.name)
    return {name: sorted(found) for name, found in sorted(places.items()) if len(found) > 1}


def stems_twice(source: list[Module]) -> dict[str, list[str]]:
    """Return the file stems that several folders have, `__init__` apart, each with its modules."""
    places = defaultdict(list)
    for module in source:
        if module.path.stem != "__init__":
            places[module.path.stem].append(module.name)
    return {stem: found for stem, found in sorted(places.items()) if len(found) > 1}


def public_names(module: Module) -> list[str]:
    """Return the public names that a module defines: itself, its functions, classes, constants, methods and attributes."""
    names, scopes = [module.path.stem], [module.tree]
    while scopes:
        for node in scopes.pop().body:
            if isinstance(node, (*FUNCTIONS, ast.ClassDef)):
                names.append(node.name)
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                names += [target.id for target in targets if isinstance(target, ast.Name)]
            if isinstance(node, ast.ClassDef):
                scopes.append(node)
    return [name for name in names if not name.startswith("_")]


def parameters(module: Module) -> list[str]:
    """Return the names of the parameters of all functions."""
    return [node.arg for node in ast.walk(module.tree) if isinstance(node, ast.arg)]


def by_grammar(names: list[str]) -> list[str]:
    """Return the names that are a bare participle or pronoun."""
    return [name for name in names if name.lower() in WORDS]


def table(source: list[Module], tests: list[Module]) -> tuple[dict[str, object], dict[str, object]]:
    """Return the figures, and what is behind some of them."""
    nodes = [node for module in source for node in ast.walk(module.tree)]
    functions = [(complexity(node), f"{module.name}.{node.name}") for module in source
                 for node in ast.walk(module.tree) if isinstance(node, FUNCTIONS)]
    complex_ones = sorted((each for each in functions if each[0] > MANY), reverse=True)
    doubled, stems, rings = in_several_files(source, ast.ClassDef), stems_twice(source), circles(source)
    names = by_grammar([name for module in source for name in public_names(module)])
    given = by_grammar([name for module in source for name in parameters(module)])
    code = Counter()
    for module in source:
        code[module.package] += code_lines(module)
    figures = {
        "files in src": len(source), "lines in src": sum(module.text.count("\n") for module in source),
        "code lines in src": code.total(), **{f"  {package}": lines for package, lines in sorted(code.items())},
        "files in tests": len(tests), "lines in tests": sum(module.text.count("\n") for module in tests),
        "functions": len(functions), f"functions of complexity > {MANY}": len(complex_ones),
        "classes": sum(isinstance(node, ast.ClassDef) for node in nodes), "class names in several files": len(doubled),
        "file stems in several folders": len(stems), "public names that are participles or pronouns": len(names),
        "parameters that are participles or pronouns": len(given), "import circles": len(rings),
        "imports inside functions": sum(len(inside_functions(module)) for module in source),
        "dict[str, Any] and Mapping[str, Any]": sum(isinstance(node, ast.Subscript) and ast.unparse(node) in _ANY for node in nodes),
    }
    behind = {
        "most complex functions": [f"{name} {number}" for number, name in complex_ones[:20]], "class names in several files": doubled,
        "file stems in several folders": stems, "participles and pronouns": dict(Counter(names).most_common()),
        "import circles": rings}
    return figures, behind


def run() -> None:
    """Print the table."""
    figures, behind = table(modules(ROOT / "src" / "heatertune"), modules(ROOT / "tests"))
    width = max(map(len, figures))
    print(*(f"{name:{width}}  {figure:>7,}" for name, figure in figures.items()), sep="\n")
    if "--list" in sys.argv[1:]:
        for title, found in behind.items():
            rows = [f"{name}: {entry}" for name, entry in found.items()] if isinstance(found, dict) else found
            print(f"\n{title}", *(f"  {row}" for row in rows), sep="\n")


if __name__ == "__main__":
    run()
