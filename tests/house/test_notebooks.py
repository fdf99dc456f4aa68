"""The notebooks run, hold no outputs, and need what a user has: heatertune's face and the usual libraries."""

import ast
import subprocess
import sys

import nbformat
import pytest
from tests.conftest import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
FACE = {"heatertune", "numpy", "matplotlib", "matplotlib.pyplot", "pandas", "control"}


@pytest.mark.doc
@pytest.mark.long
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom(path, tmp_path):
    # in a process of its own: the notebook machinery brings warnings that are not ours
    code = (
        "import sys, nbformat, nbclient; nb = nbformat.read(sys.argv[1], 4);"
        "nbclient.NotebookClient(nb, timeout=300, kernel_name='python3').execute(cwd=sys.argv[2]);"
        "print(sum(any(kind.startswith('image/') for kind in o.get('data', {})) for c in nb.cells for o in c.get('outputs', [])))"
    )
    command = [sys.executable, "-c", code, str(path), str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr[-3000:]
    assert int(ended.stdout.split()[-1]) >= 3, "pictures"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_without_outputs(path):
    cells = nbformat.read(path, 4).cells
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
    assert {cell.cell_type for cell in cells} == {"markdown", "code"}


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
