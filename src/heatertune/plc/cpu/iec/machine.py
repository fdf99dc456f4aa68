"""A machine that runs structured text: each statement becomes a function on the memory of an instance.

REAL is single precision, rounded once by each operation; whole numbers are computed in 32 bits with a sign and kept in
those of their variable. Numbers of one kind do not become another by themselves.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.text import (
    Arm,
    Assignment,
    Branches,
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
_Get = Callable[[_Memory], Any]
_Run = Callable[[_Memory], None]

#: whole type → bits, and whether it has a sign
_WHOLE: Final = {"BYTE": (8, False), "UINT": (16, False), "INT": (16, True), "DINT": (32, True)}
_KIND: Final = {"REAL": "REAL", "BOOL": "BOOL", **dict.fromkeys(_WHOLE, "WHOLE")}
_NOTHING: Final[Mapping[str, Value]] = {"REAL": 0.0, "BOOL": False, "WHOLE": 0}
_COMPARED: Final[Mapping[str, Callable[[Any, Any], bool]]] = {
    "=": operator.eq, "<>": operator.ne, "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}


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

    def __init__(self, units: Sequence[Unit], firmware: Mapping[str, Firmware]) -> None:
        """Take a text's units, and the blocks that the target brings along.

        Raises:
            InputError: there is not exactly one program; what is not known here.
        """
        known = {name.upper(): _of_firmware(block) for name, block in firmware.items()}
        for unit in (unit for unit in units if unit.kind == "FUNCTION_BLOCK"):
            known[unit.name] = _Compiler(unit, known).block()
        programs = [unit for unit in units if unit.kind == "PROGRAM"]
        if len(programs) != 1:
            raise InputError(f"{len(programs)} programs; expected one")
        self._block = _Compiler(programs[0], known).block()
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
        if name not in self:
            raise InputError(f"the program has no variable {name}")
        return self._block.places[name.upper()][1]


def _of_firmware(block: Firmware) -> _Block:
    names = list(block.variables)
    places = {name.upper(): (type_, place) for place, (name, type_) in enumerate(block.variables.items())}

    def run(memory: _Memory) -> None:
        outputs = memory[-1](dict(zip(names, memory, strict=False)))
        for name, value in outputs.items():
            memory[places[name.upper()][1]] = value

    return _Block(places, lambda: [*(_NOTHING[_KIND[type_]] for type_ in block.variables.values()), block.make()], run)


class _Compiler:
    """Translates one unit."""

    def __init__(self, unit: Unit, known: Mapping[str, _Block]) -> None:
        self._unit, self._known = unit, known
        self._places: dict[str, tuple[str, int]] = {}
        self._constant = {each.name for each in unit.variables if each.section.endswith("CONSTANT")}
        self._line = 0  # of the statement that is translated

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
        return _Block(self._places, lambda: [begin() for begin in begins], self._all(self._unit.body))

    def _wrong(self, what: str) -> InputError:
        where = self._unit.told(self._line) if self._line else self._unit.name
        return InputError(f"{where}; {what}")

    def _initial(self, given: Literal, type_: str) -> Value:
        if given.kind != _KIND[type_]:
            raise self._wrong(f"{given.value} is no {type_}")
        value: Value = _fit(type_)(single(given.value) if given.kind == "REAL" else given.value)
        return value

    def _all(self, statements: Iterable[Statement]) -> _Run:
        """Return what runs statements; where a controller would stop, InputError tells the line."""
        runs, unit = [(self._run(statement), statement.line) for statement in statements], self._unit

        def run(memory: _Memory) -> None:
            line = 0
            try:
                for each, line in runs:  # noqa: B007 - told in the error
                    each(memory)
            except InputError:
                raise
            except (ArithmeticError, ValueError):
                raise InputError(f"{unit.told(line)}; a controller stops here") from None

        return run

    def _run(self, statement: Statement) -> _Run:
        self._line = statement.line
        if isinstance(statement, Assignment):
            return self._assignment(statement)
        return self._call(statement) if isinstance(statement, Call) else self._branches(statement)

    def _assignment(self, statement: Assignment) -> _Run:
        type_, places = self._variable(statement.target)
        if statement.target.path[-1] in self._constant:
            raise self._wrong(f"{statement.target.path[-1]} is a constant")
        value = self._to(statement.value, type_)
        if len(places) == 1:
            (place,) = places

            def run(memory: _Memory) -> None:
                memory[place] = value(memory)
        else:
            instance, member = places

            def run(memory: _Memory) -> None:
                memory[instance][member] = value(memory)

        return run

    def _call(self, statement: Call) -> _Run:
        type_, place = self._places.get(statement.instance, ("", 0))
        block = self._known.get(type_)
        if block is None:
            raise self._wrong(f"{statement.instance} is no instance")
        inputs = list[tuple[int, _Get]]()
        for name, expression in statement.inputs:
            if name not in block.places:
                raise self._wrong(f"{type_} has no input {name}")
            wanted, there = block.places[name]
            inputs.append((there, self._to(expression, wanted)))
        body = block.run

        def run(memory: _Memory) -> None:
            own = memory[place]
            for there, value in inputs:
                own[there] = value(memory)
            body(own)

        return run

    def _branches(self, statement: Branches) -> _Run:
        arms = [self._arm(arm) for arm in statement.arms]

        def run(memory: _Memory) -> None:
            for holds, body in arms:
                if holds(memory):
                    body(memory)
                    return

        return run

    def _arm(self, arm: Arm) -> tuple[_Get, _Run]:
        self._line = arm.line
        holds = _always(True) if arm.condition is None else self._to(arm.condition, "BOOL")
        return holds, self._all(arm.body)

    def _variable(self, name: Name) -> tuple[str, tuple[int, ...]]:
        """Return type and place of a variable, or of an instance's."""
        places, known = self._places, list[int]()
        for part in name.path:
            if part not in places:
                raise self._wrong(f"{'.'.join(name.path)} is not declared")
            type_, place = places[part]
            known.append(place)
            places = self._known[type_].places if type_ in self._known else {}
        if type_ not in _KIND:
            raise self._wrong(f"{'.'.join(name.path)} is no number")
        return type_, tuple(known)

    def _to(self, expression: Expression, type_: str) -> _Get:
        """Return what gives an expression's value as a variable of a type keeps it."""
        kind, value = self._value(expression)
        if _KIND.get(type_) != kind:
            raise self._wrong(f"expected {type_}")
        if kind != "WHOLE" or type_ == "DINT":
            return value
        fit = _fit(type_)
        return lambda memory: fit(value(memory))

    def _value(self, expression: Expression) -> tuple[str, _Get]:
        """Return the kind of an expression and what gives its value."""
        if isinstance(expression, Literal):
            return expression.kind, _always(
                single(expression.value) if expression.kind == "REAL" else expression.value)
        if isinstance(expression, Name):
            type_, places = self._variable(expression)
            return _KIND[type_], _at(places)
        operands = [self._value(operand) for operand in expression.operands]
        kinds = [kind for kind, _ in operands]
        if (expression.sign, *kinds) not in _MADE:
            raise self._wrong(f"{expression.sign} does not go with {' and '.join(kinds)}")
        kind, makes = _MADE[(expression.sign, *kinds)]
        return kind, _applied(makes, *(value for _, value in operands))


