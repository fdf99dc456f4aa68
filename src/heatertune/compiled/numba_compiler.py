"""How Numba compiles plain functions: what others call is taken in by these, and needs no machine code of its own.

The compiler spends a fifth of its time on such code, which nobody runs. Importing this imports Numba.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache as remember
from functools import partial
from typing import Any, Final

from numba import njit, typeof
from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.types.containers import BaseNamedTuple, BaseTuple
from numba.core.types.misc import unliteral

from heatertune.compiled.loader import Code, Kinds, Result, kinds_of, letters_of, packed_door
from heatertune.compiled.plain_functions import callees, copy_function, plainly

__all__ = ["UnknownCall", "object_code", "overload"]

_LETTERS: Final = {types.float64: "d", types.float32: "f", types.int64: "q", types.boolean: "?"}


#: LLVM's type of a number → its letter, as the loader hands it over
_TAKEN: Final = {"double": "d", "float": "f", "i64": "q", "i8": "?"}


class UnknownCall(Exception):
    """A function that Numba calls in another way than the loader does."""


class _Intermediate(JITCodeLibrary):  # type: ignore[misc]
    """A function as others take it in: optimised, but neither made machine code nor ever run."""

    @property
    def codegen(self) -> Any:
        """What is told where the function's surroundings are: itself."""
        return self

    def set_env(self, env_name: str, env: object) -> None:
        """Leave the surroundings out, as no code looks at them."""

    def get_pointer_to_function(self, name: str) -> int:  # noqa: ARG002 - as in Numba
        """Return none."""
        self._ensure_finalized()
        return 0

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class _Inlined(Compiler):  # type: ignore[misc]
    """Numba's compiler without the last step, for what is never called from Python."""

    library: type[JITCodeLibrary] = _Intermediate

    def compile_extra(self, func: Any) -> Any:
        """Compile a plain function."""
        self.state.library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)


class _Whole(_Inlined):
    """Numba's compiler, which hands out the object file that it made."""

    library = JITCodeLibrary


def object_code(function: Callable[..., Any], arguments: Sequence[Any], *, calls: bool = False) -> Code:
    """Compile a plain function for arguments of these types, with all that it calls.

    Args:
        function: in which no array is made.
        arguments: as it is to be called with.
        calls: whether calls stay calls; else all of them are taken in.

    Raises:
        TypeError: it returns something else than a number or a tuple of them.
        UnknownCall: it takes its numbers in another way than the loader hands them over.
    """
    overload_code = overload(function, arguments, calls=calls)
    result = _result(function, overload_code.signature.return_type)
    _demand_call(overload_code, kinds_of(arguments), result)
    needs = [each.name for each in overload_code.library._final_module.functions if each.is_declaration]
    return Code(name=overload_code.fndesc.llvm_func_name, result=result,
                needs=tuple(name for name in needs if not name.startswith("llvm.")),
                content=overload_code.library._get_compiled_object(),
                door=packed_door(overload_code.fndesc.llvm_func_name, kinds_of(arguments)))


def _demand_call(function: Any, kinds: Kinds, result: Result) -> None:
    """Do nothing where a function takes addresses of result and error and then its arguments' numbers, one by one.

    What it writes to the first address has to be laid out as the loader reads it.
    """
    descriptor = function.fndesc
    call = function.target_context.call_conv.get_function_type(descriptor.restype, descriptor.argtypes)
    letters = [_TAKEN.get(str(each), "Q" if each.is_pointer else "") for each in call.args]
    written = result is None or _laid_out(call.args[0].pointee) == _parts(result)
    if letters != list(letters_of(kinds)) or str(call.return_type) != "i32" or not written:
        raise UnknownCall(f"{descriptor.qualname}: it takes {call}")


def _laid_out(kind: Any) -> Any:
    """Return a letter for a number, the parts of anything else."""
    letter = (_TAKEN | {"i1": "?"}).get(str(kind))  # a bit alone is written as a byte
    return letter or [_laid_out(part) for part in kind.elements]


def _parts(result: Result) -> Any:
    """Return a result without its classes."""
    return [_parts(part) for part in result[1:]] if isinstance(result, list) else result


def overload(function: Callable[..., Any], arguments: Sequence[Any], *, calls: bool = False) -> Any:
    """Return Numba's overload of a plain function; arguments as `object_code`."""
    machine, signature = _compiler(function, calls=calls, pipeline=_Whole), tuple(map(typeof, arguments))
    machine.compile(signature)
    return machine.overloads[signature]


def _result(function: Callable[..., Any], kind: Any) -> Result:
    """Return the result type of a compiled function, as `Code.result`."""
    if kind == types.none:
        return None
    if isinstance(kind, BaseTuple):
        tuple_class = kind.instance_class if isinstance(kind, BaseNamedTuple) else None
        where = "" if tuple_class is None else f"{tuple_class.__module__}:{tuple_class.__qualname__}"
        return [where, *(_result(function, each) for each in kind)]
    if kind not in _LETTERS:
        raise TypeError(f"{function.__qualname__}: it returns {kind}, not a number or a tuple of them")
    return _LETTERS[kind]


@remember
def _compiler(function: Callable[..., Any], *, calls: bool, pipeline: type[Compiler]) -> Any:
    """Return a compiled copy of a plain function whose calls go to compiled copies.

    None has a door to Python, and one that is only called by another no machine code of its own: half of the compiler's
    work.
    """
    plain = plainly(function)
    inside = {name: _compiler(value, calls=calls, pipeline=_Inlined) for name, value in callees(plain).items()}
    # no exceptions (a step is total), no reference counts as nothing is allocated, and all calls inlined: ten times
    # faster
    machine = njit(
        nogil=True, _nrt=False, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True,
        pipeline_class=pipeline, forceinline=pipeline is _Inlined and not calls)(copy_function(plain, inside))
    if pipeline is _Inlined:
        machine.get_call_template = partial(_of_types_alone, machine.get_call_template)
    return machine


def _of_types_alone(template: Callable[..., Any], args: Sequence[Any], named: Mapping[str, Any]) -> Any:
    """Choose a called function by the types of its arguments: Numba would compile it anew where one is a constant."""
    return template(tuple(map(unliteral, args)), {name: unliteral(value) for name, value in named.items()})
