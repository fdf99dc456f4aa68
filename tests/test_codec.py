"""The codec: what is written comes back, and what is wrong is told with its path. Expected texts are written by hand."""

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heatertune.codec import OrInfinite, OrUnknown, decode, encode, register_schema
from heatertune.errors import DocumentError
from heatertune.units import check


class Colour(Enum):
    RED = "as blood"
    BLUE = "as the sky"


@dataclass(frozen=True, kw_only=True)
class Part:
    length_m: float
    colour: Colour = Colour.RED

    def __post_init__(self):
        check("length_m", self.length_m, above=0.0)


@register_schema("test/whole/1")
@dataclass(frozen=True, kw_only=True)
class Whole:
    name: str
    count: int
    well: bool = True
    way: Literal["up", "down"] = "up"
    parts: tuple[Part, ...] = ()
    ends: tuple[float | None, float | None] = (None, None)
    limits: Mapping[str, float] = field(default_factory=dict)
    time_s: OrInfinite = math.inf
    fit: OrUnknown = 0.0
    other: Part | None = None
    rest: Any = None


GOOD = {"schema": "test/whole/1", "name": "x", "count": 2}


def test_fields_stand_in_their_order_and_what_is_not_finite_is_null():
    whole = Whole(name="x", count=2, parts=(Part(length_m=1.5, colour=Colour.BLUE),), limits={"ms": 1.6})
    assert json.dumps(encode(whole)) == (
        '{"schema": "test/whole/1", "name": "x", "count": 2, "well": true, "way": "up", '
        '"parts": [{"length_m": 1.5, "colour": "BLUE"}], "ends": [null, null], "limits": {"ms": 1.6}, "time_s": null, '
        '"fit": 0.0, "other": null, "rest": null}')


finite = st.floats(allow_nan=False, allow_infinity=False)
parts = st.builds(Part, length_m=st.floats(1e-9, 1e9), colour=st.sampled_from(Colour))


@given(st.builds(
    Whole, name=st.text(), count=st.integers(), well=st.booleans(), way=st.sampled_from(["up", "down"]),
    parts=st.lists(parts).map(tuple), ends=st.tuples(st.none() | finite, st.none() | finite),
    limits=st.dictionaries(st.text(), finite), time_s=finite | st.just(math.inf), other=st.none() | parts))
def test_what_is_written_comes_back(whole):
    assert decode(Whole, json.loads(json.dumps(encode(whole))), "a file") == whole


@pytest.mark.parametrize(("change", "told"), [
    ({"count": "x"}, 'count: expected a whole number, got "x"'), ({"count": True}, "count: expected a whole number, got true"),
    ({"count": 1.5}, "count: expected a whole number, got 1.5"), ({"name": None}, "name: expected a text, got null"),
    ({"well": 1}, "well: expected true or false, got 1"), ({"way": "left"}, 'way: expected one of up, down, got "left"'),
    ({"way": []}, "way: expected one of up, down, got a list of 0"), ({"more": 1}, "more: no such field"),
    ({"a b": 1}, '["a b"]: no such field'), ({"parts": {}}, "parts: expected a list, got an object"),
    ({"parts": [{"length_m": 1.0}, {"length_m": "x"}]}, 'parts[1].length_m: expected a number, got "x"'),
    ({"parts": [{}]}, "parts[0].length_m: is missing"),
    ({"parts": [{"length_m": -1}]}, "parts[0]: length_m = -1.0 is out of range: must be > 0"),
    ({"parts": [{"length_m": 1, "colour": "as blood"}]}, 'parts[0].colour: expected one of RED, BLUE, got "as blood"'),
    ({"ends": [1.0]}, "ends: expected a list of 2, got a list of 1"), ({"ends": [1, ""]}, 'ends[1]: expected a number, got ""'),
    ({"limits": {"ms": None}}, "limits.ms: expected a number, got null"), ({"other": []}, "other: expected an object, got a list of 0"),
    ({"fit": 10**400}, f"fit: expected a finite number, got {'1' + 39 * '0'}…"), ({"fit": math.nan}, "fit: expected a finite number, got NaN"),
    ({"schema": "test/whole/2"}, "schema is 'test/whole/2'; expected 'test/whole/1'"), ({"schema": None}, "schema is None; expected"),
])
def test_what_is_wrong_is_told_with_its_path(change, told):
    with pytest.raises(DocumentError) as problem:
        decode(Whole, GOOD | change, "a.json")
    assert str(problem.value).startswith(f"a.json: {told}")


def test_null_is_what_the_field_says():
    whole = decode(Whole, GOOD | {"time_s": None, "fit": None}, "a.json")
    assert (whole.time_s, math.isnan(whole.fit)) == (math.inf, True)


def test_a_schema_is_that_of_one_dataclass():
    with pytest.raises(ValueError, match="test/whole/1 is registered twice"):
        register_schema("test/whole/1")(dataclasses.make_dataclass("Another", []))