def _always(value: Value) -> Callable[..., Value]:
    return lambda *_: value


def _at(places: tuple[int, ...]) -> _Get:
    if len(places) == 1:
        return operator.itemgetter(places[0])
    instance, member = places
    return lambda memory: memory[instance][member]


def _fit(type_: str) -> Callable[[Any], Any]:
    """Return what cuts a whole number to the bits of its type; others are as they are."""
    if type_ not in _WHOLE:
        return lambda value: value
    bits, signed = _WHOLE[type_]
    low, all_ = -(1 << bits - 1) if signed else 0, 1 << bits
    return lambda value: (value - low) % all_ + low


_dint: Final = _fit("DINT")


def _applied(makes: Callable[..., Any], *values: _Get) -> _Get:
    if len(values) == 1:
        (value,) = values
        return lambda memory: makes(value(memory))
    left, right = values
    return lambda memory: makes(left(memory), right(memory))


def _truncated(value: float) -> int:
    whole = math.trunc(value)
    if whole != _dint(whole):
        raise OverflowError
    return whole


def _quotient(dividend: int, divisor: int) -> int:
    """Return it cut towards zero."""
    share = abs(dividend) // abs(divisor)
    return share if (dividend < 0) == (divisor < 0) else -share


#: operation or function and the kinds of its operands → the kind of what it makes, and how
_MADE: Final[Mapping[tuple[str, ...], tuple[str, Callable[..., Any]]]] = {
    ("NOT", "BOOL"): ("BOOL", operator.not_),
    ("AND", "BOOL", "BOOL"): ("BOOL", operator.and_),
    ("OR", "BOOL", "BOOL"): ("BOOL", operator.or_),
    ("ABS", "REAL"): ("REAL", abs),
    ("UINT_TO_REAL", "WHOLE"): ("REAL", single),
    ("DINT_TO_REAL", "WHOLE"): ("REAL", single),
    ("TRUNC", "REAL"): ("WHOLE", _truncated),
    ("+", "REAL", "REAL"): ("REAL", lambda one, two: single(one + two)),
    ("-", "REAL", "REAL"): ("REAL", lambda one, two: single(one - two)),
    ("*", "REAL", "REAL"): ("REAL", lambda one, two: single(one * two)),
    ("/", "REAL", "REAL"): ("REAL", divided),
    ("+", "WHOLE", "WHOLE"): ("WHOLE", lambda one, two: _dint(one + two)),
    ("-", "WHOLE", "WHOLE"): ("WHOLE", lambda one, two: _dint(one - two)),
    ("*", "WHOLE", "WHOLE"): ("WHOLE", lambda one, two: _dint(one * two)),
    ("/", "WHOLE", "WHOLE"): ("WHOLE", lambda one, two: _dint(_quotient(one, two))),
    ("MOD", "WHOLE", "WHOLE"): ("WHOLE", lambda one, two: one - two * _quotient(one, two)),
    **{(sign, kind, kind): ("BOOL", asks) for sign, asks in _COMPARED.items() for kind in ("REAL", "WHOLE")},
}
