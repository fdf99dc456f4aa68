"""Where the blocks of several zones are in one PLC: at equal distances, as the exported programs have them.

The block of the first zone is at its controller's own number; each further zone has the number `BLOCKS_APART` higher
or, over Modbus, registers `REGISTERS_APART` higher.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from heatertune.errors import InputError
from heatertune.live.block_memory import RegisterRange
from heatertune.live.client.connection import Address, address_of
from heatertune.live.controller_block import SERVED, ServedBlock, block_for
from heatertune.plc import Words, controller_for

__all__ = ["BLOCKS_APART", "REGISTERS_APART", "SPOKEN", "demand_served", "zone_addresses", "zone_registers"]

#: numbers of blocks from one zone to the next
BLOCKS_APART: Final = 10
#: registers from one zone to the next
REGISTERS_APART: Final = 100
#: protocols over which zones are reached
SPOKEN: Final = ("s7", "modbus")


def demand_served(words: Sequence[Words]) -> list[ServedBlock]:
    """Return the block of each zone as one controller alone has it.

    Raises:
        InputError: the blocks of the target are not known, or are not those of one PLC.
    """
    target = words[0].target
    if target not in SERVED:
        raise InputError(f"zones of {target}: which cells of a PLC hold their words is not known; {', '.join(SERVED)} "
                         "are")
    blocks = [block_for(controller_for(target), each, {}) for each in words]
    if len(blocks[0].registers) > 1:
        raise InputError(f"zones of {target}: each instrument is a device with an address of its own; use the folder "
                         "of each zone")
    return blocks


def zone_registers(block: ServedBlock, zone: int) -> RegisterRange:
    """Return the registers of a zone; errors as `demand_modbus`."""
    length = len(block.image()) // 2
    if length > REGISTERS_APART:
        raise InputError(f"zones over Modbus: a block of {length} registers is longer than the {REGISTERS_APART} of a "
                         "zone; reach it over S7")
    first = block.registers[0].first if block.registers else 0
    return RegisterRange(first + REGISTERS_APART * zone, 0, length)


def zone_addresses(address: Address, blocks: Sequence[ServedBlock], numbers: Sequence[int] = ()) -> list[Address]:
    """Return the address of each zone's block.

    Args:
        address: of the first zone's block, or of the PLC.
        blocks: as `demand_served` returns them.
        numbers: of the data blocks, or first registers, of all zones; empty: at equal distances.

    Raises:
        InputError: a protocol that does not reach zones, or another number of numbers than zones.
    """
    if address.protocol not in SPOKEN or address.protocol not in blocks[0].speaks:
        reached = " or ".join(name for name in SPOKEN if name in blocks[0].speaks)
        raise InputError(f"{address.text}: zones are reached over {reached}, not over {address.protocol}")
    if address.by_tsap:
        raise InputError(f"{address.text}: zones are reached by rack and slot, not by TSAPs")
    if numbers and len(numbers) != len(blocks):
        raise InputError(f"--zone-blocks: {len(numbers)} numbers for {len(blocks)} zones")
    if len(set(numbers)) < len(numbers):
        raise InputError("--zone-blocks: expected another number for each zone")
    is_block = address.protocol == "s7"
    first = address.block
    if is_block and first is None:
        first = blocks[0].number
    apart = BLOCKS_APART if is_block else REGISTERS_APART
    places = list(numbers) or [(first or 0) + apart * zone for zone in range(len(blocks))]
    return [_at(address, place) for place in places]


def _at(address: Address, place: int) -> Address:
    """Return the address of a block of the same PLC."""
    if address.protocol == "s7":
        text = f"s7://{_host(address)}:{address.port}/{address.way[0]}/{address.way[1]}/db{place}"
    else:
        text = f"modbus://{_host(address)}:{address.port}/{address.way[0]}/{place}"
    return replace(address_of(text), heartbeat=address.heartbeat)


def _host(address: Address) -> str:
    return f"[{address.host}]" if ":" in address.host else address.host
