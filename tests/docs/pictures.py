"""The pictures of the tutorial and the README, drawn from the folder that the tutorial's design writes.

    python -m tests.docs.pictures FOLDER     draw them again from the folder of `heatertune design table4 --target s5-ob251`

That of conditions and events is drawn from the tables of the proof, whatever the folder.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl

from heatertune.proof.event_table import EVENTS, MAINS_LABELS, EventKind
from heatertune.report import plots
from heatertune.report.plots import to_svg

PICTURES: Final = Path(__file__).parents[2] / "docs" / "pictures"
#: of one picture: a forge shows it at once
LARGEST_BYTES: Final = 180_000
_PLACE: Final = re.compile(r"\d+\.\d{2,}")  # a tenth of a point is finer than eyes are
_APART: Final = 0.025  # of the width: two names of parts that can be read
_WIDE_IN: Final = 7.0  # narrower than in the report: its letters can be read on a telephone


def drawn(folder: Path) -> dict[str, str]:
    """Return each picture by its name, drawn from the documents of a design."""
    log, model, proof, seen = (_document(folder, name) for name in ("log", "model", "proof", "pictures"))
    with mpl.rc_context({"path.simplify_threshold": 0.5}):  # half a dot: a third of the points
        figures = {
            "fit": plots.plot_fit(log, model["residuals"]),
            "words": plots.plot_wish(seen["nominal"], seen["ideal"], seen["phases"]),
            "proof": plots.plot_loop(seen["nominal"], seen["worst"], seen["others"], seen["phases"]),
        }
    return {name: _svg(figure, said(proof)) for name, figure in figures.items()}


def said(proof: Any) -> str:
    """Return what a picture says of the proof it was drawn from: by this its age is told."""
    worst = "".join(f", {name} {proof['criteria'][name]['value']:.4g}" for name in ("overshoot", "ms", "switchings"))
    return f"{proof['verdict']} for {proof['target']} in {len(proof['runs'])} runs{worst}"


_ROW, _LEFT, _COLUMN, _TOP = 22, 310, 130, 40
#: how a field is filled, of runs that are made; colours that are told apart without colour too
_FILLS: Final = {"all": "#0072b2", "nearest": "#a6cee3", "": "none"}
_NOMINAL: Final = MAINS_LABELS[1]


def runs_at(event: EventKind, mains: str) -> str:
    """Return which runs an event is part of at a mains voltage; empty: of none."""
    return event.runs if event.mains == "every" or mains == _NOMINAL else ""


def events() -> str:
    """Return the picture of conditions and events: a field for each event and mains voltage."""
    width, height = _LEFT + _COLUMN * len(MAINS_LABELS) + 10, _TOP + _ROW * len(EVENTS) + 10
    fields = [f'<text x="{_LEFT + _COLUMN * (place + 0.5)}" y="{_TOP - 14}" text-anchor="middle">{mains}</text>'
              for place, mains in enumerate(MAINS_LABELS)]
    for row, event in enumerate(EVENTS):
        top = _TOP + _ROW * row
        fields.append(f'<text x="{_LEFT - 12}" y="{top + 15}" text-anchor="end">{event.name}</text>')
        fields += [f'<rect x="{_LEFT + _COLUMN * place + 2}" y="{top + 2}" width="{_COLUMN - 4}" height="{_ROW - 4}" '
                   f'fill="{_FILLS[runs_at(event, mains)]}" stroke="#777"/>' for place, mains in enumerate(MAINS_LABELS)]
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">'
            f"<desc>{len(EVENTS)} events at {len(MAINS_LABELS)} mains voltages</desc>\n" + "\n".join(fields) + "\n</svg>\n")


def _svg(figure: Any, description: str) -> str:
    figure.set_size_inches(_WIDE_IN, figure.get_size_inches()[1])
    low = figure.axes[-1]
    if low.get_xscale() == "function":  # a story: its parts without their instants, none written over another
        ends = low.get_xlim()
        low.set_xlabel("")
        ticks, labels = low.get_xticks(), [label.get_text().partition(",")[0] for label in low.get_xticklabels()]
        places = low.transScale.transform([(tick, 0.0) for tick in (*ticks, ends[1])])[:, 0]
        kept = [i for i in range(len(ticks)) if places[i] - places[i - 1] > _APART * places[-1] or i == 0]
        low.set_xticks(ticks[kept], [labels[i] for i in kept], rotation=40, ha="right", fontsize=8,
                       rotation_mode="anchor")
    svg = to_svg(figure)
    head, _, rest = _PLACE.sub(lambda found: f"{float(found[0]):.1f}", svg).partition(">")
    return f"{head}><desc>{description}</desc>{rest.rstrip()}\n"


def _document(folder: Path, name: str) -> Any:
    (path,) = folder.rglob(f"{name}.json")
    return json.loads(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    for name, svg in ({} if len(sys.argv) < 2 else drawn(Path(sys.argv[1]))).items() | {"events": events()}.items():
        (PICTURES / f"{name}.svg").write_text(svg, encoding="utf-8")
        print(f"{name}.svg: {len(svg) / 1000:.0f} kB")
