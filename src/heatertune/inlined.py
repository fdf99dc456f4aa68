"""How Numba compiles what only other compiled functions call: these take it in, so it needs no machine code of its own.

The compiler spends a fifth of its time on such code, which nobody runs. Importing this imports Numba.
"""

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

__all__ = ["Inlined"]


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


class Inlined(Compiler):  # type: ignore[misc]
    """Numba's compiler without the last step, for what is never called from Python."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a plain function."""
        self.state.library = _Intermediate(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)
