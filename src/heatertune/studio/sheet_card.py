"""The sheet for a dropped file: first rows, the role and unit of each column, assumptions; all can be changed.

`heatertune.log.read_log` decides; a change becomes one of its options. In the HTML, elements that can be changed have
`data-change`, `data-place` and `data-key`.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from operator import methodcaller
from pathlib import Path
from typing import Any, Final

import numpy as np
from nicegui import ui

from heatertune.errors import HeatertuneError, InputError, LogError
from heatertune.log import read_log
from heatertune.log.cells import heaters_in, plain_cells, read_sheet
from heatertune.log.columns import NO_COLUMN, find_columns, with_names
from heatertune.log.log_values import Log
from heatertune.log.partial_rows import is_quality
from heatertune.log.quantities import role_of
from heatertune.log.sheet import Sheet
from heatertune.log.tags import TagSelection, places
from heatertune.options import Option, options_of
from heatertune.report.html import bullets, text_of
from heatertune.settings import AsLeftSettings, FitSettings, ReadSettings
from heatertune.studio.charts import DRAGGED, preview
from heatertune.studio.controls import NUMBER_SEEN, number_field, select_field
from heatertune.studio.wording import for_page
from heatertune.units import check

__all__ = ["IGNORED", "ROLES", "DroppedFile", "SheetAssumptions", "SheetCard", "SheetColumn", "change_sheet", "sheet"]

IGNORED: Final = "ignored"
#: of a column, as the user chooses them
ROLES: Final = ("time", "date", "temperature", "power", "setpoint", "disturbance", "zone", IGNORED)
#: of a tag of a long table
_TAG_ROLES: Final = ("temperature", "power", "setpoint", IGNORED)
#: of a column of a long table
_LONG_ROLES: Final = ("time", "tags", "values", "quality", IGNORED)
_TAG_OPTIONS: Final = {"temperature": "tag", "power": "power_tag", "setpoint": "setpoint_tag"}
_LONG_OPTIONS: Final = {
    "time": "time_column", "date": "date_column", "tags": "tag_column", "values": "temperature_column",
    "quality": "quality_column"}
_OPTIONS: Final = {role: f"{role}_column" for role in ROLES if role not in ("zone", IGNORED)} | {"zone": "tag_column"}
_ROWS: Final = 6
_LINES: Final = 8  # of a file that is no table
_LONGEST: Final = 200  # characters of one of them
_MOST_TAGS: Final = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetColumn:
    """One column of a file, or one tag of a long table.

    Attributes:
        name: as the file has it, else its number.
        role: what it was taken as.
        roles: what it may be.
        unit: as the reader took it; for a power its reading at full power; "" where there is none to tell.
        cells: of the first rows.
    """

    name: str
    role: str
    roles: tuple[str, ...]
    unit: str = ""
    cells: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetAssumptions:
    """What the file does not say and the user may.

    Attributes:
        ambient_degC: temperature without power; None: found by the fit [°C].
        power_before_pct: before the first reading; None: found by the fit [%].
        power_pct: throughout a log that holds no power; None: not known [%].
        largest_power_pct: that the heater got in such a log; None: not known [%].
        from_s, until_s: first and last instant of the log that is fitted; None: of the log [s].
        setpoint_degC, begins_s, load_at_s: of a trace of the commissioned loop, see `AsLeftSettings`.

    Raises:
        OutOfRange: a value without meaning.
    """

    ambient_degC: float | None = None
    power_before_pct: float | None = None
    power_pct: float | None = None
    largest_power_pct: float | None = None
    from_s: float | None = None
    until_s: float | None = None
    setpoint_degC: float | None = None
    begins_s: float | None = None
    load_at_s: float | None = None

    def __post_init__(self) -> None:
        if self.power_pct is not None:
            check("constant power", self.power_pct, least=0.0, most=100.0)
        _ = self.fit_settings, self.about

    @property
    def fit_settings(self) -> FitSettings:
        """What the fit is told; a constant power begins from none, where nothing else is said."""
        before = 0.0 if self.power_before_pct is None and self.power_pct is not None else self.power_before_pct
        return FitSettings(ambient_degC=self.ambient_degC, power_before_pct=before, from_s=self.from_s,
                           until_s=self.until_s, largest_power_pct=self.largest_power_pct)

    def window(self, log: Log) -> tuple[float, float]:
        """Return first and last instant of a log that are fitted [s].

        Raises:
            OutOfRange: fewer than 20 readings lie between them.
        """
        first, last = float(log.time_s[0]), float(log.time_s[-1])
        begin, end = (first if self.from_s is None else self.from_s, last if self.until_s is None else self.until_s)
        log.window(begin, end)
        return begin, end

    @property
    def about(self) -> AsLeftSettings:
        """What is known beside a trace of the commissioned loop."""
        return AsLeftSettings(setpoint_degC=self.setpoint_degC, ambient_degC=self.ambient_degC, begins_s=self.begins_s,
                              load_at_s=self.load_at_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class DroppedFile:
    """A file and how it is understood.

    Attributes:
        name, content: of the file.
        power_content: of the power's own file, which `settings` name; None: there is none.
        settings: how it is read.
        assumed: what the user adds.
        log: None where it cannot be read.
        problem: why not, in one line, else "".
        columns: in the order of the file; empty where it is no table.
        tags: of a long table, else empty.
        zones: what the column that tells zones apart holds, or the heaters of a printer, else empty; `zone` is the one
            that is read.
        lines: first lines of a file that is no table.
    """

    name: str
    content: bytes = field(repr=False)
    power_content: bytes | None = field(default=None, repr=False)
    settings: ReadSettings = field(default_factory=ReadSettings)
    assumptions: SheetAssumptions = field(default_factory=SheetAssumptions)
    log: Log | None = None
    problem: str = ""
    columns: tuple[SheetColumn, ...] = ()
    tags: tuple[SheetColumn, ...] = ()
    zones: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, name: str, content: bytes, settings: ReadSettings | None = None, assumed: SheetAssumptions | None = None,
        power_content: bytes | None = None,
    ) -> DroppedFile:
        """Return how a file is understood; whatever it holds, this never fails.

        Args:
            name: of the file.
            content: of the file.
            settings: how it is read; None: as it is found.
            assumed: what the user adds; None: nothing.
            power_content: of the power's own file, which `settings` name; None: there is none.
        """
        plain = Path(name.replace("\\", "/").replace("\0", "")).name or "log.csv"
        settings, assumed = settings or ReadSettings(), assumed or SheetAssumptions()
        log, problem = None, ""
        try:
            log = _assuming(replace(
                read_log(plain, settings, content=content, power_content=power_content), source=plain), assumed)
            assumed.window(log)
        except HeatertuneError as refused:
            log, problem = None, str(refused)
        common: dict[str, Any] = {"settings": settings, "assumptions": assumed, "log": log, "problem": problem,
                                  "power_content": power_content}
        sheet, heaters = None, list[str]()
        with suppress(LogError):
            several = heaters_in(Path(plain), content)
            heaters = several if len(several) > 1 else []
        with suppress(LogError, IndexError):
            sheet = plain_cells(with_names(read_sheet(
                Path(plain), content, settings.skip_rows, settings.tag, settings.decimal_comma,
                skip_empty=settings.skip_empty)))
        if sheet is None or not len(sheet):
            text = "" if b"\0" in content[:_LINES] else content[:_LINES * _LONGEST].decode("utf-8", "replace")
            lines = tuple(line[:_LONGEST] for line in text.splitlines()[:_LINES])
            return cls(name=plain, content=content, lines=lines, zones=tuple(heaters), **common)
        reading = _reading(sheet, settings) if log is None or log.taken is None else log.taken.reading
        columns, tags = _columns(sheet, reading, log), _tags(sheet, reading)
        place = next((i for i, column in enumerate(columns) if column.role == "zone"), None)
        zones = heaters if place is None else islice(dict.fromkeys(sheet.columns[place]), _MOST_TAGS)
        return cls(name=plain, content=content, columns=columns, tags=tags, zones=tuple(zones), **common)

    @property
    def is_long(self) -> bool:
        """Whether the file is a long table: a row for each tag."""
        return bool(self.tags)

    def with_role(self, number: int, role: str, *, tag: bool = False) -> DroppedFile:
        """Return the file with another role of a column, or of a tag; who had that role has none."""
        columns, options = (self.tags, _TAG_OPTIONS) if tag else (self.columns, _options(long=self.is_long))
        roles = [IGNORED if one.role == role else one.role for one in columns]
        roles[number] = role
        changed: dict[str, Any] = dict.fromkeys(options.values())
        for role_, option in options.items():
            if role_ in roles:
                place = roles.index(role_)
                changed[option] = columns[place].name if tag else _reference(columns, place)
            elif role_ in ("power", "setpoint", "quality", "date"):
                changed[option] = NO_COLUMN
        if not (self.is_long or tag):
            changed["tag"] = self.columns[roles.index("zone")].cells[0] if "zone" in roles else None
        return self.read(**changed)

    @property
    def run(self) -> int | None:
        """Which of several runs is read, 1 = first; None: the file holds one."""
        run = None if self.log is None or self.log.taken is None else self.log.taken.reading.get("run")
        return run if isinstance(run, int) else self.settings.run

    @property
    def zone(self) -> str:
        """The zone or heater whose rows are read, "" where nothing tells several apart, or none is chosen."""
        read = {} if self.log is None or self.log.taken is None else self.log.taken.reading
        return str(self.settings.tag or read.get("tag", "")) if self.zones else ""

    def read(self, **changed: Any) -> DroppedFile:
        """Return the file read with other settings; what is out of range is told and changes nothing."""
        try:
            return DroppedFile.of(self.name, self.content, replace(self.settings, **changed), self.assumptions,
                                  self.power_content)
        except HeatertuneError as refused:
            return self.with_problem(refused)

    def assume(self, **changed: float | None) -> DroppedFile:
        """Return the file with other assumptions; errors as in `read`."""
        try:
            return DroppedFile.of(self.name, self.content, self.settings, replace(self.assumptions, **changed),
                                  self.power_content)
        except HeatertuneError as refused:
            return self.with_problem(refused)

    def with_file(self, file: DroppedFile) -> DroppedFile:
        """Return both files as one log where one holds a temperature alone and one its power, else the new."""
        for first, second in ((self, file), (file, self)):
            if first.log is not None and first.log.power_pct is None and second.log is None:
                both = DroppedFile.of(first.name, first.content, replace(first.settings, power_log=second.name),
                                      first.assumptions, second.content)
                if both.log is not None:
                    return both
        return file

    def with_problem(self, problem: HeatertuneError) -> DroppedFile:
        """Return the file with what is wrong with the last change."""
        return replace(self, problem=str(problem), log=None)

    def to_log(self) -> tuple[Log, FitSettings]:
        """Return the log, and what is known beside it.

        Raises:
            InputError: it cannot be read.
        """
        if self.log is None:
            raise InputError(self.problem)
        settings = self.assumptions.fit_settings
        # a power that is logged, or stated throughout, tells more
        return self.log, settings if self.log.power_pct is None else replace(settings, largest_power_pct=None)


def change_sheet(dropped: DroppedFile, change: str, place: int, value: str) -> DroppedFile:
    """Return a file with one thing changed as the page names it; a value without meaning is told.

    Args:
        dropped: the file.
        change: "column", "tag" (its role), "answer" (one of `answers_to`), "window" (first and last instant [s] with a
            space between them, or only that), a field of `SheetAssumptions`, or one of `_SAID`.
        place: of the column or tag.
        value: as typed or chosen.
    """
    if change in ("column", "tag"):
        return dropped.with_role(place, value, tag=change == "tag")
    if change == "answer":
        answers = answers_to(dropped.problem)
        return dropped.read(**dict([answers[value]])) if value in answers else dropped
    try:
        if change == "window":
            begin, _, end = value.partition(" ")
            return dropped.assume(from_s=_number_sheet(begin), until_s=_number_sheet(end))
        if change in SheetAssumptions.__slots__:
            return dropped.assume(**{change: _number_sheet(value)})
        option, meant = _SAID[change]
        return dropped.read(**{option: meant(value)})
    except HeatertuneError as refused:
        return dropped.with_problem(refused)


_WORD: Final = re.compile(r"""\"[^\"]*\"|'[^']*'|[^\s,;()]+""")
_NAMED_OPTION: Final = re.compile(
    rf"(--[a-z]+(?:-[a-z]+)*)\b(?: with the [^(]*\(([^)]*)\?\)|((?:[ ,]+(?:or )?(?!-+[a-z])(?:{_WORD.pattern}))*))")
