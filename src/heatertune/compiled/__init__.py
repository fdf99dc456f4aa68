"""Plain functions made machine code: written once, run both ways, and kept on disk.

Everything here that leans on the inside of Python, NumPy, Numba or LLVM stands in this package and nowhere else; the
manual explains it (`docs/explain/machine_code.md`):

- `plain_functions`: stand-in functions, which a loop calls by global names, and `bound`, which replaces them;
- `generated`: the one place that runs generated source;
- `numba_compiler`: machine code from Numba without its doors to Python;
- `loader`: machine code as bytes, loaded by LLVM and called through `ctypes`; an array's address is read in its object;
- `dispatch`: where machine code pays, where it is kept, and which functions it belongs to;
- `check`: the probe that has to come out right before machine code is called this way, and Numba's own path, where it
  does not.
"""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

if TYPE_CHECKING:
    from heatertune.compiled.dispatch import (
        compile_elsewhere,
        compile_function,
        decide,
        has_machine_code,
        machine_code,
        tricks_hold,
        worth_a_second,
        worth_compiling,
    )
    from heatertune.compiled.plain_functions import bound, runs_compiled_as

__all__ = [
    "bound", "compile_elsewhere", "compile_function", "decide", "has_machine_code", "machine_code",
    "runs_compiled_as", "tricks_hold", "worth_a_second", "worth_compiling",
]

# plain source needs neither the loader nor the compiler
__getattr__, __dir__ = lazy_attributes(__name__, {
    "compiled.dispatch": (
        "compile_function", "decide", "has_machine_code", "machine_code", "compile_elsewhere", "tricks_hold",
        "worth_a_second", "worth_compiling"),
    "compiled.plain_functions": ("bound", "runs_compiled_as"),
})
