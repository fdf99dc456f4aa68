"""How often a monitor trips for nothing, and how late it sees a switch that is stuck: python -m tests.bench.supervise.

What is judged are the numbers of `heatertune supervise --json`; plant, controller and monitor are this file's own and
those of `second_monitor`, all heaters at once in numpy. Beside them, on the same traces, two rules that many machines
run: Klipper's as Kalico's package has it (`--kalico FOLDER`, run from there), and what Marlin publishes as its own.
"""

import argparse
import importlib.util
import json
import logging
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.bench.second_monitor import NAMES, Monitors

#: gain [°C/%], lag and dead time [s], ambient and setpoint [°C], range of the card, and what stops it anyway [°C]
HEATERS = {
    "paper": (0.37, 167.0, 12.0, 24.0, 53.3, 100.0, 100.0),
    "hot-end": (4.0, 120.0, 2.0, 22.0, 200.0, 300.0, 285.0),
    "bed": (1.1, 500.0, 12.0, 22.0, 80.0, 150.0, 120.0),
    "oven": (3.0, 3600.0, 120.0, 22.0, 180.0, 300.0, 285.0),
}


class Loops:
    """n loops: one lag and a dead time each, a PI controller without its own arithmetic, a card."""

    def __init__(self, heater, document, design, n, seed, *, spread=0.2, noise=(0.0, 0.1)):
        self.rng, self.n = np.random.default_rng(seed), n
        gain, lag, dead, ambient, self.setpoint = heater[:5]
        draw = lambda width: 1.0 + width * self.rng.uniform(-1.0, 1.0, n)  # noqa: E731
        self.dt = document["scan_s"]
        self.ambient = ambient + self.rng.uniform(-5.0, 5.0, n)
        rise = self.setpoint - self.ambient  # a heater that cannot hold the setpoint shall trip: none is drawn
        self.gain = np.maximum(gain * draw(spread), np.maximum(np.minimum(rise / 95.0, gain), rise / 98.0))
        self.keeps = np.exp(-self.dt / (lag * draw(spread)))
        delay = dead * draw(1.5 * spread) / self.dt
        self.whole, self.part = delay.astype(int), delay - delay.astype(int)
        self.noise = self.rng.uniform(*noise, n)
        self.kp, self.ki = design["gain_pct_per_degC"], design["gain_pct_per_degC"] * self.dt / design["integral_time_s"]
        self.card = document["card"]
        self.ring = np.zeros((int(delay.max()) + 3, n))
        self.t = self.ambient.copy()
        self.integral, self.k = np.zeros(n), 0
        self.mains, self.load, self.stuck, self.asked = 1.0, 0.0, 0.0, np.full(n, float(self.setpoint))
        self.top = round((heater[5] - self.card["zero_degC"]) / self.card["step_degC"])

    def scan(self, on=True):
        """Return reading and power of a scan, then let the time to the next go by."""
        seen = self.t + self.noise * self.rng.standard_normal(self.n)
        counts = np.clip(np.floor((seen - self.card["zero_degC"]) / self.card["step_degC"]), 0, self.top).astype(np.int64)
        if on:
            e = self.asked - (self.card["zero_degC"] + self.card["step_degC"] * counts)
            wish = self.kp * e + self.integral
            u = np.clip(wish, 0.0, 100.0)
            wound = ((wish >= 100.0) & (e > 0.0)) | ((wish <= 0.0) & (e < 0.0))
            self.integral += np.where(wound, 0.0, self.ki * e)
        else:
            u, self.integral = np.zeros(self.n), np.zeros(self.n)
        rows, every = len(self.ring), np.arange(self.n)
        self.ring[self.k % rows] = u * self.mains + self.stuck
        newer = self.ring[(self.k - self.whole) % rows, every]
        older = self.ring[(self.k - self.whole - 1) % rows, every]
        target = self.ambient + self.gain * ((1.0 - self.part) * newer + self.part * older + self.load)
        self.t = target + (self.t - target) * self.keeps
        self.k += 1
        return counts, np.rint(u).astype(np.int64)


def story(loops, slowest):
    """Yield what is set before each part, and its scans: cold start, load, setpoint, mains, outage and return."""
    holds = (loops.setpoint - loops.ambient) / loops.gain
    load = np.maximum(0.0, np.minimum(loops.rng.uniform(5.0, 15.0, loops.n), 98.0 - holds))
    weak = np.maximum(0.81, np.minimum(1.0, holds / 98.0))
    low = loops.setpoint - 0.2 * (loops.setpoint - loops.ambient)
    at = lambda times: int(times * slowest / loops.dt) + int(loops.rng.integers(0, 30))  # noqa: E731
    for name, value, times in (
            ("mains", 1.0, 9.0), ("load", -load, 5.0), ("load", 0.0, 5.0), ("asked", low, 5.0), ("asked", np.full(loops.n, loops.setpoint), 5.0),
            ("mains", weak, 5.0), ("mains", 1.21, 5.0), ("mains", 1.0, 4.0), (None, 0.0, 0.07), ("mains", 1.0, 5.0),
            (None, 0.0, 2.1), ("mains", 1.0, 9.0)):
        yield name, value, at(times)


