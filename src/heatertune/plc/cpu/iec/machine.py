"""A machine that runs structured text: programs, and the blocks and functions that the target supplies.

REAL is single precision, rounded once per operation; whole numbers are computed in 32 bits with a sign and stored in
the bits of their variable. Types are not converted implicitly.

Each program unit becomes one Python function on the program's memory: a row of REALs and a row of all other numbers.
Literals are cells of that memory, too, so texts that differ only in numbers share one compiled function. `run_tape`
runs many scans in one compiled loop.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from types import CodeType, FunctionType
from typing import Any, Final, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from heatertune.compiled import bound, compile_function, worth_compiling
from heatertune.compiled.loader import BEYOND, functions_from_text
from heatertune.errors import InputError
from heatertune.plc.cpu.iec.st_syntax import (
    Assignment,
    Call,
    Expression,
    Literal,
    Name,
    ProgramUnit,
    Statement,
)
from heatertune.plc.single_precision import divide_single, single

__all__ = [
    "KEEP", "KIND", "NOTHING", "Firmware", "Got", "InstanceLayout", "InstanceMemory", "Place", "Run", "Tape",
    "TextProgram", "Value", "row_of", "run_tape", "translate_unit",
]


#: of a whole number: it stays as it is
KEEP: Final = -(1 << 62)
#: scans, one by one, that take as long as to compile a program
_MOST_PLAIN: Final = 400_000

#: variable → its value after each scan
Got = Mapping[str, npt.NDArray[Any]]


class Tape(NamedTuple):
    """What is put in and asked for.

    Attributes:
        scans: how many.
        reals: REAL → its values before each scan, nan where it stays as it is.
        wholes: other variable → the same, `KEEP` where it stays as it is.
        asked: names of what is read after each scan.
    """

    scans: int
    reals: Mapping[str, npt.NDArray[np.float64]]
    wholes: Mapping[str, npt.NDArray[np.int64]]
    outputs: Sequence[str]


def run_tape(
    run: FunctionType, reals: list[float], wholes: list[int], tape: Tape, place: Mapping[str, tuple[int, int]]
) -> Got | None:
    """Run a program's function on its memory; return what is asked for.

    None: that is not worth it, a controller would stop somewhere, or a number is no REAL; the memory is as it was then.

    Args:
        run: the function.
        reals: the row of REALs.
        wholes: the row of other numbers.
        tape: see there.
        place: name → row and place.
    """
    loop = bound(_taped, scan=run)
    if not worth_compiling(tape.scans, f"text {run.__qualname__}", _MOST_PLAIN, loop):
        return None
    r, w = np.array(reals, dtype=np.float32), np.array(wholes, dtype=np.int64)
    read = [[name for name in tape.outputs if place[name][0] == row] for row in (0, 1)]
    got = np.empty((len(read[0]), tape.scans), dtype=np.float32), np.empty((len(read[1]), tape.scans), dtype=np.int64)
    puts = [(_rows(values, tape.scans, kind), _places(values, place)) for values, kind in (
        (tape.reals, np.float32), (tape.wholes, np.int64))]
    if any(not np.array_equal(row, values, equal_nan=True) for row, values in zip(
            puts[0][0], tape.reals.values(), strict=True)):
        return None
    try:
        compile_function(loop)(r, w, *puts[0], *puts[1], got[0], _places(read[0], place), got[1],
                               _places(read[1], place), tape.scans)
    except ArithmeticError:
        return None
    reals[:], wholes[:] = r.tolist(), w.tolist()
    return {name: got[row][k].astype((np.float64, np.int64)[row]) for row in (0, 1) for k, name in enumerate(read[row])}


def _rows(inputs: Mapping[str, npt.NDArray[Any]], scans: int, kind: type) -> npt.NDArray[Any]:
    return np.array(list(inputs.values()), dtype=kind).reshape(len(inputs), scans)


def _places(names: Sequence[str] | Mapping[str, Any], place: Mapping[str, tuple[int, int]]) -> npt.NDArray[np.int64]:
    return np.array([place[name][1] for name in names], dtype=np.int64)


def scan(r: Any, w: Any, f: Any, a: int, b: int, c: int) -> None:
    """Stand for the program's function, which is bound here."""


