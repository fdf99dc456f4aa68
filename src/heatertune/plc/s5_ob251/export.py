"""OB251's controller DB as a listing to key in, as CSV (DW, format, value, comment), as an image; and read back.

The image has 49 words, 98 bytes, high byte first. STEP 5 tools print a data block as `1: KF = +01024;`, one data word
(KS, KC: text of several) per line. The words are first keyed in for manual operation, with W as proven.

The exported program runs in the emulated CPU; OB251 itself is firmware and uses the model of the proof. Feed-forward
goes to Z (DW24, scaled as YA: 2047 is full power), which is added to the output, not multiplied by K, if bit 5 of STEU
is 0 (manual, table 11-10).
"""

from __future__ import annotations

import csv
import io
import re
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from operator import itemgetter
from typing import Any, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.core import Sensor, count
from heatertune.plc.cpu.s5.machine import S5Cpu
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.exported import CallResult, ExportedInPlc
from heatertune.plc.feed_forward import FeedForward, FeedForwardHooks
from heatertune.plc.keyed_entry import FIRST, THEN, bits, typed_words
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, wrong
from heatertune.plc.s5_ob251.blocks import (
    DB,
    FOUR_MA,
    HEAT,
    INPUT,
    MODE,
    OUTPUT,
    PERIOD_ENDS,
    START,
    WORK,
    program_listing,
)
from heatertune.plc.s5_ob251.step import (
    AUTO,
    COLD,
    FULL_SCALE,
    NO_Z,
    REG_AUS,
    Ob251Assumptions,
    Ob251Parameters,
    call,
    percent,
)
from heatertune.plc.s5_ob251.words import FACTOR, FIELDS, GAIN_WITH_D, parameters_of
from heatertune.plc.words import Certificate, EntryChange, Words
from heatertune.units import written

__all__ = [
    "FEED", "LENGTH", "PLACES", "export_words", "from_cells", "from_image", "from_text", "keyed_entries", "loaders",
    "oddities", "setpoint_entry", "to_image",
]


#: data words DW0 to DW48; with fewer the CPU stops with TRAF (manual, section 11.2.3)
LENGTH: Final = 49

#: word → number of its data word
PLACES: Final = {field.name: int(field.address[2:]) for field in FIELDS}
_USER_BITS: Final = 0x00FF  # DL11 belongs to the operating system
_SIGN: Final = 0x8000
_COARSE: Final = 0.05


def to_image(words: Words) -> bytes:
    """Return the 98 bytes of the DB; cells that are not words of the user are 0."""
    cells = [0] * LENGTH
    for name, place in PLACES.items():
        cells[place] = words.whole[name] & 0xFFFF
    return struct.pack(f">{LENGTH}H", *cells)


def from_image(image: bytes, _sample_time_s: float, source: str) -> dict[str, int]:
    """Return the values in a DB of at least 98 bytes; more words than 49 are allowed and not looked at.

    Raises:
        InputError: fewer than 98 bytes, or half a word.
    """
    if len(image) < 2 * LENGTH or len(image) % 2:
        raise InputError(f"{source}: {len(image)} bytes; expected {2 * LENGTH} (49 words) or more, in whole words")
    return from_cells(struct.unpack(f">{LENGTH}H", image[: 2 * LENGTH]))


def from_cells(cells: Sequence[int]) -> dict[str, int]:
    """Return the values in the data words, which are 0…65535."""
    values = {name: (cells[place] ^ _SIGN) - _SIGN for name, place in PLACES.items()}
    values["STEU"] &= _USER_BITS
    return values


def oddities(words: Words) -> tuple[str, ...]:
    """Return the oddities of a controller's words, one sentence each."""
    v = words.whole
    odd = []
    if v["TI"] == 0:
        odd.append("TI is 0: the controller has no integral action.")
    elif 0.5 / v["TI"] > _COARSE:
        odd.append(f"TI is {v['TI']}: half a word is {50.0 / v['TI']:.0f} % of TN; a slower TA makes it finer.")
    odd += [*_about_r(v), *_about_k(v)]
    if v["BGOG"] <= v["BGUG"]:
        odd.append("BGOG is not above BGUG: the output cannot move.")
    for bit, meaning in _UNUSUAL:
        if bool(v["STEU"] & bit) != (bit in (1, 32)):
            odd.append(meaning)
    return tuple(odd)


