"""PASS, FAIL or NOT PROVEN: what the runs show, and what the fit found that no run can show.

Also which runs a proof makes, what they are held against, and an interlock between controller and heater: a second
program that may open the heater's circuit. The bit processor's heater program (E. Hryniewicz, M. Chmiel, Przegląd
Elektrotechniczny 88(9a), 2012, below figure 9) runs every 10 ms. Its output H is a contact in series with the switch
that the controller drives. Its buttons A (fan) and B (heater) are pressed during the first scan and never again; see
plc/on_off/DIFFERENCES.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np

from heatertune.arrays import Array
from heatertune.codec import Document, construct_from, decode, encode
from heatertune.errors import DocumentError, InputError, UnknownName
from heatertune.model.findings import KINDS, Finding, remedy_of
from heatertune.model.model_values import HeaterModel
from heatertune.model.statistics import share_bounds
from heatertune.options import options_of
from heatertune.pid.design_values import Margins, PidDesign
from heatertune.plc.cpu.one_bit.machine import HEATER, HEATER_NAMES, START, OneBitState, Wiring, assemble, scan
from heatertune.plc.open_points import OpenPoint, settings_to_prove
from heatertune.plc.pwm import INSTANT_S
from heatertune.plc.targets import GROUPS
from heatertune.processors import ProgressCallback
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.heaters import ROOM_DEGC, Supply
from heatertune.proof.profile import Profile
from heatertune.proof.ripple_and_wear import life
from heatertune.proof.specification import GENERAL, NOTHING, Specification, relaxed_limits
from heatertune.settings import Conditions
from heatertune.units import check, count

__all__ = [
    "ASSUMED", "BREAKS_NONE", "FIRST", "INTERLOCKS", "NOTHING_PASSES", "NOT_PROVEN", "PROOF_SCHEMA", "WIDER",
    "Acceptance", "Coverage", "FitDiagnostics", "FitDiagnosticsView", "Interlock", "Run", "blocking_findings",
    "closing_text", "combined_verdict", "demand_none", "derived_verdict", "extent", "notes_by_kind",
    "relaxed_clause", "relaxed_of", "sample_lines", "samples_text", "switching_lines", "verdict_brief",
    "verdict_details", "verdict_first", "verdict_line", "verdict_notes", "verdict_of_samples", "wear_text",
]


#: of a proof's document; those of the first did not hear the fit, of the second not what goes wrong in use
PROOF_SCHEMA: Final = "heatertune/proof/4"

NOT_PROVEN: Final = "NOT PROVEN"

#: begins the remark about a request whose design keeps every limit and is not proven all the same
BREAKS_NONE: Final = "would break no limit, yet be not proven, at"

#: begins the remark of a search that found nothing that passes
NOTHING_PASSES: Final = "nothing that was tried"

#: begins what a remark tells of the limits that it suggests
WIDER: Final = "a wider limit: "

#: what a user may know beside the log → how a certificate says it
ASSUMED: Final = {
    "dead_time_at_most_s": "dead time at most {:g} s", "sensor_delay_s": "sensor delay of {:g} s",
    "log_pwm_period_s": "PWM period of {:g} s in the log",
}

#: how many samples to ask for
_MORE: Final = [number * 10**size for size in range(2, 7) for number in (1, 2, 5)]

#: reasons that a short sentence names
_NAMED: Final = 3

#: what is asked of a proof first
FIRST: Final = ("verdict", "relaxed_limits", "target", "setpoint_degC", "specification", "words", "criteria")


@dataclass(frozen=True, slots=True, kw_only=True)
class FitDiagnosticsView:
    """A finding of the fit, and whether the user accepted it."""

    name: Literal[tuple(KINDS)]  # type: ignore[valid-type]  # the kinds are declared once
    effect: str
    message: str
    accepted: bool

    def __post_init__(self) -> None:
        effect = KINDS[self.name].effect
        if self.effect != effect:
            raise DocumentError(f"effect: {self.effect!r}; a finding {self.name} {effect}")
        if self.accepted and effect != "blocks":
            raise DocumentError(f"accepted: a finding {self.name} blocks nothing")


@dataclass(frozen=True, slots=True, kw_only=True)
class FitDiagnostics:
    """What a verdict hears beside its runs.

    Attributes:
        findings: of the fit.
        accepted: names of findings that the user accepts; they block nothing.
        assumed: what the user knows beside the log, name with unit → value.
        remarks: what else stands on the verdict's line.
        not_tested: what no part of the runs shows, a few words each.

    Raises:
        UnknownName: no finding of this name blocks a verdict.
    """

    findings: tuple[Finding, ...] = ()
    accepted: tuple[str, ...] = ()
    assumed: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    not_tested: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        blocks = [name for name, kind in KINDS.items() if kind.effect == "blocks"]
        for name in self.accepted:
            if name not in blocks:
                raise UnknownName("finding to accept", name, blocks)

    def led_by(self, remark: str) -> FitDiagnostics:
        """Return these with the result of a search before all other remarks: a screen leaves out the last ones."""
        return replace(self, remarks=(remark, *self.remarks))

    @property
    def blocking(self) -> tuple[str, ...]:
        """Names of the findings that leave the words unproven."""
        return tuple(finding.name for finding in self.findings
                     if finding.kind.effect == "blocks" and finding.name not in self.accepted)

    @property
    def views(self) -> tuple[FitDiagnosticsView, ...]:
        """What is written of the findings."""
        return tuple(construct_from(FitDiagnosticsView, finding, effect=finding.kind.effect,
                                    accepted=finding.name in self.accepted)
                     for finding in self.findings)

    def to_document(self) -> dict[str, Any]:
        """Return "findings", "assumed", "remarks" and "not_tested" of a proof's document."""
        return {"findings": encode(self.views), "assumed": dict(self.assumed), "remarks": list(self.remarks),
                "not_tested": list(self.not_tested)}


