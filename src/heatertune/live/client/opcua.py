"""OPC UA: a block is a variable that holds all its bytes, as a ByteString or as an array of Byte.

A read takes the whole variable, which is one instant. A write names its bytes by an index range (OPC 10000-4, section
7.27): it puts no neighbour's word back that has changed meanwhile. A server that pays no heed to index ranges would
take the few bytes for the whole block, so before the first write it is asked to read one byte: only one that answers
with one byte is written to.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any, Final, TypeVar

from asyncua import Client, ua

from heatertune.errors import LinkDown, ReplyLost
from heatertune.live.client.connection import Address, RequestConnection, SignOfLife, close_by_reset
from heatertune.live.siemens_blocks import TAGS, instance_of
from heatertune.live.simulator_status import OWN

__all__ = ["OpcuaClient", "TagClient", "open_client"]

#: bytes of a block; the protocol sets no limit to a variable
_MOST: Final = 65535
_GOOD: Final = 0
#: what a server says that has not written: the node, its access, its type or the range is not as asked for
_REFUSED: Final = frozenset(getattr(ua.StatusCodes, name) for name in (
    "BadNodeIdInvalid", "BadNodeIdUnknown", "BadAttributeIdInvalid", "BadIndexRangeInvalid", "BadIndexRangeNoData",
    "BadIndexRangeDataMismatch", "BadTypeMismatch", "BadOutOfRange", "BadNotWritable", "BadWriteNotSupported",
    "BadUserAccessDenied"))
#: format of a tag → types in which a server may show it
_TAG_TYPES: Final = {"REAL": ua.VariantType.Float, "INT": ua.VariantType.Int16, "BOOL": ua.VariantType.Boolean}
#: after this share of its life a secure channel is renewed (OPC 10000-4, section 5.5.2)
_RENEWED: Final = 0.75

Answer = TypeVar("Answer")

logging.getLogger("asyncua").addHandler(logging.NullHandler())  # errors tell what happened


class OpcuaClient(RequestConnection):
    """See `heatertune.live.client.connection.Client`."""

    most = _MOST
    whole = True

    def __init__(self, address: Address, library: Any, loop: asyncio.AbstractEventLoop) -> None:
        """Take a client of the library's that is connected, and the loop that it lives in."""
        super().__init__(address)
        self._library, self._loop = library, loop
        self._ranges: dict[int, ua.VariantType] = {}
        self._open_since, self._stamp = time.monotonic(), None

    def sign_of_life(self) -> SignOfLife:
        """Return the source time of the block that was read last, where the server tells one."""
        return SignOfLife(stamp=self._stamp)

    def read(self, number: int, start: int, count: int) -> bytes:
        """Return bytes of a block."""
        what = f"reading {self._node(number)}"

        async def ask() -> bytes:
            value = await self._value(number)
            content, self._stamp = self._content(value, what), value.SourceTimestamp
            if start + count > len(content):
                raise self._refused(f"{what}, bytes {start} to {start + count}", f"it has {len(content)} bytes")
            return content[start : start + count]

        return self._run(ask, what)

    def write(self, number: int, start: int, content: bytes) -> None:
        """Write bytes of a block.

        Raises:
            LinkDown: it was not sent, as what is asked before it had no answer.
        """
        span = f"{start}" if len(content) == 1 else f"{start}:{start + len(content) - 1}"
        what = f"writing {self._node(number)}, bytes {span}"
        try:
            kind = self._ranged(number, what)
        except ReplyLost as problem:
            raise LinkDown(f"{problem}, which was to be asked before {what}") from None

        async def ask() -> None:
            value = ua.Variant(content if kind == ua.VariantType.ByteString else list(content), kind)
            write_value = ua.WriteValue(ua.NodeId.from_string(self._node(number)), ua.AttributeIds.Value, span,
                                        ua.DataValue(value))
            await self._send(write_value, what)

        self._run(ask, what)

    async def _send(self, wanted: ua.WriteValue, what: str) -> None:
        """Write one value."""
        status, = await self._library.uaclient.session.write(ua.WriteParameters([wanted]))
        if status.value in _REFUSED:
            raise self._refused(what, f"{status.name}, {status.doc}")
        if status.value != _GOOD:
            raise ConnectionError(f"{status.name}, {status.doc}")

    def _node(self, number: int) -> str:
        """Return the node of a block; the simulator's own stands beside the controller's."""
        if number != OWN:
            return self._address.node
        return f"{self._address.node.partition(';')[0]};s=DB{OWN}"

    async def _value(self, number: int, index_range: str | None = None) -> ua.DataValue:
        node = ua.ReadValueId(ua.NodeId.from_string(self._node(number)), ua.AttributeIds.Value, index_range)
        value, = await self._library.uaclient.session.read(ua.ReadParameters(
            TimestampsToReturn=ua.TimestampsToReturn.Source, NodesToRead=[node]))
        return value

    def _content(self, data_value: ua.DataValue, what: str) -> bytes:
        """Return the bytes of a value."""
        if data_value.StatusCode.value != _GOOD:
            raise self._refused(what, f"{data_value.StatusCode.name}, {data_value.StatusCode.doc}")
        value = data_value.Value
        if value is None or value.VariantType not in (ua.VariantType.ByteString, ua.VariantType.Byte):
            kind = "nothing" if value is None else value.VariantType.name
            raise self._refused(what, f"it holds {kind}, not a ByteString or an array of Byte")
        return bytes(value.Value or b"")

    def _ranged(self, number: int, what: str) -> ua.VariantType:
        """Return the type of a block's variable; refuse where its server pays no heed to index ranges."""

        async def ask() -> ua.VariantType:
            value = await self._value(number, "0")
            if len(self._content(value, what)) != 1:
                raise self._refused(what, "the server pays no heed to index ranges: it would write the whole block")
            return value.Value.VariantType

        if number not in self._ranges:
            self._ranges[number] = self._run(ask, f"reading byte 0 of {self._node(number)}")
        return self._ranges[number]

    def _run(self, ask: Callable[[], Awaitable[Answer]], what: str) -> Answer:
        """Return the answer to a request, in a channel that is young enough."""

        async def renewed() -> Answer:
            if time.monotonic() - self._open_since > _RENEWED * self._library.secure_channel_timeout / 1000.0:
                await self._library.open_secure_channel(renew=True)
                self._open_since = time.monotonic()
            return await ask()

        return self._answer_to(lambda: self._loop.run_until_complete(renewed()), what)

    def _close(self) -> None:
        _end(self._library, self._loop)


