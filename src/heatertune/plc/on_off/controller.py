"""Two-level control, run by the bit processor: off above SP + BAND, on below SP − BAND; its export and readback.

The document prints no memory image, so its layout is this project's choice: the 16 lines of the program, one byte each,
then BAND as a 16-bit number, high byte first.
"""

from __future__ import annotations

import csv
import io
import math
import re
from functools import lru_cache
from typing import ClassVar, Final, NamedTuple

from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, Timer
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions, count
from heatertune.plc.cpu.one_bit.machine import (
    ON_OFF,
    ON_OFF_NAMES,
    START,
    OneBitState,
    Wiring,
    assemble,
    disassemble,
    scan,
)
from heatertune.plc.open_points import NothingOpen
from heatertune.plc.readback import ReadBack, lines_of, wrong
from heatertune.plc.words import Certificate, Scaling, WordField, Words, no_pid

__all__ = [
    "BAND_DEGC", "COUNTS", "FIELDS", "PROGRAM", "TIMER", "OnOff", "OnOffState", "consistent", "export_words",
    "from_image", "from_text", "intel_hex", "listing_step", "oddities", "setpoint_entry", "step", "to_image",
    "values_of",
]


#: highest reading: the document names no converter; one of 12 bits is taken
COUNTS: Final = 4095
#: of the scan interval: the document names none
TIMER: Final = Timer(shortest_s=0.01, longest_s=600.0, step_s=0.01)
#: half of the hysteresis that is aimed at [°C]
BAND_DEGC: Final = 0.5

_MOST: Final = 2047
_WIDE: Final = 0.1  # of the sensor range

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="BAND", address="register 2", format="INT", low=1, high=_MOST,
              comment="half of the hysteresis, counts: on below SP - BAND, off above SP + BAND"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, int]:
    """Return BAND, the counts nearest 0.5 °C and at least 1; of the design only TA is taken, as the scan interval.

    Raises:
        NotRepresentable: a cooler, whose gain is negative; a sensor range so narrow that 0.5 °C are more than half.
    """
    if design.gain_pct_per_degC < 0.0:
        raise NotRepresentable("gain", design.gain_pct_per_degC, "positive: on-off switches on below the setpoint",
                               "a PID controller would fit")
    exact = BAND_DEGC * COUNTS / scaling.span_degC
    band = max(1, int(exact + 0.5))
    if band > _MOST:
        narrowest = math.ceil(100.0 * BAND_DEGC * COUNTS / _MOST) / 100.0
        raise NotRepresentable("word BAND", exact, f"1…{_MOST} counts",
                               f"a sensor range of {narrowest:g} °C or more would fit")
    return {"BAND": band}


def consistent(words: Words) -> None:
    """Refuse words whose interval the timer cannot keep.

    Raises:
        OutOfRange: a scan interval that is out of its range.
    """
    low, high = TIMER.shortest_s, TIMER.longest_s
    if not low <= words.sample_time_s <= high:
        raise OutOfRange("sample_time_s", words.sample_time_s, f"{low:g}…{high:g} s")


def oddities(words: Words) -> tuple[str, ...]:
    """Return the oddities of the word of a running controller."""
    band = words.whole["BAND"]
    if band <= _WIDE * COUNTS:
        return ()
    degrees = band * words.scaling.span_degC / COUNTS
    return (f"BAND is {band}: the heater switches {degrees:.3g} °C above and below the setpoint.",)


#: lines and addresses fit four bits
PROGRAM: Final = assemble(ON_OFF, ON_OFF_NAMES, operand_bits=4)

_OUT: Final = ON_OFF_NAMES.bits["OUT"]
_WIRING: Final = Wiring(results={ON_OFF_NAMES.bits["AC1<AC2"]: -1, ON_OFF_NAMES.bits["AC1>AC2"]: 1})


class OnOffState(NamedTuple):
    """What the direct form keeps from scan to scan."""

    is_on: bool = False


