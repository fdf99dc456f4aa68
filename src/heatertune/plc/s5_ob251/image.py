"""The controller DB as the CPU holds it: 49 words, 98 bytes, high byte first."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.s5_ob251.step import NO_Z
from heatertune.plc.s5_ob251.words import FACTOR, FIELDS, GAIN_WITH_D
from heatertune.plc.words import Words

__all__ = ["LENGTH", "PLACES", "from_cells", "from_image", "oddities", "to_image"]

#: data words DW0 to DW48; with fewer the CPU stops with TRAF (manual, section 11.2.3)
LENGTH: Final = 49

#: word → number of its data word
PLACES: Final = {field.name: int(field.address[2:]) for field in FIELDS}
_USER_BITS: Final = 0x00FF  # DL11 belongs to the operating system
_SIGN: Final = 0x8000
_COARSE: Final = 0.05


def to_image(words: Words) -> bytes:
    """Return the 98 bytes of the DB; cells that are not words of the user are 0."""
    cells = [0] * LENGTH
    for name, place in PLACES.items():
        cells[place] = words.whole[name] & 0xFFFF
    return struct.pack(f">{LENGTH}H", *cells)


def from_image(image: bytes, _sample_time_s: float, source: str) -> dict[str, int]:
    """Return the values in a DB of at least 98 bytes; more words than 49 are allowed and not looked at.

    Raises:
        InputError: fewer than 98 bytes, or half a word.
    """
    if len(image) < 2 * LENGTH or len(image) % 2:
        raise InputError(f"{source}: {len(image)} bytes; expected {2 * LENGTH} (49 words) or more, in whole words")
    return from_cells(struct.unpack(f">{LENGTH}H", image[: 2 * LENGTH]))


def from_cells(cells: Sequence[int]) -> dict[str, int]:
    """Return the values in the data words, which are 0…65535."""
    values = {name: (cells[place] ^ _SIGN) - _SIGN for name, place in PLACES.items()}
    values["STEU"] &= _USER_BITS
    return values


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a controller's words, one sentence each."""
    v = words.whole
    odd = []
    if v["TI"] == 0:
        odd.append("TI is 0: the controller has no integral action.")
    elif 0.5 / v["TI"] > _COARSE:
        odd.append(f"TI is {v['TI']}: half a word is {50.0 / v['TI']:.0f} % of TN; a slower TA makes it finer.")
    odd += [*_about_r(v), *_about_k(v)]
    if v["BGOG"] <= v["BGUG"]:
        odd.append("BGOG is not above BGUG: the output cannot move.")
    for bit, meaning in _UNUSUAL:
        if bool(v["STEU"] & bit) != (bit in (1, 32)):
            odd.append(meaning)
    return tuple(odd)


def _about_r(v: Mapping[str, int]) -> Iterator[str]:
    if v["R"] == 0:
        yield "R is 0: the controller has no proportional action."
    elif v["R"] < 0 and (v["TI"] or v["TD"]):
        yield f"R is {v['R']}: the proportional part acts against the others."
    elif v["R"] != FACTOR:
        yield f"R is {v['R']}, not {FACTOR}: the proportional part is K·R; TN and TV change with R."
    if v["R"] == 0 and v["K"] and v["TI"] and not v["TD"]:
        yield f"I alone: K·TI is {v['K'] * v['TI'] / FACTOR**2:.4g} units per unit of XW and call."


def _about_k(v: Mapping[str, int]) -> Iterator[str]:
    if v["K"] == 0:
        yield "K is 0: the output moves by Z alone." if not v["STEU"] & NO_Z else "K is 0: the output never moves."
    elif v["K"] < 0:
        yield f"K is {v['K']}: the output falls where the temperature is too low, as for a cooler."
    if v["TD"] and abs(v["K"]) > GAIN_WITH_D:
        yield f"K is {v['K']} with a derivative part: the manual allows ±{GAIN_WITH_D} where XW can jump."


#: bits of STEU that differ from plain automatic, position, no feed-forward (33)
_UNUSUAL: Final = (
    (1, "STEU bit 0 is 0: the controller is in manual mode."),
    (2, "STEU bit 1 is 1: the derivative part acts on XZ."),
    (4, "STEU bit 2 is 1: the controller is switched off and its state cleared at each call."),
    (8, "STEU bit 3 is 1: the output is an increment (velocity algorithm), not a position."),
    (32, "STEU bit 5 is 0: the disturbance variable Z is added to the output."),
)
