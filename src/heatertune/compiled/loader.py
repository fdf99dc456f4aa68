"""Machine code as bytes: kept in a file, and called without the compiler that made it; functions from generated source.

Numba makes of a function one that takes its arguments apart: each number and each part of an array is an argument of
its own. To call it, LLVM's loader and ctypes are enough; they are there in a fifth of the time that Numba takes.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import platform
from array import array
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from ctypes import addressof
from dataclasses import dataclass
from functools import cache as remember
from importlib import import_module
from struct import Struct, calcsize
from threading import Lock
from typing import Any, Final, cast

import numpy as np

from heatertune.cache import release

__all__ = [
    "BEYOND", "MISSED", "Code", "Kinds", "Scope", "array_address", "entry", "functions_from_text", "host",
    "kinds_of", "letters_of", "packed_door", "signature_text",
]


#: names that a function may use
Scope = dict[str, Any]

#: lines, more than any file has: who looks in it for the lines of a generated function finds none
BEYOND: Final = 1000


def functions_from_text(text: str, names: Mapping[str, object], *, file: str = "<generated>") -> Scope:
    """Run the text of functions and return the names it defines, with those that it was given.

    Only heatertune writes such text: from field names, numbers and instructions that were parsed before, never from
    what a user typed.

    Args:
        text: the functions.
        names: what they may use.
        file: that of which they count as a part. Machine code is kept for functions of files alone, since it depends
            on their content; the lines begin beyond its end.
    """
    scope = dict(names)
    exec(compile(text if file == "<generated>" else "\n" * BEYOND + text, file, "exec"), scope)
    return scope


#: of arguments taken apart: a letter for a number, what tells apart arrays, a tuple's class and its end
Kinds = tuple[Hashable, ...]
Result = str | None | list[Any]

_SCHEMA: Final = b"heatertune/native/1"
_DOOR: Final = "heatertune_door"
_END: Final = ")"
_NUMBERS: Final[dict[type, str]] = {
    float: "d", np.float64: "d", np.float32: "f", int: "q", np.int64: "q", bool: "?", np.bool_: "?"}
_CTYPES: Final[dict[Hashable, Any]] = {
    "d": ctypes.c_double, "f": ctypes.c_float, "q": ctypes.c_int64, "?": ctypes.c_bool}
_MOST: Final = 1 << 63

#: of a call with arguments of other kinds
MISSED: Final = object()

#: marks of an array that its type depends on (NumPy's NPY_ARRAY_…): in rows or columns, aligned, writeable
_IN_ROWS: Final = 0x001
_LAYOUT: Final = _IN_ROWS | 0x100 | 0x400
_LAYOUT_IN_COLUMNS: Final = 0x002 | 0x100 | 0x400

#: one at a time: LLVM's loader is no place for two threads
_loading: Final = Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class Code:
    """A function as machine code.

    Attributes:
        name: of the function in it.
        result: a letter for a number that it returns, the class and the parts of a tuple, None for nothing.
        needs: names of what it calls outside of itself.
        made: the object file.
        door: that of a function that takes all numbers from one row of bytes, as `packed_door` makes it.
    """

    name: str
    result: Result
    needs: tuple[str, ...]
    content: bytes
    door: bytes

    def to_bytes(self) -> bytes:
        """Return a file's content."""
        head = json.dumps([self.name, self.result, self.needs, len(self.content)]).encode()
        both = self.content + self.door
        return b"\n".join((_SCHEMA, hashlib.sha256(head + both).hexdigest().encode(), head, both))

    @classmethod
    def from_bytes(cls, content: bytes) -> Code:
        """Return the code in a file; raise ValueError where it is not as it was written: it would run what is left."""
        schema, digest, head, both = content.split(b"\n", 3)
        if schema != _SCHEMA or digest.decode() != hashlib.sha256(head + both).hexdigest():
            raise ValueError("the file was changed")
        name, result, needs, length = json.loads(head)
        return cls(name=name, result=result, needs=tuple(needs), content=both[:length], door=both[length:])


def kinds_of(arguments: Iterable[Any]) -> Kinds:
    """Return of what kinds arguments are: numbers, arrays, and tuples of them.

    Raises:
        TypeError: anything else, or a whole number of more than 64 bits.
    """
    kinds = list[Hashable]()
    for value in arguments:
        kind: Any = type(value)
        letter = _NUMBERS.get(kind)
        if letter is not None:
            if letter == "q" and not -_MOST <= value < _MOST:
                raise TypeError(f"{value} has more than 64 bits")
            kinds.append(letter)
        elif kind is np.ndarray:
            marks = value.flags.num
            kinds.append((value.dtype, value.ndim, marks & (_LAYOUT if marks & _IN_ROWS else _LAYOUT_IN_COLUMNS)))
        elif kind is array:
            kinds.append((value.typecode, 1, "array"))
        elif kind is bytearray:
            kinds.append(("B", 1, "bytearray"))
        elif isinstance(value, tuple):
            kinds += (kind, *kinds_of(value), _END)
        else:
            raise TypeError(f"{kind.__name__}: a number, an array or a tuple of them expected")
    return tuple(kinds)


