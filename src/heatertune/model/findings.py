"""What a fit found that a verdict has to hear: each kind declared once, with what it does to the verdict."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from heatertune.errors import UnknownName

__all__ = ["KINDS", "Finding", "FindingKind", "remedy_of"]

Effect = Literal["blocks", "widens", "told"]


class FindingKind(NamedTuple):
    """A kind of finding.

    Attributes:
        effect: "blocks": the verdict is NOT PROVEN until the user accepts it by name; "widens": more possible heaters
            are designed for and proven on; "told": it stands on the verdict's line.
        short: what was found, for the verdict's line.
        remedy: what closes it.
        by_case: whether the sentence of a finding, which has this log's numbers, stands in place of the short form.
    """

    effect: Effect
    short: str
    remedy: str
    by_case: bool = False


#: name → kind; the manual's table and --accept's choices are made of this
KINDS: Final[dict[str, FindingKind]] = {
    "poor-fit": FindingKind(
        "blocks", "no model explains the log well", "log the power, and keep doors and fans still"),
    "dead-time-open": FindingKind(
        "blocks", "the log does not bound the dead time",
        "log one step of the power at a shorter interval (heatertune plan), or bound it with --dead-time-at-most"),
    "faster-than-log": FindingKind(
        "blocks", "the heater answers faster than the log's interval shows", "log at a shorter interval"),
    "not-foretold": FindingKind(
        "blocks", "readings left out of the fit are not foretold", "log one open-loop step until it rests"),
    "follows-power": FindingKind(
        "told", "what the model leaves over still follows the power", "log one open-loop step until it rests"),
    "unexplained-by-power": FindingKind(
        "blocks", "the power does not explain the temperature",
        "log steps of the power from rest, each until it rests, and keep doors, fans and other heaters still "
        "(heatertune plan)"),
    "halves-disagree": FindingKind(
        "widens", "the halves of the log give different heaters", "log one open-loop step until it rests"),
    "logs-disagree": FindingKind(
        "widens", "the logs give different heaters", "log them under the conditions of use"),
    "contradicted": FindingKind(
        "blocks", "what the curve shows by itself contradicts every model", "log the power, or one open-loop step"),
    "not-regulated": FindingKind(
        "blocks", "the log looks like a heat-up in open loop, and its power is not in it",
        "add the power as a column: full power in % while the heater was on, else 0"),
    "two-level": FindingKind(
        "blocks", "the log looks like two-level control, and its power is not in it",
        "add the power as a column: full power in % while the heater was on, else 0"),
    "on-bound": FindingKind(
        "blocks", "a parameter of the fit lies on a bound of its search",
        "log the power as well, or one open-loop step and its power"),
    "one-level": FindingKind(
        "told", "the log knows one level of power, so that the heater is linear is assumed",
        "log steps to two levels of power around the one of use"),
    "nonlinear": FindingKind(
        "widens", "the gain depends on the power or on the level", "log steps around the setpoint of use"),
    "setpoint-unreached": FindingKind(
        "blocks", "not every possible heater can hold the setpoint", "log nearer to the setpoint, or lower it"),
    "beyond-the-log": FindingKind(
        "blocks", "a setpoint lies beyond what was logged",
        "log up to the setpoint (heatertune plan MODEL --limit-temperature), or take one that the log covers "
        "(--setpoint)", by_case=True),
    "coarse-sensor": FindingKind(
        "blocks", "the sensor is too coarse for the tolerance asked for",
        "take a narrower sensor range (--range) or a finer input module, or ask for less (--tolerance)"),
    "winds-up": FindingKind(
        "blocks", "it winds up the more, the longer the heater's circuit is open",
        "find out what your controller does at its limit (--switch), or keep it in manual while the circuit is open"),
    "briefly-open": FindingKind(
        "blocks", "it overshoots by more than its limit after a shorter open circuit than the story's",
        "allow what it does then (--limit reheat-overshoot), or find out what your controller does at its limit "
        "(--switch), or keep it in manual while the circuit is open"),
    "low-outage": FindingKind(
        "blocks", "it overshoots by more than its limit after an open circuit at a lower setpoint of use",
        "state a smaller range (--setpoint), allow that overshoot (--limit reheat-overshoot), or keep it in manual "
        "while the circuit is open"),
    "low-heat-up": FindingKind(
        "blocks", "it overshoots by more than its limit on a heat-up from cold to a lower setpoint of use",
        "state a smaller range (--setpoint), or allow that overshoot (--limit overshoot)"),
    "warm-restart": FindingKind(
        "blocks", "it overshoots by more than its limit where the PLC is restarted while the heater is warm",
        "allow what it does then (--limit overshoot), or let the heater cool down before it is switched on"),
    "part-change": FindingKind(
        "blocks", "it overshoots by more than its limit where the setpoint changes by a part of its range of use",
        "allow what it does then (--limit overshoot), or say a smaller range (--setpoint)"),
    "stays-at-limit": FindingKind(
        "blocks", "it may stay at full power where the setpoint rises while the heater warms up",
        "find out what your controller does at its limit (--switch), leave out D (--structure pi), or let the heater "
        "settle before the setpoint rises"),
    "known-faults": FindingKind(
        "blocks", "the program is known to be wrong where no run of a proof leads",
        "take the same program repaired (heatertune targets)"),
    "exported-text": FindingKind(
        "blocks", "the exported program does other than what was proven",
        "export with other words or another PWM, and report it: this is a fault of heatertune"),
    "alias": FindingKind(
        "blocks", "the power switches faster than it was logged",
        "log the power's mean over each interval, or at every switching"),
    "unit-assumed": FindingKind(
        "blocks", "a unit is assumed for which the log holds no evidence",
        "check and state it (--time-unit, --temperature-unit, --power-full-scale; heatertune read shows which)"),
    "closed-loop": FindingKind(
        "told", "the log is of a closed loop", "log one open-loop step"),
    "no-power": FindingKind(
        "told", "the power was not logged", "log the power, or one open-loop step"),
    "repaired": FindingKind(
        "told", "more than 1 % of the rows were repaired or left out", "read the log's line on what was taken"),
}


_LONGER: Final = ("log steps of the power up and down (heatertune plan), each until the temperature rests, with doors "
                  "and fans still")
#: kind → what closes it where the power was logged already
_OF_POWER_LOGS: Final = {
    "poor-fit": "keep doors and fans still while you log, and log each change of the power at its own instant",
    "contradicted": "log one open-loop step of the power",
    "on-bound": "log one step of the power in open loop until the temperature rests",
}
#: kind → what closes it where the log is of open-loop steps of the power already
_OF_OPEN_LOOP_LOGS: Final = _OF_POWER_LOGS | dict.fromkeys(
    ("not-foretold", "follows-power", "halves-disagree", "contradicted", "on-bound"), _LONGER)


def remedy_of(name: str, names: Collection[str]) -> str:
    """Return what closes a finding, other than what its log is already.

    Args:
        name: of the finding.
        names: of all findings of the same fit: "no-power" and "closed-loop" tell what kind of log it was.

    Raises:
        UnknownName: no such finding.
    """
    if name not in KINDS:
        raise UnknownName("finding", name, KINDS)
    if "no-power" in names:
        return KINDS[name].remedy
    known = _OF_POWER_LOGS if "closed-loop" in names else _OF_OPEN_LOOP_LOGS
    return known.get(name, KINDS[name].remedy)


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
    def kind(self) -> FindingKind:
        """What its kind does to the verdict."""
        return KINDS[self.name]
