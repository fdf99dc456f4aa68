"""A design that fails → what would pass, in the page's own words, and what pressing the button changes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from heatertune.proof.redesign import DesignResult
from heatertune.studio.settings import StudioSettings
from heatertune.studio.wording import for_page

__all__ = ["SuggestedChange", "assumed_told", "mend_for"]

_SWITCH: Final = re.compile(r",? and say --switch \w+=\S+?(?=[.;]|$)|--switch (\w+)=(\S+)")
_LIMIT: Final = re.compile(r"--limit ([\w-]+)=(\S+)")
_TOLERANCE: Final = re.compile(r"--tolerance ([\d.]*\d)")
_INTERVAL: Final = re.compile(r"--sample-time ([\d.]*\d)(?= --)")
_TA_AUTO: Final = re.compile(r"--sample-time auto")
_STRUCTURE: Final = re.compile(r"--structure (\w+)")
_MS: Final = re.compile(r"--ms ([\d.]*\d)")
_SETPOINT: Final = re.compile(r"--setpoint ([\d.]*\d)")
_BURST: Final = re.compile(r", and tried without --switch-kind")

#: options that are one setting each
_FIELDS: Final = {"--tolerance": "tolerance_degC", "--sample-time": "sample_time_s", "--setpoint": "setpoint_degC",
                  "--ms": "ms", "--structure": "structure"}
#: options of the design and of the conditions, which allow nothing
_ASKED: Final = ("--sample-time", "--setpoint", "--ms", "--structure")


@dataclass(frozen=True, slots=True, kw_only=True)
class SuggestedChange:
    """What is offered beside FAIL.

    Attributes:
        told: what would pass and its price, in a sentence or two.
        button: what is pressed; "" where nothing is known that helps.
        moved: settings that pressing it moves; none: it shows the design that was found.
    """

    message: str
    button: str = ""
    changes: Mapping[str, Any] = field(default_factory=dict)


def mend_for(found: DesignResult, settings: StudioSettings) -> SuggestedChange:
    """Return the offer of a design that was found for settings whose words fail."""
    if found.proof.verdict != "FAIL":
        notes = [note for note in found.notes if not note.startswith("Under ")]
        told = notes[0] if notes else "The optimum keeps every limit; the gains in front were found in haste."
        return SuggestedChange(message=_plain(told), button="Show the nearest design that passes")
    told = _plain(found.notes[-1]) if found.notes else "Nothing tried mends it."
    moved = dict(_moved(found.passes_with, settings))
    if not moved:
        return SuggestedChange(message=told)
    button = "Take that as known" if "assumptions" in moved else (
        "Ask for that" if {*found.passes_with[::2]} <= {*_ASKED} else "Allow that much")
    return SuggestedChange(message=told, changes=moved, button=button)


def assumed_told(settings: StudioSettings) -> str:
    """Return what was allowed or taken as known beside the defaults, "" where nothing was."""
    parts = [f"{name} = {setting}" for name, setting in settings.assumptions]
    parts += [f"{name.replace('-', ' ')} up to {value}" for name, _, value in
              (limit.partition("=") for limit in settings.limits)]
    if settings.tolerance_degC is not None:
        parts.append(f"±{settings.tolerance_degC:g} °C counts as settled")
    return f"Proven under what you allowed: {', '.join(parts)}." if parts else ""


def _moved(options: tuple[str, ...], settings: StudioSettings) -> Iterator[tuple[str, Any]]:
    """Return the settings that options mean: flags and values, in turn."""
    pairs = list(zip(options[::2], options[1::2], strict=True))
    switches = tuple(value.partition("=")[::2] for flag, value in pairs if flag == "--switch")
    limits = tuple(value for flag, value in pairs if flag == "--limit")
    if switches:
        yield "assumptions", (*settings.assumptions, *switches)
    if limits:
        named = {limit.partition("=")[0] for limit in limits}
        yield "limits", (*(own for own in settings.limits if own.partition("=")[0].strip() not in named), *limits)
    for flag, value in pairs:
        if flag in _FIELDS:
            yield _FIELDS[flag], None if value == "auto" else value if flag == "--structure" else float(value)


def _plain(told: str) -> str:
    """Return a sentence without options of the command line."""
    told = _SWITCH.sub(lambda found: f"{found[1]} = {found[2]}" if found[1] else "", told)
    told = _LIMIT.sub(lambda found: f"{found[1].replace('-', ' ')} up to {found[2]}", told)
    told = _INTERVAL.sub(r"TA = \1 s and", _TA_AUTO.sub("a TA found with the design", told))
    told = _STRUCTURE.sub(lambda found: f"the structure {found[1].upper()}", _MS.sub(r"Ms up to \1", told))
    told = _SETPOINT.sub(r"a setpoint of \1 °C", told)
    told = for_page(_BURST.sub("", _TOLERANCE.sub(r"a tolerance of \1 °C", told)))
    return told if told.endswith(".") else f"{told}."
