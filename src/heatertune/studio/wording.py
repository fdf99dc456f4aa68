"""Sentences of the chain, and faults → sentences of the page: what an option sets has a name here, too."""

from __future__ import annotations

import re
from typing import Final

__all__ = ["fault_told", "for_page"]

_OPTION: Final = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?: NAME(?: or N|\|N)?| LOW HIGH)?")
#: where an option's name alone would make no sentence
_SENTENCES: Final = (
    (re.compile(r"--tag (.+?) --tag-column (.+?) to read"), r"the role zone for ‘\2’ to read"),
    (re.compile(r"\(--skip-empty leaves such rows out\)"), "(or tick that rows without a reading are left out)"),
    (re.compile(r"\(--skip-empty leaves out rows whose cell is empty\)"),
     "(or empty the cell, and tick that rows without a reading are left out)"),
    (re.compile(r"--power-full-scale with the reading at full power"), "the reading at full power"),
    (re.compile(r"\(--power-full-scale tells another reading at full power\)"), "(or another reading at full power)"),
    (re.compile(r"--power-full-scale would have to tell the reading"), "you would have to type the reading"),
    (re.compile(r"--run reads another"), "another can be chosen"),
    (re.compile(r"--append continues it"), "tick that it is continued"),
    (re.compile(r"Say --design DIR \(whose controller runs there\), or --map FILE\.toml"),
     "Type the folder of its design, or the map that says it"),
    (re.compile(r"say it in a small file: --map FILE\.toml"), "say it in a small file, the map (TOML)"),
    (re.compile(r"--log-interval with the seconds"), "the log's interval: the seconds"),
)
_NO_COLUMN: Final = re.compile(r"--([a-z]+)-(?:column|tag) none\b")
#: what the page has no control for: the sentence is whole without it
_LEFT_OUT: Final = re.compile(r",? or --accept [\w-]+|; --force exports these parameters anyway")
#: option → what the page calls it, where its name says too little
_CALLED: Final = {
    "temperature-unit": "the temperature's unit:", "time-unit": "the time's unit:", "tag": "the temperature's tag",
    "power-full-scale": "the reading at full power", "log-interval": "the log's interval",
    "run": "the choice of the run", "tag-column": "the column of the tags", "ambient": "the ambient temperature",
    "power-before": "the power before the log", "range": "the sensor range", "input": "the analog input",
    "ms": "calm or brisk (Ms)", "sample-time": "the sampling interval TA", "tolerance": "the tolerance",
    "load-at": "‘load came’", "begins-at": "‘heat-up begins’",
}


def for_page(text: str) -> str:
    """Return a sentence without the options of the command line, in the names of the page."""
    for pattern, sentence in _SENTENCES:
        text = pattern.sub(sentence, text)
    text = _NO_COLUMN.sub(lambda found: f"no {found[1]} chosen", _LEFT_OUT.sub("", text))
    text = _OPTION.sub(lambda found: _CALLED.get(found[1], f"‘{found[1].replace('-', ' ')}’"), text)
    return re.sub(r":(?=[).,;]|$)", "", text) if "unit:" in text else text


def fault_told(problem: Exception) -> str:
    """Return what a user is told of a fault of heatertune itself, and what to do."""
    return (f"Something went wrong inside heatertune ({type(problem).__name__}). Log and settings are kept: move a "
            "control to continue; if it happens again, restart the studio and report what its terminal shows.")