def _taped(  # noqa: PLR0913 - as the compiler takes them
    r: Any, w: Any, put_r: Any, at_r: Any, put_w: Any, at_w: Any, got_r: Any, of_r: Any, got_w: Any, of_w: Any,
    scans: int,
) -> None:
    for k in range(scans):
        for j in range(len(at_r)):
            value = put_r[j, k]
            if not math.isnan(value):
                r[at_r[j]] = value
        for j in range(len(at_w)):
            whole = put_w[j, k]
            if whole != KEEP:
                w[at_w[j]] = whole
        scan(r, w, at_w, 0, 0, 0)
        for j in range(len(of_r)):
            got_r[j, k] = r[of_r[j]]
        for j in range(len(of_w)):
            got_w[j, k] = w[of_w[j]]


Value = bool | int | float
#: of a unit: the rows of REALs and of other numbers, instances of firmware, and where its own begin in each
Run = Callable[[list[Any], list[Any], list[Any], int, int, int], None]

#: whole type → bits, and whether it has a sign
_WHOLE: Final = {"BYTE": (8, False), "UINT": (16, False), "INT": (16, True), "DINT": (32, True)}
KIND: Final = {"REAL": "REAL", "BOOL": "BOOL", "TIME": "TIME", **dict.fromkeys(_WHOLE, "WHOLE")}
NOTHING: Final[Mapping[str, Value]] = {"REAL": 0.0, "BOOL": False, "WHOLE": 0, "TIME": 0}
_COMPARED: Final = {"=": "==", "<>": "!=", "<": "<", ">": ">", "<=": "<=", ">=": ">="}
_ROWS: Final = ("r", "w", "f")
_FIRST: Final = ("a", "b", "c")


#: type of a variable, and how much of each row is before it
Place = tuple[str, tuple[int, int, int]]


class InstanceMemory(NamedTuple):
    """Rows of a memory: REALs, other numbers, instances of firmware or what makes them."""

    reals: list[Any]
    wholes: list[Any]
    firmware: list[Any]

    @property
    def size(self) -> tuple[int, int, int]:
        """How much stands in each row."""
        return len(self.reals), len(self.wholes), len(self.firmware)

    def grown(self, memory: InstanceMemory) -> tuple[int, int, int]:
        """Add another's rows; return where they begin."""
        begin = self.size
        for mine, more in zip(self, memory, strict=True):
            mine.extend(more)
        return begin

    def with_one(self, kind: str, value: Value) -> tuple[int, int, int]:
        """Add a number; return where it stands, in the row of its kind."""
        begin = self.size
        (self.reals if kind == "REAL" else self.wholes).append(value)
        return begin


class InstanceLayout(NamedTuple):
    """What an instance is made of.

    Attributes:
        places: name → where it stands.
        cold: its memory, firmware not yet made.
        run: what a call does.
        lines: code of the functions in it → unit, and the line of its text for each of the function's.
    """

    places: dict[str, Place]
    cold: InstanceMemory
    run: Run
    lines: dict[CodeType, tuple[ProgramUnit, list[int]]]


def row_of(type_: str) -> int:
    """Return the row in which numbers of a type stand."""
    return 0 if type_ == "REAL" else 1


@lru_cache(256)
def _function(name: str, source: str, called: tuple[tuple[str, Callable[..., Any]], ...]) -> FunctionType:
    """Return the function of a text, which names others; the same for the same ones, so that it is compiled once."""
    names: dict[str, Any] = {**_FUNCTIONS, **dict(called), "__name__": __name__}
    function: FunctionType = functions_from_text(source, names, file=__file__)["run"]
    callee_names = "".join(getattr(other, "__qualname__", "") for _, other in called)
    # by which what is kept on disk is told from that of another text
    function.__qualname__ = f"{name}_{hashlib.sha256((source + callee_names).encode()).hexdigest()[:16]}"
    return function


def translate_unit(
    unit: ProgramUnit, layouts: Mapping[str, InstanceLayout], time_to_real: Callable[[int], float] | None
) -> InstanceLayout:
    """Return a unit translated, given the blocks it may use and what TIME_TO_REAL gives of a time [ms].

    Raises:
        InputError: what is not known here.
    """
    return _Compiler(unit, layouts, time_to_real).block()


