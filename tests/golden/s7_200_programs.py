"""Programs of random instructions for the S7-200's machine, and what they leave behind."""

import random

from heatertune.plc.cpu.s7_200 import COLD, run

_RELATIONS = ("=", "<", ">", "<=", ">=")


class _Writer:
    """Writes one program."""

    def __init__(self, rng):
        self.rng = rng

    def any_of(self, *texts):
        return self.rng.choice(texts)

    def word(self):
        number = self.any_of(self.rng.randint(-32768, 32767), self.rng.randint(-3, 3))
        return self.any_of(self.word_cell(), f"{number:+d}")

    def word_cell(self):
        return self.any_of(f"VW{2 * self.rng.randint(0, 30)}", f"AC{self.rng.randint(0, 3)}")

    def double(self):
        number = self.any_of(self.rng.randint(-2**31, 2**31 - 1), self.rng.randint(-3, 3))
        return self.any_of(self.double_cell(), self.double_cell(), f"{number:+d}", f"16#{self.rng.randrange(2**32):X}")

    def double_cell(self):
        return self.any_of(f"VD{4 * self.rng.randint(0, 15)}", f"AC{self.rng.randint(0, 3)}")

    def byte(self):
        return self.any_of(f"VB{self.rng.randint(0, 60)}", f"{self.rng.randint(0, 255)}", "IB0", "SMB28")

    def real(self):
        number = self.any_of(0.0, 1.5, -2.25, 1e-30, 3e38, self.rng.uniform(-1000, 1000))
        return self.any_of(self.double_cell(), self.double_cell(), repr(number))

    def bit(self):
        return f"V{self.rng.randint(0, 60)}.{self.rng.randint(0, 7)}"

    def line(self):
        sums = self.any_of("+I", "-I"), self.any_of("+D", "-D", "ANDD", "XORD")
        two = {
            "MOVB": (self.byte(), f"VB{self.rng.randint(0, 60)}"), "MOVW": (self.word(), self.word_cell()),
            "MOVD": (self.double(), self.double_cell()), "MOVR": (self.real(), self.double_cell()),
            sums[0]: (self.word(), self.any_of(self.word_cell(), "SMW70")), sums[1]: (self.double(), self.double_cell()),
            self.any_of("MUL", "DIV"): (self.word(), self.double_cell()),
            self.any_of("*R", "/R"): (self.real(), self.double_cell()),
            "ITD": (self.word_cell(), self.double_cell()), "DTR": (self.double_cell(), self.double_cell()),
            "ROUND": (self.real(), self.double_cell()), "SRD": (self.double_cell(), str(self.any_of(0, 1, 31, 32, 200))),
        }
        name = self.any_of(*two)
        return self.any_of(
            f"{name}\t{', '.join(two[name])}", f"{name}\t{', '.join(two[name])}", f"{name}\t{', '.join(two[name])}",
            f"LDW{self.any_of(*_RELATIONS)}\t{self.word()}, {self.word()}",
            f"LDD{self.any_of(*_RELATIONS)}\t{self.double()}, {self.double()}",
            f"LD\t{self.any_of(self.bit(), 'SM1.0', 'SM1.1', 'SM1.2', 'SM1.3', 'I1.0')}", "LD\tSM0.0", "LD\tSM0.0",
            f"=\t{self.bit()}", f"S\t{self.bit()}, 1",
            self.any_of("PLS\t0", f"MOVB\t{self.rng.randint(0, 255)}, SMB67", "MOVW\t+500, SMW68", "CRETI", "ENI"),
            self.any_of("ATCH\tINT0, 10", "ATCH\tINT0, 0", "DTCH\t0"),
        )

    def block(self, kind, name, lines, more=()):
        written = [self.line() for _ in range(lines)]
        for one in more:
            written.insert(self.rng.randint(0, lines), one)
        return f"{kind}_BLOCK X:{name}\nBEGIN\nNetwork 1\n" + "".join(f"\t{line}\n" for line in written)


def program(seed):
    """The text of a program."""
    writer = _Writer(random.Random(f"program {seed}"))
    return (writer.block("ORGANIZATION", "OB1", 25, ["CALL\tSBR0"]) + writer.block("SUBROUTINE", "SBR0", 15)
            + writer.block("INTERRUPT", "INT0", 15))


def begin(seed):
    """A state to begin with: V memory with words, REALs of use among them, and inputs."""
    rng = random.Random(f"begin {seed}")
    words = {f"VW{2 * k}": rng.choice([rng.randint(-32768, 32767), 0, 1, 16256, 16384]) for k in range(32)}
    return COLD.written(words | {"IB0": rng.randint(0, 255), "SMB28": rng.randint(0, 255), "I1.0": rng.randint(0, 1)})


def left_behind(assembled, seed):
    """Three scans with an interrupt after each: V memory, accumulators, flags and the PWM's registers after each pass."""
    rng, state, seen = random.Random(f"run {seed}"), begin(seed), []
    wrap = rng.random() < 0.5
    for name in ("OB1", "INT0") * 3:
        state = run(assembled, name, state, wrap=wrap)
        seen.append((state.memory[288:304 + 60].hex(), state.memory[800:816].hex(), state.read("SMB1"), state.read("SMD66"),
                     state.read("SMW70"), state.cycle, state.width, bool(state.overflow), bool(state.zero_division), bool(state.pulsed)))
    return seen
