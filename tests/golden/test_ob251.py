"""OB251 against traces that heatertune did not make: the manual's formulas summed in exact fractions, SciPy's linear answer,
and the figures of the manuals collected in the project's PLC page."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from heatertune.errors import InputError, LogError, NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.dump_reader import realised_design
from heatertune.plc.replay import read_inputs
from heatertune.plc.s5_ob251.export import oddities, to_image
from heatertune.plc.s5_ob251.step import (
    AUTO,
    COLD,
    GESCHW,
    HANDART,
    NO_Z,
    REG_AUS,
    XZ_EIN,
    Ob251Assumptions,
    Ob251Parameters,
    Ob251State,
    call,
)

ROOM = controller_for("s5-ob251")


def _parameters(**changed):
    plain = {"gain": 1.0, "r": 1.0, "ti": 0.0, "td": 0.0, "steu": AUTO | NO_Z, "manual": 0, "upper": 2047, "lower": -2047}
    return Ob251Parameters(**(plain | changed))


def _run(parameters, setpoints, readings, assume=None, **inputs):
    state, states = COLD, []
    for k, (w, x) in enumerate(zip(setpoints, readings, strict=True)):
        state = call(parameters, assume or Ob251Assumptions(), state, w, x, **{name: v[k] for name, v in inputs.items()})
        states.append(state)
    return states


def _design(gain, tn, tv, ta):
    structure = "p" + ("i" if np.isfinite(tn) else "") + ("d" if tv else "")
    return PidDesign(
        gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta, structure=structure, method=""
    )


def _exact(words, errors):
    """Y_k = Σ dY_m of the manual's page, in fractions, with no limits; the D part summed in closed form."""
    k, r, ti = (Fraction(words[name], 1024) for name in ("K", "R", "TI"))
    td, total, out = Fraction(words["TD"]), Fraction(0), []
    padded = [0, 0, *errors]
    for n in range(len(errors)):
        # dD_n = Σ (1/2)^(j+1)·TD·QW_{n−j}
        derivative = sum(
            Fraction(1, 2 ** (j + 1)) * td * (padded[n - j + 2] - 2 * padded[n - j + 1] + padded[n - j])
            for j in range(n + 1)
        )
        total += k * (r * (padded[n + 2] - padded[n + 1]) + ti * errors[n] + derivative)
        out.append(total)
    return out


@pytest.mark.parametrize("words", [
    {"K": 1024, "R": 1024, "TI": 0, "TD": 0}, {"K": 3031, "R": 1024, "TI": 57, "TD": 0},
    {"K": 900, "R": 1024, "TI": 31, "TD": 7}, {"K": -512, "R": 700, "TI": 9, "TD": 2},
], ids=["p", "pi", "pid", "reversed"])
def test_the_recursion_is_the_manuals_sum_of_increments(words):
    errors = [int(e) for e in np.random.default_rng(5).integers(-60, 60, 40)]
    parameters = _parameters(gain=words["K"] / 1024, r=words["R"] / 1024, ti=words["TI"] / 1024, td=float(words["TD"]),
                             upper=10**6, lower=-(10**6))
    states = _run(parameters, errors, [0] * len(errors))
    for state, exact in zip(states, _exact(words, errors), strict=True):
        assert state.total == pytest.approx(float(exact), abs=1e-9)
        assert state.output == int(state.total)


def test_unlimited_it_is_scipys_linear_filter():
    # C(z) = K·[R + TI/(1 − 1/z) + TD/2·(1 − 1/z)/(1 − 1/(2z))]
    rng = np.random.default_rng(1)
    errors = rng.integers(-40, 40, 60)
    k, ti, td = 0.75, 0.125, 3.0
    expected = k * (errors + lfilter([ti], [1, -1], errors) + lfilter([td / 2, -td / 2], [1, -0.5], errors))
    states = _run(_parameters(gain=k, ti=ti, td=td, upper=10**6, lower=-(10**6)), errors.tolist(), [0] * 60)
    assert [s.total for s in states] == pytest.approx(expected, abs=1e-9)


def test_the_derivative_of_a_step_halves_and_of_a_ramp_settles_to_td_times_slope():
    # PLC page 1.1: for TD = 10 a unit step gives 5, 2.5, 1.25 …; a ramp settles to TD·slope
    parameters = _parameters(r=0.0, td=10.0, upper=10**6, lower=-(10**6))
    assert [s.total for s in _run(parameters, [1] * 4, [0] * 4)] == [5.0, 2.5, 1.25, 0.625]
    assert _run(parameters, [3 * k for k in range(60)], [0] * 60)[-1].total == pytest.approx(30.0)


