"""Stage documents → a table for the terminal, pictures, and one self-contained HTML page; it computes nothing."""

from heatertune.report.page import render, sections
from heatertune.report.text import summary

__all__ = ["render", "sections", "summary"]