class TagClient(OpcuaClient):
    """A client of an instance whose members are nodes of their own; see `heatertune.live.siemens_blocks`.

    It reads and writes them as the bytes of the block that other protocols find. A read is one request, which a server
    may answer from two scans; a write of one tag is whole.
    """

    whole = False

    def read(self, number: int, start: int, count: int) -> bytes:
        """Return bytes of the block that the tags make."""
        if number == OWN:
            return super().read(number, start, count)
        tags = [tag for tag, place in TAGS.items() if place.part.start < start + count and place.part.stop > start]

        async def ask() -> bytes:
            nodes = [ua.ReadValueId(self._tag(tag), ua.AttributeIds.Value) for tag in tags]
            values = await self._library.uaclient.session.read(ua.ReadParameters(
                TimestampsToReturn=ua.TimestampsToReturn.Source, NodesToRead=nodes))
            cells = bytearray(max(place.part.stop for place in TAGS.values()) + 1)
            for tag, value in zip(tags, values, strict=True):
                TAGS[tag].write(cells, self._number(value, tag))
            stamps = [value.SourceTimestamp for value in values if value.SourceTimestamp is not None]
            self._stamp = max(stamps, default=None)
            return bytes(cells[start : start + count])

        return self._run(ask, f"reading {len(tags)} tags of {instance_of(self._address.node)}")

    def _number(self, value: ua.DataValue, tag: str) -> Any:
        what, kind = f"reading {instance_of(self._address.node)}.{tag}", _TAG_TYPES[TAGS[tag].format]
        if value.StatusCode.value != _GOOD:
            raise self._refused(what, f"{value.StatusCode.name}, {value.StatusCode.doc}")
        if value.Value is None or value.Value.VariantType != kind or value.Value.is_array:
            kind_name = "nothing" if value.Value is None else value.Value.VariantType.name
            raise self._refused(what, f"it is {kind_name}, not {kind.name}")
        return value.Value.Value

    def write(self, number: int, start: int, content: bytes) -> None:
        """Write one tag, the bytes of which these are.

        Raises:
            LinkDown: it was not sent.
        """
        tag = next((tag for tag, place in TAGS.items() if number != OWN and place.format != "BOOL"
                    and place.part == slice(start, start + len(content))), None)
        if tag is None:
            raise self._refused(f"writing bytes {start} to {start + len(content)} of block {number}",
                                "these are not one tag")
        place = TAGS[tag]
        value = place.read(bytes(start) + content)

        async def ask() -> None:
            write_value = ua.WriteValue(self._tag(tag), ua.AttributeIds.Value, None,
                                        ua.DataValue(ua.Variant(value, _TAG_TYPES[place.format])))
            await self._send(write_value, what)

        what = f"writing {instance_of(self._address.node)}.{tag}"
        self._run(ask, what)

    def _tag(self, tag: str) -> ua.NodeId:
        return ua.NodeId.from_string(f"{instance_of(self._address.node)}.{tag}")

    def _node(self, number: int) -> str:
        """Return the node of the simulator's own block, which stands in the namespace of its blocks."""
        return f"ns=2;s=DB{number}"


def open_client(address: Address, timeout_s: float) -> OpcuaClient:
    """Return a client that is connected, without encryption and as nobody.

    Raises:
        LinkDown: nobody is there, or one who wants encryption or a name.
    """
    loop = asyncio.new_event_loop()
    host = f"[{address.host}]" if ":" in address.host else address.host
    url = f"opc.tcp://{host}:{address.port}{address.path}"
    library = Client(url, timeout=timeout_s)
    try:
        loop.run_until_complete(_opened(library))
    except Exception as problem:  # whatever the library raises
        _end(library, loop)
        why = str(problem) or type(problem).__name__
        raise LinkDown(f"{address.text}: no OPC UA connection to {url}: {why}") from None
    return (TagClient if instance_of(address.node) else OpcuaClient)(address, library, loop)


async def _opened(library: Any) -> None:
    """Open a session, without what the library does by itself in the background: each request is one of ours."""
    await library.connect_socket()
    close_by_reset(library.uaclient.protocol.transport.get_extra_info("socket"))
    await library.send_hello()
    await library.open_secure_channel()
    await library.create_session()
    await library.activate_session()


def _end(library: Any, loop: asyncio.AbstractEventLoop) -> None:
    """Close socket and loop; a session that is told nothing ends by itself.

    What the library has not sent yet is discarded: an orderly end would still send it.
    """

    async def ended() -> None:
        protocol = library.uaclient.protocol
        if protocol is not None and protocol.transport is not None:
            protocol.transport.abort()
        library.disconnect_socket()
        rest = asyncio.all_tasks() - {asyncio.current_task()}
        for task in rest:
            task.cancel()
        await asyncio.gather(*rest, return_exceptions=True)
        await asyncio.sleep(0)  # in which the socket is closed

    with suppress(Exception):
        loop.run_until_complete(ended())
    loop.close()
