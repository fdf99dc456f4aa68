"""Where the blocks of several zones are in one PLC: at equal distances, as the exported programs have them.

The block of the first zone is at its controller's own number; each further zone has the number `BLOCKS_APART` higher
or, over Modbus, registers `REGISTERS_APART` higher. Their temperatures, powers and setpoints are read within one scan.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from heatertune.errors import InputError
from heatertune.live.block_memory import BlockSignal, RegisterRange
from heatertune.live.client.connection import Address, Client, address_of
from heatertune.live.controller_block import ROLES, SERVED, Places, ServedBlock, block_for
from heatertune.live.poller import Poller
from heatertune.plc import Words, controller_for
from heatertune.zones.zones_folder import ZonesDesign, read_zones_design

__all__ = [
    "BLOCKS_APART", "REGISTERS_APART", "SPOKEN", "ZonesPlaces", "ZonesPoller", "demand_served", "zone_addresses",
    "zone_registers", "zones_places",
]

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
    """Return the registers of a zone.

    Raises:
        InputError: its block is longer than the distance between two zones.
    """
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
    _demand_reached(address, blocks[0])
    if numbers and len(numbers) != len(blocks):
        raise InputError(f"--zone-blocks: {len(numbers)} numbers for {len(blocks)} zones")
    if len(set(numbers)) < len(numbers):
        raise InputError("--zone-blocks: expected another number for each zone")
    own, apart = (blocks[0].number, BLOCKS_APART) if address.protocol == "s7" else (0, REGISTERS_APART)
    first = own if address.block is None else address.block
    return [_at(address, place) for place in numbers or range(first, first + apart * len(blocks), apart)]


def _demand_reached(address: Address, block: ServedBlock) -> None:
    """Refuse an address over which zones are not reached; raise InputError."""
    reached = [name for name in SPOKEN if name in block.speaks]
    if address.protocol not in reached:
        raise InputError(f"{address.text}: zones are reached over {' or '.join(reached)}, not over {address.protocol}")
    if address.by_tsap:
        raise InputError(f"{address.text}: zones are reached by rack and slot, not by TSAPs")


def _at(address: Address, place: int) -> Address:
    """Return the address of a block of the same PLC."""
    if address.protocol == "s7":
        text = f"s7://{_host(address)}:{address.port}/{address.way[0]}/{address.way[1]}/db{place}"
    else:
        text = f"modbus://{_host(address)}:{address.port}/{address.way[0]}/{place}"
    return replace(address_of(text), heartbeat=address.heartbeat)


def _host(address: Address) -> str:
    return f"[{address.host}]" if ":" in address.host else address.host


_NO_COLUMN: Final = re.compile(r'[,;"\t\r\n#]')


@dataclass(frozen=True, slots=True, kw_only=True)
class ZonesPlaces:
    """Where the zones of one PLC show what is recorded.

    Attributes:
        zones: names.
        addresses: of the block of each zone.
        blocks: what each block shows.
    """

    zones: tuple[str, ...]
    addresses: tuple[Address, ...]
    blocks: tuple[ServedBlock, ...]


def zones_places(
    design: str | Path | ZonesDesign, address: Address, numbers: Sequence[int] = ()
) -> ZonesPlaces:
    """Return where the zones of a design are in a PLC.

    Args:
        design: a folder that `design --zones` wrote, or what `read_zones_design` returns.
        address: of the block of the first zone.
        numbers: as for `heatertune.live.joint.zone_blocks.zone_addresses`.

    Raises:
        InputError: as `demand_served` and `zone_addresses`; a zone whose name no column can bear.
        DocumentError: as `read_zones_design`.
    """
    zones_design = design if isinstance(design, ZonesDesign) else read_zones_design(design)
    for zone in zones_design.zones:
        if (sign := _NO_COLUMN.search(zone)) is not None:
            raise InputError(f"zone {zone!r}: a name with {sign[0]!r} cannot head a column of a log")
    blocks = demand_served(zones_design.words)
    return ZonesPlaces(zones=zones_design.zones, addresses=tuple(zone_addresses(address, blocks, numbers)),
                       blocks=tuple(blocks))


class ZonesPoller(Poller):
    """A connection that looks at all zones; see `Poller`. Quantities are named "ZONE temperature" and so on."""

    def __init__(self, places: ZonesPlaces, timeout_s: float = 2.0) -> None:
        """Connect; errors as `Poller`."""
        self._zones = places
        own = Places(block=places.blocks[0].number, signals=places.blocks[0].signals, summary="the block of a zone")
        super().__init__(places.addresses[0], own, timeout_s)

    @property
    def roles(self) -> Mapping[str, BlockSignal]:
        """What is seen, and where it is in its zone's block."""
        return {f"{zone} {role}": block.signals[role] for zone, block in zip(
            self._zones.zones, self._zones.blocks, strict=True) for role in ROLES if role in block.signals}

    @property
    def whole(self) -> bool:
        """Whether a look is of one scan: as each zone takes a request of its own, the PLC has to count its scans."""
        return super().whole and self.interval_s is not None

    def read_signals(self, client: Client, number: int) -> tuple[dict[str, float], bytes]:
        """Return the quantities of all zones as they are now, and the bytes that were read; errors as `Client.read`."""
        signals, contents = dict[str, float](), b""
        begin, count = self._places.span
        for zone, address, block in zip(self._zones.zones, self._zones.addresses, self._zones.blocks, strict=True):
            is_block = address.protocol == "s7"
            shift = 0 if is_block else 2 * ((address.block or 0) - (self._zones.addresses[0].block or 0))
            content = client.read((address.block or 0) if is_block else number, begin + shift, count)
            signals |= {f"{zone} {role}": block.signals[role].of(content, begin)
                        for role in ROLES if role in block.signals}
            contents += content
        return signals, contents
