"""An S7-300 that takes one statement after the other, for what stands in a data block: the witness of the proof's own.

From "Statement List (STL) for S7-300 and S7-400", reference manual; whole numbers and REALs are NumPy's.
"""

import operator
import re

import numpy as np

COMPARE = {"==": operator.eq, "<>": operator.ne, ">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}
WHOLE = {"+": operator.add, "-": operator.sub, "*": operator.mul, "A": operator.and_}
BYTES = {"B": 1, "W": 2, "D": 4}
MOST_STEPS = 10_000


class Stopped(Exception):
    """What makes a CPU stop, or never end."""


class Machine:
    """Blocks of statements (label, operation, operand), and one data block."""

    def __init__(self, blocks, data):
        self.blocks, self.data = blocks, bytearray(data)
        self.one = self.two = 0
        self.true = self.os = False
        self.steps = 0

    def run(self, name):
        """Run a block to its end."""
        lines, at, self.first = self.blocks[name], 0, True
        labels = {label: place for place, (label, *_) in enumerate(lines) if label}
        while at is not None and at < len(lines):
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Stopped
            _, operation, operand = lines[at]
            at = self.step(operation, operand, labels, at + 1)
        self.first = True

    def step(self, operation, operand, labels, after):
        """Carry a statement out; return the place of the next one, None: the block ends."""
        if operation in ("JU", "JC", "JCN", "JOS"):
            goes = {"JU": True, "JC": self.true, "JCN": not self.true, "JOS": self.os}[operation]
            self.first = True
            self.os = self.os and operation != "JOS"
            self.true = self.true or operation in ("JC", "JCN")
            return labels[operand] if goes else after
        if operation == "BEU":
            return None
        if operation == "CALL":
            self.run(operand)
        elif operation == "L":
            self.one, self.two = self.loaded(operand), self.one
        elif operation == "TAK":
            self.one, self.two = self.two, self.one
        elif operation == "T":
            place, size = int(operand.split()[1]), BYTES[operand[6]]
            self.data[place:place + size] = (self.one % 256**size).to_bytes(size, "big")
        elif operation in ("A", "AN", "=", "S", "R", "SET", "CLR"):
            self.logic(operation, operand)
        elif operation[:-1] in COMPARE:
            kind = operation[-1]
            two, one = (self.meant(held, kind) for held in (self.two, self.one))
            self.true, self.first = bool(COMPARE[operation[:-1]](two, one)), False
        elif operation != "NOP":
            self.one = self.computed(operation, operand)
        return after

    def loaded(self, operand):
        """Return the bits that L brings."""
        if found := re.fullmatch(r"DB1\.DB([BWD]) (\d+)", operand):
            return int.from_bytes(self.data[int(found[2]):int(found[2]) + BYTES[found[1]]], "big")
        if operand.startswith("L#"):
            return int(operand[2:]) % 2**32
        if "." in operand:
            return int(np.float32(operand).view(np.uint32))
        return int(operand) % 2**16

    def logic(self, operation, operand):
        """Carry out a statement of bits."""
        if operation in ("SET", "CLR"):
            self.true, self.first = operation == "SET", True
            return
        byte, bit = map(int, operand.split()[1].split("."))
        if operation in ("A", "AN"):
            asked = bool(self.data[byte] & 1 << bit) != (operation == "AN")
            self.true, self.first = asked if self.first else self.true and asked, False
            return
        if operation == "=" or self.true:
            on = self.true if operation == "=" else operation == "S"
            self.data[byte] = self.data[byte] | 1 << bit if on else self.data[byte] & ~(1 << bit)
        self.first = True

    @staticmethod
    def meant(held, kind):
        """Return what bits mean."""
        if kind == "R":
            return np.uint32(held).view(np.float32)
        return np.uint16(held % 2**16).view(np.int16) if kind == "I" else np.uint32(held).view(np.int32)

    def real(self, value, *, counts=True):
        """Return the bits of a REAL: none below the normal ones, one NaN; OS tells of it."""
        with np.errstate(over="ignore"):
            small, rounded = value != 0.0 and abs(value) < np.finfo(np.float32).tiny, np.float32(value)
        self.os = bool(self.os or (counts and (small or not np.isfinite(rounded))))
        return 0 if small else 0x7FC00000 if np.isnan(rounded) else int(rounded.view(np.uint32))

    def computed(self, operation, operand):  # noqa: PLR0911 - one branch for each kind
        """Return the ACCU 1 that a statement makes."""
        one, two = self.one, self.two
        if operation == "SRD":
            return one >> int(operand)
        if operation == "ITD":
            return int(self.meant(one, "I")) % 2**32
        if operation == "DTR":
            return self.real(np.float32(self.meant(one, "D")), counts=False)
        if operation in ("RND", "TRUNC"):
            number = self.meant(one, "R")
            if not np.isfinite(number):
                raise Stopped
            return int((np.rint if operation == "RND" else np.trunc)(np.float64(number))) % 2**32
        if operation in ("/D", "MOD"):
            dividend, divisor = int(self.meant(two, "D")), int(self.meant(one, "D"))
            if divisor == 0:
                raise Stopped
            share = int(np.trunc(np.longdouble(dividend) / np.longdouble(divisor)))
            return (share if operation == "/D" else dividend - share * divisor) % 2**32
        sign, kind = operation[0], operation[-1]
        if kind == "R":
            with np.errstate(all="ignore"):
                a, b = np.float64(self.meant(two, "R")), np.float64(self.meant(one, "R"))
                return self.real({"+": a + b, "-": a - b, "*": a * b, "/": a / b}[sign])
        if kind == "I":
            return one - one % 2**16 + WHOLE[sign](two, one) % 2**16
        return WHOLE[sign](two, one) % 2**32
