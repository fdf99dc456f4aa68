"""Faults on a timetable: what goes wrong with the heater, the sensor, the link, and what people do."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from heatertune.errors import InputError, UnknownName
from heatertune.proof.kernel import LOAD, MAINS

__all__ = ["FAULTS", "HEATER", "LINK", "ScheduledFault", "fault_of", "heater_events", "touch_mains"]

#: name → what happens; those with = take a number
HEATER: Final[Mapping[str, str]] = {
    "heater-open": "its circuit is open",
    "half-power": "half of it has failed, or the switch passes every other half-wave",
    "stuck-on": "the switch conducts for ever",
    "polarity": "power moves the temperature the wrong way",
    "mains=": "the voltage is so much higher or lower [%]",
    "ambient=": "the ambient is so much warmer or colder [°C]",
}
SENSOR: Final[Mapping[str, str]] = {
    "sensor-off": "its wire is broken: the module reads its upper end",
    "sensor-frozen": "the reading stands still",
    "sensor-half": "it is half out: it sees half of the rise above the ambient",
    "sensor-reversed": "its poles are changed: a rise reads as a fall",
}
PEOPLE: Final[Mapping[str, str]] = {
    "word NAME=": "somebody writes this word",
    "cpu-stop": "somebody puts the CPU in STOP",
    "db-missing": "the block is deleted, which stops the CPU",
    "db-short": "the block is half as long, which stops the CPU",
    "write-protected": "the block cannot be written",
    "compressed": "somebody compresses the memory: over AS511 the blocks stand elsewhere",
}
LINK: Final[Mapping[str, str]] = {
    "cut": "connections are closed, and new ones too",
    "black-hole": "nothing gets through, without any error",
    "lost-reply": "requests arrive, replies do not",
    "late-reply=": "each reply comes so many scans later",
    "torn": "a scan writes half of the block, and the rest with the next scan",
}
FAULTS: Final[Mapping[str, str]] = {**HEATER, **SENSOR, **PEOPLE, **LINK}

_WORD: Final = "word"
_FORM: Final = 't=SECONDS NAME [until=SECONDS], as "t=900 sensor-off until=1200"'
_RULE: Final = re.compile(r"t=(\S+) (?:(word) (\w+)=(\S+)|([a-z-]+)(?:=(\S+))?)(?: until=(\S+))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduledFault:
    """One fault.

    Attributes:
        name: as in `FAULTS`, without what follows it.
        begins_s, ends_s: of the plant's time [s]; what does not end is there for ever.
        value: its number, where it has one.
        word: that is written, where one is.
    """

    name: str
    begins_s: float
    ends_s: float = math.inf
    value: float = 0.0
    word: str = ""

    def at(self, time_s: float) -> bool:
        """Return whether it is there at an instant."""
        return self.begins_s <= time_s < self.ends_s


def fault_of(text: str) -> ScheduledFault:
    """Return the fault that a text names.

    Raises:
        InputError: another form, a time that is none, or a number where there is none.
        UnknownName: no such fault.
    """
    found = _RULE.fullmatch(" ".join(text.split()))
    if found is None:
        raise InputError(f"--fault {text!r}: expected {_FORM}")
    begins, word, name, new, plain, value, until = found.groups()
    begins_s, ends_s = _number(text, begins, 0.0), math.inf if until is None else _number(text, until, 0.0)
    if not ends_s > begins_s:
        raise InputError(f"--fault {text!r}: it ends at {ends_s:g} s, before it begins")
    if word is not None:
        return ScheduledFault(name=_WORD, begins_s=begins_s, ends_s=ends_s, value=_number(text, new), word=name)
    if plain not in FAULTS and f"{plain}=" not in FAULTS:
        raise UnknownName("fault", plain, [known.rstrip("=") for known in FAULTS])
    if (value is not None) != (f"{plain}=" in FAULTS):
        raise InputError(f"--fault {text!r}: {plain} {'takes no number' if value is not None else 'needs =NUMBER'}")
    number = 0.0 if value is None else _number(text, value)
    _demand(text, plain, number)
    return ScheduledFault(name=plain, begins_s=begins_s, ends_s=ends_s, value=number)


def _demand(text: str, name: str, value: float) -> None:
    """Refuse a number without meaning."""
    if name == "mains" and not -100.0 <= value <= 50.0:
        raise InputError(f"--fault {text!r}: mains takes -100…50 % of the voltage")
    if name == "late-reply" and not (value >= 1.0 and value == int(value)):
        raise InputError(f"--fault {text!r}: late-reply takes a whole number of scans from 1 on")


def _number(text: str, part: str, least: float = -math.inf) -> float:
    try:
        value = float(part)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= least):
        raise InputError(f"--fault {text!r}: {part!r} is no number{'' if least < 0.0 else ' from 0 on'}")
    return value


def touch_mains(faults: Iterable[ScheduledFault]) -> bool:
    """Return whether one of them changes what full power is."""
    return any(_is_heaters(fault) and fault.name != "ambient" for fault in faults)


def heater_events(faults: Sequence[ScheduledFault], gain_degC_per_pct: float,
                  dead_s: float) -> list[tuple[float, int, float]]:
    """Return what the proof's kernel is told of faults of the heater: instants [s], kinds and values, in order.

    What acts on the power reaches the temperature after the dead time.

    Args:
        faults: of which those of the heater are taken.
        gain_degC_per_pct: of the heater [°C/%].
        dead_s: its dead time [s].
    """
    own = [fault for fault in faults if _is_heaters(fault)]
    instants = sorted({instant for fault in own for instant in (fault.begins_s, fault.ends_s) if instant < math.inf})
    events, mains, load = [], 1.0, 0.0
    for instant in instants:
        there = [fault for fault in own if fault.at(instant)]
        now = math.prod(_share(fault) for fault in there)
        more = sum(_load(fault, gain_degC_per_pct) for fault in there)
        if more != load:
            events.append((instant + dead_s, LOAD, more - load))
        if now != mains:
            events.append((instant + dead_s, MAINS, now))
        mains, load = now, more
    return events


def _is_heaters(fault: ScheduledFault) -> bool:
    return fault.name in HEATER or f"{fault.name}=" in HEATER


def _share(fault: ScheduledFault) -> float:
    """Return the share of the rated power that full power is."""
    shares = {"heater-open": 0.0, "stuck-on": 0.0, "half-power": 0.5, "polarity": -1.0,
              "mains": (1.0 + fault.value / 100.0) ** 2}
    return shares.get(fault.name, 1.0)


def _load(fault: ScheduledFault, gain: float) -> float:
    """Return the power that is there whatever the switch does [%]."""
    return {"stuck-on": 100.0, "ambient": fault.value / gain}.get(fault.name, 0.0)
