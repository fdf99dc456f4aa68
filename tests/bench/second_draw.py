"""Heaters drawn a second time, from a model's document as the head of proof/monte_carlo/draw.py says it, for second_samples.py."""

import math
from dataclasses import replace

import numpy as np

from tests.bench.second_opinion import TARGETS, story

_ENDS = (0.9**2, 1.1**2)  # of the supply's tolerance, as power
_SIGMAS = 2.0 * 1.96  # in a 95 % interval


def possible(document, setpoint):
    """Return the heaters of a model's document that can hold a setpoint, (gain, lags, dead time, ambient, whether it is no
    end of an interval) each; all where none can."""
    given, least = document["candidates"] or [document], document["least_dead_time_s"]
    every = []
    for each in given:
        second = each.get("second_time_constant_s")
        lags = (each["time_constant_s"],) if second is None else (each["time_constant_s"], second)
        ambient = 20.0 if each["ambient_degC"] is None else each["ambient_degC"]
        its = (each["gain_degC_per_pct"], lags, max(each["dead_time_s"], least), ambient)
        if its not in [other[:4] for other in every]:
            every.append((*its, not each.get("part")))
    return [each for each in every if each[3] < setpoint < each[3] + 100.0 * each[0]] or every


def spreads(document):
    """Return the standard deviations of the logarithms of gain and lags, and of the dead time [s]."""
    def of_logarithm(name):
        low, high = document.get(f"{name}_ci95") or (None, None)
        return 0.0 if low is None or high is None else (math.log(high) - math.log(low)) / _SIGMAS

    dead, least = document.get("dead_time_s_ci95"), document["least_dead_time_s"]
    sigma = 0.0
    if dead is not None:  # open below: down to what is believed; open above: as far above the model's as below it
        low = least if dead[0] is None else max(least, dead[0])
        above = max(document["dead_time_s"], low) - low if dead[1] is None else None
        sigma = (2.0 * above if above is not None else max(dead[1], low) - low) / _SIGMAS
    return of_logarithm("gain_degC_per_pct"), of_logarithm("time_constant_s"), sigma


def drawn(bench, document, count, rng):
    """Return benches of heaters on days of their own."""
    every = [each for each in possible(document, bench.setpoint) if each[4]]
    of_gain, of_lag, of_dead = spreads(document)
    parts, found = list(story(bench)), []
    for number in range(count):
        gain, lags, dead, ambient, _ = every[number % len(every)]
        longer = math.exp(rng.normal(0.0, 1.0) * of_lag)
        volts = rng.uniform(0.9, 1.1)
        sizes = tuple(float(rng.uniform(0.5, 1.5)) if part.event in ("temperature-step", "load") else 1.0 for part in parts)
        found.append(replace(
            bench, gain=gain * math.exp(rng.normal(0.0, 1.0) * of_gain), lags=tuple(longer * lag for lag in lags),
            dead=max(rng.normal(dead, of_dead), document["least_dead_time_s"]), ambient=ambient + rng.uniform(-5.0, 5.0),
            mains=volts**2, sizes=sizes, seed=int(rng.integers(1 << 62))))
    return found


def given(bench, row, sizes, noise, late):
    """Return the bench of one of the program's own heaters; its mains are in the gain, its delay is the controller's."""
    gain, first, second, dead, ambient, _ = map(float, row)
    return replace(bench, gain=gain, lags=(first, second) if second else (first,), ambient=ambient,
                   dead=dead - TARGETS[bench.target][2], sizes=(1.0, *map(float, sizes)), noises=np.ascontiguousarray(noise) if bench.noise else None,
                   lates=np.ascontiguousarray(late) if bench.jitter else None)


def verdict_notes(bench, document, settings):
    """Return the bench whose story is that of all plausible heaters."""
    return replace(bench, family=tuple(each[:4] for each in possible(document, bench.setpoint)), settings=settings)


def inputs_of_rows(rows, sizes, parts):
    """Return what is drawn by name, of the program's rows: steps and loads in °C."""
    found = {"gain": rows[:, 0], "lag": rows[:, 1], "dead time": rows[:, 3], "ambient": rows[:, 4], "start": rows[:, 5]}
    for number, part in enumerate(parts[1:]):
        if part.event in ("temperature-step", "load"):
            found[f"{part.event} {number}"] = sizes[:, number] * part.value * (rows[:, 0] if part.event == "load" else 1.0)
        if part.event == "mains" and any(math.isclose(part.power, end) for end in _ENDS):
            found[f"mains {number}"] = sizes[:, number] * part.power * rows[:, 0]
    return found


def inputs_of(benches, parts):
    """Return the same of benches drawn here."""
    delay = TARGETS[benches[0].target][2]
    found = {"gain": [b.gain * b.mains for b in benches], "lag": [b.lags[0] for b in benches],
             "dead time": [b.dead + delay for b in benches], "ambient": [b.ambient for b in benches],
             "start": [b.ambient for b in benches]}
    for number, part in enumerate(parts[1:]):
        if part.event in ("temperature-step", "load"):
            found[f"{part.event} {number}"] = [
                b.sizes[number + 1] * part.value * (b.gain if part.event == "load" else 1.0) for b in benches]
        if part.event == "mains" and any(math.isclose(part.power, end) for end in _ENDS):
            found[f"mains {number}"] = [part.power * b.gain for b in benches]
    return found