def signature_text(kinds: Kinds) -> str:
    """Return kinds as text, the same in every process."""
    return " ".join(f"{each.__module__}.{each.__qualname__}" if isinstance(each, type) else str(each) for each in kinds)


@remember
def host() -> str:
    """Return on what machine code depends beside its source: the compiler, the processor, and what it is told."""
    loader = _loader()
    options = [f"{name}={value}" for name, value in sorted(os.environ.items()) if name.startswith("NUMBA_")]
    return " ".join([platform.system(), loader.get_process_triple(), loader.get_host_cpu_name(),
                     loader.get_host_cpu_features().flatten(), *map(release, ("numba", "llvmlite", "numpy")), *options])


def entry(code: Code, kinds: Kinds) -> Callable[[tuple[Any, ...]], Any] | None:
    """Load machine code and return what calls it, None where what it needs is not there.

    It takes arguments of these kinds, and returns `MISSED` where they are of others; it gives up Python's lock while
    the code runs.
    """
    with _loading:
        loader = _loader()
        if not all(map(loader.address_of_symbol, code.needs)):
            return None
        engine = loader.create_mcjit_compiler(
            loader.parse_assembly(""), loader.Target.from_default_triple().create_target_machine())
        for part in (code.content, code.door):
            engine.add_object_file(loader.ObjectFileRef.from_data(part))
        engine.finalize_object()
    function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_char_p)(engine.get_function_address(_DOOR))
    result_of, read = _result(code.result)
    inside = type("Result", (ctypes.Structure,), {"_fields_": [("value", result_of)]})
    call = _Taking().function(kinds)
    error = ctypes.c_void_p()

    def run(arguments: tuple[Any, ...], _engine: Any = engine, _error: Any = error) -> Any:
        result = inside()
        ended = call(arguments, function, addressof(result), addressof(_error))
        if ended:
            if ended is MISSED:
                return MISSED
            raise ArithmeticError(f"{code.name}: it raised an error, which compiled code must not")
        return read(result.value)

    return run


#: where an array's numbers are stands first in NumPy's PyArrayObject: an eighth of the time of `ctypes.data`
_ADDRESS: Final = f"place(id({{}}) + {object.__basicsize__}).value"
_place: Final = ctypes.c_void_p.from_address


def array_address(value: Any) -> int:
    """Return where the numbers of an array are, as the functions that take arguments apart read it."""
    address: int | None = _place(id(value) + object.__basicsize__).value
    return address or 0


