"""One call from any state, with any words, inputs and settings, against a second implementation of each controller.

The states and words are drawn from values at and beside the limits, so that each comparison and each branch is met on
both of its sides. OB251 is summed in exact fractions; REALs are NumPy's single precision.
"""

import math
import random
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.fb41 import step as fb41
from heatertune.plc.on_off import controller as on_off
from heatertune.plc.s5_ob251 import step as ob251
from heatertune.plc.s7_300 import step as tip
from heatertune.plc.weg import step as weg

F = np.float32


def _ob251(p, s, a, w, x, z, xz):
    """The manual's page (S5-115U, 11.2.3, tables 11-10 and 11-11): KM of DW11 bit by bit, all sums in fractions."""
    auto, of_xz, off, velocity, hold, no_z = (p.steu >> bit & 1 for bit in range(6))
    if off:  # DW18 to DW48 are cleared
        return (0,) * 10
    xw = Fraction(w - x)
    pw = xw - Fraction(s.error)
    xz_old, pz_old = Fraction(s.substitute), Fraction(s.substitute_change)
    xz_new, pz_new = (Fraction(xz), xz - xz_old) if of_xz else (xz_old, pz_old)
    qu = pz_new - pz_old if of_xz else pw - Fraction(s.error_change)
    z_new = Fraction(s.disturbance) if no_z else Fraction(z)
    if not auto:
        if velocity:
            ya, calls = (0 if hold else p.manual), s.approach
        elif hold:
            ya, calls = s.output, s.approach
        else:  # halved three times, each cut to whole units, then YH
            ya = p.manual if s.approach >= 3 else math.trunc(Fraction(p.manual + s.output, 2))
            calls = 4 if s.approach >= 3 else s.approach + 1
        ya = sorted((p.lower, ya, p.upper))[1]
        return (xw, pw, xz_new, pz_new, 0, z_new, ya, ya, 0, calls)
    dd = (Fraction(p.td) * qu + Fraction(s.derivative)) / 2
    k = Fraction(p.gain)
    without_i = k * Fraction(p.r) * pw + k * dd + z_new - Fraction(s.disturbance)
    with_i = without_i + k * Fraction(p.ti) * xw
    before = Fraction(0) if velocity else Fraction(s.total)

    def cut(increment):
        return Fraction(math.trunc(increment)) if a.whole_increments else increment

    def side(y):
        return (1 if y >= p.upper else 0) - (1 if y <= p.lower else 0)

    flag = side(before + cut(with_i)) if a.flag_of_same_call else s.at_limit
    leads_out = (with_i - without_i) * flag > 0
    y = before + cut(without_i if flag != 0 and (leads_out or not a.inward_allowed) else with_i)
    limited = sorted((Fraction(p.lower), y, Fraction(p.upper)))[1]
    return (xw, pw, xz_new, pz_new, dd, z_new, limited if a.sum_is_limited else y, math.trunc(limited), side(y), 0)


def test_ob251_from_any_state_is_the_manuals_page_in_fractions():
    rng = random.Random(1)

    def one_of(*values):
        return rng.choice(values)

    for _ in range(1500):
        upper, lower = one_of((100, -100), (100, 0), (2047, 0), (-5, -5), (2047, -2047))
        gain, r, ti = (n / 1024 for n in (one_of(1024, -512, 3031, 0), one_of(1024, 700, -1, 0), one_of(0, 57, 512, 1)))
        p = ob251.Ob251Parameters(gain, r, ti, float(one_of(0, 1, 7)), rng.randrange(64), one_of(-7, 3, 60, 500), upper, lower)
        state = ob251.Ob251State(
            float(one_of(-40, 0, 33, 80)), float(one_of(-3, 0, 5)), float(one_of(-9, 0, 10)), float(one_of(-2, 0, 4)),
            one_of(-1.5, 0.0, 12.25), float(one_of(-4, 0, 7)), one_of(-100.0, 0.0, 37.5, 100.0, 99.5, 120.0), one_of(-11, 0, 33, 100),
            one_of(-1, 0, 1), rng.randrange(5))
        assume = ob251.Ob251Assumptions(*(rng.random() < 0.5 for _ in range(4)))
        w, x, z, xz = one_of(0, 50, 80), one_of(0, 50, 81), one_of(-4, 0, 9), one_of(-9, 0, 10)
        found = ob251.call(p, assume, state, w, x, z, xz)
        assert [*map(Fraction, found)] == [*_ob251(p, state, assume, w, x, z, xz)], (p, state, assume, w, x, z, xz)
        scanned = ob251.step((p._replace(z=z), assume), state, w, x, False)[0]
        assert [*map(Fraction, scanned)] == [*_ob251(p, state, assume, w, x, z, 0)]
        assert ob251.call(p, assume, state, w, x) == ob251.call(p, assume, state, w, x, p.z, 0) == ob251.step((p, assume), state, w, x, True)[0]