def _about_r(v: Mapping[str, int]) -> Iterator[str]:
    if v["R"] == 0:
        yield "R is 0: the controller has no proportional action."
    elif v["R"] < 0 and (v["TI"] or v["TD"]):
        yield f"R is {v['R']}: the proportional part acts against the others."
    elif v["R"] != FACTOR:
        yield f"R is {v['R']}, not {FACTOR}: the proportional part is K·R; TN and TV change with R."
    if v["R"] == 0 and v["K"] and v["TI"] and not v["TD"]:
        yield f"I alone: K·TI is {v['K'] * v['TI'] / FACTOR**2:.4g} units per unit of XW and call."


def _about_k(v: Mapping[str, int]) -> Iterator[str]:
    if v["K"] == 0:
        yield "K is 0: the output moves by Z alone." if not v["STEU"] & NO_Z else "K is 0: the output never moves."
    elif v["K"] < 0:
        yield f"K is {v['K']}: the output falls where the temperature is too low, as for a cooler."
    if v["TD"] and abs(v["K"]) > GAIN_WITH_D:
        yield f"K is {v['K']} with a derivative part: the manual allows ±{GAIN_WITH_D} where XW can jump."


#: bits of STEU that differ from plain automatic, position, no feed-forward (33)
_UNUSUAL: Final = (
    (1, "STEU bit 0 is 0: the controller is in manual mode."),
    (2, "STEU bit 1 is 1: the derivative part acts on XZ."),
    (4, "STEU bit 2 is 1: the controller is switched off and its state cleared at each call."),
    (8, "STEU bit 3 is 1: the output is an increment (velocity algorithm), not a position."),
    (32, "STEU bit 5 is 0: the disturbance variable Z is added to the output."),
)


_FROM: Final = f"DW 0 of DB{WORK}"
_SMALL: Final = 200  # units of YH: a tenth of the power, see COMMISSIONING.md


def keyed_entries(words: Words, setpoint_degC: float | None, units: Number | None) -> Mapping[str, EntryChange]:
    """Return what is typed otherwise than it stands in the words, see `heatertune.plc.keyed_entry.KeyedEntry`.

    Args:
        words: of OB251.
        setpoint_degC: as proven [°C]; None: nothing is.
        units: the same as W.
    """
    v = words.whole
    return {
        "K": {"meaning": f"K·R = {v['K'] * v['R'] / 1024**2:.5g} units per unit"},
        "TI": {"meaning": _integral_time(words)},
        "TD": {"meaning": _derivative_time(words)},
        "W": _setpoint(words, setpoint_degC, units),
        "STEU": {"first": v["STEU"] & ~AUTO, "meaning": "control word; bit 0: automatic"},
        "YH": {"first": min(_SMALL, v["BGOG"])},
    }


def _integral_time(words: Words) -> str:
    v = words.whole
    return f"TN = {written(words.sample_time_s * v['R'] / v['TI'])} s" if v["TI"] else "no integral action"


def _derivative_time(words: Words) -> str:
    v = words.whole
    if not v["TD"]:
        return "no derivative action"
    return f"TV = {written(words.sample_time_s * v['TD'] * 1024 / v['R'])} s" if v["R"] else f"TV = {v['TD']} TA/R"


def _setpoint(words: Words, setpoint_degC: float | None, units: Number | None) -> EntryChange:
    """Return W with the factor for others; a ramp leads it to what the program asks for."""
    scale = words.scaling
    factor = f"whole part of ({FULL_SCALE}/{scale.span_degC:g})·({scale.formula})"
    if units is None:
        return {"meaning": f"setpoint, {_FROM}: {factor}, enter yours there"}
    proven = f"{setpoint_degC:g} °C as proven; others: {factor}"
    if words.ramp is not None:
        return {"meaning": f"led to the setpoint, {_FROM} = {units:+d}: {proven}"}
    return {"first": units, "then": units, "meaning": f"setpoint, {_FROM}: {proven}"}


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"DW 0 of DB31 = {units:+d}"


