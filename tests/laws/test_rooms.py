"""What holds for every room."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heatertune.errors import NotRepresentable, OutOfRange, UnknownName
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc import TARGETS, Scaling, Words, room

ROOMS = [room(name) for name in TARGETS]
rooms = pytest.mark.parametrize("which", ROOMS, ids=list(TARGETS))


def _value(field):
    if field.format == "REAL":
        low, high = (np.nextafter(np.float32(end), np.float32(0)) for end in (field.low, field.high))
        return st.floats(float(low), float(high), width=32)
    return st.integers(field.low, field.high)


#: what the first two inputs may be: whole numbers beyond their format too, and every bit pattern of a REAL
_WHOLE = st.integers(-32768, 32767)
_ANY = {"KF": _WHOLE, "BYTE": _WHOLE, "REAL": st.floats(width=32)}


@st.composite
def words_of(draw, which):
    values = {f.name: draw(_value(f)) for f in which.fields}
    ta = values.get("CYCLE", values.get("Ts", draw(st.integers(1, 6000)) * 10)) / 1000.0
    return Words(target=which.name, values=values, scaling=Scaling(), sample_time_s=ta)


@st.composite
def designs(draw):
    gain = draw(st.floats(0.05, 30.0))
    ta = draw(st.integers(10, 3000)) / 100.0
    tn = ta * draw(st.floats(3.0, 400.0))
    tv = draw(st.sampled_from([0.0, 1.0])) * ta * draw(st.floats(0.6, 20.0))
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="")


@rooms
@settings(deadline=None, max_examples=300)
@given(data=st.data())
def test_words_that_encode_gave_come_back_the_same(which, data):
    words = data.draw(words_of(which))
    try:
        which.check(words)
        design = which.decode(words)
        again = which.encode(design, words.scaling)
    except (OutOfRange, NotRepresentable):
        return
    # several word sets can hold one loop (K·R, Kp and Ki); encode picks one of them and stays with it
    assert which.encode(which.decode(again), words.scaling).values == again.values


@rooms
@settings(deadline=None, max_examples=300)
@given(design=designs())
def test_encoding_changes_a_design_by_half_a_word_at_most(which, design):
    try:
        words = which.encode(design, Scaling())
    except NotRepresentable:
        return
    back = which.decode(words)
    if which.name == "s5-ob251":
        assert abs(back.gain_pct_per_degC - design.gain_pct_per_degC) <= 0.5 / 1024 + 1e-12
        assert abs(1024 * design.sample_time_s / design.integral_time_s - words.values["TI"]) <= 0.5 + 1e-9
        assert abs(back.derivative_time_s - design.derivative_time_s) <= 0.5 * design.sample_time_s + 1e-9
    elif which.name == "weg":
        half = 2.0**-24  # of a number in single precision
        assert back.gain_pct_per_degC == pytest.approx(design.gain_pct_per_degC, rel=half + 1e-12)
        assert back.integral_time_s == pytest.approx(design.integral_time_s, rel=half + 1e-12)
        assert back.derivative_time_s == pytest.approx(design.derivative_time_s, rel=half + 1e-12)
    else:
        half = 0.5 / abs(words.values["KD"])
        assert design.gain_pct_per_degC == pytest.approx(back.gain_pct_per_degC, rel=half + 1e-9)
    assert math.isclose(back.sample_time_s, design.sample_time_s)


@rooms
def test_every_illegal_word_is_refused_by_its_name(which):
    legal = which.encode(
        PidDesign(gain_pct_per_degC=2.0, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=5.0,
                  structure="pi", method=""), Scaling(),
    )
    which.check(legal)
    for field in which.fields:
        beyond = (np.nextafter(field.low, -np.inf), np.nextafter(field.high, np.inf))
        for value in (*map(float, beyond), field.low - 1, math.nan, 0.1, None, True) if field.format == "REAL" else (
                field.low - 1, field.high + 1, 1.5, None, True):
            values = dict(legal.values) | {field.name: value}
            with pytest.raises(OutOfRange, match=rf"word {field.name}\b"):
                which.check(Words(target=which.name, values=values, scaling=legal.scaling, sample_time_s=5.0))
    with pytest.raises(OutOfRange, match="word XYZ"):
        which.check(Words(target=which.name, values=dict(legal.values) | {"XYZ": 1}, scaling=legal.scaling, sample_time_s=5.0))


@rooms
@settings(deadline=None, max_examples=1500)
@given(data=st.data())
def test_a_step_is_total_and_pure_and_asks_for_0_to_100_percent(which, data):
    words = data.draw(words_of(which))
    switches = {s.name: data.draw(st.sampled_from(s.settings)) for s in which.switches}
    state = which.start(words, switches)
    for _ in range(data.draw(st.integers(1, 6))):
        w, x = (data.draw(_ANY[which.inputs[name]]) for name in list(which.inputs)[:2])
        start = data.draw(st.booleans())
        first = which.step(words, state, w, x, switches, cycle_start=start)
        assert which.step(words, state, w, x, switches, cycle_start=start) == first
        state, scan = first
        assert 0.0 <= scan.power_pct <= 100.0


def test_an_unknown_target_is_refused_with_the_known_ones():
    with pytest.raises(UnknownName, match="known: s5-ob251, s7-200"):
        room("s5-ob252")


@rooms
def test_a_reading_is_cut_and_limited_like_a_converter(which):
    words = Words(target=which.name, values={}, scaling=Scaling(low_degC=0.0, high_degC=100.0), sample_time_s=1.0)
    full = which.measure(words, 100.0)
    assert [which.measure(words, t) for t in (-5.0, 0.0, 100.0, 500.0)] == [0, 0, full, full]
    readings = [which.measure(words, t / 10.0) for t in range(1000)]
    assert readings == sorted(readings)
