"""The block of each controller in a virtual PLC, and the cells of temperature, power and setpoint in a real one.

The cells are those of the controller's own block, or those of a TOML file: tables `temperature` [°C], `power` [%],
`setpoint` [°C] and `counter` (of scans), all but the first optional, and `block` if the address does not name one.
Each table has `byte` (or `register`) and `format`; `raw` are two numbers as stored and `range` their meaning;
`interval_s` of a counter is the time between two scans.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Final, Protocol

from heatertune.codec import read_toml
from heatertune.errors import DocumentError, InputError
from heatertune.live.block_memory import STRUCTS, BlockSignal, RegisterRange
from heatertune.plc import Words, controller_for
from heatertune.plc.controller import Controller
from heatertune.plc.open_points import assumptions_from
from heatertune.plc.ramp import Number
from heatertune.plc.words import FLOATS

__all__ = [
    "ROLES", "SERVED", "Counter", "Places", "ServedBlock", "Topic", "block_for", "places_from", "places_in",
    "places_of",
]


class ServedBlock(Protocol):
    """A controller's block in a PLC.

    Attributes:
        number: of the block; for an S7-200, whose V memory it is, 1.
        description: what it is, a few words.
        manual: whether clients can put the controller in manual.
        speaks: the protocols that reach it, the first without being asked for.
        registers: where Modbus finds its words; none: word w is register w.
        signals: where it shows temperature [°C], power [%] and setpoint [°C], by these names.
        words: word → where it stands; a word that stands elsewhere in the PLC, or in one bit, is none of them.
        bits: word of one bit → its byte, and which of that it is.
        mode: bytes that tell manual from automatic; none where nothing does.
        operators: words that are the operator's while the controller is in manual.
        undone_by: what in the PLC writes its own words over those of a client, a few words; nothing does where empty.
    """

    number: int
    description: str
    speaks: tuple[str, ...]
    registers: Sequence[RegisterRange]
    manual: bool
    signals: Mapping[str, BlockSignal]
    words: Mapping[str, BlockSignal]
    bits: Mapping[str, tuple[int, int]]
    mode: slice
    operators: tuple[str, ...]
    undone_by: str

    def image(self) -> bytes:
        """Return its bytes before the first scan."""

    def begin(self) -> Any:
        """Return the state before the first scan, which nobody else changes."""

    def scan(self, cells: bytearray, state: Any, setpoint: Number, reading: Number) -> tuple[Any, float, Number, int]:
        """Run one scan on the block; what it writes goes into `cells`. Total for every bit pattern.

        Args:
            cells: the block, as the scan finds it.
            state: before the scan.
            setpoint: as the program asks for it; where it is another than at the scan before, it is written.
            reading: of the input module.

        Returns:
            State, power 0…100 %, output and flags, as `heatertune.plc.core.StepFunctions.step` gives them.
        """

    def restarted(self, state: Any) -> Any:
        """Return the state after a start-up."""

    def in_manual(self, cells: bytes | bytearray) -> bool:
        """Return whether the controller is in manual."""

    def into_automatic(self, cells: bytearray) -> None:
        """Put the controller back in automatic."""

    def put_in_manual(self, cells: bytes, power_pct: float) -> tuple[int, bytes]:
        """Return the write that puts the controller in manual with a power.

        Args:
            cells: the block as it stands.
            power_pct: 0…100 [%].

        Returns:
            First byte, and the bytes, of one request; the bytes that stood there before bring back what was.

        Raises:
            InputError: the controller has no manual mode that clients can reach.
        """

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word, as somebody at a programming unit does.

        Raises:
            InputError: no such word, or a value that the word cannot hold.
        """


#: target → module and class of its block; only what is served is loaded
SERVED: Final[Mapping[str, tuple[str, str]]] = {
    "s5-ob251": ("siemens_blocks", "Ob251Block"), "s7-200": ("siemens_blocks", "PaperMemory"),
    "s7-200-pid": ("siemens_blocks", "PidMemory"),
    "s7-300": ("siemens_blocks", "PidTipBlock"), "fb41": ("siemens_blocks", "ContCBlock"),
    "pid-compact": ("siemens_blocks", "CompactBlock"),
    "pid-temp": ("siemens_blocks", "TempBlock"), "weg": ("modbus_blocks", "WegBlock"),
    "iec-pid": ("modbus_blocks", "IecPidBlock"),
    **dict.fromkeys(
        ("pband", "omron-e5cc", "eurotherm-3200", "jumo-dicon", "omega-cn7800"), ("modbus_blocks", "InstrumentBlock")),
}


