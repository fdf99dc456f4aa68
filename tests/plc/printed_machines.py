"""Statements of `heatertune.plc.print` in the four machines: printed, loaded, and called with cells of the caller's."""

from heatertune.plc.cpu.iec.machine import TextProgram
from heatertune.plc.cpu.iec.st_syntax import units
from heatertune.plc.cpu.s5.machine import S5Cpu
from heatertune.plc.cpu.s7_200 import assemble
from heatertune.plc.cpu.s7_200.assembler import block, block_number, program
from heatertune.plc.cpu.s7_200.cpu import carry_out
from heatertune.plc.cpu.s7_200.memory import WHOLE, bit, cell
from heatertune.plc.cpu.s7_300 import source as awl
from heatertune.plc.cpu.s7_300.machine import S7300Cpu
from heatertune.plc.print.stl import S5Printer, S7300Printer, networks


class OnS5:
    """In data words."""

    def __init__(self, groups, names):
        self._at = {name.upper(): number for number, name in enumerate(names)}
        printer = S5Printer(self._at)
        text = ["DB31", *(f"{number:4d}:  KF = +00000;" for number in range(len(names))), "", "FB 33", "NAME :PART",
                printer.next("C", "DB 31"), *printer.print_groups(groups), printer.next("BE")]
        self._cpu = S5Cpu("\n".join(text) + "\n", {})
        self._words = self._cpu.block(31, len(names) - 1)

    def __getitem__(self, name):
        return self._words[self._at[name.upper()]]

    def __setitem__(self, name, value):
        self._words[self._at[name.upper()]] = value

    def call(self):
        self._cpu.run("FB 33")


class OnS7300:
    """In members of a block, of 32 bits."""

    def __init__(self, groups, names):
        printer = S7300Printer()
        text = ["FUNCTION_BLOCK FB 33", "VERSION : 0.1", "VAR", *(f"  {name.upper()} : DINT ;" for name in names), "END_VAR",
                "BEGIN", "NETWORK", *printer.print_groups(groups), printer.next("NOP", "0"), "END_FUNCTION_BLOCK", "",
                "DATA_BLOCK DB 33", "VERSION : 0.1", "FB 33", "BEGIN", "END_DATA_BLOCK"]
        self._cpu = S7300Cpu(awl.text(text), {})
        self._cpu.instance = "DB 33"
        self._at = {name: self._cpu.member("DB 33", name.upper()) for name in names}

    def __getitem__(self, name):
        return awl.signed_number(self._cpu.get(self._at[name]), 32)

    def __setitem__(self, name, value):
        self._cpu.put(self._at[name], value)

    def call(self):
        self._cpu.run("FB 33")


class OnS7200:
    """In double words of V memory."""

    letter, width = "D", 4

    def __init__(self, groups, names):
        at = {name.upper(): f"V{self.letter}{300 + 4 * number}" for number, name in enumerate(names)}
        self._program = assemble(program(block("OB1", "none", []), block("INT0", "part", list(networks(groups, at)))))
        self._memory = bytearray(WHOLE)
        byte, mask = bit("SM0.0")
        self._memory[byte] |= mask
        self._at = {name: cell(at[name.upper()], self.width).start for name in names}

    def __getitem__(self, name):
        return int.from_bytes(self._memory[self._at[name] : self._at[name] + self.width], "big", signed=True)

    def __setitem__(self, name, value):
        self._memory[self._at[name] : self._at[name] + self.width] = int(value).to_bytes(self.width, "big", signed=True)

    def call(self):
        carry_out(self._program, self._memory, block_number("INT0"), False)


class OnS7200Words(OnS7200):
    """In words of V memory."""

    letter, width = "W", 2


class OnStructuredText:
    """In variables, whole or REAL."""

    def __init__(self, groups, names, reals=()):
        body = "".join(group.lines for group in groups)
        declared = "".join(f"  {name} : {'REAL' if name in reals else 'DINT'};\n" for name in names)
        self._program = TextProgram(units(f"PROGRAM P\nVAR\n{declared}END_VAR\n{body}END_PROGRAM\n"), {})

    def __getitem__(self, name):
        return self._program[name]

    def __setitem__(self, name, value):
        self._program[name] = value

    def call(self):
        self._program.scan()


MACHINES = {"s5": OnS5, "s7-200": OnS7200, "s7-200 in words": OnS7200Words, "s7-300": OnS7300, "st": OnStructuredText}
