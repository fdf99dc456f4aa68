"""Two word sets apart: in engineering terms, word by word, and whether the proof of one covers the other.

Words that were written into a PLC, beside the proof: as found, as left, and the response that was watched.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from heatertune.codec import Document, data_folder, existing_path, peek_schema, read_document, register_schema
from heatertune.errors import DocumentError, ExportRefused, InputError
from heatertune.pid.design_document import SCHEMA as DESIGN_SCHEMA
from heatertune.pid.design_document import read_design
from heatertune.plc import Controller, Scaling, Words, controller_for
from heatertune.plc.dump_reader import content_of, read_machine, realised_design
from heatertune.plc.inputs import describe_range
from heatertune.plc.keyed_entry import typed_words
from heatertune.proof.proof_document import check_document
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import WORDS_SCHEMA, demand_same_words, read_words

__all__ = [
    "DIFF_SCHEMA", "IN_BLOCK", "WRITTEN_SCHEMA", "DeclaredWords", "Outcome", "Passage", "Quantity", "Side", "Watch",
    "WriteHistory", "difference", "read_sides",
]


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


DIFF_SCHEMA: Final = "heatertune/diff/3"

#: of a proof's document: under what it was made, and how that is called
_CONDITIONS: Final = {
    "scenario": "what the words live through", "actuator": "the switch", "limits": "the limits",
    "specification": "the specification", "stated_settings": "what is known of the controller",
    "interlock": "the interlock",
    "findings": "the findings of the fit", "assumed": "what is assumed of the heater", "remarks": "the remarks",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredWords:
    """What a user says of words that do not tell it themselves; None: as the words beside them have it.

    Attributes:
        target: the controller.
        sample_time_s: interval at which it is called [s].
        sensor_degC: temperatures at both ends of the sensor's range [°C].
        input: range of the analog module.
        switches: settings of open points; of a text with several heaters they select one.
    """

    target: str | None = None
    sample_time_s: float | None = None
    sensor_degC: tuple[float, float] | None = None
    input: str | None = None
    switches: Mapping[str, str] = field(default_factory=dict)

    @property
    def scales(self) -> bool:
        """Whether a user says anything of the sensor's range."""
        return self.sensor_degC is not None or self.input is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """One of two word sets.

    Attributes:
        source: the file or folder.
        kind: "words" (a document), "design" (rounded here) or "machine" (a dump or text).
        words: the words.
        proof: its document, None where there is none of exactly these words.
        taken_over: what is not known of them and was taken to be as in the other set, a few words each.
        is_changed: whether the program around the words is not the one that is exported with them.
        notes: what stands in a text besides, and why a proof beside the words was not taken.
    """

    source: str
    kind: str
    words: Words
    proof: Document | None = None
    taken_over: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    is_changed: bool = False

    @property
    def controller(self) -> Controller:
        """Its controller."""
        return controller_for(self.words.target)


class _Term(NamedTuple):
    """One quantity in both sets; None: there is none of it."""

    name: str
    unit: str
    a: float | None
    b: float | None


def read_sides(first: str | Path, second: str | Path, declared: DeclaredWords) -> tuple[Side, Side]:
    """Return two word sets; what one does not tell is as the user says, else as in the other.

    Args:
        first: a folder with words.json, a words.json, a pid.json, or a dump or text of a controller.
        second: likewise.
        declared: what the user says.

    Raises:
        InputError: a file that is none of them or cannot be read; a target or interval that nobody tells.
        NotRepresentable, OutOfRange: words that the controller does not allow, a design that does not fit its words.
    """
    a, b = (_document(Path(path), declared.target) for path in (first, second))
    if a is None and b is None and _is_json(Path(second)):  # a design tells its interval, a dump does not
        b = _side_of(str(second), declared, None)
    a = _side_of(str(first), declared, b) if a is None else a
    return a, _side_of(str(second), declared, a) if b is None else b


def _document(path: Path, target: str | None) -> Side | None:
    """Return the words of a folder or of words.json, None of another file."""
    try:
        is_folder = path.is_dir()
    except OSError as problem:  # a name too long
        raise DocumentError(f"{path}: cannot be read: {problem.strerror}") from problem
    file = data_folder(path) / "words.json" if is_folder else existing_path(path)
    if is_folder and not file.exists():
        raise DocumentError(f"{path}: no words.json in this folder, as export-db writes it")
    if not is_folder and not (_is_json(file) and peek_schema(file) == WORDS_SCHEMA):
        return None
    document = read_document(file, WORDS_SCHEMA)
    words = read_words(file, target or str(document.get("target")))
    assert words is not None
    proof, notes = _proof_beside(file, document)
    return Side(source=str(path), kind="words", words=words, proof=proof, notes=notes)


