"""What holds for every room: 100 cases each in a run of all tests, others in each run."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from heatertune.errors import NotRepresentable, OutOfRange, UnknownName
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import COOLING, TARGETS, Certificate, Scaling, Words, controller_for
from heatertune.plc.words import FORMATS

NAMED = (*TARGETS, *COOLING.values())
ROOMS = [controller_for(name) for name in NAMED]
rooms = pytest.mark.parametrize("which", ROOMS, ids=NAMED)

pytestmark = pytest.mark.law

LEGAL = PidDesign(gain_pct_per_degC=2.0, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=5.0, structure="pi",
                  method="")


def _legal(which):
    """Return words of each room: its timer may not know 5 s."""
    return which.encode(replace(LEGAL, sample_time_s=which.timer.round(5.0)), Scaling())


def _value(field):
    if field.places is not None:
        tens = 10**field.places
        return st.integers(math.ceil(field.low * tens), math.floor(field.high * tens)).map(lambda whole: whole / tens)
    if field.format == "LREAL":
        return st.floats(field.low, field.high)
    if field.format == "REAL":
        low, high = (float(np.nextafter(np.float32(end), np.float32(0))) for end in (field.low, field.high))
        return st.floats(low, high, width=32)
    return st.integers(field.low, field.high)


def _interval_of(which, values, hundredths):
    """Return the interval that a room's own words tell, any where its words and its timer leave it open."""
    if which.timer.shortest_s == which.timer.longest_s:
        return which.timer.shortest_s
    return hundredths / 100.0 if which.interval_s is None else which.interval_s(values)


def words_of(which):
    fields = st.fixed_dictionaries({f.name: _value(f) for f in which.fields})

    def words(drawn):
        values, hundredths = drawn
        ta = _interval_of(which, values, hundredths)
        return Words(target=which.name, values=values, scaling=Scaling(), sample_time_s=ta)

    return st.tuples(fields, st.integers(1, 6000)).map(words)


@st.composite
def designs(draw):
    gain = draw(st.floats(0.05, 30.0))
    ta = draw(st.integers(1, 300)) / 10.0
    tn = ta * draw(st.floats(3.0, 400.0))
    tv = draw(st.sampled_from([0.0, 1.0])) * ta * draw(st.floats(0.6, 20.0))
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="")


def _parts(design):
    """Return the gains of the P, I and D part per sample."""
    gain, ta = design.gain_pct_per_degC, design.sample_time_s
    return np.array([gain, gain * ta / design.integral_time_s, gain * design.derivative_time_s / ta])


def _half_words(which, words, design):
    """Return by how much half a step of every word together changes the parts of a design."""
    total = np.zeros(3)
    for field in which.fields:
        value = words.values[field.name]
        if field.places is not None:
            neighbours = [round(value + side * 10.0**-field.places, field.places) for side in (-1, 1)]
        elif field.format == "LREAL":
            neighbours = [math.nextafter(value, side * math.inf) for side in (-1, 1)]
        elif field.format == "REAL":
            neighbours = [float(np.nextafter(np.float32(value), np.float32(end))) for end in (-np.inf, np.inf)]
        else:
            neighbours = [value - 1, value + 1]
        changes = [np.zeros(3)]
        for neighbour in neighbours:
            changed = Words(target=words.target, values=dict(words.values) | {field.name: neighbour}, scaling=words.scaling,
                            sample_time_s=words.sample_time_s)
            try:
                near = which.decode(changed)
            except OutOfRange:  # the neighbour is no legal word
                continue
            if near is not None:
                changes.append(np.abs(_parts(near) - _parts(design)))
        # a time of one step is in the parts as 1/word, and half a step below it, where no word is, doubles that
        total += (1.0 if value == 1 else 0.5) * np.max(changes, axis=0)
    return total


@rooms
def test_words_that_encode_gave_come_back_the_same(which):
    @given(words_of(which))
    def holds(words):
        try:
            which.check(words)
            design = which.decode(words)
            if design is None:  # no PID, so the words cannot be made from what they do
                return
            again = which.encode(design, words.scaling)
        except (OutOfRange, NotRepresentable):
            return
        # several word sets can hold one loop (K·R, SCALE and constants); encode picks one of them and stays with it, but
        # for the last bits of what has as many bits as the design: there and back a gain is rounded twice, and Ki, the
        # quotient of a rounded gain and a rounded time, by up to one bit more
        once_more = which.encode(which.decode(again), words.scaling).values
        doubles = {field.name for field in which.fields if field.format == "LREAL"}
        assert once_more.keys() == again.values.keys()
        for name, value in again.values.items():
            assert abs(once_more[name] - value) <= ((2.0 if name == "Ki" else 1.0) * np.spacing(abs(value)) if name in doubles else 0.0), name

    holds()


def test_a_gain_of_as_many_bits_as_the_design_comes_back_but_for_the_last_one():
    which = controller_for("arduino-pid")  # found by chance, in the test above
    values = {"Kp": 882933424.125, "Ki": 0.0, "Kd": 0.0, "POn": 1, "OutMax": 1.0, "Full": 10484.75, "SampleTime": 1}
    found = Words(target="arduino-pid", values=values, scaling=Scaling(), sample_time_s=0.001)
    words = which.encode(which.decode(found), Scaling())
    once_more = which.encode(which.decode(words), Scaling()).values
    assert once_more["Kp"] == np.nextafter(words.values["Kp"], math.inf)


