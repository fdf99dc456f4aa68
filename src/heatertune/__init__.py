"""From a temperature log to PLC words that have been proven before they reach the heater.

    log  →  model  →  pid  →  plc  →  proof  →  report

The functions here are the whole chain, stage by stage; `heatertune.chain` says more about each.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from heatertune.show import shown_by

__version__ = "0.1.0"

__all__ = ["design", "encode", "export", "fit", "prove", "read_log", "tune", "write_report"]

if TYPE_CHECKING:
    from heatertune.chain import design, encode, export, fit, prove, read_log, tune, write_report


def __getattr__(name: str) -> Any:
    """Import the chain when it is first used: `heatertune --help` needs none of it."""
    if name in __all__:
        return getattr(import_module("heatertune.chain"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _card(value: object) -> str:
    from heatertune.report.cards import card  # noqa: PLC0415 - drawn only when a front end asks

    return card(value)


shown_by(_card)


def __dir__() -> list[str]:
    return sorted(__all__)
