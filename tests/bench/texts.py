"""Attacks the compiled way of exported structured text with the plain one: random programs of random numbers, bit for bit.

    python tests/bench/texts.py 200

Both ways run one text, so this says nothing of the text's meaning: that is held by `tests/plc/test_st_machines.py`. Each program runs 500
scans with numbers of any bits put in; afterwards the memory must be the same, and where a controller would stop, the compiled way must
have declined. Ends with status 1 where they differ.
"""

import argparse
import math
import random
import struct
import sys

import numpy as np

from heatertune.compiled import dispatch
from heatertune.errors import InputError
from heatertune.plc.cpu.iec.machine import KEEP, Tape, TextProgram
from heatertune.plc.cpu.iec.st_syntax import units

REALS, WHOLES, BOOLS = ("x", "y", "z"), ("n", "m", "k"), ("p", "q")
DECLARED = ("VAR\n  x : REAL := 1.5;\n  y : REAL;\n  z : REAL;\n  n : DINT := 3;\n  m : INT;\n  k : UINT;\n  p : BOOL := TRUE;\n"
            "  q : BOOL;\n  one : INNER;\n  two : INNER;\nEND_VAR\n")
INNER = ("FUNCTION_BLOCK INNER\nVAR_INPUT\n  x : REAL;\n  n : INT;\nEND_VAR\nVAR_OUTPUT\n  y : REAL;\n  q : BOOL;\nEND_VAR\n"
         "VAR\n  z : REAL := 0.25;\n  m : DINT;\n  k : UINT := 7;\n  p : BOOL;\nEND_VAR\n{}\nEND_FUNCTION_BLOCK\n")
SCANS = 500


def real(chance, deep=3):
    kind = chance.randrange(6 if deep else 3)
    if kind == 0:
        return chance.choice(REALS)
    if kind == 1:
        return f"{chance.uniform(0, 10 ** chance.randrange(7)):.6f}"
    if kind == 2:
        return f"DINT_TO_REAL({chance.choice(WHOLES)})"
    if kind == 3:
        return f"ABS({real(chance, deep - 1)})"
    return f"({real(chance, deep - 1)} {chance.choice('+-*/')} {real(chance, deep - 1)})"


def whole(chance, deep=2):
    kind = chance.randrange(5 if deep else 2)
    if kind == 0:
        return chance.choice(WHOLES)
    if kind == 1:
        return str(chance.choice((1, 2, 3, 7, 1000, 65535, 65536, 2147483647)))
    if kind == 2 and chance.random() < 0.1:  # else all would stop
        return f"TRUNC({real(chance, 1)})"
    sign = chance.choice(("+", "-", "*", "*", "/", "MOD"))
    sure = sign in ("/", "MOD") and chance.random() < 0.9
    return f"({whole(chance, deep - 1)} {sign} {chance.choice((1, 3, 7, 4096)) if sure else whole(chance, deep - 1)})"


def condition(chance, deep=2):
    kind = chance.randrange(5 if deep else 3)
    sign = chance.choice(("<", "<=", ">", ">=", "=", "<>"))
    if kind == 0:
        return chance.choice(BOOLS)
    if kind < 3:
        side = real if kind == 1 else whole
        return f"({side(chance, 1)} {sign} {side(chance, 1)})"
    if kind == 3:
        return f"NOT ({condition(chance, deep - 1)})"
    return f"({condition(chance, deep - 1)} {chance.choice(('AND', 'OR'))} {condition(chance, deep - 1)})"


def statement(chance, inner, deep=2):
    kind = chance.randrange(6 if deep else 4)
    if kind == 0:
        return f"{chance.choice(REALS)} := {real(chance)};"
    if kind == 1:
        return f"{chance.choice(WHOLES)} := {whole(chance)};"
    if kind == 2:
        return f"{chance.choice(BOOLS)} := {condition(chance)};"
    if kind == 3 and not inner:
        name = chance.choice(("one", "two"))
        return f"{name}(x := {real(chance, 1)}, n := {whole(chance, 1)});\ny := {name}.y;\nq := {name}.q;"
    bodies = ["\n".join(statement(chance, inner, deep - 1) for _ in range(2)) for _ in range(3)] if deep else ["x := y;"] * 3
    return (f"IF {condition(chance)} THEN\n{bodies[0]}\nELSIF {condition(chance)} THEN\n{bodies[1]}\nELSE\n{bodies[2]}\nEND_IF;")


def text(chance):
    inner, outer = ("\n".join(statement(chance, inside) for _ in range(chance.randrange(2, 6))) for inside in (True, False))
    return f"{INNER.format(inner)}PROGRAM Any\n{DECLARED}{outer}\nEND_PROGRAM\n"


def number(chance):
    if chance.random() < 0.4:
        return float(np.float32(chance.uniform(-100.0, 100.0)))
    value = struct.unpack("f", struct.pack("I", chance.getrandbits(32)))[0]
    return 0.0 if math.isnan(value) else value  # not a number means here that a number stays


def bits(memory):
    return [None if math.isnan(value) else np.float32(value).view(np.int32) for value in memory[0]], list(map(int, memory[1]))


def scanned(source, tape):
    """Return the memory after the scans one by one, None where a controller would stop."""
    program = TextProgram(source, {})
    for scan in range(tape.scans):
        for name, values in (*tape.reals.items(), *tape.wholes.items()):
            if not math.isnan(values[scan]) and values[scan] != KEEP:
                program[name] = values[scan].item()
        try:
            program.scan()
        except InputError:
            return None
    return program._memory


def main():
    asked = argparse.ArgumentParser()
    asked.add_argument("programs", nargs="?", type=int, default=50)
    asked.add_argument("--seed", type=int, default=0)
    given = asked.parse_args()
    dispatch.decide(True)
    ran = stopped = wrong = 0
    for seed in range(given.seed, given.seed + given.programs):
        chance = random.Random(seed)
        source = units(text(chance))
        for _ in range(4):  # one function, other numbers
            keeps = np.array([chance.random() < 0.5 for _ in range(SCANS)])
            reals = {name: np.where(keeps, np.nan, [number(chance) for _ in range(SCANS)]) for name in REALS[:2]}
            wholes = {name: np.where(keeps, KEEP, [chance.randrange(-32768, 32768) for _ in range(SCANS)]) for name in WHOLES[:2]}
            tape = Tape(SCANS, reals, wholes, ("x", "n", "p"))
            program, expected = TextProgram(source, {}), scanned(source, tape)
            got = program.scans(tape)
            if (got is None) != (expected is None):
                wrong += 1
                print(f"seed {seed}: {'declined' if got is None else 'ran on'}, the plain way {'stops' if expected is None else 'does not'}", flush=True)
            elif expected is None:
                stopped += 1
            elif bits(program._memory) == bits(expected):
                ran += 1
            else:
                wrong += 1
                print(f"seed {seed}: other numbers at the end", flush=True)
    print(f"{given.programs} programs: {ran} runs of {SCANS} scans the same, {stopped} stopped in both ways, {wrong} differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
