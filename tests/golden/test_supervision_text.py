"""The monitor's exported texts in machines that share nothing with heatertune: the alarms of the second monitor, call by call.

The second monitor is written from the meaning of the numbers (`second_monitor`). S5: `s5_machine`, from the list of operations.
S7-300: awlsim. Structured text: tree-sitter's grammar and NumPy. S7-200: `Words` here, from the System Manual's chapter 9.
"""

import random
import re

import numpy as np
import pytest
from tests.bench.second_monitor import Monitors
from tests.golden.s5_machine import Machine
from tests.plc.st_machine import FunctionBlock
from tests.proof.test_supervision import random_numbers

from heatertune.errors import InputError
from heatertune.plc.cpu.s5.machine import S5Cpu
from heatertune.supervision.text import s5, s7_200, s7_300, structured
from heatertune.supervision.text.monitor_statements import statements_of

HEAD = ["a monitor"]


def walk(chance, calls):
    """Yield what a call gets, reading and power, and whether the monitor begins anew before."""
    reading, power = 500.0, 50.0
    for _ in range(calls):
        reading += chance.gauss(0, 12) if chance.random() < 0.3 else 0.0
        reading += chance.gauss(0, 90) if chance.random() < 0.01 else 0.0
        reading = max(0.0, min(1100.0, reading))
        power = max(0.0, min(100.0, power + chance.gauss(0, 40))) if chance.random() < 0.2 else power
        yield int(reading), int(power), chance.random() < 0.005


def check(load, monitors, calls, seed=1):
    """Hold a text against the second monitor; `load` gives call(reading, power) → (alarm, first) and begin anew."""
    chance, said = random.Random(seed), set()
    for _ in range(monitors):
        numbers = random_numbers(chance)
        call, anew = load(numbers)
        second, first = Monitors(numbers._asdict(), 1), 0
        for reading, power, begins in walk(chance, calls):
            if begins:
                anew()
                second.again()
            alarm = int(second.feed(np.array([reading]), np.array([power]))[0])
            first = first or alarm
            assert call(reading, power) == (alarm, first), numbers
            said.add(alarm)
    assert said == set(range(9))


@pytest.mark.long(seconds=5)
def test_the_s5_s_listing_says_the_same_in_words_with_carries():
    def load(numbers):
        given = "".join(f"{dw:4d}:  KF = +00000;\n" for dw in range(5))
        machine = Machine(f"{s5.written(statements_of(numbers), HEAD)}\nDB31\n{given}", wraps=True)

        def call(reading, power):
            machine.data[31][1], machine.data[31][4] = reading, power * 2047 // 100
            machine.call("FB 34")
            return tuple(machine.data[32][:2])

        return call, lambda: machine.call("FB 37")

    check(load, 40, 400)


def test_the_s5_s_listing_makes_the_nearest_whole_percent_of_every_output():
    given = "".join(f"{dw:4d}:  KF = +00000;\n" for dw in range(5))
    machine = Machine(f"{s5.written(statements_of(random_numbers(random.Random(1))), HEAD)}\nDB31\n{given}", wraps=True)
    for output in range(2048):
        machine.data[31][4] = output
        machine.call("FB 34")
        assert machine.data[32][3] == (200 * output + 2047) // (2 * 2047)


@pytest.mark.parametrize(("old", "new"), [("Z1   :DW", "Z2   :DW"), ("Z32  :DW", "Z32  :FW"), ("Z3=0 :F 200.0\n", "")])
def test_the_s5_refuses_a_multiplier_without_its_parameters(old, new):
    text = s5.written(statements_of(random_numbers(random.Random(0))._replace(slow_blocks=2)), HEAD)
    assert old in text
    with pytest.raises(InputError, match=r"FB 242|is none that is known here"):
        S5Cpu(text.replace(old, new, 1), {})


@pytest.mark.long(seconds=5)
def test_the_structured_text_says_the_same():
    def load(numbers):
        text = structured.written(statements_of(numbers), HEAD, low_degC=-20.0, step_degC=0.25, highest=1100)
        block = FunctionBlock(text)

        def call(reading, power):
            made = block.call(Runs=True, Acknowledge=False, Temperature=0.25 * reading - 20.0, Output=power)
            return made.Alarm, made.Told

        return call, lambda: block.call(Runs=False)

    check(load, 40, 400)


