"""Blocks and networks → statement list as STEP 7-Micro/WIN exports it (keywords, TAB before each line, CRLF)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

__all__ = ["Network", "block", "count_ticks", "program", "pwm_registers", "real", "timed_interrupt"]

_KINDS = {"OB": "ORGANIZATION", "SBR": "SUBROUTINE", "INT": "INTERRUPT"}


class Network(NamedTuple):
    """One network: what it does, and its instructions, "MNEMONIC operand, operand"."""

    comment: str
    instructions: Sequence[str]


def block(name: str, title: str, networks: Sequence[Network], head: Sequence[str] = ()) -> list[str]:
    """Return the lines of a block; `head` are comments below its title."""
    area = name.rstrip("0123456789")
    kind, symbol = _KINDS[area], "MAIN" if area == "OB" else f"{area}_{name.removeprefix(area)}"
    lines = [f"{kind}_BLOCK {symbol}:{name}", f"TITLE={title}", *[f"// {line}" for line in head], "BEGIN"]
    for number, network in enumerate(networks, start=1):
        lines.append(f"Network {number} // {network.comment}")
        lines += ["\t" + line.replace(" ", "\t", 1) for line in network.instructions]
    return [*lines, f"END_{kind}_BLOCK"]


def program(*blocks: Sequence[str]) -> str:
    """Return the text of a program; Micro/WIN takes OB1, subroutines and interrupts in this order."""
    return "\r\n".join(line for lines in blocks for line in lines) + "\r\n"


def real(value: float) -> str:
    """Return a REAL constant: the nine digits that tell every single from the next, always with a point or exponent."""
    text = f"{value:.9g}"
    return text if set(text) & set(".e") else f"{text}.0"


def pwm_registers(cycle_ms: int, control: str) -> Network:
    """Return the network that prepares PWM on Q0.0; the first PLS loads cycle time and pulse width.

    Args:
        cycle_ms: PWM cycle [ms].
        control: byte for SMB67 at that.
    """
    loads = [f"MOVB {control}, SMB67", f"MOVW {cycle_ms:+d}, SMW68", "MOVW +0, SMW70"]
    return Network("PWM, ms; cycle time and pulse width are loaded by the first PLS", ["LD SM0.0", *loads])


def timed_interrupt(tick_ms: int) -> Network:
    """Return the network that starts timed interrupt 0."""
    return Network("timed interrupt 0", ["LD SM0.0", f"MOVB {tick_ms}, SMB34", "ATCH INT0, 10", "ENI"])


def count_ticks(word: str, ticks: str) -> list[Network]:
    """Return the networks that leave the interrupt until so many ticks (a constant or a word) are over."""
    return [
        Network("count the ticks of a PWM cycle", ["LD SM0.0", f"-I +1, {word}"]),
        Network("not yet over", [f"LDW>= {word}, +1", "CRETI"]),
        Network("over: count anew", ["LD SM0.0", f"MOVW {ticks}, {word}"]),
    ]
