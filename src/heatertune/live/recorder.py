"""Record running loops as logs, row by row: one loop, or many into one folder.

Each row is one write at the end of the file, so a killed program leaves at most one incomplete line, which readers
recognise by its missing line end. Gaps, new connections and restarts of the PLC are comments. If the file is removed,
moved, replaced, emptied or cut, the log continues in a new file of the same name, and a comment says so.

A folder has one log per address; a loop list gives the loops names.
"""

from __future__ import annotations

import math
import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Self

from heatertune.errors import HeatertuneError, InputError, LinkError
from heatertune.live.client.connection import Address, address_of, demand_library
from heatertune.live.controller_block import ROLES, Places, places_from
from heatertune.live.joint.zone_blocks import ZonesPlaces, ZonesPoller
from heatertune.live.poller import Poller, Snapshot
from heatertune.log.cells import MARK, SWITCHED, TORN, without_torn
from heatertune.loops.measures import LoopEntry, read_list
from heatertune.units import check
from heatertune.writing import read_bytes, settle

if TYPE_CHECKING:
    from heatertune.live.mqtt_source import MqttSource

__all__ = ["RecordedLoop", "RecordingSetup", "RecordingState", "is_address", "record", "record_addresses", "record_all"]


_UNITS: Final = {"temperature": "temperature_degC", "power": "power_pct", "setpoint": "setpoint_degC"}
_SYNCED_S: Final = 0.1  # so often at most the disk is waited for
_PAUSES_S: Final = (0.0, 0.1, 0.3, 1.0, 3.0)  # before each try of a new connection; the last for ever
_SHORTEST_S: Final = 0.001
_GAP: Final = 3.5  # so many times the usual step are one


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSetup:
    """How a loop is recorded.

    Attributes:
        every_s: least time between two rows [s]; None: each scan where the PLC counts them, else 1 s.
        for_s: the log ends when it is so long [s]; None: it goes on.
        append: whether to continue a file that is there.
        timeout_s: after which an answer is lost [s].
        pwm_period_s: of the heater's switch, None where nobody knows [s].

    Raises:
        OutOfRange: a time that is none.
    """

    every_s: float | None = None
    for_s: float | None = None
    append: bool = False
    timeout_s: float = 2.0
    pwm_period_s: float | None = None

    def __post_init__(self) -> None:
        for name in ("every_s", "for_s", "timeout_s", "pwm_period_s"):
            if getattr(self, name) is not None:
                check(name, getattr(self, name), above=0.0)


@dataclass(slots=True, kw_only=True)
class RecordingState:
    """What has been recorded so far.

    Attributes:
        rows: written; those in which a quantity is not a number are comments.
        gaps: times without readings, each also a comment in the file.
        torn: looks that a scan fell into, and that were left out.
        last: the latest look.
        interval_s: of the PLC's scans, whose count is the log's clock [s]; None: this machine's clock is.
        trouble: of the link just now, empty where there is none.
        tells_new: see `heatertune.live.poller.Poller`.
        notes: what others did to the file meanwhile, one sentence each: it does not hold all rows.
    """

    rows: int = 0
    gaps: int = 0
    torn: int = 0
    last: Snapshot | None = None
    interval_s: float | None = None
    trouble: str = ""
    tells_new: bool = False
    notes: list[str] = field(default_factory=list)


