"""The document of a design of zones, `data/zones.json`, with all that a repetition of the proof needs.

The digest shows that the file is whole, not who wrote it. So before words are written into a PLC, they are tuned again
from the recorded network and proven again under the recorded conditions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from heatertune.codec import ZONES_FILE, Document, decode, encode, plain, read_document
from heatertune.errors import DocumentError, ExportRefused, InputError
from heatertune.model.findings import Finding
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.pwm import Actuator
from heatertune.plc.ramp import Ramp
from heatertune.plc.words import check_fields
from heatertune.proof.proof_document import digest_of, with_digest
from heatertune.proof.repetition import recorded_conditions
from heatertune.settings import Conditions
from heatertune.zones.decoupling import Decoupling, decoupling_for
from heatertune.zones.identify import FittedNetwork, ParameterLayout
from heatertune.zones.joint_loop import ZoneLoop
from heatertune.zones.joint_proof import JointProof, ZoneSpecification, prove_zones
from heatertune.zones.joint_tuning import JointTuner
from heatertune.zones.network import ThermalNetwork

__all__ = ["ZonesDesign", "prove_again", "read_zones_design", "to_document"]

SCHEMA: Final = "heatertune/zones/2"
#: fields of a network, and of its fit, that a document holds as they are
_OF_NETWORK: Final = ("gains_degC_per_pct", "time_constants_s", "dead_times_s", "ambients_degC",
                      "second_time_constants_s", "supply_shares")
_OF_FIT: Final = ("late_s", "noise_degC", "interval_s", "log", "findings", "setpoints_degC", "highest_degC")


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkRecord:
    """A fitted network as a document holds it; see `heatertune.zones.network` and `FittedNetwork` for the fields."""

    gains_degC_per_pct: tuple[float, ...]
    time_constants_s: tuple[float, ...]
    dead_times_s: tuple[float, ...]
    ambients_degC: tuple[float, ...]
    second_time_constants_s: tuple[float, ...]
    exchange: tuple[tuple[float, ...], ...]
    pairs: tuple[tuple[int, int], ...]
    second: bool
    values: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    late_s: float
    noise_degC: tuple[float, ...]
    interval_s: float
    log: str
    findings: tuple[Finding, ...]
    setpoints_degC: tuple[float, ...] | None
    highest_degC: tuple[float, ...] | None
    supply_shares: tuple[float, ...] = ()

    @classmethod
    def from_fitted(cls, fitted: FittedNetwork) -> NetworkRecord:
        """Return the record of a fitted network."""
        return cls(
            **{name: getattr(fitted.network, name) for name in _OF_NETWORK},
            **{name: getattr(fitted, name) for name in _OF_FIT},
            exchange=tuple(map(tuple, fitted.network.exchange.tolist())), pairs=fitted.layout.pairs,
            second=fitted.layout.second, values=tuple(fitted.values.tolist()),
            covariance=tuple(map(tuple, fitted.covariance.tolist())))

    def to_fitted(self, zones: tuple[str, ...]) -> FittedNetwork:
        """Return the fitted network; raise InputError where the numbers are of another number of zones."""
        network = ThermalNetwork(
            zones=zones, exchange=np.array(self.exchange), **{name: getattr(self, name) for name in _OF_NETWORK})
        layout = ParameterLayout(len(zones), self.pairs, self.second, sag=bool(self.supply_shares))
        size = layout.first_share + len(self.supply_shares)
        if len(self.values) != size or [len(row) for row in self.covariance] != [size] * size:
            raise InputError(f"network: expected {size} values and their covariance")
        return FittedNetwork(
            network=network, layout=layout, values=np.array(self.values), covariance=np.array(self.covariance),
            **{name: getattr(self, name) for name in _OF_FIT})


@dataclass(frozen=True, slots=True, kw_only=True)
class ZonesProvenance:
    """What a design of zones was made of.

    Attributes:
        structure: "pi" or "pid".
        ms_zones: Ms that each zone was tuned for.
        scaling: sensor range of all zones.
        sample_time_s: interval of the controllers [s].
        actuator: of each zone.
        network: the heaters.
        specification: what the zones must keep.
        conditions: of the proof.
        ramp: of the setpoints of all zones; None: they step.
        decoupled_share: of the static gains that the programs take back; 0: zones are not decoupled.
    """

    structure: str
    ms_zones: tuple[float, ...]
    scaling: Scaling
    sample_time_s: float
    actuator: Actuator
    network: NetworkRecord
    specification: ZoneSpecification
    conditions: Conditions
    ramp: Ramp | None = None
    decoupled_share: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ZonesDesign:
    """A design of zones as its folder holds it.

    Attributes:
        directory: the folder.
        verdict: of the joint proof, as it was written.
        digest: of the document, its hexadecimal digits.
        words: of each zone.
        offsets_s: begin of each zone's PWM period after that of the first [s].
        fitted: the heaters.
        provenance: what the design was made of.
        settle_s: time after which all zones are at rest [s].
        remarks: of the design on its own choices, lines of the summary.
    """

    directory: str
    verdict: str
    digest: str
    words: tuple[Words, ...]
    offsets_s: tuple[float, ...]
    fitted: FittedNetwork
    provenance: ZonesProvenance
    settle_s: float
    remarks: tuple[str, ...] = ()

    @property
    def zones(self) -> tuple[str, ...]:
        """Names of the zones."""
        return self.fitted.network.zones

    @property
    def pwm_period_s(self) -> float:
        """PWM period of each zone [s]."""
        return ZoneLoop(words=self.words, actuator=self.provenance.actuator, offsets_s=self.offsets_s).period_s

    @property
    def specification(self) -> ZoneSpecification:
        """What the zones must keep."""
        return self.provenance.specification

    @property
    def decoupling(self) -> Decoupling | None:
        """What the programs add for the neighbours' temperatures; None: nothing."""
        share = self.provenance.decoupled_share
        return decoupling_for(self.fitted, self.specification.setpoints_degC, share) if share > 0.0 else None

    @property
    def conditions(self) -> Conditions:
        """Conditions of the proof."""
        return self.provenance.conditions


