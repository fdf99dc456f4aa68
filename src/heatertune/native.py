"""Machine code as bytes: kept in a file, and called without the compiler that made it.

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
from collections.abc import Callable, Hashable, Iterable, Sequence
from contextlib import suppress
from ctypes import addressof
from dataclasses import dataclass
from functools import cache as remember
from importlib import import_module
from threading import Lock
from typing import Any, Final

import numpy as np

from heatertune.cache import release

__all__ = ["Code", "Kinds", "described", "entry", "host", "taken_apart"]

#: of arguments taken apart: a letter for a number, what tells apart arrays, a tuple's class and its end
Kinds = tuple[Hashable, ...]
Result = str | None | list[Any]

_SCHEMA: Final = b"heatertune/native/1"
_END: Final = ")"
_NUMBERS: Final[dict[type, str]] = {
    float: "d", np.float64: "d", np.float32: "f", int: "q", np.int64: "q", bool: "?", np.bool_: "?"}
_CTYPES: Final[dict[Hashable, Any]] = {
    "d": ctypes.c_double, "f": ctypes.c_float, "q": ctypes.c_int64, "?": ctypes.c_bool}
_MOST: Final = 1 << 63
_byte: Final = ctypes.c_char.from_buffer  # NumPy tells where an array is in four times as long

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
    """

    name: str
    result: Result
    needs: tuple[str, ...]
    made: bytes

    def to_bytes(self) -> bytes:
        """Return a file's content."""
        head = json.dumps([self.name, self.result, self.needs]).encode()
        return b"\n".join((_SCHEMA, hashlib.sha256(head + self.made).hexdigest().encode(), head, self.made))

    @classmethod
    def from_bytes(cls, content: bytes) -> Code:
        """Return what a file holds; raise ValueError where it is not as it was written: it would run what is left."""
        schema, digest, head, made = content.split(b"\n", 3)
        if schema != _SCHEMA or digest.decode() != hashlib.sha256(head + made).hexdigest():
            raise ValueError("the file was changed")
        name, result, needs = json.loads(head)
        return cls(name=name, result=result, needs=tuple(needs), made=made)


def taken_apart(arguments: Iterable[Any]) -> tuple[Kinds, list[Any]]:
    """Return of what kinds arguments are, and all numbers in them as a compiled function takes them.

    Args:
        arguments: numbers, arrays, and tuples of them.

    Raises:
        TypeError: anything else, or a whole number of more than 64 bits.
    """
    kinds, numbers = list[Hashable](), list[Any]()
    _take_apart(arguments, kinds, numbers)
    return tuple(kinds), numbers


def _take_apart(values: Iterable[Any], kinds: list[Hashable], numbers: list[Any]) -> None:
    for value in values:
        kind: Any = type(value)
        letter = _NUMBERS.get(kind)
        if letter is not None:
            if letter == "q" and not -_MOST <= value < _MOST:
                raise TypeError(f"{value} has more than 64 bits")
            kinds.append(letter)
            numbers.append(value)
        elif kind is np.ndarray:
            marks, shape = value.flags.num, value.shape
            marks &= _LAYOUT if marks & _IN_ROWS else _LAYOUT_IN_COLUMNS
            kinds.append((value.dtype, len(shape), marks))
            place = addressof(_byte(value)) if marks == _LAYOUT and value.size else value.ctypes.data
            numbers += (None, None, value.size, value.itemsize, place, *shape, *value.strides)  # its owner is who calls
        elif kind is array:
            place, count = value.buffer_info()
            kinds.append((value.typecode, 1, "array"))
            numbers += (None, None, count, value.itemsize, place, count, value.itemsize)
        elif kind is bytearray:
            kinds.append(("B", 1, "bytearray"))
            numbers += (None, None, len(value), 1, addressof(_byte(value)) if value else None, len(value), 1)
        elif isinstance(value, tuple):
            kinds.append(kind)
            _take_apart(value, kinds, numbers)
            kinds.append(_END)
        else:
            raise TypeError(f"{kind.__name__}: a number, an array or a tuple of them expected")


def described(kinds: Kinds) -> str:
    """Return kinds as text, the same in every process."""
    return " ".join(f"{each.__module__}.{each.__qualname__}" if isinstance(each, type) else str(each) for each in kinds)


@remember
def host() -> str:
    """Return on what machine code depends beside its source: the compiler, the processor, and what it is told."""
    loader = _loader()
    told = [f"{name}={value}" for name, value in sorted(os.environ.items()) if name.startswith("NUMBA_")]
    return " ".join([platform.system(), loader.get_process_triple(), loader.get_host_cpu_name(),
                     loader.get_host_cpu_features().flatten(), *map(release, ("numba", "llvmlite", "numpy")), *told])


def entry(code: Code, kinds: Kinds) -> Callable[[Sequence[Any]], Any] | None:
    """Load machine code and return what calls it with numbers of these kinds, None where what it needs is not there.

    It gives up Python's lock while it runs.
    """
    with _loading:
        loader = _loader()
        if not all(map(loader.address_of_symbol, code.needs)):
            return None
        engine = loader.create_mcjit_compiler(
            loader.parse_assembly(""), loader.Target.from_default_triple().create_target_machine())
        engine.add_object_file(loader.ObjectFileRef.from_data(code.made))
        engine.finalize_object()
    types = [ctypes.c_void_p, ctypes.c_void_p, *_types(kinds)]
    function = ctypes.CFUNCTYPE(ctypes.c_int32, *types)(engine.get_function_address(code.name))
    error, (result_of, read) = ctypes.c_void_p(), _result(code.result)
    inside = type("Result", (ctypes.Structure,), {"_fields_": [("value", result_of)]})

    def run(numbers: Sequence[Any], _engine: Any = engine) -> Any:
        result = inside()
        if function(addressof(result), addressof(error), *numbers):
            raise ArithmeticError(f"{code.name}: it raised an error, which compiled code must not")
        return read(result.value)

    return run


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

    return type("Tuple", (ctypes.Structure,), {"_fields_": [(name, made) for name, (made, _) in inside.items()]}), read


def _types(kinds: Kinds) -> list[Any]:
    types = list[Any]()
    for kind in kinds:
        if isinstance(kind, tuple):
            parts = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p]
            types += [*parts, *[ctypes.c_int64] * (2 * kind[1])]
        elif kind in _CTYPES:
            types.append(_CTYPES[kind])
    return types


@remember
def _loader() -> Any:
    """Return LLVM, ready to load."""
    import llvmlite.binding as llvm  # noqa: PLC0415 - 30 ms, which only the compiled world needs

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    with suppress(RuntimeError):  # elsewhere than on Linux the C library has them
        llvm.load_library_permanently("libm.so.6")
    return llvm
