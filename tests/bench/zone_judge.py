"""Zones a second time, with the words, readings and PWM of second_opinion.c: a judge that shares nothing with the proof.

The network is a heat balance in SciPy's matrix exponential (tests/zones/networks.py), with further bodies behind the zones
where it has any. The day: all zones heat up together;
then of each zone a higher setpoint and back, and a load and its end; readings are noisy. Temperatures are judged, not
readings, by the limits of the proof's own specification.
"""

import ctypes
import math
import subprocess
import tempfile
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.bench.second_opinion import SWITCHES, TARGETS, _Case
from tests.zones.networks import at_rest, balance, stepped

WORDS = {"s7-300": ("GAIN", "RATE", "RESET", "SAMPLE"), "s5-ob251": ("K", "R", "TI", "TD", "BGOG", "BGUG"),
         "fb41": ("GAIN", "TI", "TD", "TM_LAG", "CYCLE", "PV_FAC", "PV_OFF", "I_SEL", "D_SEL", "LMN_HLM"),
         "iec-pid": ("KP", "TR", "TD", "XMIN", "XMAX", "CYCLE")}
SLACK = 1.02  # of a limit, beside one count of the reading
LOAD_PCT = 20.0
RESERVE_PCT = 5.0
_STEP_S = 0.25


class _Network(ctypes.Structure):
    _fields_ = (("zones", ctypes.c_int), ("bodies", ctypes.c_int), ("scans", ctypes.c_int), ("h", ctypes.c_double), ("scan", ctypes.c_int64),
                ("period", ctypes.c_int64), *((name, ctypes.c_void_p) for name in (
                    "move", "drive", "constant", "dead", "asked", "load", "noise", "shares", "begins", "offsets", "factors", "references", "pulses")),
                ("places", ctypes.c_int64))


class Phase(NamedTuple):
    """A part of the day: what begins, in which zone (-1: all), its scans, and the change of the setpoint [°C]."""

    kind: str
    zone: int
    first: int
    end: int
    change: float = 0.0


@cache
def library():
    """Return the C program; raise FileNotFoundError where there is no compiler."""
    source = Path(__file__).parent / "zone_judge.c"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "zone_judge.so"
        subprocess.run(["cc", "-O3", "-fno-tree-slp-vectorize", "-ffp-contract=off", "-shared", "-fPIC", "-o", str(path),
                        str(source), "-lm"], check=True)
        return ctypes.CDLL(str(path))


def judge(network, proof, *, settle_s, noise_degC=0.03, seed=0, settings=None):
    """Return what the true network breaks under the words of a proof; "" where it breaks nothing.

    Args:
        network: the true one.
        proof: whose words run, and whose specification is kept.
        settle_s: how long each part of the day lasts.
        noise_degC: of the readings.
        seed: of the noise.
        settings: of the controller's open points; None: the first of each.
    """
    phases, temperatures, highest, asked = live(
        network, proof, settle_s=settle_s, noise_degC=noise_degC, seed=seed, settings=settings)
    low, high = proof.words[0].scaling.sensor_degC
    count = (high - low) / TARGETS[proof.words[0].target][1]
    ambient, _ = at_rest(network)
    if proof.specification.spread_degC is not None and (
            apart := spread(temperatures[:phases[0].end], asked[0])) > SLACK * proof.specification.spread_degC + count:
        return f"zones {apart:.2f} °C apart while heating up"
    for phase in phases:
        part = slice(phase.first, phase.end)
        complaint = broken(phase, temperatures[part] - asked[part], highest[part] - asked[part], proof.specification,
                           np.array(proof.specification.setpoints_degC) - ambient, count)
        if complaint:
            return complaint
    return ""


def spread(temperatures, setpoints):
    """Return by how much a zone is at most warmer than another one, beyond what their setpoints are apart [°C]."""
    most = 0.0
    for i, one in enumerate(setpoints):
        for j, other in enumerate(setpoints):
            most = max(most, (temperatures[:, i] - temperatures[:, j]).max() - max(one - other, 0.0))
    return most


def ramp_of(words):
    """Return step, calls and °C per second of a setpoint ramp; a step of 0 where there is none."""
    if words.ramp is None:
        return 0.0, 1, 0.0
    step = float(words.ramp.step)
    return step, words.ramp.calls, step * unit_degC(words) / words.ramp.calls / words.sample_time_s


