"""The rules of the house that a machine can check."""

import ast
import importlib
import re
from functools import cache
from pathlib import Path

import pytest
from tests.conftest import ROOT

import heatertune

SOURCE = ROOT / "src" / "heatertune"
#: in the order of their imports: each may import the core and those before it
EXTRAS = ("loops", "supervision", "batch", "zones", "live", "studio")
#: files of the core that name modules of the extras → why
NAMING_EXTRAS = {
    "cli/command_table.py": "the one table through which the command line reaches the extras' commands",
    "__init__.py": "the Python package offers fleet, study, virtual_plc and read_zones",
}
STAGES = ("heater", "log", "model", "pid", "plc", "proof", "report")
FREE = ("arrays", "units", "errors", "options", "keywords", "settings", "codec", "writing", "cache", "compiled", "lazy", "show",
        "processors")
MODULES = sorted(SOURCE.rglob("*.py"))


@cache
def _nodes(path):
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


@cache
def _imports(path):
    """Return the second part of every heatertune.X that a file imports, wherever it does so, by name or by string."""
    return set(_imported(_nodes(path)))


def _imported(nodes):
    for node in nodes:
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" if node.module == "heatertune" else node.module for alias in node.names]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            names = [part.value for part in ast.walk(node.args[0]) if isinstance(part, ast.Constant)]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "lazy_attributes":
            names = [f"heatertune.{key.value}" for key in node.args[1].keys]
        yield from (name.split(".")[1] for name in names if re.match(r"heatertune\.\w", name))


def _named_extras(nodes):
    """Yield the extras that a file imports, and those of whose modules it holds the dotted name in a text."""
    yield from {*_imported(nodes)} & {*EXTRAS}
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            extra, _, module = node.value.removeprefix("heatertune.").partition(".")
            if extra in EXTRAS and re.split(r"\W", module)[0] in {path.stem for path in (SOURCE / extra).iterdir()}:
                yield extra


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_imports_only_stages_that_sort_before_it(stage):
    for path in (SOURCE / stage).rglob("*.py"):
        for imported in _imports(path) - {"__version__"}:  # the package's own, which a record names
            assert imported in FREE or (imported in STAGES and imported <= stage), f"{path} imports {imported}"


@pytest.mark.parametrize("package", sorted(path.parent for path in MODULES if path.name == "__init__.py"), ids=lambda package: package.name)
def test_what_a_package_offers_is_there_and_no_module_of_its_own_hides_it(package):
    offers = importlib.import_module(".".join(("heatertune", *package.relative_to(SOURCE).parts)))
    assert set(getattr(offers, "__all__", ())) <= set(dir(offers))
    for name in getattr(offers, "__all__", ()):
        assert getattr(offers, name) is not None
        assert not (package / f"{name}.py").exists(), f"{package} hides {name}"


def test_what_is_free_to_all_imports_nothing_but_itself_and_nobody_imports_the_command_line():
    for name in FREE:
        for path in (SOURCE / name).glob("*.py") if (SOURCE / name).is_dir() else [SOURCE / f"{name}.py"]:
            assert _imports(path) <= set(FREE), path
    for path in MODULES:
        if path.parent.name not in ("cli", "commands") and path.name not in ("__main__.py", "command.py"):
            assert "cli" not in _imports(path), path


def test_the_core_imports_no_extra_not_even_lazily():
    core = [path for path in MODULES if path.relative_to(SOURCE).parts[0] not in EXTRAS]
    naming = {path.relative_to(SOURCE).as_posix(): sorted(set(_named_extras(_nodes(path)))) for path in core}
    assert {name for name, extras in naming.items() if extras} == set(NAMING_EXTRAS), naming