def false_trips(heater, document, design, n, seed=1):
    """Return how many of n loops in order trip the second monitor, and by which alarms."""
    loops = Loops(heater, document, design, n, seed, noise=document["noise_degC"])
    watching, tripped = Monitors(document["numbers"], n), np.zeros(n, dtype=np.int64)
    for name, value, scans in story(loops, 1.3 * (heater[1] + heater[2])):
        if name is None:
            watching.again()
        else:
            setattr(loops, name, value)
        for _ in range(scans):
            counts, power = loops.scan(on=name is not None)
            if name is not None:
                alarm = watching.feed(counts, power)
                tripped = np.where(tripped == 0, alarm, tripped)
    return int(np.count_nonzero(tripped)), {NAMES[a]: int((tripped == a).sum()) for a in np.unique(tripped[tripped > 0])}


def broken(heater, document, design, n, fault, seed=2):
    """Return how late the second monitor sees a fault [s], and the hottest of each heater, switched off then [°C].

    Args:
        heater, document, design, n, seed: as for `false_trips`.
        fault: of the loops → value, set when they are at rest.
    """
    slowest = 1.3 * (heater[1] + heater[2])
    loops = Loops(heater, document, design, n, seed, noise=document["noise_degC"])
    watching = Monitors(document["numbers"], n)
    for _ in range(int(9.0 * slowest / loops.dt)):
        watching.feed(*loops.scan())
    for name, value in fault.items():
        setattr(loops, name, value)
    late, hottest = np.full(n, np.nan), loops.t.copy()
    for k in range(int(2.0 * slowest / loops.dt)):
        alarm = watching.feed(*loops.scan())
        hottest = np.maximum(hottest, loops.t)
        new = np.isnan(late) & (alarm > 0)
        late[new] = k * loops.dt
        if new.any():
            loops.mains = np.where(np.isnan(late), loops.mains, 0.0)
            loops.stuck = np.where(np.isnan(late), loops.stuck, 0.0)
    return late, hottest


def kalico_trips(folder, name, times, temperatures, target, top, **given):
    """Return when Klipper's rule, as Kalico's package has it, stops a machine [s], NaN for never; `top`: its max_temp.

    `given` are the lines of its section; those that are not there have their defaults.
    """
    path = next(Path(folder).rglob("klippy/extras/verify_heater.py"))
    loaded = importlib.util.spec_from_file_location("verify_heater", path)
    module = importlib.util.module_from_spec(loaded)
    loaded.loader.exec_module(module)
    now, stopped = [0.0], []

    class Machine:
        """What the rule asks of a printer, its configuration, its heater and its reactor."""

        NEVER, NOW = 1e99, 0.0
        register_event_handler = register_timer = lambda *_: None
        lookup_object = lookup_heater = get_reactor = get_printer = lambda self, *_: self
        get_start_args = staticmethod(dict)
        get_name = staticmethod(lambda: f"verify_heater {name}")
        getfloat = staticmethod(lambda name, default=None, **__: given.get(name, default))
        get_temp = staticmethod(lambda _: (float(np.interp(now[0], times, temperatures)), target))
        invoke_shutdown = staticmethod(stopped.append)

    check = module.HeaterCheck(Machine())
    check.handle_connect()
    at = np.arange(1.0, times[-1], 1.0)
    for moment in at:
        now[0] = moment
        seen = Machine.get_temp(moment)[0]
        if seen > top or seen < 0.0:
            return moment
        check.check_event(moment)
        if stopped:
            return moment
    return np.nan


def marlin_trips(bed, times, temperatures, target, top):
    """Return when the rules that Marlin publishes stop a machine [s]: 40 s and 4 °C (bed: 20 s, 2 °C), and 2 °C in 20 s (60 s)."""
    period, hysteresis, watch = (20.0, 2.0, 60.0) if bed else (40.0, 4.0, 20.0)
    stable, right, aim, until = False, 0.0, None, 0.0
    for moment, seen in zip(times, temperatures, strict=True):
        if seen > top or seen < 0.0:
            return moment
        if seen >= target - hysteresis:
            stable, right = stable or seen >= target, moment
        elif stable and moment - right > period:
            return moment
        if not stable and seen < target - hysteresis - 3.0:
            if aim is None or seen >= aim:
                aim, until = seen + 2.0, moment + watch
            elif moment > until:
                return moment
    return np.nan


def made(name, folder, target="s5-ob251", least_noise=0.05):
    """Return pid.json and supervision.json of a heater, made by the commands."""
    gain, lag, dead, ambient, setpoint, card, _ = HEATERS[name]
    pid, out = folder / f"{name}.json", folder / name
    run = lambda *words: subprocess.run(  # noqa: E731
        [sys.executable, "-m", "heatertune", *map(str, words), "--quiet"], check=False, capture_output=True, text=True)
    run("tune", "--gain", gain, "--time-constant", lag, "--dead-time", dead, "--ambient", ambient, "--target", target, "--setpoint",
        setpoint, "--range", 0, card, "--noise", 0.1, "-o", pid)
    begun = time.monotonic()
    done = run("supervise", pid, "--target", target, "--least-noise", least_noise, "-o", out, "--json")
    if done.returncode:
        raise SystemExit(done.stderr)
    return json.loads(pid.read_text()), json.loads((out / "supervision.json").read_text()), time.monotonic() - begun


