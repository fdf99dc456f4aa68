"""The notebooks run, and hold no outputs."""

import os
import subprocess
import sys

import nbformat
import pytest
from tests.conftest import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


@pytest.mark.doc
@pytest.mark.long
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom(path, tmp_path, run_cache):
    # in a process of its own: the notebook machinery brings warnings that are not ours
    code = (
        "import sys, nbformat, nbclient; nb = nbformat.read(sys.argv[1], 4);"
        "nbclient.NotebookClient(nb, timeout=300, kernel_name='python3').execute(cwd=sys.argv[2]);"
        "print(sum('image/svg+xml' in o.get('data', {}) for c in nb.cells for o in c.get('outputs', [])))"
    )
    # what other tests compiled and fitted serves here: it is most of what a notebook takes
    environment = os.environ | {"HEATERTUNE_CACHE": str(run_cache)}
    command = [sys.executable, "-c", code, str(path), str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert ended.returncode == 0, ended.stderr[-3000:]
    assert int(ended.stdout.split()[-1]) >= 3, "pictures"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_without_outputs(path):
    cells = nbformat.read(path, 4).cells
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
    assert {cell.cell_type for cell in cells} == {"markdown", "code"}
