"""A trace of the commissioned loop beside the design in front, without a browser."""

import asyncio

import numpy as np
import pytest

from heatertune import report
from heatertune.log.log_values import Log
from heatertune.settings import AsLeftSettings
from heatertune.studio import background_work as downloads
from heatertune.studio.background_work import figures, left_sentence
from heatertune.studio.charts import left_chart
from heatertune.studio.sheet_card import DroppedFile, change_sheet, sheet
from heatertune.studio.wording import for_page


def trace_of(proof, *, degC=0.0):
    """The first 2000 s of the proof's own nominal run, 30 s of rest before it, as much warmer as is said.

    The run is kept once per PWM period, and the log reads it at the same instants: between them a sensor would read
    the ripple, which a line from one to the next leaves out.
    """
    nominal = proof.nominal
    time = nominal.time_s[nominal.time_s < 2000.0]
    temperature = np.round(nominal.temperature_degC[:len(time)], 1) + degC
    rest = np.arange(0.0, 30.0, 2.0)
    setpoint = np.full(len(time), nominal.setpoint_degC)
    return Log(name="after", source="after.csv", time_s=np.concatenate([rest, 30.0 + time]),
               temperature_degC=np.concatenate([np.full(len(rest), temperature[0]), temperature]),
               setpoint_degC=np.concatenate([np.zeros(len(rest)), setpoint]))


def hold(work, log, number, **about):
    asyncio.run(work.hold(log, AsLeftSettings(**about), number))


@pytest.mark.long
def test_a_trace_stands_beside_the_very_design_it_was_held_against(work, monkeypatch):
    session = work.session
    asyncio.run(work.look())
    log, number = trace_of(session.proof), session.number
    hold(work, log, number)
    left = session.as_left
    assert left.verdict == "AS PROVEN", "it is one of the proven runs"
    assert left_sentence(left, "PASS").startswith("AS PROVEN: the curve is inside of what the proven runs do, and each of the")
    assert left_sentence(left, "FAIL").endswith("The proof of these words is itself FAIL.")
    measured = {line.name: line.measured for line in left.measurements}
    assert measured["overshoot"] is not None
    assert measured["recovery_time"] is None
    assert "no load in the trace, or its time is not stated (‘load came’)" in figures(left)
    assert "NaN" not in str(left_chart(left))

    drawn = []
    monkeypatch.setattr(downloads, "dossier", lambda *_: {})
    monkeypatch.setattr(report, "render", lambda documents: drawn.append(documents) or "page")
    asyncio.run(work.report(number, force=True))
    assert drawn[0]["as_left"]["verdict"] == "AS PROVEN"

    work.move(ms=1.4)
    assert session.as_left is None, "another design is on its way"
    asyncio.run(work.look())
    assert session.verdict == "PASS"
    assert session.as_left is None
    asyncio.run(work.report(session.number, force=True))
    assert "as_left" not in drawn[1]
    work.move(ms=1.6)
    assert session.as_left is left
    work.put_trace_away()
    assert session.as_left is None


def test_a_trace_of_another_heater_is_not_as_proven(work):
    asyncio.run(work.look())
    session = work.session
    hold(work, trace_of(session.proof, degC=5.0), session.number)
    assert left_sentence(session.as_left, "PASS").startswith("NOT AS PROVEN: ")


@pytest.mark.long
@pytest.mark.parametrize(("number", "about", "told"), [
    (1, {}, "the design changed meanwhile"), (0, {"load_at_s": 1e6}, "‘load came’ = 1e+06 s: after goes from 0 to"),
])
def test_a_trace_that_cannot_be_held_is_told_in_place(work, number, about, told):
    asyncio.run(work.look())
    session = work.session
    hold(work, trace_of(session.proof), session.number + number, **about)
    assert told in for_page(session.file_error)
    assert session.as_left is None
    assert not work.busy


def test_what_is_known_beside_a_trace_is_typed_on_the_sheet(step_log):
    found = DroppedFile.of("after.csv", step_log)
    for change, value in (("setpoint_degC", "40"), ("load_at_s", "700,5"), ("begins_s", "60"), ("ambient_degC", "21")):
        found = change_sheet(found, change, 0, value)
    assert found.assumptions.about == AsLeftSettings(setpoint_degC=40.0, ambient_degC=21.0, begins_s=60.0, load_at_s=700.5)
    assert 'value="700.5" aria-label="load came, in s"' in sheet(found)
    assert "no number" in change_sheet(found, "load_at_s", 0, "soon").problem
