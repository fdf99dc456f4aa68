"""What a package offers, imported when it is first used: who needs one module of it does not wait for the others."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from heatertune.errors import did_you_mean

__all__ = ["lazy_attributes"]


def lazy_attributes(
    package: str, homes: Mapping[str, tuple[str, ...]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__getattr__` and the `__dir__` of a package, which lists its `__all__`.

    Args:
        package: its name.
        homes: module, as named within heatertune → what of it the package offers; no name of it is that of a module
            of the package, which would hide it.
    """
    home_of = {name: home for home, names in homes.items() for name in names}

    def get(name: str) -> Any:
        if name in home_of:
            return getattr(import_module(f"heatertune.{home_of[name]}"), name)
        meant = "" if name.startswith("_") else did_you_mean(name, home_of)
        raise AttributeError(f"module {package!r} has no attribute {name!r}{meant}")

    return get, lambda: sorted(sys.modules[package].__all__)