class _File:
    """The log on the disk; `with` closes it."""

    def __init__(self, path: Path, heads: str, append: bool) -> None:
        """Open, and write or check the heads; errors as in `record`."""
        self._path, self._synced, self._heads = path, 0.0, heads
        self.last_s: float | None = None
        self.notes = list[str]()
        self._size, self._latest_s = 0, float("-inf")
        flags = os.O_WRONLY | os.O_APPEND
        if append and path.exists():
            end = self._checked(heads.splitlines()[-1])
            self._latest_s = float("-inf") if self.last_s is None else self.last_s
            self._number = self._opened(flags)
            self._append(end + f"# continued {_now()}\n")
        else:
            self._number = self._opened(flags | os.O_CREAT | os.O_EXCL)
            self._append(heads)
            settle(self._path.parent)

    def _opened(self, flags: int) -> int:
        try:
            number = os.open(self._path, flags, 0o644)
            kind = os.fstat(number)
            self._file, self._size = (kind.st_dev, kind.st_ino), kind.st_size
            return number
        except FileExistsError:
            raise InputError(f"{self._path}: is there already{self._left()}; --append continues it, or take another "
                             "name") from None
        except OSError as problem:
            raise InputError(f"{self._path}: cannot be written: {problem.strerror}") from None

    def _left(self) -> str:
        """Return the text that a recording has left there; empty where it is none."""
        try:
            text = read_bytes(self._path).decode(errors="replace")
        except OSError:
            return ""
        rows = [line for line in without_torn(text, []).split("\n") if line[:1].isdigit()]
        if not text.startswith(MARK) or not rows:
            return ""
        torn = "" if text.endswith("\n") else ", and a line that was torn as it ended"
        return f", with {len(rows)} rows until {rows[-1].split(',')[0]} s{torn}"

    def _checked(self, columns: str) -> str:
        """Return the text that the last line lacks; raise InputError where the file is not one to continue."""
        try:
            text = read_bytes(self._path).decode(errors="replace")
        except OSError as problem:
            raise InputError(f"{self._path}: cannot be continued: {problem.strerror}") from None
        if not text.startswith(MARK):
            raise InputError(f"{self._path}: was not begun by heatertune record; take another name")
        lines = [line for line in without_torn(text, []).split("\n") if line and not line.startswith("#")]
        first_line = lines[0] if lines else None
        if first_line is not None and first_line != columns:
            raise InputError(f"{self._path}: has the columns {first_line}; now they would be {columns}")
        try:
            self.last_s = float(lines[-1].split(",")[0]) if len(lines) > 1 else None
        except ValueError:
            raise InputError(f"{self._path}: ends in {lines[-1]!r}; expected a row: {columns}") from None
        return ("" if text.endswith("\n") else f"{TORN}\n") + (f"{columns}\n" if first_line is None else "")

    def write(self, text: str) -> None:
        """Write at the end, and see that it stands in the file of this name.

        Raises:
            InputError: the disk does not take it, or the file of this name is none to continue.
        """
        self._go_on(self._changed())
        self._append(text)
        if what := self._changed():  # just now: the row may be gone with the file
            self._go_on(what)
            self._append(text)
        if text[:1].isdigit():
            self._latest_s = float(text.partition(",")[0])

    def reopen(self) -> None:
        """Go on in the file of this name, which may be a new one; errors as `write`."""
        self._go_on("was reopened as requested")

    def check(self) -> None:
        """Note what others have done to the file since the last row."""
        if what := self._changed():
            self.notes.append(f"{self._path}: {what} before the recording ended")

    def _changed(self) -> str:
        """Return the changes of others to the file since it was written to; empty where there are none."""
        try:
            there = self._path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return "was removed or moved"
        except OSError:  # nobody may look there just now: the file that is open takes rows all the same
            return ""
        if (there.st_dev, there.st_ino) != self._file:
            return "was replaced by another file"
        if there.st_size < self._size:
            return "was emptied or cut"
        return "was written to by another program" if there.st_size > self._size else ""

    def _go_on(self, what: str) -> None:
        """Go on in the file of this name, or in a new one, where others have done something to it."""
        if not what:
            return
        try:
            is_new, is_empty = False, self._path.stat().st_size == 0
        except OSError:
            is_new = is_empty = True
        begin = self._heads if is_empty else self._checked(self._heads.splitlines()[-1])
        if not is_empty and self.last_s is not None and self.last_s > self._latest_s:
            raise InputError(f"{self._path}: another program writes rows into it; what is there stays")
        old = self._number
        self._number = self._opened(os.O_WRONLY | os.O_APPEND | (os.O_CREAT | os.O_EXCL if is_new else 0))
        os.close(old)
        if what not in ("was written to by another program", "was reopened as requested") or (
                begin and what == "was written to by another program"):
            self.notes.append(f"{self._path}: {what} while it was recorded into; the log goes on "
                              f"{'in a new file' if is_empty else 'at its end'}")
        self._append(f"{begin}# continued {_now()}: the file {what}\n")
        settle(self._path.parent)

    def _append(self, text: str) -> None:
        content, now = text.encode(), time.monotonic()
        try:
            while content:  # a disk that is nearly full takes a part
                count = os.write(self._number, content)
                self._size, content = self._size + count, content[count:]
            if now - self._synced > _SYNCED_S:
                os.fsync(self._number)
                self._synced = now
        except OSError as problem:
            raise self._broken(problem) from None

    def _broken(self, problem: OSError) -> InputError:
        return InputError(f"{self._path}: cannot be written on: {problem.strerror}; what is there stays")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            os.fsync(self._number)
        except OSError as broken:
            if problem is None:
                raise self._broken(broken) from None
        finally:
            os.close(self._number)


