"""An S7-300 CPU that runs STL source: the statements that heatertune's own programs use, and no others.

Holds the timer and analog modules (CPU 31x manual), REAL arithmetic with the status bit OS, the translation of
statements to a Python function, and the bytes of a data block (high byte first, words by absolute address).

Source: Statement List (STL) for S7-300 and S7-400, reference manual. A REAL result beyond the largest number is
infinite, one too small for a normal number is 0, an undefined one is not a number; each sets OV and OS, and JOS clears
OS. Accumulators hold 32 bits, and the statement decides what they mean: the translation keeps bits and numbers in
local variables and converts only where a statement needs the other form.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from struct import Struct
from typing import Any, Final, Literal, NamedTuple

from heatertune.errors import InputError
from heatertune.pid.design_values import Timer
from heatertune.plc.cpu.s7_300.source import (
    LAST,
    MemberPlace,
    as_real,
    bits_of,
    constant,
    member_places,
    numbered_lines,
    signed_number,
    statements,
)
from heatertune.plc.cpu.statement_translation import Accumulators, Run, StatementLine, Translation
from heatertune.plc.inputs import FOUR_TO_TWENTY, Range
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import divide_single, single
from heatertune.plc.words import WordField

__all__ = [
    "FULL_SCALE", "INPUT_S", "RANGES", "TICK_S", "TIMER", "BlockCall", "Firmware", "S7300Cpu", "TranslatedBlock",
    "clamp", "place", "quotient", "read", "real",
]


#: analog value at the upper end of a module's nominal range
FULL_SCALE: Final = 27648

#: until an analog value is new: SM 331, eight channels at 50 Hz with wire-break check, 22 ms and 10 ms each (module
#: data A5E00105505); OB35 reads it and writes the output directly, by L PIW and T PQB, whatever the cycle of OB1 [s]
INPUT_S: Final = 8 * (0.022 + 0.010)

#: 4 mA is 0; thermocouples and resistance thermometers give 0.1 °C per digit, in the climatic range 0.01 °C
RANGES: Final = {
    FOUR_TO_TWENTY: Range(), "thermocouple": Range(high_degC=2764.8), "rtd": Range(high_degC=2764.8),
    "rtd-climatic": Range(high_degC=276.48),
}

#: OB35 is called every 1 ms to 1 min
TIMER: Final = Timer(shortest_s=0.001, longest_s=60.0, step_s=0.001)

#: OB35 as the exported program ticks where nobody asks for more: a half-wave of 50 Hz mains
TICK_S: Final = 0.01


_LEAST_NORMAL: Final = 2.0**-126


def real(value: float, os: bool = False) -> tuple[float, bool]:
    """Return an exact (double precision) result as REAL, rounded once, and OS after it.

    Args:
        value: sum, difference or product of two REALs.
        os: whether a result before was infinite, too small or not a number.
    """
    if abs(value) < _LEAST_NORMAL:
        return (value if value == 0.0 else 0.0), os or value != 0.0
    rounded = single(value)
    if math.isfinite(rounded):
        return rounded, os
    # one object for all of them, as the CPU has one bit pattern: equal states compare as equal
    return (math.nan if math.isnan(rounded) else rounded), True


def quotient(dividend: float, divisor: float, os: bool = False) -> tuple[float, bool]:
    """Return a quotient and OS after it, as `real`; by zero it is infinite or, for 0/0, not a number."""
    return real(divide_single(dividend, divisor) if divisor == 0.0 else dividend / divisor, os)


def clamp(value: float, low: float, high: float) -> float:
    """Return the value within its limits; what is not a number becomes the lower one."""
    if value > high:
        return high
    return value if value > low else low


#: runs the block of a CALL on a CPU; returns whether the next bit is asked for anew
BlockCall = Callable[[Any], bool]
_Form = Literal["bits", "real"]
_Slot = Literal["one", "two"]

_JUMPS: Final = {"JU": None, "JC": "true", "JCN": "not true", "JOS": "os"}
_COMPARED: Final = {"==": "==", "<>": "!=", ">": ">", ">=": ">=", "<": "<", "<=": "<="}
_WHOLE: Final = {"+": "+", "-": "-", "*": "*", "A": "&"}
#: statements that ask for ACCU 1 alone, and as what; all but T make another ACCU 1 of it
_OF_ONE: Final[Mapping[str, _Form]] = {
    "T": "bits", "SRD": "bits", "ITD": "bits", "DTR": "bits", "RND": "real", "TRUNC": "real"}
#: statements that ask for neither
_OF_NONE: Final = ("L", "TAK", "A", "AN", "=", "S", "R", "SET", "CLR", "NOP", "BEU", *_JUMPS)
_SLOTS: Final[tuple[_Slot, _Slot]] = ("one", "two")
_REAL: Final = Struct(">f")


class _Value:
    """What stands in an accumulator: text that gives its bits, or the REAL that they mean; "": not made yet."""

    def __init__(self, *, bits: str = "", real: str = "") -> None:
        self.bits, self.real = bits, real


class TranslatedBlock(Translation):
    """A block of the S7-300."""

    keep = "cpu.one, cpu.two, cpu.true, cpu.os = one, two, true, os"
    take = "one, two, true, os = cpu.one, cpu.two, cpu.true, cpu.os"

    def __init__(
        self, lines: Sequence[StatementLine], place_of: Callable[[str], MemberPlace | None],
        called: Callable[[str], BlockCall],
        memory: Mapping[str, bytearray],
    ) -> None:
        """Take a block.

        Args:
            lines: the statements.
            place_of: gives the place of an operand, None for a constant; raises LookupError for what is not there.
            called: gives what a CALL does, told its operand.
            memory: the CPU's; what stays in its place.
        """
        super().__init__(lines)
        self._place_of, self._called, self._memory = place_of, called, memory
        self._one, self._two, self._made, self._emitted = _Value(), _Value(), 0, list[str]()
        self._read = self._read_later()
        self.names |= {
            "real": real, "quotient": quotient, "as_real": as_real, "bits_of": bits_of, "signed": signed_number,
            "trunc": math.trunc, "share": _share, "number": int.from_bytes, "packed": _REAL.pack,
            "unpacked": _REAL.unpack_from}

    def ends(self, line: StatementLine) -> str | None:
        """See `Translation`."""
        return line.operand if line.operation in _JUMPS else "" if line.operation == "BEU" else None

    def first(self, text: Sequence[str]) -> list[str]:
        """See `Translation`."""
        return ["first = True", *(["own = cpu.memory[cpu.instance]"] if any("own[" in line for line in text) else [])]

    def statement(self, at: int, line: StatementLine) -> list[str]:
        """See `Translation`."""
        if at == 0 or self._is_last(at - 1):
            self._one, self._two = _Value(bits="one"), _Value(bits="two")
        self._emitted = []
        ends = self.ends(line) is not None
        if ends or line.operation == "CALL":
            self._write(at)
        self._emit(*self._carried_out(at, line))
        if line.operation == "CALL":
            self._one, self._two = _Value(bits="one"), _Value(bits="two")
        if not ends and self._is_last(at):
            self._write(at)
        return self._emitted or ["pass"]

    def _carried_out(self, at: int, line: StatementLine) -> list[str]:  # noqa: C901, PLR0911, PLR0912 - one branch for each kind
        """Return what a statement does beside what it makes of the accumulators."""
        name, operand = line.operation, line.operand
        place = self._place_of(operand) if operand else None
        match name:
            case "L":
                self._one, self._two = self._loaded(at, operand, place), self._one
            case "T" if place:
                return [self._stored(place)]
            case "A" | "AN" if place:
                bit = f"({self._value(place)}) {'==' if name == 'AN' else '!='} 0"
                return [f"true, first = {bit} if first else true and {bit}, False"]
            case "=" if place:
                return [self._put(place, "true"), "first = True"]
            case "S" | "R" if place:
                return [f"if true: {self._put(place, str(int(name == 'S')))}", "first = True"]
            case "SET" | "CLR":
                return [f"true, first = {name == 'SET'}, True"]
            case _ if name in _JUMPS:
                return self._jump(at, name, operand)
            case "BEU":
                return [self.keep, "return"]
            case "NOP":
                return ["pass"]
            case "TAK":
                self._one, self._two = self._two, self._one
            case "CALL":
                self.names[f"call_{at}"] = self._called(operand)
                return [self.keep, f"first = call_{at}(cpu) or first", self.take]
            case _ if name[:-1] in _COMPARED:
                return [self._compared(name)]
            case _:
                self._one = self._computed(name, operand)
        return []

    def _computed(self, name: str, operand: str) -> _Value:  # noqa: PLR0911 - likewise
        """Return the ACCU 1 that a statement makes of what stands in both."""
        one, two = (partial(self._as, value) for value in (self._one, self._two))
        match name:
            case "SRD":
                return self._new(f"{one('bits')} >> {int(operand)}")
            case "ITD":
                return self._new(f"signed({one('bits')}, 16) & 0xFFFFFFFF")
            case "DTR":
                return self._new_real(f"real(signed({one('bits')}, 32))", "_")
            case "RND" | "TRUNC":
                return self._new(f"{'round' if name == 'RND' else 'trunc'}({one('real')}) & 0xFFFFFFFF")
            case "/D" | "MOD":
                return self._new(f"share({two('bits')}, {one('bits')}, {name == 'MOD'})")
            case "/R":
                return self._new_real(f"quotient({two('real')}, {one('real')}, os)", "os")
            case "+R" | "-R" | "*R":
                return self._new_real(f"real({two('real')} {name[0]} {one('real')}, os)", "os")
            case "+I" | "-I":  # the upper half stays
                return self._new(f"{one('bits')} & ~0xFFFF | ({two('bits')} {name[0]} {one('bits')}) & 0xFFFF")
            case "+D" | "-D" | "*D" | "AD":
                return self._new(f"({two('bits')} {_WHOLE[name[0]]} {one('bits')}) & 0xFFFFFFFF")
        raise LookupError(name)

    def _compared(self, name: str) -> str:
        asks, kind = _COMPARED[name[:-1]], name[-1]
        if kind == "R":
            return f"true, first = {self._as(self._two, 'real')} {asks} {self._as(self._one, 'real')}, False"
        width = {"I": 16, "D": 32}[kind]
        two, one = (f"signed({self._as(value, 'bits')}, {width})" for value in (self._two, self._one))
        return f"true, first = {two} {asks} {one}, False"

    def _loaded(self, at: int, operand: str, place: MemberPlace | None) -> _Value:
        """Return the value that L loads: a number where its bits are not used."""
        if place is None:
            bits = constant(operand)
            meant = as_real(bits)
            return _Value(bits=str(bits), real=repr(meant) if math.isfinite(meant) else "")
        forms, stays = self._followed(at + 1, "one", self._part_of[at])
        if place.size == 4 and forms == {"real"} and not (stays and stays in self._read[self._part_of[at]]):
            return _Value(real=self._named(f"unpacked({self._bytes(place)}, {place.byte})[0]"))
        return self._new(self._value(place))

    def _stored(self, place: MemberPlace) -> str:
        """Return the text that T is."""
        value = self._one
        if place.size == 4 and not value.bits:
            return f"{self._bytes(place)}[{place.byte}:{place.byte + 4}] = packed({value.real})"
        return self._put(place, self._as(value, "bits"))

    def _as(self, register: _Value, form: _Form) -> str:
        """Return text that gives what an accumulator holds as bits or as a number."""
        if form == "bits":
            register.bits = register.bits or self._named(f"bits_of({register.real})")
            return register.bits
        register.real = register.real or self._named(f"as_real({register.bits})")
        return register.real

    def _new(self, bits: str) -> _Value:
        return _Value(bits=self._named(bits))

    def _new_real(self, text: str, status: str) -> _Value:
        self._made += 1
        self._emit(f"v{self._made}, {status} = {text}")
        return _Value(real=f"v{self._made}")

    def _named(self, text: str) -> str:
        """Give a text a local name of its own."""
        self._made += 1
        self._emit(f"v{self._made} = {text}")
        return f"v{self._made}"

    def _emit(self, *texts: str) -> None:
        self._emitted += texts

    def _write(self, at: int) -> None:
        """Write the accumulators that are read behind a part, or by what is called."""
        read = _SLOTS if self.lines[at].operation == "CALL" else self._read[self._part_of[at]]
        values: dict[_Slot, _Value] = {"one": self._one, "two": self._two}
        written = {slot: bits for slot in values if slot in read and (bits := self._as(values[slot], "bits")) != slot}
        if written:
            self._emit(f"{', '.join(written)} = {', '.join(written.values())}")

    def _is_last(self, at: int) -> bool:
        return at + 1 == len(self.lines) or self._part_of[at + 1] != self._part_of[at]

    def _followed(self, at: int, slot: _Slot | None, part: int) -> tuple[set[_Form], _Slot | None]:
        """Return as what is asked for what stands in an accumulator until its part ends, and where it stands then."""
        forms = set[_Form]()
        while slot and at < len(self.lines) and self._part_of[at] == part:
            name = self.lines[at].operation
            if name == "CALL":
                forms.add("bits")
                slot = None
            elif name == "L":
                slot = "two" if slot == "one" else None
            elif name == "TAK":
                slot = "two" if slot == "one" else "one"
            elif name in _OF_ONE:
                if slot == "one":
                    forms.add(_OF_ONE[name])
                    slot = "one" if name == "T" else None
            elif name not in _OF_NONE:
                forms.add("real" if name[-1] == "R" else "bits")
                slot = None if slot == "one" and name[:-1] not in _COMPARED else slot
            at += 1
        return forms, slot

    def _read_later(self) -> list[set[_Slot]]:
        """Return for each part which accumulators are read behind it."""
        begins = [at for at in range(len(self.lines)) if at == 0 or self._is_last(at - 1)]
        here = [{slot: self._followed(at, slot, part) for slot in _SLOTS} for part, at in enumerate(begins)]
        after = [self._after(at) for at in range(len(self.lines)) if self._is_last(at)]
        read: list[set[_Slot]] = [set() for _ in begins]
        while True:
            needed = [{slot for slot, (forms, stays) in slots.items() if forms or stays in read[part]}
                      for part, slots in enumerate(here)]
            slot_sets = [{slot for slot in _SLOTS if any(part is None or slot in needed[part] for part in parts)}
                         for parts in after]
            if slot_sets == read:
                return read
            read = slot_sets

    def _after(self, at: int) -> set[int | None]:
        """Return the parts that may follow the last statement of one; None: the block may end."""
        label = self.ends(self.lines[at])
        behind = self._part_of[at + 1] if at + 1 < len(self.lines) else None
        return {None if label == "" else behind, *([self._part_of[self.labels[label]]] if label in self.labels else [])}

    def _jump(self, at: int, name: str, label: str) -> list[str]:
        goes, condition = self.goes(at, label), _JUMPS[name]
        if condition is None:
            return ["first = True", *goes]
        # JC and JCN leave a true result of both
        after = "os = False" if name == "JOS" else "true = True"
        return [f"goes, first = {condition}, True", after, "if goes:", *(f" {line}" for line in goes)]

    def _bytes(self, place: MemberPlace) -> str:
        """Return what names the memory of a place; one that is nowhere is looked for when it is asked for."""
        memory = self._memory.get(place.memory)
        if memory is None:
            return f"cpu.memory[{place.memory!r}]" if place.memory else "own"
        if place.byte + place.size > len(memory):
            raise LookupError(place)
        name = f"m{list(self._memory).index(place.memory)}"
        self.names[name] = memory
        return name

    def _value(self, place: MemberPlace) -> str:
        memory, byte = self._bytes(place), place.byte
        if place.size == 0:
            return f"{memory}[{byte}] >> {place.bit} & 1"
        return f"number({memory}[{byte}:{byte + place.size}], 'big')"

    def _put(self, place: MemberPlace, value: str) -> str:
        memory, byte, size = self._bytes(place), place.byte, place.size
        if size == 0:
            mask = 1 << place.bit
            return f"{memory}[{byte}] = {memory}[{byte}] | {mask} if {value} else {memory}[{byte}] & {0xFF - mask}"
        return f"{memory}[{byte}:{byte + size}] = ({value} & {(1 << 8 * size) - 1}).to_bytes({size}, 'big')"


def _share(two: int, value: int, rest: bool) -> int:
    """Return quotient or remainder, cut towards zero."""
    dividend, divisor = signed_number(two, 32), signed_number(value, 32)
    share = abs(dividend) // abs(divisor) * (1 if (dividend < 0) == (divisor < 0) else -1)
    return (dividend - share * divisor if rest else share) & 0xFFFFFFFF


#: format → struct code; BOOL is a bit of a byte, TIME a DINT in ms
_CODES: Final = {"INT": ">h", "TIME": ">i", "REAL": ">f"}

_ADDRESS: Final = re.compile(r"DB[XWD](\d+)(?:\.(\d))?")


def place(address: str) -> tuple[int, int]:
    """Return byte and bit of an address such as DBD10 or DBX0.3; the bit is 0 where none is named.

    Raises:
        InputError: it is none.
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise InputError(f"{address} is no address in a data block")
    return int(match[1]), int(match[2] or 0)


