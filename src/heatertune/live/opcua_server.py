"""A virtual PLC over OPC UA, without encryption: each block is one ByteString, and each of its words a node.

A ByteString is read whole, at one instant, and written whole or in part by an index range (OPC 10000-4, section 7.27),
so that a client does not overwrite neighbouring bytes. One read request is of one instant, whatever its nodes; the
words of one write request are written one by one, as OPC UA guarantees no more. The source timestamp is the plant's
time since the start (at rate 100 a hundred times as fast); the server timestamp is the clock's.

A device zone repeats temperature, setpoint and power under the names of OPC 40082-1 (temperature control devices,
section 10) and OPC 40083 (plastics and rubber machinery, sections 22 and 23): the names, not the types.
"""

from __future__ import annotations

import asyncio
import copy
import gc
import logging
import socket
import struct
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any, Final

from asyncua import Server, ua
from asyncua.common.connection import TransportLimits
from asyncua.server.address_space import AttributeService
from asyncua.server.binary_server_asyncio import OPCUAProtocol

from heatertune.errors import OutOfRange
from heatertune.live.block_memory import STRUCTS, Access, BlockMemory, BlockSignal, Refusal
from heatertune.live.controller_block import ServedBlock
from heatertune.live.plc import VirtualPlc
from heatertune.live.siemens_blocks import INSTANCE, NAMESPACE, TAGGED, TAGS
from heatertune.live.simulator_status import OWN, OWN_CELLS
from heatertune.live.thread_server import AsideServer

__all__ = ["NodeVariable", "OpcuaServer", "cells_of", "range_of", "tags_of"]


#: format of `struct` → type of a value
_TYPES: Final = {"B": ua.VariantType.Byte, "h": ua.VariantType.Int16, "H": ua.VariantType.UInt16,
                 "i": ua.VariantType.Int32, "I": ua.VariantType.UInt32, "f": ua.VariantType.Float,
                 "d": ua.VariantType.Double, "4s": ua.VariantType.ByteString}
