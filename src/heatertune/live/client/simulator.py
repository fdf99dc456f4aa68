"""What a simulated PLC says of itself to a client that asks for it."""

from __future__ import annotations

from heatertune.errors import PlcRefused
from heatertune.live.client.client import Client
from heatertune.live.memory import OWN, OWN_LENGTH, SimulatorStatus

__all__ = ["told_by"]


def told_by(client: Client) -> SimulatorStatus | None:
    """Return what the simulator's own block says; None: this is no simulator.

    Raises:
        LinkError: no answer.
    """
    try:
        told = SimulatorStatus(client.read(OWN, 0, OWN_LENGTH))
    except PlcRefused:
        return None
    return told if told.marked else None
