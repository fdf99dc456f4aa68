"""The state of one user: log, heater, settings, the loop, and up to four designs side by side.

A log comes from a path, a built-in table, or a folder of `heatertune design`. Nothing here depends on a browser or a
thread. Slow work is a pure function of `heatertune.studio.loop_settings`; its result returns with the ticket of its
request, and an outdated one is stored but not shown. There is one session for all windows.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

from heatertune import chain
from heatertune.chain.documents import read_documents, with_own_clocks
from heatertune.errors import ExportRefused, HeatertuneError, InputError
from heatertune.log.cells import heaters_in
from heatertune.log.formats.printer_logs import names_of
from heatertune.log.log_values import BUILT_IN, Log
from heatertune.model.model_document import from_document
from heatertune.model.model_values import FittedModel
from heatertune.options import options_of
from heatertune.pid import design_document as pid_document
from heatertune.pid.design_document import DesignProvenance
from heatertune.pid.design_values import PidDesign
from heatertune.plc.word_selection import search_document
from heatertune.processors import ProgressCallback
from heatertune.proof import Proof
from heatertune.proof.as_left import AsLeft
from heatertune.proof.design_request import DesignResult
from heatertune.proof.repetition import demand_same_files, repeat_words
from heatertune.proof.specification import GENERAL, PRESETS
from heatertune.settings import Conditions, FitSettings
from heatertune.studio.loop_settings import CandidateWords, DesignOutcome, LoopView, StudioSettings, settings_for
from heatertune.studio.wording import SuggestedChange, mend_for

__all__ = ["MOST_PINNED", "FrontDesign", "LogSource", "PinnedDesign", "Session", "Ticket", "fit_log", "is_printer_log",
           "read_source"]


#: what a design says of the limit it was asked for
_MS: Final = re.compile(r"Ms <= (\d+(?:\.\d+)?)")
#: conditions of a proof that are settings of the page
_SHOWN: Final = ("setpoint_degC", "pwm_period_s", "tolerance_degC", "limit", "noise_degC", "switches")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogSource:
    """What a path holds: a log, settings to begin with, and the heater where it is known already.

    Attributes:
        log: that is in front.
        settings: to begin with; of a folder those of its design.
        fitted: None: it is to be fitted.
        found: the design of a folder; None: there is none, or its words and verdict are not those that it makes.
        left: what of it the page has no place for, one line; "" where there is nothing.
    """

    log: Log
    settings: StudioSettings
    fitted: FittedModel | None = None
    outcome: DesignOutcome | None = None
    as_left: str = ""


def is_printer_log(source: str) -> bool:
    """Return whether a path is the log of a printer with a heater that is read without being named."""
    path = Path(source)
    return path.is_file() and "extruder" in heaters_in(path)


def read_source(source: str) -> LogSource:
    """Return the content of a log file, a built-in table or a folder.

    Raises:
        InputError: a file that is no log, a folder without the documents of `heatertune design`, a specification that
            has changed since.
    """
    if not Path(source).is_dir():
        built_in = source.lower() in BUILT_IN
        return LogSource(log=chain.read_log(source, errata=built_in), settings=StudioSettings())
    documents = read_documents(Path(source))
    content = documents["log"]
    columns = {name: content[name] for name in ("name", "source", "time_s", "temperature_degC", "power_pct",
                                                 "setpoint_degC")} | {"cooling_pct": content.get("cooling_pct")}
    log = with_own_clocks(Log(**columns, repairs=tuple(content["repairs"]), warnings=tuple(content["warnings"])),
                          content.get("signals") or {})
    fitted, design, recipe = from_document(documents["model"]), *pid_document.parts_of(documents["pid"])
    settings = StudioSettings(target=documents["words"]["target"], structure=documents["pid"]["structure"])
    if recipe is None:
        return LogSource(log=log, settings=settings, fitted=fitted)
    outcome = _folder_design(design, fitted, recipe, source)
    words, verdict = documents["words"]["words"], documents["proof"]["verdict"]
    if dict(outcome.gains.words.values) != words or outcome.result.proof.verdict != verdict:
        return LogSource(log=log, settings=settings, fitted=fitted, as_left=(
            f"{source}: another design is shown: its {verdict} is of other words or runs than its pid.json makes"))
    lost = ", ".join(_without_place(recipe))
    return LogSource(
        log=log, settings=_as_made(settings, design, recipe), fitted=fitted, outcome=outcome,
        as_left=f"{source}: the page has no place for {lost}; moving a setting leaves that out" if lost else "")


def _folder_design(design: PidDesign, fitted: FittedModel, recipe: DesignProvenance, source: str) -> DesignOutcome:
    """Return the design of a folder as the page takes one that it found; errors as the stages."""
    demand_same_files(recipe, (), source)
    choice = repeat_words(design, fitted, recipe)
    proof = chain.prove(choice.words, fitted, recipe.conditions)
    closed = DesignResult(ideal=design, choice=choice, proof=proof, conditions=recipe.conditions, recipe=recipe,
                    notes=(": ".join(filter(None, (f"This is the design of {source}", recipe.way_on))),))
    return DesignOutcome(result=closed, gains=CandidateWords(
        design=design, words=choice.words, search=partial(search_document, choice, fitted), recipe=recipe,
        conditions=recipe.conditions, proof=proof, notes=choice.search.notes))


def _as_made(start: StudioSettings, design: PidDesign, recipe: DesignProvenance) -> StudioSettings:
    """Return the settings of a design, as far as the page has them."""
    terms, (low, high), ms = recipe.conditions, recipe.range_degC, _MS.search(design.method)
    return replace(
        start, ms=float(ms[1]) if ms else start.ms, sample_time_s=design.sample_time_s,
        pwm_period_s=terms.pwm_period_s, low_degC=low, high_degC=high,
        setpoint_degC=None if isinstance(terms.setpoint_degC, tuple) else terms.setpoint_degC, input=recipe.input,
        noise_degC=terms.noise_degC, tolerance_degC=terms.tolerance_degC, limits=terms.limit,
        assumptions=tuple(terms.switches.items()), spec=terms.spec if terms.spec in PRESETS else GENERAL)


def _without_place(recipe: DesignProvenance) -> Iterator[str]:
    """Yield the options of a design that the page does not have."""
    conditions = recipe.conditions
    placed = {*_SHOWN, *(["spec"] if conditions.spec in PRESETS else [])}
    placed -= {"setpoint_degC"} if isinstance(conditions.setpoint_degC, tuple) else set()
    yield from (one.flag for name, one in options_of(Conditions).items()
                if name not in placed and getattr(conditions, name) != one.default)


def fit_log(log: Log, progress: ProgressCallback = str, settings: FitSettings | None = None) -> FittedModel:
    """Return the heater behind a log, as `heatertune design` finds it; arguments and errors as there."""
    return chain.fit(log, settings, companions=True, progress=progress)


MOST_PINNED: Final = 4
#: what a design depends on: number of the heater, settings, and how the gains were found
Ticket = tuple[Any, ...]
_Beside = TypeVar("_Beside")

#: what is allowed beside the defaults: none of it
_ALLOWED: Final[Mapping[str, Any]] = {"tolerance_degC": None, "limits": (), "assumptions": ()}
_QUICK: Final = "quick"  # of a ticket whose design was found in haste
_KEPT: Final = 200  # looks and proofs remembered, the oldest forgotten first


@dataclass(frozen=True, slots=True, kw_only=True)
class PinnedDesign:
    """A design set aside for comparison.

    Attributes:
        name: one letter.
        look: the design and its loop.
        verdict: "PASS", "FAIL", "proving…" until it is known, "not proven" where that cannot be done.
    """

    name: str
    look: LoopView
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontDesign:
    """A proven design as it stands on the page, all of one piece: what is downloaded is made of nothing else.

    Attributes:
        log, fitted, look, proof: as they are seen.
        left: a trace of the commissioned loop beside the proof; None: none was held against it.
    """

    log: Log
    fitted: FittedModel
    look: LoopView
    proof: Proof
    as_left: AsLeft | None = None

    def export(self, *, force: bool) -> dict[str, str | bytes]:
        """Return the export files, name → content.

        Raises:
            ExportRefused: the verdict is not PASS and it is not forced.
        """
        return chain.export(self.look.gains.words, self.proof, force=force)


class Session:
    """State of one user.

    Attributes:
        log, fitted: None until there is one.
        coming: the log that is being fitted, or waits for it.
        known: beside it, as the user says.
        settings: as moved.
        look: the loop of the settings that were last looked at; None before the first.
        error: why there is no design for the settings, one line; "" where there is one.
        file_error: why the last file was not taken, or what of it, one line; "" where all was.
        fault: what went wrong inside, one line; "" where nothing did.
    """

    def __init__(self) -> None:
        self.log: Log | None = None
        self.fitted: FittedModel | None = None
        self.settings = StudioSettings()
        self.look: LoopView | None = None
        self.error = self.file_error = self.fault = ""
        self._heater = 0
        self._begun = 0
        self.coming: Log | None = None
        self.known = FitSettings()
        self._gains: dict[Ticket, CandidateWords] = {}
        self._found: dict[Ticket, DesignOutcome | None] = {}
        self._taken: set[Ticket] = set()
        self._numbers: dict[Ticket, int] = {}
        self._looks: dict[Ticket, LoopView] = {}
        self._proofs: dict[Ticket, Proof] = {}
        self._refused: dict[Ticket, str] = {}
        self._left: dict[Ticket, tuple[Proof, AsLeft]] = {}
        self._drawn: dict[Ticket, tuple[Proof, Mapping[str, Any]]] = {}
        self._pins: list[tuple[str, LoopView, Ticket]] = []
        self._before: dict[str, Any] = {}
        self._folder: tuple[str, float | None] = "", None

    def load(self, source: LogSource) -> None:
        """Begin with what a path holds; a log without its heater waits for the fit."""
        self.settings = source.settings
        ticket = self.begin(source.log)
        if source.fitted is not None:
            self.fit_done(ticket, source.fitted)
            self.file_error = source.as_left
            if source.outcome is not None:
                self.settings = source.settings
                self._folder = source.settings.target, source.settings.sample_time_s
                self._taken.add(self.key)
                self.take_design(self.key, source.outcome)

    def begin(self, log: Log, settings: FitSettings | None = None) -> int:
        """Take a new log; return the ticket of its fit. Heater and loop of the log before stay until it is done."""
        self._begun += 1
        self._folder = "", None
        self.coming, self.known = log, settings or FitSettings()
        self.file_error = self.fault = ""
        return self._begun

    def fit_done(self, ticket: int, fitted: FittedModel) -> bool:
        """Take the heater of a log; return whether it is shown: not where another log came since."""
        if ticket != self._begun:
            return False
        self._heater = ticket
        self.log, self.fitted, self.coming = self.coming, fitted, None
        reading = {} if self.log is None or self.log.taken is None else self.log.taken.reading
        self.settings = replace(settings_for(fitted, self.settings), heaters=names_of(reading))
        self.look, self.error, self._pins = None, "", []
        return True

    def fail(self, problem: Exception) -> None:
        """Show why there is no design for the settings."""
        self.error = str(problem)

    def is_coming(self, ticket: int) -> bool:
        """Return whether the log of a fit is still the newest."""
        return ticket == self._begun

    def fit_refused(self, ticket: int, problem: Exception) -> None:
        """Show why a log has no heater; it waits no longer, and what was there before stays."""
        if ticket == self._begun:
            self.coming = None
            self.refuse_file(problem)

    def refuse_file(self, problem: Exception) -> None:
        """Show why a file was not taken; log, heater and designs stay as they are."""
        self.file_error = str(problem)

    def change(self, **moved: Any) -> None:
        """Move settings; one that is refused changes nothing and shows its error."""
        self.fault = ""
        if "target" in moved:  # what its manual leaves open is its own
            moved = {"assumptions": ()} | self._folder_interval(moved["target"]) | moved
        if "sample_time_s" in moved and "target" not in moved:
            self._folder = "", None  # typed
        try:
            self.settings = replace(self.settings, **moved)
        except HeatertuneError as problem:
            self.fail(problem)
        else:
            self.show_remembered()

    def _folder_interval(self, target: str) -> dict[str, float | None]:
        """Return TA as it changes with the controller: that of an opened folder belongs to the folder's controller."""
        its, interval = self._folder
        interval_s = interval if self.settings.target == its else None
        if interval is None or self.settings.sample_time_s != interval_s:
            return {}
        return {"sample_time_s": interval if target == its else None}

    @property
    def ticket(self) -> Ticket:
        """What the design depends on: the heater, all settings, and whether it is designed, an optimum, or quick."""
        return *self.key, "designed" if self.has_design else "optimum" if self._words_key() in self._gains else _QUICK

    @property
    def key(self) -> Ticket:
        """What a search for a design depends on: the heater and all settings."""
        return self._heater, self.settings

    def gains(self) -> CandidateWords | None:
        """Return the design that was found for the settings, or an optimum that serves them; None: quick will do."""
        outcome = self._found.get(self.key) if self.has_design else None
        return self._gains.get(self._words_key()) if outcome is None else outcome.gains

    def _words_key(self, settings: StudioSettings | None = None, heater: int | None = None) -> Ticket:
        now = settings or self.settings
        inputs = (now.target, now.tune_settings, now.scaling, now.spec, now.limits, now.tolerance_degC, now.assumptions,
                  now.heaters, now.pwm_period_s)
        return self._heater if heater is None else heater, *inputs

    def is_quick(self, ticket: Ticket) -> bool:
        """Return whether a design was found in haste, for the eye alone: another one is proven in its place."""
        return bool(ticket[-1] == _QUICK)

    def optimum_done(self, ticket: Ticket, look: LoopView) -> None:
        """Take the loop of an optimum in the place of the quick design of a ticket, set aside or in front."""
        heater, settings, _ = ticket
        better = (heater, settings, "optimum")
        _keep(self._gains, self._words_key(settings, heater), look.gains)
        _keep(self._looks, better, look)
        self._pins = [(name, look, better) if its == ticket else (name, old, its) for name, old, its in self._pins]
        self.show_remembered()

    def show_remembered(self) -> bool:
        """Show the loop of the settings where it is remembered; return whether it is."""
        look = self._looks.pop(self.ticket, None)
        if look is not None:
            self._looks[self.ticket] = look  # the youngest again
            self.look, self.error = look, self._refused.get(self.ticket, "")
        return look is not None

    def look_done(self, ticket: Ticket, look: LoopView) -> bool:
        """Take a loop; return whether it is shown: not where the settings moved on."""
        _keep(self._looks, ticket, look)
        if look.gains.proof is not None:
            _keep(self._proofs, ticket, look.gains.proof)
        return ticket == self.ticket and self.show_remembered()

    def look_refused(self, ticket: Ticket, problem: Exception) -> bool:
        """Show why there is no loop where the settings are still in front; return whether they are."""
        if ticket == self.ticket:
            self.fail(problem)
        return ticket == self.ticket

    def take_design(self, key: Ticket, design: DesignOutcome | None) -> None:
        """Take what was found for settings; None: nothing."""
        _keep(self._found, key, design)
        if design is None:
            self._taken.discard(key)
        elif key == self.key and key in self._taken:
            self._serve(design)

    def take(self) -> None:
        """Put the design that was found, or will be, in front of the settings."""
        self.fault = ""
        if self._found.get(self.key) is None:
            self._found.pop(self.key, None)  # nothing was found: it is tried again
        self._taken.add(self.key)
        outcome = self._found.get(self.key)
        if outcome is not None:
            self._serve(outcome)
        self.show_remembered()

    def _serve(self, outcome: DesignOutcome) -> None:
        """Let a plain optimum that was taken serve other settings of the proof, too."""
        if not outcome.result.notes:
            _keep(self._gains, self._words_key(), replace(outcome.gains, recipe=None, conditions=None, proof=None))

    def allow(self, moved: Mapping[str, Any]) -> None:
        """Move settings as a mend offers; `take_back` knows what they were."""
        self._before = {name: getattr(self.settings, name) for name in moved if name not in _ALLOWED}
        self.change(**moved)

    def take_back(self) -> None:
        """Put the gains from before in front again, and what the settings allowed beside the defaults away."""
        self._taken.discard(self.key)
        self.change(**_ALLOWED, **self._before)
        self._before = {}

    @property
    def has_design(self) -> bool:
        """Whether a design was found for the settings and is in front."""
        return self.key in self._taken and self._found.get(self.key) is not None

    @property
    def is_searching(self) -> bool:
        """Whether a design is to be found for the settings: the user asked for it, or their words fail."""
        is_pending = self.key in self._taken or (self.verdict == "FAIL" and not self.error)
        return self.fitted is not None and is_pending and self.key not in self._found

    @property
    def is_awaited(self) -> bool:
        """Whether the user waits for it."""
        return self.is_searching and self.key in self._taken

    @property
    def suggestion(self) -> SuggestedChange | None:
        """What would pass where the words in front fail, or what it cost; None where neither is known."""
        outcome = self._found.get(self.key)
        if outcome is None or not (self.has_design or self.verdict == "FAIL"):
            return None
        mend = mend_for(outcome.result, self.settings)
        return replace(mend, button="") if self.has_design and not mend.changes else mend

    def proof_done(self, ticket: Ticket, proof: Proof) -> bool:
        """Take a full proof; return whether it is that of the design in front."""
        _keep(self._proofs, ticket, proof)
        return ticket == self.ticket

    def proof_refused(self, ticket: Ticket, problem: Exception) -> None:
        """Remember why a design cannot be proven, and show it where it is the one in front."""
        self._refused[ticket] = str(problem)
        if ticket == self.ticket:
            self.fail(problem)

    @property
    def front(self) -> LoopView | None:
        """The loop that is seen, where it is that of the very settings in front; else None."""
        return self.look if not self.error and self.look is self._looks.get(self.ticket) else None

    @property
    def proof(self) -> Proof | None:
        """The full proof of the design in front; None until it is done."""
        return None if self.front is None else self._proofs.get(self.ticket)

    def left_done(self, ticket: Ticket, proof: Proof, left: AsLeft) -> None:
        """Take a trace beside the proof of a design; it is seen whenever that very design is in front."""
        _keep(self._left, ticket, (proof, left))

    def put_trace_away(self) -> None:
        """Forget the trace beside the proof of the design in front."""
        self._left.pop(self.ticket, None)

    @property
    def as_left(self) -> AsLeft | None:
        """The trace beside the proof of the design in front; None where none was held against that very proof."""
        return self._of_front(self._left)

    def samples_done(self, ticket: Ticket, proof: Proof, samples: Mapping[str, Any]) -> None:
        """Take what a proven design does on drawn heaters; it is seen whenever that very design is in front."""
        _keep(self._drawn, ticket, (proof, samples))

    @property
    def samples(self) -> Mapping[str, Any] | None:
        """What the design in front does on drawn heaters; None where it was not asked for, or is not proven."""
        return self._of_front(self._drawn)

    def _of_front(self, proofs: Mapping[Ticket, tuple[Proof, _Beside]]) -> _Beside | None:
        """Return what is kept beside the proof of the design in front; None where there is none of that very proof."""
        proof, extra = proofs.get(self.ticket, (None, None))
        return extra if proof is self.proof else None

    @property
    def verdict(self) -> str:
        """"PASS" or "FAIL" of the full proof, "proving…" until it is done, "no design" where there is none."""
        if self.error or self.look is None:
            return "no design"
        return "proving…" if self.front is None else self._verdict_of(self.ticket)

    def _verdict_of(self, ticket: Ticket) -> str:
        proof = self._proofs.get(ticket)
        return proof.verdict if proof is not None else "not proven" if ticket in self._refused else "proving…"

    @property
    def pinned_designs(self) -> tuple[PinnedDesign, ...]:
        """The designs set aside, the oldest first."""
        return tuple(PinnedDesign(name=name, look=look, verdict=self._verdict_of(ticket))
                     for name, look, ticket in self._pins)

    def pin(self) -> None:
        """Set the design in front aside.

        Raises:
            InputError: there is none, it is there already, or there are four.
        """
        look = self.front
        if look is None:
            raise InputError("there is no design to keep")
        if self.ticket in [ticket for _, _, ticket in self._pins]:
            raise InputError("this design is kept already")
        if len(self._pins) == MOST_PINNED:
            raise InputError(f"{MOST_PINNED} designs are kept already: let one go first")
        name = next(letter for letter in "ABCD" if letter not in [letter_in_use for letter_in_use, _, _ in self._pins])
        self._pins.append((name, look, self.ticket))

    def unpin(self, name: str) -> None:
        """Let a design go."""
        self._pins = [pin for pin in self._pins if pin[0] != name]

    def unproven(self) -> list[tuple[Ticket, LoopView]]:
        """Return tickets and loops that wait for their full proof: the one in front, then those set aside."""
        front = {} if self.front is None else {self.ticket: self.front}
        waiting = front | {ticket: look for _, look, ticket in self._pins}
        done = self._proofs.keys() | self._refused.keys()
        return [(ticket, look) for ticket, look in waiting.items() if ticket not in done]

    @property
    def is_computing(self) -> bool:
        """Whether what is seen is on its way to something else: a fit, a loop, a proof or a search."""
        on_its_way = self.fitted is not None and not self.error and (self.front is None or self.verdict == "proving…")
        return self.coming is not None or self.is_awaited or on_its_way

    @property
    def number(self) -> int:
        """Number of the design in front, another one for every other: a download tells which it means."""
        return self._numbers.setdefault(self.ticket, len(self._numbers) + 1)

    def front_design(self, number: int | None = None) -> FrontDesign:
        """Return the proven design in front; with a number, only where it is that one.

        Raises:
            ExportRefused: it is another one, or it is not proven.
        """
        if number is not None and (number != self.number or self.is_computing):
            raise ExportRefused("the design changed meanwhile: look at it and try again")
        look, proof = self.front, self.proof
        if look is None or proof is None or self.log is None or self.fitted is None:
            raise ExportRefused("the words are not proven yet")
        return FrontDesign(log=self.log, fitted=self.fitted, look=look, proof=proof, as_left=self.as_left)

    def export(self, *, force: bool) -> dict[str, str | bytes]:
        """Return the export files of the design in front, name → content; errors as in `standing` and its `export`."""
        return self.front_design().export(force=force)


def _keep(memory: dict[Ticket, Any], key: Ticket, value: Any) -> None:
    memory[key] = value
    if len(memory) > _KEPT:
        del memory[next(iter(memory))]