def block_for(controller: Controller, words: Words, switches: Mapping[str, str]) -> ServedBlock:
    """Return what a virtual PLC serves of a controller that runs words.

    Raises:
        KeyError: it is none of those that can be served.
        UnknownName: no such switch or setting.
    """
    module, name = SERVED[controller.name]
    factory: Callable[[Controller, Words, Any], ServedBlock] = getattr(import_module(f"heatertune.live.{module}"), name)
    return factory(controller, words, assumptions_from(controller.assumptions, switches))


#: what is recorded, in the order of a log's columns
ROLES: Final = ("temperature", "power", "setpoint")
_MOST_BYTE: Final = 65535
_LEAST_SPAN: Final = 1e-9  # between two raw or shown values: anything smaller is a typing error, and divides by nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Counter:
    """A program's own count of scans.

    Attributes:
        signal: where it stands.
        interval_s: time between two scans [s].
    """

    signal: BlockSignal
    interval_s: float

    @property
    def turn(self) -> int:
        """After so many it begins anew."""
        return 1 << 8 * self.signal.size


_STATES: Final = {"ON": 1.0, "TRUE": 1.0, "OFF": 0.0, "FALSE": 0.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """Where a broker's messages hold a number.

    Attributes:
        topic: of MQTT, without a wildcard.
        path: keys and indices of a JSON payload, dots between them; empty: the payload is the number.
        raw, shown: two numbers as published, and what they mean.
        full: what ON means; OFF means 0.
    """

    topic: str
    path: str = ""
    raw: tuple[float, float] = (0.0, 1.0)
    shown: tuple[float, float] = (0.0, 1.0)
    full: float = 100.0

    def of(self, payload: bytes) -> float:
        """Return the quantity in a payload; no number where it holds none, as where a sensor is unavailable."""
        try:
            value = self._within(payload.decode())
            if (state := _STATES.get(str(value).upper())) is not None:
                return state * self.full
            number = float(value)
        except (ValueError, TypeError, LookupError, RecursionError):
            return math.nan
        if not math.isfinite(number):
            return math.nan
        (low, high), (first, last) = self.raw, self.shown
        return first + (number - low) * (last - first) / (high - low)

    def _within(self, text: str) -> Any:
        """Return the value at the path; raises ValueError, TypeError, LookupError or RecursionError."""
        value: Any = json.loads(text) if self.path or text[:1] == '"' else text
        for key in self.path.split(".") if self.path else ():
            value = value[int(key)] if isinstance(value, list) else value[key]
        return value


@dataclass(frozen=True, slots=True, kw_only=True)
class Places:
    """Where to look.

    Attributes:
        block: number of the data block; None: as the address says.
        signals: role → where and how it stands; temperature always.
        counter: of scans, if there is one.
        told: where this is from, a few words.
        topics: role → topic of a broker, in the place of cells.
    """

    block: int | None
    signals: Mapping[str, BlockSignal]
    counter: Counter | None = None
    summary: str = ""
    topics: Mapping[str, Topic] = field(default_factory=dict)

    @property
    def span(self) -> tuple[int, int]:
        """First byte, and how many, that hold all of it."""
        all_of_them = [*self.signals.values(), *([self.counter.signal] if self.counter else [])]
        begin = min(signal.start for signal in all_of_them)
        return begin, max(signal.start + signal.size for signal in all_of_them) - begin


def places_of(words: Words) -> Places | None:
    """Return where a controller's block shows what is recorded; None where heatertune does not know its block."""
    if words.target not in SERVED:
        return None
    block = block_for(controller_for(words.target), words, {})
    return Places(block=block.number, signals=block.signals, summary=f"the block of {words.target}")


def places_in(path: str | Path) -> Places:
    """Return the places that a file names; see this module for its form.

    Raises:
        DocumentError: it cannot be read, or says something else; the message names the entry.
    """
    entries = read_toml(path)
    if isinstance(entries.get("temperature"), dict) and "topic" in entries["temperature"]:
        return _topics(path, entries)
    for name in entries:
        if name not in ("block", "counter", *ROLES):
            raise DocumentError(f"{path}: entry {name!r}: expected block, counter, {', '.join(ROLES)}")
    signals: dict[str, BlockSignal] = {
        role: _signal(path, role, entries[role], ("raw", "range")) for role in ROLES if role in entries}
    if "temperature" not in signals:
        raise DocumentError(f"{path}: no [temperature]; expected where it stands: byte, format, raw, range")
    block = entries.get("block")
    if block is not None and not (type(block) is int and 1 <= block <= _MOST_BYTE):
        raise DocumentError(f"{path}: block = {block!r}: expected a whole number 1…{_MOST_BYTE}")
    counter = _counter(path, entries["counter"]) if "counter" in entries else None
    return Places(block=block, signals=signals, counter=counter, summary=Path(path).name)


def _topics(path: str | Path, said: Mapping[str, object]) -> Places:
    """Return the topics that a file says; errors as `places_in`."""
    if other := [role for role in said if role not in ROLES]:
        raise DocumentError(f"{path}: entry {other[0]!r}: expected {', '.join(ROLES)}")
    return Places(block=None, signals={}, summary=Path(path).name,
                  topics={role: _topic(path, role, table) for role, table in said.items()})


_TOPIC_TEXTS: Final = {
    "topic": (re.compile(r"[^+#\0]+"), 'one topic without + and #, as "kiln/temperature"'),
    "path": (re.compile(r"(?:[^.]+(?:\.[^.]+)*)?"), 'keys with dots between them, as "DS18B20.Temperature"')}


def _topic(path: str | Path, role: str, table: object) -> Topic:
    def wrong(what: str, expected: str) -> DocumentError:
        return DocumentError(f"{path}: [{role}] {what}; expected {expected}")

    names = ("topic", "path", "raw", "range")
    if not isinstance(table, dict) or not set(table) <= set(names):
        raise wrong(f"is {table!r}", f"a table with {', '.join(names)}")
    texts = {"topic": table.get("topic"), "path": table.get("path", "")}
    for name, (form, expected) in _TOPIC_TEXTS.items():
        if not isinstance(texts[name], str) or not form.fullmatch(texts[name]):
            raise wrong(f"{name} = {texts[name]!r}", expected)
    topic = Topic(**texts)
    if {"raw", "range"} & set(table):
        raw, shown = (_pair(table.get(name), name, wrong) for name in ("raw", "range"))
        topic = replace(topic, raw=raw, shown=shown)
    return topic


def places_from(*, design: str | Path | None = None, map_file: str | Path | None = None) -> Places | None:
    """Return the places that a file says, or those of the controller whose design lies in a folder; None: no one says.

    Raises:
        InputError: nobody knows where that controller shows its temperature; as `places_in` and `words_in`.
    """
    if map_file is not None:
        return places_in(map_file)
    if design is None:
        return None
    from heatertune.proof.words_file import words_in

    words, _ = words_in(design)
    places = places_of(words)
    if places is None:
        raise InputError(f"{design}: where {words.target} shows its temperature is not known here; say it in "
                         "a small file: --map FILE.toml")
    return places


def _counter(path: str | Path, said: Any) -> Counter:
    signal = _signal(path, "counter", said, ("interval_s",))
    if signal.format in FLOATS:
        raise DocumentError(f"{path}: [counter] format = {signal.format!r}: expected a whole number, as UINT or UDINT")
    interval = _finite(said.get("interval_s"))
    if interval is None or not interval > 0.0:
        raise DocumentError(f"{path}: [counter] interval_s = {said.get('interval_s')!r}: expected seconds > 0")
    return Counter(signal=signal, interval_s=interval)


def _signal(path: str | Path, role: str, said: Any, also: tuple[str, ...]) -> BlockSignal:
    def wrong(what: str, expected: str) -> DocumentError:
        return DocumentError(f"{path}: [{role}] {what}; expected {expected}")

    if not isinstance(said, dict):
        raise wrong(f"is {said!r}", "a table with byte and format")
    for name in said:
        if name not in ("byte", "register", "format", *also):
            raise wrong(f"entry {name!r}", f"byte or register, format, {', '.join(also)}")
    if ("byte" in said) == ("register" in said):
        raise wrong("says no byte and no register" if "byte" not in said else "says byte and register", "one of them")
    name = "byte" if "byte" in said else "register"
    place = said[name]
    if type(place) is not int or not 0 <= place <= _MOST_BYTE:
        raise wrong(f"{name} = {place!r}", f"a whole number 0…{_MOST_BYTE}")
    form = said.get("format")
    if not isinstance(form, str) or form not in STRUCTS:
        raise wrong(f"format = {form!r}", f"one of {', '.join(STRUCTS)}")
    start = place if name == "byte" else 2 * place
    if "raw" not in also:
        return BlockSignal(start, form)
    return BlockSignal(start, form, _pair(said.get("raw"), "raw", wrong), _pair(said.get("range"), "range", wrong))


def _pair(entry: Any, name: str, wrong: Any) -> tuple[float, float]:
    ends = [_finite(end) for end in entry] if isinstance(entry, list) else []
    if len(ends) != 2 or ends[0] is None or ends[1] is None or not abs(ends[1] - ends[0]) >= _LEAST_SPAN:
        raise wrong(f"{name} = {entry!r}", "two different numbers, as [0, 2047]")
    return ends[0], ends[1]


def _finite(entry: Any) -> float | None:
    """Return a number of a TOML file; None for anything else, infinities, and integers that no float holds."""
    if type(entry) not in (int, float):
        return None
    try:
        number = float(entry)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
