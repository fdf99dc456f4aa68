"""Choose the words of a design: each rounded separately, or the best integers that the controller can hold.

Rounding may violate the robustness of the design, so the words are checked on heaters drawn from the fit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from operator import itemgetter
from typing import Any, Final

import numpy as np

from heatertune import cache
from heatertune.errors import NotRepresentable, OutOfRange, UnknownName
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.pid.design_document import promise_document
from heatertune.pid.design_values import PidDesign, Promise
from heatertune.pid.sampled_loop import iae_load, sensitivity_peaks
from heatertune.pid.search.integers import IntegerOptimum, Integers, Vector, best_integers
from heatertune.pid.search.robust import ROBUST, BrokenLimit, Open, draw_heaters, ms_over
from heatertune.plc import Number, Scaling, Words, controller_for
from heatertune.plc.design import encode, loop_fit, tune
from heatertune.processors import ProgressCallback
from heatertune.settings import TuneSettings

__all__ = [
    "WAYS", "Optimum", "RealisedResult", "WordChoice", "WordSearch", "broken_by", "choose_words", "demand_sentence",
    "realised_as", "search_document", "tune_for_words",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class RealisedResult:
    """What words are on the heaters; a number that is not finite, and all of a controller that is no PID, are None.

    Attributes:
        iae_load: mean load IAE [°C·s].
        gap_pct: how much more than that of the unrounded design [%].
        ms: the worst Ms.
    """

    iae_load: float | None
    gap_pct: float | None
    ms: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Optimum:
    """What a search over whole numbers shows, and what plain rounding would have been.

    Attributes:
        proven: whether no other words are better.
        left_open_pct: by how much others may be [%].
        rounded_words: the words of plain rounding.
        rounded: what they are on the heaters.
    """

    proven: bool
    left_open_pct: float
    rounded_words: Mapping[str, Number]
    rounded: RealisedResult


@dataclass(frozen=True, slots=True, kw_only=True)
class WordSearch:
    """How words were found.

    Attributes:
        way: "rounded", "optimum" or "refined".
        realised: what the words are on the heaters.
        ms_limit: they had to keep; None: the design itself is not stable on all heaters.
        iae_load_wished: mean load IAE of the unrounded design [°C·s]; None: without end.
        notes: one sentence each.
        optimum: what the search shows; None: the words are rounded.
        promise: what they keep on drawn heaters, too.
    """

    way: str
    realised: RealisedResult
    ms_limit: float | None
    iae_load_wished: float | None
    notes: tuple[str, ...]
    optimum: Optimum | None = None
    promise: Promise | None = None

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object."""
        document: dict[str, Any] = {
            "way": self.way, **asdict(self.realised), "ms_limit": self.ms_limit,
            "iae_load_wished": self.iae_load_wished}
        if self.optimum is not None:
            plain = self.optimum.rounded
            document |= {
                "proven": self.optimum.proven, "left_open_pct": self.optimum.left_open_pct,
                "rounded": {"words": dict(self.optimum.rounded_words), "iae_load": plain.iae_load, "ms": plain.ms,
                            "gap_pct": plain.gap_pct}}
        document["notes"] = list(self.notes)
        return document if self.promise is None else document | {"robust": promise_document(self.promise)}


@dataclass(frozen=True, slots=True, kw_only=True)
class WordChoice:
    """Words, and how they were found."""

    words: Words
    search: WordSearch

    def with_note(self, note: str) -> WordChoice:
        """Return the same with one more sentence."""
        return replace(self, search=replace(self.search, notes=(*self.search.notes, note)))


def broken_by(words: Words, heaters: Open, promise: Promise) -> BrokenLimit | None:
    """Return where words break a promise, None where they keep it, are no PID controller, or have no heaters."""
    design = controller_for(words.target).decode(words)
    return None if design is None else heaters.broken(promise, design)


