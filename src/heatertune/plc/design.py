"""A design for a target: tuned for its timer and its input, and rounded to its words."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

from heatertune import cache
from heatertune.model import document as model_document
from heatertune.model.values import FittedModel
from heatertune.options import merged
from heatertune.pid import document as pid_document
from heatertune.pid.timer import Timer
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, Words, room
from heatertune.progress import Told
from heatertune.settings import TuneSettings

__all__ = ["encode", "timer_of", "tune"]

#: of a model's document, what is told and no design depends on
_TOLD: Final = (
    "residuals", "notes", "hypotheses", "whiteness", "input_crosscorrelation", "held_out", "halves", "logs")