_BLOCK: Final = re.compile(r"DB\s*(\d{1,3})\b(?!.*\bK[A-Z]\s*=).*", re.IGNORECASE | re.ASCII)
_WORD: Final = re.compile(r"(\d{1,3})\s*:\s*(K[A-Z])\s*=\s*(.*)", re.IGNORECASE | re.ASCII)
_END: Final = re.compile(r"(\d{1,3})\s*:", re.ASCII)
#: a second column, as `heatertune.plc.s5_ob251.export` writes it: what is typed then, for automatic
_THEN: Final = re.compile(r"[^;']*;\s+(K[A-Z])\s*=\s*(.*)", re.IGNORECASE)
#: what may stand after a value
_REST: Final = re.compile(r"\s*((;|//).*)?")


def _pair(text: str) -> list[int] | None:
    high, low = (int(part) for part in text.split(","))
    return [256 * high + low] if max(high, low) <= 255 else None


def _timer(text: str) -> list[int] | None:
    count, base = text.split(".")
    return [int(base) << 12 | int(count, 16)]  # three digits in BCD


def _fixed(text: str) -> list[int] | None:
    number = int(text.replace(" ", ""))
    return [number & 0xFFFF] if -32768 <= number <= 32767 else None


def _characters(text: str) -> list[int] | None:
    inner = text[1:-1].encode("latin-1", "replace")
    return [*(high << 8 | low for high, low in zip(inner[::2], inner[1::2], strict=True))] if inner else None


class _Kind(NamedTuple):
    pattern: re.Pattern[str]
    words: Callable[[str], list[int] | None]
    rule: str


_CHARACTERS: Final = _Kind(re.compile(r"'(?:[^']{2})+'"), _characters, "pairs of characters in ' '")
_COUNT: Final = _Kind(re.compile(r"\d{1,3}", re.ASCII), lambda text: [int(text, 16)], "0…999")
#: format → how its constant is written (S5-115U manual, constants of the STEP 5 language)
_KINDS: Final = {
    "KF": _Kind(re.compile(r"[+-]?\s?\d{1,5}", re.ASCII), _fixed, "a whole number -32768…32767"),
    "KH": _Kind(re.compile(r"[0-9A-Fa-f]{4}"), lambda text: [int(text, 16)], "four digits 0…9, A…F"),
    "KM": _Kind(re.compile(r"[01]{8}\s?[01]{8}"), lambda text: [int("".join(text.split()), 2)], "16 bits"),
    "KY": _Kind(re.compile(r"\d{1,3}\s*,\s*\d{1,3}", re.ASCII), _pair, "two bytes 0…255,0…255"),
    "KT": _Kind(re.compile(r"\d{1,3}\.[0-3]", re.ASCII), _timer, "a time 0.0…999.3"),
    "KZ": _COUNT,
    "KS": _CHARACTERS,
}
_FORMATS: Final = f"{', '.join(_KINDS)} or KC"


class _Cell(NamedTuple):
    word: int
    line: int
    shown: str


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in the listing of a data block, whatever format each data word is printed in.

    Where a line holds two constants, as in the listing that is exported, the second one counts: that of automatic.

    Raises:
        InputError: a line that is none of such a listing, a data word that is missing, there twice or out of its range.
    """
    cells: dict[int, _Cell] = {}
    number = None
    for line, content in _lines(text):
        block = _BLOCK.fullmatch(content)
        if block is None:
            _take(content, line, cells, source)
        elif number not in (None, int(block[1])):
            raise wrong(source, line, "block", f"DB{block[1]}", f"the listing of one block, DB{number}")
        else:
            number = int(block[1])
    missing = next((place for place in range(LENGTH) if place not in cells), None)
    if missing is not None:
        raise InputError(f"{source}: DW{missing} is missing; expected DW0 to DW{LENGTH - 1}, the whole data block")
    collected = WordCollector(source, FIELDS)
    for name, value in from_cells([cells[place].word for place in range(LENGTH)]).items():
        cell = cells[PLACES[name]]
        collected.put(name, value, cell.line, cell.shown)
    others = sum(1 for place, cell in cells.items() if place not in PLACES.values() and cell.word)
    return ReadBack(collected.values(), (f"{others} data words besides, which are not 0",) if others else ())


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Return number and content of the lines that are neither empty nor comments."""
    return ((line, content) for line, content in lines_of(text) if content and not content.startswith(("//", ";")))