@pytest.mark.parametrize(("ta", "word", "tn"), [(1.0, 3, 341.3), (10.0, 34, 301.2)])
def test_the_words_of_ti_are_those_of_the_plc_page(ta, word, tn):
    words = ROOM.encode(_design(1.0, 300.0, 0.0, ta), Scaling())
    assert words.values["TI"] == word
    assert ROOM.decode(words).integral_time_s == pytest.approx(tn, abs=0.05)


def test_the_word_1000_means_0_9766():
    words = Words(target="s5-ob251", values=dict(_WORDS, K=1000), scaling=Scaling(), sample_time_s=1.0)
    assert ROOM.decode(words).gain_pct_per_degC == pytest.approx(0.9766, abs=5e-5)


_WORDS = {"K": 1024, "R": 1024, "TI": 20, "TD": 0, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0}


@pytest.mark.parametrize(("design", "word", "remedy"), [
    (_design(1.0, 300.0, 0.0, 0.1), "TI", "slower TA"),
    (_design(40.0, 300.0, 0.0, 10.0), "K", "sensor range"),
    (_design(1.6, 300.0, 40.0, 10.0), "K", "sensor range"),
    (_design(1.0, 300.0, 4.0, 10.0), "TD", "faster TA"),
    (_design(1.0, 5.0, 0.0, 60.0), "TI", "faster TA"),
    (_design(1.0, 300.0, 0.0, 0.015), "TA", "0.0"),
    (_design(1.0, 30000.0, 0.0, 700.0), "TA", "600"),
])
def test_what_does_not_fit_is_refused_with_the_nearest_that_would(design, word, remedy):
    with pytest.raises(NotRepresentable, match=f"{word}.*{remedy}"):
        ROOM.encode(design, Scaling())


def test_the_remedy_of_a_ti_word_of_zero_does_fit():
    assert ROOM.encode(_design(1.0, 300.0, 0.0, 0.15), Scaling()).values["TI"] == 1


def test_the_integral_rests_while_the_output_is_at_its_limit():
    # manual 11.2.3: "when the correction information is at a limit, the integral-action component is deactivated"
    parameters = _parameters(gain=1.0, ti=0.5, upper=100)
    states = _run(parameters, [80] * 10, [0] * 10)
    assert [s.output for s in states[:3]] == [100, 100, 100]
    assert states[0].at_limit == 1
    assert states[1].total == states[9].total == 120.0  # 80 + 40, and nothing more
    back = _run(parameters, [80] * 10 + [60], [0] * 11)[-1]
    assert back.total == 100.0  # P takes 20 off at once: no windup to work down


def test_the_output_keeps_both_limits_in_automatic_and_in_manual():
    # table 11-10: "the limiting values are in force in Manual mode"
    for steu in (AUTO | NO_Z, NO_Z):
        parameters = _parameters(gain=5.0, upper=90, lower=-40, steu=steu, manual=500)
        assert {s.output for s in _run(parameters, [100] * 6, [0] * 6)} == {90}
        parameters = parameters._replace(manual=-500)
        assert {s.output for s in _run(parameters, [-100] * 6, [0] * 6)} == {-40}


def test_the_return_from_manual_to_automatic_is_without_a_bump():
    # manual mode keeps XW_{k-1}, so the first automatic call adds K·TI·XW and no P step (manual, bits of STEU)
    manual = _parameters(gain=2.0, ti=0.05, steu=NO_Z, manual=600)
    setpoints, readings = [500] * 8, [400, 410, 420, 430, 440, 450, 450, 450]
    state = COLD
    for w, x in zip(setpoints[:6], readings[:6], strict=True):
        state = call(manual, Ob251Assumptions(), state, w, x)
    assert state.output == 600
    after = call(manual._replace(steu=AUTO | NO_Z), Ob251Assumptions(), state, 500, 450)
    assert after.total == pytest.approx(600.0 + 2.0 * 0.05 * 50.0)


def test_the_integral_stops_at_the_very_limit_and_acts_again_below_it():
    # manual 11.2.3: off "when the correction information is at a limit": Y = 100 + ½·100 = 150 is at it, 149 is not
    for sign in (1, -1):
        at, inside = (_run(_parameters(ti=0.5, upper=150, lower=-150), [sign * e] * 2, [0, 0]) for e in (100, 99))
        assert [(s.total, s.at_limit) for s in at] == [(sign * 150.0, sign)] * 2
        assert [(s.total, s.at_limit) for s in inside] == [(sign * 148.5, 0), (sign * 198.0, sign)]


