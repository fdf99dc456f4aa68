"""The hold that commands of this machine have on a PLC: one at a time, and never lost.

    free → locked → open (the way back is on the disk, before the first byte) → closed (read back) → free

`experiment`, `write` and `rollback` take the same hold. Its file in the user's state folder, which `HEATERTUNE_STATE`
moves, is removed only after the way back was read back later than the last instant at which a request can still
arrive. A killed program or a host that was rebooted leaves it, and every live command looks there first.

A request without an answer may arrive for `LATE_S` more; one that was answered, until it is seen in the PLC, as a
gateway may answer first and write later.

The names of the files depend on where the PLC is, not on how its address is written: `localhost` is `127.0.0.1`, and
all blocks of a PLC have one hold. A PLC reached through two ports, or from two machines, is not recognised as one.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shlex
import socket
import struct
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from ipaddress import ip_address
from itertools import groupby
from pathlib import Path
from typing import Any, Final, NamedTuple

from heatertune import writing as files
from heatertune.batch.engine import hold_lock
from heatertune.codec import read_document
from heatertune.errors import DocumentError, InputError, LinkDown, LinkError, PlcRefused
from heatertune.live.client.connection import Address, Client, address_of, connect
from heatertune.writing import write_files

__all__ = ["HOST", "LATE_S", "RETRY_S", "WAY_BACK_SCHEMA", "Clock", "Hold", "WayBack", "WayBackPart", "is_number",
           "new_way_back", "state_folder", "utc_now", "where_of"]

#: so long after it was sent a request may still arrive [s]: a reset stops the system's own retries, no gateway's
LATE_S = 60.0
#: so long a dead link is tried again [s]
RETRY_S = 60.0
#: before each look; the last one for all that follow [s]
_PAUSES_S: Final = (0.0, 0.2, 0.5, 1.0, 2.0)

#: commands whose record says how to end them
_OF_ONE_BLOCK: Final = ("write", "rollback")
WAY_BACK_SCHEMA: Final = "heatertune/way-back/2"
_REAL: Final = struct.Struct(">f")
_NOT_WHOLE: Final = "as511"  # two words that are written together may reach the CPU apart


def _since_boot_s() -> float:
    """Return the time since this machine began, the time that it slept included where the system counts it [s]."""
    kind = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if kind is None else time.clock_gettime(kind)


class Clock(NamedTuple):
    """The time of this machine; tests have one of their own.

    Attributes:
        now_s: returns the time since the machine began, which nobody sets and which goes on while it sleeps [s].
        sleep: waits so long [s].
    """

    now_s: Callable[[], float] = _since_boot_s
    sleep: Callable[[float], object] = time.sleep

    def passed_s(self, since_s: float) -> float:
        """Return how much time has passed since an instant of this clock, at least: behind a reboot, since that."""
        now_s = self.now_s()
        return now_s - since_s if now_s >= since_s else now_s


HOST: Final = Clock()


def state_folder() -> Path:
    """Return the folder of the user's state; it may not be there yet.

    Raises:
        InputError: the user has no home, and no variable names another folder.
    """
    folder = files.state_folder()
    if folder is None:
        raise InputError("no folder for the state of PLCs: set HEATERTUNE_STATE to one")
    return folder


def is_number(cells: bytes, real: int | None) -> bool:
    """Return whether the big-endian REAL that begins at a byte of cells is a number; None: they hold no REAL."""
    return real is None or math.isfinite(_REAL.unpack_from(cells, real)[0])


class WayBackPart(NamedTuple):
    """Bytes that one request changes.

    Attributes:
        start: the first of them in the block.
        before: as they were.
        own: what the command, or the PLC's dead man after it, may have left there.
        real: first byte of a big-endian REAL within them; None: there is none.
        address: of the block that has them, where a command changes several; empty: that of the way back.
    """

    start: int
    before: bytes
    own: Collection[bytes]
    real: int | None = None
    address: str = ""

    def owns(self, cells: bytes, protocol: str) -> bool:
        """Return whether bytes are as they were before, or as the command or the dead man may have left them.

        A REAL that is no number is nobody's value: the PLC stores or shows what it was never given.
        """
        if not is_number(cells, self.real):
            return True
        own = {self.before, *self.own}
        if protocol != _NOT_WHOLE:
            return cells in own
        return all(cells[at : at + 2] in {each[at : at + 2] for each in own} for at in range(0, len(cells), 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class WayBack:
    """What brings back what a command has changed in a PLC.

    Attributes:
        command: that changes it: `experiment`, `write` or `rollback`.
        address: of the PLC, as the command was given it.
        number: of the block.
        parts: what is changed, in the order of the requests; none: it has ended, but a request may still arrive.
        power_pct: largest power of an experiment [%]; else 0.
        record: log of an experiment, record of a write.
        begun: UTC, ISO 8601.
        process: that runs it.
        sent_s: when a request was sent that may still arrive, by `Clock` [s]; None: there is none.
    """

    command: str
    address: str
    number: int
    parts: tuple[WayBackPart, ...]
    record: str
    begun: str
    process: int
    power_pct: float = 0.0
    sent_s: float | None = None

    @property
    def remedy(self) -> str:
        """The command line that ends it."""
        if self.command != "experiment" and Path(self.record).is_file():
            return f"heatertune rollback {shlex.quote(self.record)}"
        return f"heatertune experiment --restore {shlex.quote(self.address)}"

    @property
    def message(self) -> str:
        """What is open, a sentence that names the remedy."""
        attempt = f"{self.command} begun {self.begun} (process {self.process}) has not ended"
        state = (f"an {attempt}: the controller may be in manual at up to {self.power_pct:g} %"
                 if self.command == "experiment" else f"a {attempt}: some of its parameters may be in the PLC")
        return f"{self.address}: {state}; unless it still runs, bring back what stood there before: {self.remedy}"

    def to_text(self) -> str:
        """Return it as its file holds it."""
        parts = [{"start": part.start, "before": part.before.hex(), "own": sorted(each.hex() for each in part.own),
                  "real": part.real, "address": part.address} for part in self.parts]
        return json.dumps({
            "schema": WAY_BACK_SCHEMA, "command": self.command, "address": self.address, "block": self.number,
            "parts": parts, "power_pct": self.power_pct, "record": self.record, "begun": self.begun,
            "process": self.process, "sent_s": self.sent_s}, indent=2) + "\n"

    @classmethod
    def from_document(cls, document: Any) -> WayBack:
        """Return the content of a file; raises KeyError, TypeError or ValueError where it is damaged."""
        parts = tuple(_part_of(part) for part in document["parts"])
        return cls(command=str(document["command"]), address=str(document["address"]), number=int(document["block"]),
                   parts=parts, power_pct=float(document["power_pct"]), record=str(document["record"]),
                   begun=str(document["begun"]), process=int(document["process"]),
                   sent_s=None if document["sent_s"] is None else float(document["sent_s"]))


def _part_of(document: Any) -> WayBackPart:
    """Return the part of a way back that a file holds; errors as `WayBack.from_document`."""
    part = WayBackPart(int(document["start"]), bytes.fromhex(document["before"]),
                       {bytes.fromhex(each) for each in document["own"]}, document.get("real"),
                       str(document.get("address", "")))
    if not part.before or {len(each) for each in part.own} != {len(part.before)}:
        raise ValueError("own: bytes of another length than before")
    if part.real not in (None, *range(len(part.before) - 3)):
        raise ValueError("real: no byte at which a REAL begins")
    return part


class Hold:
    """The hold on one PLC.

    Attributes:
        path: of the file of the way back, which is there while the hold is open.
        clock: of this machine.
    """

    def __init__(self, address: Address, clock: Clock | None = None) -> None:
        """Take a PLC; errors as `state_folder`."""
        self._address, self.clock = address, clock or HOST
        name = hashlib.sha256(where_of(address).encode()).hexdigest()[:16]
        self.path = state_folder() / f"plc-{name}.json"
        self._way_back: WayBack | None = None
        self._lost_s: float | None = None  # the latest request without an answer
        self._unseen_s: float | None = None  # the latest one with an answer, until it is seen
        self._before_s: float | None = None  # `_lost_s` before the request that is under way
        self._sent_again: set[tuple[str, int]] = set()  # parts that were sent though what is read is as before

    @contextmanager
    def lock(self, command: str) -> Iterator[None]:
        """Hold the PLC's lock within the block; the system releases it when the process ends, however that ends.

        Args:
            command: that holds it, for the message of the next one.

        Raises:
            InputError: another process holds it, or the state folder cannot be written.
        """
        with hold_lock(self.path, "", what=f"{self._address.text}: another command works on this PLC",
                       holder=f": heatertune {command}, begun {utc_now()}"):
            yield

    def way_back(self) -> WayBack | None:
        """Return the way back of a command that has not ended, None where there is none.

        Raises:
            DocumentError: the file is damaged.
        """
        way = self._stored()
        return way if way is not None and way.parts else None

    def _stored(self) -> WayBack | None:
        try:
            self.path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as problem:
            raise DocumentError(f"{self.path}: cannot be read: {problem.strerror}") from None
        try:
            return WayBack.from_document(read_document(self.path, WAY_BACK_SCHEMA))
        except (DocumentError, KeyError, TypeError, ValueError) as problem:
            why = str(problem).removeprefix(f"{self.path}: ")
            raise DocumentError(f"{self.path}: {why}: no whole way back; look at the PLC, put the controller back in "
                                "automatic, and remove the file") from None

    def message(self) -> str:
        """Return the message about a command that has not ended, a sentence; empty where there is none.

        Raises:
            DocumentError: as `way_back`.
        """
        way = self.way_back()
        return "" if way is None else way.message

    def demand_free(self, *, unless_write: bool = False) -> WayBack | None:
        """Refuse a hold that is not free.

        Args:
            unless_write: whether a write or rollback that has not ended is returned and not refused.

        Raises:
            InputError: a command has not ended, and the message names the one that ends it; or a request may still
                arrive, and would undo what is done now: the message says when it can arrive no longer.
            DocumentError: as `way_back`.
        """
        way = self._stored()
        if way is None:
            return None
        if way.parts and (way.command not in _OF_ONE_BLOCK or not unless_write):
            raise InputError(way.message)
        if left_s := self._late_s(way.sent_s):
            raise InputError(f"{self._address.text}: an earlier request has no answer, and a gateway may still pass it "
                             f"on: again in {math.ceil(left_s)} s")
        return way if way.parts else None

    def open(self, way_back: WayBack) -> None:
        """Put a way back on the disk, whole, before this returns; nothing may be sent before.

        Raises:
            InputError: that cannot be.
        """
        self._save(way_back)
        self._lost_s = way_back.sent_s

    def resume(self) -> WayBack | None:
        """Take over the way back that another process has left; errors as `way_back`."""
        way = self._stored()
        if way is not None:
            self._way_back, self._lost_s = way, way.sent_s
        return way

    def _save(self, way_back: WayBack) -> None:
        write_files(self.path.parent, {self.path.name: way_back.to_text()})
        self._way_back = way_back

    def _note(self, sent_s: float | None) -> None:
        """Note on the disk what may still arrive, where it is otherwise."""
        if self._way_back is not None and self._way_back.sent_s != sent_s:
            self._save(replace(self._way_back, sent_s=sent_s))

    def note_request(self) -> None:
        """Note that a request is sent now.

        Raises:
            InputError: that cannot be noted: send nothing that is not a way back.
        """
        self._before_s, self._lost_s = self._lost_s, self.clock.now_s()
        self._note(self._lost_s)

    def note_refusal(self) -> None:
        """Note that the request was not carried out."""
        self._lost_s = self._before_s
        self._forget_sent()

    def note_answer(self) -> None:
        """Note that the request has its answer; what it wrote has still to be seen."""
        self._unseen_s, self._lost_s = self._lost_s, self._before_s

    def note_stored(self) -> None:
        """Note that what an answered request wrote was seen in the PLC."""
        self._unseen_s = None
        self._forget_sent()

    def _forget_sent(self) -> None:
        latest = [at for at in (self._lost_s, self._unseen_s) if at is not None]
        with suppress(InputError):  # that it may still arrive costs time at the end, no more
            self._note(max(latest, default=None))

    def add_own(self, start: int, cells: bytes, address: str = "") -> None:
        """Note that the device keeps other bytes than were written in their place; errors are told by the next one."""
        way = self._way_back
        if way is not None:
            parts = tuple(
                part._replace(own={*part.own, cells}) if (part.start, part.address) == (start, address) else part
                for part in way.parts)
            self._way_back = replace(way, parts=parts)
            with suppress(InputError):
                self._save(self._way_back)

    def _late_s(self, sent_s: float | None) -> float:
        return 0.0 if sent_s is None else max(0.0, LATE_S - self.clock.passed_s(sent_s))

    @property
    def left_s(self) -> float:
        """How long anything that was sent may still arrive [s]."""
        return max(self._late_s(self._lost_s), self._late_s(self._unseen_s))

    @property
    def stored_left_s(self) -> float:
        """The same, of what another process has sent; errors as `way_back`."""
        way = self._stored()
        return self._late_s(None if way is None else way.sent_s)

    def close(self) -> None:
        """End the hold: what stands in the PLC is known. While a request may still arrive, the file says so."""
        if self._way_back is not None and self.left_s > 0.0:
            with suppress(InputError):
                self._save(replace(self._way_back, parts=()))
        else:
            self.path.unlink(missing_ok=True)
        self._way_back = None

    def bring_back(
        self, timeout_s: float, progress: Callable[[str], object] = str, enough: Callable[[], bool] = lambda: False,
    ) -> bool | None:
        """Bring back what stood there, where what stands there is the command's, or of the PLC's dead man after it.

        Each look is made on a connection of its own, and the last one when nothing can arrive any more. Once what
        stands there is known, the hold is closed.

        Args:
            timeout_s: after which an answer is lost [s].
            progress: called with why this takes long.
            enough: asked between two looks whether somebody wants no more of them.

        Returns:
            Whether what stood there stands there again, read back; False: somebody else has changed it, and it was left
            alone; None: not known, and the hold stays open.
        """
        begun_s, number, stands = self.clock.now_s(), 0, None
        while True:
            self.clock.sleep(_PAUSES_S[min(number, len(_PAUSES_S) - 1)])
            number, left_s = number + 1, self.left_s
            try:
                state = self._brought_back(timeout_s)
            except LinkError:
                state = None
            if state is not None and left_s == self.left_s == 0.0:  # nothing could arrive when that look began
                self.close()
                return state
            # a device that shows something else whatever is written would be tried for ever
            left_s = self.left_s if state is not None else max(RETRY_S, LATE_S) - self.clock.passed_s(begun_s)
            if (state is None and left_s <= 0.0) or enough():
                return None
            if state != stands or number == 1:
                progress(f"{self._address.text}: " + (
                    f"no answer; trying for {left_s:.0f} s to bring back what stood there" if state is None
                    else f"looking for {left_s:.0f} s more whether a request without an answer still arrives"))
            stands = state

    def _brought_back(self, timeout_s: float) -> bool | None:
        """Look once, and write where it is not as before; as `bring_back`.

        Raises:
            LinkError: no answer.
        """
        way_back, outcome = self._way_back, True
        assert way_back is not None
        for place, parts in groupby(reversed(way_back.parts), lambda part: part.address):
            address = address_of(place or way_back.address)
            number = address.block or way_back.number  # over Modbus the block is the address's, whatever the number
            with connect(address, timeout_s) as client:
                for part in parts:
                    content = client.read(number, part.start, len(part.before))
                    if not part.owns(content, self._address.protocol):
                        outcome = False
                    elif not self._has_put_back(client, number, part, content):
                        return None
        return outcome

    def _has_put_back(self, client: Client, number: int, part: WayBackPart, present: bytes) -> bool:
        """Write a part that is not as before, and return whether it is; errors as `_brought_back`.

        What is read may be a gateway's copy: where something was sent and not seen, the part is written once anyway.
        """
        if present == part.before and ((part.address, part.start) in self._sent_again or not self.left_s):
            return True
        with suppress(InputError):  # the way back is sent though the disk takes nothing
            self.note_request()
        self.send(partial(client.write, number, part.start, part.before))
        if client.read(number, part.start, len(part.before)) != part.before:
            return False
        if present == part.before:
            self._sent_again.add((part.address, part.start))
        else:
            self.note_stored()
        return True

    def send(self, write: Callable[[], object]) -> None:
        """Send a request that `note_request` has noted.

        Args:
            write: sends it.

        Raises:
            PlcRefused, LinkDown: it was not carried out.
            ReplyLost: whether it was is not known.
        """
        try:
            write()
        except (PlcRefused, LinkDown):
            self.note_refusal()
            raise
        self.note_answer()


def utc_now() -> str:
    """Return the time of this machine, UTC, as a person reads it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def new_way_back(
    command: str, address: Address, number: int, parts: Collection[WayBackPart], record: str | Path,
    power_pct: float = 0.0,
) -> WayBack:
    """Return the way back of a command that begins now, in this process.

    Args:
        command: `experiment`, `write` or `rollback`; `write of zones`, which changes several blocks.
        address: of the PLC.
        number: of the block.
        parts: what is changed, in the order of the requests.
        record: log of an experiment, record of a write.
        power_pct: largest power of an experiment [%].
    """
    return WayBack(command=command, address=address.text, number=number, parts=tuple(parts), record=str(record),
                   begun=utc_now(), process=os.getpid(), power_pct=power_pct)


def where_of(address: Address) -> str:
    """Return where a PLC is, the same for every way to write its address."""
    if address.protocol == "as511":
        return f"line {os.path.realpath(address.host)}"
    unit = f" unit {address.way[0]}" if address.protocol == "modbus" else ""
    return f"{_host(address.host)} port {address.port}{unit}"


def _host(name: str) -> str:
    """Return the network address of a host, or its name where nobody knows one."""
    try:
        numbers = sorted({str(each[4][0]).partition("%")[0] for each in socket.getaddrinfo(name, None)})
    except (OSError, UnicodeError):
        return name.lower()
    return "loopback" if any(ip_address(each).is_loopback for each in numbers) else numbers[0]
