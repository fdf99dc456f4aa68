"""A machine that runs structured text: a unit becomes a Python function on the memory of an instance.

REAL is single precision, rounded once by each operation; whole numbers are computed in 32 bits with a sign and kept in
those of their variable. Numbers of one kind do not become another by themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.text import (
    Assignment,
    Call,
    Expression,
    Literal,
    Name,
    Statement,
    Unit,
)
from heatertune.plc.single import divided, single

__all__ = ["Firmware", "Program", "Value"]

Value = bool | int | float
#: variables of an instance by their places, instances in it being memories themselves
_Memory = list[Any]
_Run = Callable[[_Memory], None]

#: whole type → bits, and whether it has a sign
_WHOLE: Final = {"BYTE": (8, False), "UINT": (16, False), "INT": (16, True), "DINT": (32, True)}
_KIND: Final = {"REAL": "REAL", "BOOL": "BOOL", "TIME": "TIME", **dict.fromkeys(_WHOLE, "WHOLE")}
_NOTHING: Final[Mapping[str, Value]] = {"REAL": 0.0, "BOOL": False, "WHOLE": 0, "TIME": 0}
_COMPARED: Final = {"=": "==", "<>": "!=", "<": "<", ">": ">", "<=": "<=", ">=": ">="}


class Firmware(NamedTuple):
    """A block that the target brings along.

    Attributes:
        variables: name → type.
        make: makes an instance, cold; called with the values of all variables, it returns those of its outputs.
    """

    variables: Mapping[str, str]
    make: Callable[[], Callable[[Mapping[str, Value]], Mapping[str, Value]]]


class _Block(NamedTuple):
    """What an instance is made of: name → type and place, its memory when cold, and what a call does."""

    places: dict[str, tuple[str, int]]
    cold: Callable[[], _Memory]
    run: _Run


class Program:
    """The program of a text, with its memory."""

    def __init__(
        self, units: Sequence[Unit], firmware: Mapping[str, Firmware],
        time_to_real: Callable[[int], float] | None = None,
    ) -> None:
        """Take a text's units, and what the target brings along: blocks, and what TIME_TO_REAL gives of a time [ms].

        Raises:
            InputError: there is not exactly one program; what is not known here.
        """
        known = {name.upper(): _of_firmware(block) for name, block in firmware.items()}
        for unit in (unit for unit in units if unit.kind == "FUNCTION_BLOCK"):
            known[unit.name] = _Compiler(unit, known, time_to_real).block()
        programs = [unit for unit in units if unit.kind == "PROGRAM"]
        if len(programs) != 1:
            raise InputError(f"{len(programs)} programs; expected one")
        self._block = _Compiler(programs[0], known, time_to_real).block()
        self._named: dict[str, int] = {}  # name as it was asked for → place
        self.start()

    def start(self) -> None:
        """Give all variables their initial values."""
        self._memory = self._block.cold()

    def scan(self) -> None:
        """Run it once.

        Raises:
            InputError: a statement at which a controller would stop.
        """
        self._block.run(self._memory)

    def __contains__(self, name: str) -> bool:
        return name.upper() in self._block.places

    def __getitem__(self, name: str) -> Any:
        return self._memory[self._place(name)]

    def __setitem__(self, name: str, value: Value) -> None:
        self._memory[self._place(name)] = value

    def _place(self, name: str) -> int:
        if name not in self._named:
            if name not in self:
                raise InputError(f"the program has no variable {name}")
            self._named[name] = self._block.places[name.upper()][1]
        return self._named[name]


def _of_firmware(block: Firmware) -> _Block:
    names = list(block.variables)
    places = {name.upper(): (type_, place) for place, (name, type_) in enumerate(block.variables.items())}

    def run(memory: _Memory) -> None:
        outputs = memory[-1](dict(zip(names, memory, strict=False)))
        for name, value in outputs.items():
            memory[places[name.upper()][1]] = value

    return _Block(places, lambda: [*(_NOTHING[_KIND[type_]] for type_ in block.variables.values()), block.make()], run)


class _Compiler:
    """Translates one unit: its statements become a Python function of the instance's memory `m`."""

    def __init__(
        self, unit: Unit, known: Mapping[str, _Block], time_to_real: Callable[[int], float] | None
    ) -> None:
        self._unit, self._known, self._time_to_real = unit, known, time_to_real
        self._places: dict[str, tuple[str, int]] = {}
        self._constant = {each.name for each in unit.variables if each.section.endswith("CONSTANT")}
        self._line = 0  # of the statement that is translated
        self._lines = [0, 0]  # of the text, for each of the function's from 0 on: there is none, and its head

    def block(self) -> _Block:
        """Return the unit translated."""
        begins = list[Callable[[], Any]]()
        for place, variable in enumerate(self._unit.variables):
            if variable.name in self._places:
                raise self._wrong(f"{variable.name} is declared twice")
            self._places[variable.name] = (variable.type, place)
            if variable.type in self._known and variable.initial is None:
                begins.append(self._known[variable.type].cold)
                continue
            kind = _KIND.get(variable.type)
            if kind is None:
                raise self._wrong(f"{variable.name}: {variable.type} is no type that is known here")
            value = _NOTHING[kind] if variable.initial is None else self._initial(variable.initial, variable.type)
            begins.append(_always(value))
        return _Block(self._places, lambda: [begin() for begin in begins], self._body())

    def _wrong(self, what: str) -> InputError:
        where = self._unit.told(self._line) if self._line else self._unit.name
        return InputError(f"{where}; {what}")

    def _initial(self, given: Literal, type_: str) -> Value:
        if given.kind != _KIND[type_]:
            raise self._wrong(f"{given.value} is no {type_}")
        if given.kind == "REAL":
            return single(given.value)
        return _cut(int(given.value), *_WHOLE[type_]) if type_ in _WHOLE else given.value

    def _body(self) -> _Run:
        """Return what runs the unit's statements; where a controller would stop, InputError tells the line."""
        source = ["def body(m):", *self._all(self._unit.body, " ")]
        blocks = {f"run_{type_}": block.run for type_, block in self._known.items()}
        names = {**_FUNCTIONS, "time_to_real": self._time_to_real, **blocks}
        exec(compile("\n".join(source), self._unit.name, "exec"), names)
        body, unit, lines = names["body"], self._unit, self._lines

        def run(memory: _Memory) -> None:
            try:
                body(memory)
            except InputError:
                raise
            except (ArithmeticError, ValueError) as problem:
                made = problem.__traceback__ and problem.__traceback__.tb_next
                line = lines[made.tb_lineno if made else 0]
                raise InputError(f"{unit.told(line)}; a controller stops here") from None

        return run

    def _all(self, statements: Iterable[Statement], indent: str) -> Iterator[str]:
        """Return the lines that run statements, at least one."""
        made = False
        for statement in statements:
            self._line = statement.line
            for line in self._run(statement, indent):
                made = True
                yield line
        if not made:
            yield self._made(f"{indent}pass")

    def _made(self, line: str) -> str:
        self._lines.append(self._line)
        return line

    def _run(self, statement: Statement, indent: str) -> Iterator[str]:
        if isinstance(statement, Assignment):
            yield self._made(f"{indent}{self._assignment(statement)}")
        elif isinstance(statement, Call):
            yield from (self._made(f"{indent}{line}") for line in self._call(statement))
        else:
            for number, arm in enumerate(statement.arms):
                self._line = arm.line
                if arm.condition is None:
                    head = "else:"
                else:
                    head = f"{'elif' if number else 'if'} {self._to(arm.condition, 'BOOL')}:"
                yield self._made(f"{indent}{head}")
                yield from self._all(arm.body, f"{indent} ")

    def _assignment(self, statement: Assignment) -> str:
        type_, place = self._variable(statement.target)
        if statement.target.path[-1] in self._constant:
            raise self._wrong(f"{statement.target.path[-1]} is a constant")
        return f"{place} = {self._to(statement.value, type_)}"

    def _call(self, statement: Call) -> Iterator[str]:
        type_, place = self._places.get(statement.instance, ("", 0))
        block = self._known.get(type_)
        if block is None:
            raise self._wrong(f"{statement.instance} is no instance")
        for name, expression in statement.inputs:
            if name not in block.places:
                raise self._wrong(f"{type_} has no input {name}")
            wanted, there = block.places[name]
            yield f"m[{place}][{there}] = {self._to(expression, wanted)}"
        yield f"run_{type_}(m[{place}])"

    def _variable(self, name: Name) -> tuple[str, str]:
        """Return the type of a variable, or of an instance's, and where it stands in the memory."""
        places, there, type_ = self._places, "m", ""
        for part in name.path:
            if part not in places:
                raise self._wrong(f"{'.'.join(name.path)} is not declared")
            type_, place = places[part]
            there = f"{there}[{place}]"
            places = self._known[type_].places if type_ in self._known else {}
        if type_ not in _KIND:
            raise self._wrong(f"{'.'.join(name.path)} is no number")
        return type_, there

    def _to(self, expression: Expression, type_: str) -> str:
        """Return an expression, its value as a variable of a type keeps it."""
        kind, value = self._value(expression)
        if _KIND.get(type_) != kind:
            raise self._wrong(f"expected {type_}")
        return value if kind != "WHOLE" or type_ == "DINT" else _fitted(value, type_)

    def _value(self, expression: Expression) -> tuple[str, str]:
        """Return the kind of an expression, and it."""
        if isinstance(expression, Literal):
            return expression.kind, repr(single(expression.value) if expression.kind == "REAL" else expression.value)
        if isinstance(expression, Name):
            type_, place = self._variable(expression)
            return _KIND[type_], place
        operands = [self._value(operand) for operand in expression.operands]
        kinds = [kind for kind, _ in operands]
        if expression.sign == "TIME_TO_REAL" and self._time_to_real is None:
            raise self._wrong("the unit of TIME_TO_REAL is not told")
        if (expression.sign, *kinds) not in _MADE:
            raise self._wrong(f"{expression.sign} does not go with {' and '.join(kinds)}")
        kind, made = _MADE[(expression.sign, *kinds)]
        return kind, made.format(*(value for _, value in operands))


