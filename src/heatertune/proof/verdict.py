"""PASS, FAIL or NOT PROVEN: what the runs show, and what the fit found that no run can show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from heatertune.codec import built, encode
from heatertune.errors import DocumentError, InputError, UnknownName
from heatertune.log.cells import count
from heatertune.model.findings import KINDS, Finding
from heatertune.proof.period import life
from heatertune.proof.specification import GENERAL, NOTHING

__all__ = [
    "ASSUMED", "NOT_PROVEN", "PROOF_SCHEMA", "Heard", "HeardView", "blocking", "combined", "extent", "told_of",
    "verdict_line",
]

#: of a proof's document; those of the first did not hear the fit, of the second no specification
PROOF_SCHEMA: Final = "heatertune/proof/3"

NOT_PROVEN: Final = "NOT PROVEN"

#: what a user may know beside the log → how a certificate says it
ASSUMED: Final = {"dead_time_at_most_s": "dead time at most {:g} s", "sensor_delay_s": "sensor delay of {:g} s"}


@dataclass(frozen=True, slots=True, kw_only=True)
class HeardView:
    """A finding of the fit, and whether the user accepted it."""

    name: Literal[tuple(KINDS)]  # type: ignore[valid-type]  # the kinds are declared once
    effect: str
    told: str
    accepted: bool

    def __post_init__(self) -> None:
        effect = KINDS[self.name].effect
        if self.effect != effect:
            raise DocumentError(f"effect: {self.effect!r}; a finding {self.name} {effect}")
        if self.accepted and effect != "blocks":
            raise DocumentError(f"accepted: a finding {self.name} blocks nothing")


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """What a verdict hears beside its runs.

    Attributes:
        findings: of the fit.
        accepted: names of findings that the user accepts; they block nothing.
        assumed: what the user knows beside the log, name with unit → value.
        remarks: what else stands on the verdict's line.

    Raises:
        UnknownName: no finding of this name blocks a verdict.
    """

    findings: tuple[Finding, ...] = ()
    accepted: tuple[str, ...] = ()
    assumed: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        blocks = [name for name, kind in KINDS.items() if kind.effect == "blocks"]
        for name in self.accepted:
            if name not in blocks:
                raise UnknownName("finding to accept", name, blocks)

    @property
    def views(self) -> tuple[HeardView, ...]:
        """What is written of the findings."""
        return tuple(built(HeardView, each, effect=each.kind.effect, accepted=each.name in self.accepted)
                     for each in self.findings)

    def to_document(self) -> dict[str, Any]:
        """Return "findings", "assumed" and "remarks" of a proof's document."""
        return {"findings": encode(self.views), "assumed": dict(self.assumed), "remarks": list(self.remarks)}


def combined(verdicts: Iterable[str]) -> str:
    """Return the one verdict of several: the worst; raise InputError where there is none."""
    heard = set(verdicts)
    if not heard:
        raise InputError("a verdict needs at least one run: none proves nothing")
    return "FAIL" if "FAIL" in heard else NOT_PROVEN if NOT_PROVEN in heard else "PASS"


def blocking(proof: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the findings in a proof's document that leave it unproven, by what their names mean."""
    return [each for each in proof["findings"] if KINDS[each["name"]].effect == "blocks" and not each["accepted"]]


def verdict_line(proof: Mapping[str, Any]) -> str:
    """Return the verdict of a proof's document as one line: where, on how many heaters, why not, and what is told."""
    parts = [f"{proof['verdict']} {extent(proof)}"]
    parts += [f"not kept: {', '.join(broken)}"] if (broken := _broken(proof)) else []
    if (drawn := proof.get("samples")) is not None:
        parts.append(f"{100.0 * drawn['passing']:.3g} % of {drawn['count']} samples keep every limit")
    parts += [f"{KINDS[each['name']].short} ({each['name']}): {KINDS[each['name']].remedy}, or --accept {each['name']}"
              for each in blocking(proof)]
    return "; ".join([*parts, *told_of(proof), *_switched(proof)])


def extent(proof: Mapping[str, Any]) -> str:
    """Return where and on what a proof's document was made: "at 50 °C in 45 runs on 9 possible heaters"."""
    heaters = {run["model"] for run in proof["runs"]}
    return (f"at {proof['scenario']['setpoint_degC']:g} °C in {count(len(proof['runs']), 'run')} on "
            f"{count(len(heaters), 'possible heater')}")


def _broken(proof: Mapping[str, Any]) -> Sequence[str]:
    return [name.replace("_", " ") for name, each in proof["criteria"].items() if not each["ok"]]


def told_of(proof: Mapping[str, Any]) -> list[str]:
    """Return what is told, widened, accepted and assumed in a proof's document, a few words each."""
    under = [] if (spec := proof.get("specification")) is None else _of_spec(spec)
    told = [KINDS[each["name"]].short for each in proof["findings"]
            if KINDS[each["name"]].effect != "blocks"]
    accepted = [f"accepted: {KINDS[each['name']].short}" for each in proof["findings"] if each["accepted"]]
    assumed = [f"taken as known: {ASSUMED[name].format(value)}" for name, value in proof["assumed"].items()]
    return [*under, *assumed, *accepted, *dict.fromkeys(told), *proof["remarks"]]


def _switched(proof: Mapping[str, Any]) -> list[str]:
    """Return how often the heater is switched, and what that means for a contactor."""
    if (often := proof["criteria"].get("switchings")) is None:
        return []
    per_hour = math.inf if often["value"] is None else often["value"]
    return [f"{per_hour:.0f} switchings/h (a contactor lasts {life('contactor', per_hour)})"]


def _of_spec(spec: Mapping[str, Any]) -> list[str]:
    """Return which specification was kept or broken, where it is not the general one as it is."""
    own = ", ".join(f"{name} {' and '.join(spec['limits'][name]) or NOTHING}" for name in spec["changed"])
    preset = "" if spec["name"] == GENERAL else f"specification {spec['name']}"
    return [part for part in (preset, f"own limits: {own}" if own else "") if part]
