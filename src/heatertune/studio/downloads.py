"""What the user takes home: the export files as one zip, and the report. The same design gives the same bytes."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Final

from heatertune.chain.documents import words_document
from heatertune.chain.pipeline import dossier
from heatertune.codec import encode
from heatertune.documents import DATA, plain, to_json
from heatertune.plc import controller_for
from heatertune.studio.session import FrontDesign

__all__ = ["export_zip", "report_page"]

_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold: no date


def export_zip(standing: FrontDesign, *, force: bool) -> bytes:
    """Return the export files with `data/words.json` and `data/proof.json`, as `heatertune export-db` writes them.

    The main file of the controller comes first.

    Raises:
        ExportRefused: the verdict is not PASS and it is not forced.
    """
    files, gains, proof = standing.export(force=force), standing.look.gains, standing.proof
    documents = {
        f"{DATA}/words.json": to_json(words_document(gains.words, proof, files, gains.search)),
        f"{DATA}/proof.json": to_json(proof.to_document()),
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        first = controller_for(gains.words.target).main_file
        for name, content in sorted({**files, **documents}.items(), key=lambda one: (one[0] != first, one[0])):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content)
    return packed.getvalue()


def report_page(standing: FrontDesign, files: Mapping[str, str | bytes]) -> str:
    """Return `report.html` of a proven design, as left where a trace was held against it.

    Args:
        standing: the design.
        files: that were exported; none for words that failed and were not forced.
    """
    from heatertune.report import render  # noqa: PLC0415 - matplotlib only where pictures are drawn

    gains = standing.look.gains
    documents = dossier(standing.log, standing.fitted, gains.design, standing.proof, files, gains.search, gains.recipe)
    left = {} if standing.as_left is None else {"as_left": plain(encode(standing.as_left))}
    return render(documents | left)