class _Unit:
    """Floating-point math of an S7-300 (STL reference manual) in NumPy: below the normal numbers 0, OS kept once set."""

    def __init__(self, os=False):
        self.os = os

    def _told(self, value, *, nothing):
        if abs(value) < F(2.0**-126):
            self.os |= not nothing
            return F(0.0)
        self.os |= not np.isfinite(value)
        return value

    def add(self, a, b):
        return self._told(F(a) + F(b), nothing=bool(F(a) == -F(b)))

    def sub(self, a, b):
        return self.add(a, -F(b))

    def mul(self, a, b):
        return self._told(F(a) * F(b), nothing=bool(F(a) == 0 or F(b) == 0))

    def div(self, a, b):
        return self._told(F(a) / F(b), nothing=bool(F(a) == 0 or np.isinf(F(b))))


def _fb41(p, s, a, sp, pv, os):
    """CONT_C's diagram with the statics of its re-implementations, one operation of the unit a line."""
    u = _Unit(os)
    er = u.sub(sp, pv)
    er = u.sub(er, p.dead_band) if er > p.dead_band else u.add(er, p.dead_band) if er < -F(p.dead_band) else F(0)
    e = u.mul(er, p.gain)
    part_p = e if p.p_sel else F(0)
    half = u.mul(p.cycle, 0.5)
    part_i = rest_i = part_d = rest_d = F(0)
    feed = e
    if p.i_sel and p.i_itl_on:
        part_i = F(p.initial)
    elif p.i_sel and p.man_on:
        part_i = u.sub(u.sub(s.limited, part_p), p.disturbance)
    elif p.i_sel:
        mean = e if a.rectangle else u.mul(u.add(e, s.before), 0.5)
        change = u.add(u.mul(u.div(p.cycle, np.fmax(F(p.ti), half)), mean), s.integral_rest)
        if p.int_hold or (change > 0 and s.at_upper) or (change < 0 and s.at_lower):
            change = F(0)
        part_i = u.add(s.integral, change)
        rest_i = u.add(u.sub(s.integral, part_i), change)
    if p.d_sel and not p.man_on:
        td, lag = np.fmax(F(p.td), F(p.cycle)), np.fmax(F(p.tm_lag), half)
        part_d = u.mul(u.sub(e, s.feedback), u.div(td, u.add(p.cycle if a.whole_cycle else half, lag)))
        back = u.add(u.mul(u.div(p.cycle, td), part_d), s.feedback_rest)
        feed = u.add(back, s.feedback)
        rest_d = u.add(u.sub(s.feedback, feed), back)
    total = u.add(u.add(u.add(part_p, part_i), part_d), p.disturbance)
    if p.man_on:
        total = F(p.manual)
    elif p.i_sel and not p.i_itl_on and not a.only_held:
        part_i = _led_back(u, p, part_i, total, u.sub(total, s.derivative))
    high, low = bool(total >= p.upper), bool(total <= p.lower and not total >= p.upper)
    lmn = F(p.upper if high else p.lower if low else total)
    output = u.add(u.mul(lmn, p.lmn_factor), p.lmn_offset)
    return (part_i, e, part_d, feed, rest_i, rest_d, lmn, high, low, output, bool(u.os))


def _led_back(u, p, part_i, total, without_d):
    for sign, limit in ((1, p.upper), (-1, p.lower)):
        room = u.sub(limit, p.disturbance)
        if sign * part_i > sign * room and sign * total > sign * limit and sign * without_d > sign * limit:
            own, beyond = u.sub(part_i, room), u.sub(total, limit)
            return u.sub(part_i, own if sign * own < sign * beyond else beyond)
    return part_i


def _reals(rng, *often):
    """Return what draws a number that single precision holds: now and then one at the ends of its range."""
    ends = (0.0, 1e-38, -1e-38, 2e-38, 3e38, -3e38)
    return lambda: float(F(rng.choice(ends) if rng.random() < 0.02 else rng.choice(often)))