@lru_cache(maxsize=1 << 16)  # a pure function, and near the setpoint the same few readings come again and again
def listing_step(band: int, state: OneBitState, setpoint: int, reading: int, _begins: bool) -> tuple[OneBitState, float,
                                                                                                     int, int]:
    """Compute one scan by the program, see `heatertune.plc.core.StepFunctions`.

    Args:
        band: half the hysteresis [counts].
        state: of the bit processor before the scan.
        setpoint: in counts.
        reading: in counts.
        _begins: not looked at: there is no PWM.
    """
    after = scan(PROGRAM, _WIRING, state, registers=(setpoint, reading, band))
    is_on = after.is_on(_OUT)
    return after, 100.0 if is_on else 0.0, int(is_on), int(after.overflow) + 2 * int(after.endless)


def step(band: int, state: OnOffState, setpoint: int, reading: int, _begins: bool) -> tuple[OnOffState, float, int,
                                                                                            int]:
    """Compute the same without the program, all in 16 bits.

    Args:
        band: half the hysteresis [counts].
        state: the memory before the scan.
        setpoint: in counts.
        reading: in counts.
        _begins: not looked at: there is no PWM.
    """
    w, x, b = _word(setpoint), _word(reading), _word(band)
    above, below = w + b, w - b
    overflow = above != _word(above)
    is_on = state.is_on
    if x > _word(above):
        is_on = False
    else:
        overflow = overflow or below != _word(below)
        is_on = is_on or x < _word(below)
    return OnOffState(is_on), 100.0 if is_on else 0.0, int(is_on), int(overflow)


def _word(number: int) -> int:
    return ((number + 0x8000) & 0xFFFF) - 0x8000


_RECORD: Final = 16  # data bytes in a line of Intel HEX


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return all files; the same words and certificate give the same bytes."""
    image = to_image(words)
    return {
        "on_off_listing.txt": _listing(words, certificate),
        "on_off_words.csv": _csv(words),
        "on_off_rom.hex": intel_hex(image),
        "on_off_rom.bin": image,
    }


def to_image(words: Words) -> bytes:
    """Return the memory: program, then BAND."""
    return PROGRAM.image + words.whole["BAND"].to_bytes(2, "big")


def from_image(image: bytes, _sample_time_s: float, source: str) -> dict[str, int]:
    """Return BAND from a memory of 18 bytes that was read back.

    Raises:
        InputError: another length, or another program than the two-level control.
    """
    program, size = PROGRAM.image, len(PROGRAM.image) + 2
    if len(image) != size:
        raise InputError(f"{source}: {len(image)} bytes; expected {size}: {size - 2} lines of program, then BAND")
    for line, (byte, expected) in enumerate(zip(image, program, strict=False)):
        if byte != expected:
            raise InputError(f"{source}: line {line} of the program is {byte:02X}; expected {expected:02X}")
    return {"BAND": int.from_bytes(image[size - 2 :], "big", signed=True)}


def intel_hex(image: bytes, *, start: int = 0) -> str:
    """Return bytes as Intel HEX (Hexadecimal Object File Format Specification, revision A, 1988), 8-bit records."""
    records = [_record(start + k, 0, image[k : k + _RECORD]) for k in range(0, len(image), _RECORD)]
    return "\n".join([*records, _record(0, 1, b"")]) + "\n"


def _record(address: int, kind: int, data: bytes) -> str:
    body = bytes([len(data), *address.to_bytes(2, "big"), kind, *data])
    return f":{body.hex().upper()}{-sum(body) & 0xFF:02X}"


def _listing(words: Words, certificate: Certificate) -> str:
    scale, band = words.scaling, words.whole["BAND"]
    head = [
        "two-level control of a heater, for the bit processor of Hryniewicz and Chmiel (2012)",
        f"sensor {scale.low_degC:g}…{scale.high_degC:g} °C = 0…{COUNTS} counts in register 1 (PV)",
        f"setpoint in counts in register 0 (SP): {COUNTS}/{scale.span_degC:g}·({scale.formula}), whole part",
        f"register 2 (BAND) = {band} counts = {band * scale.span_degC / COUNTS:.3g} °C",
        f"one scan every {words.sample_time_s:g} s; output 0 (OUT) switches the heater",
        "after a loss of supply: proven with output 0 off until the first scan, which switches it by this law",
        *certificate.head,
    ]
    rows = zip(disassemble(PROGRAM, ON_OFF_NAMES).splitlines(), PROGRAM.words, strict=True)
    body = [f"{line.ljust(28)}; {word >> 4:04b} {word & 15:04b}" for line, word in rows]
    return "\n".join([*(f"; {line}" for line in head), *body]) + "\n"


def _csv(words: Words) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["address", "word", "format", "value", "comment"])
    writer.writerows([f.address, f.name, f.format, words.whole[f.name], f.comment] for f in FIELDS)
    return text.getvalue()


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"register 0 = {units}"


_READBACK_RECORD: Final = re.compile(r":((?:[0-9A-F]{2}){5,260})", re.IGNORECASE)
_DATA, _END = 0, 1


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return BAND from the records of a memory that was read back.

    Raises:
        InputError: a line that is no record or whose length, address, kind or checksum is wrong; as `from_image`.
    """
    image, ended = bytearray(), False
    for line, content in lines_of(text):
        if not content:
            continue
        data, kind = _record_readback(content, line, source)
        if ended:
            raise wrong(source, line, "record", content, "nothing after the record of kind 01, the end")
        if kind == _DATA and int.from_bytes(data[:2], "big") != len(image):
            raise wrong(source, line, "address", data[:2].hex().upper(), f"{len(image):04X}, where the data before end")
        image += data[2:] if kind == _DATA else b""
        ended = kind == _END
    if not ended:
        raise InputError(f"{source}: no record of kind 01; expected :00000001FF as the last line")
    return ReadBack({**from_image(bytes(image), 0.0, source)})


