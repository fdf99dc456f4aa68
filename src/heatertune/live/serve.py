"""Serve a virtual PLC: create it from a folder of `design`, start and stop its protocols, disturb its links."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from importlib import import_module
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from threading import Thread
from typing import Any, Final

from heatertune.codec import data_folder
from heatertune.errors import InputError, OutOfRange, UnknownName, demand_known
from heatertune.live.client.connection import LIBRARIES, ClosesOnExit, demand_library
from heatertune.live.controller_block import SERVED, ServedBlock, block_for
from heatertune.live.plc import LINK, Pace, ScheduledFault, VirtualPlant, VirtualPlc, fault_of, plan_for
from heatertune.live.simulator_status import OWN, SimulatorStatus
from heatertune.model.model_values import FittedModel
from heatertune.pid.design_document import read_design
from heatertune.plc import Words, controller_for
from heatertune.proof.words_file import words_in
from heatertune.settings import Conditions
from heatertune.units import check

__all__ = [
    "FaultyLink", "Simulation", "VirtualPlcServed", "is_of_link", "pace_of", "reaching_settings", "read_folder",
    "virtual_plc",
]


_MOST: Final = 65536
_LOOK_S: Final = 0.02  # so often a link that is cut, or a reply that is late, is seen to


class _Pair:
    """A client's connection and the one to the server behind it."""

    def __init__(self, client: socket.socket, server: socket.socket) -> None:
        self.client, self.server = client, server
        self.late: list[tuple[int, bytes]] = []

    def close(self) -> None:
        self.client.close()
        self.server.close()


