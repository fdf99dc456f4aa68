"""A further firmware controller is a row, its law and its text: what the rows share does the rest."""

import pytest

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, Timer, structure_of
from heatertune.plc import Certificate, Scaling, controller_for
from heatertune.plc.exported import TextSettings
from heatertune.plc.firmware.firmware_pid import FirmwarePid, controller_of, gain_fields, texts_of
from heatertune.plc.firmware.firmware_text import number_of
from heatertune.plc.firmware.parallel import COLD, PARALLEL, TERMS, ParallelParameters
from heatertune.plc.readback import ReadBack
from heatertune.plc.words import WordField

NAME = "firmware-for-the-test"
GAINS = gain_fields(("p", "i", "d"), "M900 {}", "LREAL", ("gain, 1 is full power per °C", "p/TN, per s", "p·TV, s"))
PERIOD = WordField(name="period", address="M901", format="UINT", low=10, high=60000, comment="ms")


def _parameters(values, _assume):
    return ParallelParameters(
        law=TERMS, narrow=False, kp=values["p"], ki=values["i"], kd=values["d"], low=0.0, high=1.0, least=0.0, most=1.0, full=1.0,
        interval=values["period"] / 1000.0)


def _export(words, _certificate):
    return {"test.gcode": "".join(f"{name}={text}\n" for name, text in texts_of(words, (*GAINS, PERIOD)).items())}


def _read(text, _sample_time_s, _source):
    found = {name: number_of(value) for name, value in (line.split("=") for line in text.splitlines())}
    return ReadBack({**found, "period": int(found["period"])})


controller_of(FirmwarePid(
    name=NAME, title="of the test", main_file="test.gcode", can=("all",), cannot=("nothing",), counts=4095,
    inputs={"setpoint": "REAL", "reading": "REAL"}, timer=Timer(shortest_s=0.01, longest_s=60.0, step_s=0.01),
    gains=GAINS, settings=(PERIOD,), full=1.0, usual={}, interval=("period", 0.001), method="of the test",
    law=PARALLEL, cold=COLD, parameters=_parameters, oddities=lambda _values: (), export=_export, text=_read,
    settings_in={"test.gcode": lambda text: TextSettings(_read(text, None, "").values)}))


def _design(gain=2.0, tn=20.0):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=1.0, sample_time_s=0.5, structure=structure_of(tn, 1.0), method="")


def test_a_row_encodes_decodes_exports_and_reads_back():
    controller = controller_for(NAME)
    words = controller.encode(_design(), Scaling())
    assert words.values == {"p": 0.02, "i": 0.001, "d": 0.02, "period": 500}  # by hand: 2 %/°C of 1; p/20 s; p·1 s
    assert words.sample_time_s == 0.5
    back = controller.decode(words)
    assert (back.gain_pct_per_degC, back.integral_time_s, back.derivative_time_s) == pytest.approx((2.0, 20.0, 1.0))
    files = controller.export(words, Certificate(verdict="PASS"))
    assert controller.text(files["test.gcode"], None, "").values == words.values
    assert controller.load_exported(files, controller.assumptions())["test.gcode"]().values == words.values


def test_a_row_runs_its_law():
    # by hand: e = 10 °C: P 0.2, I 0.001·10·0.5 s = 0.005, no change of the reading: 20.5 %
    controller = controller_for(NAME)
    _, scan = controller.step(controller.start(controller.encode(_design(), Scaling()), {}), 50.0, 40.0)
    assert scan.power_pct == pytest.approx(20.5)


def test_what_no_heater_has_is_refused_and_a_missing_part_is_told():
    controller = controller_for(NAME)
    with pytest.raises(NotRepresentable, match="of a heater"):
        controller.encode(_design(gain=-2.0), Scaling())
    words = controller.encode(_design(tn=float("inf")), Scaling())
    assert controller.oddities(words) == ("i is 0: there is no integral part, and an offset remains.",)
    with pytest.raises(OutOfRange, match="word p"):
        controller.decode(type(words)(target=NAME, values={**words.values, "p": 0.0}, scaling=Scaling(), sample_time_s=0.5))