def test_cont_c_from_any_state_is_its_diagram_in_numpys_single_precision():
    rng = random.Random(2)
    error, part, limit = _reals(rng, -50.0, -4.0, 0.0, 0.1, 4.0, 50.0), _reals(rng, -120.0, -3.3, 0.0, 0.7, 100.0, 120.0), _reals(rng, 100.0, 60.0)
    rest = _reals(rng, -1e-6, 0.0, 3e-6)

    def time(*more):  # a TIME of whole ms, as REAL in s
        return float(F(rng.choice((0.001, 0.3, 1.0, 2.5, 20.0, *more))))

    for _ in range(500):
        p = fb41.ContCParameters(
            time(), _reals(rng, 1.0, -2.0, 0.37)(), time(0.0), time(0.0), time(0.0), _reals(rng, 0.0, 4.0, 1.3)(), limit(),
            _reals(rng, 0.0, -100.0, -20.0)(), rng.choice((1.0, 2.5, 3e38)), rng.choice((0.0, -50.0)), _reals(rng, 1.0, 3.0)(), _reals(rng, 0.0, -1.0)(), part(),
            _reals(rng, 0.0, 7.25, -4.0)(), part(), *(rng.random() < share for share in (0.2, 0.8, 0.8, 0.2, 0.2, 0.6)))
        state = fb41.ContCState(part(), error(), part(), error(), rest(), rest(), part(), *(rng.random() < 0.3 for _ in range(2)))
        assume = fb41.ContCAssumptions(*(rng.random() < 0.3 for _ in range(3)))
        sp, pv, os = error(), error(), rng.random() < 0.1
        with np.errstate(all="ignore"):
            expected = _fb41(p, state, assume, sp, pv, os)
        found = fb41.call(p, assume, state, sp, pv, os)
        assert _plain(found) == _plain(expected), (p, state, assume, sp, pv)
        raw_sp, raw_pv = rng.choice((-32768, 0, 5000)), rng.choice((0, 5000, 13824, 32767))
        with np.errstate(all="ignore"):
            (sp, _), (pv, os) = _normalised(p, raw_sp), _normalised(p, raw_pv)
            expected = _fb41(p, state, assume, sp, pv, os)
        assert _plain(fb41.step((p, assume), state, raw_sp, raw_pv, False)[0]) == _plain(expected), (p, state, assume, raw_sp, raw_pv)
        assert _plain(fb41.scan((p, assume), state, {"SP_PER": raw_sp, "PV_PER": raw_pv})[0]) == _plain(expected)


def _normalised(p, raw):
    """PV_PER·100/27648·PV_FAC + PV_OFF, and OS after it."""
    u = _Unit()
    return u.add(u.mul(u.div(u.mul(raw, 100.0), 27648.0), p.pv_factor), p.pv_offset), bool(u.os)


def _plain(numbers):
    """Return bits and numbers as text, in which what is no number is itself; a zero has no sign."""
    return [repr(bool(n)) if isinstance(n, bool | np.bool_) else repr(float(n) + 0.0) for n in numbers]


def _tip(p, s, a, raw_sp, raw_pv):
    """The tip's formulas 2.1 to 2.9, one operation of the unit a step."""
    u = _Unit()
    sp, pv = u.div(raw_sp, 27648), u.div(raw_pv, 27648)
    before = s.reading if s.started or a.starts_at_zero else pv
    gain = F(1) if p.gain == 0 else F(p.gain)
    ci = F(0) if p.reset == 0 else u.mul(u.div(p.sample, p.reset), gain)
    cd = u.mul(u.div(p.rate, p.sample), gain)
    error = u.sub(sp, pv)
    mp = u.mul(p.gain, error)
    mi = u.add(u.mul(ci, error), s.bias)
    md = u.mul(cd, u.sub(before, pv))
    output, other = u.add(u.add(mp, mi), md), u.add(mp, md)
    inside = bool(output >= 0) and bool(output <= 1)
    bias = mi if inside else u.sub(1 if output > 1 else 0, other)
    if not inside or a.bias_always_clamped:
        bias = _within(bias)
    scaled = u.mul(_within(output), 27648)
    return (bias, pv, True, int(scaled) if a.truncates else int(np.rint(scaled)), bool(u.os))


def _within(value):
    return F(1) if value > 1 else value if value > 0 else F(0)


