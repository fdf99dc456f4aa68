"""A running loop, recorded beside the pages: the file is that of `heatertune record`, and its trace grows with it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.live.client.connection import address_of
from heatertune.live.controller_block import ROLES, places_from
from heatertune.live.recorder import RecordingSetup, RecordingState, record
from heatertune.studio.proof_picture import downsample

__all__ = ["LiveLog", "RecordedTrace", "RecordingRequest"]


_MOST_ROWS: Final = 40_000  # that are kept for the picture; the file has them all
_PIXELS: Final = 700


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingRequest:
    """What the user typed.

    Attributes:
        address: of the PLC.
        where: folder of the design whose controller runs there, or file that says where the quantities stand; "": the
            PLC is a simulator, which tells it itself.
        log: file to write.
        every: least time between two rows, in s; "": each scan, or 1 s where the PLC does not count them.
        append: whether to continue a file that is there.
    """

    address: str
    where: str = ""
    log: str = ""
    every: str = ""
    append: bool = False


class RecordedTrace(NamedTuple):
    """What was recorded, as a picture shows it; shape (n,) each, NaN where the PLC does not show it.

    Attributes:
        part: number of the stretch without a gap that a row belongs to.
    """

    time_s: Array
    temperature_degC: Array
    power_pct: Array
    setpoint_degC: Array
    part: Array


class LiveLog:
    """A recording from its start to its end.

    Attributes:
        path: of the log.
        address: of the PLC, as it was typed.
        so_far: what was recorded; None: there is no connection yet.
        is_over: whether it has ended.
    """

    def __init__(self, request: RecordingRequest) -> None:
        """Take what the user typed.

        Raises:
            HeatertuneError: no address, no log, a time that is none; as
                `heatertune.live.controller_block.places_from`.
        """
        self.address, where = request.address.strip(), request.where.strip()
        if not request.log.strip():
            raise InputError("the log to write: expected a file's name, as log.csv")
        self.path = Path(request.log.strip()).expanduser().absolute()
        self._address = address_of(self.address)
        is_design = bool(where) and Path(where).expanduser().is_dir()
        self._places = places_from(design=where if is_design else None,
                                    map_file=where if where and not is_design else None)
        self._settings = RecordingSetup(every_s=_seconds(request.every), append=request.append)
        self.so_far: RecordingState | None = None
        self.is_over = False
        self._ended = Event()
        self._rows: list[tuple[float, ...]] = []
        self._counted = 0

    def run(self) -> None:
        """Record until `stop`; errors as in `heatertune.live.recorder.record`."""
        try:
            self.so_far = record(self._address, self.path, self._places, self._settings, shown=self._shown,
                                 ended=self._ended.is_set)
        finally:
            self.is_over = True

    def stop(self) -> None:
        """Ask for the end; it comes with the next look, or where the link is lost, with the next try."""
        self._ended.set()

    @property
    def is_ending(self) -> bool:
        """Whether the end was asked for."""
        return self._ended.is_set()

    @property
    def rows(self) -> int:
        """How many rows were written."""
        return 0 if self.so_far is None else self.so_far.rows

    def _shown(self, so_far: RecordingState) -> None:
        self.so_far = so_far
        if so_far.last is None or so_far.rows == self._counted:
            return
        self._counted = so_far.rows
        readings = (so_far.last.signals.get(role, np.nan) for role in ROLES)
        self._rows.append((so_far.last.time_s, *readings, float(so_far.gaps)))
        if len(self._rows) > _MOST_ROWS:
            rows = np.array(self._rows)
            self._rows = [self._rows[number] for number in downsample(rows[:, 0], rows[:, 1], _MOST_ROWS // 10)]

    @property
    def trace(self) -> RecordedTrace:
        """What was recorded, thinned to what a picture shows."""
        rows = np.array(self._rows).reshape(-1, len(RecordedTrace._fields))
        return RecordedTrace(*rows[downsample(rows[:, 0], rows[:, 1], _PIXELS)].T)

    @property
    def state(self) -> str:
        """How it stands, a sentence that changes seldom."""
        so_far, where = self.so_far, f"{self.address} into {self.path}"
        if so_far is None:
            return "" if self.is_over else f"Connecting to {self.address}…"
        gaps = "" if not so_far.gaps else f", {so_far.gaps} gap{'s' if so_far.gaps > 1 else ''}"
        gaps += "".join(f"; {note}" for note in so_far.notes[-1:])
        if self.is_over:
            return f"Ended: {so_far.rows} rows{gaps} in {self.path}."
        if self.is_ending:
            return "Ending…"
        if so_far.trouble:
            return f"No answer, trying again: {so_far.trouble}. What was read before stands in {self.path}."
        return f"Recording {where}{gaps}; the PLC is only read."

    @property
    def latest(self) -> str:
        """The latest row in numbers; "" where there is none."""
        if self.so_far is None or self.so_far.last is None:
            return ""
        last = self.so_far.last
        units = {"temperature": "{:.2f} °C", "power": "{:.1f} %", "setpoint": "setpoint {:.1f} °C"}
        readings = [units[role].format(last.signals[role]) for role in ROLES if role in last.signals]
        return f"{last.time_s:.0f} s: {', '.join(readings)}; {self.rows} rows"


def _seconds(text: str) -> float | None:
    """Return the time between two rows; raise InputError where the text is none."""
    try:
        return float(text.replace(",", ".")) if text.strip() else None
    except ValueError:
        raise InputError(f"least time between two rows: {text!r}; expected seconds, as 1") from None
