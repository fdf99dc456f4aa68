"""What the lines for Configuration.h and the G-code set in the firmware."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from heatertune.plc.exported import TextSettings
from heatertune.plc.marlin.readback import from_text
from heatertune.plc.marlin.step import MarlinAssumptions

__all__ = ["loaders"]


def loaders(files: Mapping[str, str | bytes], assume: MarlinAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads each file: both set all words."""
    return {file: partial(_settings, file, str(text)) for file, text in files.items()}


def _settings(file: str, text: str) -> TextSettings:
    return TextSettings(from_text(text, None, file).values)
