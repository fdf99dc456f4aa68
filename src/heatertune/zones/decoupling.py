"""Static decoupling: each zone's controller is told how far its neighbours are from their setpoints.

Of zone i, T_i·dy_i/dt = a_i + K_i·u_i − y_i + Σ_j c_ij·(y_j − y_i): power of −c_ij/K_i percent for each degree by which
zone j is warmer takes back what zone j gives. So the program adds to the controller's output

    −share · Σ_j c_ij / K_i · (y_j − r_j),   r_j: the setpoint of zone j that was proven

in REALs, y_j and r_j in units of the reading, y_j of the same scan as the zone's own reading, whatever the order of
the calls. At rest nothing is added. It is the neighbours' temperature that is fed, not their output: an output says
nothing of a heater that is open, stuck, off or in manual, and static gains of outputs act before the heat has arrived.
A neighbour whose sensor is broken adds nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.plc import controller_for
from heatertune.plc.single_precision import single
from heatertune.plc.words import Words
from heatertune.zones.identify import FittedNetwork
from heatertune.zones.joint_kernel import DecouplingArrays

__all__ = ["WRITTEN", "Decoupling", "decoupling_arrays", "decoupling_for", "demand_input",
           "demand_one_sensor", "neighbours_in"]

#: target whose exported program decouples zones → words of its block that the program then writes at each call
WRITTEN: Final = {"fb41": ("DISV",), "iec-pid": ("XMIN", "XMAX")}
#: why others do not
_REASONS: Final = {
    "s5-ob251": "its Z takes whole numbers, and the exported listing does not scale the neighbours' readings to them",
    "s7-300": "its block has no input for a disturbance variable, and limits its bias to 0…100 %"}
_NO_INPUT: Final = "its exported program has no input for a disturbance variable, or none that sees the other zones"


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoupling:
    """What the program of each zone adds to its controller's output.

    Attributes:
        share: of what the fitted network's static gains stand for.
        pct_per_degC: power that zone i gets for each degree by which zone j is above its reference, row after row; 0
            where they exchange no heat that the log shows [%/°C].
        references_degC: of each zone [°C].
    """

    share: float
    pct_per_degC: tuple[tuple[float, ...], ...]
    references_degC: tuple[float, ...]

    @property
    def matrix(self) -> Array:
        """`pct_per_degC`, shape (n, n)."""
        return np.array(self.pct_per_degC)


def demand_input(target: str) -> None:
    """Refuse a target whose program cannot decouple zones.

    Raises:
        InputError: it is one.
    """
    if target not in WRITTEN or controller_for(target).core.disturbance_step is None:
        raise InputError(f"--decouple: not for {target}: {_REASONS.get(target, _NO_INPUT)}; leave it out, or take "
                         f"--target {' or '.join(WRITTEN)}")


def demand_one_sensor(words: Sequence[Words]) -> None:
    """Refuse words that cannot be those of decoupled zones.

    Args:
        words: of each zone.

    Raises:
        InputError: several sensor ranges, or as `demand_input`.
    """
    demand_input(words[0].target)
    if len({each.scaling for each in words}) > 1:
        raise InputError("decoupled zones: all of them need the same sensor range")


def decoupling_for(fitted: FittedNetwork, setpoints_degC: Sequence[float], share: float) -> Decoupling | None:
    """Return the decoupling of zones by the best fit; None where the log shows no exchange of heat.

    Args:
        fitted: the network and what of it the log shows.
        setpoints_degC: of the zones [°C].
        share: of the static gains, above 0 and up to 1.
    """
    network, shown = fitted.network, fitted.couplings
    rows = [tuple(
        -share * float(network.exchange[i, j]) / network.gains_degC_per_pct[i]
        if shown.get(f"{zone}-{other}", False) else 0.0 for j, other in enumerate(network.zones))
        for i, zone in enumerate(network.zones)]
    if not np.any(np.array(rows)):
        return None
    return Decoupling(share=share, pct_per_degC=tuple(rows), references_degC=tuple(map(float, setpoints_degC)))


def decoupling_arrays(decoupling: Decoupling | None, words: Sequence[Words]) -> DecouplingArrays:
    """Return factors and references as the programs hold them; without rows where there is no decoupling.

    Args:
        decoupling: of the zones.
        words: of each zone, all with the same sensor range.
    """
    if decoupling is None:
        return DecouplingArrays(np.zeros((0, 0)), np.zeros(0))
    controller = controller_for(words[0].target)
    sensor = controller.sensor(words[0].scaling)
    references = [controller.measure(words[0], each) for each in decoupling.references_degC]
    unit_degC = sensor.span / sensor.counts if isinstance(references[0], int) else 1.0
    factors = [[single(each * unit_degC) for each in row] for row in decoupling.pct_per_degC]
    return DecouplingArrays(np.array(factors), np.array(references, dtype=np.float64))


def neighbours_in(arrays: DecouplingArrays, zone: int) -> list[tuple[int, float, float]]:
    """Return number, factor and reference of each neighbour that a zone's program looks at, in its order.

    Args:
        arrays: of all zones.
        zone: its number.
    """
    return [(other, float(arrays.factors[zone, other]), float(reference))
            for other, reference in enumerate(arrays.references) if arrays.factors[zone, other] != 0.0]
