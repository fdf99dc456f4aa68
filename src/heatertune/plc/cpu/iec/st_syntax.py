"""Structured text → program organization units: declarations, and statements as a tree.

Names are the same in capitals and small letters (IEC 61131-3, 6.1.2), so a tree holds capitals. What is none of the
language's few forms used here is an InputError that names its line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final, NamedTuple

from heatertune.errors import InputError

__all__ = [
    "Arm", "Assignment", "Branches", "Call", "Expression", "Literal", "Name", "Operation", "ProgramUnit", "Statement",
    "Value", "Variable", "body_of", "literal", "units",
]

#: weakest first; all of them go from left to right
_INFIX: Final = (("OR",), ("AND",), ("=", "<>"), ("<", ">", "<=", ">="), ("+", "-"), ("*", "/", "MOD"))
_FUNCTIONS: Final = ("ABS", "TRUNC", "DINT_TO_REAL", "UINT_TO_REAL", "TIME_TO_REAL")
_SECTIONS: Final = ("VAR_INPUT", "VAR_OUTPUT", "VAR")
_KINDS: Final = ("FUNCTION_BLOCK", "PROGRAM")
_WORDS: Final = frozenset(
    {"IF", "THEN", "ELSIF", "ELSE", "END_IF", "NOT", "TRUE", "FALSE", "CONSTANT", "END_VAR", *_FUNCTIONS, *_SECTIONS,
     *_KINDS, *(f"END_{kind}" for kind in _KINDS), *(sign for signs in _INFIX for sign in signs)})
_TOKEN: Final = re.compile(
    r"(?P<blank>\s+|\(\*.*?\*\))|(?P<time>T#\d+m?s\b)|(?P<real>\d+\.\d+(E[+-]?\d+)?)|(?P<whole>\d+)|(?P<word>[A-Z_]\w*)"
    r"|(?P<sign>:=|<>|<=|>=|[-+*/=<>().,;:])", re.DOTALL | re.IGNORECASE)

Value = bool | int | float


@dataclass(frozen=True, slots=True)
class Literal:
    """A number or truth value; kind is REAL, BOOL, WHOLE or TIME, whose value is in ms."""

    kind: str
    value: Value


@dataclass(frozen=True, slots=True)
class Name:
    """A variable, or a variable of an instance."""

    path: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Operation:
    """An operation or a standard function of its operands."""

    sign: str
    operands: tuple[Expression, ...]


Expression = Literal | Name | Operation


@dataclass(frozen=True, slots=True)
class Assignment:
    """A variable gets a value."""

    target: Name
    value: Expression
    line: int = field(compare=False)


@dataclass(frozen=True, slots=True)
class Arm:
    """Statements under a condition; None: whatever it is."""

    condition: Expression | None
    body: tuple[Statement, ...]
    line: int = field(compare=False)


@dataclass(frozen=True, slots=True)
class Branches:
    """IF, ELSIF and ELSE: the first arm whose condition holds."""

    arms: tuple[Arm, ...]
    line: int = field(compare=False)


@dataclass(frozen=True, slots=True)
class Call:
    """A call of an instance with some of its inputs."""

    instance: str
    inputs: tuple[tuple[str, Expression], ...]
    line: int = field(compare=False)


Statement = Assignment | Branches | Call


class Variable(NamedTuple):
    """A declaration; without an initial value, a variable begins at nothing."""

    section: str
    name: str
    type: str
    initial: Literal | None


@dataclass(frozen=True, slots=True)
class ProgramUnit:
    """A function block or program."""

    kind: str
    name: str
    variables: tuple[Variable, ...]
    body: tuple[Statement, ...]
    lines: tuple[str, ...] = field(compare=False)

    def line_text(self, line: int) -> str:
        """Return a line of its text as errors name it."""
        return _place_text(self.lines, line)


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


def units(text: str) -> list[ProgramUnit]:
    """Return the function blocks and programs of a text.

    Raises:
        InputError: what is not known here.
    """
    return list(_units(text))


@lru_cache(8)  # a proof reads the same text for each of its runs
def _units(text: str) -> tuple[ProgramUnit, ...]:
    reader, program_units = _TokenReader(text), list[ProgramUnit]()
    while reader.kind != "end":
        program_units.append(reader.unit())
    return tuple(program_units)


def body_of(text: str) -> tuple[Statement, ...]:
    """Return the statements of a text that holds nothing else; errors as `units`."""
    reader = _TokenReader(text)
    statements = tuple(reader.statements())
    reader.take("")
    return statements


def literal(text: str) -> Literal:
    """Return the literal that a text is; errors as `units`."""
    reader = _TokenReader(text)
    value = reader.literal()
    reader.take("")
    return value


def _place_text(lines: tuple[str, ...], line: int) -> str:
    return f"line {line}: {lines[line - 1].strip()!r}" if line <= len(lines) else "the end of the text"


class _TokenReader:
    """Reads one token after the other."""

    def __init__(self, text: str) -> None:
        self._lines = tuple(text.splitlines())
        self._tokens = list(self._split(text))
        self._place = 0

    def _split(self, text: str) -> Iterator[_Token]:
        place, line = 0, 1
        while place < len(text):
            match = _TOKEN.match(text, place)
            if match is None:
                raise InputError(f"{_place_text(self._lines, line)}; {text[place]!r} is no sign that is known here")
            kind, token = str(match.lastgroup), match[0]
            if kind != "blank":
                word = token.upper()
                yield _Token("sign" if word in _WORDS else kind, word, line)
            place, line = match.end(), line + token.count("\n")
        yield _Token("end", "", len(self._lines) + 1)

    @property
    def _now(self) -> _Token:
        return self._tokens[self._place]

    @property
    def kind(self) -> str:
        """Kind of the token that comes: word, sign (words of the language among them), real, whole, time or end."""
        return self._now.kind

    def _expected(self, what: str) -> InputError:
        return InputError(f"{_place_text(self._lines, self._now.line)}; expected {what}")

    def _next(self, kind: str, what: str) -> str:
        if self.kind != kind:
            raise self._expected(what)
        self._place += 1
        return self._tokens[self._place - 1].text

    def _comes(self, *signs: str) -> bool:
        return self.kind == "sign" and self._now.text in signs

    def _taken(self, sign: str) -> bool:
        comes = self._comes(sign)
        self._place += comes
        return comes

    def take(self, sign: str) -> None:
        """Go over a sign, or the end (""); raise InputError where another comes."""
        if self.kind == "end" and not sign:
            return
        if not self._taken(sign):
            raise self._expected(sign or "the end of the text")

    def unit(self) -> ProgramUnit:
        """Return the unit that comes."""
        kind = next((kind for kind in _KINDS if self._taken(kind)), None)
        if kind is None:
            raise self._expected(" or ".join(_KINDS))
        name, variables = self._next("word", "a name"), list[Variable]()
        while section := next((section for section in _SECTIONS if self._taken(section)), None):
            constant = " CONSTANT" if self._taken("CONSTANT") else ""
            while not self._taken("END_VAR"):
                variables.append(self._variable(f"{section}{constant}"))
        body = tuple(self.statements())
        self.take(f"END_{kind}")
        return ProgramUnit(kind, name, tuple(variables), body, self._lines)

    def _variable(self, section: str) -> Variable:
        name = self._next("word", "a variable or END_VAR")
        self.take(":")
        type_ = self._next("word", "a type")
        initial = self.literal() if self._taken(":=") else None
        self.take(";")
        return Variable(section, name, type_, initial)

    def literal(self) -> Literal:
        """Return the literal that comes."""
        sign = -1 if self._taken("-") else 1
        if self.kind == "real":
            return Literal("REAL", sign * float(self._next("real", "")))
        if self.kind == "whole":
            return Literal("WHOLE", sign * int(self._next("whole", "")))
        if sign > 0 and self.kind == "time":
            text = self._next("time", "").removeprefix("T#").removesuffix("S")
            return Literal("TIME", int(text[:-1]) if text.endswith("M") else 1000 * int(text))
        if sign > 0 and self._comes("TRUE", "FALSE"):
            return Literal("BOOL", self._next("sign", "") == "TRUE")
        raise self._expected("a number, TRUE, FALSE or a time in s or ms")

    def statements(self) -> Iterator[Statement]:
        """Yield the statements that come."""
        while self.kind == "word" or self._comes("IF"):
            line = self._now.line
            yield self._branches(line) if self._taken("IF") else self._simple(line)
            self.take(";")

    def _branches(self, line: int) -> Branches:
        arms, begins = list[Arm](), line
        while True:
            condition = self._expression()
            self.take("THEN")
            arms.append(Arm(condition, tuple(self.statements()), begins))
            begins = self._now.line
            if not self._taken("ELSIF"):
                break
        if self._taken("ELSE"):
            arms.append(Arm(None, tuple(self.statements()), begins))
        self.take("END_IF")
        return Branches(tuple(arms), line)

    def _simple(self, line: int) -> Statement:
        target = self._name()
        if len(target.path) == 1 and self._taken("("):
            inputs = list[tuple[str, Expression]]()
            while not self._taken(")"):
                if inputs:
                    self.take(",")
                name = self._next("word", "an input")
                self.take(":=")
                inputs.append((name, self._expression()))
            return Call(target.path[0], tuple(inputs), line)
        self.take(":=")
        return Assignment(target, self._expression(), line)

    def _name(self) -> Name:
        path = [self._next("word", "a name")]
        while self._taken("."):
            path.append(self._next("word", "a name"))
        return Name(tuple(path))

    def _expression(self, level: int = 0) -> Expression:
        if level == len(_INFIX):
            return self._operand()
        expression = self._expression(level + 1)
        while self._comes(*_INFIX[level]):
            sign = self._next("sign", "")
            expression = Operation(sign, (expression, self._expression(level + 1)))
        return expression

    def _operand(self) -> Expression:
        if self._taken("("):
            operand = self._expression()
            self.take(")")
            return operand
        if self._taken("NOT"):
            return Operation("NOT", (self._operand(),))
        function = next((name for name in _FUNCTIONS if self._taken(name)), None)
        if function is not None:
            self.take("(")
            operand = self._expression()
            self.take(")")
            return Operation(function, (operand,))
        return self._name() if self.kind == "word" else self.literal()