def to_document(proof: JointProof, files: Iterable[str] = ()) -> Mapping[str, object]:
    """Return network, words of all zones, their proof and exported files as a JSON document, its digest last."""
    fitted, network = proof.fitted, proof.fitted.network
    return with_digest({
        "schema": SCHEMA,
        "verdict": proof.verdict,
        "target": proof.words[0].target,
        "zones": [{
            "name": zone, "setpoint_degC": proof.specification.setpoints_degC[number],
            "gain_degC_per_pct": network.gains_degC_per_pct[number],
            "time_constant_s": network.time_constants_s[number],
            "second_time_constant_s": network.second_time_constants_s[number],
            "dead_time_s": network.dead_times_s[number], "ambient_degC": network.ambients_degC[number],
            "fit_pct": fitted.fit_pct[number] if fitted.fit_pct else None,
            "words": dict(proof.words[number].values), "pwm_offset_s": proof.offsets_s[number],
        } for number, zone in enumerate(network.zones)],
        "exchange": [list(map(float, row)) for row in network.exchange],
        "shown_couplings": dict(fitted.couplings),
        "ci95": {name: [interval.low, interval.high] for name, interval in fitted.ci95.items()},
        "decoupling": encode(proof.design.decoupling), "remarks": list(proof.remarks),
        "sample_time_s": proof.words[0].sample_time_s,
        "range_degC": list(proof.words[0].scaling.sensor_degC),
        "criteria": [plain({"name": each.name, "value": each.value, "limit": each.limit, "ok": each.ok,
                            "where": each.where}) for each in proof.criteria],
        "findings": [{"name": each.name, "message": each.message, "accepted": each.name in proof.accepted}
                     for each in proof.findings],
        "runs": list(proof.runs),
        "not_tested": list(proof.not_tested),
        "peak_heaters": proof.peak_heaters, "peak_kw": proof.peak_kw, "heaters_bound": proof.heaters_bound,
        "bound_share": proof.bound_share,
        "spread_degC": None if proof.spread is None else proof.spread.value,
        "settle_s": proof.settle_s, "heat_s": proof.heat_s,
        "files": sorted(files), "provenance": encode(_provenance(proof)),
    })