def _record_readback(content: str, line: int, source: str) -> tuple[bytes, int]:
    """Return address and data of a record, and its kind."""
    match = _READBACK_RECORD.fullmatch(content)
    if match is None:
        raise wrong(source, line, "record", content, "a record of Intel HEX such as :00000001FF")
    record = bytes.fromhex(match[1])
    if record[0] != len(record) - 5:
        raise wrong(source, line, "length", match[1][:2], f"{len(record) - 5:02X}, the number of data bytes")
    if sum(record) & 0xFF:
        raise wrong(source, line, "checksum", match[1][-2:], f"{-sum(record[:-1]) & 0xFF:02X}")
    if record[3] not in (_DATA, _END):
        raise wrong(source, line, "kind", match[1][6:8], "00 (data) or 01 (end)")
    return record[1:3] + record[4:-1], record[3]


_FLAGS = ("overflow", "endless")


def _direct(words: Words, _assume: NothingOpen) -> tuple[StepFunctions, ControllerState]:
    return _DIRECT, ControllerState(words.whole["BAND"], OnOffState())


_DIRECT = StepFunctions(step=step, measure=count, flags=_FLAGS)


class OnOff(Controller, name="on-off"):
    """Two-level control; the switch behind the output is an actuator, always on or off for a whole scan."""

    title = "bit processor, two-level control (Hryniewicz, Chmiel, Przegląd Elektrotechniczny 88(9a), 2012, Ex. 3)"
    main_file = "on_off_rom.hex"
    setpoint_entry = staticmethod(setpoint_entry)
    can = ("switch the heater fully on below SP − BAND and off above SP + BAND",)
    cannot = (
        "no PID: of a design only TA is taken, as the scan interval",
        "the temperature swings around the setpoint, the more the longer the dead time",
        "no setpoint ramp in its program",
    )
    fields, timer, counts = FIELDS, TIMER, COUNTS
    inputs: ClassVar = {"SP": "INT", "PV": "INT"}
    baseline = None
    core = StepFunctions(step=listing_step, measure=count, flags=_FLAGS, compiles=False)
    values, design, consistent = staticmethod(values_of), staticmethod(no_pid), staticmethod(consistent)
    export, direct = staticmethod(export_words), staticmethod(_direct)
    image, oddities, text = staticmethod(from_image), staticmethod(oddities), staticmethod(from_text)

    def begin(self, words: Words, assume: NothingOpen) -> ControllerState:  # noqa: ARG002 - the same for all
        """Return the state after power-on: heater off."""
        return ControllerState(words.whole["BAND"], START)
