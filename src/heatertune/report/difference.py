"""What tells two word sets apart, as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from heatertune.plc.inputs import INPUTS
from heatertune.report.layout import table
from heatertune.report.text import figure

__all__ = ["difference_lines"]

Document = Mapping[str, Any]


def difference_lines(document: Document) -> str:
    """Return quantities, words, oddities and proofs of two word sets, side by side; the last line is the outcome."""
    a, b = document["a"], document["b"]
    blocks = [table([("", a["source"], b["source"], ""), *_terms(document)], right=(1, 2))]
    if rows := list(_words(document)):
        blocks.append(table([("address", "word", "before", "after", "meaning"), *rows], right=(2, 3)))
    notes = [f"{side['source']}: {sentence}" for side in (a, b) for sentence in _of_side(side)]
    notes += [f"no longer: {sentence}" for sentence in document["odd_in_a_alone"]]
    notes += [f"now: {sentence}" for sentence in document["odd_in_b_alone"]]
    notes += [_covers(proof) for proof in document["proofs"]]
    if document["conditions"] is not None:
        unlike = ", ".join(document["conditions"])
        notes.append(f"the proofs differ in {unlike}" if unlike else "both proofs were made under the same conditions")
    return "\n".join([*blocks, *(f"- {note}" for note in notes), _outcome(document)])


def _terms(document: Document) -> Iterator[tuple[str, str, str, str]]:
    """Yield the quantities; what is in neither set is left out."""
    for term in document["terms"]:
        one, two = term["a"], term["b"]
        if one is None and two is None:
            continue
        shown = [f"{figure(value)} {term['unit']}" if value is not None else "none" for value in (one, two)]
        yield term["name"], shown[0], shown[1], _change(term)


def _change(term: Document) -> str:
    if term["a"] == term["b"]:
        return "as before"
    if term["change_pct"] is None:
        return "changed"
    return f"{term['change_pct']:+.2g} %" if abs(term["change_pct"]) < 1e3 else f"{term['b'] / term['a']:.3g} times"


def _words(document: Document) -> Iterator[tuple[str, str, str, str, str]]:
    for one in document["words"]:
        live = " (written by the program: no difference)" if one["written"] else ""
        yield one["address"], one["name"], one["a_text"], one["b_text"], f"{one['comment']}{live}"


def _of_side(side: Document) -> Iterator[str]:
    if side["kind"] == "design":
        yield f"a design, made words of {side['target']}"
    if side["input"] is not None:
        yield f"its sensor is {INPUTS[side['input']]}"
    yield from side["notes"]


def _covers(proof: Document) -> str:
    head = f"the proof of {proof['proof_of']} ({proof['verdict']})"
    if not proof["covers"]:
        return f"{head} does not cover {proof['words_of']}: another {', another '.join(proof['why_not'])}"
    provided = f", where these are as proven: {', '.join(proof['provided'])}" if proof["provided"] else ""
    return f"{head} covers {proof['words_of']}{provided}"


def _outcome(document: Document) -> str:
    if document["same"]:
        return "SAME WORDS"
    unlike = [*document["around"], *(f"word {one['name']}" for one in document["words"] if not one["written"])]
    return f"DIFFERENT: {', '.join(unlike)}"
