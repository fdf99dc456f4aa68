"""The exported text runs what the proof ran; the witness is a text with a fault, which has to be noticed.

That the text and the proof are right is tests/golden's: awlsim and an S5 of its own.
"""

import re
from dataclasses import replace

import pytest

from heatertune import chain
from heatertune.errors import InputError
from heatertune.model.by_hand import model_by_hand
from heatertune.model.values import TwoLag
from heatertune.pid.values import PidDesign
from heatertune.plc import Certificate, Scaling, controller_for
from heatertune.plc.cpu.s5.machine import Cpu as S5Cpu
from heatertune.plc.cpu.s7_300.machine import Cpu as S7Cpu
from heatertune.plc.pwm import Actuator
from heatertune.proof.exported import as_exported, departure
from heatertune.proof.verdict import verdict_line
from heatertune.settings import Conditions

HEATER = TwoLag(gain_degC_per_pct=0.6, time_constant_s=50.0, second_time_constant_s=11.0, dead_time_s=1.3, ambient_degC=21.0)
FILES = {"s5-ob251": "program_listing.txt", "s7-300": "s7_300_pid.awl", "fb41": "fb41_cont_c.awl"}

pytestmark = pytest.mark.long


def proven(target, *, ramp=None, tv=0.0, **conditions):
    """A first look at PI or PID words; the heater passes with them or not."""
    wished = PidDesign(gain_pct_per_degC=1.4 if tv else 2.5, integral_time_s=40.0, derivative_time_s=tv, sample_time_s=3.0,
                       structure="pid" if tv else "pi", method="")
    words = chain.encode(wished, target, scaling=Scaling(low_degC=10.0, high_degC=110.0))
    if ramp is not None:
        words = replace(words, ramp=controller_for(target).ramp(words, *ramp))
    return chain.prove(words, model_by_hand(HEATER), Conditions(setpoint_degC=51.0, **conditions), first_look=True)


def departs(proof):
    return departure(controller_for(proof.words.target), proof.words, proof.nominal)


@pytest.mark.parametrize(("target", "asked"), [
    ("s5-ob251", {"tv": 6.0}), ("s5-ob251", {"ramp": (5.0, 4.0), "pwm_period_s": 12.0, "minimum_on_s": 0.7, "minimum_off_s": 0.9}),
    ("s5-ob251", {"pwm_period_s": 7.0 / 3.0}), ("s7-300", {"ramp": (5.0, 4.0), "pwm_period_s": 12.0, "minimum_on_s": 0.7}),
    ("s7-300", {"tv": 6.0, "pwm_period_s": 1.5, "pwm_resolution_s": 0.05}), ("fb41", {"ramp": (9.0,), "noise_degC": 0.3}),
    ("fb41", {"tv": 6.0, "pwm_period_s": 3.0, "pwm_rule": "pulsegen"})])
def test_the_text_does_what_was_proven(target, asked):
    proof = proven(target, **asked)
    assert len(set(proof.nominal.power_asked_pct)) > 20
    assert departs(proof) is None


def test_a_start_up_as_chosen_is_that_of_the_text():
    proof = proven("s5-ob251", tv=6.0, switches={"start_up": "retained"})
    which = controller_for("s5-ob251")
    assert departure(which, proof.words, proof.nominal, proof.known) is None
    assert departure(which, proof.words, proof.nominal) is not None  # a text that clears goes on from cold
    cleared = proven("s5-ob251", tv=6.0).nominal
    assert cleared.power_asked_pct.tolist() != proof.nominal.power_asked_pct.tolist()
    assert departure(which, proof.words, cleared, proof.known) is None  # a CPU without a battery


#: target → a pattern of its text, what stands there instead
PLANTED = [
    ("s5-ob251", r"SRW 3", "SRW 2"), ("s5-ob251", r"KF = \+02560;( +K )", r"KF = +02561;\1"),
    ("s5-ob251", r":T  DW 22 ", ":T  DW 23 "), ("s5-ob251", r"(OUT  :L  DW 7.*\n +:L  KF \+)(\d+)", r"\g<1>3"),
    ("s5-ob251", r":SU D 11\.2", ":RU D 11.2"), ("s5-ob251", r"(:L  KF \+\d+\n +:\+F\n +:L  DW 0\n +:>F)", r"\1\n     :JU =END"),
    ("s7-300", r"/R    ;", "*R    ;"), ("s7-300", r"DTR   ;", "NOP   0;"), ("s7-300", r"ou1:  L     1\.0", "ou1:  L     9.0"),
    ("s7-300", r"L     L#13824;", "L     L#13000;"), ("s7-300", r"CALL  FC 101;\r\nEND_ORG", "NOP   0;\r\nEND_ORG"),
    ("fb41", r"GAIN := \d", "GAIN := 9"), ("fb41", r"SP_INT := DB101\.DBD    2", "SP_INT := DB101.DBD    6"),
    ("fb41", r"SRD   12;", "SRD   11;"), ("fb41", r"COM_RST := TRUE", "COM_RST := FALSE"),
]


@pytest.mark.parametrize(("target", "there", "instead"), PLANTED)
def test_a_fault_in_the_text_is_noticed(target, there, instead, monkeypatch):
    proof = proven(target, ramp=(5.0, 4.0) if ":>F" in there else None)
    controller, file = controller_for(target), FILES[target]
    whole = controller.export(proof.words, Certificate(verdict="", setpoint_degC=51.0, actuator=proof.actuator))[file]
    broken, count = re.subn(there, instead, whole)
    assert count, whole
    monkeypatch.setattr(type(controller), "export", staticmethod(lambda *_: {file: broken}))
    try:
        assert departs(proof) is not None
    except InputError:
        assert "=END" in instead


def test_a_proof_whose_text_does_other_is_none(monkeypatch):
    proof = proven("s7-300", ramp=(3.0, 4.0))
    assert (proof.verdict, as_exported(proof).verdict) == ("PASS", "PASS")
    monkeypatch.setattr("heatertune.proof.exported.departure", lambda *_: "at 3 s it asks for 7 %")
    told = as_exported(proof)
    assert told.verdict == "NOT PROVEN"
    assert "the exported program does other than what was proven" in verdict_line(told.to_document())


def test_a_statement_that_no_cpu_here_knows_is_told():
    with pytest.raises(InputError, match="'XYZ DW 3'"):
        S5Cpu("FB 1\n     :XYZ DW 3\n     :BE\n", {})
    with pytest.raises(InputError, match="line 2: 'what'"):
        S5Cpu("FB 1\nwhat\n", {})
    with pytest.raises(InputError, match="XYZ"):
        S7Cpu("FUNCTION FC 1 : VOID\nBEGIN\n      XYZ   3;\nEND_FUNCTION\n", {})


def test_an_analog_output_makes_no_pulses():
    controller = controller_for("fb41")
    words = proven("fb41").words
    files = controller.export(words, Certificate(verdict="", actuator=Actuator(pwm_period_s=3.0, minimum_rule="carry")))
    assert controller.exported(files, controller.assumptions()).pulses(50.0, 300) is None
