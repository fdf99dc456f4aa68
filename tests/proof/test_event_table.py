"""The tables of conditions and events say what a proof runs: they are held against its test sequences and additional runs."""

from pathlib import Path

import pytest

from heatertune.model.findings import KINDS, Finding
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Scaling, controller_for
from heatertune.plc.design import encode, tune
from heatertune.proof.event_table import EVENTS, EXCLUDED, NOT_RUN
from heatertune.proof.heaters import MAINS_POWERS
from heatertune.proof.long_outage import JUDGED, LOADED, PART, WINDOW, OutageTiming, nights_of, wound
from heatertune.proof.prove_words import course_for
from heatertune.proof.scenario import Mains, SetpointRampEvent, kinds_of
from heatertune.proof.verdict import FitDiagnostics
from heatertune.settings import Conditions

HEATER = Fopdt(gain_degC_per_pct=1.0, time_constant_s=200.0, dead_time_s=20.0, ambient_degC=20.0)
WORDS = encode(tune(model_by_hand(HEATER), target="esphome"), "esphome", scaling=Scaling())
SEQUENCE = [event for event in EVENTS if not event.finding]


def _sequence(profile=None, mains_power=None, setpoint=(40.0, 60.0)):
    conditions = Conditions(setpoint_degC=setpoint, profile=profile)
    return course_for(WORDS, [HEATER], conditions, 60.0, mains_power=mains_power).scenario


def _mains_steps(scenario):
    """Return the shares of the power between which the voltage changes while a loop is at rest."""
    return {event.share for event in scenario.disturbances if isinstance(event, Mains)} - {0.0, 1.0}


def _profile(folder):
    path = Path(folder, "profile.csv")
    path.write_text("target [degC],ramp [degC/min],soak [min]\n50,1,60\n")
    return str(path)


def test_the_test_sequence_has_the_phases_that_the_table_names_and_no_others(tmp_path):
    kinds = {kind for kind, *_ in kinds_of(_sequence(_profile(tmp_path)))}
    assert kinds == {phase for event in SEQUENCE for phase in event.phases}


@pytest.mark.parametrize("mains_power", [None, *MAINS_POWERS])
def test_at_a_held_voltage_everything_runs_but_what_the_table_leaves_to_the_nominal_one(mains_power):
    scenario = _sequence(mains_power=mains_power)
    assert _mains_steps(scenario) == ({*MAINS_POWERS} if mains_power is None else set())
    assert [event.name for event in EVENTS if event.mains == "nominal"] == ["mains step"]
    kinds, nominal = ({kind for kind, *_ in kinds_of(each)} for each in (scenario, _sequence()))
    assert kinds == nominal


def test_each_finding_of_an_additional_run_has_its_row():
    named = [event.finding for event in EVENTS if event.finding]
    assert sorted(named) == sorted(JUDGED)
    assert {*named} <= {*KINDS}


@pytest.mark.parametrize("name", [event.finding for event in EVENTS if event.finding])
def test_each_finding_blocks_and_is_designed_against_but_the_two_that_the_manual_calls_only_told(name):
    told = name in ("outage-below", "loaded-window")  # docs/explain/events.md
    assert KINDS[name].effect != "blocks" if told else KINDS[name].effect == "blocks"
    assert wound(FitDiagnostics(findings=(Finding(name=name, message="After 4 h it overshoots."),))) == (set() if told else {name})


def test_the_additional_runs_have_the_phases_that_the_table_names():
    runs = {}
    for scenario, again in ((_sequence(), LOADED), (_sequence(setpoint=60.0), WINDOW)):
        timing = OutageTiming(controller_for("esphome"), WORDS, controller_for("esphome").decode(WORDS), scenario, [HEATER])
        runs |= {night.name: {kind for kind, *_ in kinds_of(night.scenario)} for night in nights_of(
            scenario, [HEATER], timing.openings_s(), timing.restarts_s(), timing.lows_degC(), timing.lower_s(),
            again=again)}
    table = {event.finding: {*event.phases} for event in EVENTS if event.finding}
    assert runs.keys() == table.keys()
    for name, phases in table.items():
        ways = {"heat-up", "off", "change", "recovery"}  # to where it happens: from cold, to a lower setpoint, under a load
        assert phases <= runs[name] <= phases | ways, name


def _unrested(scenario):
    """Return the kinds of the phases that end with an event before the loop had time to come to rest, a profile's left out."""
    kinds = (kind for kind, *_ in kinds_of(scenario))
    return {kind for kind, rest_s, event in zip(kinds, scenario.rests_s, scenario.disturbances, strict=False)
            if rest_s == 0.0 and not isinstance(event, SetpointRampEvent)}


def test_no_event_comes_before_the_loop_is_at_rest_but_those_that_the_table_excepts():
    assert NOT_RUN[-1].startswith("a second event before the loop is at rest, except without power, a setpoint rise right after it")
    scenario = _sequence()
    timing = OutageTiming(controller_for("esphome"), WORDS, controller_for("esphome").decode(WORDS), scenario, [HEATER])
    nights = {night.name: _unrested(night.scenario) for night in nights_of(
        scenario, [HEATER], timing.openings_s(), timing.restarts_s(), timing.lows_degC(), timing.lower_s(), again=LOADED)}
    # "off" is without power, or the way back on which the setpoint rises; a fall of the setpoint by a part lasts as
    # long as the test sequence's own, with its rest
    assert {"off"} == _unrested(scenario) == set.union(*(kinds for name, kinds in nights.items() if name != PART))
    assert nights[PART] == {"change"}


def test_each_exclusion_names_an_event_of_the_table():
    assert {each.event for each in EXCLUDED} <= {"all", *(event.name for event in EVENTS)}