def read(image: bytes, fields: Sequence[WordField], source: str) -> dict[str, Number]:
    """Return the words of a dump; a REAL is given as it stands there, be it infinite or not a number.

    Raises:
        InputError: the dump ends before the last word.
    """
    needed = max(place(field.address)[0] + _size(field) for field in fields)
    if len(image) < needed:
        raise InputError(f"{source}: {len(image)} bytes; expected {needed} or more, a whole instance data block")
    values: dict[str, Number] = {}
    for field in fields:
        byte, bit = place(field.address)
        if field.format == "BOOL":
            values[field.name] = image[byte] >> bit & 1
        else:
            values[field.name] = struct.unpack_from(_CODES[field.format], image, byte)[0]
    return values


def _size(field: WordField) -> int:
    return 1 if field.format == "BOOL" else struct.calcsize(_CODES[field.format])


#: what temporaries hold before they are written: anything
_JUNK: Final = b"\x5a" * 128
_WIDTHS: Final = {"X": 0, "B": 1, "W": 2, "D": 4}
_HEAD: Final = re.compile(r"(FUNCTION_BLOCK|DATA_BLOCK|FUNCTION|ORGANIZATION_BLOCK) +((?:FB|DB|FC|OB) \d+).*")
_ASSIGNED: Final = re.compile(r"(\w+) := ([^;,)]+)")