_PLACEHOLDER: Final = re.compile(r"[A-Z]+")


def answers_to(problem: str) -> dict[str, tuple[str, object]]:
    """Return the options of the reader that a message names together with their values, as the user would type them.

    Args:
        problem: the message, empty if there is none.

    Returns:
        Option and value → field of `ReadSettings` and its value.
    """
    flags = {option.flag: option for option in options_of(ReadSettings).values()}
    answers: dict[str, tuple[str, object]] = {}
    for flag, candidates, rest in _NAMED_OPTION.findall(problem):
        if (option := flags.get(flag)) is not None:
            for words in map(str.split, candidates.split(" or ")) if candidates else [_WORD.findall(rest)]:
                answers |= {f"{flag} {text}".strip(): (option.name, value) for text, value in _values(option, words)}
    return answers


def _values(option: Option, words: Sequence[str]) -> list[tuple[str, object]]:
    """Return the text typed for an option, and its value, of the words that follow its name."""
    plain = [*map(methodcaller("strip", "'\",.:"), words)]
    if option.kind is bool:
        return [("", True)]
    if option.choices:
        return [(word, word) for word in plain if word in option.choices]
    texts = plain[:2 if option.pair else 1]
    try:
        values = tuple(map(option.kind, texts))
    except ValueError:  # words of the sentence
        return []
    if not option.pair:
        return [(text, value) for text, value in zip(texts, values, strict=True) if not _PLACEHOLDER.fullmatch(text)]
    return [(" ".join(texts), values)]