class _Compiler:
    """Translates one unit: its statements become a Python function."""

    def __init__(
        self, unit: ProgramUnit, layouts: Mapping[str, InstanceLayout], time_to_real: Callable[[int], float] | None
    ) -> None:
        self._unit, self._known, self._time_to_real = unit, layouts, time_to_real
        self._cold = InstanceMemory([], [], [])
        self._places: dict[str, Place] = {}
        self._constant = {each.name for each in unit.variables if each.section.endswith("CONSTANT")}
        self._line = 0  # of the statement that is translated
        self._lines = [0, 0]  # of the text, for each of the function's from 0 on: there is none, and its head

    def block(self) -> InstanceLayout:
        """Return the unit translated."""
        for variable in self._unit.variables:
            if variable.name in self._places:
                raise self._wrong(f"{variable.name} is declared twice")
            if variable.type in self._known and variable.initial is None:
                place = self._cold.grown(self._known[variable.type].cold)
            else:
                kind = KIND.get(variable.type)
                if kind is None:
                    raise self._wrong(f"{variable.name}: {variable.type} is no type that is known here")
                value = NOTHING[kind] if variable.initial is None else self._initial(variable.initial, variable.type)
                place = self._cold.with_one(kind, value)
            self._places[variable.name] = variable.type, place
        run, lines = self._body()
        for other in self._known.values():
            lines |= other.lines
        return InstanceLayout(self._places, self._cold, run, lines)

    def _wrong(self, what: str) -> InputError:
        where = self._unit.line_text(self._line) if self._line else self._unit.name
        return InputError(f"{where}; {what}")

    def _initial(self, literal: Literal, type_: str) -> Value:
        if literal.kind != KIND[type_]:
            raise self._wrong(f"{literal.value} is no {type_}")
        if literal.kind == "REAL":
            return single(literal.value)
        return _cut(int(literal.value), *_WHOLE[type_]) if type_ in _WHOLE else literal.value

    def _body(self) -> tuple[Run, dict[CodeType, tuple[ProgramUnit, list[int]]]]:
        """Return the function that runs the unit's statements, and the lines of its text."""
        source = "\n".join([f"def run({', '.join((*_ROWS, *_FIRST))}):", *self._all(self._unit.body, " ")])
        callees: dict[str, Callable[..., Any]] = {
            f"run_{type_}": block.run for type_, block in self._known.items() if f"run_{type_}(" in source}
        if self._time_to_real is not None:
            callees["time_to_real"] = self._time_to_real
        function = _function(self._unit.name, source, tuple(callees.items()))
        return function, {function.__code__: (self._unit, self._lines)}

    def _all(self, statements: Iterable[Statement], indent: str) -> Iterator[str]:
        """Return the lines that run statements, at least one."""
        has_step = False
        for statement in statements:
            self._line = statement.line
            for line in self._run(statement, indent):
                has_step = True
                yield line
        if not has_step:
            yield self._noted_line(f"{indent}pass")

    def _noted_line(self, line: str) -> str:
        self._lines.append(self._line)
        return line

    def _run(self, statement: Statement, indent: str) -> Iterator[str]:
        if isinstance(statement, Assignment):
            yield self._noted_line(f"{indent}{self._assignment(statement)}")
        elif isinstance(statement, Call):
            yield from (self._noted_line(f"{indent}{line}") for line in self._call(statement))
        else:
            for number, arm in enumerate(statement.arms):
                self._line = arm.line
                if arm.condition is None:
                    head = "else:"
                else:
                    head = f"{'elif' if number else 'if'} {self._to(arm.condition, 'BOOL')}:"
                yield self._noted_line(f"{indent}{head}")
                yield from self._all(arm.body, f"{indent} ")

    def _assignment(self, statement: Assignment) -> str:
        type_, place = self._variable(statement.target)
        if statement.target.path[-1] in self._constant:
            raise self._wrong(f"{statement.target.path[-1]} is a constant")
        return f"{place} = {self._to(statement.value, type_)}"

    def _call(self, statement: Call) -> Iterator[str]:
        type_, place = self._places.get(statement.instance, ("", (0, 0, 0)))
        block = self._known.get(type_)
        if block is None:
            raise self._wrong(f"{statement.instance} is no instance")
        for name, expression in statement.inputs:
            if name not in block.places:
                raise self._wrong(f"{type_} has no input {name}")
            kind, there = block.places[name]
            yield f"{self._cell(kind, place, there)} = {self._to(expression, kind)}"
        yield f"run_{type_}({', '.join((*_ROWS, *map(self._index, _FIRST, place)))})"

    def _variable(self, name: Name) -> tuple[str, str]:
        """Return the type of a variable, or of an instance's, and where it stands in the memory."""
        places, there, type_ = self._places, list[tuple[int, int, int]](), ""
        for part in name.path:
            if part not in places:
                raise self._wrong(f"{'.'.join(name.path)} is not declared")
            type_, place = places[part]
            there.append(place)
            places = self._known[type_].places if type_ in self._known else {}
        if type_ not in KIND:
            raise self._wrong(f"{'.'.join(name.path)} is no number")
        return type_, self._cell(type_, *there)

    def _cell(self, type_: str, *places: tuple[int, int, int]) -> str:
        """Return the expression for a number in its row."""
        row = row_of(type_)
        return f"{_ROWS[row]}[{self._index(_FIRST[row], sum(place[row] for place in places))}]"

    def _index(self, first: str, place: int) -> str:
        return str(place) if self._unit.kind == "PROGRAM" else f"{first} + {place}"

    def _to(self, expression: Expression, type_: str) -> str:
        """Return an expression, its value as a variable of a type keeps it."""
        kind, value = self._value(expression)
        if KIND.get(type_) != kind:
            raise self._wrong(f"expected {type_}")
        return value if kind != "WHOLE" or type_ == "DINT" else _fitted(value, type_)

    def _value(self, expression: Expression) -> tuple[str, str]:
        """Return the kind of an expression, and it."""
        if isinstance(expression, Literal):
            if expression.kind == "BOOL":
                return "BOOL", repr(expression.value)
            value = single(expression.value) if expression.kind == "REAL" else expression.value
            return expression.kind, self._cell(expression.kind, self._cold.with_one(expression.kind, value))
        if isinstance(expression, Name):
            type_, place = self._variable(expression)
            return KIND[type_], place
        operands = [self._value(operand) for operand in expression.operands]
        kinds = [kind for kind, _ in operands]
        if expression.sign == "TIME_TO_REAL" and self._time_to_real is None:
            raise self._wrong("the unit of TIME_TO_REAL is not told")
        if (expression.sign, *kinds) not in _MADE:
            raise self._wrong(f"{expression.sign} does not go with {' and '.join(kinds)}")
        kind, template = _MADE[(expression.sign, *kinds)]
        return kind, template.format(*(value for _, value in operands))


