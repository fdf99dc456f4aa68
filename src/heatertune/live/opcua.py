"""A virtual PLC over OPC UA, without encryption: each block as one ByteString, its words and quantities beside it.

A ByteString is read whole, which is one instant, and written whole or, by an index range (OPC 10000-4, section 7.27),
in part: so a client changes its own bytes and never puts a neighbour's back. What one request reads is of one instant,
too, however many nodes; the words of one write request are written one by one, as OPC UA promises no more.

The source timestamp is the plant's own time, which begins when it is served: at rate 100 it runs a hundred times as
fast. The server timestamp is the clock's.
"""

from __future__ import annotations

import asyncio
import copy
import gc
import logging
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from typing import Any, Final

from asyncua import Server, ua
from asyncua.server.address_space import AttributeService

from heatertune.live.memory import Access, Refusal
from heatertune.live.nodes import NodeVariable, cells_of
from heatertune.live.plc import VirtualPlc
from heatertune.live.thread_server import AsideServer

__all__ = ["OpcuaServer"]

_URI: Final = "urn:heatertune:virtual-plc"
_CODES: Final = {Access.MISSING: ua.StatusCodes.BadNodeIdUnknown, Access.OUTSIDE: ua.StatusCodes.BadIndexRangeNoData,
                 Access.PROTECTED: ua.StatusCodes.BadNotWritable}
_LOOK_S: Final = 0.05  # so often what is subscribed to is looked at
_MOST_S: Final = 2e11  # a date ends with the year 9999
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
        """Return what a cell shows, or why it shows nothing."""
        now = datetime.now(UTC)
        try:
            found, status = cell.read(self.plc.memory, index_range), ua.StatusCodes.Good
        except (Refusal, ua.UaStatusCodeError) as refused:
            found, status = None, _code(refused)
        plant = self._begun + timedelta(seconds=min(self.plc.elapsed_s, _MOST_S))
        return ua.DataValue(found, ua.StatusCode(status), SourceTimestamp=plant, ServerTimestamp=now)

    def read(self, params: ua.ReadParameters) -> list[ua.DataValue]:
        with self.plc.memory.changed:
            return [self._read(wanted) for wanted in params.NodesToRead]

    def _read(self, wanted: ua.ReadValueId) -> ua.DataValue:
        cell = self.cells.get(wanted.NodeId)
        if cell is None or wanted.AttributeId != ua.AttributeIds.Value:
            found: ua.DataValue = self._aspace.read_attribute_value(wanted.NodeId, wanted.AttributeId)
            return found
        return self.value(cell, wanted.IndexRange)

    async def write(self, params: ua.WriteParameters, user: Any = None) -> list[ua.StatusCode]:
        done = []
        for wanted in params.NodesToWrite:
            cell = self.cells.get(wanted.NodeId)
            if cell is None or wanted.AttributeId != ua.AttributeIds.Value:
                done += await super().write(ua.WriteParameters([wanted]), user)
                continue
            try:
                cell.write(self.plc.memory, wanted.Value.Value, wanted.IndexRange)
                done.append(ua.StatusCode())
            except (Refusal, ua.UaStatusCodeError) as refused:
                done.append(ua.StatusCode(_code(refused)))
        return done


def _code(refused: Refusal | ua.UaStatusCodeError) -> int:
    return int(_CODES[refused.why] if isinstance(refused, Refusal) else refused.code)


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

    @asynccontextmanager
    async def serving(self) -> AsyncIterator[None]:
        """Serve; see `heatertune.live.thread_server.AsideServer`."""
        server, service = await self._made()
        async with server:
            publishing = asyncio.create_task(_publish(service))
            yield
            publishing.cancel()

    async def _made(self) -> tuple[Server, _Attributes]:
        """Return a server with all its nodes."""
        server = Server()
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
    begun = datetime.now(UTC)
    told = copy.copy(space.read_attribute_value(status, ua.AttributeIds.Value).Value.Value)
    told.State, told.StartTime = ua.ServerState.Running, begun

    def now(node: ua.NodeId, _attribute: ua.AttributeIds) -> ua.DataValue:
        told.CurrentTime = datetime.now(UTC)
        return ua.DataValue(ua.Variant(told if node == status else told.CurrentTime))

    for node in (status, ua.NodeId(ua.ObjectIds.Server_ServerStatus_CurrentTime)):
        space.set_attribute_value_callback(node, ua.AttributeIds.Value, now)


async def _lay_out(server: Server, service: _Attributes) -> None:
    """Add a node for each cell, and objects where they stand in none."""
    index = await server.register_namespace("urn:heatertune:blocks")
    nodes: dict[str, Any] = {"": server.nodes.objects}
    for cell in cells_of(service.plc.block):
        *above, name = cell.name.split(".")
        for depth in range(1, len(above) + 1):
            path, parent = ".".join(above[:depth]), nodes[".".join(above[: depth - 1])]
            if path not in nodes:
                nodes[path] = await parent.add_object(ua.NodeId(path, index), f"{index}:{above[depth - 1]}")
        where = nodes[".".join(above)], ua.NodeId(cell.name, index), f"{index}:{name}"
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


async def _publish(service: _Attributes) -> None:
    """Tell those who subscribed to a cell when it has changed."""
    space, told = service._aspace, dict[ua.NodeId, Any]()
    while True:
        await asyncio.sleep(_LOOK_S)
        for node, cell in service.cells.items():
            callbacks = space[node].attributes[ua.AttributeIds.Value].datachange_callbacks
            if not callbacks:
                continue
            found = service.value(cell)
            seen = found.Value and found.Value.Value, found.StatusCode
            if told.get(node) != seen:
                told[node] = seen
                for handle, callback in callbacks.copy().items():
                    await callback(handle, found)