def _take(content: str, line: int, cells: dict[int, _Cell], source: str) -> None:
    """Add the data words of a line."""
    match = _WORD.fullmatch(content)
    if match is None:
        end = _END.fullmatch(content)
        if end is None or int(end[1]) != max(cells, default=-1) + 1:
            raise wrong(source, line, "data word", content, "a line such as 1: KF = +01024;")
        return
    place = int(match[1])
    words, shown = _constant(match[2].upper(), match[3], source, line, f"DW{place}")
    then = _THEN.fullmatch(match[3])
    if then is not None:
        words, shown = _constant(then[1].upper(), then[2], source, line, f"DW{place}")
    for offset, word in enumerate(words):
        before = cells.setdefault(place + offset, _Cell(word, line, shown))
        if before.line != line:
            raise wrong(source, line, f"DW{place + offset}", shown, f"each data word once; line {before.line} has it")


def _constant(format_: str, rest: str, source: str, line: int, field: str) -> tuple[list[int], str]:
    """Return the words of a constant and its text; KC is a text in German tools, a count in English ones."""
    kind = _KINDS.get(format_, (_CHARACTERS if rest.startswith("'") else _COUNT) if format_ == "KC" else None)
    if kind is None:
        raise wrong(source, line, field, format_, f"a constant {_FORMATS}")
    match = kind.pattern.match(rest)
    words = None if match is None or not _REST.fullmatch(rest, match.end()) else kind.words(match[0])
    if match is None or words is None:
        raise wrong(source, line, field, rest.partition(";")[0].strip(), f"{format_}, {kind.rule}")
    return words, match[0]


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

    def call(self, target: Number, counts: int, reading_degC: float) -> CallResult:
        """Run OB13 when OB251 is due."""
        if self._begun:
            self._work[_DUE] = 1
        return self.tick(target, counts, reading_degC)[0]

    def tick(self, target: Number, counts: int, reading_degC: float) -> tuple[CallResult, bool | None]:  # noqa: ARG002
        """Run OB13."""
        if self._asked not in (None, target):
            self._work[_ASKED] = int(target)
        self._asked, self._begun = target, True
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
        work[_YA], work[_DUE], work[_STAIRS], work[_PART] = int(output), _FAR, PERIOD_ENDS, 0
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
    """Return the function that loads the listing."""
    return {_FILE: lambda: ExportedS5(str(files[_FILE]), assume)}


_DB: Final = 30
_FEED_FORWARD_BLOCK: Final = 32


def _listened(values: Mapping[str, Number]) -> dict[str, Number]:
    return {**values, "STEU": int(values["STEU"]) & ~NO_Z}


def _with_input(parameters: tuple[Ob251Parameters, Ob251Assumptions], value: Number) -> tuple[Any, Ob251Assumptions]:
    return parameters[0]._replace(z=int(value)), parameters[1]


def _listing_feed_forward(line: FeedForward, certificate: Certificate) -> dict[str, str]:
    head = [
        f"FB{_FEED_FORWARD_BLOCK}: writes Z (DW 24 of DB{_DB}): {line.pct_per_unit:+.4g} % of full power per unit of "
        f"{line.column}",
        f"Z = {line.at_low:+d} at {line.low:g}, {line.at_high:+d} at {line.high:g}; about 0 at {line.calm:g}",
        f"JU FB{_FEED_FORWARD_BLOCK} in FB{HEAT} of program_listing.txt after T DW 22; its last statement clears bit 5 "
        f"of STEU",
        *certificate.head,
    ]
    body = _contact(line) if line.switched else _analog(line)
    lines = [f"C  DB {_DB}", *body, "RU D 11.5", "BE"]
    split = [statement.partition(":") if ":" in statement else ("", "", statement) for statement in lines]
    return {"feed_forward_listing.txt": "\n".join([
        *(f"// {text}" for text in head), f"FB {_FEED_FORWARD_BLOCK}", "NAME :FEED",
        *(f"{label:5s}:{operation}" for label, _, operation in split)]) + "\n"}


def _contact(line: FeedForward) -> list[str]:
    return ["A  I 1.0", "JC =ON", f"L  KF {line.at_low:+d}", "JU =END", f"ON:L  KF {line.at_high:+d}", "END:T  DW 24"]


