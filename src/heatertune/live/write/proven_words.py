"""What may be written: the words of a folder whose proof is whole, says PASS, and is the one that somebody has read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from heatertune.codec import decode
from heatertune.documents import data_folder, read_document
from heatertune.errors import ExportRefused, HeatertuneError, InputError
from heatertune.model.values import FittedModel
from heatertune.pid.loop.robustness import margins
from heatertune.plc import Words, controller_for
from heatertune.plc.ramp import Number
from heatertune.progress import ProgressCallback
from heatertune.proof.acceptance import Acceptance
from heatertune.proof.coverage import Coverage
from heatertune.proof.document import ProofView
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.proof import prove_models
from heatertune.proof.repetition import repeat_proof
from heatertune.proof.setpoint_ramp import prove_ramped
from heatertune.proof.verdict import PROOF_SCHEMA, derived_verdict, verdict_line
from heatertune.settings import Conditions

__all__ = ["LEAST_YES", "ProvenWords", "read_proven"]

#: digits of a digest that somebody has to type
LEAST_YES: Final = 6
#: of an order of writing, what each set of words in between has to keep: it may have to stay
_IN_BETWEEN: Final = ("stability", "ms", "overflow")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvenWords:
    """Words and their proof.

    Attributes:
        directory: where they lie.
        words: that are to be written.
        proof: its document.
        view: the same, by name.
        fitted: the heater that they were proven on.
        conditions: of the proof.
    """

    directory: str
    words: Words
    proof: Mapping[str, Any]
    view: ProofView
    fitted_model: FittedModel
    conditions: Conditions

    @property
    def digest(self) -> str:
        """The proof's digest, its digits alone."""
        return self.view.digest.partition(":")[2]

    @property
    def yes(self) -> str:
        """What somebody types who has read the proof."""
        return self.digest[:8]

    @property
    def slowest_s(self) -> float:
        """Lags and dead time of the slowest plausible heater [s]."""
        return max(sum(model.lags_s) + model.dead_time_s for _, model in labelled_heaters(self.fitted_model))

    def demand_yes(self, typed: str | None) -> None:
        """Refuse what is not the beginning of this proof's digest.

        Raises:
            InputError: it is not.
        """
        if typed is None or len(typed) < LEAST_YES or not self.digest.startswith(typed.lower()):
            found = "it was not said" if typed is None else f"found {typed!r}"
            raise InputError(f"--yes: {found}; expected the first digits of the digest of the proof that you have "
                             f"read, as {self.yes}")

    def open_in_between(self, values: Mapping[str, Number]) -> str:
        """Return why other values of the words are not stable on each plausible heater; nothing where they are.

        Raises:
            InputError: the proof was made on other heaters than the folder has.
        """
        words = replace(self.words, values={**self.words.values, **values})
        view, heaters = self.view, dict(labelled_heaters(self.fitted_model))
        ran = [(run.model, dict(run.switches), None) for run in view.runs if run.mains_power is None]
        try:
            models = [(label, heaters[label]) for label in dict.fromkeys(label for label, *_ in ran)]
        except KeyError as problem:
            raise InputError(f"{self.directory}: proof.json was made on {problem}, which is none of the possible "
                             "heaters of its model; prove the words again") from None
        try:
            proof = prove_models(
                controller_for(words.target), words, models, view.scenario, view.actuator,
                Acceptance(limits=view.limits, margins_of=margins),
                Coverage(stated_settings=view.stated_settings, only=ran, draws=False), interlock=view.interlock)
        except HeatertuneError as problem:
            return str(problem)
        found = {criterion.name: criterion for criterion in proof.criteria}
        if "ms" not in found and "ms" in view.criteria:
            return "they make no PID"
        broken = [f"{name} is {found[name].value:.3g}" for name in _IN_BETWEEN
                  if name in found and not (found[name].ok and math.isfinite(found[name].value))]
        return " and ".join(broken)


    def not_proven(self, values: Mapping[str, Number]) -> str:
        """Return why other values of the words do not pass on this heater and conditions; empty where they do.

        Args:
            values: of words, by name; the others are the proven ones.
        """
        words = replace(self.words, values={**self.words.values, **values})
        try:
            controller_for(words.target).check(words)
            proof, _ = prove_ramped(words, self.fitted_model, None, self.conditions)
        except HeatertuneError as problem:
            return str(problem)
        document = proof.to_document()
        return "" if derived_verdict(document) == "PASS" else verdict_line(document)


def read_proven(directory: str | Path, progress: ProgressCallback = str) -> ProvenWords:
    """Return the words of a folder that `design` or `export-db` wrote, proven again on its heater and conditions.

    Args:
        directory: that holds them.
        progress: called with the name of the step that begins.

    Raises:
        DocumentError: the folder has not what these write, or it was changed since.
        ExportRefused: the proof is of other words, or its verdict is not PASS.
        InputError, OutOfRange, UnknownName: as `heatertune.proof.repetition.repeat_proof`.
    """
    path = data_folder(directory) / "proof.json"
    again = repeat_proof(path.with_name("words.json"), progress=progress)
    if derived_verdict(again.proof) != "PASS":
        raise ExportRefused(f"{path}: {verdict_line(again.proof)}; only words that pass are written")
    view = decode(ProofView, dict(again.proof), path)
    stored = decode(ProofView, read_document(path, PROOF_SCHEMA), path)
    return ProvenWords(directory=str(directory), words=again.words, proof={**again.proof, "digest": stored.digest},
                  view=replace(view, digest=stored.digest), fitted_model=again.fitted_model,
                  conditions=again.conditions)
