"""WEG's advice for retuning by hand (WPS help, SCA06 Ladder, block PID, second NOTE): symptom → changes of the gains.

It is meant for the academic form, where Kp scales all three parts.
"""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

__all__ = ["ADVICE", "AcademicGains", "Change", "Symptom", "apply_changes"]


class Symptom(Enum):
    """What a response to a setpoint step looks like; the value is the sentence for people."""

    OVERSHOOT = "almost good, but the overshoot is a bit high"
    SLOW = "almost good, but late at the setpoint, without overshoot"
    RESTLESS = "good, but the temperature varies too much"
    OSCILLATING = "bad: several periods of oscillation that hardly decay"
    FAR = "bad: creeps towards the setpoint without overshoot, and is still far from it"
    NONE = "good: none of the manual's symptoms"


class AcademicGains(NamedTuple):
    """Kp [% per °C], Ki [1/s] and Kd [s] of the academic form."""

    kp: float
    ki: float
    kd: float


class Change(NamedTuple):
    """One numbered step of an advice: a gain of `Gains` and by how much [%]."""

    gain: str
    percent: int

    @property
    def label(self) -> str:
        """The step as people write it."""
        return f"{self.gain.capitalize()} {self.percent:+d} %"


#: in the order and with the figures of the manual
ADVICE: Final[dict[Symptom, tuple[Change, ...]]] = {
    Symptom.OVERSHOOT: (Change("kp", -20), Change("ki", -20), Change("kd", -50)),
    Symptom.SLOW: (Change("kp", 20), Change("ki", 20), Change("kd", 50)),
    Symptom.RESTLESS: (Change("kd", 50), Change("kp", -20)),
    Symptom.OSCILLATING: (Change("kp", -50),),
    Symptom.FAR: (Change("kp", 50), Change("ki", 50), Change("kd", 70)),
    Symptom.NONE: (),
}


def apply_changes(gains: AcademicGains, changes: tuple[Change, ...]) -> AcademicGains:
    """Return the gains after all of the changes."""
    for change in changes:
        gains = gains._replace(**{change.gain: getattr(gains, change.gain) * (100 + change.percent) / 100.0})
    return gains
