"""Every exception heatertune raises on purpose.

HeatertuneError
├── InputError                 something the user gave cannot be used
│   ├── LogError               a log file, with line, column and value
│   ├── DocumentError          a JSON document of a stage
│   ├── UnknownName            a target, rule or table that does not exist
│   ├── UnknownOption          a keyword that a function does not have
│   └── OutOfRange             a value outside its physical or logical range
├── NotRepresentable           a design the PLC's words cannot hold
├── ExportRefused              words whose proof failed, without --force
└── LinkError                  a PLC that was asked over a network
    ├── PlcRefused             it answered: no; nothing has changed
    ├── LinkDown               it was not asked: there is no connection
    └── ReplyLost              it was asked, and what it did is not known
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

__all__ = [
    "LONGEST", "DocumentError", "ExportRefused", "HeatertuneError", "InputError", "LinkDown", "LinkError", "LogError",
    "NotRepresentable", "OutOfRange", "PlcRefused", "ReplyLost", "UnknownName", "UnknownOption", "closest",
    "demand_known", "did_you_mean", "one_line",
]

#: characters of an error
LONGEST: Final = 480
#: letters up to which every name is near to some other
_SHORT: Final = 2
_BROKEN: Final = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]+")


def one_line(text: str) -> str:
    """Return a text as one line: what would break it is escaped, the middle of a long one left out."""
    line = _BROKEN.sub(lambda broken: broken[0].encode("unicode_escape").decode(), text)
    half = LONGEST // 2 - 2
    return line if len(line) <= LONGEST else f"{line[:half]} … {line[-half:]}"


def closest(name: str, names: Iterable[str]) -> str | None:
    """Return the one of some names that is near to another one, whatever the case; None if there is none."""
    import difflib

    lower = {each.lower(): each for each in names}
    matches = [each for each in lower if each.startswith(name.lower())]
    near = matches if len(matches) == 1 else difflib.get_close_matches(name.lower(), list(lower), n=1)
    return lower[near[0]] if near and len(name) > _SHORT else None


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return ": did you mean …?" where a known name is near to one that is not; else nothing."""
    near = closest(name, names)
    return "" if near is None else f": did you mean {near}?"


class HeatertuneError(Exception):
    """Base of all errors a user can meet; its text is one line of at most `LONGEST` characters."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class InputError(HeatertuneError, ValueError):
    """Raised when something the user gave cannot be used."""


class LogError(InputError):
    """Raised when a log file cannot be understood.

    The text names the file and, where known, the line (1 = first line of the file), the column,
    the value found there, and what would be right.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path,
        line: int | None = None,
        column: str | None = None,
        value: str | None = None,
        expected: str | None = None,
    ) -> None:
        self.problem, self.file, self.line = problem, str(file), line
        self.column, self.value, self.expected = column, value, expected
        place = f"{file}" + (f", line {line}" if line is not None else "")
        place += f", column {column}" if column is not None else ""
        shown = f" {value!r}" if value is not None else ""
        expectation = f"; expected {expected}" if expected is not None else ""
        super().__init__(f"{place}: {problem}{shown}{expectation}")

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild_log_error, (self.problem, self.file, self.line, self.column, self.value, self.expected)


def _rebuild_log_error(
    problem: str, file: str, line: int | None, column: str | None, value: str | None, expected: str | None
) -> LogError:
    return LogError(problem, file=file, line=line, column=column, value=value, expected=expected)


class DocumentError(InputError):
    """Raised when a stage's JSON document is not what the next stage can read."""


class UnknownName(InputError):
    """Raised when a name is not one of those that exist."""

    def __init__(self, kind: str, name: str, names: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, tuple(names)
        near = closest(name, self.known)
        meant = "" if near is None else f"; did you mean {near!r}?"
        super().__init__(f"unknown {kind} {name!r}{meant or ';'} known: {', '.join(self.known)}")

    def __reduce__(self) -> tuple[object, ...]:
        return UnknownName, (self.kind, self.name, self.known)


class UnknownOption(InputError, TypeError):
    """Raised when a function is called with a keyword that it does not have."""

    def __init__(self, name: str, names: Iterable[str], *, near: str | None = None) -> None:
        self.name, self.known = name, tuple(names)
        self.near = near or closest(name, self.known)
        meant = f"did you mean {self.near!r}?" if self.near else f"known: {', '.join(self.known)}"
        super().__init__(f"no option {name!r}; {meant}")

    def __reduce__(self) -> tuple[object, ...]:
        return UnknownOption, (self.name, self.known)


def demand_known(names: Iterable[str], options: Iterable[str], near: Mapping[str, str] | None = None) -> None:
    """Refuse keywords that a function does not have; `near`: wrong name → the right one, where that is known.

    Raises:
        UnknownOption: the first of them.
    """
    valid = tuple(options)
    for name in names:
        if name not in valid:
            raise UnknownOption(name, valid, near=(near or {}).get(name))


class OutOfRange(InputError):
    """Raised when a value breaks the rule of its field."""

    def __init__(self, field: str, value: object, rule: str) -> None:
        self.field, self.value, self.rule = field, value, rule
        super().__init__(f"{field} = {value!r} is out of range: must be {rule}")

    def __reduce__(self) -> tuple[object, ...]:
        return OutOfRange, (self.field, self.value, self.rule)


class NotRepresentable(HeatertuneError, ValueError):
    """Raised when a design does not fit the words of the target; nothing is clipped."""

    def __init__(self, field: str, value: float, allowed: str, remedy: str) -> None:
        self.field, self.value, self.allowed, self.remedy = field, value, allowed, remedy
        super().__init__(f"{field} would be {value:g}, allowed {allowed}; {remedy}")

    def __reduce__(self) -> tuple[object, ...]:
        return NotRepresentable, (self.field, self.value, self.allowed, self.remedy)


class ExportRefused(HeatertuneError):
    """Raised when the proof of the words ended in FAIL and the export was not forced."""


class LinkError(HeatertuneError):
    """Raised when a PLC that was asked over a network does not do it; which kind says what is known afterwards."""


class PlcRefused(LinkError):
    """Raised when the PLC answered that it does not; nothing has changed."""


class LinkDown(LinkError):
    """Raised when there is no connection: the PLC was not asked, and nothing has changed."""


class ReplyLost(LinkError):
    """Raised when a request was sent and no answer came: whether a write arrived is not known."""