@rooms
@given(design=designs())
@example(design=PidDesign(gain_pct_per_degC=1.0, integral_time_s=0.6, derivative_time_s=0.0, sample_time_s=0.2, structure="pi", method=""))
def test_encoding_changes_a_design_by_half_a_word_at_most(which, design):
    if which.timer.longest_s < 1.0:  # a printer's few intervals: none of the others can be asked for
        design = replace(design, sample_time_s=which.timer.round(design.sample_time_s))
    try:
        words = which.encode(design, Scaling())
    except NotRepresentable:
        return
    which.check(words)
    back = which.decode(words)
    if back is None:
        return
    assert math.isclose(words.sample_time_s, design.sample_time_s)
    # a product of two words of 1 or more is off by up to a quarter more than the sum of their half steps
    assert np.all(np.abs(_parts(back) - _parts(design)) <= 1.25 * _half_words(which, words, back) + 1e-12)


def _illegal(field):
    if field.format == "LREAL":
        beyond = [math.nextafter(end, to) for end, to in ((field.low, -math.inf), (field.high, math.inf))]
        return (*beyond, *([] if field.places is None else [field.low + 1.5 * 10.0**-field.places]), math.nan, math.inf, None, True)
    if field.format != "REAL":
        return (field.low - 1, field.high + 1, 1.5, None, True)
    with np.errstate(over="ignore"):  # beyond the largest single there is infinity
        beyond = [float(np.nextafter(np.float32(end), np.float32(to))) for end, to in
                  ((field.low, -np.inf), (field.high, np.inf))]
    return (*beyond, 0.1, math.nan, math.inf, None, True)


@rooms
def test_every_illegal_word_is_refused_by_its_name(which):
    legal = _legal(which)
    which.check(legal)
    for field in which.fields:
        for value in _illegal(field):
            values = dict(legal.values) | {field.name: value}
            with pytest.raises(OutOfRange, match=rf"word {field.name}\b"):
                which.check(Words(target=which.name, values=values, scaling=legal.scaling, sample_time_s=legal.sample_time_s))
    with pytest.raises(OutOfRange, match="word XYZ"):
        which.check(Words(target=which.name, values=dict(legal.values) | {"XYZ": 1}, scaling=legal.scaling, sample_time_s=legal.sample_time_s))


def _scans(which, stream):
    """Return setpoint, reading and whether a PWM period begins: any bit patterns of the two, taken from bytes."""
    kinds = [{"REAL": "<f4", "LREAL": "<f8"}.get(form, "<i2") for form in list(which.inputs.values())[:2]]
    row = np.dtype([("w", kinds[0]), ("x", kinds[1]), ("begins", "u1")])
    found = np.frombuffer(stream[:len(stream) // row.itemsize * row.itemsize], row)
    return [(w, x, begins > 127) for w, x, begins in found.tolist()]


@rooms
def test_a_step_is_total_and_pure_and_asks_for_0_to_100_percent(which):
    switched = st.fixed_dictionaries({s.name: st.sampled_from(s.settings) for s in which.switches})

    @given(words_of(which), switched, st.binary(min_size=17, max_size=68))
    def holds(words, switches, stream):
        state = which.start(words, switches)
        for w, x, begins in _scans(which, stream):
            found = which.step(state, w, x, cycle_start=begins)
            # NaN is not itself
            assert repr(which.step(state, w, x, cycle_start=begins)) == repr(found)
            state, scan = found
            assert (0.0 if which.cooling is None else -100.0) <= scan.power_pct <= 100.0

    holds()


@rooms
@given(data=st.data())
def test_a_scan_of_all_inputs_is_total_and_pure(which, data):
    words = data.draw(words_of(which))
    state = which.start(words, {})
    whole = {name: st.floats(width=32) if form == "REAL" else st.floats() if form == "LREAL" else st.integers(*map(int, FORMATS[form]))
             for name, form in which.inputs.items()}
    for row in data.draw(st.lists(st.fixed_dictionaries(whole), min_size=1, max_size=4)):
        found = which.scan(state, row)
        assert repr(which.scan(state, row)) == repr(found)
        state, scan = found
        assert (0.0 if which.cooling is None else -100.0) <= scan.power_pct <= 100.0


@rooms
def test_the_same_words_and_certificate_always_give_the_same_bytes(which):
    words = _legal(which)
    certificate = Certificate(verdict="FAIL", lines=("one fact",), forced=True)
    files = which.export(words, certificate)
    assert files == which.export(words, certificate)
    texts = [content for content in files.values() if isinstance(content, str)]
    assert any("verdict of the proof: FAIL - FORCED" in text and "one fact" in text for text in texts)


def test_an_unknown_target_is_refused_with_the_known_ones():
    with pytest.raises(UnknownName, match=", ".join(TARGETS)):
        controller_for("s5-ob252")


@rooms
def test_a_reading_is_cut_and_limited_like_a_converter(which):
    words = Words(target=which.name, values={}, scaling=Scaling(low_degC=0.0, high_degC=100.0), sample_time_s=1.0)
    low, full = which.measure(words, 0.0), which.measure(words, 100.0)
    assert [which.measure(words, t) for t in (-5.0, 500.0)] == [low, full]
    readings = [which.measure(words, t / 10.0) for t in range(1000)]
    assert readings == sorted(readings)
    step = 100.0 / which.counts
    assert which.measure(words, 50.0 + 1.01 * step) > which.measure(words, 50.0)
    for count in (1, 17, 100):  # cut, not rounded
        assert which.measure(words, (count + 0.9) * step) == which.measure(words, (count + 0.1) * step)
