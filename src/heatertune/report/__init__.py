"""Stage documents → a table for the terminal, pictures, and one self-contained HTML page; it computes nothing."""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

if TYPE_CHECKING:
    from heatertune.report.page import render, sections
    from heatertune.report.text import summary

__all__ = ["render", "sections", "summary"]

__getattr__, __dir__ = lazy_attributes(__name__, {"report.page": ("render", "sections"), "report.text": ("summary",)})