def record(
    address: Address, path: str | Path, places: Places | ZonesPlaces | None = None,
    settings: RecordingSetup | None = None, *,
    shown: Callable[[RecordingState], object] = lambda _: None, ended: Callable[[], bool] = lambda: False,
    reopen: Callable[[], bool] = lambda: False,
) -> RecordingState:
    """Record a running loop until its time is over.

    Args:
        address: of the PLC, which is only read.
        path: of the log.
        places: where the PLC shows what; see `heatertune.live.poller.Poller`. Those of several zones are recorded
            together, with columns that bear the names of the zones.
        settings: how; None: each scan, without an end.
        shown: called after each look.
        ended: asked after each look whether it is enough.
        reopen: asked after each look whether to go on in the file of that name, which may be another one now.

    Returns:
        What was recorded; the file is whole, also where this raises.

    Raises:
        InputError: as `heatertune.live.poller.Poller`; a file that is there or cannot be written.
        LinkError: nobody is there at the beginning; later ones are waited for.
        OutOfRange: a time that is none.
    """
    setup = settings or RecordingSetup()
    with _looking(address, places, setup.timeout_s) as looking:
        columns = ["time_s", *_titles(looking.roles).values()]
        clock = ("this machine's clock" if looking.interval_s is None
                 else f"scans of the PLC, each {looking.interval_s:.9g} s")
        mixed = "" if looking.whole else "; a row may hold quantities of two scans"
        switched = "" if setup.pwm_period_s is None else f"{SWITCHED}{setup.pwm_period_s:.9g} s"
        heads = f"{MARK}; {address.text}; begun {_now()}; time: {clock}{switched}{mixed}\n{','.join(columns)}\n"
        with _File(Path(path), heads, setup.append) as file:
            return _Rows(looking, file, setup).run(shown, ended, reopen)


def _titles(roles: Iterable[str]) -> dict[str, str]:
    """Return quantity → title of its column, in the order of the columns; those of a zone begin with its name."""
    role_names = list(roles)
    if zones := [key.rpartition(" ") for key in role_names if " " in key]:
        return {f"{zone} {role}": f"{zone}_{_UNITS[role]}" for zone, _, role in zones}
    return {role: _UNITS[role] for role in ROLES if role in role_names}


def _looking(
    address: Address, places: Places | ZonesPlaces | None, timeout_s: float
) -> Poller | MqttSource:
    """Return what looks, connected; errors as its kind."""
    if isinstance(places, ZonesPlaces):
        return ZonesPoller(places, timeout_s)
    if address.protocol != "mqtt":
        return Poller(address, places, timeout_s)
    demand_library("mqtt")
    from heatertune.live.mqtt_source import MqttSource

    return MqttSource(address, places, timeout_s)