def main():
    """Judge the four heaters."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=[], help=f"of {', '.join(HEATERS)}")
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--faults-per-kind", type=int, default=1000)
    parser.add_argument("--kalico", help="folder of Kalico's package")
    settings = parser.parse_args()
    logging.disable(logging.CRITICAL)  # what Klipper's rule says of each machine
    for name in settings.names or HEATERS:
        heater = HEATERS[name]
        with tempfile.TemporaryDirectory() as folder:
            design, document, seconds = made(name, Path(folder))
        trips, why = false_trips(heater, document, design, settings.samples)
        print(f"{name}: {trips} false trips of {settings.samples} {why or ''}; supervise took {seconds:.1f} s", flush=True)
        for told, fault in (("switch stuck on", {"mains": 0.0, "stuck": 100.0}), ("heater open", {"mains": 0.0}), ("half power", {"mains": 0.5})):
            late, hottest = broken(heater, document, design, settings.broken, fault)
            print(f"  {told}: missed {np.isnan(late).sum()}, median {np.nanmedian(late):.1f} s, 95 % {np.nanpercentile(late, 95):.1f} s, "
                  f"worst {np.nanmax(late):.1f} s, hottest {hottest.max():.1f} °C", flush=True)
        if settings.kalico:
            compare(name, heater, document, design, settings.kalico)


def compare(name, heater, document, design, kalico, n=12):
    """Print what Klipper's and Marlin's rules do on n heaters beside the monitor, on the same traces."""
    slowest, top = 1.3 * (heater[1] + heater[2]), heater[6]
    for told, fault, sensor in (
            ("nothing", {}, "right"), ("switch stuck on", {"mains": 0.0, "stuck": 100.0}, "right"), ("heater open", {"mains": 0.0}, "right"),
            ("half power", {"mains": 0.5}, "right"), ("sensor frozen", {}, "frozen"), ("sensor half out", {}, "half")):
        loops = Loops(heater, document, design, n, 3, noise=document["noise_degC"])
        watching, seen, late, true = Monitors(document["numbers"], n), [], np.full(n, np.nan), []
        begins, ends = int(9.0 * slowest / loops.dt), int(12.0 * slowest / loops.dt)
        frozen = None
        original = loops.t
        for k in range(ends):
            if k == begins:
                for field, value in fault.items():
                    setattr(loops, field, value)
            original = loops.t
            noise = loops.noise * loops.rng.standard_normal(n)
            if k >= begins and sensor == "frozen":
                frozen = original + noise if frozen is None else frozen
                shown = frozen
            elif k >= begins and sensor == "half":
                shown = loops.ambient + 0.5 * (original - loops.ambient) + noise
            else:
                shown = original + noise
            counts, power = _step(loops, shown)
            alarm = watching.feed(counts, power)
            new = np.isnan(late) & (alarm > 0)
            late[new] = (k - begins) * loops.dt
            seen.append(shown)
            true.append(original)
        seen, true, times = np.array(seen), np.array(true), np.arange(ends) * loops.dt
        section = "heater_bed" if name == "bed" else "extruder"
        klipper = [kalico_trips(kalico, section, times, column, heater[4], top) for column in seen.T]
        marlin = [marlin_trips(name == "bed", times, column, heater[4], top) for column in seen.T]
        when = {"monitor": late} | {who: np.array(at) - begins * loops.dt for who, at in (("Klipper", klipper), ("Marlin", marlin))}
        print(f"  {told}: " + "; ".join(f"{who} {_told(at)}" + _hot(at, true, begins, loops.dt) for who, at in when.items()), flush=True)


def _step(loops, shown):
    """Let a scan go by whose sensor shows other temperatures."""
    silent = loops.noise
    loops.noise = silent * 0.0
    heated = loops.t.copy()
    loops.t = shown
    counts, power = loops.scan()
    # the heater goes on from where it is, not from what is shown
    loops.t = loops.t + (heated - shown) * loops.keeps
    loops.noise = silent
    return counts, power


def _told(at):
    early, late = np.count_nonzero(at < 0.0), at[at >= 0.0]
    words = [f"{early} of {len(at)} before anything broke"] if early else []
    words += [f"{np.median(late):.0f} s (worst {late.max():.0f})"] if len(late) else ([] if early else ["never"])
    missed = np.isnan(at).sum()
    return ", ".join(words + ([f"{missed} missed"] if missed and len(late) else []))


def _hot(at, true, begins, dt):
    if not (at >= 0.0).any():
        return ""
    ends = [min(begins + int(one / dt), len(true) - 1) for one in at[at >= 0.0]]
    return f" at {max(true[begins:end + 1, i].max() for i, end in zip(np.flatnonzero(at >= 0.0), ends, strict=True)):.0f} °C"


if __name__ == "__main__":
    main()
