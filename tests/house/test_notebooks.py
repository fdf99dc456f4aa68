"""The notebooks run and hold what they print and draw, light, and need what a user has: heatertune's face, usual libraries."""

import ast
import os
import subprocess
import sys

import nbformat
import pytest
from tests.conftest import ROOT
from tests.docs.blocks import differences
from tests.docs.notebooks import LARGEST_BYTES, NOTEBOOKS, pictures, texts

FACE = {"heatertune", "from heatertune.zones", "numpy", "matplotlib", "matplotlib.pyplot", "pandas", "control", "tclab"}
#: what a notebook imports that tests don't install for themselves → the witnesses that it takes
BROUGHT = {"tclab": ("tclab", "pyserial")}


@pytest.mark.doc
@pytest.mark.long(seconds=25)
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom_and_prints_what_is_stored(path, tmp_path, witness):
    # in a process of its own: the notebook machinery brings warnings that are not ours
    code = "import sys; from tests.docs.notebooks import Path, store; store(*map(Path, sys.argv[1:]))"
    again = tmp_path / path.name
    again.write_bytes(path.read_bytes())
    command = [sys.executable, "-c", code, str(again), str(tmp_path)]
    brought = [str(witness(each)) for name in set(_imported(path)) & set(BROUGHT) for each in BROUGHT[name]]
    places = os.pathsep.join(filter(None, [*brought, os.environ.get("PYTHONPATH")]))
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": places})
    assert ended.returncode == 0, ended.stderr[-3000:]
    stored, now = (nbformat.read(each, 4) for each in (path, again))
    assert differences(texts(stored), texts(now)) == [], "python -m tests.docs.notebooks stores them anew"
    assert pictures(now) == pictures(stored) >= 3


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_with_light_results_and_without_what_differs_from_run_to_run(path):
    cells = nbformat.read(path, 4).cells
    assert path.stat().st_size <= LARGEST_BYTES
    assert {cell.cell_type for cell in cells} == {"markdown", "code"}
    assert not any(cell.get("execution_count") or cell.metadata for cell in cells)
    assert not any(word in path.read_text(encoding="utf-8") for word in ("<svg", "<style", "stderr"))


def _imported(path):
    """Return the modules that a notebook imports, but for those of the standard library."""
    trees = [ast.parse(cell.source) for cell in nbformat.read(path, 4).cells if cell.cell_type == "code"]
    for node in (node for tree in trees for node in ast.walk(tree)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] not in sys.stdlib_module_names)
        elif isinstance(node, ast.ImportFrom) and node.module.split(".")[0] not in sys.stdlib_module_names:
            yield f"from {node.module}"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_imports_the_face_and_the_usual_libraries_as_a_whole(path):
    assert set(_imported(path)) <= FACE