def unit_degC(words):
    """Return a unit of the reading: a count, but of the PID of IEC 61131-3 [°C]."""
    low, high = words.scaling.sensor_degC
    return 1.0 if words.target == "iec-pid" else (high - low) / TARGETS[words.target][1]


def live(network, proof, *, settle_s, noise_degC, seed, settings):
    """Return phases, temperatures, highest temperatures between scans and setpoints, each of shape (scans, n)."""
    phases, asked, load = _day(network, proof.specification, math.ceil(settle_s / proof.words[0].sample_time_s))
    temperatures, highest, *_ = simulated(network, proof, asked, load, noise_degC=noise_degC, seed=seed, settings=settings)
    return phases, temperatures, highest, asked


def simulated(network, proof, asked, load, *, noise_degC=0.0, seed=0, settings=None, begins=None):
    """Return temperatures, highest ones between scans and powers, of shape (scans, n), and pulses, of shape (p, 3).

    Args:
        network: the true one.
        proof: whose words and PWM run.
        asked, load: setpoint and load at each scan, shape (scans, n) [°C, %].
        noise_degC: of the readings.
        seed: of the noise.
        settings: of the controller's open points; None: the first of each.
        begins: scan at which each zone's controller is started; None: all at the first one.
    """
    words, actuator = proof.words, proof.actuator
    count, interval = len(words), words[0].sample_time_s
    ratio = Fraction(actuator.pwm_period_s / interval).limit_denominator(64)
    h = interval / ratio.denominator
    parts = math.ceil(h / _STEP_S)
    h /= parts
    states, _, constant = balance(network)
    move, drive, still = stepped(network, h)
    number, counts, delay = TARGETS[words[0].target]
    switches = settings or {name: choices[0] for name, choices in SWITCHES[words[0].target].items()}
    places = [choices.index(switches[name]) for name, choices in SWITCHES[words[0].target].items()]
    cases = (_Case * count)(*(_Case(
        target=number, sw=(ctypes.c_int * 8)(*places),
        words=(ctypes.c_double * 16)(*(float(each.values[name]) for name in WORDS[each.target])),
        low=each.scaling.sensor_degC[0], span=each.scaling.sensor_degC[1] - each.scaling.sensor_degC[0], counts=counts,
        resolution=actuator.resolution_s, least_on=actuator.minimum_on_s, least_off=actuator.minimum_off_s,
        carries=actuator.minimum_rule == "carry", ramp=ramp_of(each)[0], ramp_calls=ramp_of(each)[1]) for each in words))
    noise = np.random.default_rng(seed).normal(0.0, noise_degC, asked.shape) if noise_degC else np.zeros(asked.shape)
    arrays = {"move": move, "drive": drive, "constant": still, "dead": np.array(network.dead_times_s) + delay,
              "asked": asked, "load": load, "noise": noise}
    if any(network.supply_shares):
        arrays["shares"] = np.array(network.supply_shares)
    arrays["offsets"] = np.array(proof.offsets_s)
    if proof.design.decoupling is not None:
        low, unit = words[0].scaling.low_degC, unit_degC(words[0])
        away = (np.array(proof.design.decoupling.references_degC) - low) / ((words[0].scaling.sensor_degC[1] - low) / counts)
        whole = np.floor(away + 1e-9)  # as the module reads it
        arrays["factors"] = np.array(proof.design.decoupling.pct_per_degC) * unit
        arrays["references"] = whole if unit != 1.0 else low + whole * (words[0].scaling.sensor_degC[1] - low) / counts
    arrays["pulses"] = np.zeros((count * (math.ceil(len(asked) * interval / actuator.pwm_period_s) + 2), 3))
    arrays = {name: np.ascontiguousarray(array, dtype=np.float64) for name, array in arrays.items()}
    arrays["begins"] = np.zeros(count, dtype=np.int64) if begins is None else np.array(begins, dtype=np.int64)
    outline = _Network(zones=count, bodies=len(still), scans=len(asked), h=h, scan=ratio.denominator * parts, period=ratio.numerator * parts,
                       places=len(arrays["pulses"]), **{name: array.ctypes.data for name, array in arrays.items()})
    rest = np.linalg.solve(states, -constant)
    found = [np.zeros(asked.shape) for _ in range(3)]
    if library().zone_judge(ctypes.byref(outline), cases, *(ctypes.c_void_p(each.ctypes.data) for each in (rest, *found))):
        raise RuntimeError("too many pulses were under way")
    return *found, arrays["pulses"][:outline.places]


