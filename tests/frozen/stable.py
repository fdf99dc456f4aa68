"""The form in which an output is compared: everything that differs between two machines or two days is removed here.

| output | what is changed |
| --- | --- |
| JSON (documents, `--json`) | floats to 6 significant digits, below 1e-9 to 0; then as text |
| text (stdout, report pages) | numbers of more digits to 6 significant digits; pictures to their titles; then as below |
| both, and export texts | digests of a proof, the working folder, times of day, heatertune's version |
| export bytes (blocks) | nothing |
| tables (Parquet) and pictures (SVG) | not compared: the versions of the libraries that write them show |
"""

import json
import re
from contextlib import suppress
from pathlib import Path

from heatertune import __version__

#: not compared
LEFT_OUT = (".parquet", ".svg", ".png")

_MASKS = (
    (re.compile(r"sha256:[0-9a-f]{64}"), "sha256:DIGEST"),  # of a proof with all its digits
    (re.compile(r"\b20\d\d-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?(Z|\+\d\d:?\d\d)?"), "TIME"),
    (re.compile(rf"heatertune {re.escape(__version__)}"), "heatertune VERSION"),
)
_PICTURE = re.compile(r"<svg\b.*?</svg>", re.DOTALL)
_TITLE = re.compile(r"<(?:title|desc)\b.*?</(?:title|desc)>", re.DOTALL)
_LONG_NUMBER = re.compile(r"(?<![\w.])-?\d+\.\d{4,}(?:e[-+]?\d+)?(?![\w.])")


def stable(name: str, content: str | bytes) -> bytes:
    """Return the content of a file, or what a command printed, in the form that is compared."""
    try:
        text = content if isinstance(content, str) else content.decode()
    except UnicodeDecodeError:
        return content
    suffix = Path(name).suffix
    if suffix == ".json":
        with suppress(json.JSONDecodeError):  # an error in place of a document is compared as the text that it is
            text = json.dumps(_rounded(json.loads(text)), ensure_ascii=False, indent=1) + "\n"
    elif suffix in (".html", ".out"):
        text = _PICTURE.sub(lambda picture: f"<svg>{''.join(_TITLE.findall(picture[0]))}</svg>", text)
        text = _LONG_NUMBER.sub(lambda number: f"{float(number[0]):.6g}", text)
    text = text.replace(str(Path.cwd()), "FOLDER")
    for mask, word in _MASKS:
        text = mask.sub(word, text)
    return text.encode()


def _rounded(value):
    if isinstance(value, float):
        return 0.0 if abs(value) < 1e-9 else float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    return [_rounded(part) for part in value] if isinstance(value, list) else value
