"""The table of advice against the figures of WEG's manual: WPS help, SCA06, block PID, second NOTE."""

import pytest

from heatertune.proof.advice import ADVICE, AcademicGains, Symptom, apply_changes

GAINS = AcademicGains(kp=10.0, ki=0.5, kd=4.0)


@pytest.mark.parametrize(("symptom", "after"), [
    (Symptom.OVERSHOOT, AcademicGains(8.0, 0.4, 2.0)),  # decrease Kp 20 %, Ki 20 %, Kd 50 %
    (Symptom.SLOW, AcademicGains(12.0, 0.6, 6.0)),  # increase Kp 20 %, Ki 20 %, Kd 50 %
    (Symptom.RESTLESS, AcademicGains(8.0, 0.5, 6.0)),  # increase Kd 50 %, decrease Kp 20 %
    (Symptom.OSCILLATING, AcademicGains(5.0, 0.5, 4.0)),  # decrease Kp 50 %
    (Symptom.FAR, AcademicGains(15.0, 0.75, 6.8)),  # increase Kp 50 %, Ki 50 %, Kd 70 %
    (Symptom.NONE, GAINS),
])
def test_the_whole_list_changes_the_gains_by_the_manuals_figures(symptom, after):
    assert apply_changes(GAINS, ADVICE[symptom]) == pytest.approx(after)


def test_steps_stand_in_the_manuals_order_and_say_what_they_do():
    assert [change.label for change in ADVICE[Symptom.RESTLESS]] == ["Kd +50 %", "Kp -20 %"]
    assert [change.label for change in ADVICE[Symptom.OVERSHOOT]] == ["Kp -20 %", "Ki -20 %", "Kd -50 %"]
    assert set(ADVICE) == set(Symptom)
