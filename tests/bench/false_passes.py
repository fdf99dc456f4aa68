"""How many PASSes does a second, longer simulation not confirm? Random heaters, words and conditions.

    python tests/bench/false_passes.py --count 500
    python tests/bench/false_passes.py --first 500 --count 500 --targets s5-ob251 weg --keep cases.jsonl

Each case is drawn from its number alone: heater, controller with one setting of each of its open points, words of a rule
that is detuned at random, sensor range, limits, setpoint, switch and noise; from 100,000 on also presets, limits of every
kind, two ends of the setpoints and ramps with a holdback, from 1,000,000 on limits of the output and burst firing, from
2,000,000 on profiles with limits of their own, and words that were made for another heater, from 3,000,000 on boosts, those of
heatertune and any, from 6,000,000 on heaters of printers no slower than those are. heatertune proves the words. Where no limit
of the runs is broken, second_opinion.c runs the whole story again, and then its rests for 50 stories more, to see what
hunts or drifts later; a short story is measured in steps of a millisecond, too. A false PASS breaks a limit by more than
0.1 %. Whatever the verdict, all that both measure in the story has to be the same but for close calls (close_calls.py).
What differs is printed as a line of JSON; exit status 1 where something does.

A PASS with noise says that at least 95 % of all draws of the noise keep every limit, with 95 % confidence: the judge runs
the story with 40 draws of its own. At most 5 of 100 such PASSes may have a larger share than 5 % of draws that break a
limit; how many have is printed at the end. What a noisy rest does in five stories more is told, and is none of that claim: the
largest of more noise is larger.
"""

import argparse
import json
import math
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune.errors import HeatertuneError
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.pid.sampled_loop import margins
from heatertune.plc import Boost, Scaling, controller_for
from heatertune.proof import Acceptance, Coverage, prove_models
from heatertune.proof.prove_words import actuator_for, course_for, limits_of
from heatertune.proof.specification import PRESETS, specification_of
from heatertune.settings import Conditions
from tests.bench.close_calls import apart, by_a_hair, differ, named
from tests.bench.second_opinion import (
    OWN_PULSES,
    SWITCHES,
    TARGETS,
    Bench,
    compiled,
    ends_of,
    in_plain_steps,
    opinion,
    story,
)

SLACK = 1e-3
_PRESETS = [name for name in PRESETS if name != "paper"]  # whose story is another one
LONGER = 50.0
_MOST_PULSES = 2e8  # of one case: minutes; where a story has so many, its rests go on for fewer stories, which is told
_LONGER_NOISY = 5.0
_DRAWS = 40  # of a noise that the proof has not seen
_FIRST_DRAW = 1_000
_TOO_MANY = 0.05  # of them may break a limit
_OF_WORDS = {"stability", "ms", "gain_margin", "phase_margin", "step_power"}
_FLAGS = "overflow"  # of which the judge knows what is no number alone
_WIDE = 100_000  # from this case on more is drawn, those before stay as they were
_WIDER = 1_000_000  # and from this on again
_ALONG = 2_000_000  # and again
_BOOSTED = 3_000_000  # and again
_AS_PRINTERS = 6_000_000  # from this on, of targets whose interval is a fraction of a second
_PRINTERS = ("klipper", "marlin")
_SLOWEST_S = 7200.0, 600.0
_PLAIN_STEPS_S = (1e-3, 1e-4)  # the shorter where a ripple grazes the band for less than the longer
_PLAIN_S = 40_000.0  # a story so long is measured in such steps, too


