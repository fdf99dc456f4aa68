"""Where a design fails for heaters in a room warmer than the log alone, the room's temperature is the way on."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.bench import blind

from heatertune.errors import InputError
from heatertune.model.model_values import Fopdt, Residuals, model_by_hand
from heatertune.proof.design_request import DesignRequest
from heatertune.proof.redesign.suggestion import Suggestion

DIAGNOSTICS = SimpleNamespace(findings=(), views=(), accepted=())
READINGS = np.linspace(20.0, 40.0, 50)


def _suggestion(rooms, verdict):
    """Return a search over heaters in rooms [°C]; a design for some of them, none warmer than 21 °C, has this verdict."""
    first = model_by_hand(Fopdt(gain_degC_per_pct=1.0, time_constant_s=100.0, dead_time_s=10.0, ambient_degC=rooms[0]))
    candidates = tuple(replace(first.candidates[0], model=replace(first.model, ambient_degC=room)) for room in rooms)
    residuals = Residuals(time_s=np.arange(50.0), measured_degC=READINGS, simulated_degC=READINGS, autocorrelation=np.zeros(1))

    def close(fitted, request, *, progress):
        assert max(each.model.ambient_degC for each in fitted.candidates) <= 21.0
        if verdict is None:
            raise InputError("they cannot be held at the setpoint")
        return SimpleNamespace(proof=SimpleNamespace(verdict=verdict, diagnostics=DIAGNOSTICS))

    proof = SimpleNamespace(broken_criteria=("overshoot",), criteria=(), diagnostics=DIAGNOSTICS)
    return Suggestion(fitted_model=replace(first, candidates=candidates, residuals=residuals),
                      request=DesignRequest(target="fb41"), first=SimpleNamespace(proof=proof), progress=str, close=close)


@pytest.mark.parametrize(("rooms", "verdict", "is_told"), [
    ((20.5, 30.0), "PASS", True), ((20.5, 30.0), "FAIL", False), ((20.5, 30.0), None, False),
    ((20.5, 19.0), "PASS", False),  # no heater is left out: the room would change nothing
    ((25.0, 30.0), "PASS", False),  # none is left
])
def test_the_room_is_named_only_where_the_heaters_that_it_leaves_have_a_design(rooms, verdict, is_told):
    told = _suggestion(rooms, verdict)._hopeless(whole=True)
    assert ("--ambient" in told) == is_told
    assert told.startswith("nothing that was tried passes, nor does any limit of up to twice its default")


@pytest.mark.sample
def test_the_design_passes_when_the_room_is_stated(run, tmp_path):
    case = blind.make("part pulse", 0)
    (tmp_path / "log.csv").write_text(case.text(), encoding="utf-8")
    options = ("--target", "fb41", "--range", 0, 500, "--setpoint", 24.7, "--quiet")
    status, screen, _ = run("design", tmp_path / "log.csv", *options, "--out", tmp_path / "free")
    assert status == 1
    assert "state the room's temperature (--ambient)" in " ".join(screen.split())
    assert run("design", tmp_path / "log.csv", "--ambient", 15.5, *options, "--out", tmp_path / "stated")[0] == 0