def _number_sheet(text: str) -> float | None:
    """Return a typed number, with decimal point or comma; None where nothing is typed."""
    try:
        return float(text.replace(",", ".")) if text.strip() else None
    except ValueError as problem:
        raise InputError(f"{text!r} is no number") from problem


def _whole(text: str) -> int | None:
    number = _number_sheet(text)
    if number is not None and number != int(number):
        raise InputError(f"{text!r} is no whole number")
    return None if number is None else int(number)


#: what the page can change → option of the reader, and how a text becomes its value
_SAID: Final[Mapping[str, tuple[str, Callable[[str], Any]]]] = {
    "zone": ("tag", lambda text: text or None),
    "temperature_unit": ("temperature_unit", lambda text: text or None),
    "time_unit": ("time_unit", lambda text: text or None),
    "skip_empty": ("skip_empty", bool),
    "run": ("run", _whole),
    "skip_rows": ("skip_rows", lambda text: _whole(text) or 0),
    "power_full_scale": ("power_full_scale", _number_sheet),
    "sample_time_s": ("sample_time_s", _number_sheet),
}


def _options(*, long: bool) -> Mapping[str, str]:
    return _LONG_OPTIONS if long else _OPTIONS


def _assuming(log: Log, assumed: SheetAssumptions) -> Log:
    """Return a log without power with a constant one, which is told, where the user says so."""
    if assumed.power_pct is None or log.power_pct is not None:
        return log
    repair = f"The power is not in the file; taken as {assumed.power_pct:g} % throughout, as you say."
    return replace(log, repairs=(*log.repairs, repair)).with_rows(power_pct=np.full(len(log.time_s), assumed.power_pct))


