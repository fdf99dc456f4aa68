"""What the parameter sheet and the list of registers set in the instrument."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from heatertune.plc.exported import TextSettings
from heatertune.plc.pband.makes import Make
from heatertune.plc.pband.readback import from_text
from heatertune.plc.pband.step import PbandAssumptions
from heatertune.plc.pband.words import period_of

__all__ = ["loaders"]


def loaders(
    make: Make, files: Mapping[str, str | bytes], assume: PbandAssumptions  # noqa: ARG001 - of the instrument, not of a text
) -> dict[str, Callable[[], TextSettings]]:
    """Return what reads each file: both set all words, the PWM period among them where the make has one."""
    return {file: partial(_settings, make, file, str(text)) for file, text in files.items()}


def _settings(make: Make, file: str, text: str) -> TextSettings:
    values = from_text(make, text, None, file).values
    return TextSettings(values, period_s=period_of(make, values))