def _always(value: Value) -> Callable[[], Value]:
    return lambda: value


def _fitted(value: str, type_: str) -> str:
    """Return an expression of a whole number, cut to the bits of a type."""
    bits, signed = _WHOLE[type_]
    low = 1 << bits - 1 if signed else 0
    return f"(({value} + {low}) % {1 << bits} - {low})"


def _cut(value: int, bits: int, signed: bool) -> int:
    low = -(1 << bits - 1) if signed else 0
    return (value - low) % (1 << bits) + low


def _truncated(value: float) -> int:
    whole = math.trunc(value)
    if whole != _cut(whole, *_WHOLE["DINT"]):
        raise OverflowError
    return whole


def _quotient(dividend: int, divisor: int) -> int:
    """Return it cut towards zero."""
    share = abs(dividend) // abs(divisor)
    return share if (dividend < 0) == (divisor < 0) else -share


def _rest(dividend: int, divisor: int) -> int:
    return dividend - divisor * _quotient(dividend, divisor)


#: what a unit's function calls; of a literal beyond all singles `repr` gives "inf"
_FUNCTIONS: Final[Mapping[str, Any]] = {"single": single, "divided": divided, "truncated": _truncated,
                                        "quotient": _quotient, "rest": _rest, "inf": math.inf}