def combined_verdict(verdicts: Iterable[str]) -> str:
    """Return the one verdict of several: the worst.

    Raises:
        InputError: there is none, or something else than a verdict.
    """
    values = set(verdicts)
    if not values:
        raise InputError("a verdict needs at least one run")
    if others := sorted(map(repr, values - {"PASS", NOT_PROVEN, "FAIL"})):
        raise InputError(f"verdict: expected PASS, {NOT_PROVEN} or FAIL, got {', '.join(others)}")
    return "FAIL" if "FAIL" in values else NOT_PROVEN if NOT_PROVEN in values else "PASS"


def verdict_of_samples(count: int, quantile: float, passing_counts: Sequence[int]) -> str:
    """Return whether so many samples show, with 95 % confidence, that enough of all such heaters keep every limit.

    "PASS" where they show that enough do under each setting, "FAIL" where that too few do under one of them, and
    "NOT PROVEN" where they are too few to show either.

    Args:
        count: samples, each run under every setting of what the manual leaves open.
        quantile: share of all such heaters that must.
        passing_counts: how many samples keep every limit, under each setting.
    """
    if not passing_counts:
        return NOT_PROVEN
    least, most = share_bounds(min(passing_counts), count)
    return "PASS" if least >= quantile else "FAIL" if most < quantile else NOT_PROVEN


def blocking_findings(proof: Document) -> list[Mapping[str, Any]]:
    """Return the findings in a proof's document that leave it unproven, by what their names mean."""
    return [finding for finding in proof["findings"]
            if KINDS[finding["name"]].effect == "blocks" and not finding["accepted"]]


def verdict_line(proof: Document) -> str:
    """Return the verdict of a proof's document as one line: where, on how many heaters, why not, and what is told."""
    parts = [_head(proof)]
    parts += [f"not kept: {', '.join(broken)}"] if (broken := _broken(proof)) else []
    return "; ".join([*parts, *verdict_details(proof)])


def verdict_brief(proof: Document) -> str:
    """Return the same in one short sentence: the reasons by name, at most three of them."""
    reasons = [*_broken(proof), *(f"open: {finding['name'].replace('-', ' ')}" for finding in blocking_findings(proof))]
    more = [f"{len(reasons) - _NAMED} more"] if len(reasons) > _NAMED else []
    return f"{_head(proof)}{': ' if reasons else ''}{', '.join([*reasons[:_NAMED], *more])}"


