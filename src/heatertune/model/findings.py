"""What a fit found that a verdict has to hear: each kind declared once, with what it does to the verdict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from heatertune.errors import UnknownName

__all__ = ["KINDS", "Finding", "Kind"]

Effect = Literal["blocks", "widens", "told"]


class Kind(NamedTuple):
    """A kind of finding.

    Attributes:
        effect: "blocks": the verdict is NOT PROVEN until the user accepts it by name; "widens": more possible heaters
            are designed for and proven on; "told": it stands on the verdict's line.
        short: what was found, for the verdict's line.
        remedy: what closes it.
    """

    effect: Effect
    short: str
    remedy: str


#: name → kind; the manual's table and --accept's choices are made of this
KINDS: Final[dict[str, Kind]] = {
    "poor-fit": Kind(
        "blocks", "no model explains the log well", "log the power, and keep doors and fans still"),
    "dead-time-open": Kind(
        "blocks", "the log does not bound the dead time",
        "log one step of the power at a shorter interval (heatertune plan), or bound it with --dead-time-at-most"),
    "faster-than-log": Kind(
        "blocks", "the heater answers faster than the log's interval shows", "log at a shorter interval"),
    "not-foretold": Kind(
        "blocks", "readings left out of the fit are not foretold", "log one open-loop step until it rests"),
    "follows-power": Kind(
        "told", "what the model leaves over still follows the power", "log one open-loop step until it rests"),
    "halves-disagree": Kind(
        "widens", "the halves of the log give different heaters", "log one open-loop step until it rests"),
    "logs-disagree": Kind(
        "widens", "the logs give different heaters", "log them under the conditions of use"),
    "contradicted": Kind(
        "blocks", "what the curve shows by itself contradicts every model", "log the power, or one open-loop step"),
    "one-level": Kind(
        "told", "the log knows one level of power, so that the heater is linear is assumed",
        "log steps to two levels of power around the one of use"),
    "nonlinear": Kind(
        "widens", "the gain depends on the power or on the level", "log steps around the setpoint of use"),
    "setpoint-unreached": Kind(
        "blocks", "not every possible heater can hold the setpoint", "log nearer to the setpoint, or lower it"),
    "coarse-sensor": Kind(
        "blocks", "the sensor is too coarse for the tolerance asked for",
        "take a narrower sensor range (--range) or a finer input module, or ask for less (--tolerance)"),
    "winds-up": Kind(
        "blocks", "it winds up the more, the longer the heater's circuit is open",
        "find out what your controller does at its limit (--switch), or keep it in manual while the circuit is open"),
    "briefly-open": Kind(
        "blocks", "it overshoots by more than its limit after a shorter open circuit than the story's",
        "allow what it does then (--limit reheat-overshoot), or find out what your controller does at its limit "
        "(--switch), or keep it in manual while the circuit is open"),
    "warm-restart": Kind(
        "blocks", "it overshoots by more than its limit where the PLC is restarted while the heater is warm",
        "allow what it does then (--limit overshoot), or let the heater cool down before it is switched on"),
    "part-change": Kind(
        "blocks", "it overshoots by more than its limit where the setpoint changes by a part of its range of use",
        "allow what it does then (--limit overshoot), or say a smaller range (--setpoint)"),
    "stays-at-limit": Kind(
        "blocks", "it may stay at full power where the setpoint rises while the heater warms up",
        "find out what your controller does at its limit (--switch), leave out D (--structure pi), or let the heater "
        "settle before the setpoint rises"),
    "known-faults": Kind(
        "blocks", "the program is known to be wrong where no run of a proof leads",
        "take the same program repaired (heatertune targets)"),
    "exported-text": Kind(
        "blocks", "the exported program does other than what was proven",
        "export with other words or another PWM, and report it: this is a fault of heatertune"),
    "alias": Kind(
        "blocks", "the power switches faster than it was logged",
        "log the power's mean over each interval, or at every switching"),
    "closed-loop": Kind(
        "told", "the log is of a closed loop", "log one open-loop step"),
    "no-power": Kind(
        "told", "the power was not logged", "log the power, or one open-loop step"),
    "repaired": Kind(
        "told", "more than 1 % of the rows were repaired or left out", "read the log's line on what was taken"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that a verdict has to hear.

    Attributes:
        name: of its kind, one of `KINDS`.
        told: what was found in this log, one sentence with its numbers.

    Raises:
        UnknownName: no such kind.
    """

    name: str
    told: str

    def __post_init__(self) -> None:
        if self.name not in KINDS:
            raise UnknownName("finding", self.name, KINDS)

    @property
    def kind(self) -> Kind:
        """What its kind does to the verdict."""
        return KINDS[self.name]