_WRITTEN: Final = ("released", "heartbeat")  # by clients, of the simulator's own block
#: quantity of `Block.signals` → its name, its unit, and whether clients write it
_ZONE: Final = {
    "temperature": ("DeviceZone.Temperature.ActualValue", "°C", False),
    "setpoint": ("DeviceZone.Temperature.SetValue", "°C", True),
    "power": ("DeviceZone.ActualRegulationRatio", "%", False),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeVariable:
    """A variable: bytes of a block, and what they mean.

    Attributes:
        name: with those of what it stands in before it, dots between them.
        block: number of the block.
        part: its bytes there; None: all that there are.
        type: of its value.
        of: the value that bytes mean.
        to: the bytes of a value; None: clients do not write it. Raises `ua.UaStatusCodeError` where it has none.
        unit, span: of a quantity, and its least and largest value there.
    """

    name: str
    block: int
    part: slice | None
    type: ua.VariantType
    of: Callable[[bytes], Any]
    to: Callable[[Any], bytes] | None
    unit: str = ""
    span: tuple[float, float] = (0.0, 0.0)

    def read(self, memory: BlockMemory, index_range: str | None = None) -> ua.Variant:
        """Return the value, of a ByteString also a part.

        Raises:
            Refusal: the PLC would refuse.
            ua.UaStatusCodeError: an index range that is none.
        """
        with memory.changed:
            part = self.part or slice(0, memory.block_size(self.block))
            if index_range:
                part = self._within(part, index_range)
            content = memory.read(self.block, part.start, part.stop - part.start)
        return ua.Variant(content if index_range else self.of(content), self.type)

    def write(self, memory: BlockMemory, value: ua.Variant | None, index_range: str | None = None) -> None:
        """Write the value, or a part of a ByteString: at once or not at all.

        Raises:
            Refusal: the PLC would refuse.
            ua.UaStatusCodeError: not to be written, another type, another length, or an index range that is none.
        """
        if self.to is None:
            raise ua.uaerrors.BadNotWritable
        if value is None or value.VariantType != self.type or value.is_array or value.Value is None:
            raise ua.uaerrors.BadTypeMismatch
        content = bytes(value.Value) if index_range else self.to(value.Value)
        with memory.changed:
            part = self.part or slice(0, memory.block_size(self.block))
            if index_range:
                part = self._within(part, index_range)
            if len(content) != part.stop - part.start:
                raise ua.uaerrors.BadIndexRangeDataMismatch if index_range else ua.uaerrors.BadOutOfRange
            memory.write(self.block, part.start, content)

    def _within(self, part: slice, index_range: str) -> slice:
        if self.type != ua.VariantType.ByteString:
            raise ua.uaerrors.BadIndexRangeNoData
        first, end = range_of(index_range)
        if part.start + end > part.stop:
            raise ua.uaerrors.BadIndexRangeNoData
        return slice(part.start + first, part.start + end)


def range_of(text: str) -> tuple[int, int]:
    """Return first and end of a numeric range of one dimension (OPC 10000-4, section 7.27).

    Raises:
        ua.UaStatusCodeError: it is none.
    """
    numbers = text.split(":")
    if len(numbers) > 2 or not all(each.isascii() and each.isdigit() for each in numbers):
        raise ua.uaerrors.BadIndexRangeInvalid
    first, last = int(numbers[0]), int(numbers[-1])
    if len(numbers) == 2 and not first < last:
        raise ua.uaerrors.BadIndexRangeInvalid
    return first, last + 1


def cells_of(block: ServedBlock) -> Iterator[NodeVariable]:
    """Yield what clients find: the block, its words, the simulator's own block likewise, and the device zone."""
    for number in (block.number, OWN):
        yield NodeVariable(name=f"DB{number}", block=number, part=None, type=ua.VariantType.ByteString, of=bytes,
                           to=bytes)
    for name, place in block.words.items():
        yield _number(f"DB{block.number}.{name}", block.number, place.start, STRUCTS[place.format], written=True)
    for name, (start, code) in OWN_CELLS.items():
        yield _number(f"DB{OWN}.{name}", OWN, start, code, written=name in _WRITTEN)
    for quantity, (name, unit, written) in _ZONE.items():
        if quantity in block.signals:
            yield _quantity(name, block.number, block.signals[quantity], unit, written=written)


def tags_of(block: ServedBlock, target: str) -> Iterator[NodeVariable]:
    """Yield the members of a PID_Compact's instance by their names, as an S7-1500 shows them."""
    for tag, place in TAGS.items() if target == TAGGED else ():
        name = f"{INSTANCE}.{tag}"
        if place.format == "BOOL":
            yield NodeVariable(name=name, block=block.number, part=place.part, type=ua.VariantType.Boolean, to=None,
                               of=partial(_bit, place.bit))
        else:
            yield _number(name, block.number, place.byte, STRUCTS[place.format], written=True)


def _bit(number: int, content: bytes) -> bool:
    return bool(content[0] >> number & 1)


def _number(name: str, block: int, start: int, code: str, *, written: bool) -> NodeVariable:
    """Return the cell of a number that stands in a block."""
    form = struct.Struct(code)

    def to(value: Any) -> bytes:
        try:
            return form.pack(value)
        except (struct.error, OverflowError):
            raise ua.uaerrors.BadOutOfRange from None

    return NodeVariable(name=name, block=block, part=slice(start, start + form.size), type=_TYPES[code[1:]],
                of=lambda match: form.unpack(match)[0], to=to if written else None)


def _quantity(name: str, block: int, signal: BlockSignal, unit: str, *, written: bool) -> NodeVariable:
    """Return the cell of a quantity that a block shows."""

    def to(value: Any) -> bytes:
        try:
            return signal.bytes_of(value)
        except OutOfRange:
            raise ua.uaerrors.BadOutOfRange from None

    part = slice(signal.start, signal.start + signal.size)
    return NodeVariable(name=name, block=block, part=part, type=ua.VariantType.Double, unit=unit, span=signal.shown,
                of=lambda match: signal.of(match, signal.start), to=to if written else None)


_URI: Final = "urn:heatertune:virtual-plc"
_CODES: Final = {Access.MISSING: ua.StatusCodes.BadNodeIdUnknown, Access.OUTSIDE: ua.StatusCodes.BadIndexRangeNoData,
                 Access.PROTECTED: ua.StatusCodes.BadNotWritable}
_LOOK_S: Final = 0.05  # so often what is subscribed to is looked at
_MOST_S: Final = 2e11  # a date ends with the year 9999
_CHUNKS: Final = 64  # of a message: all nodes are read in a tenth of that
_CONNECTIONS: Final = 100
#: unit → its UNECE code, whose letters are its number (OPC 10000-8, section 5.6.4.3)
_UNITS: Final = {"°C": b"CEL", "%": b"P1"}

logging.getLogger("asyncua").addHandler(logging.NullHandler())  # what a client does wrong is no message of the PLC


class _Attributes(AttributeService):  # type: ignore[misc]
    """The library's service; values of cells come from the memory of the virtual PLC and go there."""

    def __init__(self, space: Any, plc: VirtualPlc) -> None:
        super().__init__(space)
        self.plc, self.cells = plc, dict[ua.NodeId, NodeVariable]()
        self._begun = datetime.now(UTC)

    def value(self, cell: NodeVariable, index_range: str | None = None) -> ua.DataValue:
        """Return the value of a cell, or the reason why it has none."""
        now = datetime.now(UTC)
        try:
            value, status = cell.read(self.plc.memory, index_range), ua.StatusCodes.Good
        except (Refusal, ua.UaStatusCodeError) as refused:
            value, status = None, _code(refused)
        plant = self._begun + timedelta(seconds=min(self.plc.elapsed_s, _MOST_S))
        return ua.DataValue(value, ua.StatusCode(status), SourceTimestamp=plant, ServerTimestamp=now)

    def read(self, params: ua.ReadParameters) -> list[ua.DataValue]:
        with self.plc.memory.changed:
            return [self._read(node) for node in params.NodesToRead]

    def _read(self, wanted: ua.ReadValueId) -> ua.DataValue:
        cell = self.cells.get(wanted.NodeId)
        if cell is None or wanted.AttributeId != ua.AttributeIds.Value:
            value: ua.DataValue = self._aspace.read_attribute_value(wanted.NodeId, wanted.AttributeId)
            return value
        return self.value(cell, wanted.IndexRange)

    async def write(self, params: ua.WriteParameters, user: Any = None) -> list[ua.StatusCode]:
        done = []
        for node in params.NodesToWrite:
            cell = self.cells.get(node.NodeId)
            if cell is None or node.AttributeId != ua.AttributeIds.Value:
                done += await super().write(ua.WriteParameters([node]), user)
                continue
            try:
                cell.write(self.plc.memory, node.Value.Value, node.IndexRange)
                done.append(ua.StatusCode())
            except (Refusal, ua.UaStatusCodeError) as refused:
                done.append(ua.StatusCode(_code(refused)))
        return done


def _code(refused: Refusal | ua.UaStatusCodeError) -> int:
    return int(_CODES[refused.why] if isinstance(refused, Refusal) else refused.code)


class _OpcuaConnection(OPCUAProtocol):  # type: ignore[misc]
    """A connection of the library's, which would keep whatever a client sends until it makes a message."""

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if len(self._buffer) > self.limits.max_recv_buffer and self.transport is not None:
            self.transport.abort()  # larger than any chunk that was agreed: it never makes one

    def connection_lost(self, ex: BaseException | None) -> None:
        super().connection_lost(ex)
        # each task refers to the cancelled frame, and the frame to this: such a cycle would stay for long
        self._task = self._activation_watchdog_task = None

    def pause_writing(self) -> None:
        """Take no more requests of a client that takes no answers."""
        if self.transport is not None:
            self.transport.pause_reading()

    def resume_writing(self) -> None:
        """Take requests again."""
        if self.transport is not None:
            self.transport.resume_reading()


class OpcuaServer(AsideServer):
    """The library's server."""

    def __init__(self, plc: VirtualPlc, listener: socket.socket) -> None:
        """Serve on a socket that listens; return when the address space stands.

        Args:
            plc: to be served.
            listener: on loopback.
        """
        self._plc, self._port = plc, listener.getsockname()[1]
        super().__init__("OPC UA", listener)

    def connections(self, factory: Any) -> Any:
        """Return the factory of each connection's protocol; see `_OpcuaConnection`."""
        own = factory.__self__
        return lambda: _OpcuaConnection(own.iserver, own._policies, own.clients, own.closing_tasks, own.limits)

    @asynccontextmanager
    async def serving(self) -> AsyncIterator[None]:
        """Serve; see `heatertune.live.thread_server.AsideServer`."""
        server, service = await self._made()
        gc.freeze()  # next to 100,000 objects that stay, those of clients that have gone would be collected too rarely
        gc.collect()
        try:
            async with server:
                publishing = asyncio.create_task(_publish(service, server.bserver.closing_tasks))
                yield
                publishing.cancel()
        finally:
            gc.unfreeze()

    async def _made(self) -> tuple[Server, _Attributes]:
        """Return a server with all its nodes."""
        server = Server()
        server.limits = TransportLimits(max_chunk_count=_CHUNKS, max_message_size=_CHUNKS * 65535)
        server.iserver.max_connections = _CONNECTIONS
        server.iserver.attribute_service = service = _Attributes(server.iserver.aspace, self._plc)
        collects = gc.isenabled()
        gc.disable()  # 100,000 objects that all stay: looking for garbage takes half the time
        try:
            await server.init()
        finally:
            if collects:
                gc.enable()
        await server.set_application_uri(_URI)
        server.set_server_name("heatertune simulate")
        server.set_endpoint(f"opc.tcp://127.0.0.1:{self._port}/")
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        server.set_identity_tokens([ua.AnonymousIdentityToken])
        _tell_time(server)
        await _lay_out(server, service)
        return server, service


def _tell_time(server: Server) -> None:
    """Answer with the clock when asked for it; the library's own way writes it each second, and ends a second late."""
    server.disable_clock()
    space, status = server.iserver.aspace, ua.NodeId(ua.ObjectIds.Server_ServerStatus)
    start = datetime.now(UTC)
    value = copy.copy(space.read_attribute_value(status, ua.AttributeIds.Value).Value.Value)
    value.State, value.StartTime = ua.ServerState.Running, start

    def now(node: ua.NodeId, _attribute: ua.AttributeIds) -> ua.DataValue:
        value.CurrentTime = datetime.now(UTC)
        return ua.DataValue(ua.Variant(value if node == status else value.CurrentTime))

    for node in (status, ua.NodeId(ua.ObjectIds.Server_ServerStatus_CurrentTime)):
        space.set_attribute_value_callback(node, ua.AttributeIds.Value, now)


async def _lay_out(server: Server, service: _Attributes) -> None:
    """Add a node for each cell, and objects where they stand in none."""
    block = service.plc.block
    for uri, cells in (("urn:heatertune:blocks", cells_of(block)), (NAMESPACE, tags_of(block, service.plc.target))):
        await _lay_out_in(await server.register_namespace(uri), cells, server, service)


async def _lay_out_in(index: int, cells: Iterator[NodeVariable], server: Server, service: _Attributes) -> None:
    nodes: dict[str, Any] = {"": server.nodes.objects}
    for cell in cells:
        *above, name = cell.name.split(".")
        shown = [each.strip('"') for each in above]
        for depth in range(1, len(above) + 1):
            path, parent = ".".join(above[:depth]), nodes[".".join(above[: depth - 1])]
            if path not in nodes:
                nodes[path] = await parent.add_object(ua.NodeId(path, index), f"{index}:{shown[depth - 1]}")
        where = nodes[".".join(above)], ua.NodeId(cell.name, index), f"{index}:" + name.strip('"')
        nodes[cell.name] = node = await _variable(*where, cell, service)
        service.cells[node.nodeid] = cell
        server.iserver.aspace.set_attribute_value_callback(
            node.nodeid, ua.AttributeIds.Value, lambda _node, _attribute, cell=cell: service.value(cell))


async def _variable(parent: Any, identifier: ua.NodeId, name: str, cell: NodeVariable, service: _Attributes) -> Any:
    """Return a variable that is added to its parent."""
    node = await parent.add_variable(identifier, name, service.value(cell).Value, datatype=ua.NodeId(cell.type.value))
    if cell.to is not None:
        await node.set_writable()
    if cell.unit:
        await node.delete_reference(ua.NodeId(ua.ObjectIds.BaseDataVariableType), ua.ObjectIds.HasTypeDefinition)
        await node.add_reference(ua.NodeId(ua.ObjectIds.AnalogItemType), ua.ObjectIds.HasTypeDefinition)
        code = _UNITS[cell.unit]
        for what, value in (("EURange", ua.Range(*cell.span)), ("EngineeringUnits", ua.EUInformation(
                "http://www.opcfoundation.org/UA/units/un/cefact", int.from_bytes(code, "big"),
                ua.LocalizedText(cell.unit), ua.LocalizedText(code.decode())))):
            property_ = ua.NodeId(f"{cell.name}.{what}", identifier.NamespaceIndex)
            await node.add_property(property_, f"0:{what}", value)
    return node


async def _publish(service: _Attributes, closing: list[asyncio.Task[Any]]) -> None:
    """Tell those who subscribed to a cell when it has changed.

    Args:
        service: with the cells.
        closing: the library's ends of connections, which it looks through too rarely for a client that sends nonsense.
    """
    space, last_values = service._aspace, dict[ua.NodeId, Any]()
    while True:
        await asyncio.sleep(_LOOK_S)
        closing[:] = [each for each in closing if not each.done()]
        for node, cell in service.cells.items():
            callbacks = space[node].attributes[ua.AttributeIds.Value].datachange_callbacks
            if not callbacks:
                continue
            data = service.value(cell)
            value = data.Value and data.Value.Value, data.StatusCode
            if last_values.get(node) != value:
                last_values[node] = value
                for handle, callback in callbacks.copy().items():
                    await callback(handle, data)