def demand_sentence(words: Words, promise: Promise, fitted: FittedModel, *, told_only: bool = False) -> str:
    """Return the sentence that tells whether words keep a promise.

    Args:
        words: what the PLC will hold.
        promise: on the heaters drawn from the fit.
        fitted: what they are drawn from.
        told_only: words that break the promise are told, not refused.

    Raises:
        NotRepresentable: the words break it.
    """
    heaters, where = Open.of(fitted, promise.way), ROBUST[promise.way]
    if not len(heaters):
        return "This model has no intervals, so the limits could not be checked on sampled heaters."
    broken = broken_by(words, heaters, promise)
    if broken is None:
        return (f"Of the {len(heaters)} heaters sampled from the fit, {where} keep the limits with the rounded "
                "parameters too.")
    name, limit = broken.name.capitalize(), promise.limits[broken.name]
    if not told_only:
        raise NotRepresentable(
            f"{name} of the rounded parameters on the heaters sampled from the fit ({where})",
            broken.value, f"<= {limit:g}",
            "use a longer TA, which rounds less (--sample-time words searches for one), or loosen the limit",
        )
    return (f"Rounding breaks the limits on the heaters sampled from the fit ({where}): {name} is "
            f"{broken.value:.4g}, {100.0 * (broken.value / limit - 1.0):.2g} % above {limit:g}.")


#: how words are found; auto: the optimum for a design that is an optimum itself, else what was asked for is kept
WAYS: Final = ("auto", "optimum", "rounded")

_COARSE: Final = 10  # below this one step of the word is more than a tenth, and rounding decides
_FINE: Final = 20
#: shares of K, see `_as_robust`; whole seconds of TN ask for the smallest
_LESS: Final = (*(1.0 - share for share in (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)),)
_INTERVALS: Final = (0.5, 0.7, 1.0, 1.4, 2.0)  # times TRdom/10


@dataclass(frozen=True, slots=True, kw_only=True)
class _Measured:
    """Mean load IAE [°C·s] and worst Ms over the heaters; infinite where one of the loops is unstable."""

    iae_load: float
    ms: float


def choose_words(
    design: PidDesign, target: str, fitted: FittedModel, *, scaling: Scaling | None = None, way: str = "auto",
    progress: ProgressCallback = str,
) -> WordChoice:
    """Return the words of a design for a target.

    The optimum is searched over all whole numbers the controller can hold, on every candidate model, under the Ms that
    the design itself has: the words shall be no less robust than what they stand for.

    Args:
        design: what was tuned.
        target: the controller.
        fitted: the heater and its candidates.
        scaling: sensor range.
        way: one of `WAYS`.
        progress: called with a few words as each step begins.

    Raises:
        UnknownName: no such target or way.
        NotRepresentable: as `encode`; no words keep what the design promises on the heaters drawn from the fit.
    """
    if way not in WAYS:
        raise UnknownName("way to find words", way, WAYS)
    fitted = loop_fit(fitted, target, scaling)
    choice, promise = _choice(design, target, fitted, scaling, way, progress), design.promise
    if promise is None or controller_for(target).decode(choice.words) is None:
        return choice
    note = demand_sentence(choice.words, promise, fitted, told_only=way == "rounded")
    return replace(choice, search=replace(choice.search, promise=promise)).with_note(note)


def _choice(
    design: PidDesign, target: str, fitted: FittedModel, scaling: Scaling | None, way: str, progress: ProgressCallback
) -> WordChoice:
    rounded = encode(design, target, scaling=scaling)
    wished = _measured(fitted.plants, design)
    why = _why_rounded(design, rounded, way, wished)
    if why is not None:
        return _plainly(_as_robust(design, rounded, fitted, wished), fitted, wished, why)
    inputs = {
        "words": dict(rounded.values), "target": target, "range": repr(rounded.scaling),
        "sample_time_s": rounded.sample_time_s, "ms": wished.ms, "plants": [repr(plant) for plant in fitted.plants],
        "promise": repr(design.promise), "drawn": repr(draw_heaters(fitted)) if design.promise else "",
        "step_power": design.step_power_limit_pct_per_degC,
    }

    progress(f"searching the integers of {target}")
    best = cache.load_or_compute("words", inputs, lambda: asdict(_search(rounded, fitted, wished.ms, design)), _optimum,
                        progress=progress)
    if best.words is None:
        also = "" if design.promise is None else " and the limits on the sampled heaters"
        why = f"no words keep Ms <= {wished.ms:.5g}{also} at TA = {rounded.sample_time_s:g} s"
        return _plainly(rounded, fitted, wished, why)
    return _chosen(rounded, best, fitted, design, wished)


