"""The machine for structured text that proofs use, beside the tests' own: one parses by itself and rounds by ctypes, the other has
tree-sitter's grammar and NumPy's singles. Both run random programs of random numbers.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.plc.st_machine import Program as Witness

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.machine import TextProgram
from heatertune.plc.cpu.iec.st_syntax import units

REALS, WHOLES, BOOLS = ("x", "y", "z"), ("n", "m", "k"), ("p", "q")
DECLARED = ("VAR\n  x : REAL := 1.5;\n  y, z : REAL;\n  n : DINT := 3;\n  m : INT;\n  k : UINT;\n  p : BOOL := TRUE;\n  q : BOOL;\nEND_VAR\n"
            .replace("y, z : REAL", "y : REAL;\n  z : REAL"))

real_literals = st.floats(0.0, 1e6, width=32).map(lambda value: f"{value:.6f}")
whole_literals = st.integers(0, 999).map(str)


def _pairs(inner, *signs):
    return st.tuples(inner, st.sampled_from(signs), inner).map(lambda parts: f"({' '.join(parts)})")


def _reals():
    leaves = st.sampled_from(REALS) | real_literals | st.sampled_from(WHOLES).map(lambda name: f"DINT_TO_REAL({name})")
    return st.recursive(leaves, lambda inner: _pairs(inner, *"+-*/") | inner.map(lambda one: f"ABS({one})"), max_leaves=6)


def _wholes():
    # none below zero, and none beyond 32 bits: there the witness has other numbers
    pair = _pairs(st.sampled_from(WHOLES) | whole_literals, *"+*")
    return st.tuples(pair, st.sampled_from(("/", "MOD")), st.integers(1, 999)).map(lambda parts: f"({parts[0]} {parts[1]} {parts[2]}) MOD 30000")


conditions = st.recursive(
    st.sampled_from(BOOLS) | _pairs(_reals(), "<", "<=", ">", ">=", "=", "<>") | _pairs(_wholes(), "<", "<=", ">", ">=", "=", "<>"),
    lambda inner: _pairs(inner, "AND", "OR") | inner.map(lambda one: f"NOT ({one})"), max_leaves=4)

assignments = (
    st.tuples(st.sampled_from(REALS), _reals()) | st.tuples(st.sampled_from(WHOLES), _wholes()) | st.tuples(st.sampled_from(BOOLS), conditions)
).map(lambda parts: f"{parts[0]} := {parts[1]};")
truncations = st.tuples(st.sampled_from(WHOLES), st.sampled_from(REALS)).map(
    lambda parts: f"IF ABS({parts[1]}) < 30000.0 THEN {parts[0]} := TRUNC(ABS({parts[1]})); END_IF;")


def _statements(inner):
    bodies = st.lists(inner, min_size=1, max_size=3).map("\n".join)
    return st.tuples(conditions, bodies, conditions, bodies, bodies).map(
        lambda parts: "IF {} THEN\n{}\nELSIF {} THEN (* another *)\n{}\nELSE\n{}\nEND_IF;".format(*parts))


statements = st.lists(st.recursive(assignments | truncations, _statements, max_leaves=5), min_size=1, max_size=6).map("\n".join)


@pytest.mark.long
@given(body=statements, inputs=st.lists(st.tuples(*[st.floats(width=32)] * 3), min_size=1, max_size=3))
def test_two_machines_give_the_same_bits_for_random_programs(body, inputs):
    text = f"PROGRAM Any\n{DECLARED}\n{body}\nEND_PROGRAM\n"
    ours, witness = TextProgram(units(text), {}), Witness(text)
    for values in inputs:
        for name, value in zip(REALS, values, strict=True):
            ours[name] = value
        ours.scan()
        theirs = witness.call(**{name: np.float32(value) for name, value in zip(REALS, values, strict=True)})
        for name in REALS:
            mine, other = ours[name], float(getattr(theirs, name))
            assert mine == other or (math.isnan(mine) and math.isnan(other)), (name, text)
        assert [ours[name] for name in (*WHOLES, *BOOLS)] == [getattr(theirs, name) for name in (*WHOLES, *BOOLS)], text


@pytest.mark.parametrize(("body", "told"), [
    ("x := 1;", "line 13: 'x := 1;'; expected REAL"), ("n := 1.0;", "expected DINT"), ("x := x + n;", r"\+ does not go with REAL and WHOLE"),
    ("w := 1.0;", "W is not declared"), ("IF x THEN\n  n := 1;\nEND_IF;", "expected BOOL"), ("n := 1", "line 14: 'END_PROGRAM'; expected ;"),
    ("IF p THEN\n  n := 1;\nELSIF n THEN\n  n := 2;\nEND_IF;", "line 15: 'ELSIF n THEN'; expected BOOL"),
    ("FOR n := 1 TO 3 DO", "line 13: 'FOR n := 1 TO 3 DO'"), ("n := 1 # 2;", "'#' is no sign"), ("(* open", "expected END_PROGRAM"),
    ("Block(a := 1);", "BLOCK is no instance"), ("Block(a := 1 b := 2);", "expected ,"), ("x.y := 1.0;", "X.Y is not declared"), ("p := p < q;", "< does not go with BOOL and BOOL"),
    ("x := SIN(x);", r"line 13: 'x := SIN\(x\);'; expected ;"),
])
def test_what_the_machine_does_not_know_is_named_with_its_line(body, told):
    with pytest.raises(InputError, match=told):
        TextProgram(units(f"PROGRAM Any\n{DECLARED}\n{body}\nEND_PROGRAM\n"), {})


@pytest.mark.parametrize("statement", ["n := n / (n - n);", "n := n MOD 0;", "n := TRUNC(x / 0.0);", "n := TRUNC(3000000000.0);"])
def test_where_a_controller_would_stop_the_line_is_named(statement):
    program = TextProgram(units(f"PROGRAM Any\n{DECLARED}\nx := 1.0;\n{statement}\nEND_PROGRAM\n"), {})
    with pytest.raises(InputError, match=r"line 14: .*; a controller stops here"):
        program.scan()


def test_whole_numbers_have_the_bits_of_their_variables_and_are_cut_towards_zero():
    # IEC 61131-3, tables 10 and 24: INT 16 bits with a sign, UINT without, DINT 32; -7 / 2 = -3, and -7 MOD 2 = -1
    program = TextProgram(units(f"PROGRAM Any\n{DECLARED}\nm := 32767;\nm := m + 1;\nk := 0;\nk := k - 1;\nn := (0 - 7) / 2;\n"
                            "IF (0 - 7) MOD 2 = -1 THEN\n  x := -0.5;\nEND_IF;\nEND_PROGRAM\n"), {})
    program.scan()
    assert [program[name] for name in ("m", "k", "n", "x")] == [-32768, 65535, -3, -0.5]


def test_a_constant_is_not_written_and_a_name_is_declared_once():
    for declared, told in (("VAR CONSTANT\n  c : REAL := 1.0;\nEND_VAR", "C is a constant"), ("VAR\n  c : REAL;\n  C : INT;\nEND_VAR", "twice"),
                           ("VAR\n  c : BOOL := 3;\nEND_VAR", "3 is no BOOL"), ("VAR\n  c : LREAL;\nEND_VAR", "LREAL is no type")):
        with pytest.raises(InputError, match=told):
            TextProgram(units(f"PROGRAM Any\n{declared}\nc := 2.0;\nEND_PROGRAM\n"), {})
    with pytest.raises(InputError, match="0 programs"):
        TextProgram([], {})