def verdict_details(proof: Document) -> list[str]:
    """Return what a proof's document leaves open, each with what closes it, and the conditions it holds under."""
    blocking = [closing_text(finding, proof, f" ({finding['name']}): ") for finding in blocking_findings(proof)]
    return [*sample_lines(proof), *blocking, *verdict_notes(proof), *switching_lines(proof)]


def _head(proof: Document) -> str:
    relaxed = relaxed_clause(proof)
    return f"{proof['verdict']} {f'{relaxed}, ' if relaxed else ''}{extent(proof)}"


def closing_text(finding: Document, proof: Document, between: str = "; ") -> str:
    """Return what a finding of a proof's document leaves open and what closes it; `between`: the two."""
    name, kind = finding["name"], KINDS[finding["name"]]
    cause = finding["message"].rstrip(".") if kind.by_case else kind.short
    remedy = remedy_of(name, [entry["name"] for entry in proof["findings"]])
    return f"{cause}{between}{remedy}, or --accept {name}"


def relaxed_clause(proof: Document) -> str:
    """Return which limits a proof's document kept are wider than their defaults; "" where none is, or it fails.

    It stands directly after the verdict: "against relaxed limits: overshoot 30 % (default 20 %)".
    """
    relaxed = () if proof["verdict"] == "FAIL" else relaxed_of(proof)
    return f"against relaxed limits: {', '.join(relaxed)}" if relaxed else ""


def relaxed_of(proof: Document) -> tuple[str, ...]:
    """Return the limits of a proof's document that are wider than their defaults, see `relaxed_limits`."""
    if proof.get("specification") is None:
        return ()
    return relaxed_limits(decode(Specification, proof["specification"], PROOF_SCHEMA), _rise_degC(proof))


def _rise_degC(proof: Document) -> float:
    """Return the setpoint step of a proof's heat-up: by its overshoot in both units, else from the ambient [°C]."""
    pct, degC = (proof["criteria"].get(name, {}) for name in ("overshoot", "overshoot_degC"))
    if pct.get("value") and degC.get("value") and pct.get("where") == degC.get("where"):
        return abs(100.0 * float(degC["value"]) / float(pct["value"]))
    ambient = proof["scenario"].get("ambient_degC")
    return abs(float(proof["scenario"]["setpoint_degC"]) - (ROOM_DEGC if ambient is None else float(ambient)))


def sample_lines(proof: Document) -> list[str]:
    """Return what the samples of a proof's document show, a few words; nothing where there are none."""
    return [] if (drawn := proof.get("samples")) is None else [samples_text(drawn)]


def samples_text(drawn: Document) -> str:
    """Return how many samples keep every limit, under which setting the fewest do, and what that shows."""
    number, quantile, counts = drawn["count"], drawn["quantile"], [row["passing_count"] for row in drawn["settings"]]
    share, must = f"{min(counts)} of {number} samples keep every limit{_under(drawn['settings'])}", 100.0 * quantile
    if (verdict := verdict_of_samples(number, quantile, counts)) != NOT_PROVEN:
        least, most = share_bounds(min(counts), number)
        shows = (f"least {math.floor(1e4 * least) / 100.0:.4g}" if verdict == "PASS" else
                 f"most {math.ceil(1e4 * most) / 100.0:.4g}")
        return f"{share}, so at {shows} % of all do (95 % confidence), {must:.4g} % must"
    more = next((more for more in _MORE if more > number and verdict_of_samples(
        more, quantile, [round(more * min(counts) / number)]) != NOT_PROVEN), None)
    return f"{share}, too few to decide whether {must:.4g} % of all do" + (
        f": --samples {more}" if more else "; at this share, more samples would not decide it either")


def derived_verdict(proof: Document) -> str:
    """Return the verdict that follows from a proof's values; what the document calls it is not asked."""
    verdicts = ["FAIL" if _broken(proof) else "PASS", *([NOT_PROVEN] if blocking_findings(proof) else [])]
    if (drawn := proof.get("samples")) is not None:
        counts = [setting["passing_count"] for setting in drawn["settings"]]
        verdicts.append(verdict_of_samples(drawn["count"], drawn["quantile"], counts))
    return combined_verdict(verdicts)


