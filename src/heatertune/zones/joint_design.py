"""The design of all zones together: intervals, robust controllers at each of them, and the first that passes.

A controller of whole numbers may need a longer interval: its integral part moves by whole increments only, and an error
whose increment is below one of them stays.

Where zones overshoot or move their neighbours, or the spread of zones that heat up together is limited, and no gains
keep the limit, all get the same setpoint ramp: the fastest of a few at which the slowest zone follows and all is kept.

Zones that are to be decoupled keep the words that were found without decoupling, where these pass with it; the largest
share of the static gains that is robust, passes and moves the neighbours less is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import Final

import numpy as np

from heatertune.errors import InputError, OutOfRange
from heatertune.plc import Scaling, controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.ramp import Ramp
from heatertune.plc.words import Words
from heatertune.proof.heaters import RESERVE_PCT
from heatertune.settings import Conditions
from heatertune.zones.decoupling import decoupling_for
from heatertune.zones.identify import FittedNetwork
from heatertune.zones.joint_loop import residual_error_degC
from heatertune.zones.joint_proof import (
    HOLDING_POWERS,
    SPREAD_NAME,
    JointProof,
    ZoneSpecification,
    prove_zones,
    specification_for,
)
from heatertune.zones.joint_tuning import JOINT_MS, MS_LADDER, JointDesign, JointTuner

__all__ = ["design_zones"]

_ATTEMPTS: Final = 5  # designs that are proven, each detuned further, in all zones and then in one
_MANY: Final = 10.0  # times the tolerance that an error at rest has to be to spare the other zones' tuning
_PACES: Final = (1.0, 0.7, 0.5, 0.35, 0.25, 0.125)  # of the rate at which the slowest zone can follow a setpoint ramp
#: what a setpoint ramp lowers
_OF_RAMPS: Final = (SPREAD_NAME, "overshoot [%]", "overshoot after a fault [%]", "neighbour deviation [°C]")
_LONGER: Final = (2.0, 4.0, 3.0)  # intervals that are tried beyond the first, as multiples of it
_ALMOST: Final = 1.2  # times the least neighbour deviation that faster decoupled controllers may have
_CANDIDATES: Final = 3  # decoupled designs that are proven
_SHARES: Final = (1.0, 0.8, 0.6, 0.4, 0.2)  # of the static gains that decoupling may take back


def design_zones(
    fitted: FittedNetwork, target: str, setpoints_degC: float | Sequence[float] | None = None, *,
    scaling: Scaling | None = None, structure: str = "pi", conditions: Conditions | None = None,
    specification: ZoneSpecification | None = None, sample_time_s: float | None = None,
) -> JointProof:
    """Tune all zones together and prove them; the first design that passes, else the one that comes nearest.

    Zones that the specification wants decoupled are so where that passes and moves the neighbours less; the remarks of
    the proof say whether they are.

    Args:
        fitted: the network, see `heatertune.zones.fit_network` and `network_by_hand`.
        target: the controller of all zones.
        setpoints_degC: one for all zones or one for each; None: the last logged ones [°C].
        scaling: sensor range; None: 0…100 °C.
        structure: "pi" or "pid".
        conditions: PWM, limits, accepted findings and known open points; None: the defaults.
        specification: what the zones must keep; None: that of `conditions` at the setpoints.
        sample_time_s: common interval of the controllers; None: found with the design [s].

    Raises:
        InputError: no setpoint is known, no design is robust for all plausible networks, or zones of that target
            cannot be decoupled.
        OutOfRange, UnknownName, NotRepresentable: as `JointTuner` and `actuator_for`.
    """
    assumptions = conditions or Conditions()
    spec = specification or specification_for(fitted, setpoints_degC, assumptions)
    is_broken = partial(_never_moves, tolerance_degC=spec.limits.tolerance_degC, stated=assumptions.switches)
    at_interval = partial(JointTuner, fitted, target, scaling=scaling, structure=structure)
    prove = partial(prove_zones, fitted=fitted, specification=replace(spec, spread_degC=None), conditions=assumptions)
    best = _tuned(at_interval, prove, is_broken, sample_time_s)
    if best is None:
        raise InputError(f"no {structure} of {target} keeps Ms {JOINT_MS:g} on all plausible networks: log longer "
                         "steps of each zone's power, which narrows the intervals")
    prove = partial(prove, specification=spec)
    if spec.spread_degC is not None or (best.verdict == "FAIL" and _keeps_all_but(_OF_RAMPS, best)):
        best = _start_together(best, prove)
    tuner = partial(at_interval, sample_time_s=best.words[0].sample_time_s)
    return _decoupled(best, tuner(), prove) if spec.decouple else best


def _decoupled(plain: JointProof, tuner: JointTuner, prove: Callable[..., JointProof]) -> JointProof:
    """Return the proof of decoupled zones that move their neighbours less than without, else the one without.

    Args:
        plain: of the design without decoupling.
        tuner: at its interval.
        prove: proves a design.
    """
    if decoupling_for(plain.fitted, plain.specification.setpoints_degC, 1.0) is None:
        return replace(plain, remarks=("not decoupled: the log shows no exchange of heat between zones",))
    before_degC, best = plain.neighbour_deviation_degC, _best_decoupled(plain, tuner, prove)
    if best is None:
        reason = "no share of the static gains is robust on all plausible networks"
    elif best.verdict == "FAIL":
        broken = max(best.criteria, key=lambda criterion: criterion.share)
        reason = f"with it, {broken.name} would be {broken.value:.3g}, limit {broken.limit:.3g} ({broken.where})"
    elif plain.verdict == "FAIL" or best.neighbour_deviation_degC < before_degC:
        return replace(best, remarks=(_gain(best, plain.verdict, before_degC),))
    else:
        reason = (f"with it, the neighbours would deviate by {best.neighbour_deviation_degC:.3g} °C, without by "
                  f"{before_degC:.3g} °C")
    return replace(plain, remarks=(f"not decoupled: {reason}",))


def _best_decoupled(plain: JointProof, tuner: JointTuner, prove: Callable[..., JointProof]) -> JointProof | None:
    """Return the proof of decoupled zones that comes nearest; None where none is robust. Arguments as `_decoupled`.

    Of those that pass, that of the fastest controllers whose neighbours deviate little more than those of the best.
    """
    proofs = [prove(design.with_ramp(plain.words[0].ramp), up_to_failure=True)
              for design in islice(_decoupled_designs(plain, tuner), _CANDIDATES)]
    kept = [proof for proof in proofs if proof.verdict != "FAIL"]
    if kept:
        most_degC = _ALMOST * min(proof.neighbour_deviation_degC for proof in kept)
        return next(proof for proof in kept if proof.neighbour_deviation_degC <= most_degC)
    nearest = min(proofs, key=_worst_share, default=None)
    if nearest is not None and _keeps_all_but(_OF_RAMPS, nearest):
        return _start_together(nearest, prove)
    return nearest


def _decoupled_designs(plain: JointProof, tuner: JointTuner) -> Iterator[JointDesign]:
    """Yield decoupled designs of the same words and of slower ones, each with its largest robust share."""
    setpoints, own = plain.specification.setpoints_degC, plain.design.ms_zones
    slower = [(ms,) * len(own) for ms in MS_LADDER if plain.verdict == "FAIL" or ms < min(own)]
    for ms_zones in dict.fromkeys([own, *slower]):
        designs = (tuner.design_for(ms_zones, decoupling_for(plain.fitted, setpoints, share)) for share in _SHARES)
        yield from islice((design for design in designs if design.is_robust), 1)


def _gain(proof: JointProof, verdict: str, before_degC: float) -> str:
    """Return what decoupling does for the zones, a line."""
    share = 1.0 if proof.design.decoupling is None else proof.design.decoupling.share
    return (f"decoupled: the program of each zone adds power for its neighbours' temperatures, {100.0 * share:.0f} % "
            f"of the static gains; the neighbours deviate by up to {proof.neighbour_deviation_degC:.3g} °C, without "
            f"decoupling by {before_degC:.3g} °C{', and the verdict would be FAIL' if verdict == 'FAIL' else ''}")


def _start_together(proof: JointProof, prove: Callable[..., JointProof]) -> JointProof:
    """Return the proof of a design with the fastest setpoint ramp with which the zones keep together, or without one.

    Where no ramp does it, the proof comes back that breaks nothing else and comes nearest: its spread can be allowed.

    Args:
        proof: of a design without setpoint ramp, whose spread was not limited.
        prove: proves a design with the limit, if there is one.
    """
    plain = prove(proof.design)
    if plain.verdict != "FAIL" or not _keeps_all_but(_OF_RAMPS, plain):
        return plain
    ramped = [plain.design.with_ramp(ramp) for ramp in _ramps(plain)]
    for design in ramped:
        candidate = prove(design, up_to_failure=True)
        if candidate.verdict != "FAIL":
            return candidate
    whole = [plain, *map(prove, ramped)]
    return min(filter(partial(_keeps_all_but, (SPREAD_NAME,)), whole), key=_worst_share, default=plain)


def _keeps_all_but(names: Sequence[str], proof: JointProof) -> bool:
    return all(each.ok or each.name in names for each in proof.criteria)


def _ramps(proof: JointProof) -> Iterator[Ramp]:
    """Yield setpoint ramps, the first as fast as the slowest zone rises near its setpoint with full power."""
    words, network = proof.words[0], proof.fitted.network
    controller = controller_for(words.target)
    spare_pct = 100.0 - RESERVE_PCT - network.holding_pct(proof.specification.setpoints_degC)
    per_s = float(np.min(spare_pct * np.array(network.gains_degC_per_pct) / np.array(network.time_constants_s)))
    for pace in _PACES if controller.has_ramp and per_s > 0.0 else ():
        with suppress(OutOfRange):  # slower than the controller's words can be
            yield controller.ramp(words, 60.0 * pace * per_s)


def _tuned(
    at_interval: Callable[..., JointTuner], prove: Callable[..., JointProof], is_broken: Callable[[Words], bool],
    sample_time_s: float | None,
) -> JointProof | None:
    """Return the proof of the first design that passes, else of that which comes nearest; None where none is robust."""
    proofs = _proofs_of(at_interval(sample_time_s=sample_time_s), prove, is_broken)
    if not proofs:
        return None
    words = proofs[0].words[0]
    for factor in _LONGER if sample_time_s is None else ():
        if proofs[-1].verdict != "FAIL" or _needs_more_power(proofs[-1]):
            break
        longer_s = controller_for(words.target).timer.round(factor * words.sample_time_s)
        proofs += _proofs_of(
            at_interval(sample_time_s=longer_s), partial(prove, first=proofs[-1].runs[-1]), is_broken)
    best = proofs[-1] if proofs[-1].verdict != "FAIL" else min(proofs, key=_worst_share)
    return best if best.verdict != "FAIL" else prove(best.design)


def _never_moves(words: Words, *, tolerance_degC: float, stated: Mapping[str, str]) -> bool:
    """Return whether a controller of whole numbers leaves errors many times the tolerance, whatever the others do."""
    return any(residual_error_degC(words, setting) > _MANY * tolerance_degC
               for setting in settings_to_prove(controller_for(words.target).switches, stated))


def _proofs_of(
    tuner: JointTuner, prove: Callable[..., JointProof], is_broken: Callable[[Words], bool]
) -> list[JointProof]:
    """Return the proofs of designs at one interval, each up to its failure; the last one passes, or none does."""
    proofs, broken = list[JointProof](), list[float]()
    for design in islice(tuner.designs(is_broken), _ATTEMPTS):
        if isinstance(design, float):
            broken.append(design)
            continue
        proofs.append(prove(design, up_to_failure=True))
        if proofs[-1].verdict != "FAIL" or _needs_more_power(proofs[-1]):
            return proofs
    if not proofs:
        whole = (tuner.design_for((ms,) * len(tuner.models)) for ms in broken)
        return [prove(design, up_to_failure=True) for design in islice((each for each in whole if each.is_robust), 1)]
    proof = min(proofs, key=_worst_share, default=None)
    for _ in range(_ATTEMPTS):  # all zones alike did not help: that alone which moves the others
        cause = -1 if proof is None else max(proof.criteria, key=lambda criterion: criterion.share).cause
        slower = None if proof is None or cause < 0 else tuner.slower(proof.design, cause)
        if slower is None:
            break
        proofs.append(proof := prove(slower, up_to_failure=True))
        if proof.verdict != "FAIL":
            break
    return proofs


def _needs_more_power(proof: JointProof) -> bool:
    """Return whether the setpoints cannot be held, which no tuning mends."""
    return any(each.name in HOLDING_POWERS and not each.ok for each in proof.criteria)


def _worst_share(proof: JointProof) -> float:
    return max(each.share for each in proof.criteria)