class _Rows:
    """Looks → rows, and what is between them."""

    def __init__(self, looking: Poller | MqttSource, file: _File, settings: RecordingSetup) -> None:
        self._looking, self._file, self._settings = looking, file, settings
        self._keys = tuple(_titles(looking.roles))
        self._every_s = settings.every_s or (0.0 if looking.interval_s is not None else 1.0)
        self.so_far = RecordingState(interval_s=looking.interval_s, notes=file.notes)
        self._shift_s: float | None = None if file.last_s is not None else 0.0
        self._first_s: float | None = None
        self._last_s: float | None = file.last_s
        self._step_s, self._pause_s, self._new_at = 0.0, 0.01, time.monotonic()
        self._reason, self._missing = "", tuple[str, ...]()

    def run(self, shown: Callable[[RecordingState], object], ended: Callable[[], bool],
            reopen: Callable[[], bool] = lambda: False) -> RecordingState:
        """Look until it is enough."""
        while not ended():
            if reopen():
                self._file.reopen()
            look = self._looked(shown, ended)
            if look is not None:
                self._take(look)
            self.so_far.torn, self.so_far.tells_new = self._looking.torn, self._looking.tells_new
            shown(self.so_far)
            if look is not None and self._enough():
                break
            if look is None or self._looking.interval_s is None:
                time.sleep(self._pause_s)
        self._file.check()
        return self.so_far

    def _enough(self) -> bool:
        return (self._settings.for_s is not None and self._first_s is not None and self._last_s is not None
                and self._last_s - self._first_s >= self._settings.for_s * (1.0 - 1e-9))

    def _looked(self, shown: Callable[[RecordingState], object], ended: Callable[[], bool]) -> Snapshot | None:
        """Return a look; where the link is lost, wait for it."""
        try:
            return self._looking.look()
        except LinkError as problem:
            self._reason = self.so_far.trouble = str(problem)
        tries = 0
        while not ended():
            shown(self.so_far)
            time.sleep(_PAUSES_S[min(tries, len(_PAUSES_S) - 1)])
            tries += 1
            try:
                self._looking.again()
                look = self._looking.look()
            except LinkError as problem:
                self.so_far.trouble = str(problem)
            else:
                self.so_far.trouble = ""
                return look
        return None

    def _take(self, look: Snapshot) -> None:
        """Write a look as a row, unless it is too early for one."""
        now = time.monotonic()
        if self._shift_s is None:  # a file is continued: by the PLC's own count, if that has gone on
            assert self._last_s is not None
            goes_on = look.time_s > self._last_s
            self._shift_s = 0.0 if goes_on else self._last_s + max(self._every_s, self._looking.interval_s or 0.0)
            self._reason = "continued" if goes_on else "continued; how long the gap is, is not known"
        at = look.time_s + self._shift_s
        if self._last_s is not None and at < self._last_s + self._every_s * (1.0 - 1e-6):
            return
        self._tell_gap(at, look)
        values = [look.signals[key] for key in self._keys if key in look.signals]
        is_row = self._are_numbers(at, look)
        cells = ",".join([f"{at:.9g}", *(f"{value:.7g}" for value in values)])
        self._file.write(f"{cells}\n" if is_row else f"# {cells}\n")
        self.so_far.rows += 1
        self.so_far.last = look._replace(time_s=at)
        self._first_s = at if self._first_s is None else self._first_s
        self._last_s, self._reason = at, ""
        self._pause_s = min(max(0.25 * (now - self._new_at), _SHORTEST_S), max(0.25 * self._every_s, 0.05))
        self._new_at = now

    def _are_numbers(self, at: float, look: Snapshot) -> bool:
        """Return whether all quantities are numbers; name a gap, in a comment, where they begin not to be."""
        missing = tuple(key for key in self._keys if key in look.signals and not math.isfinite(look.signals[key]))
        if missing and missing != self._missing:
            self.so_far.gaps += 1
            self._file.write(f"# gap from {at:.9g} s: no number for {', '.join(missing)}\n")
        self._missing = missing
        return not missing

    def _tell_gap(self, at: float, look: Snapshot) -> None:
        if self._last_s is None:
            return
        step = at - self._last_s
        usual = max(self._step_s, self._every_s, self._looking.interval_s or 0.0)
        why = "the PLC has restarted its count; the length of the gap is not known" if look.restarted else self._reason
        if why or step > _GAP * usual:
            self.so_far.gaps += 1
            self._file.write(f"# gap before {at:.9g} s: {why or 'no new reading'}\n")
        else:
            self._step_s = step


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


_LATE: Final = 1.1  # of the time asked for, by this machine's clock: a link that is gone does not hold up the others
_LATE_S: Final = 10.0
_BEAT_S: Final = 0.2


class RecordedLoop(NamedTuple):
    """A loop that runs: the name of its log, where its PLC is, and where that shows what (None: a simulated one)."""

    file: str
    address: Address
    places: Places | None


