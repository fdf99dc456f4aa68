"""What commands on this machine share about one PLC.

That is a lock, the way back of an experiment that has not ended, and whether a request has no answer yet.

All are files in the user's state folder, which `HEATERTUNE_STATE` moves. Their names depend on where the PLC is, not
on how its address is written: `localhost` is `127.0.0.1`, and all blocks of a PLC have one lock. A PLC that is reached
through two ports, or from two machines, is not recognised as one.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shlex
import socket
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Final

from heatertune import writing as files
from heatertune.batch.engine import hold_lock
from heatertune.codec import read_document
from heatertune.errors import DocumentError, InputError
from heatertune.live.client.connection import Address
from heatertune.writing import write_files

__all__ = ["LATE_S", "WAY_BACK_SCHEMA", "PlcState", "WayBack", "late_left_s", "state_folder", "utc_now"]

#: so long after it was given up a request may still arrive [s]: a reset stops the system's own retries, no gateway's
LATE_S = 60.0

WAY_BACK_SCHEMA: Final = "heatertune/way-back/1"
_NOT_WHOLE: Final = "as511"  # two words that are written together may reach the CPU apart


def late_left_s(sent_at: float | None) -> float:
    """Return how long a request may still arrive [s].

    Args:
        sent_at: when it was sent, where it has no answer [s since 1970]; None: it has one.
    """
    left_s = 0.0 if sent_at is None else sent_at + LATE_S - time.time()
    return left_s if 0.0 < left_s < 2.0 * LATE_S else 0.0  # longer: the clock was set back since, far


def state_folder() -> Path:
    """Return the folder of the user's state; it may not be there yet.

    Raises:
        InputError: the user has no home, and no variable names another folder.
    """
    folder = files.state_folder()
    if folder is None:
        raise InputError("no folder for the state of PLCs: set HEATERTUNE_STATE to one")
    return folder


@dataclass(frozen=True, slots=True, kw_only=True)
class WayBack:
    """What brings back mode and manual value of a controller that an experiment has put in manual.

    Attributes:
        address: of the PLC, as the experiment was given it.
        number, start: of the block, and of the first byte of the cells of mode and manual value.
        before: the cells as they were.
        own: what the experiment, or the PLC's dead man after it, may have left in the cells.
        power_pct: largest power of the plan [%].
        log: file that the experiment writes.
        begun: UTC, ISO 8601.
        process: that runs it.
        sent_at: when the latest request to change the cells was sent, where it has no answer [s since 1970]; else None.
    """

    address: str
    number: int
    start: int
    before: bytes
    own: Collection[bytes]
    power_pct: float
    log: str
    begun: str
    process: int
    sent_at: float | None = None

    def owns(self, cells: bytes, protocol: str) -> bool:
        """Return whether cells are as they were before, or as the experiment or the dead man may have left them."""
        own = {self.before, *self.own}
        if protocol != _NOT_WHOLE:
            return cells in own
        return all(cells[at : at + 2] in {each[at : at + 2] for each in own} for at in range(0, len(cells), 2))

    @property
    def command(self) -> str:
        """The command that brings back what stood there."""
        return f"heatertune experiment --restore {shlex.quote(self.address)}"

    def to_text(self) -> str:
        """Return it as its file holds it."""
        return json.dumps({
            "schema": WAY_BACK_SCHEMA, "address": self.address, "block": self.number, "start": self.start,
            "before": self.before.hex(), "own": sorted(each.hex() for each in self.own), "power_pct": self.power_pct,
            "log": self.log, "begun": self.begun, "process": self.process, "sent_at": self.sent_at}, indent=2) + "\n"


class PlcState:
    """Lock and way back of one PLC.

    Attributes:
        path: of the file of the way back, which is there while an experiment has not ended.
    """

    def __init__(self, address: Address) -> None:
        """Take a PLC; errors as `state_folder`."""
        self._address = address
        name = hashlib.sha256(_where(address).encode()).hexdigest()[:16]
        self.path = state_folder() / f"plc-{name}.json"
        self._sent = self.path.with_suffix(".sent")

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
        """Return the way back of an experiment that has not ended, None where there is none.

        Raises:
            DocumentError: the file is damaged.
        """
        try:
            self.path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as problem:
            raise DocumentError(f"{self.path}: cannot be read: {problem.strerror}") from None
        document: Any = read_document(self.path, WAY_BACK_SCHEMA)
        try:
            found = WayBack(
                address=str(document["address"]), number=int(document["block"]), start=int(document["start"]),
                before=bytes.fromhex(document["before"]), own={bytes.fromhex(each) for each in document["own"]},
                power_pct=float(document["power_pct"]), log=str(document["log"]), begun=str(document["begun"]),
                process=int(document["process"]),
                sent_at=None if document["sent_at"] is None else float(document["sent_at"]))
            if not found.before or {len(each) for each in found.own} != {len(found.before)}:
                raise ValueError("own: cells of another length than before")
        except (KeyError, TypeError, ValueError) as problem:
            raise DocumentError(f"{self.path}: {problem}: no whole way back; look at the PLC, put the controller back "
                                "in automatic, and remove the file") from None
        return found

    def demand_no_way_back(self) -> None:
        """Do nothing where no experiment is open.

        Raises:
            InputError: an experiment has not ended; the message names the command that ends it.
            DocumentError: as `way_back`.
        """
        if message := self.message():
            raise InputError(message)

    def message(self) -> str:
        """Return what has to be said of an experiment that has not ended, a sentence; nothing where there is none.

        Raises:
            DocumentError: as `way_back`.
        """
        found = self.way_back()
        if found is None:
            return ""
        return (f"{found.address}: an experiment begun {found.begun} (process {found.process}) has not ended: the "
                f"controller may be in manual at up to {found.power_pct:g} %; unless it still runs, bring back what "
                f"stood there before: {found.command}")

    def send(self) -> None:
        """Note that a request is sent.

        Raises:
            InputError: that cannot be noted.
        """
        try:
            self._sent.parent.mkdir(parents=True, exist_ok=True)
            self._sent.touch()
        except OSError as problem:
            raise InputError(f"{self._sent}: cannot be written: {problem.strerror}") from None

    def note_answer(self) -> None:
        """Note that the latest request has its answer."""
        with suppress(OSError):  # then the next command waits for nothing
            self._sent.unlink(missing_ok=True)

    def late_left_s(self) -> float:
        """Return how long a request that changes the PLC, and has no answer, may still arrive [s]."""
        try:
            return late_left_s(self._sent.stat().st_mtime)
        except OSError:
            return 0.0

    def demand_nothing_late(self) -> None:
        """Do nothing unless a request without an answer may still arrive.

        Raises:
            InputError: one may, and would undo what is done now; the message says when it can arrive no longer.
        """
        if left_s := self.late_left_s():
            raise InputError(f"{self._address.text}: an earlier request has no answer, and a gateway may still pass it "
                             f"on: again in {math.ceil(left_s)} s")

    def keep(self, way_back: WayBack) -> None:
        """Put a way back on the disk, whole, before this returns.

        Raises:
            InputError: that cannot be.
        """
        write_files(self.path.parent, {self.path.name: way_back.to_text()})

    def forget(self) -> None:
        """Remove the way back: what stood there was read back."""
        self.path.unlink(missing_ok=True)


def utc_now() -> str:
    """Return the time of this machine, UTC, as a person reads it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _where(address: Address) -> str:
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