def test_the_tip_from_any_state_is_its_formulas_in_numpys_single_precision():
    rng = random.Random(3)
    share = _reals(rng, -0.3, 0.0, 0.25, 0.75 / 27648, 0.999, 1.0, 1.7)
    gain, time = _reals(rng, 0.0, 1.0, 2.5, -0.7, 11.0), _reals(rng, 0.0, 1000.0, 4000.0, 333.3)
    for _ in range(1500):
        p = tip.PidTipParameters(gain(), time(), time(), _reals(rng, 1000.0, 4999.0)())
        state = tip.PidTipState(share(), share(), rng.random() < 0.7)
        assume = tip.PidTipAssumptions(*(rng.random() < 0.5 for _ in range(3)))
        sp, pv = (rng.choice((-32768, 0, 1, 10368, 13824, 27648, 32767)) for _ in range(2))
        with np.errstate(all="ignore"):
            expected = _tip(p, state, assume, sp, pv)
        assert _plain(tip.call(p, assume, state, sp, pv)) == _plain(expected), (p, state, assume, sp, pv)
        assert _plain(tip.step((p, assume), state, sp, pv, False)[0]) == _plain(expected)


def test_a_call_of_the_tip_in_manual_sets_the_bias_to_out_and_keeps_os():
    for out in (-5, 0, 9999, 27648, 32767):
        after = tip.manual(tip.PidTipState(0.3, 0.2, False, 7, True), 13824, out)
        assert (after.bias, after.reading, after.started, after.output, after.overflow) == (
            float(F(min(max(out, 0), 27648)) / F(27648)), 0.5, True, out, False)
    assert tip.manual(tip.PidTipState(output=13824), 0).bias == 0.5


def _weg_block(v, a):
    ts, tau = F(v["Ts"]) / F(1000), F(v["TauSetPoint"])
    kp, ki_ts, kd_by_ts = F(v["Kp"]), F(v["Ki"]) * ts, F(v["Kd"]) / ts
    share = F(1) - F(math.exp(-float(ts / tau)) if tau else 0.0) if a.exact_filter else ts / (tau + ts)
    form = v["Type"] == 1
    return {"share": share, "kp": kp, "ki_ts": ki_ts, "kd_by_ts": kd_by_ts, "form": form,
            "now": ((kp if form else F(1)) + ki_ts) + kd_by_ts, "growth": ki_ts if form else kp * ki_ts}


def _weg(v, a, s, x):
    """One call; a block that keeps Ts itself may let every second one pass."""
    if a.sampling != weg.SKIPPED:
        return (*_weg_computed(v, a, s, x), False)
    return (*s[:6], False) if s.skips and x.enable else (*_weg_computed(v, a, s, x), x.enable)


def _weg_computed(v, a, s, x):
    """The CFW501's equation and the sentences of the help (EN, limits, ManualSetPoint), in single precision."""
    b, low, high = _weg_block(v, a), F(v["MinimumOutput"]), F(v["MaximumOutput"])

    def limited(value):
        return low if not value >= low else high if value > high else value

    if not x.enable:
        return (False, *s[1:5], False)
    edge = not s.enabled
    old = s
    if edge:
        old = weg.WegState(True, 0.0 if a.zero_history else x.setpoint)
    filtered = F(old.reference) + b["share"] * (F(x.setpoint) - F(old.reference))
    e = F(x.feedback) - filtered if v["Action"] == 1 else filtered - F(x.feedback)
    by_hand = F(x.manual) if a.manual_unlimited and np.isfinite(x.manual) else limited(F(x.manual))
    if not np.isfinite(e):
        return (s.enabled, s.reference, s.error, s.integral, by_hand if x.select_manual else low, True)
    past = e if edge and not a.zero_history else F(old.error)
    if edge and not a.runs_at_once:
        return (True, old.reference, past, 0.0, 0.0, False)
    i = F(old.integral)
    if x.select_manual and not a.bumpless:
        return (True, old.reference, past, i, by_hand, False)
    if x.select_manual:
        led = by_hand - b["kp"] * e
        return (True, filtered, e, led if np.isfinite(led) else i, by_hand, False)
    return _weg_automatic(b, a, old, filtered, e, past, limited)