def _day(network, spec, scans):
    setpoint, count = np.array(spec.setpoints_degC), len(network.zones)
    cold, rise = at_rest(network)
    held = np.linalg.solve(rise, setpoint - cold)
    phases, asked, load = [], [], []

    def part(kind, zone, change=0.0, burden=0.0, times=1):
        moved, weight = setpoint.copy(), np.zeros(count)
        if zone >= 0:
            moved[zone] += change if kind == "setpoint" else 0.0
            weight[zone] = burden
        begin = phases[-1].end if phases else 0
        phases.append(Phase(kind, zone, begin, begin + times * scans, change))
        asked.append(np.tile(moved, (times * scans, 1)))
        load.append(np.tile(weight, (times * scans, 1)))

    part("heat-up", -1, times=2)
    for zone in range(count):
        change = min(spec.step_degC, 0.95 * room(network, setpoint, zone))
        if change >= 0.2 * spec.step_degC:
            part("setpoint", zone, change)
            part("setpoint back", zone, change)
        burden = min(LOAD_PCT, 100.0 - RESERVE_PCT - held[zone])
        if burden > 1.0:
            part("load", zone, burden=burden)
            part("load gone", zone)
    return phases, np.concatenate(asked), np.concatenate(load)


def room(network, setpoint, zone):
    """Return by how much a zone's setpoint can rise before a neighbour needs no power, or it needs more than all [°C]."""
    cold, rise = at_rest(network)
    base, slope = np.linalg.solve(rise, setpoint - cold), np.linalg.inv(rise)[:, zone]
    limits = [(base[i] - 1.0) / -slope[i] if slope[i] < 0.0 else (95.0 - base[i]) / slope[i]
              for i in range(len(base)) if slope[i]]
    return max(min(limits), 0.0)


def broken(phase, errors, highest, spec, rise, count):
    """Return what a phase breaks: distances from the setpoints [°C], of shape (scans, n); "" where it breaks nothing."""
    limits, last = spec.limits, errors[-len(errors) // 5:]
    what = f"in {phase.kind}{'' if phase.zone < 0 else f' of zone {phase.zone + 1}'}"
    mine = [phase.zone] if phase.zone >= 0 else range(errors.shape[1])
    if (offset := np.abs(last).max()) > SLACK * limits.tolerance_degC + count:
        return f"{offset:.2f} °C off at the end {what}"
    over = highest.max(axis=0)
    if phase.kind == "heat-up" and (most := (100.0 * (over - count) / rise).max()) > SLACK * limits.overshoot_pct:
        return f"overshoot {most:.1f} %"
    if phase.kind.startswith("setpoint"):
        others = np.delete(np.maximum(highest, np.abs(errors)), phase.zone, axis=1)
        if (off := others.max()) > SLACK * spec.deviation_limit_degC(phase.change) + count:
            return f"a neighbour {off:.2f} °C off {what}"
    if phase.kind == "setpoint" and limits.small_change_overshoot_pct is not None:
        most = max(limits.small_change_overshoot_pct / 100.0 * phase.change, limits.tolerance_degC)
        if over[phase.zone] > SLACK * most + count:
            return f"overshoot {over[phase.zone]:.2f} °C {what}"
    if phase.kind.startswith("load") and limits.recovery_overshoot_pct is not None:
        for zone in mine:
            beyond = over[zone] if phase.kind == "load" else -errors[:, zone].min()
            if 100.0 * (beyond - count) / rise[zone] > SLACK * limits.recovery_overshoot_pct:
                return f"overshoot {beyond:.2f} °C {what}"
    return ""


def settling(network, proof, radius):
    """Return how long a part of the day lasts, by the largest eigenvalue of the loop [s]."""
    designs = proof.design.designs
    size = min(max(radius, 0.5), 1.0 - 1e-4)
    *_, rate = ramp_of(proof.words[0])
    rise = max(proof.specification.setpoints_degC) - min(proof.fitted.network.ambients_degC)
    return ((rise / rate if rate else 0.0) + 12.0 * max(each.integral_time_s for each in designs) - 8.0 * designs[0].sample_time_s / math.log(size)
            + 2.0 * max(network.time_constants_s))
