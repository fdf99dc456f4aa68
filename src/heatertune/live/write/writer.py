"""Words into a PLC, part by part: compared before, read back after, and taken back where anything is not as expected.

Nothing is written twice because an answer was lost: the PLC is asked what stands there, and that decides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from typing import Any, Final

from heatertune.errors import InputError, LinkDown, LinkError, PlcRefused, ReplyLost
from heatertune.live.hold import Hold
from heatertune.live.write.plc_block import BlockImage, BlockSnapshot, Peer, WritePart
from heatertune.live.write.write_record import Budget, RecordBroken, WriteRecord
from heatertune.plc.ramp import Number

__all__ = ["WriteEnd", "WriteOutcome", "Writer"]

Values = Mapping[str, Number]
_SCANS: Final = 2  # after which a program that writes words of its own has done so
_ROUNDS: Final = 5  # of taking back what was interrupted, or arrived late
_PAUSE_S: Final = 1.0  # between two looks for what may still arrive
_LATE_LOOK_S: Final = 10.0  # after a look, a write over what was seen in it is one over something unknown


class WriteOutcome(StrEnum):
    """How a write ended."""

    DONE = "done"
    NOT_DONE = "not done"
    ROLLED_BACK = "rolled back"
    PARTLY = "partly done"
    UNWATCHED = "done, not watched"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class WriteEnd:
    """The end of a write.

    Attributes:
        outcome: of it.
        message: what happened, one sentence.
        stands: the words in the PLC when it was last read; None: it could not be.
    """

    outcome: WriteOutcome
    message: str
    stands: Values | None = None

    @property
    def is_done(self) -> bool:
        """Whether all was done that was asked for."""
        return self.outcome is WriteOutcome.DONE

    def to_document(self) -> dict[str, Any]:
        """Return it as a record has it."""
        return {"outcome": self.outcome.value, "message": self.message,
                "stands": None if self.stands is None else dict(self.stands)}


class _Stopped(Exception):
    """Raised where the next part cannot be written; the text says why."""


#: what ends a write: nothing worse than that happens
_STOPS: Final = (_Stopped, LinkError, InputError)


@dataclass(frozen=True, slots=True)
class _Change:
    """What is written: parts in their order, and all words at both ends.

    Attributes:
        image: of the block that has the words.
        parts: in their order.
        before, after: all words.
        stored: word → what the device keeps in the place of what was written.
        pending: words whose part was accepted, and that stood there as before when they were last looked at.
        tried: parts that were put back.
        unsettled: words that were put back, and not seen standing as before since then.
    """

    image: BlockImage
    parts: Sequence[WritePart]
    before: Values
    after: Values
    stored: dict[str, Number] = field(default_factory=dict)
    pending: set[str] = field(default_factory=set)
    tried: set[tuple[str, ...]] = field(default_factory=set)
    unsettled: set[str] = field(default_factory=set)

    def is_written(self, name: str, value: Number) -> bool:
        """Return whether a word stands there as this change left it, whole or with some of its bytes only.

        What is no number is nobody's value: this change may be behind it.
        """
        return (not math.isfinite(value) or value in (self.after[name], self.stored.get(name))
                or self.image.is_torn(name, value, self.before[name], self.after[name]))

    def left_of(self, names: Iterable[str], values: Values) -> list[str]:
        """Return which words stand there as written though they were put back, and take note of neither side's."""
        left = [name for name in names if self.is_written(name, values[name])]
        self.settle(values)
        self.stored.update({name: values[name] for name in names
                            if name not in left and values[name] != self.before[name]})
        return left

    def settle(self, values: Values) -> dict[str, Number]:
        """Return words that were put back, or may still arrive, and stand at a value of neither side.

        It is the device's own in the place of what was sent, or somebody else's. A word that was put back and stands as
        before is settled: what comes after is another's.
        """
        self.unsettled.difference_update([name for name in self.unsettled if values[name] == self.before[name]])
        return {name: values[name] for name in self.names
                if (name in self.unsettled or (name in self.pending and values[name] != self.before[name]))
                and not self.is_written(name, values[name])}

    @property
    def names(self) -> list[str]:
        """The words that differ."""
        return [name for part in self.parts for name in part.names]


