"""What the user takes home: the export files as one zip, and the report. The same design gives the same bytes."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Final

from heatertune.chain.documents import words_document
from heatertune.chain.whole import dossier
from heatertune.documents import to_json
from heatertune.log.values import Log
from heatertune.model.values import FittedModel
from heatertune.proof import Proof
from heatertune.studio.loop import Look

__all__ = ["export_zip", "report_page"]

_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold: no date


def export_zip(files: Mapping[str, str | bytes], look: Look, proof: Proof) -> bytes:
    """Return the export files with `words.json` and `proof.json` beside them, as `heatertune export-db` writes them.

    Args:
        files: of `Session.export`, which has refused what must not leave.
        look: the design.
        proof: its full proof.
    """
    documents = {
        "words.json": to_json(words_document(look.gains.words, proof, files, look.gains.search)),
        "proof.json": to_json(proof.to_document()),
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, content in sorted({**files, **documents}.items()):
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content)
    return packed.getvalue()


def report_page(
    log: Log, fitted: FittedModel, look: Look, proof: Proof, files: Mapping[str, str | bytes]
) -> str:
    """Return `report.html`.

    Args:
        log: as it was read.
        fitted: the heater behind it.
        look: the design.
        proof: its full proof.
        files: that were exported; none for words that failed and were not forced.
    """
    from heatertune.report import render  # noqa: PLC0415 - matplotlib only where pictures are drawn

    return render(dossier(log, fitted, look.gains.design, proof, files, look.gains.search))