def _reading(sheet: Sheet, settings: ReadSettings) -> dict[str, Any]:
    """Return the options of a reading that failed: what the user says, else what the names tell."""
    options = {name: getattr(settings, name) for name in ReadSettings.__slots__}
    options = {name: value for name, value in options.items() if value is not None}
    tag, value = _long_places(sheet, settings)
    if tag is not None and value is not None:
        by_option = {"time_column": next((i for i, name in enumerate(sheet.header) if role_of(name) == "time"), None),
                     "quality_column": next((i for i, name in enumerate(sheet.header) if is_quality(name)), None),
                     "tag_column": tag, "temperature_column": value}
        return {option: str(place + 1) for option, place in by_option.items() if place is not None} | options
    column_names = {role: options[option] for role, option in _OPTIONS.items()
                    if option in options and role not in ("date", "zone")}
    try:
        columns = find_columns(sheet, column_names)
    except LogError:
        return options
    units = {option: unit for role, option in (("time", "time_unit"), ("temperature", "temperature_unit"))
             if role in columns.index and (unit := columns.unit(role)) is not None}
    return {f"{role}_column": str(place + 1) for role, place in columns.index.items()} | units | options


def _long_places(sheet: Sheet, settings: ReadSettings) -> tuple[int | None, int | None]:
    selection = TagSelection(
        temperature=settings.tag, power=settings.power_tag, setpoint=settings.setpoint_tag, column=settings.tag_column,
        value=settings.temperature_column)
    try:
        return places(sheet, selection)
    except LogError:
        return None, None