class FaultyLink:
    """A proxy on loopback, in one thread."""

    def __init__(self, plc: VirtualPlc, listener: socket.socket, server: tuple[str, int]) -> None:
        """Stand between.

        Args:
            plc: whose timetable has the faults.
            listener: where clients come to.
            server: where the protocol is served.
        """
        self._plc, self._listener, self._server = plc, listener, server
        self._selector, self._pairs = DefaultSelector(), list[_Pair]()
        self._wake, self._woken = socket.socketpair()
        listener.setblocking(False)
        self._selector.register(listener, EVENT_READ, self._accept)
        self._selector.register(self._woken, EVENT_READ, None)
        self._thread = Thread(target=self._run, name="link", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close all connections, and the door."""
        self._wake.send(b"x")
        self._thread.join()

    def _run(self) -> None:
        while True:
            for key, _ in self._selector.select(_LOOK_S):
                if key.data is None:
                    self._end()
                    return
                key.data()
            if self._plc.link("cut") is not None:
                for pair in list(self._pairs):
                    self._drop(pair)
            for pair in list(self._pairs):
                self._send_late(pair)

    def _end(self) -> None:
        for pair in list(self._pairs):
            self._drop(pair)
        self._selector.close()
        for one in (self._listener, self._wake, self._woken):
            one.close()

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        if self._plc.link("cut") is not None:
            client.close()
            return
        pair = _Pair(client, socket.create_connection(self._server))
        self._pairs.append(pair)
        for source, act in ((client, self._forward_request), (pair.server, self._forward_reply)):
            source.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._selector.register(source, EVENT_READ, _with(act, pair))

    def _drop(self, pair: _Pair) -> None:
        if pair in self._pairs:
            self._pairs.remove(pair)
            for one in (pair.client, pair.server):
                self._selector.unregister(one)
            pair.close()

    def _forward_request(self, pair: _Pair) -> None:
        request = self._received(pair, pair.client)
        if request and self._plc.link("black-hole") is None:
            self._sent(pair, pair.server, request)

    def _forward_reply(self, pair: _Pair) -> None:
        reply = self._received(pair, pair.server)
        if not reply or any(self._plc.link(name) is not None for name in ("black-hole", "lost-reply", "late-request")):
            return
        late = self._plc.link("late-reply") or self._plc.link("duplicate")
        if late is None and not pair.late:
            self._sent(pair, pair.client, reply)
        else:  # nor does a later reply overtake
            pair.late.append((self._plc.intervals + (0 if late is None else int(late.value)), reply))

    def _send_late(self, pair: _Pair) -> None:
        while pair.late and self._plc.intervals >= pair.late[0][0]:
            self._sent(pair, pair.client, pair.late.pop(0)[1])

    def _received(self, pair: _Pair, source: socket.socket) -> bytes:
        if pair not in self._pairs:
            return b""
        try:
            content = source.recv(_MOST)
        except OSError:
            content = b""
        if not content:
            self._drop(pair)
        return content

    def _sent(self, pair: _Pair, to: socket.socket, content: bytes) -> None:
        try:
            to.sendall(content)
        except OSError:
            self._drop(pair)


def _with(act: Callable[[_Pair], None], pair: _Pair) -> Callable[[], None]:
    return lambda: act(pair)


_LOOPBACK: Final = "127.0.0.1"
_MOST_PORT: Final = 65535
_RELEASED: Final = 8
#: a connection whose other end has gone without a word is ended by the system after 60 s + 3 · 10 s
_KEEP_ALIVE: Final = {"SO_KEEPALIVE": 1, "TCP_KEEPIDLE": 60, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3}
#: protocol → address as `heatertune.live.client.connection` reads it
_URLS: Final = {"s7": "s7://{}:{}/0/2/db{}", "modbus": "modbus://{}:{}/1/{first}", "opcua": "opc.tcp://{}:{}/db{}",
                "as511": "as511://{0}/db{2}"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """How a virtual PLC is served and what happens to it.

    Attributes:
        serve: protocols, of `heatertune.live.client.connection.LIBRARIES`; none: the first that reaches the controller.
        ports: for them, in turn; 0, or none: one that is free.
        rate: so many times as fast as a real heater; infinite: as fast as it can.
        step: whether a client releases each interval.
        intervals: after so many the plant stands still; None: it goes on.
        sample: seed of the heater that is drawn from the model set; None: the working model.
        story: whether the proof's story happens.
        faults: the timetable, as `heatertune.live.plc.fault_of` reads it.
        dead_man: scans in manual without a heartbeat, after which the controller goes to automatic; 0: it stays.

    Raises:
        InputError: a protocol twice, more ports than protocols, both a rate and steps, a fault that is none.
        OutOfRange: a number without meaning.
        UnknownName: no such protocol or fault.
    """

    serve: tuple[str, ...] = ()
    ports: tuple[int, ...] = ()
    rate: float = 1.0
    step: bool = False
    intervals: int | None = None
    sample: int | None = None
    story: bool = False
    faults: tuple[str, ...] = ()
    dead_man: int = 0

    def __post_init__(self) -> None:
        for protocol in self.serve:
            if protocol not in LIBRARIES:
                raise UnknownName("protocol", protocol, LIBRARIES)
        if len(set(self.serve)) != len(self.serve):
            raise InputError(f"--serve needs each protocol once, of {', '.join(LIBRARIES)}")
        if len(self.ports) > max(len(self.serve), 1):
            raise InputError(f"{len(self.ports)} ports for {max(len(self.serve), 1)} protocols")
        for port in self.ports:
            check("port", port, least=0, most=_MOST_PORT)
        if not self.rate > 0.0:
            raise OutOfRange("rate", self.rate, "> 0, or max")
        if self.step and self.rate != 1.0:
            raise InputError("--step leaves the time to the client: leave out --rate")
        if self.intervals is not None:
            check("intervals", self.intervals, least=1)
        check("dead_man", self.dead_man, least=0)

    @property
    def timetable(self) -> tuple[ScheduledFault, ...]:
        """The faults, read."""
        return tuple(map(fault_of, self.faults))


class VirtualPlcServed(ClosesOnExit):
    """A virtual PLC that answers; `with` ends it.

    Attributes:
        plc: the PLC itself.
        addresses: protocol → host and port; AS511: the serial device, and 0.
        block: of the controller, a few words.
        number, length: of that block, and its bytes.
        registers: where Modbus finds its words.
        target: the controller's name.
        scan_s: time of the plant between two scans [s].
    """

    def __init__(self, plc: VirtualPlc, target: str, scan_s: float, settings: Simulation, *, linked: bool) -> None:
        """Begin to serve; `virtual_plc` hands in what is needed.

        Args:
            plc: that does not run yet.
            target: name of the controller.
            scan_s: time of the plant between two scans [s].
            settings: protocols and ports.
            linked: whether faults of the link are scheduled.
        """
        self.plc, self.target, self.scan_s = plc, target, scan_s
        self.block, self.number = plc.block.description, plc.memory.main
        self.length, self.registers = plc.memory.size(self.number), plc.registers
        self.addresses: dict[str, tuple[str, int]] = {}
        self._ends: list[Callable[[], Any]] = []
        try:
            for protocol, port in zip(settings.serve, (*settings.ports, *[0] * len(settings.serve)), strict=False):
                self._serve(protocol, port, linked=linked)
        except BaseException:
            self.close()
            raise
        self.plc.start()

    def _serve(self, protocol: str, port: int, *, linked: bool) -> None:
        if protocol == "as511":
            from heatertune.live.as511_server import As511Server

            if port:
                raise InputError(f"as511 is served at a line, not at port {port}: give 0 in its turn")
            line = As511Server(self.plc)
            self.addresses[protocol] = line.device, 0
            self._ends.append(line.stop)
            return
        server_of = _server_of(protocol)
        front = _listening(port)
        try:
            inner = _listening(0) if linked else front
            server = server_of(self.plc, inner)
        except BaseException:
            front.close()
            raise
        self.addresses[protocol] = front.getsockname()
        self._ends.append(server.stop)
        if linked:
            self._ends.append(FaultyLink(self.plc, front, inner.getsockname()).stop)

    @property
    def urls(self) -> dict[str, str]:
        """Protocol → the address that `heatertune record` and its like take."""
        first = self.registers[0].first if len(self.registers) == 1 else 0
        return {protocol: _URLS[protocol].format(*where, self.number, first=first)
                for protocol, where in self.addresses.items()}

    def zone_places(self) -> list[dict[str, object]]:
        """Return name, block and addresses of each zone; nothing where there is one heater."""
        return []

    @property
    def status(self) -> SimulatorStatus:
        """What the simulator's own block says."""
        return SimulatorStatus(self.plc.memory.read(OWN, 0, self.plc.memory.size(OWN)))

    def release(self, intervals: int) -> SimulatorStatus:
        """Let so many more intervals pass, wait until they are over, and return what is told then; needs `step`.

        Raises:
            InputError: the plant has ended before.
        """
        memory = self.plc.memory
        upto = self.plc.memory.released + intervals
        memory.write(OWN, _RELEASED, upto.to_bytes(4, "big"))
        with memory.changed:
            memory.changed.wait_for(lambda: self.status.intervals >= upto or self.plc.ended)
        if self.status.intervals < upto:
            raise InputError(f"the virtual PLC has ended after {self.status.intervals} intervals")
        return self.status

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the plant stands still, and return whether it does; raises what its thread raised, if anything."""
        over = self.plc.wait(timeout_s)
        if self.plc.failed is not None:
            raise self.plc.failed
        return over

    def close(self) -> None:
        """End plant and protocols; nothing is left."""
        self.plc.close()
        for end in reversed(self._ends):
            end()
        self._ends.clear()


def virtual_plc(
    source: str | Path | Words, model: FittedModel | None = None, conditions: Conditions | None = None,
    settings: Simulation | None = None, **changed: Any,
) -> VirtualPlcServed:
    """Return a virtual PLC that runs words with a heater behind it, and answers on loopback.

    Args:
        source: a folder that `design` wrote, or words.
        model: the heater, for words; of a folder it is its own.
        conditions: as of a proof; of a folder, None: those that it was made for.
        settings: see `Simulation`.
        changed: fields of `Simulation` that are other than in `settings`.

    Raises:
        InputError: a protocol whose library is not installed, a port that is taken, a controller that is not served,
            no heater; as `Simulation` and `heatertune.live.plc.plan_for`.
        UnknownOption: a keyword that is no field of `Simulation`.
        DocumentError: the folder has not what `design` writes.
        OutOfRange, UnknownName: likewise.
    """
    demand_known(changed, [each.name for each in fields(Simulation)])
    options = replace(settings or Simulation(), **_tuples(changed))
    for protocol in options.serve:
        demand_library(protocol)  # before anything is made
    if not isinstance(source, Words):
        words, model, made_for = read_folder(source)
        conditions = made_for if conditions is None else conditions
    elif model is None:
        raise InputError("virtual_plc of words needs a model: virtual_plc(words, model)")
    else:
        words = source
    plan, block = _prepared(words, model, conditions or Conditions(), options)
    options = reaching_settings(block, words.target, options)
    plc = VirtualPlc(plan, block, controller_for(words.target).core.measure, pace_of(options),
                     dead_man_scans=options.dead_man)
    return VirtualPlcServed(plc, words.target, plan.loop.scan_s, options, linked=any(map(is_of_link, plan.faults)))


def pace_of(settings: Simulation) -> Pace:
    """Return when intervals pass."""
    return Pace(rate=settings.rate, by_client=settings.step, intervals=settings.intervals)


def is_of_link(fault: ScheduledFault) -> bool:
    """Return whether a fault is one of the link or the device behind it, and of no zone."""
    return fault.name in LINK or f"{fault.name}=" in LINK


def reaching_settings(block: ServedBlock, target: str, settings: Simulation) -> Simulation:
    """Return the settings with the protocols that are served.

    Raises:
        InputError: one of them does not reach the controller, or its library is not installed.
    """
    if not settings.serve:
        settings = replace(settings, serve=block.speaks[:1])
        demand_library(*settings.serve)
    for protocol in settings.serve:
        if protocol not in block.speaks:
            raise InputError(f"--serve {protocol}: {target} is reached over {' and '.join(block.speaks)} alone")
    return settings


def _tuples(changed: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a caller says, one protocol, port or fault as well as several."""
    several = ("serve", "ports", "faults")
    return {name: (value,) if name in several and isinstance(value, str | int) else
            tuple(value) if name in several else value for name, value in changed.items()}


def _prepared(
    words: Words, model: FittedModel, conditions: Conditions, settings: Simulation
) -> tuple[VirtualPlant, ServedBlock]:
    """Return what a virtual PLC is made of; errors as in `virtual_plc`."""
    timetable = settings.timetable
    if words.target not in SERVED:
        raise InputError(f"simulate serves {', '.join(SERVED)}; {words.target} is not among them")
    plan = plan_for(words, model, conditions, sample=settings.sample, story=settings.story, faults=timetable)
    controller = controller_for(words.target)
    block = block_for(controller, words, plan.loop.switches)
    for fault in timetable:
        if fault.name == "word":
            block.put_word(bytearray(block.image()), fault.word, fault.value)
    if settings.dead_man and not block.manual:
        raise InputError(f"--dead-man is for a controller with a manual mode; {words.target} has none here")
    return plan, block


def read_folder(folder: str | Path) -> tuple[Words, FittedModel, Conditions]:
    """Return words, heater and conditions of a folder that `design` wrote.

    Raises:
        DocumentError: it has not what `design` writes.
        InputError: its design holds no model.
        OutOfRange: a word that the controller cannot hold.
    """
    place = data_folder(folder)
    words, document = words_in(folder)
    outer = Path(folder) / "pid.json"  # where tune was told to write it; words of an earlier release lie without theirs
    design = place / "pid.json" if (place / "pid.json").is_file() else outer
    _, fitted, recipe = read_design(design)
    if fitted is None:
        raise InputError(f"{design}: no model in it; simulate needs a folder that heatertune design wrote")
    own = recipe.conditions if recipe is not None and recipe.target == words.target else Conditions()
    proven = document.get("setpoint_degC")
    if own.setpoint_degC is None and isinstance(proven, float | int):
        own = replace(own, setpoint_degC=float(proven))
    return words, fitted, own


def _server_of(protocol: str) -> Callable[[VirtualPlc, socket.socket], Any]:
    """Return the class of a protocol's server; only the one needed is loaded."""
    module = import_module(f"heatertune.live.{protocol}_server")
    server: Callable[[VirtualPlc, socket.socket], Any] = getattr(module, f"{protocol.capitalize()}Server")
    return server


def _listening(port: int) -> socket.socket:
    """Return a socket on loopback that listens; raise InputError where the port is taken or not ours to take."""
    door = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    with suppress(OSError):
        door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        for name, value in _KEEP_ALIVE.items():  # the connections that come to it inherit it
            if (option := getattr(socket, name, None)) is not None:
                level = socket.SOL_SOCKET if name == "SO_KEEPALIVE" else socket.IPPROTO_TCP
                door.setsockopt(level, option, value)
        door.bind((_LOOPBACK, port))
        door.listen()
    except OSError as problem:
        door.close()
        raise InputError(f"port {port} of {_LOOPBACK} cannot be served on: {problem.strerror}") from None
    return door
