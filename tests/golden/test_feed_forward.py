"""Z and DISV: the line and its words by hand, by the manual's equation, and in awlsim."""

import struct
from fractions import Fraction

import numpy as np
import pytest
from tests.golden.test_fb41 import _stub, _words

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Scaling, controller_for
from heatertune.plc.feed_forward import feed_forward
from heatertune.plc.targets import TARGETS

OB251, FB41 = controller_for("s5-ob251"), controller_for("fb41")
WITNESS = Certificate(verdict="PASS", lines=("worst of 3 runs",))


def _line(room, **changed):
    # one litre per minute takes 8 % of full power, beyond 1 l/min; the sensor gives 0…5 l/min
    return feed_forward(room.feed, **{"column": "flow", "pct_per_unit": -8.0, "calm": 1.0, "low": 0.0, "high": 5.0} | changed)


def test_zs_units_are_those_of_ya():
    # −(−8 %)·20.47 units/%·(0 − 1) = −163.76 → −164, and ·(5 − 1) = 655.04 → 655
    line = _line(OB251)
    assert (line.at_low, line.at_high) == (-164, 655)
    assert line.pct_per_unit == pytest.approx((655 + 164) / 20.47 / 5.0)
    # 2.5 l/min is count 1023 of 2047: −164 + 819·1023/2047 = 245.3, cut to 245
    assert line.at(2.5, 2047) == 245
    assert (line.at(-1.0, 2047), line.at(9.0, 2047)) == (-164, 655)


def test_z_is_added_to_the_output_as_it_is_where_bit_5_of_the_control_word_is_0():
    # manual: dY = K·(…) + (Z_k − Z_{k−1}); K = 2 acts on XW alone. XW 10: dP = 2·1·10 = 20, dI 0
    design = PidDesign(gain_pct_per_degC=1.0, integral_time_s=np.inf, derivative_time_s=0.0, sample_time_s=10.0,
                       structure="p", method="")
    words = OB251.encode(design, Scaling())
    values = dict(words.values) | {"K": 2048, "R": 1024, "TI": 0}
    rows = [{"W": 1010, "X": 1000, "Z": z} for z in (0, 245, 245, -164)]

    def outputs(given):
        state, found = OB251.start(type(words)(target="s5-ob251", values=given, scaling=Scaling(), sample_time_s=10.0), {}), []
        for row in rows:
            state, scan = OB251.scan(state, row)
            found.append(scan.output)
        return found

    assert values["STEU"] == 0b100001
    assert outputs(values) == [20, 20, 20, 20]
    listened = OB251.feed.listened(values)
    assert listened["STEU"] == 0b000001
    assert outputs(listened) == [20, 265, 265, 0]  # the last is −144, at the lower limit BGUG
    running = OB251.start(type(words)(target="s5-ob251", values=listened, scaling=Scaling(), sample_time_s=10.0), {})
    _, scan = OB251.step(type(running)(OB251.feed.set_disturbance(running.parameters, 245), running.state), 1010, 1000)
    assert scan.output == 265


def test_the_listing_of_z_reads_the_sensor_and_switches_z_on_last():
    (text,) = OB251.feed.listing(_line(OB251), WITNESS).values()
    statements = [line for line in text.splitlines() if not line.startswith("//")]
    assert statements[:3] == ["FB 32", "NAME :FEED", "     :C  DB 30"]
    assert "XA   :DW 24" in statements
    assert statements[-2:] == ["     :RU D 11.5", "     :BE"]
    # RLG:AE, type 6, scales −2048…+2048 units to UGR…OGR, so 0 units is their mean: Z at the sensor's lower end
    ends = {name.strip(): int(value.split()[1]) for name, _, value in (line.partition(":") for line in statements) if "GR" in name}
    assert (ends["OGR"], (ends["OGR"] + ends["UGR"]) / 2) == (655, -164)
    assert "// verdict of the proof: PASS" in text
    assert "// worst of 3 runs" in text


def test_a_contact_gives_one_of_two_words():
    (text,) = OB251.feed.listing(_line(OB251, calm=0.0, high=1.0, switched=True), WITNESS).values()
    assert [line[6:] for line in text.splitlines() if ":L " in line] == ["L  KF +0", "L  KF +164"]


def test_disv_is_percent_and_added_before_the_limits():
    line = _line(FB41)
    assert (line.at_low, line.at_high, line.pct_per_unit) == (-8.0, 32.0, 8.0)
    words = _words(GAIN=0.0, I_SEL=0)
    rows = [{"SP_PER": 0, "PV_PER": 0, "DISV": value} for value in (0.0, 12.0, -8.0)]
    state, outputs = FB41.start(words, {}), []
    for row in rows:
        state, scan = FB41.scan(state, row)
        outputs.append(scan.output)
    assert outputs == [0.0, 12.0, 0.0]
    running = FB41.start(words, {})
    _, scan = FB41.step(type(running)(FB41.feed.set_disturbance(running.parameters, 12.5), running.state), 0.0, 0)
    assert scan.output == 12.5
    assert _line(FB41, pct_per_unit=-8.3).at_low == np.float32(-8.3)  # a REAL keeps its fraction


@pytest.mark.parametrize("counts", [0, 13824, 27648])
def test_fc_41_writes_disv_where_fb41_reads_it(awlsim, counts):
    (text,) = FB41.feed.listing(_line(FB41), WITNESS).values()
    whole = FB41.export(_words(), WITNESS)["fb41_cont_c.awl"].replace("      CALL  FB 41 , DB 41 (\r\n           COM_RST := FALSE",
                                                                      "      CALL  FC 41;\r\n      CALL  FB 41 , DB 41 (\r\n           COM_RST := FALSE")
    assert "CALL  FC 41" in whole
    source = _stub(whole).replace("ORGANIZATION_BLOCK OB 100", f"{text.replace('PIW  258', 'PIW  256')}\r\nORGANIZATION_BLOCK OB 100")
    answer = awlsim(source, [[1, 0, counts, None]], block=41)
    (disv,) = struct.unpack_from(">f", bytes.fromhex(answer["rows"][0]), 68)
    assert disv == _line(FB41).at(5.0 * counts / 27648.0, 27648)
    assert disv == pytest.approx(float(-8 + 40 * Fraction(counts, 27648)), abs=1e-5)


@pytest.mark.parametrize(("changed", "problem", "match"), [
    ({"low": 5.0}, OutOfRange, "disturbance range"),
    ({"calm": 7.0}, OutOfRange, "calm level"),
    ({"high": 50.0}, NotRepresentable, "input Z"),
    ({"pct_per_unit": 0.001}, NotRepresentable, "input Z"),
    ({"low": float("nan")}, OutOfRange, "disturbance range"),
])
def test_a_line_that_z_cannot_hold_is_refused(changed, problem, match):
    with pytest.raises(problem, match=match):
        _line(OB251, **changed)


def test_only_two_controllers_have_an_input_for_it():
    # S7-200, WEG's block and the PID tip have none in their manuals' parameter tables
    assert {name for name in TARGETS if controller_for(name).feed is not None} == {"s5-ob251", "fb41"}
