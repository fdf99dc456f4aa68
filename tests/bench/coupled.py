"""Three heaters in a row that exchange heat, designed one by one and together, for each coupling c.

    python -m tests.bench.coupled [TARGET [C…] [decoupled]]

T1·dT_i/dt = ambient + k·u_i(t − L) − T_i + c·Σ (T_j − T_i) over neighbours, by Euler's method in steps of a second; logged
every 4 s with noise. Designed one by one, each zone's log has its neighbours at rest. Designed together, all powers step in
turn. Each joint PASS is judged by the largest eigenvalue of a linear model and by `zone_judge`.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import heatertune as ht
from heatertune.plc import controller_for
from heatertune.settings import Conditions
from heatertune.zones import design_zones, fit_network, read_zones
from heatertune.zones.joint_proof import specification_for
from tests.bench.zone_judge import judge, live, settling
from tests.zones.networks import chain, radius

GAIN, LAG_S, DEAD_S, AMBIENT_DEGC = 1.2, 240.0, 12.0, 22.0
REST_PCT, SETPOINT_DEGC = 20.0, 60.0


class Outcome(NamedTuple):
    """What becomes of a coupling: verdicts, largest eigenvalue, deviation of the neighbours [°C], complaint, CPU time [s]."""

    alone: tuple
    verdict: str
    eigenvalue: float
    deviation: float
    complaint: str
    seconds: float
    summary: str


def rows(c, powers, seed=3):
    """Return instants and noisy temperatures of powers given for each second, every 4 s, shapes (N,) and (N, n)."""
    count = powers.shape[1]
    matrix = -np.eye(count)
    for zone in range(count):
        for other in (zone - 1, zone + 1):
            if 0 <= other < count:
                matrix[zone, zone] -= c
                matrix[zone, other] += c
    temperature = np.linalg.solve(-matrix, AMBIENT_DEGC + GAIN * powers[0])
    random, found = np.random.default_rng(seed), []
    for second in range(len(powers)):
        if second % 4 == 0:
            found.append(np.round(temperature + random.normal(0.0, 0.03, count), 2))
        heat = AMBIENT_DEGC + GAIN * powers[max(second - int(DEAD_S), 0)]
        temperature = temperature + (matrix @ temperature + heat) / LAG_S
    return np.arange(0, len(powers), 4), np.array(found)


def joint_log(c, folder, count=3):
    """Write a log in which each zone's power steps in turn; return its path."""
    lasts = 4000
    powers = np.full((lasts * count, count), REST_PCT)
    for zone in range(count):
        powers[100 + lasts * zone: 2200 + lasts * zone, zone] = REST_PCT + 40.0
    instants, readings = rows(c, powers)
    names = "abcdefgh"[:count]
    head = ",".join(["time_s", *(f"{name}_temp_C" for name in names), *(f"{name}_power_pct" for name in names)])
    lines = [f"{t}," + ",".join(map(str, [*readings[k], *powers[t]])) for k, t in enumerate(instants)]
    path = Path(folder) / f"zones_{c:g}.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def verdict_alone(c, zone, target, folder, count=3):
    """Return the verdict of one zone designed by itself, its neighbours at rest."""
    powers = np.full((4000, count), REST_PCT)
    powers[100:2200, zone] = REST_PCT + 40.0
    instants, readings = rows(c, powers)
    path = Path(folder) / f"zone_{c:g}_{zone}.csv"
    lines = [f"{t},{readings[k, zone]},{powers[t, zone]}" for k, t in enumerate(instants)]
    path.write_text("\n".join(["time_s,temp_C,power_pct", *lines]) + "\n", encoding="utf-8")
    model = ht.fit(path)
    return ht.prove(ht.encode(ht.tune(model, target=target), target=target), model, setpoint_degC=SETPOINT_DEGC).verdict


def outcome(c, target, *, alone=True, count=3, decouple=False):
    """Return what becomes of a coupling."""
    with tempfile.TemporaryDirectory() as folder:
        verdicts = tuple(verdict_alone(c, zone, target, folder, count) for zone in (0, 1)) if alone else ()
        begun = time.process_time()
        log = read_zones(joint_log(c, folder, count), "abcdefgh"[:count])
        fitted = fit_network(log)
        spec = replace(specification_for(fitted, SETPOINT_DEGC, Conditions()), decouple=decouple)
        proof = design_zones(fitted, target, specification=spec)
        seconds = time.process_time() - begun
    truth = chain(count, c, gain=GAIN, lag=LAG_S, dead=DEAD_S, ambient=AMBIENT_DEGC)
    words = proof.words[0]
    added = 0.0 if proof.design.decoupling is None else np.array(proof.design.decoupling.pct_per_degC)
    size = radius(truth, proof.design.designs, words.sample_time_s, controller_for(target).delayed_s(words.scaling), added)
    lasts_s = settling(truth, proof, size)
    phases, temperatures, highest, asked = live(truth, proof, settle_s=lasts_s, noise_degC=0.0, seed=0, settings=None)
    off = [np.abs(np.delete(each[phase.first:phase.end] - asked[phase.first:phase.end], phase.zone, axis=1)).max()
           for phase in phases if phase.kind == "setpoint" for each in (temperatures, highest)]
    return Outcome(verdicts, proof.verdict, size, max(off, default=0.0), judge(truth, proof, settle_s=lasts_s), seconds,
                   proof.summary())


def run(target="s7-300", *couplings):
    """Print a line for each coupling."""
    decouple = "decoupled" in couplings
    for c in map(float, [each for each in couplings if each != "decoupled"] or range(9)):
        found = outcome(c, target, alone=not decouple, decouple=decouple)
        print(f"{target} c = {c:g}: alone {', '.join(found.alone)}; together {found.verdict}, largest eigenvalue "
              f"{found.eigenvalue:.4f}, neighbours {found.deviation:.2f} °C off, {found.complaint or 'nothing broken'}, "
              f"{found.seconds:.1f} s", flush=True)
        if found.verdict != "PASS":
            print(found.summary, flush=True)


if __name__ == "__main__":
    run(*sys.argv[1:])
