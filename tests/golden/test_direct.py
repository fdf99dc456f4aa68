"""A room's direct form against the listing that it exports: the same power, output and flags in every scan."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Scaling, controller_for
from heatertune.plc.words import FORMATS

LISTED = [name for name in TARGETS if controller_for(name).direct is not None]
DESIGN = PidDesign(gain_pct_per_degC=1.4, integral_time_s=150.0, derivative_time_s=4.0, sample_time_s=2.0, structure="pid",
                   method="")


def _values_of(field):
    if field.format == "REAL":
        usual = st.floats(max(field.low, -64.0), min(field.high, 64.0), width=32)  # few of all singles are between these
        return st.one_of(usual, st.floats(field.low, field.high, width=32))
    return st.integers(int(field.low), int(field.high))


def test_every_room_that_runs_a_listing_has_a_direct_form():
    assert sorted(LISTED) == ["on-off"]
    assert all(controller_for(name).core.compiles for name in TARGETS if name not in LISTED)


@pytest.mark.long
@pytest.mark.parametrize("target", LISTED)
def test_the_direct_form_is_the_listing_for_any_words_inputs_and_settings(target):
    which = controller_for(target)
    legal = which.encode(DESIGN, Scaling())
    ranges = [FORMATS[which.inputs[name]] for name in ("SP", "PV")]
    usual = st.tuples(*(st.integers(0, min(int(high), 32000)) for _, high in ranges))
    inputs = st.one_of(usual, st.tuples(*(st.integers(int(low), int(high)) for low, high in ranges)))

    @settings(max_examples=60)
    @given(
        values=st.fixed_dictionaries({}, optional={each.name: _values_of(each) for each in which.fields}),
        switches=st.fixed_dictionaries({each.name: st.sampled_from(each.settings) for each in which.switches}),
        scans=st.lists(st.tuples(inputs, st.booleans()), min_size=1, max_size=12),
    )
    def holds(values, switches, scans):
        words = replace(legal, values=dict(legal.values) | values)
        try:
            which.check(words)
        except ValueError:
            words = replace(legal, values=dict(legal.values) | {"KC": values.get("KC", 1.0)} if "KC" in legal.values else legal.values)
        core, direct = which.start_directly(words, switches)
        listed = which.start(words, switches)
        for (setpoint, reading), begins in scans:
            listed, told = which.core.run(listed, setpoint, reading, cycle_start=begins)
            direct, found = core.run(direct, setpoint, reading, cycle_start=begins)
            assert found == told

    holds()