def _columns(sheet: Sheet, reading: Mapping[str, Any], log: Log | None) -> tuple[SheetColumn, ...]:
    long = reading.get("tag_column") is not None and bool(_tags(sheet, reading))
    roles: dict[int, str] = {}
    for role, option in _options(long=long).items():
        place = _place(sheet, reading.get(option))
        if place is not None:
            roles.setdefault(place, role)
    return tuple(
        SheetColumn(name=name, role=roles.get(i, IGNORED), roles=_LONG_ROLES if long else ROLES,
               unit=_unit_sheet(roles.get(i, IGNORED), reading, log),
               cells=tuple(sheet.columns[i][:_ROWS]))
        for i, name in enumerate(sheet.names()))


def _unit_sheet(role: str, reading: Mapping[str, Any], log: Log | None) -> str:
    """Return the unit of a column as the page shows it, "" where the user has to choose it: a select shows "unit?"."""
    if log is not None and log.taken is not None and ("temperature" if role == "values" else role) in log.taken.assumed:
        return ""
    if role == "time":
        stamps = log is not None and log.taken is not None and log.taken.columns.get("time", ("", ""))[1] == "stamps"
        return "stamps" if stamps else str(reading.get("time_unit", ""))
    if role in ("temperature", "values"):
        return str(reading.get("temperature_unit", ""))
    return f"{reading['power_full_scale']:g}" if role == "power" and "power_full_scale" in reading else ""


def _tags(sheet: Sheet, reading: Mapping[str, Any]) -> tuple[SheetColumn, ...]:
    """Return the tags of a long table with their first values; none of a table with a column for each."""
    tag, value = (_place(sheet, reading.get(name)) for name in ("tag_column", "temperature_column"))
    wide = "power_column" in reading or tag is None or value is None or tag == value
    if tag is None or value is None or wide:
        return ()
    cells: dict[str, list[str]] = {}
    for name, cell in zip(sheet.columns[tag], sheet.columns[value], strict=True):
        cells.setdefault(name, []).append(cell)
    roles = {reading.get(option): role for role, option in _TAG_OPTIONS.items()}
    return tuple(
        SheetColumn(name=name, role=roles.get(name, IGNORED), roles=_TAG_ROLES, cells=tuple(texts[:_ROWS]),
               unit=_unit_sheet(roles.get(name, IGNORED), reading, None))
        for name, texts in islice(cells.items(), _MOST_TAGS))


