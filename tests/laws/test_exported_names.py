"""No exported program declares a name that its language, or a library that is always there, already has.

The lists of `reserved/` are data with their sources; the names are found by patterns and by parsers of their own, not by what wrote the files.
"""

import ast
import builtins
import keyword
import re
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import pytest
from tests.plc.export_corpus import controller_exports, every_export, feed_forwards, monitors

RESERVED = Path(__file__).with_name("reserved")
#: inputs whose names are those of a block that exists: PV of the standard's PID, which is an operand of its counters alone; members of STEP 7's blocks
ALLOWED = {"iec": {"PV"}, "stl": {"SP", "SD"}}
NAME = r"[A-Za-z_]\w*"


@cache
def reserved(language):
    """Return the words of a language, in capitals where its case does not count."""
    lines = (RESERVED / f"{language}.txt").read_text(encoding="ascii").splitlines()
    words = " ".join(line for line in lines if not line.startswith("#")).split()
    if language in ("cpp", "esphome"):
        return frozenset(words) | (reserved("cpp") if language == "esphome" else frozenset())
    more = reserved("iec") if language == "scl" else frozenset()
    return frozenset(word.upper() for word in words) | more


def is_reserved(language, name):
    if language == "python":
        return keyword.iskeyword(name) or keyword.issoftkeyword(name) or hasattr(builtins, name)
    plain = name if language in ("cpp", "esphome") else name.upper()
    conversion = language in ("iec", "scl") and re.fullmatch(r"[A-Z]+_TO_[A-Z]+", plain)
    return (plain in reserved(language) or bool(conversion)) and plain not in ALLOWED.get(language, ())


def without_comments(text):
    """Return structured text or SCL without comments and strings."""
    return re.sub(r"\(\*.*?\*\)|//[^\n]*|'[^'\n]*'", " ", text, flags=re.DOTALL)


def names_in_structured_text(text):
    """Return what a text declares: its program units, their variables and instances."""
    plain = without_comments(text)
    units = re.findall(rf"\b(?:FUNCTION_BLOCK|PROGRAM|FUNCTION|TYPE)\s+\"?({NAME})", plain)
    sections = re.findall(r"\bVAR(?:_\w+)?\b(?:\s+CONSTANT|\s+RETAIN|\s+NON_RETAIN)?(.*?)\bEND_VAR\b", plain, re.DOTALL)
    return [*units, *(name for section in sections for name in re.findall(rf"({NAME})\s*:(?!=)", section))]


def names_in_project(text):
    """Return every name that a PLCopen project gives: units, variables, configuration, resource, task and instance."""
    return [each.get("name") for each in ElementTree.fromstring(text).iter() if each.get("name") and not each.tag.endswith("contentHeader")]


def names_in_statement_list(text):
    """Return labels and members of a source of the S7-300."""
    plain = re.sub(r"//[^\r\n]*", " ", text)
    members = re.findall(rf"^\s*({NAME})\s*:\s*(?:BOOL|BYTE|WORD|DWORD|INT|DINT|REAL|TIME|S5TIME|ARRAY|STRUCT)\b", plain, re.MULTILINE)
    return [*members, *re.findall(r"^(\w+):\s", plain, re.MULTILINE)]


def names_in_sketch(text):
    """Return what a sketch declares: constants, variables, functions and their parameters."""
    plain = re.sub(r"//[^\n]*|\"[^\"\n]*\"", " ", text)
    return re.findall(rf"\b(?:int|long|double|float|bool|void|PID)\s+({NAME})(?=\s*[=(,);])", plain)


def names_in_module(text):
    """Return what a module of Python defines or binds."""
    tree = ast.walk(ast.parse(text))
    return [name for node in tree for name in (
        [node.name] if isinstance(node, ast.FunctionDef) else [node.arg] if isinstance(node, ast.arg)
        else [node.id] if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else [])]


#: end of a file's name → its language, and what finds its names
FINDERS = {
    ".st": ("iec", names_in_structured_text), ".xml": ("iec", names_in_project), ".scl": ("scl", names_in_structured_text),
    ".ino": ("cpp", names_in_sketch), ".yaml": ("esphome", lambda text: re.findall(rf"^\s*(?:- )?id:\s*({NAME})", text, re.MULTILINE)),
    ".py": ("python", names_in_module),
}
#: files that declare no names of their own: firmware's sections, registers, G-code, machine code, STEP 5, and lists to key in
NAMELESS = (".cfg", ".gcode", ".h", ".csv", ".txt", ".hex")


