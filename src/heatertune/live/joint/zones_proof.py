"""What is written to or watched at the zones of one PLC: words that were proven together again, and their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from heatertune.errors import HeatertuneError, InputError
from heatertune.live.write.proven_words import LEAST_YES
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.ramp import Number
from heatertune.processors import ProgressCallback
from heatertune.zones.joint_proof import JointProof
from heatertune.zones.joint_tuning import JOINT_MS, closed_loop_radius, joint_sensitivity
from heatertune.zones.zones_folder import ZonesDesign, prove_again, read_zones_design

__all__ = ["ProvenZone", "ProvenZones", "read_proven_zones"]

_DRAWN: Final = 12  # networks on which words in between have to be stable, besides the ends of the intervals


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvenZone:
    """The words of a zone, and what the proof expects of its loop; see `ExpectedWords`."""

    words: Words
    setpoints_degC: tuple[float, ...]
    tolerance_degC: float
    ambient_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvenZones:
    """Words of all zones that were proven together again.

    Attributes:
        design: as its folder has it.
        proof: as it was repeated.
    """

    design: ZonesDesign
    proof: JointProof

    @property
    def yes(self) -> str:
        """What somebody types who has read the proof."""
        return self.design.digest[:8]

    def demand_yes(self, typed: str | None) -> None:
        """Refuse what is not the beginning of the digest.

        Raises:
            InputError: it is not.
        """
        if typed is None or len(typed) < LEAST_YES or not self.design.digest.startswith(typed.lower()):
            found = "it was not said" if typed is None else f"found {typed!r}"
            raise InputError(f"--confirm: {found}; expected the first digits of the digest of the proof that you have "
                             f"read, as {self.yes}")

    @property
    def parts(self) -> tuple[ProvenZone, ...]:
        """The words of each zone."""
        spec, network = self.design.specification, self.design.fitted.network
        return tuple(ProvenZone(
            words=words, setpoints_degC=(setpoint,), tolerance_degC=spec.limits.tolerance_degC,
            ambient_degC=ambient) for words, setpoint, ambient in zip(
                self.design.words, spec.setpoints_degC, network.ambients_degC, strict=True))

    def open_in_between(self, values: Sequence[Mapping[str, Number]]) -> str:
        """Return why words of the zones are not stable together on each plausible network; empty where they are.

        Args:
            values: the words that are in the PLC, of each zone.
        """
        try:
            designs = [_decoded(words, own) for words, own in zip(self.design.words, values, strict=True)]
        except HeatertuneError as problem:
            return str(problem)
        words = self.design.words[0]
        delay = controller_for(words.target).delayed_s(words.scaling)
        networks = [network for _, network in self.design.fitted.draw(_DRAWN)]
        with np.errstate(all="ignore"):  # words of others may be anything
            radius = max(closed_loop_radius(network, designs, delay) for network in networks)
            if not radius < 1.0:
                return f"the loops swing together (largest eigenvalue {radius:.4g})"
            size = max(joint_sensitivity(network, designs, delay) for network in networks)
        return "" if size <= JOINT_MS else f"the largest singular value of S is {size:.3g}, limit {JOINT_MS:g}"


def _decoded(words: Words, values: Mapping[str, Number]) -> PidDesign:
    """Return the PID that other values of words make; raise InputError or OutOfRange where they make none."""
    other = replace(words, values={**words.values, **values})
    controller = controller_for(words.target)
    controller.check(other)
    design = controller.decode(other)
    if design is None or not design.gain_pct_per_degC > 0.0:
        raise InputError("they make no PID that heats")
    return replace(design, sample_time_s=words.sample_time_s)


def read_proven_zones(directory: str | Path, progress: ProgressCallback = str) -> ProvenZones:
    """Return the words of a folder that `design --zones` wrote, proven together again.

    Args:
        directory: that holds them.
        progress: called with the name of the step that begins.

    Raises:
        DocumentError, ExportRefused: as `heatertune.zones.zones_folder.read_zones_design` and `prove_again`.
    """
    design = read_zones_design(directory)
    progress("proving all zones together again")
    return ProvenZones(design=design, proof=prove_again(design))