@pytest.mark.long(seconds=30)
@pytest.mark.parametrize("real", [False, True])
def test_the_s7_300_s_source_says_the_same_in_awlsim(machine, real):
    caller = ("\r\nORGANIZATION_BLOCK OB 35\r\nVAR_TEMP\r\n  told : ARRAY  [1 .. 20 ] OF BYTE ;\r\nEND_VAR\r\nBEGIN\r\nNETWORK\r\n"
              "      CALL FB 105 , DB 105 (\r\n           PV := PIW 256);\r\nEND_ORGANIZATION_BLOCK\r\n")

    def load(numbers):
        machine.load(s7_300.written(statements_of(numbers), HEAD, real=real) + caller)

        def call(reading, power):
            machine.write(105, OUT=float(power) if real else 27648 * power // 100)
            machine.tick(100, reading)
            return machine.read(105, "ALARM"), machine.read(105, "TOLD")

        return call, lambda: machine.write(105, BEGUN=0)

    check(load, 12, 300, seed=11)


class Words:
    """An S7-200's V memory and accumulators: what the two subroutines do, line by line."""

    def __init__(self, text):
        self.cells, self.code = {}, {}
        for line in text.splitlines():
            if begins := re.match(r"SUBROUTINE_BLOCK \w+:(\w+)", line):
                block = self.code[begins[1]] = []
            elif line.startswith("\t"):
                name, _, operands = line[1:].partition("\t")
                block.append((name, operands.split(", ")))

    def value(self, text, bits=16):
        number = int(text) if re.fullmatch(r"[+-]\d+", text) else self.cells.get(text, 0)
        return (number + (1 << bits - 1)) % (1 << bits) - (1 << bits - 1)

    def put(self, place, number, bits):
        assert -1 << bits - 1 <= number < 1 << bits - 1, "an overflow would leave the operand as it was"
        if place.startswith("AC") and bits == 16:
            number = self.cells.get(place, 0) & ~0xFFFF | number & 0xFFFF
        self.cells[place] = number

    def run(self, block):
        top = True
        for name, (first, *rest) in self.code[block]:
            if compared := re.fullmatch(r"LD([WD])([<>=]+)", name):
                one, two = (self.value(each, 16 if compared[1] == "W" else 32) for each in (first, *rest))
                top = {"=": one == two, "<": one < two, ">": one > two, "<=": one <= two, ">=": one >= two}[compared[2]]
            elif name == "LD":
                assert first == "SM0.0"
                top = True
            elif top:
                self.act(name, first, rest[0])

    def act(self, name, first, place):
        bits = 32 if name in ("MOVD", "+D", "-D") else 16
        if name in ("MOVW", "MOVD"):
            self.put(place, self.value(first, bits), bits)
        elif name[0] in "+-":
            self.put(place, self.value(place, bits) + (1 if name[0] == "+" else -1) * self.value(first, bits), bits)
        elif name == "MUL":
            self.put(place, self.value(place) * self.value(first), 32)
        elif name == "DIV":
            share, rest = divmod(self.value(place), self.value(first))  # none is negative here
            self.put(place, rest << 16 | share, 32)
        else:
            assert name == "SRD"
            self.put(first, self.value(first, 32) % (1 << 32) >> int(place), 32)


@pytest.mark.long(seconds=5)
@pytest.mark.parametrize(("target", "per_count", "cycle"), [("s7-200", 1, 600), ("s7-200-pid", 8, 100), ("s7-200-pid", 8, 32700)])
def test_the_s7_200_s_subroutines_say_the_same_in_words(target, per_count, cycle):
    def load(numbers):
        statements = statements_of(numbers)
        text = s7_200.written(statements, HEAD, s7_200.reading_of(target, per_count), cycle)
        words = Words(text)
        place = dict(reversed(found) for found in re.findall(r"^// (V[WD]\d+): (\w+),", text, re.MULTILINE))
        over = re.search(r"LDW>= (VW\d+), \+(\d+); CALL SBR2", text)

        def call(reading, power):
            words.cells["VW0" if target == "s7-200" else "VW86"] = reading * per_count
            words.cells["SMW70"] = -(-power * cycle // 100)
            words.run("SBR1")
            assert words.cells[place["POWER"]] == power
            if words.cells[over[1]] >= int(over[2]):
                words.run("SBR2")
            return words.cells[place["ALARM"]], words.cells.get(place["TOLD"], 0)

        return call, lambda: words.cells.update({place["BEGUN"]: 0})

    check(load, 20, 400, seed=0)