def test_integral_action_that_leads_back_from_the_limit_stays_on_where_that_is_so():
    # by hand, K = R = 1, TI = ½, limit ±100, XW = 80, 80, −10: Y = 120, then 120 (held), then 120 − 90 and −5 where I acts
    for sign in (1, -1):
        errors, parameters = [sign * e for e in (80, 80, -10)], _parameters(ti=0.5, upper=100, lower=-100)
        for inward, last in ((False, 30.0), (True, 25.0)):
            states = _run(parameters, errors, [0] * 3, Ob251Assumptions(inward_allowed=inward))
            assert [s.total for s in states] == [sign * 120.0, sign * 120.0, sign * last]


def test_manual_mode_forgets_the_derivative():
    # PLC page 1.4: in manual dD_{k−1} = 0 while XW_{k−1} and PW_{k−1} follow. A step of 100: Y = 100 + ½·4·100; two calls
    # of hand (held) and the same XW again: dP = 0, QW = 0, so dD = ½·(0 + 0); kept, it would add ½·200
    steu, states = (AUTO | NO_Z, NO_Z | HANDART, NO_Z | HANDART, AUTO | NO_Z), [COLD]
    for bits in steu:
        states.append(call(_parameters(td=4.0, steu=bits), Ob251Assumptions(), states[-1], 100, 0))
    assert [s.total for s in states[1:]] == [300.0] * 4


def test_the_history_of_xz_rests_while_xz_is_not_looked_at():
    # PLC page 1.4: XZ_{k−1} and PZ_{k−1} follow where bit 1 of STEU is set. TD = 2, XW = 0, XZ = 10: dD = ½·2·10, then
    # ½·(−20 + 10), and halves from there on; forgotten, the last call would see XZ jump by 10 again
    parameters, state, totals = _parameters(r=0.0, td=2.0), COLD, []
    for bits in (XZ_EIN, XZ_EIN, XZ_EIN, 0, XZ_EIN):
        state = call(parameters._replace(steu=AUTO | NO_Z | bits), Ob251Assumptions(), state, 0, 0, 0, 10)
        totals.append(state.total)
    assert totals == [10.0, 5.0, 2.5, 1.25, 0.625]


def test_full_power_is_2047_units_and_the_limits_are_told_as_bits():
    # table 11-11: YA is −2047…+2047
    running = ROOM.start(Words(target="s5-ob251", values=dict(_WORDS, TI=0), scaling=Scaling(), sample_time_s=1.0), {})
    shares = {w: ROOM.scan_all(running.parameters, COLD, {"W": w, "X": 0})[1:] for w in (2047, 1024, 0, -5)}
    assert shares == {2047: (100.0, 2047, 1), 1024: (102400.0 / 2047.0, 1024, 0), 0: (0.0, 0, 2), -5: (0.0, 0, 2)}


def test_the_listing_tells_times_in_the_factor_of_the_manual():
    # footnote of table 11-11: the words are 1/1024. TN = 10 s·512/50, TV = 10 s·3·1024/512, K·R = 1200/1024·½
    words = Words(target="s5-ob251", values=dict(_WORDS, K=1200, R=512, TI=50, TD=3), scaling=Scaling(), sample_time_s=10.0)
    listing = ROOM.export(words, Certificate(verdict="PASS"))["DB30_listing.txt"]
    for told in ("TI TN = 102.4 s", "TD TV = 60 s", "K K·R = 0.58594 units per unit"):
        assert told in listing


@pytest.mark.parametrize(("field", "changes"), [
    ("sum_is_limited", "total"), ("flag_of_same_call", "total"), ("inward_allowed", "total"), ("whole_increments", "total"),
])
def test_every_open_point_changes_something(field, changes):
    setpoints, readings = [80] * 6 + [-7] * 6, [0] * 12
    parameters = _parameters(gain=1.1, ti=0.3, upper=100, lower=0)
    plain = _run(parameters, setpoints, readings)
    other = _run(parameters, setpoints, readings, Ob251Assumptions(**{field: True}))
    assert [getattr(s, changes) for s in plain] != [getattr(s, changes) for s in other]


