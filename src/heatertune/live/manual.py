"""A controller's mode and manual value, taken by a client and given back as they were."""

from __future__ import annotations

import time
from collections.abc import Collection
from contextlib import suppress
from typing import Final

from heatertune.errors import InputError, LinkError
from heatertune.live.blocks import SERVED, Block, block_for
from heatertune.live.client.address import Address
from heatertune.live.client.client import Client, connect
from heatertune.plc import Words, controller_for

__all__ = ["ManualMode"]

#: before each try to give back what stood there; a link that is gone for longer is told
_TRIES_S: Final = (0.0, 0.2, 0.5, 1.0, 2.0, 4.0)


class ManualMode:
    """The cells of a block that put the controller in manual, with a power; they are written in one request.

    Attributes:
        address: of the PLC.
        block: of the controller, as heatertune knows it.
        place: number of the block, first byte of the cells, and how many they are.
    """

    def __init__(self, address: Address, words: Words, timeout_s: float) -> None:
        """Prepare; nothing is asked of the PLC yet.

        Args:
            address: of the PLC.
            words: that it is said to hold.
            timeout_s: after which an answer is lost [s].

        Raises:
            InputError: the controller's block is not known, or has no manual mode.
        """
        if words.target not in SERVED:
            raise InputError(f"the block of {words.target} is not known here: set the powers by hand, and record")
        self.address, self._timeout_s = address, timeout_s
        self.block: Block = block_for(controller_for(words.target), words, {})
        self._image = self.block.image()
        start, put = self.block.by_hand(self._image, 0.0)
        said = address.block if address.protocol == "s7" else None
        self.place = self.block.number if said is None else said, start, len(put)

    def connected(self) -> Client:
        """Return a new connection; errors as `heatertune.live.client.client.connect`."""
        return connect(self.address, self._timeout_s)

    def image(self, client: Client) -> bytes:
        """Return the whole block; errors as `Client.read`."""
        return client.read(self.place[0], 0, len(self._image))

    def cells(self, client: Client) -> bytes:
        """Return what stands in the cells; errors as `Client.read`."""
        return client.read(*self.place)

    def put(self, client: Client, content: bytes) -> None:
        """Write the cells; errors as `Client.write`."""
        client.write(self.place[0], self.place[1], content)

    def by_hand(self, before: bytes, power_pct: float) -> bytes:
        """Return the cells in manual with a power, all else in them as before."""
        return self.block.by_hand(bytes(self._with(before)), power_pct)[1]

    def give_back(self, before: bytes, puts: Collection[bytes]) -> bool | None:
        """Bring back what stood there, where what stands there now is this hand's, or of the PLC's dead man after it.

        Args:
            before: the cells as they were.
            puts: what this hand may have written there.

        Returns:
            Whether it stands there again; False: somebody else has been there, and it was left alone; None: not known.
        """
        own = {before, *puts, *map(self._after_dead_man, puts)}
        for pause_s in _TRIES_S:
            time.sleep(pause_s)
            with suppress(LinkError), self.connected() as client:
                found = self.cells(client)
                if found not in own:
                    return False
                if found != before:
                    self.put(client, before)
                if self.cells(client) == before:
                    return True
        return None

    def _after_dead_man(self, put: bytes) -> bytes:
        image = self._with(put)
        self.block.into_automatic(image)
        _, start, count = self.place
        return bytes(image[start : start + count])

    def _with(self, cells: bytes) -> bytearray:
        image = bytearray(self._image)
        _, start, count = self.place
        image[start : start + count] = cells
        return image