def _place(sheet: Sheet, said: Any) -> int | None:
    """Return the column of a name or number, None where there is none."""
    if said is None or said == NO_COLUMN:
        return None
    if str(said) in sheet.header:
        return sheet.header.index(str(said))
    number = int(said) if str(said).isdecimal() else 0
    return number - 1 if 1 <= number <= len(sheet.columns) else None


def _reference(columns: tuple[SheetColumn, ...], place: int) -> str:
    """Return the name of a column where it has one of its own, else its number."""
    names = [column.name for column in columns]
    own = names.count(names[place]) == 1 and not names[place].isdecimal() and names[place] not in ("", NO_COLUMN)
    return names[place] if own else f"{place + 1}"


_UNITS: Final[Mapping[str, Mapping[str, str]]] = {
    "temperature": {
        "degC": "°C", "degF": "°F", "K": "K", "0.1degC": "0.1 °C", "0.01degC": "0.01 °C", "0.1degF": "0.1 °F"},
    "time": {"s": "s", "ms": "ms", "min": "min", "h": "h", "d": "days"},
}
_MOST_COLUMNS: Final = 40


def sheet(dropped: DroppedFile) -> str:
    """Return first rows with the role and unit of each column, preview and assumptions."""
    shown = preview(dropped.log, dropped.assumptions.window(dropped.log)) if dropped.log else ""
    return "".join((_file_card(dropped), _zone(dropped), _table(dropped), _rest(dropped), shown,
                    _assumptions(dropped), _repairs(dropped.log)))


def _file_card(dropped: DroppedFile) -> str:
    if dropped.problem:
        answers = {answer: for_page(answer) for answer in answers_to(dropped.problem)}
        chosen = "" if not answers else select_field(
            "answer to the message", "answer", 0, {"": "choose", **answers}, "", label="Answer")
        return f'<p class="error" role="alert">error: {text_of(for_page(dropped.problem))}</p>{chosen}'
    assert dropped.log is not None
    time, (begin, end) = dropped.log.time_s, dropped.assumptions.window(dropped.log)
    used = int(np.count_nonzero((time >= begin) & (time <= end)))
    part = "" if used == len(time) else f"; {used} of them, from {begin:g} to {end:g} s, are fitted"
    line = (f"{len(time)} readings every {float(np.median(np.diff(time))):.4g} s, "
            f"{dropped.log.temperature_degC.min():.4g} to {dropped.log.temperature_degC.max():.4g} °C{part}")
    return f'<p role="status" data-field="taken">{line}</p>'


def _table(dropped: DroppedFile) -> str:
    if not dropped.columns:
        return f"<pre>{text_of(chr(10).join(dropped.lines))}</pre>" if dropped.lines else ""
    shown = "".join(_column(column, place, "column") for place, column in enumerate(dropped.columns[:_MOST_COLUMNS]))
    text = f'<h3>Columns, with their first rows</h3><div class="columns">{shown}</div>'
    if dropped.tags:
        tags = "".join(_column(column, place, "tag") for place, column in enumerate(dropped.tags))
        text += f'<h3>Tags: each becomes a column</h3><div class="columns">{tags}</div>'
    return text


def _zone(dropped: DroppedFile) -> str:
    """Return the choice among several zones or heaters, "" where there is none."""
    if not dropped.zones:
        return ""
    printed = not any(column.role == "zone" for column in dropped.columns)
    name, label = ("the heater that is read", "Heater, by its tag") if printed else (
        "the zone that is read", "Rows of the zone")
    choose = {} if dropped.zone in dropped.zones else {"": "choose"}
    return select_field(name, "zone", 0, choose | {zone: zone for zone in dropped.zones}, dropped.zone, label=label)


def _column(column: SheetColumn, place: int, kind: str) -> str:
    """Return one column: its name, role, unit and first cells."""
    name = text_of(column.name)
    roles = {role: role for role in column.roles}
    role = select_field(f"role of {kind} {column.name}", kind, place, roles, column.role)
    used = "" if column.role == IGNORED else " used"
    cells = "".join(f"<li>{text_of(cell) or '&nbsp;'}</li>" for cell in column.cells)
    return f'<div class="read-column{used}"><b>{name}</b>{role}{_unit(column, place)}<ol>{cells}</ol></div>'


