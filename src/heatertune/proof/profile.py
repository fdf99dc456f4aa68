"""A profile: ramps and soaks along which the program around the controller leads the setpoint, as kilns are fired.

`firing.csv`: a profile as a table of segments, units in its header; the same columns as lists in `spec.toml`.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from heatertune.errors import DocumentError, InputError
from heatertune.model.model_values import HeaterModel
from heatertune.proof.scenario import can_hold
from heatertune.units import check, count
from heatertune.writing import read_text

__all__ = ["Leg", "Profile", "Segment", "profile_of_table", "rate_text", "read_profile", "table_of"]


_DIGITS: Final = 12  # of a digest, as it is told


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A ramp and the soak at its end.

    Attributes:
        target_degC: of both [°C].
        rate_degC_per_s: how fast the setpoint goes there, up or down [°C/s]; None: in `ramp_s`.
        ramp_s: in what time it does [s]; None: at the rate.
        soak_s: how long it stays there [s].

    Raises:
        InputError: neither or both of rate and time.
        OutOfRange: a rate or time that is not above 0, a soak below 0.
    """

    target_degC: float
    rate_degC_per_s: float | None = None
    ramp_s: float | None = None
    soak_s: float = 0.0

    def __post_init__(self) -> None:
        if (self.rate_degC_per_s is None) == (self.ramp_s is None):
            raise InputError("a ramp has a rate or a duration; expected one of them")
        check("target_degC", self.target_degC, least=-273.15)
        for name in ("rate_degC_per_s", "ramp_s"):
            if (value := getattr(self, name)) is not None:
                check(name, value, above=0.0)
        check("soak_s", self.soak_s, least=0.0)

    def ramp_from(self, start_degC: float) -> float:
        """Return how long the ramp takes from a temperature on [s]."""
        if self.rate_degC_per_s is None:
            return float(self.ramp_s or 0.0)
        return abs(self.target_degC - start_degC) / self.rate_degC_per_s


class Leg(NamedTuple):
    """A ramp, a soak, or what comes after a last ramp without one: from when on, ends, how long, of which segment.

    Attributes:
        begin_s: after the begin of the profile [s].
        from_degC, to_degC: setpoint at its ends [°C].
        duration_s: [s].
        segment: from 1.
        soaks: whether it is a soak.
    """

    begin_s: float
    from_degC: float
    to_degC: float
    duration_s: float
    segment: int
    soaks: bool

    @property
    def degC_per_s(self) -> float:
        """How fast the setpoint moves [°C/s]; 0: a soak."""
        return (self.to_degC - self.from_degC) / self.duration_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """Segments one after the other.

    Attributes:
        name: of its file.
        segments: in order.

    Raises:
        InputError: no segment.
    """

    name: str
    segments: tuple[Segment, ...]

    def __post_init__(self) -> None:
        if not self.segments:
            raise InputError("no segment; expected at least one, with target, ramp and soak")

    @property
    def label(self) -> str:
        """What it is called, and what tells it from others of that name."""
        digest = hashlib.sha256(repr(self.segments).encode()).hexdigest()[:_DIGITS]
        return f"{self.name} ({count(len(self.segments), 'segment')}, sha256 {digest})"

    def legs(self, start_degC: float, watch_s: float = 0.0) -> Iterator[Leg]:
        """Return its ramps and soaks, those left out that take no time.

        Args:
            start_degC: setpoint before the first ramp [°C].
            watch_s: how long the last target is held where it has no soak, so that what its ramp leaves is seen [s].
        """
        begin, reached = 0.0, start_degC
        for number, segment in enumerate(self.segments, 1):
            target = segment.target_degC
            for start, duration in ((reached, segment.ramp_from(reached)), (target, segment.soak_s)):
                if duration > 0.0:
                    yield Leg(begin, start, target, duration, number, start == target)
                    begin += duration
            reached = target
        if watch_s > 0.0 and self.segments[-1].soak_s == 0.0:
            yield Leg(begin, reached, reached, watch_s, len(self.segments), soaks=False)

    def demand_followed(self, models: Sequence[tuple[HeaterModel, float]]) -> None:
        """Refuse a ramp that a heater cannot follow: at full power up, or without power down, as nothing cools it.

        A heater follows where its power a = (setpoint − ambient + lags·rate)/gain is one that it has.

        Args:
            models: the plausible heaters and their ambients [°C]; the ramp begins at that of the first.

        Raises:
            InputError: with the fastest ramp that all of them can follow.
        """
        for leg in self.legs(models[0][1]):
            if not all(can_hold(model, leg.to_degC, ambient) for model, ambient in models):
                least, most = _reach(models)
                raise InputError(f"{self.name}, segment {leg.segment}: target {leg.to_degC:g} °C; expected more than "
                                 f"{least:.4g} and less than {most:.4g} °C, which every plausible heater can hold")
            rate, fastest = leg.degC_per_s, min(_fastest(leg, model, ambient) for model, ambient in models)
            if abs(rate) > fastest:
                way = "at full power" if _by_power(leg, models[0][0]) else "without power"
                raise InputError(
                    f"{self.name}, segment {leg.segment}: {rate_text(abs(rate))} to {leg.to_degC:g} °C is faster than "
                    f"the weakest plausible heater follows {way} there; expected at most {rate_text(fastest)}")


