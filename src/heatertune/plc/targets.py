"""The names of all targets, and the text in a target's folder that leads through its commissioning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Final

from heatertune.errors import InputError, UnknownName

__all__ = [
    "ALIKE", "COOLING", "FAITHFUL", "GROUPS", "NAMES", "REPAIRED", "SYNONYMS", "TARGETS", "Commissioning",
    "commissioning", "target_by_name",
]


#: what holds the controller → its controllers, by their names on the command line
GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "PLC": (
        "s5-ob251", "s7-200", "s7-200-paper", "s7-200-pid", "s7-300", "fb41", "pid-compact", "pid-temp", "weg",
        "iec-pid", "iec-pid-text", "on-off",
    ),
    "instrument": ("pband",),
    "printer": ("klipper", "marlin"),
    "maker": ("arduino-pid", "esphome", "simple-pid"),
}

#: name on the command line → its package: the folder named as the target, whose controller.py has the class
TARGETS: Final[dict[str, str]] = {
    name: f"heatertune.plc.{name.replace('-', '_')}" for names in GROUPS.values() for name in names
}

#: target → the makes of instrument that its package has beside it: the same law, with places and digits of their own
ALIKE: Final[dict[str, tuple[str, ...]]] = {
    "pband": ("omron-e5cc", "eurotherm-3200", "jumo-dicon", "abb-commander-300", "omega-cn7800"),
}

#: target that heats → the same one with a cooler beside the heater, in the same package
COOLING: Final[dict[str, str]] = {"pid-temp": "pid-temp-cooling"}

#: target → the same as its source prints it, faults included; and back
FAITHFUL: Final[dict[str, str]] = {"s7-200": "s7-200-paper", "iec-pid": "iec-pid-text"}
REPAIRED: Final[dict[str, str]] = {faithful: name for name, faithful in FAITHFUL.items()}

#: every name on the command line → its package
NAMES: Final[dict[str, str]] = TARGETS | {make: TARGETS[name] for name, makes in ALIKE.items() for make in makes} | {
    cooling: TARGETS[name] for name, cooling in COOLING.items()}


#: what the hardware is called as well → its controller
SYNONYMS: Final[dict[str, str]] = {
    "ob251": "s5-ob251", "s5-115u": "s5-ob251", "s7-1200": "pid-compact", "s7-1500": "pid-compact",
    "pid_compact": "pid-compact", "pid_temp": "pid-temp", "cont_c": "fb41", "e5cc": "omron-e5cc",
    "pid_v1": "arduino-pid", "arduino": "arduino-pid",
}


def target_by_name(name: str) -> str:
    """Return the target of a name in any case, or of what its hardware is called as well; others as they are.

    Raises:
        InputError: no text.
    """
    if not isinstance(name, str):
        raise InputError(f"target = {name!r}: expected the name of one controller, such as 's5-ob251'")
    plain = name.lower()
    return SYNONYMS.get(plain) or (plain if plain in NAMES else name)


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