def _log(rng, low, high):
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def drawn(number, target):
    """Return (model, words, bench, conditions) of a case; raise HeatertuneError where no words fit."""
    rng = np.random.default_rng([number, TARGETS[target][0]])
    slowest = _SLOWEST_S[number >= _AS_PRINTERS and target in _PRINTERS]
    gain, lag, ambient = _log(rng, 0.1, 10.0), _log(rng, 10.0, slowest), float(rng.uniform(5.0, 30.0))
    lags = (lag,) if rng.random() < 0.5 else (lag, lag * float(rng.uniform(0.02, 1.0)))
    dead = sum(lags) * _log(rng, 0.02, 1.5)
    setpoint = ambient + gain * float(rng.uniform(10.0, 92.0))
    step = setpoint - ambient
    low = float(rng.choice([0.0, -50.0]))
    high = max(setpoint * _log(rng, 1.05, 2.5), setpoint + 0.22 * step)
    made_for = _another(number, gain, lags, dead, target) if number >= _ALONG else (gain, lags, dead)
    design = _design(rng, *made_for[:2], made_for[2] + TARGETS[target][2], target)
    words = controller_for(target).encode(design, Scaling(low_degC=low, high_degC=high))
    if rng.random() < 0.15:
        words = _ramped(words, step / (sum(lags) + dead) * 60.0 / _log(rng, 0.3, 4.0))
    band = step * _log(rng, 0.005, 0.08)
    noise = 0.0 if rng.random() < 0.5 else band * float(rng.uniform(0.02, 0.25))
    settings = {name: str(rng.choice(choices)) for name, choices in SWITCHES[target].items()}
    switch = _switch(rng, words.sample_time_s, target)
    if target == "pband":
        words, switch = _cycled(words, switch)
    kwargs = {"gain_degC_per_pct": gain, "time_constant_s": lags[0], "dead_time_s": dead, "ambient_degC": ambient}
    model = Fopdt(**kwargs) if len(lags) == 1 else TwoLag(**kwargs, second_time_constant_s=lags[1])
    bench = Bench(
        gain=gain, lags=lags, dead=dead, ambient=ambient, target=target, words=dict(words.values), low=low, high=high,
        interval=words.sample_time_s, settings=settings, setpoint=setpoint, tolerance=band, noise=noise, seed=0,
        ramp=_of_ramp(words), **switch)
    pwm = {} if target in OWN_PULSES else {
        "pwm_period_s": bench.period, "minimum_on_s": bench.least_on, "minimum_off_s": bench.least_off,
        "pwm_resolution_s": bench.resolution, "pwm_rule": "pid-compact" if bench.carries else None}
    known = {switch.name: switch.default for switch in controller_for(target).switches} | settings
    conditions = Conditions(
        setpoint_degC=setpoint, limit=_own_limits(rng), tolerance_degC=band, noise_degC=noise, switches=known, **pwm)
    if number >= _WIDE:
        words, bench, conditions = _widened(number, words, bench, conditions)
    if number >= _WIDER:
        words, bench, conditions = _switched_otherwise(number, words, bench, conditions)
    if _ALONG <= number < _BOOSTED:
        bench, conditions = _led(number, bench, conditions)
    if number >= _BOOSTED:
        words, bench = _boosted(number, words, bench)
    return model, words, bench, conditions


def _another(number, gain, lags, dead, target):
    """Return a heater that differs from the case's by up to a half, in one case of two; else the same."""
    rng = np.random.default_rng([number, TARGETS[target][0], 3])
    if rng.random() < 0.5:
        return gain, lags, dead
    return gain * _log(rng, 0.67, 1.5), tuple(lag * _log(rng, 0.67, 1.5) for lag in lags), dead * _log(rng, 0.67, 1.5)


def _design(rng, gain, lags, dead, target):
    """Return SIMC's PI or PID, detuned."""
    first, second = lags[0], lags[1] if len(lags) > 1 else 0.0
    pid = rng.random() < 0.4
    if not pid:
        first, dead, second = first + second / 2.0, dead + second / 2.0, 0.0
    slow = dead * _log(rng, 0.7, 5.0) + 0.02 * first
    k = first / gain / (slow + dead) * _log(rng, 0.5, 1.3)
    tn = min(first, 4.0 * (slow + dead)) * _log(rng, 0.7, 2.0)
    tv = max(second, dead / 3.0) * _log(rng, 0.3, 1.2) if pid else 0.0
    room = controller_for(target)
    ta = room.timer.round((slow + dead) / 10.0 * _log(rng, 0.2, 2.0))
    if target == "s5-ob251" and tv:
        tv = ta * max(1, round(tv / ta))
    return PidDesign(gain_pct_per_degC=k, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="", derivative_filter=room.derivative_filter)


def _switch(rng, ta, target):
    if target.startswith("s7-200"):  # of TA
        return {"ratio": (1, 1), "resolution": 0.001, "least_on": 0.0, "least_off": 0.0, "carries": False}
    kind = rng.random()
    ratio = (1, int(rng.integers(1, 6))) if kind < 0.6 else (int(rng.integers(1, 4)), 1) if kind < 0.8 else (
        int(rng.integers(2, 12)), int(rng.integers(2, 8)))
    common = math.gcd(*ratio)
    ratio = ratio[0] // common, ratio[1] // common
    period = ta * ratio[0] / ratio[1]
    resolution = min(period, 0.01 if rng.random() < 0.7 else period * _log(rng, 0.002, 0.1))
    least_on = least_off = 0.0
    if rng.random() < 0.5:
        least_on, least_off = (period * _log(rng, 0.01, 0.2) for _ in range(2))
    carries = bool(least_on and rng.random() < 0.5) or target == "pid-compact"
    if carries:  # PID_Compact makes both times whole calls
        least_on, least_off = (resolution * math.floor(each / resolution + 0.5) for each in (least_on, least_off))
    return {"ratio": ratio, "resolution": resolution, "least_on": least_on, "least_off": least_off, "carries": carries}