class _Taking:
    """The text of a function that takes arguments of some kinds apart and calls machine code with all numbers in them.

    Written out it needs half a microsecond for an array, a third of what a loop over kinds does; a search calls machine
    code a thousand times.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self._lines, self._numbers, self._names = list[str](), list[str](), 0
        self._scope: Scope = {
            "ndarray": np.ndarray, "float32": np.float32, "array": array, "place": _place,
            "byte": ctypes.c_char.from_buffer, "addressof": addressof, "letter_of": _NUMBERS.get, "MISSED": MISSED}

    def function(self, kinds: Kinds) -> Callable[..., Any]:
        """Return the function: (arguments, machine code, two addresses) → what the code returned, or `MISSED`."""
        whole: list[Any] = [[]]
        for kind in kinds:
            if isinstance(kind, type):
                whole.append([kind])
            elif kind == _END:
                tuple_ = whole.pop()
                whole[-1].append(tuple_)
            else:
                whole[-1].append(kind)
        self._take("arguments", whole[0])
        self._scope["pack"] = Struct("=" + letters_of(kinds)).pack
        text = "\n    ".join(["def call(arguments, function, result, error):", *self._lines,
                             f"return function(pack({', '.join(['result', 'error', *self._numbers])}))"])
        return cast("Callable[..., Any]", functions_from_text(text, self._scope)["call"])

    def _take(self, whole: str, kinds: Sequence[Any]) -> None:
        names = [self._name() for _ in kinds]
        self._demand(f"len({whole}) == {len(names)}")
        if names:
            self._lines.append(f"{', '.join(names)}, = {whole}")
        for name, kind in zip(names, kinds, strict=True):
            if isinstance(kind, list):
                self._demand(f"type({name}) is {self._constant(kind[0])}")
                self._take(name, kind[1:])
            elif isinstance(kind, tuple):
                self._take_array(name, *kind)
            else:
                usual = {"d": "float", "f": "float32", "q": "int", "?": "bool"}[kind]
                self._demand(f"type({name}) is {usual} or letter_of(type({name})) == {kind!r}")
                if kind == "q":
                    self._demand(f"{-_MOST} <= {name} < {_MOST}")
                self._numbers.append(name)

    def _take_array(self, name: str, of: Any, dimensions: int, marks: Any) -> None:
        """Take an array apart; its owner is who calls."""
        shape, strides = ([self._name() for _ in range(dimensions)] for _ in range(2))
        if isinstance(marks, str):
            type_check = f"{name}.typecode == {of!r}" if marks == "array" else "True"
            self._demand(f"type({name}) is {marks} and {type_check}")
            where = f"{name}.buffer_info()[0]" if marks == "array" else f"addressof(byte({name})) if {name} else 0"
            size, shape, strides = f"len({name})", [f"len({name})"], [str(array(of).itemsize)]
            self._numbers += ["0", "0", size, *strides, where, *shape, *strides]
            return
        mask = _LAYOUT if marks & _IN_ROWS else _LAYOUT_IN_COLUMNS | _IN_ROWS
        dtype = self._constant(of)  # the same one, but for arrays that came from another process
        self._demand(f"type({name}) is ndarray and ({name}.dtype is {dtype} or {name}.dtype == {dtype}) and "
                     f"{name}.ndim == {dimensions} and {name}.flags.num & {mask} == {marks}")
        if dimensions:
            self._lines += [f"{', '.join(shape)}, = {name}.shape", f"{', '.join(strides)}, = {name}.strides"]
        self._numbers += ["0", "0", f"{name}.size", str(of.itemsize), f"{_ADDRESS.format(name)} or 0", *shape, *strides]

    def _demand(self, what: str) -> None:
        self._lines.append(f"if not ({what}): return MISSED")

    def _name(self) -> str:
        self._names += 1
        return f"v{self._names}"

    def _constant(self, value: Any) -> str:
        name = self._name()
        self._scope[name] = value
        return name


def _result(result: Result) -> tuple[Any, Callable[[Any], Any]]:
    """Return how a result lies in memory, and what reads it there."""
    if result is None:
        return ctypes.c_void_p, lambda _nothing: None
    if isinstance(result, str):
        return _CTYPES[result], lambda number: number
    where, *parts = result
    inside = {f"part_{place}": _result(part) for place, part in enumerate(parts)}
    module, _, name = where.rpartition(":")
    class_ = getattr(import_module(module), name) if where else None

    def read(there: Any) -> Any:
        values = (read(getattr(there, name)) for name, (_, read) in inside.items())
        return tuple(values) if class_ is None else class_(*values)

    return type("Tuple", (ctypes.Structure,), {"_fields_": [(name, kind) for name, (kind, _) in inside.items()]}), read


def letters_of(kinds: Kinds) -> str:
    """Return a letter for each number, as `struct` has it: addresses of result and error, and what arguments hold."""
    letters = ["QQ"]
    for kind in kinds:
        if isinstance(kind, tuple):
            letters.append("QQqqQ" + "q" * (2 * kind[1]))  # owner twice, size, size of one, place; shape and strides
        elif kind in _CTYPES:
            letters.append(str(kind))
    return "".join(letters)


def packed_door(name: str, kinds: Kinds) -> bytes:
    """Return an object file with the function that takes all numbers of a call from one row of bytes.

    Python hands over one argument in a tenth of the time of a hundred.

    Args:
        name: of the function that takes them one by one.
        kinds: of its arguments.
    """
    from llvmlite import ir

    letters = letters_of(kinds)
    types = {"d": ir.DoubleType(), "f": ir.FloatType(), "q": ir.IntType(64), "Q": ir.IntType(64), "?": ir.IntType(8)}
    module, row, whole = ir.Module(), ir.IntType(8).as_pointer(), ir.IntType(32)
    module.triple = _loader().get_process_triple()
    function = ir.Function(module, ir.FunctionType(whole, [types[letter] for letter in letters]), name)
    door = ir.Function(module, ir.FunctionType(whole, [row]), _DOOR)
    build, numbers, at = ir.IRBuilder(door.append_basic_block()), [], 0
    for letter in letters:
        place = build.gep(door.args[0], [ir.Constant(ir.IntType(64), at)])
        numbers.append(build.load(build.bitcast(place, types[letter].as_pointer()), align=1))
        at += calcsize("=" + letter)
    build.ret(build.call(function, numbers))
    target = _loader().Target.from_default_triple().create_target_machine(jit=True)
    return cast("bytes", target.emit_object(_loader().parse_assembly(str(module))))


@remember
def _loader() -> Any:
    """Return LLVM, ready to load."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    with suppress(RuntimeError):  # elsewhere than on Linux the C library has them
        llvm.load_library_permanently("libm.so.6")
    return llvm