def _optimum(document: Mapping[str, Any]) -> IntegerOptimum:
    words = document["words"]
    return IntegerOptimum(**{**document, "words": None if words is None else tuple(words)})


def tune_for_words(
    fitted: FittedModel, settings: TuneSettings | None = None, *, target: str, scaling: Scaling | None = None,
    progress: ProgressCallback = str,
) -> PidDesign:
    """Return the design at the sampling interval, out of five around TRdom/10, whose words cost the least load IAE.

    Args:
        fitted: the heater and its candidates.
        settings: what is asked for; None: the defaults.
        target: the controller.
        scaling: sensor range.
        progress: called with a few words as each step begins.

    Raises:
        UnknownName, OutOfRange, InputError: as `tune`.
        NotRepresentable: the words fit at none of the intervals.
    """
    at = partial(tune, fitted, settings, target=target, scaling=scaling, progress=progress)
    usual = at(sample_time_s=None)
    timer = controller_for(target).timer
    intervals = sorted({timer.round(share * usual.sample_time_s) for share in _INTERVALS} | {usual.sample_time_s})
    tried: list[tuple[float, float, PidDesign]] = []
    refused: NotRepresentable | None = None
    for ta in intervals:
        design = usual if ta == usual.sample_time_s else at(sample_time_s=ta)
        try:
            choice = choose_words(design, target, fitted, scaling=scaling, progress=progress)
        except NotRepresentable as problem:
            refused = problem
            continue
        cost = choice.search.realised.iae_load
        tried.append((math.inf if cost is None else cost, ta, design))
    if not tried:
        assert refused is not None
        raise refused
    _, best, design = min(tried, key=itemgetter(0, 1))
    costs = ", ".join(f"{cost:.4g} at {ta:g} s" for cost, ta, _ in tried)
    note = f"TA = {best:g} s has the lowest mean load IAE [°C·s] after rounding: {costs}."
    return replace(design, notes=(*design.notes, note))


def _why_rounded(design: PidDesign, rounded: Words, way: str, ideal: _Measured) -> str | None:
    """Return why the words are rounded, None where the optimum is searched."""
    reasons = (
        (controller_for(rounded.target).decode(rounded) is None, "the controller is no PID"),
        (controller_for(rounded.target).integers is None,
         f"there is no search over those of {rounded.target}"),
        (way == "rounded", "requested with --words rounded"),
        (way == "auto" and not design.method.startswith("optimum"),
         "the design is not an optimum, so its values are kept; --words optimum would search"),
        (math.isinf(design.integral_time_s), "without an I part only the gain is rounded"),
        (math.isinf(ideal.ms) or math.isinf(ideal.iae_load),
         "the unrounded design itself does not settle on a candidate model"),
    )
    return next((why for applies, why in reasons if applies), None)


def _as_robust(design: PidDesign, rounded: Words, fitted: FittedModel, ideal: _Measured) -> Words:
    """Return the words with less gain where whole milliseconds or seconds have lifted an optimum's Ms."""
    its, gain = controller_for(rounded.target), design.gain_pct_per_degC
    if its.integers is not None or not design.method.startswith("optimum") or math.isinf(ideal.ms):
        return rounded
    for words in (encode(replace(design, gain_pct_per_degC=less * gain), its.name, scaling=rounded.scaling)
                  for less in _LESS):
        real = its.decode(words)
        if real is None or max(sensitivity_peaks(plant, real)[0] for plant in fitted.plants) <= ideal.ms:
            return words
    return rounded


def _search(rounded: Words, fitted: FittedModel, ms: float, design: PidDesign) -> IntegerOptimum:
    """Return the best whole numbers; a drawn heater on which they break the promise becomes a guard, and again."""
    problem, guards = _problem(rounded, fitted.plants, ms, design.step_power_limit_pct_per_degC), list[HeaterModel]()
    promise = design.promise
    heaters = None if promise is None else Open.of(fitted, promise.way)
    while True:
        best = best_integers(problem)
        if promise is None or heaters is None or best.words is None:
            return best
        broken = broken_by(_with(rounded, best.words), heaters, promise)
        if broken is None or broken.heater in guards:
            return best
        guards.append(broken.heater)
        upright = tuple(map(_heating, guards))
        problem = replace(problem, guards=upright, limits=promise.limits)