def rate_text(degC_per_s: float) -> str:
    """Return a rate in the unit in which it is a handy number."""
    for factor, unit in ((1.0, "s"), (60.0, "min")):
        if factor * degC_per_s >= 1.0:
            return f"{factor * degC_per_s:.3g} °C/{unit}"
    return f"{3600.0 * degC_per_s:.3g} °C/h"


def _by_power(leg: Leg, model: HeaterModel) -> bool:
    return (leg.to_degC > leg.from_degC) == (model.gain_degC_per_pct > 0.0)


def _fastest(leg: Leg, model: HeaterModel, ambient_degC: float) -> float:
    """Return how fast a heater that can hold the end of a leg can follow up to it, where it is hardest [°C/s]."""
    end = ambient_degC + (100.0 * model.gain_degC_per_pct if _by_power(leg, model) else 0.0)
    return abs(end - leg.to_degC) / sum(model.lags_s)


def _reach(models: Sequence[tuple[HeaterModel, float]]) -> tuple[float, float]:
    """Return between which temperatures all heaters can hold any [°C]."""
    ends = [sorted((ambient, ambient + 100.0 * model.gain_degC_per_pct)) for model, ambient in models]
    return max(low for low, _ in ends), min(high for _, high in ends)


_HEAD: Final = re.compile(r"\s*(\w+)\s*[\[(]\s*(.+?)\s*[\])]\s*\Z")
_EXPECTED: Final = "target [degC], ramp [degC/h] (or ramp [min]), soak [min]"
_TIMES: Final = {"s": 1.0, "min": 60.0, "h": 3600.0}
#: unit of a temperature → degrees Celsius per degree, and where its zero is [°C]
_TEMPERATURES: Final = {"degC": (1.0, 0.0), "degF": (5.0 / 9.0, -160.0 / 9.0)}
_RATES: Final = {f"{degree}/{time}": size / seconds for degree, (size, _) in _TEMPERATURES.items()
                 for time, seconds in _TIMES.items()}
_SPELLINGS: Final = (("°", "deg"), ("deg C", "degC"), ("deg F", "degF"))
#: names of columns
_NAMES: Final = {"target": "target", "temperature": "target", "ramp": "ramp", "rate": "ramp", "duration": "ramp",
                 "soak": "soak", "hold": "soak"}


class _Column(NamedTuple):
    """What a column sets, as its header calls it, and how its numbers become °C, °C/s or s."""

    sets: str
    head: str
    factor: float
    zero: float = 0.0


#: a row of cells, and its place for errors
_Row = tuple[str, Sequence[str]]


def read_profile(path: str | Path) -> Profile:
    """Return the profile of a CSV file; its cells are set apart by ",", ";" or tabs, "#" begins a remark.

    Raises:
        DocumentError: the file cannot be read, or is no such table; it names the line, the column and the value.
    """
    try:
        lines = read_text(path).removeprefix("\ufeff").splitlines()  # as spreadsheets begin a file
    except OSError as problem:
        raise DocumentError(f"{path}: cannot be read: {problem.strerror}") from problem
    except ValueError as problem:
        raise DocumentError(f"{path}: no text; expected the columns {_EXPECTED}") from problem
    written = [(number, line) for number, line in enumerate(lines, 1)
               if line.strip() and not line.lstrip().startswith("#")]
    if not written:
        raise DocumentError(f"{path}: empty; expected the columns {_EXPECTED}")
    separator = next((mark for mark in (";", "\t") if mark in written[0][1]), ",")
    rows = [(f"{path}, line {number}", [cell.strip().strip('"').strip() for cell in line.split(separator)])
            for number, line in written]
    if separator == ";":
        rows = [(place, [cell.replace(",", ".") for cell in cells]) for place, cells in rows]
    return _profile(Path(path).name, rows[0], rows[1:])