def _is_json(file: Path) -> bool:
    return content_of(existing_path(file)).lstrip().startswith(b"{")


def _proof_beside(file: Path, document: Document) -> tuple[Document | None, tuple[str, ...]]:
    proof_file = file.with_name("proof.json")
    if not proof_file.exists():
        return None, ()
    try:
        proof = check_document(read_document(proof_file, PROOF_SCHEMA), proof_file)
        demand_same_words(document, proof, proof_file)
    except (DocumentError, ExportRefused) as problem:
        return None, (f"its proof is not taken: {problem}",)
    return proof, ()


def _side_of(path: str, declared: DeclaredWords, opposite: Side | None) -> Side:
    """Return words that a design becomes or a machine holds."""
    return _designed(path, declared, opposite) if _is_json(Path(path)) else _dumped(path, declared, opposite)


def _designed(path: str, declared: DeclaredWords, opposite: Side | None) -> Side:
    """Return the words of a design: as its own recipe makes them, where it has one and the user says nothing else."""
    schema = peek_schema(path)
    if schema != DESIGN_SCHEMA:
        raise DocumentError(f"{path}: schema is {schema!r}; expected {WORDS_SCHEMA!r} or {DESIGN_SCHEMA!r}")
    from heatertune.proof.repetition import apply_provenance, repeat_words

    design, model, recipe = read_design(path)
    is_own = recipe is not None and declared.target in (None, recipe.target) and not declared.scales
    if is_own and model is not None and recipe is not None:
        return Side(source=path, kind="design", words=repeat_words(design, model, recipe).words)
    controller, scaling, taken_over = _whose(path, declared, opposite)
    words = apply_provenance(controller.encode(design, scaling), recipe)
    return Side(source=path, kind="design", words=words, taken_over=taken_over)


def _dumped(path: str, declared: DeclaredWords, opposite: Side | None) -> Side:
    """Return the words in a dump or text, with the other set's interval and ramp where it does not tell them."""
    controller, scaling, taken_over = _whose(path, declared, opposite)
    interval = declared.sample_time_s
    if interval is None and opposite is not None and controller.interval_s is None:
        interval = opposite.words.sample_time_s
        taken_over += (f"call interval {interval:g} s",)
    same = opposite if opposite is not None and opposite.words.target == controller.name else None
    proven = {} if same is None or same.proof is None else same.proof["stated_settings"]
    read = read_machine(controller, content_of(path), sample_time_s=interval, scaling=scaling, source=path,
                        stated={**proven, **declared.switches})
    words = read.words
    if same is not None:
        words = replace(words, ramp=same.words.ramp, boost=same.words.boost)
    unlike = () if read.unlike is None else read.unlike(words)
    if read.unlike is None:
        ways = {"setpoint ramp": words.ramp, "boost": words.boost}
        extras = (f"{name}, {way}" for name, way in ways.items() if way is not None)
        taken_over += (*extras, "the program around the words")
    notes = [*unlike, *(f"not looked at: {passage}" for passage in read.passed_over),
             *(f"assumed, as the text does not say: {each}" for each in read.assumed)]
    return Side(source=path, kind="machine", words=words, taken_over=taken_over, notes=tuple(notes),
                is_changed=bool(unlike))


def _whose(path: str, declared: DeclaredWords, opposite: Side | None) -> tuple[Controller, Scaling, tuple[str, ...]]:
    """Return the controller and sensor range of words that do not tell them, and what was taken over of the other's."""
    target = declared.target or (None if opposite is None else opposite.words.target)
    if target is None:
        raise InputError(f"{path}: --target is needed: neither file names the controller")
    its = controller_for(target)
    if declared.scales or opposite is None:
        return its, its.scaled(declared.input, declared.sensor_degC), ()
    scaling = opposite.words.scaling
    return its, scaling, (f"sensor range {describe_range(scaling)}",)


def difference(a: Side, b: Side) -> dict[str, Any]:
    """Return the document of what differs.

    Args:
        a: the words before.
        b: those after.
    """
    terms = [_Term(name, unit, one, two) for (name, unit, one), (_, _, two) in zip(_terms(a), _terms(b), strict=True)]
    words = _words(a, b)
    odd = [set(_odd(side)) for side in (a, b)]
    around = ["program around the words"] if a.is_changed or b.is_changed else []
    around += [name for name, one, two in _around(a, b) if one != two]
    return {
        "schema": DIFF_SCHEMA, "a": _side_document(a), "b": _side_document(b),
        "same": not around and not [word for word in words if not word["written"]],
        "terms": [term._asdict() | {"change_pct": _change_pct(term)} for term in terms], "around": around,
        "words": words, "odd_in_a_alone": [sentence for sentence in _odd(a) if sentence not in odd[1]],
        "odd_in_b_alone": [sentence for sentence in _odd(b) if sentence not in odd[0]],
        "proofs": [_covers(one, two) for one, two in ((a, b), (b, a)) if one.proof is not None],
        "conditions": None if a.proof is None or b.proof is None else _conditions(a.proof, b.proof),
    }