@pytest.mark.parametrize("code", [
    "from heatertune.live import serve", "import heatertune.live.serve", "from heatertune import live",
    "def run():\n    from heatertune.live.serve import virtual_plc", "if TYPE_CHECKING:\n    import heatertune.live.serve",
    "import_module('heatertune.live.serve')", "lazy_attributes(__name__, {'live.serve': ('virtual_plc',)})",
    "HOMES = {'virtual_plc': 'live.serve'}", "import_module(f'heatertune.{\"live.serve\"}')",
])
def test_every_way_to_import_an_extra_is_seen(code):
    assert {*_named_extras(list(ast.walk(ast.parse(code))))} == {"live"}


@pytest.mark.parametrize("extra", EXTRAS)
def test_an_extra_imports_the_core_and_the_extras_before_it(extra):
    for path in (SOURCE / extra).rglob("*.py"):
        later = EXTRAS[EXTRAS.index(extra) + 1 :]
        assert not {*_imports(path)} & {*later}, path


def test_the_studios_logic_knows_no_browser():
    knowing = {path.stem for path in (SOURCE / "studio").glob("*.py") if "from nicegui" in path.read_text(encoding="utf-8")}
    assert knowing == {"browser_page", "controls", "server", "sheet_card", "zones_card"}


def _dotted(path):
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@pytest.mark.parametrize("path", [p for p in MODULES if p.name != "__main__.py"], ids=_dotted)
def test_public_names_exist_and_have_docstrings(path):
    module = importlib.import_module(_dotted(path))
    assert module.__doc__
    for name in getattr(module, "__all__", ()):
        found = getattr(module, name)
        if callable(found) and getattr(found, "__module__", "").startswith("heatertune"):
            assert found.__doc__, f"{_dotted(path)}.{name}"


def test_the_package_offers_what_the_readme_uses():
    assert {"design", "encode", "export", "fit", "prove", "read_log", "tune", "write_report"} <= set(heatertune.__all__)
    for name in heatertune.__all__:
        assert callable(getattr(heatertune, name))
    with pytest.raises(AttributeError, match="nothing"):
        _ = heatertune.nothing


def test_files_and_functions_stay_small():
    for path in MODULES:
        # one file, one topic: more files are harder to find one's way in than longer ones
        assert path.read_text(encoding="utf-8").count("\n") <= 700, path
        for node in _nodes(path):
            if isinstance(node, ast.FunctionDef):
                first = node.body[1].lineno if ast.get_docstring(node) and len(node.body) > 1 else node.body[0].lineno
                assert node.end_lineno - first <= 60, f"{path}: {node.name}"


def test_no_file_names_a_path_of_somebodys_machine():
    machine = re.compile(r"/(root|home|work)/|/tmp/")
    for path in [p for folder in ("src", "tests", "notebooks", "data", ".ci") for p in (ROOT / folder).rglob("*")]:
        if path.suffix in (".py", ".md", ".toml", ".ipynb", ".csv") or path.name == "run":
            hits = [line for line in path.read_text(encoding="utf-8").splitlines() if machine.search(line)]
            assert not hits or path == Path(__file__), (path, hits[:1])


def test_the_switches_of_every_room_are_the_table_of_its_differences():
    from heatertune.plc import COOLING, TARGETS, controller_for  # noqa: PLC0415 - beside its only use

    for name, package in TARGETS.items():
        text = (SOURCE.joinpath(*package.split(".")[1:]) / "DIFFERENCES.md").read_text(encoding="utf-8")
        _, _, table = text.partition("| open point | settings (default first) | what is open |\n| --- | --- | --- |\n")
        rows = [f"| {switch.name} | {', '.join(switch.settings)} | {switch.reason} |" for switch in controller_for(name).switches]
        assert table.split("\n\n")[0].splitlines() == rows, name
        if name in COOLING:  # the open points that a cooler brings stand in a table of their own
            own = controller_for(COOLING[name]).switches[len(rows):]
            more = table.partition("| --- | --- | --- |\n")[2].split("\n\n")[0].splitlines()
            assert more == [f"| {switch.name} | {', '.join(switch.settings)} | {switch.reason} |" for switch in own]