def _cycled(words, switch):
    """Return an instrument's words with a cycle time near the switch's period, and its own pulses."""
    part = Fraction(*switch["ratio"])
    tenths = max(1, round(10.0 * words.sample_time_s * part))
    values = controller_for("pband").cycle.put(words.values, tenths / 10.0)
    part = Fraction(tenths, 10) / Fraction(words.sample_time_s).limit_denominator(1000)
    return replace(words, values=values), {"ratio": part.as_integer_ratio(), "resolution": 0.001, "least_on": 0.0,
                                           "least_off": 0.0, "carries": False}


def _own_limits(rng):
    """Return the specification's limits as they are, or tighter or wider ones."""
    names = ("overshoot", "reheat-overshoot", "recovery-overshoot")
    return () if rng.random() < 0.6 else tuple(f"{name}={_log(rng, 2.0, 60.0):.4g}%" for name in names)


def _ramped(words, degC_per_min, hold_degC=None):
    try:
        return replace(words, ramp=controller_for(words.target).ramp(words, degC_per_min, hold_degC))
    except HeatertuneError:
        return words


def _widened(number, words, bench, conditions):
    """Return words, bench and conditions with more drawn: ramp and holdback, lower setpoint, preset, limits."""
    rng = np.random.default_rng([number, TARGETS[bench.target][0], 1])
    step = bench.setpoint - bench.ambient
    if rng.random() < 0.4:
        hold = bench.tolerance * _log(rng, 1.5, 12.0) if rng.random() < 0.7 else None
        words = _ramped(words, step / bench.slow * 60.0 / _log(rng, 0.3, 4.0), hold)
    if rng.random() < 0.5:
        bench = replace(bench, asked_low=bench.ambient + step * float(rng.uniform(0.2, 0.95)))
    name = str(rng.choice(_PRESETS)) if rng.random() < 0.3 else None
    tolerance = bench.tolerance if name is None or rng.random() < 0.5 else None
    asked = _many_limits(rng, step, bench.slow) if rng.random() < 0.5 else {}
    conditions = replace(
        conditions, spec=name, tolerance_degC=tolerance, limit=tuple(f"{limit}={value}" for limit, value in asked.items()),
        setpoint_degC=bench.setpoint if bench.asked_low is None else (bench.asked_low, bench.setpoint))
    limits = specification_of(conditions).limits_for(bench.slow)
    return words, replace(
        bench, tolerance=limits.tolerance_degC, heats_in=limits.settling_s or 0.0, recovers_in=limits.recovery_s or 0.0,
        ramp=_of_ramp(words)), conditions


def _switched_otherwise(number, words, bench, conditions):
    """Return them with a limit of the output, and with a power controller that fires in bursts of whole waves."""
    rng = np.random.default_rng([number, TARGETS[bench.target][0], 2])
    room = controller_for(bench.target)
    if room.most_power is not None and rng.random() < 0.6:
        words = room.with_output_limit(words, round(float(rng.uniform(bench.power, 100.0))))
        bench = replace(bench, words=dict(words.values))
    if conditions.pwm_period_s is not None and rng.random() < 0.5:
        parts = math.ceil(bench.interval / _log(rng, 0.1, 1.0))
        bench = replace(bench, ratio=(1, parts), resolution=min(0.02, bench.interval / parts), least_on=0.0, least_off=0.0,
                        carries=True)
        conditions = replace(conditions, pwm_period_s=bench.period, pwm_resolution_s=bench.resolution, pwm_rule="burst",
                             minimum_on_s=0.0, minimum_off_s=0.0)
    return words, bench, conditions


