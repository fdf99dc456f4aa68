"""The design of all zones together: intervals, robust controllers at each of them, and the first that passes.

A controller of whole numbers may need a longer interval: its integral part moves by whole increments only, and an error
whose increment is below one of them stays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import islice
from typing import Final

from heatertune.errors import InputError
from heatertune.plc import Scaling, controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.words import Words
from heatertune.settings import Conditions
from heatertune.zones.identify import FittedNetwork
from heatertune.zones.joint_loop import residual_error_degC
from heatertune.zones.joint_proof import HOLDING_POWERS, JointProof, ZoneSpecification, prove_zones, specification_for
from heatertune.zones.joint_tuning import JOINT_MS, JointTuner

__all__ = ["design_zones"]

_ATTEMPTS: Final = 5  # designs that are proven, each detuned further, in all zones and then in one
_MANY: Final = 10.0  # times the tolerance that an error at rest has to be to spare the other zones' tuning
_LONGER: Final = (2.0, 4.0, 3.0)  # intervals that are tried beyond the first, as multiples of it


def design_zones(
    fitted: FittedNetwork, target: str, setpoints_degC: float | Sequence[float] | None = None, *,
    scaling: Scaling | None = None, structure: str = "pi", conditions: Conditions | None = None,
    specification: ZoneSpecification | None = None, sample_time_s: float | None = None,
) -> JointProof:
    """Tune all zones together and prove them; the first design that passes, else the one that comes nearest.

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
        InputError: no setpoint is known, or no design is robust for all plausible networks.
        OutOfRange, UnknownName, NotRepresentable: as `JointTuner` and `actuator_for`.
    """
    asked = conditions or Conditions()
    spec = specification or specification_for(fitted, setpoints_degC, asked)
    is_broken = partial(_never_moves, tolerance_degC=spec.limits.tolerance_degC, stated=asked.switches)
    at_interval = partial(JointTuner, fitted, target, scaling=scaling, structure=structure)
    prove = partial(prove_zones, fitted=fitted, specification=spec, conditions=asked)
    proofs = _proofs_of(at_interval(sample_time_s=sample_time_s), prove, is_broken)
    if not proofs:
        raise InputError(f"no {structure} of {target} keeps Ms {JOINT_MS:g} on all plausible networks: log longer "
                         "steps of each zone's power, which narrows the intervals")
    shortest_s = proofs[0].design.designs[0].sample_time_s
    for factor in _LONGER if sample_time_s is None else ():
        if proofs[-1].verdict != "FAIL" or _needs_more_power(proofs[-1]):
            break
        longer_s = controller_for(target).timer.round(factor * shortest_s)
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
