"""Words that were written into a PLC, beside the proof: as found, as left, and the response that was watched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from heatertune.codec import register_schema
from heatertune.errors import DocumentError

__all__ = ["IN_BLOCK", "WRITTEN_SCHEMA", "Outcome", "Passage", "Quantity", "Watch", "WriteHistory"]

WRITTEN_SCHEMA: Final = "heatertune/written/2"
#: quantities that the words in a block make
IN_BLOCK: Final = ("K", "TN", "TV", "largest power")

#: of a write, see `heatertune.live.write.writer.WriteOutcome`
Outcome = Literal["done", "not done", "rolled back", "partly done", "done, not watched", "unknown"]
Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """What words mean.

    Attributes:
        name: of the quantity, as "K".
        unit: of all three.
        found, left: in the PLC before and after; None: there is none of it, or it is not known.
        proven: of the words that were proven.
    """

    name: str
    unit: str
    as_found: float | None
    proven: float | None
    left: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """The response to words, and the proven band around it; every column has as many numbers.

    Attributes:
        time_s: since the first reading [s].
        temperature_degC: measured [°C].
        low_degC, high_degC: ends of the proven band at that instant [°C].
        setpoint_degC: that the PLC asked for [°C].
    """

    time_s: Numbers
    temperature_degC: Numbers
    low_degC: Numbers
    high_degC: Numbers
    setpoint_degC: Numbers

    def __post_init__(self) -> None:
        if len({len(getattr(self, name)) for name in self.__slots__}) != 1 or not self.time_s:
            raise DocumentError("columns of different lengths, or empty")


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """One time that somebody wrote: words, or what was before them.

    Attributes:
        kind: which of both.
        record: name of the file that tells it.
        address: of the PLC.
        simulated: whether that was a simulator.
        version: of heatertune, as the record's beginning has it.
        begun, ended: instants, ISO 8601 with their zone; ended None: the record breaks off.
        outcome, told: what happened, the latter a sentence.
        seen: what was looked at before, a few words each.
        notes: what else to know, a sentence each.
        found, left: all words in the PLC before and after, by name; None: not known.
        quantities: what they mean.
        watch: the response; None: it was not watched.
    """

    kind: Literal["write", "rollback"]
    record: str
    address: str
    simulated: bool
    version: str
    begun: str
    ended: str | None
    outcome: Outcome
    message: str
    observations: tuple[str, ...]
    notes: tuple[str, ...]
    as_found: Mapping[str, int | float] | None
    left: Mapping[str, int | float] | None
    quantities: tuple[Quantity, ...]
    watch: Watch | None


@register_schema(WRITTEN_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class WriteHistory:
    """All that was written of one proof.

    Attributes:
        digest: of the proof.
        passages: in order of time.
    """

    digest: str
    passages: tuple[Passage, ...]

    def __post_init__(self) -> None:
        if not self.passages:
            raise DocumentError("passages: none")
