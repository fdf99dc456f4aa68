"""What `design` wrote of a log with a measured disturbance → feed-forward, run beside plain feedback."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from heatertune.codec import decode
from heatertune.documents import DATA, data_folder, read_document, to_json
from heatertune.errors import ExportRefused, InputError
from heatertune.model.disturbance import DisturbanceEffect
from heatertune.model.document import read_model
from heatertune.options import merge_options
from heatertune.plc import Words, controller_for
from heatertune.plc.feed_forward import feed_forward as line_for
from heatertune.proof.document import ProofView, check_document
from heatertune.proof.feed_forward import FeedForwardProof, PlainLoop, prove_feed_forward
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import WORDS_SCHEMA, certificate, demand_same_words, read_words
from heatertune.settings import FeedForwardSettings

__all__ = ["FedForward", "feed_forward"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FedForward:
    """Feed-forward for the words of a design.

    Attributes:
        proof: beside plain feedback.
        files: name → content: the document, and the PLC's program where it is to be used or was forced.
    """

    proof: FeedForwardProof
    files: Mapping[str, str]


def feed_forward(
    directory: str | Path, settings: FeedForwardSettings | None = None, *, force: bool = False
) -> FedForward:
    """Return feed-forward of the disturbance in the log of a design.

    Args:
        directory: as `heatertune.chain.design` wrote it.
        settings: how the PLC sees the disturbance; None: an analog sensor over the levels logged.
        force: return the program whatever the verdicts.

    Raises:
        InputError: no disturbance in the design, one that the log does not show to act, or not as power; a target
            without an input for it; no power left over.
        DocumentError: a document is missing or is none.
        ExportRefused: the words themselves are not proven, and nothing is forced.
        NotRepresentable, OutOfRange: the input cannot hold the line.
    """
    asked, folder = merge_options(FeedForwardSettings, settings, {}), data_folder(directory)
    effect = _effect(folder)
    document = check_document(read_document(folder / "proof.json", PROOF_SCHEMA), folder / "proof.json")
    demand_same_words(read_document(folder / "words.json", WORDS_SCHEMA), document, folder / "proof.json")
    plain = decode(ProofView, document, folder / "proof.json")
    words = _words(folder, plain.target)
    feed = controller_for(words.target).feed
    if feed is None:
        raise InputError(f"{words.target} has no input for a measured disturbance (see: heatertune targets)")
    proven = certificate(document, force=force)
    low, high = asked.disturbance_range or (effect.calm, effect.strong)
    line = line_for(feed, column=effect.column, pct_per_unit=effect.pct_per_unit, calm=effect.calm, low=low, high=high,
                    switched=asked.contact)
    loop = PlainLoop(setpoint_degC=plain.scenario.setpoint_degC, actuator=plain.actuator, limits=plain.limits,
                     noise_degC=plain.scenario.noise_degC, stated_settings=plain.stated_settings)
    models = holding_heaters(read_model(folder / "model.json"), loop.setpoint_degC)
    proof = prove_feed_forward(words, line, effect, models, loop)
    files = {f"{DATA}/feed_forward.json": to_json(proof.to_document())}
    if force or not proof.refusal:
        files |= feed.listing(line,
                              replace(proven, lines=(*proven.lines, *proof.summary), forced=proven.forced or force))
    return FedForward(proof=proof, files=files)


def _effect(folder: Path) -> DisturbanceEffect:
    effect = read_model(folder / "model.json").disturbance
    if effect is None:
        raise InputError(f"{folder}: its log has no disturbance: design with --disturbance-column NAME first")
    if not effect.acts:
        raise InputError(effect.sentence)
    if not effect.as_power:
        raise InputError(
            f"{effect.sentence} Feed-forward of a straight line is proven only for what acts as power does.")
    return effect


def _words(folder: Path, target: str) -> Words:
    words = read_words(folder / "words.json", target)
    if words is None:
        raise ExportRefused(f"{folder / 'words.json'} holds no words")
    return words
