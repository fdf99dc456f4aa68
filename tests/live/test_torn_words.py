"""A word of which only some bytes arrived: mixtures are made here by cutting a request's bytes, with struct formats of this file's own."""

import dataclasses
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.live.conftest import words_of

from heatertune.live.block_memory import BlockSignal
from heatertune.live.client.connection import address_of
from heatertune.live.controller_block import SERVED
from heatertune.live.write.plc_block import block_image

#: format of a word → of `struct`, and its lowest and highest number; STEP 7 and IEC 61131-3, table 10
FORMATS = {"BYTE": ("B", 0, 2**8 - 1), "INT": ("h", -(2**15), 2**15 - 1), "KF": ("h", -(2**15), 2**15 - 1), "WORD": ("H", 0, 2**16 - 1),
           "UINT": ("H", 0, 2**16 - 1), "KM": ("H", 0, 2**16 - 1), "DINT": ("i", -(2**31), 2**31 - 1), "TIME": ("i", -(2**31), 2**31 - 1),
           "UDINT": ("I", 0, 2**32 - 1), "REAL": ("f", None, None), "LREAL": ("d", None, None)}
WHOLE = block_image(words_of("s5-ob251"), address_of("s7://127.0.0.1/0/2"), {})
#: what is read → the order in which a link carries the bytes of two registers
ORDERS = {"high word first": (0, 1, 2, 3), "low word first": (2, 3, 0, 1)}


def image_of(form, order):
    """Return the image of a block with one word, WORD, of a format."""
    signal = BlockSignal(0, form, turned=order == "low word first")
    return dataclasses.replace(WHOLE, block=_Block({"WORD": signal}), spans=((0, 8),))


@dataclasses.dataclass
class _Block:
    words: dict


def carried(form, order, number):
    """Return a number's bytes as the link carries them."""
    cells = struct.pack(">" + FORMATS[form][0], number)
    return bytes(cells[at] for at in ORDERS[order]) if len(cells) == 4 else cells


def read_as(form, order, cells):
    """Return the number that stands in bytes."""
    cells = bytes(cells[at] for at in ORDERS[order]) if len(cells) == 4 else cells
    return struct.unpack(">" + FORMATS[form][0], cells)[0]


def numbers(form):
    """Return a strategy of numbers of a format, of those that differ in few bytes, too."""
    code, low, high = FORMATS[form]
    if low is not None:
        return st.one_of(st.integers(low, high), st.sampled_from([low, high, 0, 1, min(300, high), min(256, high)]))
    return st.one_of(st.floats(width=32 if code == "f" else 64, allow_nan=False, allow_infinity=False), st.sampled_from([0.0, 1.5, -1.5, 88.0]))


KINDS = [(form, order) for form, (code, _, _) in FORMATS.items() for order in ORDERS if order == "high word first" or struct.calcsize(code) == 4]


@pytest.mark.parametrize(("form", "order"), KINDS)
@given(data=st.data())
def test_each_number_of_bytes_that_arrived_of_each_format_is_known_and_nothing_else(form, order, data):
    image, old, new = image_of(form, order), data.draw(numbers(form)), data.draw(numbers(form))
    one, other = carried(form, order, old), carried(form, order, new)
    mixtures = {first[:cut] + last[cut:] for first, last in ((one, other), (other, one)) for cut in range(1, len(one))}
    for cells in mixtures:
        value = read_as(form, order, cells)
        assert image.is_torn("WORD", value, old, new) is (cells not in (one, other))
    drawn = carried(form, order, data.draw(numbers(form)))
    third = bytes(data.draw(st.sampled_from(cells)) for cells in zip(one, other, drawn, strict=True))  # of its bytes some are of both sides
    value = read_as(form, order, third)
    if not math.isnan(value) and value != 0.0:  # a reading has lost its sign: 0 stands for both zeros
        assert image.is_torn("WORD", value, old, new) is (third in mixtures - {one, other})


@pytest.mark.parametrize(("form", "value", "old", "new", "torn"), [
    ("INT", 44, 300, 0, True), ("INT", 256, 300, 0, True), ("INT", 300, 300, 0, False), ("INT", 45, 300, 0, False),
    ("INT", -212, -200, 300, True),  # 0xFF38 and 0x012C: 0xFF2C
    ("DINT", 0x0001, 0x0002_0001, 0, True),  # two registers of which one arrived
    ("DINT", 44, 300, 0, True), ("DINT", 0x0100_0000, 0x0100_002C, 0x2C, False), ("REAL", 2.0, 1.5, 88.0, False)])
def test_examples_worked_out_on_paper(form, value, old, new, torn):
    assert image_of(form, "high word first").is_torn("WORD", value, old, new) is torn


def test_a_small_number_of_two_registers_is_torn_as_one_of_two_registers_is():
    """0x0000_012C and 0x0001_0000: with its high word alone 0x0001_012C = 65836; the size of both numbers tells nothing of a width."""
    image = image_of("DINT", "low word first")
    assert image.is_torn("WORD", 65836, 300, 65536)
    assert image.is_torn("WORD", 0, 300, 65536)
    assert image_of("DINT", "high word first").is_torn("WORD", 65836, 300, 65536)
    assert not image.is_torn("WORD", 0x0100_012C, 0x0000_012C, 0x0101_0101)  # a byte in the middle of what the link carries


def test_what_is_not_a_number_is_torn_as_any_other():
    old, new = (struct.unpack(">f", bytes.fromhex(each))[0] for each in ("7f000001", "40812345"))
    mixed = bytes.fromhex("7f812345")  # a signalling NaN, which a conversion makes a quiet one
    assert image_of("REAL", "high word first").is_torn("WORD", struct.unpack(">f", mixed)[0], old, new)
    assert not image_of("REAL", "high word first").is_torn("WORD", math.nan, 1.5, 88.0)


@pytest.mark.parametrize("target", sorted(SERVED.keys() - {"s7-200"}))  # its words are out of a client's reach
@given(data=st.data())
def test_a_request_that_ends_behind_any_byte_leaves_words_that_are_known(target, data):
    """Each controller's own block: of each request the first bytes arrive, or the last; each word is old, new or torn."""
    words = words_of(target)
    protocol = "modbus" if SERVED[target][0] == "modbus_blocks" else "s7"
    image = block_image(words, address_of({"modbus": "modbus://127.0.0.1/1/0", "s7": "s7://127.0.0.1/0/2/db30"}[protocol]), {})
    content = image.with_words(bytes(image.count), image.values(bytes(image.count)))
    sides = []
    for _ in range(2):
        values = {}
        for name in image.own:
            code, low, high = FORMATS[image.block.words[name].format]
            values[name] = data.draw(st.floats(width=32, allow_nan=False, allow_infinity=False) if code == "f" else st.integers(low, high))
        sides.append(values)
    old, new = sides
    content = image.with_words(content, old)
    for part in image.parts(content, new):
        at, count = image.at(part.start), len(part.after)
        cut = data.draw(st.integers(0, count))
        for arrived in (part.after[:cut] + part.before[cut:], part.before[:cut] + part.after[cut:]):
            found = image.values(content[:at] + arrived + content[at + count :])
            for name in image.own:
                assert found[name] in (old[name], new[name]) or image.is_torn(name, found[name], old[name], new[name])