def finder(export, file):
    """Return language and finder of a file; None: it declares no names."""
    if file.endswith(".awl"):  # an S7-200's list has networks and addresses alone
        return None if export.label.startswith("s7-200") else ("stl", names_in_statement_list)
    end = f".{file.rpartition('.')[2]}"
    if end in NAMELESS:
        return None
    return FINDERS[end]


def test_no_exported_name_is_reserved():
    seen, taken = {}, []
    for export in every_export():
        for file, text in export.texts.items():
            found = finder(export, file)
            if found is None:
                continue
            language, names_of = found
            names = names_of(text)
            assert names or "feed_forward" in file, (export.label, file)
            seen.setdefault(language, set()).update(names)
            taken += [(export.label, file, name) for name in names if is_reserved(language, name)]
    assert not taken
    assert {language: len(names) > 2 for language, names in seen.items()} == dict.fromkeys(("iec", "scl", "stl", "cpp", "esphome", "python"), True)


def test_in_one_unit_no_name_is_declared_twice_whatever_its_case():
    for export in every_export():
        for file, text in export.texts.items():
            if not file.endswith((".st", ".scl")):
                continue
            for unit in re.split(r"(?=^(?:FUNCTION_BLOCK|PROGRAM|FUNCTION) )", without_comments(text), flags=re.MULTILINE)[1:]:
                names = [name.upper() for name in names_in_structured_text(unit)]
                assert len(names) == len(set(names)), (export.label, file)


@pytest.mark.parametrize(("language", "name"), [
    ("iec", "Integral"), ("iec", "Resource"), ("iec", "derivative"), ("iec", "Ramp"), ("iec", "REAL_TO_DINT"), ("scl", "Begin"), ("scl", "Type"),
    ("stl", "BEGIN"), ("cpp", "OUTPUT"), ("cpp", "switch"), ("python", "max"), ("python", "lambda")])
def test_the_lists_have_what_was_once_exported_and_what_is_known_to_break(language, name):
    assert is_reserved(language, name)


@pytest.mark.parametrize(("names_of", "text", "expected"), [
    (names_in_structured_text, "PROGRAM Heater\nVAR (* not : this *)\n a : REAL := 1.0; b : PID;\nEND_VAR\nx := 1;\nEND_PROGRAM", ["Heater", "a", "b"]),
    (names_in_sketch, "const unsigned long STEP_MS = 1; // int no\ndouble f(double x) {\n bool on = false;", ["STEP_MS", "f", "x", "on"]),
    (names_in_statement_list, "FUNCTION FC 1 : VOID\nVAR_TEMP\n  led : REAL ;\nEND_VAR\non:   L 1;\n", ["led", "on"]),
    (names_in_module, "import math\ndef f(x):\n    y = x\n", ["f", "x", "y"])])
def test_the_finders_find_every_declaration(names_of, text, expected):
    assert sorted(names_of(text)) == sorted(expected)


#: ends of files that a tool on Windows imports or shows in an editor of its own
WINDOWS = (".st", ".scl", ".awl", ".xml", ".csv", ".gcode", ".cfg", ".h")


def test_what_a_programming_tool_imports_is_ascii():
    files = [(export.label, file) for export in every_export() for file, text in export.texts.items()
             if file.endswith(WINDOWS) and not text.isascii()]
    assert not files


def test_a_remark_ends_no_comment():
    for export in [*controller_exports("weg"), *controller_exports("iec-pid"), *controller_exports("pid-compact"), *monitors(), *feed_forwards()]:
        for file, text in export.texts.items():
            if file.endswith((".st", ".scl")):
                assert text.count("(*") == text.count("*)"), (export.label, file)
                assert "by name" not in without_comments(text), (export.label, file)


def test_a_remark_stays_on_one_line():
    for export in every_export():
        for file, text in export.texts.items():
            assert not re.search(r"^\s*(?:L     4711;|lines\b)", text, re.MULTILINE), (export.label, file)
