"""A controller's mode and manual value, taken by a client and given back as they were."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from heatertune.errors import InputError, LinkError
from heatertune.live.blocks import SERVED, ServedBlock, block_for
from heatertune.live.client.address import Address
from heatertune.live.client.client import Client, connect
from heatertune.live.plc_state import WayBack, late_left_s
from heatertune.plc import Words, controller_for

__all__ = ["RETRY_S", "ManualMode", "give_back"]

#: so long a dead link is tried again [s]
RETRY_S = 60.0
#: before each look; the last one for all that follow [s]
_PAUSES_S: Final = (0.0, 0.2, 0.5, 1.0, 2.0)


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
            raise InputError(f"the block of {words.target} is not known: set the powers manually, and record")
        self.address, self._timeout_s = address, timeout_s
        self.block: ServedBlock = block_for(controller_for(words.target), words, {})
        self._image = self.block.image()
        start, put = self.block.put_in_manual(self._image, 0.0)
        said = address.block if address.protocol == "s7" else None
        self.place = self.block.number if said is None else said, start, len(put)

    def open_client(self) -> Client:
        """Return a new connection; errors as `heatertune.live.client.client.connect`."""
        return connect(self.address, self._timeout_s)

    def image(self, client: Client) -> bytes:
        """Return the whole block; errors as `Client.read`."""
        return client.read(self.place[0], 0, len(self._image))

    def cells(self, client: Client) -> bytes:
        """Return what stands in the cells; errors as `Client.read`."""
        return client.read(*self.place)

    def write_cells(self, client: Client, content: bytes) -> None:
        """Write the cells; errors as `Client.write`."""
        client.write(self.place[0], self.place[1], content)

    def by_hand(self, before: bytes, power_pct: float) -> bytes:
        """Return the cells in manual with a power, all else in them as before."""
        return self.block.put_in_manual(bytes(self._with(before)), power_pct)[1]

    def give_back(
        self, way_back: WayBack, progress: Callable[[str], object], enough: Callable[[], bool]
    ) -> bool | None:
        """Bring back what stood there; see `give_back`."""
        return give_back(self.address, way_back, self._timeout_s, progress, enough)

    def after_dead_man(self, put: bytes) -> bytes:
        """Return the cells as the PLC's dead man leaves them behind a put."""
        image = self._with(put)
        self.block.into_automatic(image)
        _, start, count = self.place
        return bytes(image[start : start + count])

    def _with(self, cells: bytes) -> bytearray:
        image = bytearray(self._image)
        _, start, count = self.place
        image[start : start + count] = cells
        return image


def give_back(
    address: Address, way_back: WayBack, timeout_s: float, progress: Callable[[str], object] = str,
    enough: Callable[[], bool] = lambda: False,
) -> bool | None:
    """Bring back mode and manual value where what stands there is the experiment's, or of the PLC's dead man after it.

    Each look is made on a connection of its own. Where the latest request of the experiment has no answer, the cells
    are looked at until `heatertune.live.plc_state.LATE_S` after it: a gateway may still pass it on.

    Args:
        address: of the PLC.
        way_back: what stood there.
        timeout_s: after which an answer is lost [s].
        progress: told why this takes long.
        enough: asked between two looks whether somebody wants no more of them.

    Returns:
        Whether what stood there stands there again, read back; False: somebody else has changed it, and it was left
        alone; None: not known.
    """
    begun, number, stands = time.monotonic(), 0, None
    wait_s = late_left_s(way_back.sent_at)
    while True:
        time.sleep(_PAUSES_S[min(number, len(_PAUSES_S) - 1)])
        number += 1
        try:
            found = _brought_back(address, way_back, timeout_s)
        except LinkError:
            found = None
        passed_s = time.monotonic() - begun
        if found is not None and passed_s >= wait_s:
            return found
        if (found is None and passed_s >= max(wait_s, RETRY_S)) or enough():
            return None
        if found != stands or number == 1:
            left_s = (max(wait_s, RETRY_S) if found is None else wait_s) - passed_s
            progress(f"{address.text}: " + (
                f"no answer; trying for {left_s:.0f} s to bring back mode and manual value" if found is None
                else f"looking for {left_s:.0f} s more whether a request without an answer still arrives"))
        stands = found


def _brought_back(address: Address, way_back: WayBack, timeout_s: float) -> bool | None:
    """Look once, and write where it is not as before; as `give_back`.

    Raises:
        LinkError: no answer.
    """
    with connect(address, timeout_s) as client:
        place = way_back.number, way_back.start, len(way_back.before)
        found = client.read(*place)
        if not way_back.owns(found, address.protocol):
            return False
        if found == way_back.before:
            return True
        client.write(way_back.number, way_back.start, way_back.before)
        return True if client.read(*place) == way_back.before else None