def _weg_automatic(b, a, old, filtered, e, past, limited):
    i, more = F(old.integral), b["growth"] * e
    if a.by_parts:
        d = b["kd_by_ts"] * (e - past)
        u = (b["kp"] * e + (i + more)) + (d if b["form"] else b["kp"] * d)
    else:
        bracket = b["now"] * e - b["kd_by_ts"] * past
        u = i + (bracket if b["form"] else b["kp"] * bracket)
    output, led = limited(u), i + more
    if a.anti_windup == weg.FREEZE and output != u:
        led = i
    elif a.anti_windup == weg.CLAMP and b["ki_ts"] != 0:
        led = np.fmin(np.fmax(led, limited(F(-np.inf)) - b["kp"] * e), limited(F(np.inf)) - b["kp"] * e)
    return (True, filtered, e, led if np.isfinite(led) else i, output, not np.isfinite(u))


def test_wegs_block_from_any_state_is_its_equation_in_numpys_single_precision():
    rng = random.Random(4)
    number, gain = _reals(rng, -20.0, 0.0, 0.1, 4.0, 50.0, 100.0), _reals(rng, 0.0, 1.0, 0.37, 2.5)
    for _ in range(2500):
        low, high = rng.choice(((0.0, 100.0), (5.0, 60.0), (50.0, 50.0)))
        words = {"Kp": abs(gain()), "Ki": abs(gain()), "Kd": abs(gain()), "TauSetPoint": abs(_reals(rng, 0.0, 0.7, 3.0)()),
                 "MinimumOutput": low, "MaximumOutput": high, "Type": rng.randrange(2), "Action": rng.randrange(2),
                 "Ts": rng.choice((50, 333, 1000, 65535))}
        assume = weg.WegAssumptions(rng.randrange(3), *(rng.random() < 0.4 for _ in range(6)), rng.randrange(3))
        skips = assume.sampling == weg.SKIPPED and rng.random() < 0.3
        state = weg.WegState(rng.random() < 0.8, number(), number(), number(), number(), rng.random() < 0.2, skips)
        broken = rng.choice((math.nan, math.inf, -math.inf))
        feedback, manual = (broken if rng.random() < 0.05 else number() for _ in range(2))
        inputs = weg.WegInputs(number(), feedback, manual, rng.random() < 0.3, rng.random() < 0.9)
        with np.errstate(all="ignore"):
            expected = _weg(words, assume, state, inputs)
        found = weg.call(weg.block_of(words, assume), assume, state, inputs)
        assert _plain(found) == _plain(expected), (words, assume, state, inputs)
        if inputs.enable and not inputs.select_manual:
            by_step = weg.step((weg.block_of(words, assume), assume), state, inputs.setpoint, inputs.feedback, False)[0]
            assert _plain(by_step) == _plain(expected), (words, assume, state, inputs)


def _two_level(band, is_on, w, x):
    """Example 3 as printed, SP and BAND in the registers of a 16-bit unit that tells a sum beyond them by its overflow."""
    upper, lower = np.int16(w), np.int16(w)
    with np.errstate(over="ignore"):
        upper, lower = upper + np.int16(band), lower - np.int16(band)
    off = int(x) > int(upper)
    overflow = int(upper) != w + band or (not off and int(lower) != w - band)
    is_on = not off and (is_on or int(x) < int(lower))
    return is_on, 100.0 if is_on else 0.0, int(is_on), int(overflow)


def test_on_off_from_either_state_is_example_3_by_its_listing_and_without_it():
    rng = random.Random(5)
    ends = (-32768, -32767, -20, 0, 1, 2000, 32747, 32748, 32767)
    room = controller_for("on-off")
    for _ in range(400):
        band, was_on, w = rng.choice((1, 20, 2047)), rng.random() < 0.5, rng.choice(ends)
        x = (w + rng.choice((-1, 1)) * band + rng.choice((-1, 0, 1)) + 2**15) % 2**16 - 2**15
        expected = _two_level(band, was_on, w, x)
        memory, *found = on_off.step(band, on_off.OnOffState(was_on), w, x, False)
        assert (memory.is_on, *found) == expected, (band, was_on, w, x)
        words = Words(target="on-off", values={"BAND": band}, scaling=Scaling(), sample_time_s=1.0)
        begun, _ = room.step(room.start(words, {}), 2500, 0 if was_on else 4095)
        scan = room.step(begun, w, x)[1]
        assert (scan.power_pct, scan.output, scan.flags) == (*expected[1:3], {"overflow": bool(expected[3]), "endless": False}), (band, was_on, w, x)