def record_all(
    loops: Sequence[RecordedLoop], folder: Path, settings: RecordingSetup, *,
    shown: Callable[[int], object] = lambda _: None, ended: Callable[[], bool] = lambda: False,
) -> dict[str, str]:
    """Record loops side by side, each on a connection of its own, and return what went wrong: file → why.

    A loop that cannot be reached, or shows nothing, does not stop the others.

    Args:
        loops: to record.
        folder: that the logs are written to.
        settings: how, with an end.
        shown: called now and then with the rows of all logs so far.
        ended: asked whether it is enough.
    """
    assert settings.for_s is not None
    last_s = time.monotonic() + _LATE * settings.for_s + _LATE_S
    so_far: dict[str, RecordingState] = {}
    wrong: dict[str, str] = {}

    def enough() -> bool:
        return ended() or time.monotonic() > last_s

    def one(loop: RecordedLoop) -> None:
        try:
            recording = record(loop.address, folder / loop.file, loop.places, settings, ended=enough,
                               shown=lambda state: so_far.__setitem__(loop.file, state))
            if not recording.rows:
                wrong[loop.file] = f"{loop.address.text}: nothing was recorded{_because(recording)}"
        except HeatertuneError as problem:
            wrong[loop.file] = str(problem)

    threads = [threading.Thread(target=one, args=(loop,), daemon=True) for loop in loops]
    for thread in threads:
        thread.start()
    for thread in threads:
        while thread.is_alive():
            thread.join(_BEAT_S)
            shown(sum(recording.rows for recording in list(so_far.values())))
    return wrong


def _because(state: RecordingState) -> str:
    return f": {state.trouble}" if state.trouble else ""


def is_address(text: str) -> bool:
    """Return whether a text is an address, and no path."""
    return "://" in text


def record_addresses(
    addresses: Sequence[str], folder: Path, settings: RecordingSetup, *, loops: str | Path | None = None,
    shown: Callable[[int], object] = lambda _: None, ended: Callable[[], bool] = lambda: False,
) -> tuple[dict[str, LoopEntry], list[dict[str, Any]]]:
    """Record the loops at some addresses; return file → loop of those recorded, and a row for each that was not.

    Args:
        addresses: of their PLCs, which are only read.
        folder: for the logs; it is made, and must not be there.
        settings: how long, and how often.
        loops: list of the loops, in which `file` is the address; see `heatertune.loops.measures.read_list`.
        shown: called now and then with the rows so far.
        ended: asked whether it is enough.

    Raises:
        InputError: an address that is none, or given twice; a list that is not right, or names another address; a
            folder that is there; no loop could be recorded.
    """
    entries = {} if loops is None else read_list(loops)
    for address in entries:
        if address not in addresses:
            raise InputError(f"{loops}: {address!r} is none of the addresses given")
    list_folder = Path() if loops is None else Path(loops).parent
    table: dict[str, LoopEntry] = {}
    running, wrong = [], {}
    for address in addresses:
        loop = entries.get(address, LoopEntry(name=address, file=address))
        file = _file_of(loop.name, table)
        table[file] = replace(
            loop, file=file, folder=None if loop.folder is None else str((list_folder / loop.folder).absolute()))
        where = address_of(address)
        try:
            running.append(RecordedLoop(file, where, _places(loop, list_folder)))
        except HeatertuneError as problem:
            wrong[file] = str(problem)
    if len(set(addresses)) < len(addresses):
        raise InputError("an address is given twice; each loop has one")
    try:
        folder.mkdir(parents=True)
    except OSError as problem:
        raise InputError(f"{folder}: cannot be made for the logs: {problem.strerror}") from None
    wrong |= record_all(running, folder, settings, shown=shown, ended=ended)
    if len(wrong) == len(table):
        raise InputError("no loop was recorded: " + "; ".join(dict.fromkeys(wrong.values())))
    rows = [{"name": table[file].name, "file": file, "outcome": "no log", "reason": why} for file, why in wrong.items()]
    return {file: loop for file, loop in table.items() if file not in wrong}, rows


def _file_of(name: str, taken: Mapping[str, object]) -> str:
    """Return a name for a log, none that is taken."""
    stem = re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("_.") or "loop"
    file, number = f"{stem}.csv", 2
    while file in taken:
        file, number = f"{stem}-{number}.csv", number + 1
    return file


def _places(loop: LoopEntry, folder: Path) -> Places | None:
    return places_from(design=None if loop.folder is None else folder / loop.folder,
                        map_file=None if loop.map is None else folder / loop.map)