def _fitted(value: str, type_: str) -> str:
    """Return an expression of a whole number, cut to the bits of a type."""
    bits, signed = _WHOLE[type_]
    low = 1 << bits - 1 if signed else 0
    return f"(({value} + {low}) % {1 << bits} - {low})"


def _cut(value: int, bits: int, signed: bool) -> int:
    low = -(1 << bits - 1) if signed else 0
    return (value - low) % (1 << bits) + low


def _truncated(value: float) -> int:
    if not -2147483649.0 < value < 2147483648.0:  # beyond DINT, or no number
        raise OverflowError
    return math.trunc(value)


def _quotient(dividend: int, divisor: int) -> int:
    """Return it cut towards zero."""
    if divisor == 0:  # compiled, this would be a number
        raise ZeroDivisionError
    share = abs(dividend) // abs(divisor)
    return share if (dividend < 0) == (divisor < 0) else -share


def _rest(dividend: int, divisor: int) -> int:
    return dividend - divisor * _quotient(dividend, divisor)


#: what a unit's function calls
_FUNCTIONS: Final[Mapping[str, Any]] = {"single": single, "divided": divide_single, "truncated": _truncated,
                                        "quotient": _quotient, "rest": _rest}
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


class Firmware(NamedTuple):
    """A block that the target brings along.

    Attributes:
        variables: name → type.
        make: makes an instance, cold; called with the values of all variables, it returns those of its outputs.
        run: in its place, what a call does to the rows: variables are there in their order, then `keeps`.
        keeps: cold numbers that an instance keeps beside its variables; REALs are floats.
    """

    variables: Mapping[str, str]
    make: Callable[[], Callable[[Mapping[str, Value]], Mapping[str, Value]]] | None = None
    run: Run | None = None
    keeps: tuple[Value, ...] = ()


