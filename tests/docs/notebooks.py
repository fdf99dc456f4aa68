"""The notebooks with their results stored, light enough for a page of a forge.

    python -m tests.docs.notebooks [NAME …]     run the notebooks and store what they print and draw

Pictures are kept as PNG of few colours, cards of values without their styles and drawings, which a forge would take away. What
differs from run to run (counts, addresses in memory) is left out.
"""

from __future__ import annotations

import base64
import io
import re
import sys
from pathlib import Path
from typing import Any, Final

import nbclient
import nbformat
from PIL import Image

NOTEBOOKS: Final = sorted((Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
#: of one stored notebook: a forge shows it at once
LARGEST_BYTES: Final = 150_000
_COLOURS: Final = 64  # of a picture: the lines' own, rare ones too, and what smooths them
_DRAWN: Final = re.compile(r"<(style|script|svg)\b.*?</\1>", re.DOTALL)
_TAG: Final = re.compile(r"<[^>]*>")
_ADDRESS: Final = re.compile(r" at 0x[0-9a-f]+")


def executed(path: Path, folder: Path | str) -> Any:
    """Return a notebook as it is after a run in a folder, its results made light."""
    notebook = nbformat.read(path, 4)
    nbclient.NotebookClient(notebook, timeout=900, kernel_name="python3", coalesce_streams=True).execute(cwd=str(folder))
    notebook.metadata = nbformat.from_dict({
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"}})
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.execution_count, cell.outputs = None, [each for each in map(_light, cell.outputs) if each is not None]
    return notebook


def _light(output: Any) -> Any:
    """Return a result without what differs from run to run; None where nothing is left of it."""
    if output.output_type == "stream":
        return output if output.name == "stdout" else None  # progress and hints are for a run's own eyes
    data = dict(output.data)
    if "image/png" in data:
        output.data = {"image/png": light_png(data["image/png"])}
    elif "text/html" in data:
        output.data = {"text/html": _DRAWN.sub("", data["text/html"])}
    elif _ADDRESS.search(data.get("text/plain", "")):
        return None
    output.metadata = {}
    if output.output_type == "execute_result":
        output.execution_count = None
    return output


def light_png(encoded: str) -> str:
    """Return a picture in base64 with few colours."""
    picture = Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGB")
    few = picture.quantize(_COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    content = io.BytesIO()
    few.save(content, format="PNG", optimize=True)
    return base64.b64encode(content.getvalue()).decode("ascii")


def texts(notebook: Any) -> str:
    """Return all that a notebook prints, cell by cell."""
    outputs = [each for cell in notebook.cells for each in cell.get("outputs", ())]
    return "\n".join(map(_text, outputs))


def _text(output: Any) -> str:
    if output.output_type == "stream":
        return str(output.text)
    return str(output.data.get("text/plain", _TAG.sub("\n", output.data.get("text/html", ""))))


def pictures(notebook: Any) -> int:
    """Return how many pictures a notebook shows."""
    return sum("image/png" in each.get("data", {}) for cell in notebook.cells for each in cell.get("outputs", ()))


def store(path: Path, folder: Path | str) -> None:
    """Run a notebook in a folder and write it, its results included."""
    notebook = executed(path, folder)
    path.write_text(nbformat.writes(notebook).rstrip("\n") + "\n", encoding="utf-8")


if __name__ == "__main__":
    import tempfile

    known = {each.stem for each in NOTEBOOKS}
    if unknown := set(sys.argv[1:]) - known:
        raise SystemExit(f"no notebook {', '.join(sorted(unknown))}; there are {', '.join(sorted(known))}")
    for each in NOTEBOOKS:
        if each.stem in (sys.argv[1:] or known):
            with tempfile.TemporaryDirectory() as empty:
                store(each, empty)
            print(f"{each.stem}: {each.stat().st_size / 1000:.0f} kB", flush=True)