def _under(settings: Sequence[Document]) -> str:
    """Return under which setting of what the manual leaves open the fewest samples pass, where not all do alike.

    Of it what is other than assumed, which is the first one's.
    """
    least = min(settings, key=lambda entry: entry["passing_count"])
    if all(one["passing_count"] == least["passing_count"] for one in settings):
        return " under every setting" if len(settings) > 1 else ""
    assumed = settings[0]["switches"]
    other = [f"{name} = {setting}" for name, setting in least["switches"].items() if setting != assumed[name]]
    return f" under {', '.join(other) or 'the settings assumed'}"


def extent(proof: Document) -> str:
    """Return where and on what a proof's document was made: "at 50 °C in 45 runs on 9 plausible heaters"."""
    heaters = {run["model"] for run in proof["runs"]}
    return (f"at {proof['scenario']['setpoint_degC']:g} °C in {count(len(proof['runs']), 'run')} on "
            f"{count(len(heaters), 'plausible heater')}")


def _broken(proof: Document) -> Sequence[str]:
    return [name.replace("_", " ") for name, criterion in proof["criteria"].items() if not criterion["ok"]]


def verdict_notes(proof: Document) -> list[str]:
    """Return what is told, widened, accepted and assumed in a proof's document, a few words each."""
    notes = notes_by_kind(proof)
    untested = [f"not tested: {', '.join(notes['not tested'])}"] if notes["not tested"] else []
    return [*notes["asked"], *notes["assumed"], *notes["not known"], *notes["changed"], *untested]


def notes_by_kind(proof: Document) -> dict[str, list[str]]:
    """Return the same by what it is: "not known", "not tested", "assumed", "asked" or "changed"."""
    findings = [(KINDS[finding["name"]], finding["accepted"]) for finding in proof["findings"]]
    others = [kind.short for kind, _ in findings if kind.effect != "blocks" and not kind.is_assumption]
    accepted = [f"accepted: {kind.short}" for kind, accepts in findings if accepts]
    assumed = [f"assumed: {ASSUMED[name].format(value)}" for name, value in proof["assumed"].items()]
    assumed += dict.fromkeys(f"assumed: {kind.short}" for kind, _ in findings if kind.is_assumption)
    return {
        "not known": list(dict.fromkeys(others)), "not tested": list(proof["not_tested"]),
        "assumed": [*assumed, *accepted],
        "asked": [] if (spec := proof.get("specification")) is None else _of_spec(spec),
        "changed": list(proof["remarks"])}


def switching_lines(proof: Document) -> list[str]:
    """Return how often the heater is switched, and what that means for what switches it."""
    if (often := proof["criteria"].get("switchings")) is None:
        return []
    per_hour = math.inf if often["value"] is None else often["value"]
    return [f"{per_hour:.0f} switchings/h ({wear_text(proof.get('target', ''), per_hour)})"]


def wear_text(target: str, per_hour: float) -> str:
    """Return how long a switch lasts that is usual behind a controller; a printer's is a transistor."""
    if target in GROUPS["printer"]:
        return "a MOSFET does not wear"
    kind = "relay" if target in GROUPS["maker"] else "contactor"
    return f"a {kind} lasts {life(kind, per_hour)}"


def verdict_first(proof: Document) -> dict[str, Any]:
    """Return a proof's document with what is asked of it first."""
    parts = {**proof, "setpoint_degC": proof["scenario"]["setpoint_degC"], "relaxed_limits": list(relaxed_of(proof))}
    return {name: parts[name] for name in FIRST} | {name: part for name, part in parts.items() if name not in FIRST}


def _of_spec(spec: Document) -> list[str]:
    """Return which specification was kept or broken, where it is not the general one as it is."""
    led = spec.get("profile")
    along = "" if led is None else (
        f"along the profile {decode(Profile, led, PROOF_SCHEMA).label}, which your own program has to run")
    own = ", ".join(f"{name} {' and '.join(spec['limits'][name]) or NOTHING}" for name in spec["changed"])
    preset = "" if spec["name"] == GENERAL else f"specification {spec['name']}"
    return [part for part in (preset, f"own limits: {own}" if own else "", along) if part]