def _problem(rounded: Words, plants: tuple[HeaterModel, ...], ms: float, step_power: float) -> Integers:
    """Return the search for the best whole numbers; parts that the rounded words leave out stay out.

    The D part at most doubles: load disturbances alone would ask for ever more of it, and noise would pay.
    """
    controller, names = controller_for(rounded.target), _integers(rounded)
    start = tuple(abs(rounded.whole[name]) for name in names)
    largest = [_largest(rounded, name) for name in names]
    largest[2] = min(largest[2], max(2 * start[2], 2))
    ranges = tuple((1, high) if value else (0, 0) for value, high in zip(start, largest, strict=True))

    def decode(values: Vector) -> PidDesign | None:
        try:
            return _upright(controller.decode(_with(rounded, values)))
        except OutOfRange:
            return None

    upright = tuple(map(_heating, plants))
    return Integers(decode=decode, ranges=ranges, plants=upright, ms=ms, start=start, step_power=step_power)


def _upright(design: PidDesign | None) -> PidDesign | None:
    return None if design is None else replace(design, gain_pct_per_degC=abs(design.gain_pct_per_degC))


def _heating(plant: HeaterModel) -> HeaterModel:
    """Return the heater whose mirror image a cooler is: the search of words knows positive gains alone."""
    return replace(plant, gain_degC_per_pct=abs(plant.gain_degC_per_pct))


def _largest(words: Words, name: str) -> int:
    """Return the largest size of a word that the controller allows, the others being as they are."""
    controller, sign = controller_for(words.target), -1 if words.whole[name] < 0 else 1
    low, high = abs(words.whole[name]), next(int(field.high) for field in controller.fields if field.name == name)
    while low < high:
        middle = (low + high + 1) // 2
        try:
            controller.check(replace(words, values=dict(words.values) | {name: sign * middle}))
            low = middle
        except OutOfRange:
            high = middle - 1
    return low


def _integers(words: Words) -> tuple[str, str, str]:
    names = controller_for(words.target).integers
    assert names is not None
    return names


def _with(words: Words, sizes: Vector) -> Words:
    """Return the words with others of these sizes, each with the sign it has."""
    changed = {name: -size if words.whole[name] < 0 else size
               for name, size in zip(_integers(words), sizes, strict=True)}
    return replace(words, values=dict(words.values) | changed)


def _chosen(rounded: Words, best: IntegerOptimum, fitted: FittedModel, design: PidDesign,
            ideal: _Measured) -> WordChoice:
    assert best.words is not None
    words = _with(rounded, best.words)
    plain, real = _realised(rounded, fitted), _realised(words, fitted)
    assert plain is not None
    assert real is not None
    assignments = " and ".join(f"{name} = {words.values[name]}" for name in _integers(words) if words.values[name])
    left = 100.0 * (1.0 - best.least / best.cost)
    proof = "no other integers are better" if best.proven else f"no other integers are better by more than {left:.2g} %"
    gap, gap_rounded = _gap(real, ideal), _gap(plain, ideal)
    notes = [
        f"{assignments} are the best integers with Ms <= {ideal.ms:.5g}: a load disturbance costs {_more(gap)} than "
        f"the unrounded design; plain rounding costs {_more(gap_rounded)} at Ms = {plain.ms:.5g}.",
        f"The branch-and-bound search evaluated {best.boxes} boxes of integers: {proof}.",
        *_coarse_notes(words, design),
    ]
    return WordChoice(words=words, search=WordSearch(
        way="optimum", realised=_as_realised(real, ideal.iae_load), ms_limit=ideal.ms,
        iae_load_wished=ideal.iae_load, notes=tuple(notes), optimum=Optimum(
            proven=best.proven, left_open_pct=left,
            rounded_words={name: rounded.values[name] for name in _integers(words)},
            rounded=_as_realised(plain, ideal.iae_load)),
    ))