class Writer:
    """What writes to one PLC, and records it.

    Attributes:
        peer: the PLC.
        record: that every step goes into first.
        looks: what was seen before each part was written, and when it was read back.
    """

    def __init__(
        self, peer: Peer, hold: Hold, record: WriteRecord, budget: Budget, progress: Callable[[str], object] = str, *,
        place: str = "",
    ) -> None:
        """Take a PLC.

        Args:
            peer: the PLC.
            hold: on it, open.
            record: that every step goes into first.
            budget: that every write is counted in.
            progress: called with a sentence where something takes long.
            place: address of the block in the hold's way back, where that has several.
        """
        self._place = place
        self.peer, self.record, self._budget, self._progress = peer, record, budget, progress
        self._hold, self._clock = hold, peer.clock
        self._standing: BlockImage = peer.standing
        self._looked_s = 0.0
        self.looks: list[BlockSnapshot] = []

    def write(self, parts: Sequence[WritePart], before: Values, after: Values) -> WriteEnd:
        """Write parts in their order, and take back those that were written where one cannot be.

        Args:
            parts: what differs.
            before: all words, as they are expected to stand there.
            after: all words, as they are to stand there.
        """
        change = _Change(self._standing, parts, before, after)
        expected, sent = dict(before), False
        try:
            for part in parts:
                self._demand_left(part)
            for part in parts:
                self._expected(expected, change.pending)
                sent = True
                self._put(part, change)
                self._demand_stored(part.names, change)
                expected |= {name: after[name] for name in part.names}
            return self._read_back(expected, change)
        except (*_STOPS, KeyboardInterrupt) as stopped:
            why = _why(stopped)
            self.peer.close()  # what is under way when somebody interrupts must not be taken for another's answer
            return self._safely(change, why) if sent else WriteEnd(WriteOutcome.NOT_DONE, f"nothing was sent: {why}")

    def restore(
        self, parts: Sequence[WritePart], before: Values, after: Values, why: str,
        device_values: Values | None = None,
    ) -> WriteEnd:
        """Put back what a write has changed, the last first, and nothing that somebody else has changed since.

        Args:
            parts: as they were written.
            before: the words as they were.
            after: the words as they were written.
            why: it is done.
            device_values: words that stand at another value than was written, and are put back, too.
        """
        return self._safely(_Change(self._standing, parts, before, after, dict(device_values or {})), why)

    def demand_new(self, before: BlockSnapshot, ended: WriteEnd) -> WriteEnd:
        """Return the end of a write that is not watched: not done where what was read back may be a gateway's copy.

        Args:
            before: what was seen before the write.
            ended: its end.
        """
        look = self.looks[-1]
        written = {name: before.values[name] for name in self._standing.own}
        if look.is_new(before) or self._standing.with_words(look.content, written) != before.content:
            return ended
        return WriteEnd(WriteOutcome.UNWATCHED, f"{ended.message}, but nothing else in the block has moved since: a "
                        "copy in a gateway and a CPU that stands look the same", ended.stands)

    def end(self, ended: WriteEnd) -> WriteEnd:
        """Record an end, and close the hold where what stands in the PLC is known to be as it is to stay."""
        if ended.outcome not in (WriteOutcome.UNKNOWN, WriteOutcome.PARTLY):
            self._hold.close()
        try:
            self.record.write_line("end", **ended.to_document())
        except RecordBroken as problem:
            return replace(ended, message=f"{ended.message}; {problem}")
        return ended

    def _safely(self, change: _Change, why: str) -> WriteEnd:
        try:
            self._await(change)
            for _ in range(_ROUNDS + len(change.parts)):
                try:
                    ended = self._taken_back(change, why)
                except KeyboardInterrupt:  # a second one: what was begun is ended all the same
                    self.peer.close()
                    continue
                if (late := self._late(change, ended)) is not None:
                    return late
            raise LinkDown("again and again, requests have no answer")
        except LinkError as problem:
            return WriteEnd(WriteOutcome.UNKNOWN, f"{why}; whether {', '.join(change.names)} stand there is not known: "
                         f"{problem}; heatertune rollback {self.record.path} asks again")

    def _await(self, change: _Change) -> None:
        """Wait for what was sent and was not seen: where an earlier part were put back first, it would meet others.

        What stands there meanwhile is a set of words that is proven stable.

        Raises:
            LinkError: the PLC cannot be read.
        """
        if change.pending and self._hold.left_s:
            self._noted("waiting", message=f"{', '.join(sorted(change.pending))} may still arrive")
        with suppress(KeyboardInterrupt):  # nothing is waited for any more
            while change.pending and (left_s := self._hold.left_s):
                self._progress(f"looking for {left_s:.0f} s more whether {', '.join(sorted(change.pending))} arrive")
                self._clock.sleep(min(_PAUSE_S, left_s))
                values = self.peer.look().values
                if arrived := {name for name in change.pending if change.is_written(name, values[name])}:
                    change.pending.difference_update(arrived)
                    self._noted("arrived late", stands=dict(values))

    def _late(self, change: _Change, ended: WriteEnd) -> WriteEnd | None:
        """Look at the PLC until no request can still arrive.

        Returns:
            The end; None: one has arrived, and what stands there has to be judged again.

        Raises:
            LinkError: the PLC cannot be read.
        """
        if not self._hold.left_s:
            return self._nothing_more(change, ended) if change.pending else ended
        self._noted("waiting", message="a request may still arrive")
        try:
            while True:
                if left_s := self._hold.left_s:
                    self._progress(f"looking for {left_s:.0f} s more whether a request without an answer still arrives")
                    self._clock.sleep(min(_PAUSE_S, left_s))
                values = self.peer.look().values
                if self._has_arrived(change, ended, values):
                    return None
                if not left_s:  # the look was later than the last instant at which anything can arrive
                    return self._nothing_more(change, replace(ended, stands=values))
        except KeyboardInterrupt:
            raise LinkDown("interrupted while a request without an answer may still arrive") from None

    def _nothing_more(self, change: _Change, ended: WriteEnd) -> WriteEnd:
        if change.pending and not self.peer.moved:
            raise LinkDown(f"{', '.join(sorted(change.pending))} may have been taken, and nothing in the block has "
                           "moved since: it may be a copy in a gateway")
        return replace(ended, message=f"{ended.message}; nothing more has arrived since")

    def _has_arrived(self, change: _Change, ended: WriteEnd, values: Values) -> bool:
        """Return whether a word that was written stands there, or does no longer, since an end was found."""
        stands = ended.stands or {}
        own = change.unsettled | change.pending
        if all(values[name] == stands.get(name) or not (name in own or change.is_written(name, values[name])
               or change.is_written(name, stands[name])) for name in change.names):
            return False
        self._noted("arrived late", stands=dict(values))
        return True

    def _demand_left(self, part: WritePart) -> None:
        if spent := self._budget.spent(part.names):
            raise _Stopped(spent)

    def _expected(self, expected: Values, pending: Collection[str]) -> None:
        look, self._looked_s = self.peer.look(), self._clock.now_s()
        if unlike := self._unlike(look.values, expected):
            late = {name: value for name, value in expected.items() if name not in pending}
            raise _Stopped(f"somebody has changed the words meanwhile: {unlike}" if self._unlike(look.values, late) else
                           f"accepted, and not there yet: {unlike}")
        self.looks.append(look)
        self.record.write_line("compared", **look.to_document())

    def _unlike(self, values: Values, expected: Values) -> str:
        return ", ".join(f"{name} is {values[name]:g}, not {expected[name]:g}" for name in self._standing.own
                         if values[name] != expected.get(name, values[name]))

    def _put(self, part: WritePart, change: _Change, *, back: bool = False) -> None:
        """Write a part over what was looked at; raise `_Stopped` where it does not stand there afterwards.

        What was before is put back even where that can be neither recorded nor counted.
        """
        if not back and not self._clock.passed_s(self._looked_s) <= _LATE_LOOK_S:
            raise _Stopped("this machine was asleep, or the program stopped, behind the last look")
        with suppress(*((InputError,) if back else ())):
            self.record.write_line("writing", **part.to_document())
            self._budget.count(part.names)
            self._hold.note_request()
        try:
            self._hold.send(partial(self.peer.write, part, part.after))
        except (PlcRefused, LinkDown) as problem:
            self.record.write_line("not written", message=str(problem))
            raise _Stopped(str(problem)) from None
        except ReplyLost as problem:
            self.record.write_line("no answer", message=str(problem))
            self._decide(part, str(problem), change)
        else:
            self.record.write_line("written", names=list(part.names))

    def _demand_stored(self, names: Sequence[str], change: _Change) -> None:
        """Look at words that were just written; raise `_Stopped` where the device keeps other values in their place."""
        values = self.peer.look().values
        for name in names:
            if values[name] == change.before[name] != change.after[name]:
                change.pending.add(name)
                continue
            change.pending.discard(name)
            if not change.is_written(name, values[name]):
                change.stored[name] = values[name]
        if change.stored:
            self._own_stored(change)
            differences = ", ".join(f"{name} = {value:g} in place of {change.after[name]:g}"
                                    for name, value in change.stored.items())
            raise _Stopped(f"the device keeps {differences}: a limit of its own, or a scale")

        if not change.pending:
            self._hold.note_stored()

    def _own_stored(self, change: _Change) -> None:
        """Have the way back on the disk hold what the device keeps, too."""
        look = self.peer.look()
        for part in change.parts:
            at = self._standing.at(part.start)
            if change.stored.keys() & set(part.names):
                self._hold.add_own(part.start, look.content[at : at + len(part.after)], self._place)

    def _decide(self, part: WritePart, problem: str, change: _Change) -> None:
        """Ask the PLC whether a part arrived; raise `_Stopped` where it did not."""
        look = self.peer.later(self.peer.look(), _SCANS)
        begin = self._standing.at(part.start)
        arrived = look.content[begin : begin + len(part.after)] == part.after
        self.record.write_line("asked", arrived=arrived, **look.to_document())
        if not arrived:
            change.pending.update(part.names)
            raise _Stopped(f"{problem}; two scans later it is not there")

    def _read_back(self, expected: Values, change: _Change) -> WriteEnd:
        first = look = self.peer.look()
        self._demand_stored(tuple(change.pending), change)
        for again in (False, True):
            look = self.peer.later(look, _SCANS) if again else look
            self.looks.append(look)
            self.record.write_line("read back", again=again, **look.to_document())
            if unlike := self._unlike(look.values, expected):
                raise _Stopped(f"read back{' two scans later' if again else ''}, {unlike}")
        if first.status is not None and look.status is not None and look.status.scans - first.status.scans < _SCANS:
            return WriteEnd(WriteOutcome.UNWATCHED, "the words stand in the PLC, but it has run no scan with them",
                            look.values)
        return WriteEnd(WriteOutcome.DONE, "the words stand in the PLC: read back, and again two scans later",
                        look.values)

    def _taken_back(self, change: _Change, why: str) -> WriteEnd:
        """Put back, the last part first, the words that stand there as they were written; errors as `Peer.look`."""
        self._noted("taking back", why=why)
        problems = list[str]()
        for part in reversed(change.parts):
            if not self._put_back(part, change, problems):
                break  # an earlier part would meet it out of turn
        look = self.peer.later(self.peer.look(), _SCANS)
        self._noted("read back", again=True, **look.to_document())
        _demand_numbers(change.names, look.values)
        if left := [name for name in change.names if change.is_written(name, look.values[name])]:
            return WriteEnd(WriteOutcome.PARTLY,
                            f"{why}; {', '.join(left)} stand there as written and could not be taken "
                         f"back: {'; '.join(problems) or 'somebody has written them again'}", look.values)
        if changed := change.settle(look.values):
            rest = ", ".join(f"{name} is {value:g}, not {change.before[name]:g}" for name, value in changed.items())
            self._noted("in doubt", words=changed)
            put_back = "put back, but " if change.tried else ""
            return WriteEnd(WriteOutcome.PARTLY, f"{why}; {put_back}{rest}: the device keeps it in place of what was "
                            "sent, or somebody else has written it", look.values)
        if change.stored:  # what stands there from now on is another's
            self._noted("in doubt", words={})
        others = self._unlike(look.values, change.before)
        note = f"; besides, somebody has changed the words: {others}" if others else ""
        if not change.pending:
            self._hold.note_stored()
        if not change.tried:
            return WriteEnd(WriteOutcome.NOT_DONE, f"{why}; nothing that was written stands there{note}", look.values)
        return WriteEnd(WriteOutcome.ROLLED_BACK, f"{why}; what was written is taken back{note}", look.values)

    def _put_back(self, part: WritePart, change: _Change, problems: list[str]) -> bool:
        """Put back the words of a part that stand there as written; return whether they are, as far as that is known.

        Args:
            part: that was written.
            change: it is part of.
            problems: that are met are added.
        """
        look, mine = self.peer.look(), list[str]()
        while backs := self._standing.parts(look.content, {
                name: change.before[name] for name in part.names
                if name not in mine and change.is_written(name, look.values[name])}):
            back = backs[0]  # of several, where somebody has changed a word between them
            mine += back.names
            change.tried.add(part.names)
            change.pending.difference_update(part.names)
            change.unsettled.update(back.names)
            try:
                self._put(back, change, back=True)
            except _STOPS as stopped:
                problems.append(_why(stopped))
            look = self.peer.look()
        if not (unseen := change.left_of(mine, look.values)) or not self._hold.left_s:
            return True
        problems.append(f"{', '.join(unseen)}: accepted, and not there yet")
        return False

    def _noted(self, step: str, **what: Any) -> None:
        """Record a step of taking back, which is made even where it cannot be recorded."""
        with suppress(RecordBroken):
            self.record.write_line(step, **what)


def _demand_numbers(names: Iterable[str], values: Values) -> None:
    """Raise LinkDown where words that were put back are read as no number: whether they are back is not known."""
    if blind := ", ".join(name for name in names if not math.isfinite(values[name])):
        raise LinkDown(f"{blind}: put back, and read as no number")


def _why(stopped: BaseException) -> str:
    return "interrupted" if isinstance(stopped, KeyboardInterrupt) else str(stopped)