#: names on the command line
INTERLOCKS: Final = tuple(options_of(Conditions)["interlock"].choices)

_SCAN_S: Final = 0.01

_BITS: Final = HEATER_NAMES.bits
_PROGRAM: Final = assemble(HEATER, HEATER_NAMES, operand_bits=5)
_WIRING: Final = Wiring(inputs=frozenset(_BITS[name] for name in "ABCDR"))

_BLOCK: Final = 100_000  # instants looked at in one go


def demand_none(name: str | None) -> None:
    """Refuse an interlock for samples, which are run without one.

    Raises:
        InputError: there is one.
    """
    if name is not None:
        raise InputError("samples are run without an interlock: leave out --interlock, or --samples and --replay")


@dataclass(frozen=True, slots=True, kw_only=True)
class Interlock:
    """The program that watches the heater.

    Attributes:
        name: one of `INTERLOCKS`.
        limit_degC: temperature from which on its limit sensor reads 1 [°C]; the sensor has neither noise nor delay.
        fan_stops_s: instant from which on the fan does not turn, whatever it is told [s]; None: it never fails.

    Raises:
        UnknownName: no such interlock.
        OutOfRange: a temperature or time without meaning.
    """

    name: str
    limit_degC: float
    fan_stops_s: float | None = None

    def __post_init__(self) -> None:
        if self.name not in INTERLOCKS:
            raise UnknownName("interlock", self.name, INTERLOCKS)
        check("limit_degC", self.limit_degC, least=-273.15)
        if self.fan_stops_s is not None:
            check("fan_stops_s", self.fan_stops_s, least=0.0)

    def opens_s(self, temperature_at: Callable[[Array], Array], end_s: float, cold_until_s: float = 0.0) -> float:
        """Return the instant at which the contact opens [s], infinite where it does not.

        The program rests between changes of its inputs, so it is run only at the scans that see one.

        Args:
            temperature_at: instants [s] → temperatures [°C] of a run whose contact stays closed, both of shape (n,).
            end_s: of that run [s].
            cold_until_s: up to then it is known to be colder than the limit [s].
        """
        stops = None if self.fan_stops_s is None else math.ceil(self.fan_stops_s / _SCAN_S - INSTANT_S)
        changes = {0, 1, self._first_hot(temperature_at, end_s, cold_until_s), stops}
        state = START
        for k in sorted(k for k in changes if k is not None and k * _SCAN_S <= end_s):
            hot = float(temperature_at(np.array([k * _SCAN_S]))[0]) >= self.limit_degC
            state = _scan(state, pressed=k == 0, hot=hot, turns=stops is None or k < stops)
            if not state.is_on(_BITS["H"]):
                return k * _SCAN_S
        return math.inf

    def _first_hot(self, temperature_at: Callable[[Array], Array], end_s: float, cold_until_s: float) -> int | None:
        """Return the first scan after the buttons' at which the limit sensor reads 1."""
        last = math.floor(end_s / _SCAN_S)
        for begin in range(1 + math.floor(min(cold_until_s, end_s) / _SCAN_S), last + 1, _BLOCK):
            scans = np.arange(begin, min(begin + _BLOCK, last + 1), dtype=np.float64)
            hot = np.flatnonzero(temperature_at(scans * _SCAN_S) >= self.limit_degC)
            if len(hot):
                return begin + int(hot[0])
        return None


def _scan(state: OneBitState, *, pressed: bool, hot: bool, turns: bool) -> OneBitState:
    signals = {"A": pressed, "B": pressed, "C": hot, "D": turns, "R": False}
    return scan(_PROGRAM, _WIRING, state, on=frozenset(_BITS[name] for name, value in signals.items() if value))