def _analog(line: FeedForward) -> list[str]:
    """Return the call of the reading block: bipolar, so its lower end lies as far below 0 as its upper end above."""
    below = 2 * int(line.at_low) - int(line.at_high)
    return ["JU FB 250", "NAME:RLG:AE", "BG:KF +128", "KNKT:KY 2,6", f"OGR:KF {line.at_high:+d}",
            f"UGR:KF {below:+d}", "EINZ:F 199.0", "XA:DW 24", "FB:F 199.1", "BU:F 199.2", "TBIT:F 199.3"]


FEED: Final = FeedForwardHooks(
    word="Z", per_pct=FULL_SCALE / 100.0, most=FULL_SCALE, whole=True, listened=_listened, set_disturbance=_with_input,
    listing=_listing_feed_forward)


_CELLS = {22: ("KF", "X actual value, written by the program"), 24: ("KF", "Z disturbance variable"),
          29: ("KF", "XZ substitute for the D part"), 48: ("KF", "YA controller output, read by the program")}


class _Row(NamedTuple):
    """A data word: its number, format, what is typed first and then, comment."""

    dw: int
    format: str
    first: str
    then: str
    comment: str


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return name → content of all files; the same words and certificate give the same bytes."""
    rows, setpoint = _rows(words, certificate.setpoint_degC), certificate.setpoint_degC
    sensor = Sensor(words.scaling.low_degC, words.scaling.span_degC, FULL_SCALE)
    setpoint_counts = 0 if setpoint is None else count(sensor, setpoint)
    return {
        f"DB{DB}_listing.txt": _listing(words, certificate, rows),
        f"DB{DB}.csv": _csv(rows),
        f"DB{DB}.bin": to_image(words),
        "program_listing.txt": program_listing(words, certificate, setpoint_counts, [_typed(row) for row in rows]),
    }


def _rows(words: Words, setpoint_degC: float | None) -> list[_Row]:
    """Return all 49 words."""
    table = {int(row.address[2:]): row for row in typed_words(words, setpoint_degC)}
    cells = {dw: _CELLS.get(dw, ("KH", "")) for dw in range(LENGTH)}
    return [
        _Row(dw, table[dw].format, _value(table[dw].format, table[dw].first), _value(table[dw].format, table[dw].then),
             f"{table[dw].name} {table[dw].meaning}") if dw in table
        else _Row(dw, format_, _value(format_, 0), _value(format_, 0), comment)
        for dw, (format_, comment) in cells.items()]


def _value(format_: str, value: Number) -> str:
    if format_ == "KM":
        return bits(int(value))
    return f"{value:+06d}" if format_ == "KF" else f"{value:04X}"


def _listing(words: Words, certificate: Certificate, rows: Sequence[_Row]) -> str:
    s = words.scaling
    head = [
        "OB251 controller DB, a listing to key in (no STEP 5 import file)",
        f"sensor {s.low_degC:g}…{s.high_degC:g} °C = 0…{FULL_SCALE} units; output 0…{FULL_SCALE} units = 0…100 % power",
        f"call OB251 every {words.sample_time_s:g} s from a timed block (OB13), this DB opened before, as "
        "program_listing.txt does",
        *certificate.head,
        f"begin in manual: type the first column; the second where there is one, for automatic. DB{DB}.bin holds the "
        f"words of automatic, W = {words.whole['W']:+06d}",
        f"   {FIRST.ljust(27)}{THEN.ljust(27)}meaning",
    ]
    return "\n".join([*(f"// {line}" for line in head), f"DB{DB}", *(_typed(row, _then(row)) for row in rows)]) + "\n"


def _typed(row: _Row, then: str | None = None) -> str:
    """Return a data word as it is typed, with what is typed later where that is wanted."""
    later = "" if then is None else then.ljust(27)
    return f"{f'{row.dw:4d}:  {row.format} = {row.first};'.ljust(33)}{later}{row.comment}".rstrip()


def _then(row: _Row) -> str:
    return "" if row.first == row.then else f"{row.format} = {row.then};"


def _csv(rows: Sequence[_Row]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["DW", "format", FIRST, THEN, "comment"])
    writer.writerows(rows)
    return in_ascii(text.getvalue())
