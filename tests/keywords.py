"""Write `heatertune.keywords`, the options of the functions for editors and mypy: `python -m tests.keywords --update`.

The dataclasses of `heatertune.settings` declare each option once; a type checker cannot read keywords from them.
"""

import argparse
import re
import textwrap
from dataclasses import fields

from heatertune import options, settings
from heatertune.settings import AsLeftSettings
from tests.conftest import ROOT

FILE = ROOT / "src" / "heatertune" / "keywords.py"
KINDS = (
    settings.ReadSettings, settings.FitSettings, settings.ValidateSettings, settings.TuneSettings,
    settings.SensorSettings, settings.WordSettings, settings.SampleSettings, settings.Conditions, AsLeftSettings)
#: TypedDict → those whose options it has all
UNIONS = {"LogFitOptions": ("ReadOptions", "FitOptions"), "TargetTuneOptions": ("TuneOptions", "SensorOptions"),
          "DesignOptions": ("TuneOptions", "SensorOptions", "WordOptions", "ConditionOptions")}
#: TypedDict → its further keywords, which are no options of a stage
OWN = {"DesignOptions": (
    "    #: the controller\n    target: str", "    #: whether TA is the one whose parameters round best\n    interval_by_words: bool",
    "    #: on which drawn heaters the design has to pass as well\n    sample_settings: SampleSettings | None")}
#: they are written in capitals as well
ABBREVIATIONS = ("p", "pi", "pid", "ki", "iae", "itae", "ise", "ssr", "rtd", "k")
HEAD = '''"""The options of the functions by name, for editors and mypy; written by `python -m tests.keywords --update`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, TypedDict

if TYPE_CHECKING:
    from heatertune.settings import SampleSettings

__all__ = [
'''


def name_of(kind):
    return f"{kind.__name__.removesuffix('Settings').removesuffix('s')}Options"


def _literal(texts):
    spelled = [each for text in texts for each in ((text, text.upper()) if text in ABBREVIATIONS else (text,))]
    return f"Literal[{', '.join(f'{chr(34)}{each}{chr(34)}' for each in dict.fromkeys(spelled))}]"


def type_of(one, annotated):
    """Return the type of a keyword: that of the field, with the texts that it may be."""
    texts = (*one.choices, *one.or_text, *one.automatic[:1])
    annotated = annotated.replace("tuple[str, ...]", "tuple[str, ...] | list[str] | str")
    if texts:
        parts = [part for part in annotated.split(" | ") if part not in ("str", "None")]
        annotated = " | ".join([*parts, _literal(texts), *(["None"] if "None" in annotated else [])])
    return annotated


def _entry(name, one, annotated):
    default = one.instead[0] or ("" if one.default in (None, (), {}, False) else f"{one.default}")
    meaning = f"{one.quantity_with_unit}{f' (default: {default})' if default else ''}"
    comment = textwrap.wrap(meaning, 112, initial_indent="    #: ", subsequent_indent="    #: ")
    declared = f"    {name}: {annotated}"
    if len(declared) > 120:
        head, _, tail = declared.partition("Literal[")
        declared = f"{head}Literal[\n        {tail.removesuffix(' | None').removesuffix(']')}] | None"
    return [*comment, declared]


def content():
    """Return the module as it should be."""
    names = sorted([*map(name_of, KINDS), *UNIONS])
    listed = "\n".join(f'    "{name}",' for name in names)
    lines = [f"{HEAD}{listed}\n]\n"]
    for kind in KINDS:
        lines += ["", f"class {name_of(kind)}(TypedDict, total=False):", f'    """Keywords of `{kind.__name__}`."""', ""]
        own = options.options_of(kind)
        for field in fields(kind):
            if field.name in own:
                lines += _entry(field.name, own[field.name], type_of(own[field.name], re.sub(r"\s+", " ", field.type)))
        lines.append("")
    for name, bases in UNIONS.items():
        lines += ["", f"class {name}({', '.join(bases)}, total=False):", f'    """{" and ".join(bases)}."""', *(("", *OWN[name]) if name in OWN else ()), ""]
    return "\n".join(lines).rstrip("\n") + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", help="write the module")
    if parser.parse_args().update:
        FILE.write_text(content(), encoding="utf-8")
    else:
        print(content(), end="")
