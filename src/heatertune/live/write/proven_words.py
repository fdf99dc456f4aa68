"""The checks before a write: the folder's proof is whole and says PASS, and the user confirmed it.

The PLC must be the one for which the words were proven: this is checked where it can be read, otherwise declared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Protocol

from heatertune.codec import Document, data_folder, decode, read_document
from heatertune.errors import ExportRefused, HeatertuneError, InputError, OutOfRange
from heatertune.live.write.plc_block import BlockImage, BlockSnapshot, runs
from heatertune.model.model_values import FittedModel
from heatertune.pid.sampled_loop import margins
from heatertune.plc import Words, controller_for
from heatertune.plc.ramp import Number
from heatertune.plc.words import check_fields
from heatertune.processors import ProgressCallback
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.proof import prove_models
from heatertune.proof.proof_document import ProofView
from heatertune.proof.prove_words import prove
from heatertune.proof.repetition import repeat_proof
from heatertune.proof.text_comparison import as_exported
from heatertune.proof.verdict import PROOF_SCHEMA, Acceptance, Coverage, derived_verdict, verdict_line
from heatertune.settings import Conditions

__all__ = [
    "LEAST_YES", "Check", "Declared", "ExpectedWords", "ProvenWords", "call_interval", "checks", "read_proven",
    "refusal_reason",
]


#: digits of a digest that somebody has to type
LEAST_YES: Final = 6
#: of an order of writing, what each set of words in between has to keep: it may have to stay
_IN_BETWEEN: Final = ("stability", "ms", "overflow")


class ExpectedWords(Protocol):
    """Words that are to be written, and what their proof expects of the PLC.

    Attributes:
        words: that are to be written.
        setpoints_degC: of the proof [°C].
        tolerance_degC: around them [°C].
        ambient_degC: from which a setpoint ramp begins [°C].
    """

    @property
    def words(self) -> Words:
        """Words that are to be written."""
    @property
    def setpoints_degC(self) -> tuple[float, ...]:
        """Setpoints of the proof [°C]."""
    @property
    def tolerance_degC(self) -> float:
        """Tolerance around them [°C]."""
    @property
    def ambient_degC(self) -> float:
        """Ambient of the proof [°C]."""


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
    proof: Document
    view: ProofView
    fitted_model: FittedModel
    conditions: Conditions

    @property
    def setpoints_degC(self) -> tuple[float, ...]:
        """Setpoints of the proof [°C]."""
        return self.view.scenario.setpoints_degC

    @property
    def tolerance_degC(self) -> float:
        """Tolerance around them [°C]."""
        return self.view.limits.tolerance_degC

    @property
    def ambient_degC(self) -> float:
        """Ambient of the proof [°C]."""
        return self.view.scenario.ambient_degC or 0.0

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
            entry = "it was not said" if typed is None else f"found {typed!r}"
            raise InputError(f"--confirm: {entry}; expected the first digits of the digest of the proof that you have "
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
        by_name = {criterion.name: criterion for criterion in proof.criteria}
        if "ms" not in by_name and "ms" in view.criteria:
            return "they make no PID"
        broken = [f"{name} is {by_name[name].value:.3g}" for name in _IN_BETWEEN
                  if name in by_name and not (by_name[name].ok and math.isfinite(by_name[name].value))]
        return " and ".join(broken)


    def not_proven(self, values: Mapping[str, Number]) -> str:
        """Return why other values of the words do not pass on this heater and conditions; empty where they do.

        Args:
            values: of words, by name; the others are the proven ones.
        """
        words = replace(self.words, values={**self.words.values, **values})
        try:
            controller_for(words.target).check(words)
            proof = as_exported(prove(words, self.fitted_model, self.conditions))
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


_NEAR: Final = 1e-9
_COUNT: Final = 1.5  # steps of the module: so near to its end a reading is that of a broken wire


@dataclass(frozen=True, slots=True, kw_only=True)
class Declared:
    """What somebody says of a PLC that its block does not hold.

    Attributes:
        called_every_s: interval at which the controller is called [s].
        range_degC: both ends of the sensor's range [°C].
        as_exported: whether the program around the words is the exported one.
        in_manual: whether the controller is in manual, and stays there.
    """

    called_every_s: float | None = None
    range_degC: tuple[float, float] | None = None
    as_exported: bool = False
    in_manual: bool = False


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that has to agree.

    Attributes:
        name: of it.
        ok: whether it does; None: nobody knows.
        message: what was found, a few words.
        option: that says it, where the PLC does not.
    """

    name: str
    ok: bool | None
    message: str
    option: str = ""

    def to_document(self) -> dict[str, Any]:
        """Return it as a document has it."""
        return {"name": self.name, "ok": self.ok, "message": self.message, "option": self.option or None}


def checks(proven: ExpectedWords, standing: BlockImage, looks: tuple[BlockSnapshot, BlockSnapshot],
           said: Declared) -> list[Check]:
    """Return what was looked at of a PLC.

    Args:
        proven: what is to be written.
        standing: where.
        looks: at the PLC, two scans apart.
        said: what the block does not hold.
    """
    look = looks[1]
    return [
        _block(proven, standing, look), *_bits(proven, standing, look), _moves(looks),
        _interval(proven, standing, look, said), _range(proven, said), *_program(proven, said),
        _mode(standing, look, said), _reading(proven, standing, look), _setpoint(proven, standing, look),
    ]