def _plainly(rounded: Words, fitted: FittedModel, ideal: _Measured, why: str) -> WordChoice:
    plain = _realised(rounded, fitted)
    gap = None if plain is None else _gap(plain, ideal)
    price = "" if plain is None or math.isinf(plain.iae_load) else (
        f"; a load disturbance costs {_more(gap)} than the unrounded design, at Ms = {plain.ms:.5g}"
    )
    notes = [f"The parameters are rounded: {why}{price}."]
    if plain is not None and controller_for(rounded.target).integers is not None:
        design = controller_for(rounded.target).decode(rounded)
        assert design is not None
        notes += _coarse_notes(rounded, design)
    return WordChoice(words=rounded, search=WordSearch(
        way="rounded", realised=_as_realised(plain, ideal.iae_load), ms_limit=_finite(ideal.ms),
        iae_load_wished=_finite(ideal.iae_load), notes=tuple(notes)))


def realised_as(words: Words, fitted: FittedModel, wished_iae: float | None) -> RealisedResult:
    """Return what words are on the heaters, beside the mean load IAE that was wished for."""
    return _as_realised(_realised(words, loop_fit(fitted, words.target, words.scaling)), wished_iae)


def search_document(choice: WordChoice, fitted: FittedModel, notes: Sequence[str] = ()) -> dict[str, Any]:
    """Return how words were found as a JSON object for a reader: with Ms over heaters drawn from the fit.

    Args:
        choice: the words and how they were found.
        fitted: the heater, its candidates and intervals.
        notes: more sentences about the words.

    Returns:
        `choice.search` with ms_drawn (None: no PID, or no interval to draw from) and the notes.
    """
    return choice.search.to_document() | {
        "ms_sampled": _ms_drawn(choice.words, fitted), "notes": [*choice.search.notes, *notes],
    }


def _ms_drawn(words: Words, fitted: FittedModel) -> dict[str, Any] | None:
    design = controller_for(words.target).decode(words)
    heaters = draw_heaters(loop_fit(fitted, words.target, words.scaling))
    drawn = None if design is None else ms_over(heaters, design)
    return None if drawn is None else {
        "count": drawn.count, "median": _finite(drawn.median), "p95": _finite(drawn.p95), "worst": _finite(drawn.worst),
        "unstable": drawn.unstable,
        "message": f"On {drawn.count} heaters sampled from the fit's intervals the median of Ms is {drawn.median:.3g}, "
                f"the 95th percentile {drawn.p95:.3g}, the worst {drawn.worst:.3g}; unstable on {drawn.unstable}.",
    }


def _as_realised(measured: _Measured | None, wished_iae: float | None) -> RealisedResult:
    if measured is None:
        return RealisedResult(iae_load=None, gap_pct=None, ms=None)
    gap = None if wished_iae is None else _gap(measured, _Measured(iae_load=wished_iae, ms=1.0))
    return RealisedResult(iae_load=_finite(measured.iae_load), gap_pct=gap, ms=_finite(measured.ms))


def _coarse_notes(words: Words, design: PidDesign) -> list[str]:
    """Return a warning where one step of the I part's word is coarse, and the TA that makes the word fine."""
    name = _integers(words)[1]
    value = words.values[name]
    if not 0 < value < _COARSE:
        return []
    ta = words.sample_time_s * _FINE / value
    timer = controller_for(words.target).timer
    slower = math.ceil(ta / timer.step_s - 1e-9) * timer.step_s
    fine = f"TA = {slower:.6g} s makes it about {_FINE}"
    remedy = fine if slower <= timer.longest_s else "no TA of this timer makes it fine"
    return [f"{name} = {value}: one step changes the I part by {100.0 / value:.0f} %, so rounding matters; {remedy} "
            f"(now {design.sample_time_s:g} s)."]


def _realised(words: Words, fitted: FittedModel) -> _Measured | None:
    design = controller_for(words.target).decode(words)
    return None if design is None else _measured(fitted.plants, design)


def _measured(plants: tuple[HeaterModel, ...], design: PidDesign) -> _Measured:
    return _Measured(
        iae_load=float(np.mean([iae_load(plant, design) for plant in plants])),
        ms=max(sensitivity_peaks(plant, design)[0] for plant in plants),
    )


def _gap(measured: _Measured, ideal: _Measured) -> float | None:
    if math.isinf(measured.iae_load) or math.isinf(ideal.iae_load):
        return None
    return 100.0 * (measured.iae_load / ideal.iae_load - 1.0)


def _more(gap: float | None) -> str:
    if gap is None:
        return "infinitely more IAE"
    return f"{abs(gap):.2g} % {'less' if gap < 0.0 else 'more'} IAE"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