#: label of a model, setting of each switch, full power as a share of the rated one (None: the rated power)
Run = tuple[str, Mapping[str, str], float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Which runs a proof makes: every model under every setting the manual leaves open, or fewer for a quick look.

    Attributes:
        known: switch → setting of what is known of this very controller, the manual leaving it open.
        open_points: False: only the default settings of the controller's switches, for a quick comparison.
        only: these runs, by the controller's direct form alone; None: every model under every setting at each power.
        night: with `only`: the heat-up and one of `heatertune.proof.long_outage` alone, by its name, if the words have
            it.
        night_times: how many times as long as in a proof the longest open circuit of that night lasts.
        draws: False: no more than one draw of the noise; see `heatertune.proof.proof`.
        progress: called with how many runs are done, as "18 of 54 runs".
        supplies: other mains voltages, each with the heaters that run at it; none: the rated power alone.
    """

    stated_settings: Mapping[str, str] = field(default_factory=dict)
    open_points: bool = True
    only: Sequence[Run] | None = None
    night: str | None = None
    night_times: float = 1.0
    draws: bool = True
    progress: ProgressCallback = str
    supplies: Sequence[Supply] = ()

    @property
    def whole(self) -> bool:
        """Whether every model runs under every setting."""
        return self.open_points and self.only is None

    def settings(self, switches: Sequence[OpenPoint]) -> list[dict[str, str]]:
        """Return the settings under which words are run, the defaults (and what is known) first.

        Raises:
            UnknownName: what is known is no switch or setting.
        """
        return settings_to_prove(switches, self.stated_settings)[: None if self.open_points else 1]

    def runs(self, model: str, settings: Mapping[str, str], mains_power: float | None = None) -> bool:
        """Return whether a model, by its label, is run under these settings at a power, see `Run`."""
        return self.only is None or (model, settings, mains_power) in self.only

    def runs_any(self, mains_power: float | None) -> bool:
        """Return whether there is a run at a power, see `Run`."""
        return self.only is None or any(power == mains_power for *_, power in self.only)

    def in_question(self, switches: Sequence[OpenPoint]) -> list[OpenPoint]:
        """Return the switches that are run in several settings, or that no run can show though nobody knows them.

        None where only some runs are made, of which nothing is told.
        """
        if self.only is not None:
            return []
        return [switch for switch in switches
                if not switch.in_manual or (self.whole and switch.name not in self.stated_settings)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceptance:
    """What a proof's verdict rests on beside its runs.

    Attributes:
        limits: that every run must keep.
        specification: behind the limits, in its user's words; None: the limits were given as they are.
        margins_of: margins of a design on a heater; None: margins are not judged.
        reading_step_degC: step or noise of a reading on the heater, where that is more than the controller's own [°C].
        heard: what the fit found and the user knows.
    """

    limits: LoopLimits = field(default_factory=LoopLimits)
    specification: Specification | None = None
    margins_of: Callable[[HeaterModel, PidDesign], Margins] | None = None
    reading_step_degC: float = 0.0
    diagnostics: FitDiagnostics = field(default_factory=FitDiagnostics)

    def margins(self, designs: Sequence[PidDesign], models: Iterable[HeaterModel]) -> dict[HeaterModel, Margins]:
        """Return the worst margins of designs on each model; none where they are not judged, or there is no design."""
        of = self.margins_of
        if of is None or not designs:
            return {}
        return {model: _worst([of(linear, design) for linear in model.linear for design in designs])
                for model in dict.fromkeys(models)}

    def step_power_pct(self, designs: Sequence[PidDesign], reading_degC: float) -> float | None:
        """Return the most power that one step of the reading moves [%]; None where there is no design.

        Args:
            designs: as the words realise them.
            reading_degC: what the controller and the scenario make of a reading's step [°C].
        """
        step = max(self.reading_step_degC, reading_degC)
        return max((design.step_power_pct_per_degC * step for design in designs), default=None)


def _worst(margins: Sequence[Margins]) -> Margins:
    """Return the least of each margin."""
    return margins[0] if len(margins) == 1 else Margins(
        ms=max(one.ms for one in margins), mt=max(one.mt for one in margins),
        gain_margin=min(one.gain_margin for one in margins),
        phase_margin_deg=min(one.phase_margin_deg for one in margins))