def _side_document(side: Side) -> dict[str, Any]:
    return {
        "source": side.source, "kind": side.kind, "target": side.words.target, "input": side.words.scaling.input,
        "verdict": None if side.proof is None else side.proof["verdict"],
        "digest": None if side.proof is None else side.proof["digest"],
        "taken_over": list(side.taken_over), "notes": list(side.notes),
    }


def _odd(side: Side) -> tuple[str, ...]:
    return () if side.controller.oddities is None else side.controller.oddities(side.words)


def _terms(side: Side) -> Iterator[tuple[str, str, float | None]]:
    """Yield name, unit and value of what words mean."""
    words, controller = side.words, side.controller
    design = realised_design(controller, words)
    yield "K", "%/°C", None if design is None else design.gain_pct_per_degC
    yield "TN", "s", None if design is None or math.isinf(design.integral_time_s) else design.integral_time_s
    yield "TV", "s", None if design is None else design.derivative_time_s
    yield "TA", "s", words.sample_time_s
    yield "largest power", "%", _largest_power(controller, words)
    yield "range from", "°C", words.scaling.low_degC
    yield "range to", "°C", words.scaling.high_degC
    rate = controller.ramp_degC_per_min(words)
    yield "setpoint ramp", "°C/min", None if math.isinf(rate) else rate
    yield "holdback", "°C", controller.hold_degC(words)
    yield "boost until", "°C", None if words.boost is None else words.boost.within_degC


def _largest_power(controller: Controller, words: Words) -> float | None:
    if controller.most_power is None:
        return None
    name, full = controller.most_power
    return 100.0 * words.values[name] / full


def _change_pct(term: _Term) -> float | None:
    """Return by how much b is more than a [%], None where there is no such share."""
    if term.a is None or term.b is None or term.a == 0.0 or term.unit == "°C":
        return None
    return 100.0 * (term.b / term.a - 1.0)


def _words(a: Side, b: Side) -> list[dict[str, Any]]:
    """Return the words that differ; of two controllers none can be compared."""
    if a.words.target != b.words.target:
        return []
    texts = [{row.name: row.then_text for row in typed_words(side.words)} for side in (a, b)]
    return [
        {"address": one.address, "name": one.name, "a": a.words.values[one.name], "b": b.words.values[one.name],
         "a_text": texts[0][one.name], "b_text": texts[1][one.name], "format": one.format, "comment": one.comment,
         "written": one.name in a.controller.written}
        for one in a.controller.fields if a.words.values[one.name] != b.words.values[one.name]]


def _around(a: Side, b: Side) -> Iterator[tuple[str, object, object]]:
    """Yield name and values of what belongs to words besides them."""
    yield "target", a.words.target, b.words.target
    yield "call interval", a.words.sample_time_s, b.words.sample_time_s
    one, two = a.words.scaling, b.words.scaling
    yield "analog input", one.input, two.input
    yield "sensor range", (one.low_degC, one.high_degC, one.from_degC), (two.low_degC, two.high_degC, two.from_degC)
    yield "setpoint ramp", a.words.ramp, b.words.ramp
    yield "boost", a.words.boost, b.words.boost


def _covers(proven: Side, side: Side) -> dict[str, Any]:
    """Return whether a proof is of the other's words, why not, and what is not known of these."""
    assert proven.proof is not None
    why = [name for name, one, two in _around(proven, side) if one != two]
    why += ["program around the words"] if side.is_changed else []
    why += [f"word {word['name']}" for word in _words(proven, side) if not word["written"]]
    return {
        "proof_of": proven.source, "verdict": proven.proof["verdict"], "words_of": side.source, "covers": not why,
        "why_not": why, "provided": [] if why else list(side.taken_over),
    }


def _conditions(document: Mapping[str, Any], two: Mapping[str, Any]) -> list[str]:
    """Return under what two proofs were not made alike; empty: under the same."""
    unlike = [meaning for name, meaning in _CONDITIONS.items() if document[name] != two[name]]
    models = [{run["model"] for run in proof["runs"]} for proof in (document, two)]
    return [*unlike, *(["the plausible heaters"] if models[0] != models[1] else [])]