@pytest.mark.parametrize(("target", "values", "inputs", "left_out"), [
    ("s5-ob251", {"K": 1024, "R": 1024, "TI": 512, "TD": 3, "W": 0, "STEU": 3, "YH": 0, "BGOG": 2047, "BGUG": -2047}, {"W": 50, "X": 20},
     {"Z": 0, "XZ": 0, "YH": 0, "STEU": 3}),
    ("fb41", {"D_SEL": 1, "MAN": 30.0, "DISV": 2.0}, {"SP_PER": 9000, "PV_PER": 5000}, {"MAN_ON": 0, "MAN": 30.0, "DISV": 2.0, "INT_HOLD": 0, "COM_RST": 0}),
    ("s7-300", {}, {"SP": 9000, "PV": 5000}, {"mode_req": 1}), ("s7-300", {}, {"SP": 9000, "PV": 5000, "mode_req": 0}, {"OUT": 0}),
    ("weg", {}, {"SetPoint": 50.0, "Feedback": 20.0}, {"ManualSetPoint": 0.0, "SelectSetPoint": 0, "EN": 1}),
    ("weg", {}, {"SetPoint": 50.0, "Feedback": 20.0, "SelectSetPoint": 1}, {"ManualSetPoint": 0.0, "EN": 1}),
])
def test_inputs_that_are_not_named_are_those_of_the_words_and_else_those_of_automatic(target, values, inputs, left_out):
    room = controller_for(target)
    design = PidDesign(gain_pct_per_degC=1.0, integral_time_s=20.0, derivative_time_s=8.0, sample_time_s=2.0, structure="pid", method="")
    words = room.encode(design, Scaling())
    words = replace(words, values={**words.values, **values})
    state = other = room.start(words, {})
    for _ in range(3):
        state, told = room.scan(state, inputs)
        other, same = room.scan(other, inputs | left_out)
        assert (state, told) == (other, same)


def test_every_memory_is_cleared_at_first():
    # DW18 to DW48 (table 11-10), and the statics of a new instance block
    assert tuple(ob251.COLD) == (0,) * 10
    assert tuple(fb41.ContCState()) == (0,) * 11
    assert fb41.ContCState() == fb41.restart(controller_for("fb41").start(_fb41_words(), {}).parameters[0])
    assert tuple(tip.COLD) == (0.0, 0.0, False, 0, False)
    assert tuple(weg.COLD) == (False, 0.0, 0.0, 0.0, 0.0, False, False)
    assert on_off.OnOffState() == (False,)


def _fb41_words():
    design = PidDesign(gain_pct_per_degC=1.0, integral_time_s=20.0, derivative_time_s=0.0, sample_time_s=2.0, structure="pi", method="")
    return controller_for("fb41").encode(design, Scaling())


def test_power_is_0_to_100_percent_of_the_output_and_flags_are_bits():
    # full power is 2047 units, 27648, or 100 %; the lowest bit is the first flag
    for output, power in ((-5, 0.0), (0, 0.0), (512, 51200.0 / 2047.0), (2047, 100.0), (2100, 100.0)):
        for side, bits in ((1, 1), (0, 0), (-1, 2)):
            assert ob251._outcome(ob251.Ob251State(output=output, at_limit=side))[1:] == (power, output, bits)
    for output, power in ((-5, 0.0), (6912, 25.0), (27648, 100.0), (32767, 100.0)):
        assert [tip._outcome(tip.PidTipState(output=output, overflow=over))[1:] for over in (False, True)] == [(power, output, 0), (power, output, 1)]
    for output, power in ((-60.0, 0.0), (0.5, 0.5), (99.5, 99.5), (300.0, 100.0)):
        for upper, lower, over, bits in ((False, False, False, 0), (True, False, False, 1), (False, True, True, 6), (False, False, True, 4), (True, False, True, 5)):
            state = fb41.ContCState(output=output, at_upper=upper, at_lower=lower, overflow=over)
            assert fb41.outcome(state)[1:] == (power, output, bits)
    words = {"Kp": 1.0, "Ki": 0.0, "Kd": 0.0, "TauSetPoint": 0.0, "MinimumOutput": 5.0, "MaximumOutput": 60.0, "Type": 0, "Action": 0, "Ts": 1000}
    block = weg.block_of(words, weg.WegAssumptions())
    for output, power, bits in ((-5.0, 0.0, 2), (5.0, 5.0, 2), (5.5, 5.5, 0), (60.0, 60.0, 1), (100.5, 100.0, 1)):
        assert [weg._outcome(block, weg.WegState(overflow=over), output)[1:] for over in (False, True)] == [(power, output, bits), (power, output, bits + 4)]
    assert weg.WegInputs(1.0, 2.0) == (1.0, 2.0, 0.0, False, True)