def test_the_bits_of_steu_do_what_table_11_10_says():
    def outputs(steu, **inputs):
        n = len(next(iter(inputs.values()))) if inputs else 6
        return [s.output for s in _run(_parameters(ti=0.25, td=4.0, steu=steu, manual=800), [100] * n, [0] * n, **inputs)]

    assert outputs(AUTO | NO_Z)[:2] == [100 + 25 + 200, 100 + 50 + 100]
    assert outputs(AUTO | NO_Z | REG_AUS) == [0] * 6
    assert outputs(NO_Z)[2:] == [700, 800, 800, 800]  # halved three times, then YH
    assert outputs(NO_Z)[3] == 800
    assert outputs(NO_Z | HANDART) == [0] * 6
    assert outputs(NO_Z | GESCHW)[0] == 800
    assert outputs(NO_Z | GESCHW | HANDART) == [0] * 6
    # velocity: dY itself; Z feed-forward is not multiplied by K
    assert outputs(AUTO | NO_Z | GESCHW)[1] == 25 - 100
    assert outputs(AUTO, z=[7] * 6)[0] == 325 + 7
    # the derivative of XZ instead of XW
    assert outputs(AUTO | NO_Z | XZ_EIN, xz=[0] * 6)[:2] == [125, 150]


def test_the_image_is_49_words_high_byte_first_at_the_manuals_places():
    # table 11-11: DW1 K, DW3 R, DW5 TI, DW7 TD, DW11 STEU, DW14 BGOG, DW16 BGUG
    words = ROOM.encode(_design(2.96, 306.3, 0.0, 17.0), Scaling())
    image = to_image(words)
    assert len(image) == 98
    assert {n: int.from_bytes(image[2 * n : 2 * n + 2], "big") for n in (1, 3, 5, 7, 11, 14, 16, 22, 48)} == {
        1: 3031, 3: 1024, 5: 57, 7: 0, 11: 33, 14: 2047, 16: 0, 22: 0, 48: 0,
    }
    assert ROOM.read_image(image, sample_time_s=17.0, scaling=Scaling(), source="DB") == words
    assert oddities(words) == ()


def test_a_dump_of_a_running_controller_is_read_and_its_oddities_told():
    cells = [0] * 60
    cells[1], cells[3], cells[5], cells[7], cells[11], cells[14] = -1600 & 0xFFFF, 1000, 6, 4, 0xA530 | 1, 2047
    cells[22], cells[48] = 777, 1500  # inputs and output of the moment
    dump = b"".join(cell.to_bytes(2, "big") for cell in cells)
    words = ROOM.read_image(dump, sample_time_s=10.0, scaling=Scaling(), source="DB")
    assert (words.values["K"], words.values["STEU"]) == (-1600, 0x31)
    told = " ".join(oddities(words))
    for part in ("TI is 6", "8 % of TN", "R is 1000", "K is -1600 with a derivative part"):
        assert part in told
    none = dict(words.values, TI=0, STEU=0b1110, K=100, R=0)
    told = " ".join(oddities(Words(target="s5-ob251", values=none, scaling=Scaling(), sample_time_s=1.0)))
    for part in ("no integral action", "no proportional", "manual mode", "acts on XZ", "switched off", "velocity", "Z is added"):
        assert part in told


def _words(**changed):
    return Words(target="s5-ob251", values=_WORDS | changed, scaling=Scaling(), sample_time_s=10.0)


@pytest.mark.parametrize(("changed", "told"), [
    ({"R": 0}, "R is 0: the controller has no proportional action"), ({"K": 0}, "K is 0: the output never moves"),
    ({"K": 0, "STEU": 1}, "moves by Z alone"), ({"R": -1024}, "R is -1024: the proportional part acts against the others"),
    # 0.001 is 1/1024: I alone adds K·TI = 512/1024·20/1024 = 0.009766 units per unit and call
    ({"R": 0, "K": 512}, "K·TI is 0.009766 units"),
])
def test_what_table_11_11_allows_and_has_no_standard_form_is_read_back_with_its_remark(changed, told):
    words = _words(**changed)
    assert realised_design(ROOM, words) is None
    assert any(told in oddity for oddity in oddities(words))
    with pytest.raises(OutOfRange, match=r"word [KR]"):  # no margins can be judged: it is not proven
        ROOM.decode(words)


