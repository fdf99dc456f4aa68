"""The networks that lead a setpoint word along a ramp."""

from __future__ import annotations

from heatertune.plc.cpu.s7_200.assembler import Network
from heatertune.plc.ramp import Number, Ramp

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


def ramp_moves(ramp: Ramp, asked: str, reading: str, word: str, countdown: str) -> list[Network]:
    """Return the networks of each call; AC0 to AC3 are used.

    What is left to the setpoint asked for is limited to a step, and to nothing between the steps; what is between
    setpoint and reading is limited to the holdback, which is below zero for a cooler. Setpoint and readings are not
    negative: no difference overflows. Comparisons are >= and <=, which a CPU 21x has, too: equal numbers come out the
    same.

    Args:
        ramp: of the setpoint.
        asked: word of the setpoint asked for.
        reading: word of the reading.
        word: of the setpoint on its way.
        countdown: word of the calls to the next step.
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
        Network("not more than a step up", ["LDW>= AC0, AC1", "MOVW AC1, AC0"]),
        Network("not more than a step down", ["LDW<= AC0, AC2", "MOVW AC2, AC0"]),
        *([] if ramp.hold is None else _not_far_down(ramp.hold, reading, word)),
        Network("move the setpoint", ["LD SM0.0", f"+I AC0, {word}"]),
        *([] if ramp.hold is None else _not_far_up(ramp.hold, reading, word)),
    ]


def _not_far_down(hold: Number, reading: str, word: str) -> list[Network]:
    below, up, down = ("above", "down", "up") if hold < 0 else ("below", "up", "down")
    more, less = ("<=", ">=") if hold < 0 else (">=", "<=")
    return [
        Network(f"holdback: what is left to the process variable and so much {below} it, which is no way {up}", [
            "LD SM0.0", f"MOVW {reading}, AC3", f"-I {word}, AC3", f"-I {hold:+d}, AC3",
        ]),
        Network(f"never {up}", [f"LDW{more} AC3, +0", "MOVW +0, AC3"]),
        Network(f"not farther {down}", [f"LDW{less} AC0, AC3", "MOVW AC3, AC0"]),
    ]


def _not_far_up(hold: Number, reading: str, word: str) -> list[Network]:
    above, more = ("below", "<=") if hold < 0 else ("above", ">=")
    return [
        Network(f"holdback: how far the setpoint is {above} the process variable", [
            "LD SM0.0", f"MOVW {word}, AC0", f"-I {reading}, AC0",
        ]),
        Network("not farther", [f"LDW{more} AC0, {hold:+d}", f"MOVW {reading}, {word}", f"+I {hold:+d}, {word}"]),
    ]