def profile_of_table(name: str, table: Mapping[str, object], where: str) -> Profile:
    """Return the profile of a table of lists, each under the header of its column.

    Raises:
        DocumentError: it is no such table; it names `where`, the row, the column and the value.
    """
    columns = [list(column) if isinstance(column, list) else [column] for column in table.values()]
    if len({len(column) for column in columns}) > 1:
        raise DocumentError(f"{where}: lists of different lengths; expected one number for each segment in each")
    rows = [(f"{where}, segment {number}", list(map(str, cells)))
            for number, cells in enumerate(zip(*columns, strict=True), 1)]
    return _profile(name, (where, list(table)), rows)


def table_of(profile: Profile) -> dict[str, str]:
    """Return a profile as the lists of a TOML table, each by the header of its column."""
    columns: dict[str, list[float | None]] = {
        "target [degC]": [segment.target_degC for segment in profile.segments],
        "ramp [degC/h]": [segment.rate_degC_per_s and 3600.0 * segment.rate_degC_per_s for segment in profile.segments],
        "ramp [min]": [segment.ramp_s and segment.ramp_s / 60.0 for segment in profile.segments],
        "soak [min]": [segment.soak_s / 60.0 for segment in profile.segments]}
    return {head: f"[{', '.join(map(_cell, cells))}]" for head, cells in columns.items()
            if cells.count(None) < len(cells)}


def _cell(number: float | None) -> str:
    return '""' if number is None else f"{number:.12g}"


def _profile(name: str, head: _Row, rows: Iterable[_Row]) -> Profile:
    try:
        columns = _columns(head)
        return Profile(name=name, segments=tuple(_segment(place, cells, columns) for place, cells in rows))
    except DocumentError:
        raise
    except InputError as problem:
        raise DocumentError(f"{head[0]}: {problem}") from problem


def _columns(head: _Row) -> list[_Column]:
    place, cells = head
    columns = [_column(place, cell) for cell in cells]
    sets = [column.sets for column in columns]
    for needed in (("target_degC",), ("rate_degC_per_s", "ramp_s"), ("soak_s",)):
        if not any(name in sets for name in needed):
            raise DocumentError(f"{place}: no column {needed[0].partition('_')[0]}; expected {_EXPECTED}")
    if len(set(sets)) < len(sets):
        raise DocumentError(f"{place}: {', '.join(cells)}: a column twice; expected {_EXPECTED}")
    return columns


def _column(place: str, cell: str) -> _Column:
    spelled = _HEAD.match(cell)
    if spelled is None or spelled[1].lower() not in _NAMES:
        raise DocumentError(f"{place}: {cell!r} is no column with its unit; expected {_EXPECTED}")
    unit = spelled[2]
    for written, meant in _SPELLINGS:
        unit = unit.replace(written, meant)
    name = _NAMES[spelled[1].lower()]
    if name == "target" and unit in _TEMPERATURES:
        return _Column("target_degC", cell, *_TEMPERATURES[unit])
    if name == "ramp" and unit in _RATES:
        return _Column("rate_degC_per_s", cell, _RATES[unit])
    if name != "target" and unit in _TIMES:
        return _Column(f"{name}_s", cell, _TIMES[unit])
    units = {"target": _TEMPERATURES, "ramp": [*_RATES, *_TIMES], "soak": _TIMES}[name]
    raise DocumentError(f"{place}: column {cell!r} has the unit {spelled[2]!r}; expected {' or '.join(units)}")


def _segment(place: str, cells: Sequence[str], columns: Sequence[_Column]) -> Segment:
    if len(cells) != len(columns):
        raise DocumentError(f"{place}: {len(cells)} cells; expected {len(columns)}, one for each column")
    pairs = list(zip(columns, cells, strict=True))
    values = {column.sets: _number(place, column, cell) for column, cell in pairs
              if cell or column.sets == "target_degC"}
    ramps = [column for column, cell in pairs if cell and column.sets in ("rate_degC_per_s", "ramp_s")]
    if len(ramps) != 1:
        heads = " or ".join(column.head for column in columns if column.sets in ("rate_degC_per_s", "ramp_s"))
        raise DocumentError(f"{place}: {len(ramps) or 'no'} ramps; expected a number in column {heads}")
    return Segment(**values)


def _number(place: str, column: _Column, cell: str) -> float:
    expected = {"target_degC": "a temperature", "soak_s": "a time of 0 or more"}.get(column.sets, "a number above 0")
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    value = column.zero + column.factor * number
    least = {"target_degC": -273.15, "soak_s": 0.0}.get(column.sets, 1e-12)
    if not least <= value < 1e9 or "_" in cell:
        raise DocumentError(f"{place}, column {column.head}: {cell!r}; expected {expected}")
    return value
