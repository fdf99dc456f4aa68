"""Conditions and events of a proof: which events it runs, from which state, under which conditions, and on which runs.

Conditions hold through a whole run; events happen in it, one after the other. The manual shows these tables.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from heatertune.proof.long_outage import (
    BELOW,
    BRIEF,
    HEAT_UP,
    LOADED,
    LONGER,
    LOW,
    PART,
    RISING,
    UNDER_LOAD,
    WARM,
    WINDOW,
)

__all__ = ["CONDITIONS", "EVENTS", "EXCLUDED", "MAINS_LABELS", "NOT_RUN", "Condition", "EventKind", "Exclusion"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """What holds through a whole run.

    Attributes:
        name: a few words.
        values: that it takes; every combination of all conditions is run.
    """

    name: str
    values: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EventKind:
    """An event, or events of a kind.

    Attributes:
        name: a few words.
        state: of the loop when it happens.
        sizes: lengths and sizes of it.
        phases: kinds of the phases that it begins, see `heatertune.proof.scenario.Phase`.
        runs: "all" runs, or those "nearest" to their limits: of each setting of the open points the run that uses most
            of a limit, and every heater under the hardest setting.
        finding: name of the finding if it breaks a limit in an additional run; empty: it belongs to the test sequence.
        mains: whether it runs at "every" mains voltage that is held, or only at the "nominal" one.
    """

    name: str
    state: str
    sizes: str
    phases: tuple[str, ...]
    runs: Literal["all", "nearest"] = "all"
    finding: str = ""
    mains: Literal["every", "nominal"] = "every"


@dataclass(frozen=True, slots=True, kw_only=True)
class Exclusion:
    """A combination that is not run.

    Attributes:
        event, condition: what is combined.
        reason: why it is not run.
    """

    event: str
    condition: str
    reason: str


#: mains voltages that are held through a run, as people know them
MAINS_LABELS: Final = ("mains −10 %", "nominal mains", "mains +10 %")

CONDITIONS: Final = (
    Condition(name="heater", values="every plausible heater, each with its own ambient temperature"),
    Condition(name="mains voltage", values="81, 100 and 121 % of the power (EN 50160)"),
    Condition(name="open points", values="every setting of what the manual leaves open"),
    Condition(name="reading", values="the input module's steps and delay; 59 draws of noise on the nearest run"),
)

_REST = "at rest at the highest setpoint"
_OPEN = "open circuit"

EVENTS: Final = (
    EventKind(name="heat-up", state="cold", sizes="to the highest setpoint", phases=("heat-up",)),
    EventKind(name="heat-up to a lower setpoint", state="cold", sizes="to the lowest of a stated range, and above",
              phases=("restart",), runs="nearest", finding=HEAT_UP),
    EventKind(name="cold goods", state=_REST, sizes="30 % of the rise above ambient, at once", phases=("recovery",)),
    EventKind(name="load", state=_REST, sizes="10 % of full power is taken away, and given back", phases=("recovery",)),
    EventKind(name=_OPEN, state=_REST, phases=("off", "reheat"),
              sizes="for 2 TN, for 10 TN and until the heater is cold, and to just before a boost"),
    EventKind(name="longer open circuit", state=_REST, sizes="four times the longest", phases=("off", "reheat"),
              runs="nearest", finding=LONGER),
    EventKind(name="shorter open circuit", state=_REST, sizes="12 to 96 lengths around the one that integrates most",
              phases=("off", "reheat"), runs="nearest", finding=BRIEF),
    EventKind(name="open circuit or restart under a load", state="at rest under the load",
              sizes="as above, and 12 to 96 times without supply", phases=("off", "reheat", "restart"),
              runs="nearest", finding=UNDER_LOAD),
    EventKind(name="the same with a boost", state="at rest under the load", sizes="as above; it has to come to rest",
              phases=("off", "reheat", "restart"), runs="nearest", finding=LOADED),
    EventKind(name="the same with a firmware's window", state="at rest under the load",
              sizes="as above", phases=("off", "reheat", "restart"), runs="nearest", finding=WINDOW),
    EventKind(name="outages, loads, cold goods in a range",
              state="at rest at a lower setpoint, also under the load", sizes="as above; restarts too",
              phases=("off", "reheat", "restart", "recovery"), runs="nearest", finding=LOW),
    EventKind(name="the same below a stated setpoint", state="at rest, a fifth of the rise lower",
              sizes="as above; told, it blocks nothing", phases=("off", "reheat", "restart", "recovery"),
              runs="nearest", finding=BELOW),
    EventKind(name="setpoint falls and rises during an open circuit", state=_OPEN,
              sizes="it rises as the reading arrives at the lower one", phases=("off", "reheat"), runs="nearest",
              finding=RISING),
    EventKind(name="setpoint change", state=_REST, sizes="to the lowest setpoint and back", phases=("change", "off")),
    EventKind(name="setpoint change by less", state=_REST, sizes="9 to 96 sizes, also the largest without a boost",
              phases=("change",), runs="nearest", finding=PART),
    EventKind(name="small setpoint change", state=_REST, sizes="5 and 10 % of the rise, or two and four tolerances",
              phases=("small-change",)),
    EventKind(name="mains step", state=_REST, sizes="−10 %, +10 % and back", phases=("recovery",), mains="nominal"),
    EventKind(name="controller restart", state=_REST, sizes="after a moment, and with the heater cold",
              phases=("off", "restart")),
    EventKind(name="controller restart, heater warm", state=_REST, sizes="12 to 96 times without supply in between",
              phases=("off", "restart"), runs="nearest", finding=WARM),
    EventKind(name="profile", state="cold", sizes="its ramps and soaks, where one is given", phases=("ramp", "soak")),
)

EXCLUDED: Final = (
    Exclusion(event="mains step", condition="mains −10 % or +10 %",
              reason="the voltage is at an end of its range already: another step leaves EN 50160"),
    Exclusion(event="all", condition="mains −10 %, heater that needs more than 95 % of that power",
              reason="it cannot hold the setpoint with a reserve; the verdict lists it as not tested"),
    Exclusion(event="load", condition="heater with less than 15 % of power left over",
              reason="the load is reduced to what leaves 5 %"),
    Exclusion(event="cold goods", condition="cold heater", reason="nothing in the room is colder than the heater"),
    Exclusion(event="small setpoint change", condition="range narrower than the change",
              reason="the setpoint would leave its range"),
    Exclusion(event="controller restart", condition=_OPEN, reason="without supply the circuit is open anyway"),
)

#: what happens in a plant, and no run shows
NOT_RUN: Final = (
    "manual mode and back, which the controller's own program decides",
    "sensor break and return, for which the exported supervision is tested",
    "a second event before the loop is at rest, except without power, a setpoint rise right after it, and a profile",
)
