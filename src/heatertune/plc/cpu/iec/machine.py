"""A machine that runs structured text: programs, and blocks that the target brings along.

REAL is single precision, rounded once by each operation; whole numbers are computed in 32 bits with a sign and kept in
those of their variable. Numbers of one kind do not become another by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import FunctionType
from typing import Any, NamedTuple, cast

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.tape import Got, Tape, run_tape
from heatertune.plc.cpu.iec.text import ProgramUnit
from heatertune.plc.cpu.iec.translation import (
    BEYOND,
    KIND,
    NOTHING,
    InstanceLayout,
    InstanceMemory,
    Place,
    Run,
    Value,
    row_of,
    translate_unit,
)

__all__ = ["Firmware", "TextProgram", "Value"]


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
        known = self._known = {name.upper(): _of_firmware(block) for name, block in firmware.items()}
        for unit in (unit for unit in units if unit.kind == "FUNCTION_BLOCK"):
            known[unit.name] = translate_unit(unit, known, time_to_real)
        programs = [unit for unit in units if unit.kind == "PROGRAM"]
        if len(programs) != 1:
            raise InputError(f"{len(programs)} programs; expected one")
        self._block = translate_unit(programs[0], known, time_to_real)
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
            raise InputError(f"{self._told(problem)}; a controller stops here") from None

    def scans(self, tape: Tape) -> Got | None:
        """Run it many times, compiled, see `heatertune.plc.cpu.iec.tape.run_tape`."""
        if not self._compiles:
            return None
        places = {name: self._place(name) for name in (*tape.reals, *tape.wholes, *tape.outputs)}
        return run_tape(cast("FunctionType", self._block.run), self._memory.reals, self._memory.wholes, tape, places)

    def _told(self, problem: BaseException) -> str:
        """Return the line at which it stopped."""
        told, trace = "", problem.__traceback__
        while trace is not None:
            if found := self._block.lines.get(trace.tb_frame.f_code):
                unit, lines = found
                told = unit.line_text(lines[trace.tb_lineno - BEYOND])
            trace = trace.tb_next
        return told

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
    named = [(name, row_of(type_), places[name.upper()][1][row_of(type_)]) for name, type_ in block.variables.items()]
    put = {name: (row, place) for name, row, place in named}

    def run(
        r: list[Any], w: list[Any], f: list[Any], a: int, b: int, c: int
    ) -> None:
        rows, first = (r, w), (a, b)
        for name, value in f[c]({name: rows[row][first[row] + place] for name, row, place in named}).items():
            row, place = put[name]
            rows[row][first[row] + place] = value

    return InstanceLayout(places, cold, run, {})
