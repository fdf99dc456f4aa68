"""The networks that lead a setpoint word along a ramp."""

from __future__ import annotations

from heatertune.plc.cpu.s7_200.text import Network
from heatertune.plc.ramp import Ramp

__all__ = ["ramp_begins", "ramp_moves"]


def ramp_begins(ramp: Ramp, reading: str, word: str, countdown: str) -> Network:
    """Return the network for the first scan: the ramp begins at the reading.

    Args:
        ramp: step in units of the setpoint word.
        reading: word of the process variable.
        word: the setpoint that the controller follows.
        countdown: word of the calls to go.
    """
    return Network("setpoint ramp begins at the process variable", [
        "LD SM0.0", f"MOVW {reading}, {word}", f"MOVW {ramp.calls:+d}, {countdown}",
    ])


def ramp_moves(ramp: Ramp, asked: str, word: str, countdown: str) -> list[Network]:
    """Return the networks of each call; AC0 to AC2 are used.

    What is left to the setpoint asked for is limited to a step, and to nothing between the steps.
    """
    step = int(ramp.step)
    due = Network("setpoint ramp: no step but every so many calls", [
        "LD SM0.0", "MOVW +0, AC1", "MOVW +0, AC2", f"-I +1, {countdown}",
    ])
    return [
        due,
        Network("a step up or down", [
            f"LDW<= {countdown}, +0", f"MOVW {ramp.calls:+d}, {countdown}", f"MOVW {step:+d}, AC1",
            f"MOVW {-step:+d}, AC2",
        ]),
        Network("what is left to go", ["LD SM0.0", f"MOVW {asked}, AC0", f"-I {word}, AC0"]),
        Network("not more than a step up", ["LDW> AC0, AC1", "MOVW AC1, AC0"]),
        Network("not more than a step down", ["LDW< AC0, AC2", "MOVW AC2, AC0"]),
        Network("move the setpoint", ["LD SM0.0", f"+I AC0, {word}"]),
    ]
