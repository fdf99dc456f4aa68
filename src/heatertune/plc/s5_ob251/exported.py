"""The exported S5 program, statement by statement in its CPU; OB251 itself, which is firmware, is the proof's."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import lru_cache
from operator import itemgetter
from typing import Final

from heatertune.plc.cpu.s5.machine import S5Cpu
from heatertune.plc.exported import CallResult, ExportedInPlc
from heatertune.plc.ramp import Number
from heatertune.plc.s5_ob251.blocks import DB, FOUR_MA, INPUT, MODE, OUTPUT, START, WORK
from heatertune.plc.s5_ob251.step import COLD, FULL_SCALE, REG_AUS, Ob251Assumptions, Ob251Parameters, call, percent
from heatertune.plc.s5_ob251.words import FIELDS, parameters_of

__all__ = ["loaders"]

_INTERVAL: Final = "RS 97"
#: of DB31: setpoint asked for, YA, calls of OB13 until OB251's, the staircase with its remainder, YA of this period
_ASKED, _YA, _DUE, _STAIRS, _PART, _YA_OF_PERIOD = 0, 4, 5, 6, 7, 8
_FAR: Final = 32767
_WIRE_BREAK: Final = 2
_FILE: Final = "program_listing.txt"
_PLACES: Final = {field.name: int(field.address.removeprefix("DW")) for field in FIELDS}
_words_typed: Final = itemgetter(*_PLACES.values())


class ExportedS5(ExportedInPlc):
    """See `heatertune.plc.exported.ExportedInPlc`."""

    def __init__(self, listing: str, assume: Ob251Assumptions) -> None:
        """Load a listing; raise InputError where it has what the CPU does not know."""
        self._cpu = S5Cpu(listing, {"OB 251": self._ob251})
        self._own, self._work = self._cpu.block(DB, max(_PLACES.values())), self._cpu.block(WORK, _YA_OF_PERIOD)
        self._typed = {number: list(words) for number, words in self._cpu.data.items()}
        start = listing.partition(f"\nFB {START}\n")[2].partition("\nFB ")[0].partition("\nOB ")[0]
        self._clears = "OB 251" in start
        self._zero = FOUR_MA if re.search(rf"\+{FOUR_MA} *; 4 mA", listing) else 0
        self._assume, self._state = assume, COLD
        self._asked: Number | None = None
        self._cpu.inputs[MODE] = 1
        self.start()

    @property
    def tick_s(self) -> float:
        """Interval of OB13, which system data word 97 tells [s]."""
        return self._cpu.outputs.get(_INTERVAL, 0) / 100.0

    def start(self) -> None:
        """Run OB22, with the data blocks as they were, or as they were typed where nothing was kept."""
        if not self._assume.retained and not self._clears:  # what it leaves to a battery
            self._forget()
        self._cpu.run("OB 22")
        self._begun = False

    def call(self, asked: Number, counts: int, reading_degC: float) -> CallResult:
        """Run OB13 when OB251 is due."""
        if self._begun:
            self._work[_DUE] = 1
        return self.tick(asked, counts, reading_degC)[0]

    def tick(self, asked: Number, counts: int, reading_degC: float) -> tuple[CallResult, bool | None]:  # noqa: ARG002
        """Run OB13."""
        if self._asked not in (None, asked):
            self._work[_ASKED] = int(asked)
        self._asked, self._begun = asked, True
        self._cpu.inputs[INPUT] = counts + self._zero << 3
        self._cpu.run("OB 13")
        output = self._own[48]
        return CallResult(self._own[_PLACES["W"]], output, percent(output)), self._on()

    def interrupt(self) -> tuple[float, bool | None]:
        """Run OB13 with the wire-break bit, and start up: without that, manual and its power come first."""
        self._cpu.inputs[INPUT] |= _WIRE_BREAK
        self._cpu.run("OB 13")
        power, on = percent(self._work[_YA]), self._on()
        self._cpu.inputs[INPUT] &= ~_WIRE_BREAK
        if not self._clears:
            self._forget()
        self.start()
        return power, on

    def begin(self, output: Number, ticks: int) -> bool | None:  # noqa: ARG002 - the staircase's end begins a period
        """Run OB13 where a period begins with this YA."""
        work = self._work
        work[_YA], work[_DUE], work[_STAIRS], work[_PART] = int(output), _FAR, FULL_SCALE, 0
        work[_YA_OF_PERIOD] = FULL_SCALE - int(output)  # anything else than what it has to become
        self._cpu.run("OB 13")
        return self._on()

    def go_on(self) -> bool:
        """Run OB13."""
        self._cpu.run("OB 13")
        return bool(self._on())

    def tick_count(self) -> None:
        """Return None: the staircase rises tick by tick."""

    def _forget(self) -> None:
        """Take the data blocks as they were typed, but for the setpoint."""
        for number, words in self._typed.items():
            self._cpu.data[number][:] = words
        if self._asked is not None:
            self._work[_ASKED] = int(self._asked)
        self._state = COLD

    def _on(self) -> bool | None:
        on = self._cpu.outputs.get(OUTPUT)
        return None if on is None else on != 0

    def _ob251(self, dw: list[int]) -> None:
        p = _parameters(_words_typed(dw))
        if p.steu & REG_AUS:
            dw[18:49] = [0] * 31
        self._state = call(p, self._assume, self._state, dw[_PLACES["W"]], dw[22], dw[24], dw[29])
        dw[48] = self._state.output


@lru_cache(maxsize=16)
def _parameters(typed: tuple[int, ...]) -> Ob251Parameters:
    """Return the words as the algorithm uses them; they seldom change."""
    return parameters_of(dict(zip(_PLACES, typed, strict=True)))


def loaders(files: Mapping[str, str | bytes], assume: Ob251Assumptions) -> dict[str, Callable[[], ExportedS5]]:
    """Return what loads the listing."""
    return {_FILE: lambda: ExportedS5(str(files[_FILE]), assume)}