def _led(number, bench, conditions):
    """Return them with a profile that the heater can follow, its parts whole PWM periods and scans, and its limits."""
    rng = np.random.default_rng([number, TARGETS[bench.target][0], 4])
    unit, step = bench.interval * bench.ratio[0], bench.setpoint - bench.ambient
    if bench.target.startswith("s7-200"):
        unit = bench.interval
    segments, at = [], bench.ambient
    for _ in range(rng.integers(1, 5)):
        end = bench.ambient + step * float(rng.uniform(0.2, 1.0))
        room = bench.ambient + 100.0 * bench.gain - end if end > at else end - bench.ambient
        ramp = abs(end - at) / (room / sum(bench.lags)) * _log(rng, 1.1, 12.0)
        soak = bench.slow * _log(rng, 1.0, 20.0) if rng.random() < 0.8 else 0.0
        segments.append((end, unit * math.ceil(ramp / unit), unit * math.ceil(soak / unit)))
        at = end
    end, ramp, soak = segments[-1]
    segments[-1] = end, ramp, soak or unit * math.ceil(5.0 * bench.slow / unit)  # what has none is watched for a time of its own
    band = bench.tolerance * _log(rng, 0.5, 4.0) if rng.random() < 0.6 else None
    share = round(float(rng.uniform(10.0, 90.0))) if rng.random() < 0.4 else None
    seconds = bench.slow * _log(rng, 0.5, 10.0) if rng.random() < 0.3 else None
    peak = bench.setpoint + step * _log(rng, 0.01, 0.2) if rng.random() < 0.4 else None
    asked = {"soak-band": band and f"{band!r} degC", "soak-settling": share and f"{share} %", "peak": peak and f"{peak!r} degC"}
    limits = [f"{name}={value}" for name, value in asked.items() if value]
    limits += [f"soak-settling={seconds!r} s"] if seconds else []
    file = Path(_folder().name) / f"{bench.target}-{number}.csv"
    rows = (f"{end!r},{ramp!r},{soak!r}" for end, ramp, soak in segments)
    file.write_text("\n".join(("target [degC],ramp [s],soak [s]", *rows)))
    bench = replace(bench, profile=tuple(segments), soak_band=band, soak_in_s=seconds,
                    soak_in_share=None if share is None else share / 100.0)
    return bench, replace(conditions, profile=str(file), limit=(*conditions.limit, *limits))


def _boosted(number, words, bench):
    """Return them with a boost in place of a ramp, in three cases of four: about as heatertune has it, or any."""
    rng = np.random.default_rng([number, TARGETS[bench.target][0], 5])
    if not controller_for(bench.target).has_boost or rng.random() < 0.25:
        return words, bench
    full, gain = {"iec-pid": ("XMAX", "KP"), "weg": ("MaximumOutput", "Kp"), "arduino-pid": ("OutMax", "Kp"),
                  "simple-pid": ("output_max", "Kp"), "esphome": (None, "kp")}[bench.target]
    at_limit = words.values.get(full, 1.0) / words.values[gain]
    within = at_limit * (_log(rng, 0.35 if bench.target in ("weg", "iec-pid") else 0.1, 1.0) if rng.random() < 0.7 else _log(rng, 0.05, 2.0))
    between = within / 2.0 if rng.random() < 0.7 else max(within, bench.band) * _log(rng, 0.01, 1.0)
    distances = [float(np.float32(each)) for each in (within, within + between)]
    words = words.with_boost(Boost(within_degC=distances[0], again_degC=distances[1]))
    return words, replace(bench, ramp=None, boost=tuple(distances))


@cache
def _folder():
    return tempfile.TemporaryDirectory()


def _many_limits(rng, step, slow):
    """Return limits of every kind as a user writes them, some of them."""
    kinds = {
        "overshoot": f"{_log(rng, 0.01, 0.3) * step:.4g} degC", "recovery-overshoot": f"{_log(rng, 0.02, 0.3) * step:.4g} degC",
        "reheat-overshoot": f"{_log(rng, 0.02, 0.6) * step:.4g} degC", "settling": f"{_log(rng, 2.0, 12.0) * slow:.5g} s",
        "recovery": f"{_log(rng, 1.5, 12.0) * slow:.5g} s", "load-deviation": f"{_log(rng, 0.28, 0.6) * step:.4g} degC",
        "iae": f"{_log(rng, 2.0, 30.0) * step * slow:.4g} degC·s", "power-reserve": f"{_log(rng, 2.0, 40.0):.3g} %",
        "saturation": f"{_log(rng, 3.0, 60.0):.3g} %", "switchings": f"{_log(rng, 0.5, 20.0) * 3600.0 / slow:.4g} /h",
    }
    return {name: value for name, value in kinds.items() if rng.random() < 0.3}


