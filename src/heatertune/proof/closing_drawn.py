"""The design closed on drawn heaters, too: where too few keep every limit, the first lower Ms with which enough do."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from heatertune.errors import HeatertuneError, InputError
from heatertune.model.values import FittedModel
from heatertune.progress import Told
from heatertune.proof import price
from heatertune.proof.asked import Asked, Closed
from heatertune.proof.closing import closed_on_runs
from heatertune.proof.drawn import with_samples
from heatertune.proof.fitted import aimed
from heatertune.proof.sampled import SampleProof
from heatertune.proof.verdict import samples_told, verdict_of_samples
from heatertune.settings import SampleSettings

__all__ = ["closed_on_samples"]

#: tried in turn; the field designs for 1.2 to 2.0, and from 1.4 on for robustness (K. J. Åström, T. Hägglund, "PID
#: Controllers", 1995)
_CALMER_MS: Final = (1.4, 1.25)


def closed_on_samples(fitted: FittedModel, asked: Asked, *, progress: Told = str, stage: Told = str) -> Closed:
    """Return the design of `closed_on_runs`, or, where too few samples pass, the first of a lower Ms where enough do.

    Who looks for a design that passes on some samples finds one that suits them: what was found so is judged by as many
    others, whose verdict stands. Where no lower Ms helps, for heaters lack the power, say, it is the design as it was
    asked for.

    Args:
        fitted: the heater and its candidates.
        asked: what the design is asked for; without samples it is that of `closed_on_runs`.
        progress: told what begins.
        stage: as `closed_on_runs`.

    Raises:
        HeatertuneError: as `closed_on_runs`; as `heatertune.proof.drawn.sampled`.
    """
    drawn, found = asked.drawn, closed_on_runs(fitted, asked, progress=progress, stage=stage)
    if drawn.samples is None:
        return found
    progress(f"proving the words on {drawn.samples} samples")
    first = _heard(found, fitted, drawn)
    if asked.as_is or found.proof.verdict == "FAIL" or _drawn(first).verdict == "PASS" or _lacks_power(first):
        return first
    by_ms, limit = found.wished.method.startswith("optimum"), aimed(asked.tuned, asked.conditions).ms
    tried = [ms for ms in _CALMER_MS if by_ms and ms < limit]
    for ms in tried:
        progress(f"too few samples keep every limit: trying Ms <= {ms:g}")
        calmer = replace(asked, tuned=replace(asked.tuned, ms=ms))
        try:
            other = closed_on_runs(fitted, calmer, progress=progress)
        except HeatertuneError:  # with so low a limit there is no design
            continue
        if other.proof.verdict != "FAIL" and _drawn(_heard(other, fitted, drawn)).verdict == "PASS":
            others = replace(drawn, seed=drawn.seed + drawn.samples)
            return _changed(first, _heard(other, fitted, others), f"Ms <= {ms:g}")
    last = _remarked(first, f"no lower Ms down to {tried[-1]:g} helps the samples") if tried else first
    return _with_way_on(last, fitted, asked, progress)


def _with_way_on(first: Closed, fitted: FittedModel, asked: Asked, progress: Told) -> Closed:
    """Return a design that says with which setting of an open point one would pass, where it fails for another."""
    drawn = _drawn(first)
    assumed, worst = drawn.settings[0].switches, min(drawn.settings, key=lambda setting: setting.kept).switches
    for name in (name for name, setting in assumed.items() if worst[name] != setting):
        kept = [setting.kept for setting in drawn.settings if setting.switches[name] == assumed[name]]
        if verdict_of_samples(drawn.count, drawn.quantile, kept) != "PASS":
            continue
        option = f"--switch {name}={assumed[name]}"
        progress(f"too few samples keep every limit: trying {option}")
        switches = {**asked.conditions.switches, name: assumed[name]}
        other = closed_on_samples(fitted, replace(asked, conditions=replace(asked.conditions, switches=switches)))
        if other.proof.verdict == "PASS":
            told = _remarked(first, f"would pass with {option}: find out what this controller does")
            return replace(told, passes_with=tuple(option.split()))
    return first


def _heard(found: Closed, fitted: FittedModel, drawn: SampleSettings) -> Closed:
    return replace(found, proof=with_samples(found.proof, fitted, drawn, found.conditions))


def _drawn(found: Closed) -> SampleProof:
    """Return what the samples showed.

    Raises:
        InputError: there are none.
    """
    if found.proof.samples is None:
        raise InputError("samples: none")
    return found.proof.samples


def _lacks_power(found: Closed) -> bool:
    """Return whether one in twenty samples lacks the power for the setpoint, whatever drives it."""
    return next(spot.p95 for spot in _drawn(found).criteria if spot.name == "power_reserve") <= 0.0


def _changed(first: Closed, found: Closed, what: str) -> Closed:
    before, now = (samples_told(_drawn(each).to_document()) for each in (first, found))
    note = f"As asked for, {before}; with {what}, of as many others, {now}; {price.costs(first, found)}."
    return replace(_remarked(found, f"with {what} for the samples"), notes=(note, *found.notes))


def _remarked(found: Closed, remark: str) -> Closed:
    heard = found.proof.heard
    return replace(found, proof=replace(found.proof, heard=replace(heard, remarks=(*heard.remarks, remark))))
