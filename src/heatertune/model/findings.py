"""The kinds of findings of a fit, each declared once, with its effect on the verdict."""

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
        effect: "blocks": the verdict is NOT PROVEN until the user accepts the finding by name; "widens": more
            plausible heaters are used for design and proof; "told": it only appears on the verdict line.
        short: the finding, for the verdict line.
        remedy: how to resolve it.
        by_case: whether the sentence with this log's figures replaces the short form.
        is_assumption: whether it is what a verdict assumes, not what it leaves open.
    """

    effect: Effect
    short: str
    remedy: str
    by_case: bool = False
    is_assumption: bool = False


#: name → kind; the manual's table and --accept's choices are made of this
KINDS: Final[dict[str, FindingKind]] = {
    "poor-fit": FindingKind(
        "blocks", "no model explains the log well", "log the power, with doors and fans unchanged"),
    "dead-time-open": FindingKind(
        "blocks", "the log does not bound the dead time",
        "log one step of the power at a shorter interval (heatertune plan LOG), or bound it with --dead-time-at-most"),
    "faster-than-log": FindingKind(
        "blocks", "the heater answers faster than the log's interval shows", "log at a shorter interval"),
    "not-foretold": FindingKind(
        "blocks", "readings left out of the fit are poorly "
                  "predicted", "log one open-loop step until the temperature is steady"),
    "follows-power": FindingKind(
        "told", "the residuals of the model still follow the power", "log one open-loop step until the temperature is "
                                                                      "steady"),
    "unexplained-by-power": FindingKind(
        "blocks", "the power does not explain the temperature",
        "log steps of the power from rest, each until the temperature is steady, with doors, fans and other heaters "
        "unchanged (heatertune plan LOG)"),
    "halves-disagree": FindingKind(
        "widens", "the halves of the log give different heaters", "log one open-loop step until the temperature is "
                                                                  "steady"),
    "logs-disagree": FindingKind(
        "widens", "the logs give different heaters", "log them under the conditions of use"),
    "contradicted": FindingKind(
        "blocks", "the shape of the curve contradicts every model", "log the power, or one open-loop step"),
    "not-regulated": FindingKind(
        "blocks", "the log looks like an open-loop heat-up whose power was not logged",
        "add the power as a column, or write each change of it into a file with the columns time_s,power_pct and give "
        "that as --power-log; or state at which temperature it was switched off (--thermostat ROOM OFF)"),
    "two-level": FindingKind(
        "blocks", "the log looks like two-level control whose power was not logged",
        "state that it switches full power (--thermostat LOW HIGH), or add the power as a column: full power in % "
        "while the heater was on, else 0"),
    "thermostat": FindingKind(
        "told", "a thermostat at the stated thresholds switched the heater between full power and none",
        "leave out --thermostat where the heater was switched in another way", is_assumption=True),
    "largest-power-unknown": FindingKind(
        "blocks", "the largest output of the controller is taken as full power",
        "state the largest power that the heater got in the log (--largest-power PCT), or log the power"),
    "largest-power": FindingKind(
        "told", "the heater got the stated largest power in a log without power",
        "leave out --largest-power if it is not known", is_assumption=True),
    "output-limit": FindingKind(
        "told", "the heater got the largest output that its program allows",
        "state another largest power of the log (--largest-power PCT)", is_assumption=True),
    "on-bound": FindingKind(
        "blocks", "a fitted parameter lies at a bound of its search",
        "log the power as well, or one open-loop step and its power"),
    "one-level": FindingKind(
        "told", "the log has one level of power only, so the heater is assumed to be linear",
        "log steps to two levels of power around the usual one"),
    "nonlinear": FindingKind(
        "widens", "the gain depends on the power or on the temperature", "log steps around the setpoint of use"),
    "loss-changes": FindingKind(
        "widens", "a fan or a flow multiplies the heat loss", "log with the fan or the flow as in use"),
    "cooler": FindingKind(
        "told", "the log has a cooler, which only a proof with --cooling-gain uses",
        "prove a controller that drives it (--target pid-temp --cooling-gain)"),
    "cooler-differs": FindingKind(
        "blocks", "the cooler does not act as negative power of the heater",
        "leave the cooler off in use and log the heater alone, or log steps of both (the power below 0 as well), each "
        "until the temperature is steady"),
    "cooling-gain": FindingKind(
        "blocks", "the power of the cooler is not the one that the log shows",
        "state what the log shows (--cooling-gain)"),
    "setpoint-unreached": FindingKind(
        "blocks", "not every plausible heater can hold the setpoint", "log closer to the setpoint, or lower it"),
    "beyond-the-log": FindingKind(
        "blocks", "a setpoint lies beyond the logged temperatures",
        "log up to the setpoint (heatertune plan LOG --limit-temperature °C), or two powers up to half of it, each "
        "until it rests; or choose one that the log covers (--setpoint)", by_case=True),
    "coarse-sensor": FindingKind(
        "blocks", "the sensor is too coarse for the requested tolerance",
        "use a narrower sensor range (--range) or a finer input module, or a wider tolerance (--tolerance)"),
    "winds-up": FindingKind(
        "blocks", "it winds up more the longer the heater circuit is open",
        "find out what your controller does at its limit (--assume), or keep it in manual while the circuit is open"),
    "briefly-open": FindingKind(
        "blocks", "it exceeds its overshoot limit after a shorter open circuit than that of the test sequence",
        "allow that overshoot (--limit reheat-overshoot), find out what your controller does at its limit (--assume), "
        "or keep it in manual while the circuit is open"),
    "low-outage": FindingKind(
        "blocks", "it exceeds its overshoot limit after an open circuit, a restart, a load or cold goods at a lower "
                  "setpoint of use",
        "state a smaller range (--setpoint), allow that overshoot (--limit reheat-overshoot, recovery-overshoot, or "
        "overshoot for a restart), or keep it in manual while the circuit is open"),
    "outage-under-load": FindingKind(
        "blocks", "it exceeds its overshoot limit after an open circuit or a restart while a load is held",
        "allow that overshoot (--limit reheat-overshoot, or overshoot for a restart), or keep it in manual until the "
        "load is taken away"),
    "loaded-outage": FindingKind(
        "blocks", "it does not come to rest after an open circuit or a restart while a load is held: its boost starts "
                  "again and again",
        "leave out the boost (--boost none), or keep it in manual while the circuit is open"),
    "loaded-window": FindingKind(
        "told", "an open circuit or a restart while a load is held leaves it swinging outside PID_FUNCTIONAL_RANGE",
        "build the firmware with a wider PID_FUNCTIONAL_RANGE (heatertune design tries some), or take the load away "
        "before the circuit is closed again"),
    "outage-below": FindingKind(
        "told", "an open circuit, a restart or a load below the stated setpoint overshoots more than allowed",
        "state the range of setpoints in use (--setpoint LOW HIGH), or keep it in manual while the circuit is open"),
    "low-heat-up": FindingKind(
        "blocks", "it exceeds its overshoot limit on a heat-up from cold to a lower setpoint of use",
        "state a smaller range (--setpoint), or allow that overshoot (--limit overshoot)"),
    "warm-restart": FindingKind(
        "blocks", "it exceeds its overshoot limit if the controller restarts while the heater is warm",
        "allow that overshoot (--limit overshoot), or let the heater cool down before it is switched on"),
    "part-change": FindingKind(
        "blocks", "it exceeds its overshoot limit if the setpoint changes by part of its range of use, or rises "
                  "without its boost",
        "allow that overshoot (--limit overshoot), or state the range of setpoints in use, or a smaller one "
        "(--setpoint LOW HIGH)"),
    "stays-at-limit": FindingKind(
        "blocks", "it may stay at full power if the setpoint rises while the heater warms up",
        "find out what your controller does at its limit (--assume), leave out D (--structure pi), or let the heater "
        "settle before the setpoint rises"),
    "known-faults": FindingKind(
        "blocks", "the program has known faults in states that no run reaches",
        "use the repaired version of the program (heatertune targets)"),
    "exported-text": FindingKind(
        "blocks", "the exported program behaves differently from what was proven",
        "export with other parameters or another PWM, and report it: this is a fault of heatertune"),
    "second-opinion": FindingKind(
        "blocks", "python-control or CasADi calculates something else",
        "design with other gains (--ms), and report it: this is a fault of heatertune or of that library",
        by_case=True),
    "alias": FindingKind(
        "blocks", "the power switches faster than it was logged",
        "log the mean power of each interval, or every switching"),
    "neighbours-moved": FindingKind(
        "blocks", "other heaters were moving",
        "log them together and design them as zones (heatertune design LOG --zones NAMES), or log this heater again "
        "with the others at rest", by_case=True),
    "shared-mass": FindingKind(
        "widens", "other heaters may heat its slow mass and move with it",
        "state that none does (--alone), or log all heaters together and design them as zones (heatertune design LOG "
        "--zones NAMES)"),
    "alone": FindingKind(
        "told", "no other heater heats its slow mass", "leave out --alone where one does", is_assumption=True),
    "unit-assumed": FindingKind(
        "blocks", "a unit is assumed for which the log has no evidence",
        "check and state it (--time-unit, --temperature-unit, --power-full-scale; heatertune read shows which)"),
    "unit-contradicted": FindingKind(
        "blocks", "a stated unit makes the heater one that cannot exist",
        "check the unit that you state (--time-unit, --temperature-unit, --power-full-scale), and its column",
        by_case=True),
    "begins-as-room": FindingKind(
        "told", "the temperature is in °C, as the log begins like a room in °C",
        "state it if it is not (--temperature-unit)", is_assumption=True),
    "gap-hides-power": FindingKind(
        "blocks", "a gap in the log hides what the power did",
        "use a part of the log without it (--until, --from), or log again without a gap", by_case=True),
    "one-clock": FindingKind(
        "told", "the files of the zones without dates begin at the same instant",
        "log dates, or all zones in one file", is_assumption=True),
    "shared-supply": FindingKind(
        "told", "the heaters of the zones share a supply that sags as much as in the log, where each was switched on a "
                "clock of its own",
        "feed them from a supply that holds its voltage with all heaters on, or each from its own, and log again",
        is_assumption=True),
    "closed-loop": FindingKind(
        "told", "the log is of a closed loop", "log one open-loop step"),
    "no-power": FindingKind(
        "told", "the power was not logged", "log the power, or one open-loop step"),
    "repaired": FindingKind(
        "told", "more than 1 % of the rows were repaired or left out", "check the line on how the log was read"),
}


_LONGER: Final = ("log steps of the power up and down (heatertune plan LOG), each until the temperature is steady, "
                  "with doors and fans unchanged")
#: kind → its remedy if the power is already logged
_OF_POWER_LOGS: Final = {
    "poor-fit": "keep doors and fans unchanged while you log, and log each change of the power at its own time",
    "contradicted": "log one open-loop step of the power",
    "on-bound": "log one open-loop step of the power until the temperature is steady",
}
#: kind → its remedy if the log already has open-loop steps of the power
_OF_OPEN_LOOP_LOGS: Final = _OF_POWER_LOGS | dict.fromkeys(
    ("not-foretold", "follows-power", "halves-disagree", "contradicted", "on-bound"), _LONGER)


def remedy_of(name: str, names: Collection[str]) -> str:
    """Return the remedy of a finding that is not already satisfied by its log.

    Args:
        name: of the finding.
        names: of all findings of the same fit: "no-power" and "closed-loop" give the kind of log.

    Raises:
        UnknownName: no such finding.
    """
    if name not in KINDS:
        raise UnknownName("finding", name, KINDS)
    if "no-power" in names:
        return KINDS[name].remedy
    remedies = _OF_POWER_LOGS if "closed-loop" in names else _OF_OPEN_LOOP_LOGS
    return remedies.get(name, KINDS[name].remedy)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A finding that affects the verdict.

    Attributes:
        name: of its kind, one of `KINDS`.
        message: the finding in this log, one sentence with figures.

    Raises:
        UnknownName: no such kind.
    """

    name: str
    message: str

    def __post_init__(self) -> None:
        if self.name not in KINDS:
            raise UnknownName("finding", self.name, KINDS)

    @property
    def kind(self) -> FindingKind:
        """The effect of its kind on the verdict."""
        return KINDS[self.name]
