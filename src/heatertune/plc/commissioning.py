"""Commissioning of a controller, step by step: report and manual use the text in its folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files

from heatertune.errors import UnknownName
from heatertune.plc.targets import NAMES

__all__ = ["Commissioning", "commissioning"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Commissioning:
    """The steps of one controller.

    Attributes:
        facts: the source documents.
        steps: section → its steps, in order.
    """

    facts: str
    steps: Mapping[str, tuple[str, ...]]


def commissioning(target: str) -> Commissioning:
    """Return the steps of a target, read from its COMMISSIONING.md.

    Raises:
        UnknownName: no such target.
    """
    if target not in NAMES:
        raise UnknownName("target", target, NAMES)
    head, *parts = files(NAMES[target]).joinpath("COMMISSIONING.md").read_text(encoding="utf-8").split("\n## ")
    steps = {}
    for part in parts:
        title, _, body = part.partition("\n")
        steps[title.strip()] = tuple(" ".join(item.split()) for item in _items(body))
    facts = " ".join(head.partition("\n")[2].split()).removeprefix("Facts: ")
    return Commissioning(facts=facts, steps=steps)


def _items(body: str) -> list[str]:
    """Return the numbered items of a Markdown list, each with its continuation lines, without the numbers."""
    items: list[str] = []
    for line in body.strip().splitlines():
        number, dot, rest = line.partition(". ")
        if dot and number.isdigit():
            items.append(rest)
        else:
            items[-1] += f" {line}"
    return items
