"""The words as they are typed in: the one table behind listing, CSV, terminal, studio and report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from heatertune.plc.controller import controller_for
from heatertune.plc.ramp import Number
from heatertune.plc.words import FLOATS, EntryChange, WordField, Words

__all__ = [
    "FIRST", "THEN", "KeyedEntry", "TypedTable", "as_typed", "bits", "entry_texts", "setpoint_entry", "typed_table",
    "typed_words", "value_texts", "word_text",
]

FIRST: Final = "first (manual)"
THEN: Final = "then (automatic)"


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyedEntry:
    """One word as a person types it: first, while the controller is put into service in manual, and then for good.

    Attributes:
        address, name: of the word.
        format: see `heatertune.plc.words.FORMATS`; empty for a word that is entered as the display of an instrument
            shows it.
        first, then: both values, as the word stores them.
        meaning: of the word.
        first_text, then_text: both values as a person enters them; empty: as `as_typed` writes them.
    """

    address: str
    name: str
    format: str
    first: Number
    then: Number
    meaning: str
    first_text: str = ""
    then_text: str = ""

    def __post_init__(self) -> None:
        for name, value in (("first_text", self.first), ("then_text", self.then)):
            object.__setattr__(self, name, getattr(self, name) or as_typed(value, self.format))

    @property
    def changes(self) -> bool:
        """Whether it is typed twice."""
        return self.first != self.then


class TypedTable(NamedTuple):
    """Heads, which columns are values, and the cells, row by row."""

    heads: tuple[str, ...]
    values: tuple[int, ...]
    cells: list[tuple[str, ...]]


def typed_words(words: Words, setpoint_degC: float | None = None) -> tuple[KeyedEntry, ...]:
    """Return the words in the order in which they are typed in.

    Args:
        words: of any controller.
        setpoint_degC: the one of the proof, for the word that holds it [°C]; None: none is proven.
    """
    controller = controller_for(words.target)
    other: Mapping[str, EntryChange] = {}
    if controller.keyed_entries is not None:
        units = None if setpoint_degC is None else controller.measure(words, setpoint_degC)
        other = controller.keyed_entries(words, setpoint_degC, units)
    return tuple(_keyed_entry(each, words.values[each.name], other.get(each.name, {})) for each in controller.fields)


def _keyed_entry(field: WordField, value: Number, change: EntryChange) -> KeyedEntry:
    return KeyedEntry(
        address=field.address, name=field.name, format=change.get("format", field.format),
        first=change.get("first", value), then=change.get("then", value), meaning=change.get("meaning", field.comment),
        first_text=change.get("first_text", ""), then_text=change.get("then_text", ""))


def value_texts(words: Words, values: Mapping[str, Number]) -> dict[str, str]:
    """Return each word as a person enters it, with other values in place of the words' own.

    Args:
        words: of any controller.
        values: word name → value; where the controller does not allow one of them, they are shown as they are.
    """
    fields = controller_for(words.target).fields
    if not all(field.takes(values[field.name]) for field in fields if field.name in values):
        return {name: f"{value:.9g}" for name, value in values.items()}
    return {row.name: row.then_text for row in typed_words(replace(words, values={**words.values, **values}))}


def entry_texts(texts: Mapping[str, str]) -> dict[str, EntryChange]:
    """Return the part of `Controller.typed` that enters each word, named, as a text says."""
    return {name: {"first_text": text, "then_text": text} for name, text in texts.items()}


def setpoint_entry(words: Words, setpoint_degC: float) -> str:
    """Return the setpoint of a proof as a person enters it, with its unit.

    Args:
        words: of any controller.
        setpoint_degC: the setpoint of the proof [°C].
    """
    controller = controller_for(words.target)
    units = controller.measure(words, setpoint_degC)
    if controller.setpoint_entry is not None:
        return controller.setpoint_entry(words, setpoint_degC, units)
    name, format_ = next(iter(controller.inputs.items()))
    return f"{setpoint_degC:.9g} °C" if format_ in FLOATS else f"{name} = {word_text(units)}"


def typed_table(rows: Sequence[KeyedEntry]) -> TypedTable:
    """Return the rows as text: with one column of values, or two where a word is typed twice."""
    if not any(row.changes for row in rows):
        return TypedTable(("address", "word", "value", "meaning"), (2,), [
            (row.address, row.name, row.then_text, row.meaning) for row in rows])
    return TypedTable(("address", "word", FIRST, THEN, "meaning"), (2, 3), [
        (row.address, row.name, row.first_text, row.then_text if row.changes else "", row.meaning) for row in rows])


def word_text(value: Number, format_: str = "") -> str:
    """Return a word as people read it: a pattern of bits as bits, a REAL with nine digits, so none is another's.

    An LREAL has the fewest digits that no other has.
    """
    if format_ == "KM":
        return f"KM {bits(int(value))}"
    if format_ == "LREAL":
        return repr(float(value)).removesuffix(".0")
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def as_typed(value: Number, format_: str) -> str:
    """Return a word as its programming tool takes it: KF +02968, TRUE, T#17000MS, a REAL with its decimal point."""
    if format_ == "KF":
        return f"KF {int(value):+06d}"
    if format_ == "BOOL":
        return "TRUE" if value else "FALSE"
    if format_ == "TIME":
        return f"T#{int(value)}MS"
    text = word_text(value, format_)
    return f"{text}.0" if format_ in FLOATS and text.lstrip("-").isdigit() else text


def bits(value: int) -> str:
    """Return 16 bits as STEP 5 writes them: high byte, low byte."""
    text = f"{value:016b}"
    return f"{text[:8]} {text[8:]}"