def _block(proven: ExpectedWords, standing: BlockImage, look: BlockSnapshot) -> Check:
    name = "block"
    try:
        check_fields(standing.controller.fields, standing.words(look.content, proven.words))
    except OutOfRange as problem:
        return Check(name, False, f"holds no words of {standing.controller.name}: {problem}")
    return Check(name, True, f"{standing.controller.name}, {standing.block.description}")


def _bits(proven: ExpectedWords, standing: BlockImage, look: BlockSnapshot) -> Iterator[Check]:
    """Yield words of one bit that are not as proven: none is written, as its byte holds what is others', too."""
    bits = standing.bits(look.content)
    if other := [f"{name} is {value}; {proven.words.values[name]:g} was proven" for name, value in bits.items()
                 if value != proven.words.values[name]]:
        yield Check("bits", False, f"{', '.join(other)}: set them manually")


def _moves(looks: tuple[BlockSnapshot, BlockSnapshot]) -> Check:
    first, second = looks
    name = "CPU"
    if runs(second) is False:
        return Check(name, False, "is in STOP")
    if second.status is not None and first.status is not None:
        new = second.is_new(first)
        return Check(name, new, "runs, a simulator" if new else "says that it runs, but no scan came")
    is_new = second.is_new(first)
    if first.content != second.content if is_new is None else is_new:
        return Check(name, True, "the block moves")
    if runs(second):
        return Check(name, True, "says that it runs")
    return Check(name, None, "nothing in the block moved in two scans: look whether it runs")


def call_interval(standing: BlockImage, look: BlockSnapshot, said: Declared) -> tuple[float | None, str]:
    """Return the interval at which a PLC calls the controller [s], None where nobody tells it, and who does."""
    value, by = said.called_every_s, "as said"
    if look.status is not None:
        value, by = look.status.interval_s, "as the simulator says"
    if (interval_s := standing.interval_s(look.content)) is not None:
        value, by = interval_s, "by its words"
    return value, by


def _interval(proven: ExpectedWords, standing: BlockImage, look: BlockSnapshot, said: Declared) -> Check:
    own = proven.words.sample_time_s
    interval_s, by = call_interval(standing, look, said)
    if interval_s is None:
        return Check("TA", None, f"{own:g} s was proven; the block does not hold it", f"--called-every {own:g}")
    same = abs(interval_s - own) <= _NEAR * own
    return Check("TA", same, f"{interval_s:g} s, {by}" + ("" if same else f"; {own:g} s was proven"))


def _range(proven: ExpectedWords, said: Declared) -> Check:
    low, high = proven.words.scaling.sensor_degC
    if said.range_degC is None:
        return Check("sensor range", None, f"{low:g} to {high:g} °C was proven; no block holds it",
                     f"--range {low:g} {high:g}")
    same = all(abs(one - other) <= _NEAR for one, other in zip(said.range_degC, (low, high), strict=True))
    range_text = f"{said.range_degC[0]:g} to {said.range_degC[1]:g} °C, as said"
    return Check("sensor range", same, range_text if same else f"{range_text}; {low:g} to {high:g} °C was proven")


def _program(proven: ExpectedWords, said: Declared) -> Iterator[Check]:
    words = proven.words
    around = {"setpoint ramp": words.ramp, "boost": words.boost, f"input {words.scaling.input}": words.scaling.input}
    if missing := [name for name, there in around.items() if there is not None]:
        ok = True if said.as_exported else None
        yield Check("program", ok, f"proven with {', '.join(missing)}" + (", there as said" if ok else ""),
                    "" if ok else "--as-exported")


def _mode(standing: BlockImage, look: BlockSnapshot, said: Declared) -> Check:
    manual = standing.in_manual(look.content)
    if manual == said.in_manual:
        return Check("mode", True, "manual, as said" if manual else "automatic")
    if manual:
        return Check("mode", False, "manual: put it in automatic, or say --in-manual")
    return Check("mode", False, "automatic, not manual as said")


def _reading(proven: ExpectedWords, standing: BlockImage, look: BlockSnapshot) -> Check:
    reading, scale = standing.signal(look.content, "temperature"), proven.words.scaling
    step = _COUNT * scale.span_degC / standing.controller.counts
    low, high = scale.low_degC, scale.high_degC
    good = low <= reading <= high - step
    return Check("reading", good, f"{reading:.4g} °C" + ("" if good else
                 f"; expected {low:g} to {high - step:.4g} °C: is the sensor's wire broken?"))


def _setpoint(proven: ExpectedWords, standing: BlockImage, look: BlockSnapshot) -> Check:
    setpoints, setpoint_degC = proven.setpoints_degC, standing.signal(look.content, "setpoint")
    around = proven.tolerance_degC
    low, high = min(setpoints) - around, max(setpoints) + around
    if proven.words.ramp is not None:  # it is led there from the reading
        ambient = proven.ambient_degC
        low, high = min(low, ambient), max(high, ambient)
    good = low <= setpoint_degC <= high
    return Check("setpoint", good, f"{setpoint_degC:.4g} °C" + ("" if good else
                 f"; proven from {min(setpoints):.4g} to {max(setpoints):.4g} °C"))


def refusal_reason(checks: list[Check]) -> str:
    """Return why nothing is written, a sentence; nothing where all agrees.

    Raises:
        InputError: nobody has said what the PLC does not tell.
    """
    if wrong := [f"{check.name} {check.message}" for check in checks if check.ok is False]:
        return "; ".join(wrong)
    if unsaid := [check.option for check in checks if check.ok is None and check.option]:
        raise InputError(f"what the block does not hold has to be said, if it is so: {' '.join(unsaid)}")
    return ""
