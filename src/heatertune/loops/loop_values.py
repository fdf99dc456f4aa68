"""The loops of a folder of logs, with a list of what their logs do not say; and the values of a diagnosis."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from pathlib import Path, PurePath
from typing import Any, Final

from heatertune.codec import read_toml
from heatertune.errors import HeatertuneError, InputError, UnknownName, did_you_mean
from heatertune.plc import controller_for
from heatertune.proof.ripple_and_wear import SWITCHES
from heatertune.units import check
from heatertune.writing import read_text

__all__ = ["Cause", "LoopEntry", "LoopFault", "list_loops", "read_list"]


class Cause(Enum):
    """What is wrong with a loop; each member's value is what to do about it."""

    FULL_POWER = "a stronger heater, less loss or a lower setpoint: no words help"
    NO_POWER = "look for heat from elsewhere, a stuck switch or a setpoint below the room: no words help"
    DRIFTED = "look at the heater (element, mains, insulation, sensor); then take the new words"
    OSCILLATING = "take calmer words"
    OFFSET = "take words with an integral part"
    SLUGGISH = "take faster words"
    WEAR = "take a longer PWM period"
    UNKNOWN = "log the power and a change of the setpoint until it rests, or list the controller and its words"
    WELL = "nothing"

    @property
    def label(self) -> str:
        """The cause as a table has it."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopEntry:
    """A loop as the list has it; what is not said is None or its default.

    Attributes:
        name: of the loop.
        file: its log, a path below the folder; of a loop that is recorded, the address of its PLC.
        target: the controller.
        folder: what `design` wrote for it: its words, and the heater they were made for.
        setpoint_degC: where the log holds none [°C].
        switch: what switches the heater, one of `heatertune.proof.ripple_and_wear.SWITCHES`; None: not known.
        pwm_period_s: of it [s].
        low_degC, high_degC: range of the sensor [°C]; None: that of its words, or as asked for.
        map: small file that says where the PLC shows temperature and power, where no `folder` does; of a loop that is
            recorded.

    Raises:
        OutOfRange: a period that is not above zero, a setpoint below the absolute zero, half a range or an empty one.
        UnknownName: no such switch.
    """

    name: str
    file: str
    target: str | None = None
    folder: str | None = None
    setpoint_degC: float | None = None
    switch: str | None = None
    pwm_period_s: float | None = None
    low_degC: float | None = None
    high_degC: float | None = None
    map: str | None = None

    def __post_init__(self) -> None:
        if self.pwm_period_s is not None:
            check("pwm_period_s", self.pwm_period_s, above=0.0)
        if self.setpoint_degC is not None:
            check("setpoint_degC", self.setpoint_degC, least=-273.15)
        if self.low_degC is not None or self.high_degC is not None:
            check("low_degC", math.nan if self.low_degC is None else self.low_degC, least=-273.15)
            check("high_degC", math.nan if self.high_degC is None else self.high_degC, above=self.low_degC)
        if self.switch is not None and self.switch not in SWITCHES:
            raise UnknownName("switch", self.switch, tuple(SWITCHES))


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopFault:
    """One thing that is wrong.

    Attributes:
        cause: what.
        excess: how far it is beyond what is accepted: 1 is just there.
        told: one sentence with its numbers.
    """

    cause: Cause
    excess: float
    message: str


_KEYS: Final = tuple(field.name for field in fields(LoopEntry))
_Entry = Mapping[str, Any]
_NUMBERS: Final = ("setpoint_degC", "pwm_period_s", "low_degC", "high_degC")


def list_loops(names: Sequence[str], entries: Mapping[str, LoopEntry]) -> list[LoopEntry]:
    """Return a loop for each log, by its file; what the list says of it is in the place of its name alone.

    Raises:
        InputError: the list names a file that is no log of the folder.
    """
    for file in entries:
        if file not in names:
            raise InputError(f"the list names {file!r}, which is no log of the folder{did_you_mean(file, names)}")
    return [entries.get(name, LoopEntry(name=str(PurePath(name).with_suffix("")), file=name)) for name in names]


def read_list(path: str | Path) -> dict[str, LoopEntry]:
    """Return file → loop of a list: a CSV table with a head, or a TOML file with one [[loop]] each.

    Raises:
        InputError: it cannot be read, or an entry is not right; the line (of a TOML file: the entry) is named.
    """
    told: dict[str, LoopEntry] = {}
    names: dict[str, str] = {}
    entries = _entries_of_toml if Path(path).suffix.lower() == ".toml" else _entries_of_csv
    for where, entry in entries(Path(path)):
        loop = _loop(entry, where)
        if loop.file in told:
            raise InputError(f"{where}: the log {loop.file!r} is listed twice; a loop has one log")
        if loop.name in names:
            raise InputError(f"{where}: the name {loop.name!r} is that of {names[loop.name]!r}, too; give another one")
        told[loop.file], names[loop.name] = loop, loop.file
    return told


def _entries_of_toml(path: Path) -> Iterator[tuple[str, _Entry]]:
    document = read_toml(path)
    if set(document) != {"loop"} or not isinstance(document["loop"], list):
        raise InputError(f"{path}: expected [[loop]] entries and nothing else")
    for number, entry in enumerate(document["loop"], 1):
        if not isinstance(entry, dict):
            raise InputError(f"{path}, loop {number}: expected a table, [[loop]]")
        yield f"{path}, loop {number}", entry


def _entries_of_csv(path: Path) -> Iterator[tuple[str, _Entry]]:
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(f"{path}: cannot be read as a list; expected CSV or TOML as UTF-8") from problem
    rows = csv.reader(io.StringIO(text), delimiter=";" if ";" in text.partition("\n")[0] else ",")
    heads = [head.strip() for head in next(rows, [])]
    for row in rows:
        where = f"{path}, line {rows.line_num}"
        cells = [cell.strip() for cell in row]
        if any(cells) and len(cells) != len(heads):
            raise InputError(f"{where}: {len(cells)} cells; expected {len(heads)}, as in the first line")
        if any(cells):
            yield where, {head: cell for head, cell in zip(heads, cells, strict=True) if cell}


def _loop(entry: _Entry, where: str) -> LoopEntry:
    for key in entry:
        if key not in _KEYS:
            raise InputError(f"{where}: unknown field {key!r}{did_you_mean(key, _KEYS)}; expected {', '.join(_KEYS)}")
    if "file" not in entry:
        raise InputError(f"{where}: no file; every loop names its log")
    values: dict[str, Any] = {
        key: _number(value, key, where) if key in _NUMBERS else str(value) for key, value in entry.items()}
    file = str(entry["file"])
    values.setdefault("name", file if "://" in file else str(PurePath(file).with_suffix("")))
    try:
        if "target" in values:
            controller_for(values["target"])
        return LoopEntry(**values)
    except HeatertuneError as problem:
        raise InputError(f"{where}: {problem}") from problem


def _number(value: Any, key: str, where: str) -> float:
    try:
        if isinstance(value, bool):
            raise TypeError
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{where}, field {key}: no number: {value!r}") from None
