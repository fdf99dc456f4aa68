"""Structured text (IEC 61131-3): the part of the language that heatertune's own programs use, read and run."""