def _of_ramp(words):
    return None if words.ramp is None else (float(words.ramp.step), words.ramp.calls, float(words.ramp.hold or 0.0))


def _proven(words, model, conditions, *, draws):
    """Return the proof, with one draw of the noise or as many as it takes for a PASS, without the listing of a room that has one: the proof's own runs take the direct form, too."""
    course = course_for(words, [model], conditions, conditions.highest_degC)
    return prove_models(
        _without_listing(words.target), words, [("by hand", model)], course.scenario, actuator_for(conditions, words),
        Acceptance(limits=limits_of(specification_of(conditions), [model]), margins_of=margins),
        Coverage(stated_settings=conditions.switches, draws=draws))


@cache
def _without_listing(target):
    room = controller_for(target)
    if room.direct is None:
        return room
    kind = type(room)
    core = sys.modules[kind.__module__]._DIRECT
    return type("Direct", (kind,), {"core": core, "direct": None, "begin": lambda _, *given: kind.direct(*given)[1]},
                name=f"bench-{target}")()


def _limits(limits):
    """Return the limits by the judge's names."""
    return {"overshoot": limits.overshoot_pct, "change_overshoot": limits.overshoot_pct,
            "small_change_overshoot": limits.small_change_overshoot_pct,
            "restart_overshoot": limits.overshoot_pct, "reheat_overshoot": limits.reheat_overshoot_pct,
            "recovery_overshoot": limits.recovery_overshoot_pct, "settling_time": limits.settling_s,
            "recovery_time": limits.recovery_s, "deviation": limits.deviation_degC, "iae": limits.iae_degC_s,
            "peak": limits.peak_degC, "saturation": limits.saturation_pct, "switchings": limits.switchings_per_h,
            "power held": None if limits.power_reserve_pct is None else 100.0 - limits.power_reserve_pct,
            **{f"{name} in degC": limits.overshoot_degC for name in ("overshoot", "change_overshoot", "restart_overshoot")},
            "small_change_overshoot in degC": limits.small_change_overshoot_degC,
            "reheat_overshoot in degC": limits.reheat_overshoot_degC,
            "recovery_overshoot in degC": limits.recovery_overshoot_degC}


def judged(library, number, target, longer=LONGER, draws=_DRAWS):
    """Return what became of a case, as a document; "wrong" tells where proof and judge differ."""
    case = {"number": number, "target": target}
    try:
        model, words, bench, conditions = drawn(number, target)
        proof = _proven(words, model, conditions, draws=False)  # the draw that the judge has, too
    except HeatertuneError as problem:
        return case | {"end": "no words", "why": str(problem)}
    case["with"] = [name for name, there in {
        "ramp": bench.ramp, "boost": bench.boost, "hold": bench.ramp and bench.ramp[2], "low": bench.asked_low, "noise": bench.noise,
        "spec": conditions.spec, "limits": conditions.limit, "least on": bench.least_on, "bursts": conditions.pwm_rule == "burst", "profile": bench.profile,
        "limited": any(words.values.get(name, 100.0) < 100.0 for name in ("MaximumOutput", "LMN_HLM", "XMAX"))}.items() if there]
    case |= {"end": proof.runs[0].verdict, "not kept": [each.name for each in proof.criteria if not each.ok]}
    case["runs"] = set(case["not kept"]) <= _OF_WORDS
    if case["end"] == "PASS" and bench.noise:
        case["end"] = _proven(words, model, conditions, draws=True).runs[0].verdict
        case["runs"] = case["end"] == "PASS"
    limits = _limits(proof.limits)
    case |= {"measures": {}, "wrong": {}}
    case |= _measured_apart(library, bench, limits, proof, kept=set(case["not kept"]) <= {*_OF_WORDS, _FLAGS})
    if not case["runs"]:
        return case
    case["longer"] = min(longer, _LONGER_NOISY if bench.noise else longer, _MOST_PULSES * bench.period / proof.scenario.duration_s)
    told = opinion(library, bench, limits, longer=case["longer"])
    case["noise"] = bench.noise / bench.band
    case["at"] = {name: value / limit for name, (value, limit) in told.values.items()} | told.later
    later = () if bench.noise else told.later
    case["wrong"] |= {name: share for name, share in case["at"].items()
                      if not share <= 1.0 + SLACK and (name in told.values or name in later)}
    if bench.noise and case["end"] == "PASS":
        case["later"] = max(told.later.values(), default=0.0)
        case["draws broken"] = _broken_draws(library, bench, limits, draws)
    case["wrong"] |= _story_apart(bench, proof.scenario)
    if told.begins[-1] <= _PLAIN_S:
        edges, plain = proof.trace(0).edge_time_s, dict[str, float]()
        for step_s in _PLAIN_STEPS_S:
            plain = _apart_in_steps(proof, in_plain_steps(library, bench, limits, edges, step=step_s), step_s)
            if max(plain.values()) <= SLACK:
                break
        case["plain"] = max(plain.values())
        case["wrong"] |= {f"{name} in plain steps": share for name, share in plain.items() if share > SLACK}
    return case