def _unit(column: SheetColumn, place: int) -> str:
    if column.role == "power":
        return number_field("reading at full power", "power_full_scale", place, column.unit, "at full power")
    if column.role == "time" and column.unit == "stamps":
        return '<span class="unit">date and time</span>'
    units = _UNITS.get("temperature" if column.role == "values" else column.role)
    if units is None:
        return ""
    option = "time_unit" if column.role == "time" else "temperature_unit"
    return select_field(f"unit of {column.name}", option, place, {"": "unit?", **units}, column.unit)


def _rest(dropped: DroppedFile) -> str:
    """Return what else tells how the file is read."""
    settings, parts = dropped.settings, []
    if dropped.columns and not any(column.role == "time" for column in dropped.columns):
        parts.append(number_field(
            "seconds between two rows", "sample_time_s", 0, settings.sample_time_s, "s between rows"))
    parts.append(number_field(
        "title lines left out", "skip_rows", 0, settings.skip_rows or None, "title lines left out"))
    if dropped.run is not None:
        parts.append(number_field("run that is read, 1 is the first", "run", 0, dropped.run, "run that is read"))
    ticked = " checked" if settings.skip_empty else ""
    parts.append('<label><input type="checkbox" data-change="skip_empty" data-place="0" data-key="skip_empty"'
                 f"{ticked}> leave out rows without a reading</label>")
    return f'<div class="fields">{"".join(parts)}</div>'


def _assumptions(dropped: DroppedFile) -> str:
    """Return what the file does not say: ambient, power before, and a constant power where none is logged."""
    assumed = dropped.assumptions
    powered = dropped.power_content is not None or any(
        column.role == "power" for column in (*dropped.columns, *dropped.tags))
    fields = [number_field("first instant that is fitted in s", "from_s", 0, assumed.from_s,
                      "s: fitted from (or drag over the picture; empty: all)"),
              number_field("last instant that is fitted in s", "until_s", 0, assumed.until_s, "s: fitted until"),
              number_field("ambient temperature in °C, if known", "ambient_degC", 0, assumed.ambient_degC,
                      "°C ambient (empty: found by the fit)"),
              number_field("power before the log in percent, if known", "power_before_pct", 0, assumed.power_before_pct,
                      "% power before the log (empty: found by the fit)")]
    if not powered:
        fields += [number_field("constant power in percent, if known", "power_pct", 0, assumed.power_pct,
                                "% power throughout (empty: not known)"),
                   number_field("largest power in percent, if known", "largest_power_pct", 0, assumed.largest_power_pct,
                                "% largest power in this log (100 if it was fully on for a while)")]
    inputs = [number_field("setpoint of the trace in °C", "setpoint_degC", 0, assumed.setpoint_degC,
                    "°C setpoint (empty: as logged, else that of the proof)"),
              number_field("heat-up begins, in s", "begins_s", 0, assumed.begins_s, "s: heat-up begins (empty: found)"),
              number_field("load came, in s", "load_at_s", 0, assumed.load_at_s, "s: load came (empty: none)")]
    return (f'<h3>Assumptions</h3><div class="fields">{"".join(fields)}</div><div class="of-trace">'
            f'<h3>Of a trace of the commissioned loop</h3><div class="fields">{"".join(inputs)}</div></div>')


def _repairs(log: Log | None) -> str:
    """Return what the reader changed, assumed or finds odd; nothing of it is folded away."""
    if log is None:
        return ""
    parts = (("Changed or assumed by the reader", log.repairs), ("Odd, but left as it is", log.warnings))
    return "".join(f"<h3>{title}</h3>{bullets([for_page(item) for item in items])}" for title, items in parts if items)


_SHARED: Final = ("temperature_unit", "power_full_scale", "time_unit", "sample_time_s", "skip_rows", "skip_empty")
_CHANGED: Final = """(e) => { const t = e.target; if (!t.dataset.change) return;
  emit([t.dataset.change, Number(t.dataset.place), t.type === "checkbox" ? t.checked ? "1" : "" : t.value,
        t.dataset.key]); }"""