def _provenance(proof: JointProof) -> ZonesProvenance:
    words, decoupling = proof.words[0], proof.design.decoupling
    return ZonesProvenance(
        structure=proof.design.structure, ms_zones=proof.design.ms_zones, scaling=words.scaling,
        sample_time_s=words.sample_time_s, actuator=proof.actuator, network=NetworkRecord.from_fitted(proof.fitted),
        specification=proof.specification, conditions=recorded_conditions(proof.conditions), ramp=words.ramp,
        decoupled_share=0.0 if decoupling is None else decoupling.share)


def read_zones_design(directory: str | Path) -> ZonesDesign:
    """Return a design of zones.

    Raises:
        DocumentError: the folder has no such design, or it was changed since it was written.
    """
    path = Path(directory) / ZONES_FILE
    document = read_document(path, SCHEMA)
    if document.get("digest") != digest_of({name: value for name, value in document.items() if name != "digest"}):
        raise DocumentError(f"{path}: digest: the file was changed since it was written; design the zones again")
    try:
        provenance = decode(ZonesProvenance, document["provenance"], path, "provenance")
        zones = tuple(str(each["name"]) for each in document["zones"])
        words = tuple(_words(document, each, provenance) for each in document["zones"])
        offsets = tuple(float(each["pwm_offset_s"]) for each in document["zones"])
        _demand_all(provenance, len(zones))
        return ZonesDesign(
            directory=str(directory), verdict=str(document["verdict"]),
            digest=str(document["digest"]).partition(":")[2], words=words, offsets_s=offsets,
            fitted=provenance.network.to_fitted(zones), provenance=provenance, settle_s=float(document["settle_s"]),
            remarks=tuple(map(str, document.get("remarks", ()))))
    except (KeyError, TypeError, ValueError, InputError) as problem:
        raise DocumentError(f"{path}: {problem}: no whole design of zones; design them again") from None


def _demand_all(provenance: ZonesProvenance, zones: int) -> None:
    """Refuse setpoints or Ms of another number of zones; raise InputError."""
    if not zones == len(provenance.specification.setpoints_degC) == len(provenance.ms_zones):
        raise InputError(f"expected setpoints and Ms of {zones} zones")


def _words(document: Document, zone: Document, provenance: ZonesProvenance) -> Words:
    """Return the words of a zone; raise KeyError, TypeError, ValueError or InputError where they are none."""
    controller = controller_for(str(document["target"]))
    values = {field.name: zone["words"][field.name] for field in controller.fields}
    check_fields(controller.fields, words := Words(
        target=controller.name, values=values, scaling=provenance.scaling, sample_time_s=provenance.sample_time_s,
        ramp=provenance.ramp))
    controller.check_ramp(words)
    return words


def prove_again(design: ZonesDesign) -> JointProof:
    """Tune and prove the words of a folder again, from the recorded network and conditions.

    Raises:
        ExportRefused: the verdict is not PASS, or the folder has other words than the design makes.
        InputError, OutOfRange, UnknownName: as `heatertune.zones.joint_proof.prove_zones`.
    """
    origin, path = design.provenance, Path(design.directory) / ZONES_FILE
    if design.verdict != "PASS":
        raise ExportRefused(f"{path}: the joint proof is {design.verdict}; only words that pass are written")
    tuner = JointTuner(design.fitted, design.words[0].target, scaling=origin.scaling, structure=origin.structure,
                       sample_time_s=origin.sample_time_s)
    again = tuner.design_for(origin.ms_zones, design.decoupling).with_ramp(origin.ramp)
    for zone, stored_words, words in zip(design.zones, design.words, again.words, strict=True):
        if dict(stored_words.values) != dict(words.values):
            raise ExportRefused(f"{path}: zone {zone}: its design makes other words than the file has, so it was "
                                "changed; design the zones again")
    proof = prove_zones(again, design.fitted, origin.specification, origin.conditions)
    if proof.verdict != "PASS":
        raise ExportRefused(f"{path}: {proof.summary().splitlines()[0]}; only words that pass are written")
    if proof.offsets_s != design.offsets_s or proof.actuator != origin.actuator:
        raise ExportRefused(f"{path}: the proof has another PWM than the file, so it was changed; design the zones "
                            "again")
    return replace(proof, remarks=design.remarks)