#: outputs and inputs, the words of an instance whose block is not in the source → what a call of the block does
Firmware = Callable[["S7300Cpu", dict[str, int]], None]


class _CodeBlock(NamedTuple):
    """Source of a code block: its members, its temporaries among them, and its statements."""

    members: dict[str, MemberPlace]
    lines: list[StatementLine]


class S7300Cpu(Accumulators):
    """A CPU with a source in its memory.

    Attributes:
        memory: "DB 101", "I", "Q", "P" (periphery), "L 35" (temporaries of OB35) → its bytes.
        members: "DB 101" → name of a member → its place.
        words: "DB 41", the instance of a block that is not in the source → member → value, a REAL as its bits.
    """

    def __init__(self, source: str, firmware: Mapping[str, Firmware]) -> None:
        """Take a source, and what the CPU brings along: block → what a call of it does.

        Raises:
            InputError: what is no source, or a statement that is not known here.
        """
        super().__init__()
        self.memory = {name: bytearray(1024) for name in ("I", "Q", "P")}
        self.members: dict[str, dict[str, MemberPlace]] = {}
        self.words: dict[str, dict[str, int]] = {}
        self.os = False
        self.instance = ""
        self._firmware = firmware
        self._blocks = self._loaded(source)
        self._code = {name: self._translated(block) for name, block in self._blocks.items()}

    def run(self, block: str) -> None:
        """Run a block until it ends.

        Raises:
            InputError: there is none, or a statement at which the CPU would stop.
        """
        if block not in self._code:
            raise InputError(f"{block}: the source has no such block")
        if block.startswith("F"):
            self.memory[f"L {block}"][:] = _JUNK
        self._code[block](self)

    def member(self, data: str, name: str) -> MemberPlace:
        """Return the place of a data block's member.

        Raises:
            InputError: there is none.
        """
        try:
            return self.members[data][name]
        except KeyError:
            raise InputError(f"{data}: the source has no member {name} there") from None

    def get(self, place: MemberPlace) -> int:
        """Return the content of a place: a bit, or bytes as an unsigned number."""
        memory = self.memory[place.memory or self.instance]
        if place.size == 0:
            return memory[place.byte] >> place.bit & 1
        return int.from_bytes(memory[place.byte : place.byte + place.size], "big")

    def put(self, place: MemberPlace, value: int) -> None:
        """Write the same."""
        memory = self.memory[place.memory or self.instance]
        if place.size == 0:
            mask = 1 << place.bit
            memory[place.byte] = memory[place.byte] | mask if value else memory[place.byte] & ~mask
        else:
            memory[place.byte : place.byte + place.size] = (value % (1 << 8 * place.size)).to_bytes(place.size, "big")

    def _loaded(self, source: str) -> dict[str, _CodeBlock]:
        """Load the data blocks; return the others."""
        blocks: dict[str, _CodeBlock] = {}
        part: list[tuple[int, str]] = []
        for number, line in numbered_lines(source):
            part.append((number, line))
            if line in LAST:
                head = next((match for _, text in part if (match := _HEAD.fullmatch(text))), None)
                if head is None or all(text != "BEGIN" for _, text in part):
                    raise InputError(f"line {number}: {line}; expected its head and BEGIN before")
                if head[1] == "DATA_BLOCK":
                    self._data(head[2], part, blocks)
                else:
                    blocks[head[2]] = self._block(head[2], part)
                part = []
        return blocks

    def _data(self, name: str, part: list[tuple[int, str]], blocks: Mapping[str, _CodeBlock]) -> None:
        texts = [text for _, text in part]
        begin = texts.index("BEGIN")
        values = {match[1]: (number, _constant(number, match[2].strip())) for number, text in part[begin:]
                  if (match := _ASSIGNED.match(text))}
        of = next((line for line in texts if re.fullmatch(r"FB \d+", line)), None)
        self.memory[name] = bytearray(1024)
        if of is not None and of not in blocks:
            self.words[name] = {member: value for member, (_, value) in values.items()}
            return
        members = member_places(texts[:begin], name, 0) if of is None else blocks[of].members
        self.members[name] = {member: place._replace(memory=name) for member, place in members.items()}
        for member, (number, value) in values.items():
            if member not in members:
                raise InputError(f"line {number}: {member}; {name} has no such member")
            self.put(self.members[name][member], value)

    def _block(self, name: str, part: list[tuple[int, str]]) -> _CodeBlock:
        texts = [text for _, text in part]
        begin = texts.index("BEGIN")
        declared, temporary = list[str](), list[str]()
        section = declared
        for text in texts[:begin]:
            section = temporary if text == "VAR_TEMP" else declared if text.startswith("VAR") else section
            section.append(text)
        own = f"L {name}"
        self.memory[own] = bytearray(len(_JUNK))
        return _CodeBlock(member_places(declared, "", 0) | member_places(temporary, own, 0),
                          statements(part[begin + 1 : -1]))

    def _translated(self, block: _CodeBlock) -> Run:
        return TranslatedBlock(block.lines, lambda operand: self._place(block, operand),
                          lambda operand: self._call(block, operand), self.memory).run()

    def _place(self, block: _CodeBlock, operand: str) -> MemberPlace | None:
        """Return the place of an operand; None: it is a constant."""
        if operand.startswith("#"):
            return block.members[operand[1:]]
        if match := re.fullmatch(r"DB(\d+)\.DB([XBWD]) ?(\d+)(?:\.(\d))?", operand):
            return MemberPlace(f"DB {match[1]}", int(match[3]), int(match[4] or 0), _WIDTHS[match[2]])
        if match := re.fullmatch(r"(P?)([IQ])([BWD]?) ?(\d+)(?:\.(\d))?", operand):
            memory = "P" if match[1] else match[2]
            return MemberPlace(memory, int(match[4]), int(match[5] or 0), _WIDTHS[match[3] or "X"])
        return None

    def _call(self, block: _CodeBlock, operand: str) -> BlockCall:
        """Return the block call of a CALL."""
        callee = re.match(r"((?:FB|FC) \d+)(?: , (DB \d+))?", operand)
        if callee is None:
            raise InputError(f"CALL {operand!r}; expected a block, and its instance where it has one")
        name, data = callee[1], callee[2] or ""
        if name not in self._firmware and name not in self._blocks:
            raise LookupError(name)
        operands = [(match[1], match[2].strip()) for match in _ASSIGNED.finditer(operand)]
        places = [(member, place) for member, text in operands if (place := self._place(block, text)) is not None]
        constants = {member: constant(text) for member, text in operands if self._place(block, text) is None}
        # what is put in comes back as it was
        back = [(member, place) for member, place in places if not place.memory.startswith(("L", "P"))]

        def firmware(cpu: S7300Cpu) -> bool:
            words = cpu.words[data]
            words |= constants | {member: cpu.get(place) for member, place in places}
            cpu._firmware[name](cpu, words)
            for member, place in back:
                cpu.put(place, words[member])
            return False

        def run(cpu: S7300Cpu) -> bool:
            before, members = cpu.instance, cpu.members.get(data, {})
            for member, value in constants.items():
                cpu.put(members[member], value)
            for member, place in places:
                cpu.put(members[member], cpu.get(place))
            cpu.instance = data
            cpu.run(name)
            cpu.instance = before
            for member, place in back:
                cpu.put(place, cpu.get(members[member]))
            return True

        return firmware if name in self._firmware else run


def _constant(number: int, text: str) -> int:
    try:
        return constant(text)
    except InputError as problem:
        raise InputError(f"line {number}: {problem}") from None