class TextProgram:
    """The program of a text, with its memory."""

    def __init__(
        self, units: Sequence[ProgramUnit], firmware: Mapping[str, Firmware],
        time_to_real: Callable[[int], float] | None = None,
    ) -> None:
        """Take a text's units, and what the target brings along: blocks, and what TIME_TO_REAL gives of a time [ms].

        Raises:
            InputError: there is not exactly one program; what is not known here.
        """
        blocks = self._known = {name.upper(): _of_firmware(block) for name, block in firmware.items()}
        for unit in (unit for unit in units if unit.kind == "FUNCTION_BLOCK"):
            blocks[unit.name] = translate_unit(unit, blocks, time_to_real)
        programs = [unit for unit in units if unit.kind == "PROGRAM"]
        if len(programs) != 1:
            raise InputError(f"{len(programs)} programs; expected one")
        self._block = translate_unit(programs[0], blocks, time_to_real)
        self._compiles = time_to_real is None and all(_is_plain(block.run) for block in firmware.values())
        self._named: dict[str, tuple[int, int]] = {}  # name as it was asked for → row and place
        self.start()

    def start(self) -> None:
        """Give all variables their initial values."""
        reals, wholes, firmware = self._block.cold
        self._memory = InstanceMemory([*reals], [*wholes], [make() for make in firmware])

    def scan(self) -> None:
        """Run it once.

        Raises:
            InputError: a statement at which a controller would stop.
        """
        try:
            self._block.run(*self._memory, 0, 0, 0)
        except InputError:
            raise
        except (ArithmeticError, ValueError) as problem:
            raise InputError(f"{self._stopped_at(problem)}; a controller stops here") from None

    def scans(self, tape: Tape) -> Got | None:
        """Run it many times, compiled, see `heatertune.plc.cpu.iec.machine.run_tape`."""
        if not self._compiles:
            return None
        places = {name: self._place(name) for name in (*tape.reals, *tape.wholes, *tape.outputs)}
        return run_tape(cast("FunctionType", self._block.run), self._memory.reals, self._memory.wholes, tape, places)

    def _stopped_at(self, problem: BaseException) -> str:
        """Return the line at which it stopped."""
        line_text, trace = "", problem.__traceback__
        while trace is not None:
            if source := self._block.lines.get(trace.tb_frame.f_code):
                unit, lines = source
                line_text = unit.line_text(lines[trace.tb_lineno - BEYOND])
            trace = trace.tb_next
        return line_text

    def __contains__(self, name: str) -> bool:
        """Return whether there is a variable, or one of an instance: `Block.Variable`."""
        instance, _, inner = name.upper().rpartition(".")
        return inner in self._places_in(instance)

    def __getitem__(self, name: str) -> Any:
        row, place = self._place(name)
        return self._memory[row][place]

    def __setitem__(self, name: str, value: Value) -> None:
        row, place = self._place(name)
        self._memory[row][place] = value

    def _places_in(self, instance: str) -> Mapping[str, Place]:
        if not instance:
            return self._block.places
        type_, _ = self._block.places.get(instance, ("", None))
        return self._known[type_].places if type_ in self._known else {}

    def _place(self, name: str) -> tuple[int, int]:
        if name not in self._named:
            if name not in self:
                raise InputError(f"the program has no variable {name}")
            instance, _, inner = name.upper().rpartition(".")
            type_, place = self._places_in(instance)[inner]
            begin = self._block.places[instance][1] if instance else (0, 0, 0)
            row = row_of(type_)
            self._named[name] = row, begin[row] + place[row]
        return self._named[name]


def _is_plain(run: Run | None) -> bool:
    """Return whether a compiler may take it."""
    return isinstance(run, FunctionType) and run.__closure__ is None


def _of_firmware(block: Firmware) -> InstanceLayout:
    cold, places = InstanceMemory([], [], [block.make] if block.make else []), dict[str, Place]()
    for name, type_ in block.variables.items():
        places[name.upper()] = type_, cold.with_one(KIND[type_], NOTHING[KIND[type_]])
    for value in block.keeps:
        cold.with_one("REAL" if isinstance(value, float) else "WHOLE", value)
    if block.run is not None:
        return InstanceLayout(places, cold, block.run, {})
    inputs = [(name, row_of(type_), places[name.upper()][1][row_of(type_)]) for name, type_ in block.variables.items()]
    put = {name: (row, place) for name, row, place in inputs}

    def run(r: list[Any], w: list[Any], f: list[Any], a: int, b: int, c: int) -> None:
        rows, first = (r, w), (a, b)
        for name, value in f[c]({name: rows[row][first[row] + place] for name, row, place in inputs}).items():
            row, place = put[name]
            rows[row][first[row] + place] = value

    return InstanceLayout(places, cold, run, {})
