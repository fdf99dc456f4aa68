"""`heatertune design LOG --zones NAMES`: the whole chain for heaters that exchange heat."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from heatertune import options
from heatertune.cli import common, printing
from heatertune.codec import ZONES_FILE
from heatertune.errors import InputError
from heatertune.proof.design_request import with_printer_range
from heatertune.proof.words_file import exported_names
from heatertune.settings import FitSettings, SampleSettings, WordSettings
from heatertune.writing import write_files
from heatertune.zones.decoupling import demand_input
from heatertune.zones.identify import FittedNetwork, fit_network
from heatertune.zones.joint_design import design_zones
from heatertune.zones.joint_proof import JointProof, ZoneSpecification, specification_for
from heatertune.zones.zone_export import demand_program
from heatertune.zones.zone_reader import numbers_in, read_zones
from heatertune.zones.zone_record import design_files

__all__ = ["run"]

#: options of a design of one heater that zones do not have
_FITTED: Final = ("from_s", "until_s")
_TUNED: Final = ("structure", "sample_time_s")
_PROVEN: Final = ("setpoint_degC", "pwm_period_s", "minimum_on_s", "minimum_off_s", "pwm_rule", "pwm_resolution_s",
                  "spec", "limit", "tolerance_degC", "accept", "switches")


def run(settings: argparse.Namespace) -> int:
    """Run the command; return 0 for PASS, otherwise 1.

    Raises:
        InputError: an option that zones do not have, or as `read_zones`, `fit_network`, `design_zones`, `export_zones`.
    """
    progress = printing.Progress(settings)
    request = common.design_request(settings)
    _refuse_others(settings, request)
    zones = [zone.strip() for zone in settings.zones.split(",")]
    _demand_program(settings, request.target, len(zones))
    progress("reading")
    log = read_zones([settings.log, *settings.zone_log], zones, common.reading(settings))
    for repair in log.repairs:
        progress.note(repair)
    hottest = [log.temperatures_degC, *([] if log.setpoints_degC is None else [log.setpoints_degC])]
    request = with_printer_range(request, float(np.max(hottest)))
    progress("fitting the network of all zones")
    part = options.of(FitSettings, settings)
    fitted = fit_network(log.part(part.from_s, part.until_s), structure=settings.neighbours)
    progress("tuning and proving all zones together")
    proof = design_zones(
        fitted, request.target, scaling=request.scaling, structure=request.tune_settings.structure,
        sample_time_s=request.tune_settings.sample_time_s, conditions=request.conditions,
        specification=_specification(settings, fitted, request.conditions))
    files, earlier = design_files(proof, force=settings.force), Path(settings.out) / ZONES_FILE
    write_files(settings.out, files, gone=exported_names(earlier))
    document = json.loads(files[ZONES_FILE])
    text = f"{fitted.summary()}\n{_parameters(proof)}\n{proof.summary()}\nwritten to {settings.out}"
    brief = f"{_parameters(proof)}\n{proof.brief()}\nwritten to {settings.out}"
    printing.output(settings, document, lambda: text, brief=lambda: brief)
    return 0 if proof.verdict == "PASS" else 1


def _refuse_others(settings: argparse.Namespace, request: Any) -> None:
    """Refuse options that a design of zones does not follow, rather than pass over them."""
    kinds = ((type(request.tune_settings), request.tune_settings, _TUNED),
             (type(request.conditions), request.conditions, _PROVEN),
             (WordSettings, options.of(WordSettings, settings), ()),
             (FitSettings, options.of(FitSettings, settings), _FITTED),
             (SampleSettings, options.of(SampleSettings, settings), ()))
    for kind, values, followed in kinds:
        for name, option in options.options_of(kind).items():
            if name not in followed and getattr(values, name) != option.default:
                raise InputError(f"{option.flag}: not for zones, whose design does not follow it; leave it out")
    for name in ("zone_setpoints", "rated_power"):
        text = getattr(settings, name)
        if text is not None and len(text.split(",")) != len(settings.zones.split(",")):
            raise InputError(f"--{name.replace('_', '-')} {text}: expected a number for each of {settings.zones}")


def _demand_program(settings: argparse.Namespace, target: str, zones: int) -> None:
    """Refuse what no program of the target can do, before anything is computed."""
    if settings.peak_power is not None and settings.rated_power is None:
        raise InputError("--peak-power: needs the rated power of each zone's heater; state --rated-power")
    if settings.decouple:
        demand_input(target)
    demand_program(target, zones, staggered=settings.stagger or settings.peak_power is not None)


def _specification(settings: argparse.Namespace, fitted: FittedNetwork, conditions: Any) -> ZoneSpecification:
    setpoints: Any = conditions.setpoint_degC
    if isinstance(setpoints, tuple):
        raise InputError("--setpoint: zones take one setpoint for all; state --zone-setpoints for one of each")
    if settings.zone_setpoints is not None:
        setpoints = numbers_in("--zone-setpoints", settings.zone_setpoints)
    spec = specification_for(fitted, setpoints, conditions)
    rated = () if settings.rated_power is None else numbers_in("--rated-power", settings.rated_power)
    return replace(spec, deviation_degC=settings.neighbour_deviation, rated_kw=rated, peak_kw=settings.peak_power,
                   staggered=settings.stagger, spread_degC=settings.spread, decouple=settings.decouple)


def _parameters(proof: JointProof) -> str:
    lines = []
    for zone, words, design in zip(proof.fitted.network.zones, proof.words, proof.design.designs, strict=True):
        values = ", ".join(f"{name} {value:.9g}" for name, value in words.values.items())
        lines.append(f"zone {zone}: K {design.gain_pct_per_degC:.4g} %/°C, TN {design.integral_time_s:.4g} s, "
                     f"TA {design.sample_time_s:.4g} s: {values}")
    return "\n".join(lines)