def test_negative_and_large_gains_are_read_back_with_their_remark_and_the_large_ones_not_proven():
    cooler = _words(K=-512)
    assert realised_design(ROOM, cooler).gain_pct_per_degC == ROOM.decode(cooler).gain_pct_per_degC == -0.5
    assert any("K is -512" in oddity and "cooler" in oddity for oddity in oddities(cooler))
    assert realised_design(ROOM, _words(K=-1024, R=-1024, TI=0)).gain_pct_per_degC == 1.0  # both signs: P alone acts as usual
    # footnote 1 of table 11-11: larger gains where abrupt changes of the system deviation are sufficiently small
    large = _words(K=2048, TD=3)
    assert realised_design(ROOM, large).gain_pct_per_degC == 2.0
    assert any("K is 2048 with a derivative part" in oddity for oddity in oddities(large))
    with pytest.raises(OutOfRange, match=r"word K = 2048.*small steps"):
        ROOM.decode(large)
    assert realised_design(ROOM, _words(K=2048)).gain_pct_per_degC == 2.0
    with pytest.raises(OutOfRange, match=r"word R = 1501.*-1500…1500"):
        realised_design(ROOM, _words(R=1501, TD=3))
    assert realised_design(ROOM, _words(R=1501)) is not None


@pytest.mark.parametrize("name", ["W", "X", "Z", "XZ", "YH"])
def test_replay_takes_inputs_of_table_11_11_alone(tmp_path, name):
    path = tmp_path / "inputs.csv"
    row = {"W": 0, "X": 0} | {name: 0}
    for value in (-2047, 2047):
        path.write_text(f"{','.join(row)}\n{','.join(str(cell) for cell in (row | {name: value}).values())}\n")
        assert read_inputs(path, ROOM)[0][name] == value
    for value in (-2048, 2048):
        path.write_text(f"{','.join(row)}\n{','.join(str(cell) for cell in (row | {name: value}).values())}\n")
        with pytest.raises(LogError, match=f"line 2, column {name}: no input: '{value}'; expected KF, .* -2047…2047"):
            read_inputs(path, ROOM)


@pytest.mark.parametrize("size", [0, 96, 99])
def test_a_dump_that_is_too_short_or_torn_is_refused(size):
    with pytest.raises(InputError, match=f"DB: {size} bytes; expected 98"):
        ROOM.read_image(bytes(size), sample_time_s=1.0, scaling=Scaling(), source="DB")


def test_the_listing_holds_49_words_and_tells_verdict_and_force():
    words = ROOM.encode(_design(2.96, 306.3, 0.0, 17.0), Scaling())
    files = ROOM.export(words, Certificate(verdict="FAIL", lines=("not kept: ms",), forced=True))
    listing, table = files["DB30_listing.txt"], files["DB30.csv"].splitlines()
    assert "   1:  KF = +03031;" in listing
    assert "  11:  KM = 00000000 00100000;   KM = 00000000 00100001;" in listing  # bit 0: manual, then automatic
    assert "FAIL - FORCED" in listing
    assert "not kept: ms" in listing
    assert [row.split(",")[0] for row in table] == ["DW", *map(str, range(49))]
    assert ROOM.export(words, Certificate(verdict="FAIL", lines=("not kept: ms",), forced=True)) == files


@given(state=st.builds(Ob251State, error=st.floats(-2047, 2047), total=st.floats(-1e4, 1e4), output=st.integers(0, 2047),
                       at_limit=st.sampled_from([-1, 0, 1]), derivative=st.floats(-1e4, 1e4)),
       w=st.integers(0, 2047), x=st.integers(0, 2047))
def test_the_exported_start_up_leaves_the_controller_as_the_proof_starts_it(state, w, x):
    # table 11-10: bit 2 of STEU is "controller off, memory cleared"; the block sets it, calls OB251 and resets it
    words = ROOM.encode(_design(2.0, 100.0, 0.0, 2.0), Scaling())
    listing = ROOM.export(words, Certificate(verdict="PASS", lines=()))["program_listing.txt"]
    block = listing.partition("NAME :START\n")[2].partition("\n\n")[0].split("\n")
    assert [line.partition(";")[0].strip(" :") for line in block][:5] == [
        "C  DB 30", "SU D 11.2", "JU OB 251", "RU D 11.2", "C  DB 31"]
    running = ROOM.start(words, {})
    steu = words.whole["STEU"]
    cleared, power, *_ = ROOM.scan_all(running.parameters, state, {"W": w, "X": x, "STEU": steu | REG_AUS})
    assert (cleared, power) == (running.state, 0.0)
    assert running.state == COLD
