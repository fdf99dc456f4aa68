"""Words and their heater → a monitor that never trips for nothing, and how soon it tells each fault."""

from __future__ import annotations

from typing import Any

from heatertune.model.values import FittedModel
from heatertune.plc import Words
from heatertune.progress import ProgressCallback
from heatertune.proof.supervision.supervise import SampleCounts
from heatertune.proof.supervision.supervise import supervise as supervise_words
from heatertune.settings import Conditions

__all__ = ["supervise"]


def supervise(
    words: Words, fitted: FittedModel, conditions: Conditions | None = None, *, progress: ProgressCallback = str,
    **drawn: Any,
) -> dict[str, Any]:
    """Return the monitor of a loop and what it sees, as a JSON object.

    Args:
        words: what the controller holds.
        fitted: the heater and its candidates.
        conditions: as of the proof; None: the defaults.
        progress: told what begins.
        drawn: fields of `heatertune.proof.supervision.supervise.Drawn`.

    Raises:
        InputError, OutOfRange, UnknownName: as `heatertune.proof.supervision.supervise.supervise`.
    """
    return supervise_words(words, fitted, conditions, SampleCounts(**drawn), progress=progress)