#: operation or function and the kinds of its operands → the kind of what it makes, and how
_MADE: Final[Mapping[tuple[str, ...], tuple[str, str]]] = {
    ("NOT", "BOOL"): ("BOOL", "(not {0})"),
    ("AND", "BOOL", "BOOL"): ("BOOL", "({0} & {1})"),
    ("OR", "BOOL", "BOOL"): ("BOOL", "({0} | {1})"),
    ("ABS", "REAL"): ("REAL", "abs({0})"),
    ("UINT_TO_REAL", "WHOLE"): ("REAL", "single({0})"),
    ("DINT_TO_REAL", "WHOLE"): ("REAL", "single({0})"),
    ("TIME_TO_REAL", "TIME"): ("REAL", "time_to_real({0})"),
    ("TRUNC", "REAL"): ("WHOLE", "truncated({0})"),
    ("/", "REAL", "REAL"): ("REAL", "divided({0}, {1})"),
    ("/", "WHOLE", "WHOLE"): ("WHOLE", _fitted("quotient({0}, {1})", "DINT")),
    ("MOD", "WHOLE", "WHOLE"): ("WHOLE", "rest({0}, {1})"),
    **{(sign, "REAL", "REAL"): ("REAL", f"single({{0}} {sign} {{1}})") for sign in "+-*"},
    **{(sign, "WHOLE", "WHOLE"): ("WHOLE", _fitted(f"({{0}} {sign} {{1}})", "DINT")) for sign in "+-*"},
    **{(sign, kind, kind): ("BOOL", f"({{0}} {asks} {{1}})") for sign, asks in _COMPARED.items()
       for kind in ("REAL", "WHOLE")},
}