class SheetCard:
    """A card that is seen while a dropped file waits.

    Args:
        use: called with the file once the user takes it as the log of a heater.
        hold: called with the file and the number of the design in front once it is to be held against that.
    """

    def __init__(
        self, use: Callable[[DroppedFile], Awaitable[object]], hold: Callable[[DroppedFile, int], Awaitable[object]]
    ) -> None:
        self._use, self._hold = use, hold
        self._dropped: DroppedFile | None = None
        self._in_turn = asyncio.Lock()  # a change is read in a thread: no button may act on what was there before it
        self._card = ui.element("section").classes("card wide sheet").props('aria-labelledby="sheet-title"')
        with self._card:
            self._title = ui.html("", sanitize=False, tag="h2").props('id=sheet-title tabindex=-1')
            self._content = ui.html("", sanitize=False).on("change", self._changed, js_handler=_CHANGED).on(
                "pointerdown", self._changed, js_handler=DRAGGED)
            with ui.element("div").classes("actions"):
                self._take = ui.button("Use this log", on_click=self._taken).props("dense")
                self._against = ui.button("Hold against the proven design").props("outline dense")
                self._against.on("click", lambda event: self._holds(int(event.args)), js_handler=NUMBER_SEEN)
                ui.button("Put it away", on_click=self.close).props("outline dense")
        self.close()

    async def open(self, name: str, content: bytes) -> None:
        """Show how a file is understood, together with one that waits where one holds the other's power."""
        async with self._in_turn:  # of two files that are dropped together, the second finds the first
            dropped, before = await asyncio.to_thread(DroppedFile.of, name, content), self._dropped
            self._show(dropped if before is None else await asyncio.to_thread(before.with_file, dropped))
        self._title.client.run_javascript("document.getElementById('sheet-title').focus()")

    def show(self, *, proven: bool) -> None:
        """Show whether the file can be the trace of a commissioned loop: a proven design is in front."""
        self._card.classes(remove="" if proven else "proven", add="proven" if proven else "")
        self._against.set_visibility(proven)

    @property
    def reading(self) -> ReadSettings:
        """What the user said of units and rows, which holds for the columns of each zone."""
        settings = ReadSettings() if self._dropped is None else self._dropped.settings
        return ReadSettings(**{name: getattr(settings, name) for name in _SHARED})

    def close(self) -> None:
        """Forget the file."""
        self._dropped = None
        self._content.set_content("")
        self._card.set_visibility(False)

    def _show(self, dropped: DroppedFile) -> None:
        self._dropped = dropped
        names = text_of(" and ".join(filter(None, (dropped.name, dropped.settings.power_log))))
        self._title.set_content(f"The file as read: {names}")
        self._content.set_content(sheet(dropped))
        for button in (self._take, self._against):
            button.set_enabled(dropped.log is not None)
        self._card.set_visibility(True)

    async def _changed(self, event: Any) -> None:
        change, place, value, key = event.args
        async with self._in_turn:
            before = self._dropped
            if before is None:
                return
            after = await asyncio.to_thread(change_sheet, before, change, int(place), str(value))
            if self._dropped is not before:  # put away meanwhile, or another file is there
                return
            self._show(after)
        # what was changed was drawn anew, so the keyboard would have lost its place
        self._content.client.run_javascript(f"document.querySelector('[data-key=\"{key}\"]')?.focus()")

    async def _taken(self) -> None:
        dropped = await self._closed_with()
        if dropped is not None:
            await self._use(dropped)

    async def _holds(self, number: int) -> None:
        dropped = await self._closed_with()
        if dropped is not None:
            await self._hold(dropped, number)

    async def _closed_with(self) -> DroppedFile | None:
        """Close the sheet and return it with every change that came before; None where it holds no log."""
        async with self._in_turn:
            dropped = self._dropped
            if dropped is not None and dropped.log is not None:
                self.close()
                return dropped
            return None
