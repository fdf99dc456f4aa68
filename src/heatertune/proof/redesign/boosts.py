"""Boosts to try: full power far from the setpoint, so that nothing is wound up on the way, nor in an open circuit.

The gains stay, and with them what a disturbance costs; the way to the setpoint takes no longer than at full power. So
where a boost keeps every limit, no other change is cheaper.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from heatertune.plc import Boost, Words, controller_for
from heatertune.plc.single_precision import single
from heatertune.proof.worst_runs import RunScreen
from heatertune.settings import Conditions

__all__ = ["boosts"]

#: of the distance at which the P part alone asks for full power: nearer, the I part has less time to wind up, but more
#: is left to it. The nearest ones, which overshoot sooner, are for an I part that goes on at a limit of the output
_SHARES: Final = ((1.0, 0.7, 0.5, 0.35), (0.25, 0.18, 0.12))
#: between the two distances: of the nearer one; steps of the sensor and standard deviations of its noise, together
_BETWEEN: Final = 0.5
_STEPS: Final = 4.0
_SIGMAS: Final = 6.0


def boosts(words: Words, screen: RunScreen, conditions: Conditions) -> Iterator[Boost]:
    """Yield the boosts with which words keep the limits in runs that were failed, the nearest ones last.

    Of either, that which settles first comes first.

    Args:
        words: without one.
        screen: the runs.
        conditions: of the proof.
    """
    for shares in _SHARES:
        settled = [(settles, boost.within_degC, boost) for boost in _tried(words, conditions, shares)
                   if (settles := screen.settles(words.with_boost(boost), conditions)) is not None]
        yield from (boost for *_, boost in sorted(settled, key=lambda each: each[:2]))


def _tried(words: Words, conditions: Conditions, shares: Sequence[float]) -> Iterator[Boost]:
    controller, span = controller_for(words.target), words.scaling.span_degC
    design = controller.decode(words)
    if design is None:
        return
    least = _STEPS * span / controller.counts + _SIGMAS * abs(conditions.noise_degC)
    for share in shares:
        within = _short(share * controller.most_power_pct(words) / abs(design.gain_pct_per_degC))
        again = _short(within + max(_BETWEEN * within, least))
        if within < again < span:
            yield Boost(within_degC=within, again_degC=again)


def _short(distance_degC: float) -> float:
    """Return a distance in three digits, as a single."""
    return single(float(f"{distance_degC:.3g}"))