def _broken_draws(library, bench, limits, count):
    """Return the share of other draws of the noise that break a limit in the story."""
    draws = (opinion(library, replace(bench, seed=_FIRST_DRAW + draw), limits, longer=0.0) for draw in range(count))
    return sum(any(value > limit * (1.0 + SLACK) for value, limit in told.values.values()) for told in draws) / count


def _measured_apart(library, bench, limits, proof, *, kept):
    """Return what the story's measures are that differ, and under "wrong" which of them are no close call."""
    values = named({each.name: each.value for each in proof.criteria if each.name != _FLAGS})
    told = opinion(library, bench, limits, longer=0.0).values
    found = apart(values, told)
    if not found and not differ(values, kept, told):
        return {}
    wrong = {} if by_a_hair(library, bench, limits, values, kept) else {"measures": found or told}
    return {"measures": found, "wrong": wrong}


def _apart_in_steps(proof, told, step_s):
    """Return by which share the proof's integral and times differ from another's, times by more than two of its steps."""
    values = {"iae": told.iae} | {name: told.values[name][0] for name in ("settling_time", "recovery_time") if name in told.values}
    criteria = {each.name: each.value for each in proof.criteria}
    unseen = {"settling_time": 2.0 * step_s, "recovery_time": 2.0 * step_s}
    return {name: max(0.0, abs(criteria[name] - value) - unseen.get(name, 0.0)) / value
            for name, value in values.items() if value > 0.0}


def _story_apart(bench, scenario):
    """Return where the proof's story differs from the judge's, in ticks; empty where it does not."""
    parts, tick = list(story(bench)), bench.interval / bench.ratio[1]
    ends = [*(event.time_s for event in scenario.disturbances), scenario.duration_s]
    if len(parts) != len(ends):
        return {"parts": len(ends) - len(parts)}
    apart = np.round(np.array(ends) / tick - ends_of(bench, parts))
    return {"story": float(np.abs(apart).max())} if apart.any() else {}


def main():
    """Judge cases and print what became of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--targets", nargs="+", default=list(TARGETS), choices=list(TARGETS), help="taken in turn")
    parser.add_argument("--longer", type=float, default=LONGER, help="by how many stories the rests go on")
    parser.add_argument("--keep", type=Path, help="file to which each case is written, a line of JSON each")
    asked = parser.parse_args()
    ends, wrong, hairs, noisy, cut = Counter(), 0, 0, [], []
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        for number in range(asked.first, asked.first + asked.count):
            case = judged(library, number, asked.targets[number % len(asked.targets)], asked.longer)
            ends[case["target"], case["end"], "the runs' limits kept" if case.get("runs") else ""] += 1
            if case.get("longer", asked.longer) < asked.longer and not case["noise"]:
                cut.append(case["longer"])
            if "draws broken" in case:
                noisy.append(case)
            hairs += bool(case.get("measures")) and "measures" not in case["wrong"]
            if case.get("wrong"):
                wrong += 1
                print(json.dumps(case), flush=True)
            if asked.keep:
                with asked.keep.open("a") as out:
                    out.write(json.dumps(case) + "\n")
    for (target, end, kept), count in sorted(ends.items()):
        print(f"{target:12s} {end:10s} {kept:22s} {count}")
    print(f"{wrong} disagreements, {hairs} close calls; {len(cut)} cases without noise went on for fewer stories, {min(cut, default=asked.longer):.3g} the fewest")
    often = [case["draws broken"] for case in noisy if case["draws broken"] > _TOO_MANY]
    share = sum(case["draws broken"] for case in noisy) / max(1, len(noisy))
    print(f"{len(noisy)} PASSes with noise: {share:.2%} of draws break a limit, in {len(often)} more than 5 % (the most in "
          f"{max(often, default=0.0):.0%}), {sum(case['later'] > 1.0 for case in noisy)} leave the band later")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
