"""Where a log comes from: a path, a built-in table, or a folder that `heatertune design` wrote."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from heatertune import chain
from heatertune.chain.documents import read_documents
from heatertune.log.tables import BUILT_IN
from heatertune.log.values import Log
from heatertune.model.document import from_document
from heatertune.model.values import FittedModel
from heatertune.options import options_of
from heatertune.pid import document as pid_document
from heatertune.pid.document import DesignProvenance
from heatertune.pid.values import PidDesign
from heatertune.plc.word_selection import search_document
from heatertune.processors import ProgressCallback
from heatertune.proof.design_request import DesignResult
from heatertune.proof.repetition import demand_same_files, made_again
from heatertune.proof.specification import GENERAL, PRESETS
from heatertune.settings import Conditions, FitSettings
from heatertune.studio.loop import CandidateWords, DesignOutcome
from heatertune.studio.settings import StudioSettings

__all__ = ["LogSource", "fit_log", "read_source"]

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


def read_source(source: str) -> LogSource:
    """Return what a log file, a built-in table or a folder holds.

    Raises:
        InputError: a file that is no log, a folder without the documents of `heatertune design`, a specification that
            has changed since.
    """
    if not Path(source).is_dir():
        built_in = source.lower() in BUILT_IN
        return LogSource(log=chain.read_log(source, errata=built_in), settings=StudioSettings())
    documents = read_documents(Path(source))
    held = documents["log"]
    columns = {name: held[name] for name in ("name", "source", "time_s", "temperature_degC", "power_pct",
                                              "setpoint_degC")}
    log = Log(**columns, repairs=tuple(held["repairs"]), warnings=tuple(held["warnings"]))
    fitted, design, recipe = from_document(documents["model"]), *pid_document.parts_of(documents["pid"])
    settings = StudioSettings(target=documents["words"]["target"], structure=documents["pid"]["structure"])
    if recipe is None:
        return LogSource(log=log, settings=settings, fitted=fitted)
    found = _found(design, fitted, recipe, source)
    words, verdict = documents["words"]["words"], documents["proof"]["verdict"]
    if dict(found.gains.words.values) != words or found.result.proof.verdict != verdict:
        return LogSource(log=log, settings=settings, fitted=fitted, as_left=(
            f"{source}: another design is shown: its {verdict} is of other words or runs than its pid.json makes"))
    lost = ", ".join(_without_place(recipe))
    return LogSource(
        log=log, settings=_as_made(settings, design, recipe), fitted=fitted, outcome=found,
        as_left=f"{source}: the page has no place for {lost}; moving a setting leaves that out" if lost else "")


def _found(design: PidDesign, fitted: FittedModel, recipe: DesignProvenance, source: str) -> DesignOutcome:
    """Return the design of a folder as the page takes one that it found; errors as the stages."""
    demand_same_files(recipe, (), source)
    choice = made_again(design, fitted, recipe)
    proof = chain.prove(choice.words, fitted, recipe.conditions)
    closed = DesignResult(ideal=design, choice=choice, proof=proof, conditions=recipe.conditions, recipe=recipe,
                    notes=(": ".join(filter(None, (f"This is the design of {source}", recipe.way_on))),))
    return DesignOutcome(result=closed, gains=CandidateWords(
        design=design, words=choice.words, search=search_document(choice, fitted), recipe=recipe,
        conditions=recipe.conditions, proof=proof))


def _as_made(start: StudioSettings, design: PidDesign, recipe: DesignProvenance) -> StudioSettings:
    """Return the settings of a design, as far as the page has them."""
    asked, (low, high), ms = recipe.conditions, recipe.range_degC, _MS.search(design.method)
    return replace(
        start, ms=float(ms[1]) if ms else start.ms, sample_time_s=design.sample_time_s,
        pwm_period_s=asked.pwm_period_s, low_degC=low, high_degC=high,
        setpoint_degC=None if isinstance(asked.setpoint_degC, tuple) else asked.setpoint_degC, input=recipe.input,
        noise_degC=asked.noise_degC, tolerance_degC=asked.tolerance_degC, limits=asked.limit,
        assumptions=tuple(asked.switches.items()), spec=asked.spec if asked.spec in PRESETS else GENERAL)


def _without_place(recipe: DesignProvenance) -> Iterator[str]:
    """Yield the options of a design that the page does not have."""
    asked = recipe.conditions
    placed = {*_SHOWN, *(["spec"] if asked.spec in PRESETS else [])}
    placed -= {"setpoint_degC"} if isinstance(asked.setpoint_degC, tuple) else set()
    yield from (one.flag for name, one in options_of(Conditions).items()
                if name not in placed and getattr(asked, name) != one.default)


def fit_log(log: Log, progress: ProgressCallback = str, known: FitSettings | None = None) -> FittedModel:
    """Return the heater behind a log, as `heatertune design` finds it; arguments and errors as there."""
    return chain.fit(log, known, companions=True, progress=progress)
