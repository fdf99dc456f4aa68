"""Temperature, power and setpoint of several zones of one PLC, of one scan."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from heatertune.errors import InputError
from heatertune.live.block_memory import BlockSignal
from heatertune.live.client.connection import Address, Client
from heatertune.live.controller_block import ROLES, Places, ServedBlock
from heatertune.live.joint.zone_blocks import demand_served, zone_addresses
from heatertune.live.poller import Poller
from heatertune.zones.zones_folder import ZonesDesign, read_zones_design

__all__ = ["ZonesPlaces", "ZonesPoller", "zones_places"]

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
    known = design if isinstance(design, ZonesDesign) else read_zones_design(design)
    for zone in known.zones:
        if (sign := _NO_COLUMN.search(zone)) is not None:
            raise InputError(f"zone {zone!r}: a name with {sign[0]!r} cannot head a column of a log")
    blocks = demand_served(known.words)
    return ZonesPlaces(zones=known.zones, addresses=tuple(zone_addresses(address, blocks, numbers)),
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
        found, contents = dict[str, float](), b""
        begin, count = self._places.span
        for zone, address, block in zip(self._zones.zones, self._zones.addresses, self._zones.blocks, strict=True):
            is_block = address.protocol == "s7"
            shift = 0 if is_block else 2 * ((address.block or 0) - (self._zones.addresses[0].block or 0))
            content = client.read((address.block or 0) if is_block else number, begin + shift, count)
            found |= {f"{zone} {role}": block.signals[role].of(content, begin)
                      for role in ROLES if role in block.signals}
            contents += content
        return found, contents
