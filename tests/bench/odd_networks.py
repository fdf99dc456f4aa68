"""Zones and logs of kinds that `networks` does not draw: whatever passes is judged on the true heaters by `zone_judge`.

    python -m tests.bench.odd_networks [COUNT [SEED [KIND…]]]

ring: five to eight zones in a ring, listed in any order, two of them across it. slow: one zone ten times slower. late: dead times
longer than lags. elements: a heating element in each zone. shield: each zone's sensor is a body of its own, which the air cools.
mass: all zones on one slow mass. hidden: an oven next to the zones warms up, and is not logged. drift: the ambient wanders. uneven:
rows at random instants, and a gap. together: all powers move at the same instants, by shares of their own. short: steps of a third of
what the zones need. coarse: readings of half a degree. pulses: powers logged as pulses of 0 and 100 %. by-thermostat: the log is one
of thermostats. door: a zone loses heat for a while. five-on-supply: five heaters take power from each other. hot and cold: setpoints
that need 60 to 85 %, or 3 to 8 %. pid: PID, not PI. relay: a PWM of 20 s with pulses of at least 1 s. seldom: called every 20 s.
noisy: readings with 0.5 °C of noise.
"""

import sys
import time
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from heatertune.errors import HeatertuneError
from heatertune.plc import Scaling
from heatertune.settings import Conditions
from heatertune.zones import design_zones, fit_network
from heatertune.zones.identify import ZoneLog
from tests.bench.networks import TARGETS, complaint_of, on_one_supply
from tests.bench.zone_judge import judge, settling
from tests.zones.networks import at_rest, balance, drawn, logged, steps

LOW_PCT, HIGH_PCT = 15.0, 65.0
#: kind → powers between which the setpoints are held [%], and arguments of the design, where they are others
HELD_PCT = {"hot": (60.0, 85.0), "cold": (3.0, 8.0)}
SETTINGS = {"pid": {"structure": "pid"}, "seldom": {"sample_time_s": 20.0},
            "relay": {"conditions": Conditions(pwm_period_s=20.0, minimum_on_s=1.0)}}


@dataclass(frozen=True, slots=False, kw_only=True)
class Bodies:
    """Heaters that are no network of zones: matrices of their heat balance, the zones' temperatures first.

    Attributes:
        matrices: A, B and the constant of dT/dt = A·T + B·u + constant.
        zones, dead_times_s, time_constants_s, supply_shares: as of `heatertune.zones.network.ThermalNetwork`.
    """

    matrices: tuple
    zones: tuple
    dead_times_s: tuple
    time_constants_s: tuple
    supply_shares: tuple = field(default=())


class Case(NamedTuple):
    """A drawn case: its verdict, what the judge says of it, processor time [s] and the summary."""

    verdict: str
    complaint: str
    seconds: float
    summary: str


def ring(random):
    """Return five to eight zones in a ring in any order, two of them joined across it."""
    network = drawn(random, int(random.integers(5, 9)))
    count = len(network.zones)
    order, exchange = random.permutation(count), np.zeros((count, count))
    across = tuple(random.choice(count, 2, replace=False))
    for one, other in [*((order[k], order[(k + 1) % count]) for k in range(count)), across]:
        exchange[one, other], exchange[other, one] = random.uniform(0.2, 2.0, 2)
    return replace(network, exchange=exchange)


def slow(random):
    """Return three zones, one of them ten times slower."""
    network = drawn(random, 3)
    zone = int(random.integers(3))
    lags = [lag * (10.0 if number == zone else 0.5) for number, lag in enumerate(network.time_constants_s)]
    return replace(network, time_constants_s=tuple(lags))


def late(random):
    """Return two or three zones whose dead times are longer than their lags."""
    network = drawn(random, int(random.integers(2, 4)))
    lags = random.uniform(30.0, 80.0, len(network.zones))
    return replace(network, time_constants_s=tuple(lags), dead_times_s=tuple(lags * random.uniform(1.0, 2.0, len(lags))))


def elements(random):
    """Return two to four zones, each with a heating element."""
    network = drawn(random, int(random.integers(2, 5)))
    shares = random.uniform(0.05, 0.5, len(network.zones))
    return replace(network, second_time_constants_s=tuple(shares * np.array(network.time_constants_s)))


def shield(random):
    """Return three zones whose sensors stand behind a body that the air cools a little."""
    network = drawn(random, 3)
    states, inputs, constant = balance(network)
    lag, loss = random.uniform(10.0, 80.0, 3), random.uniform(0.0, 0.3, 3)
    sensors = np.hstack([-np.diag((1.0 + loss) / lag), np.diag(1.0 / lag)])
    whole = np.vstack([sensors, np.hstack([np.zeros((3, 3)), states])])
    air = loss * np.array(network.ambients_degC) / lag
    return _bodies(network, (whole, np.vstack([np.zeros((3, 3)), inputs]), np.concatenate([air, constant])))


def mass(random):
    """Return three fast zones on one slow mass, through which alone they exchange heat."""
    network = replace(drawn(random, 3), exchange=np.zeros((3, 3)))
    states, inputs, constant = balance(network)
    held, lag = random.uniform(0.5, 3.0, 3), np.array(network.time_constants_s)
    whole = np.zeros((4, 4))
    whole[:3, :3] = states - np.diag(held / lag)
    whole[:3, 3] = held / lag
    slowest = random.uniform(5.0, 20.0) * lag.max()
    whole[3, :3], whole[3, 3] = held / slowest, -(held.sum() + random.uniform(0.1, 1.0)) / slowest
    still = [*constant, 20.0 * -(whole[3].sum())]
    return _bodies(network, (whole, np.vstack([inputs, np.zeros(3)]), np.array(still)),
                   lags=(*network.time_constants_s[:2], slowest))


def _bodies(network, matrices, lags=None):
    return Bodies(matrices=matrices, zones=network.zones, dead_times_s=network.dead_times_s,
                  time_constants_s=lags or network.time_constants_s)


#: kinds whose heaters differ; all others are two to four zones in a row with another log
HEATERS = {each.__name__: each for each in (ring, slow, late, elements, shield, mass)}
LOGS = ("hidden", "drift", "uneven", "together", "short", "coarse", "pulses", "by-thermostat", "door", "five-on-supply", "hot", "cold", "pid", "relay", "seldom",
        "noisy")
KINDS = (*HEATERS, *LOGS)


def heaters(kind, random):
    """Return the true heaters of a kind."""
    if kind in HEATERS:
        return HEATERS[kind](random)
    if kind == "five-on-supply":
        return on_one_supply(drawn(random, 5), random, 0.1, 0.3)
    return drawn(random, int(random.integers(2, 5)))


def course(kind, network, random):
    """Return the logged powers, one for each second, shape (N, n) [%]."""
    count = len(network.zones)
    slowest = int(6 * max(network.time_constants_s))
    length = int(2.0 * slowest + 1500 * count) if kind != "short" else int(0.3 * slowest) * (count + 1)
    last = np.full((slowest // (4 if kind == "short" else 1), count), 90.0 if kind == "hot" else 45.0)
    powers = np.vstack([steps(count, length, LOW_PCT, HIGH_PCT), last])
    if kind == "together":
        shares = random.uniform(0.3, 1.0, count)
        powers = LOW_PCT + (powers.max(axis=1, keepdims=True) - LOW_PCT) * shares
    if kind == "pulses":
        second = np.arange(len(powers))[:, None] % 20
        powers = np.where(second < np.round(powers / 5.0), 100.0, 0.0)
    return powers


def by_thermostat(network, powers, random):
    """Return the powers of thermostats: 70 % below a setpoint, 5 % above it; setpoints move zone after zone."""
    states, inputs, constant = balance(network)
    count, band = len(network.zones), 0.5
    cold, rise = at_rest(network)
    middle = cold + rise @ np.full(count, 35.0)
    wanted = middle + (powers - powers.min()) / np.ptp(powers) * 0.3 * (middle - cold)
    given, on, state = np.zeros_like(powers), np.ones(count, dtype=bool), np.linalg.solve(states, -constant)
    dead = [round(each) for each in network.dead_times_s]
    for k in range(len(powers)):
        on = np.where(state[:count] > wanted[k] + band, False, np.where(state[:count] < wanted[k] - band, True, on))
        given[k] = np.where(on, 70.0, 5.0)
        arriving = np.array([given[k - dead[i], i] if k >= dead[i] else 0.0 for i in range(count)])
        state = state + states @ state + inputs @ arriving + constant
    return given


def log_of(kind, network, random):
    """Return the log of heaters, a row every 2 s where the kind says nothing else."""
    count, powers, warmer, reaching = len(network.zones), course(kind, network, random), None, None
    if kind == "by-thermostat":
        powers = by_thermostat(network, powers, random)
    true, seconds = network, np.arange(len(powers))
    if kind == "drift":
        warmer = random.uniform(1.0, 3.0) * np.sin(2.0 * np.pi * (seconds / len(powers) * random.uniform(0.3, 2.0) + random.random()))
    if kind == "door":
        reaching = powers.copy()
        begin = int(random.uniform(0.1, 0.7) * len(powers))
        reaching[begin: begin + len(powers) // 6, int(random.integers(count))] -= random.uniform(5.0, 20.0)
    if kind == "hidden":
        true, reaching = _with_neighbour(network, powers, random)
    if kind == "five-on-supply":
        lost = powers @ np.diag(network.supply_shares) / 100.0
        reaching = powers * (1.0 - (lost.sum(axis=1, keepdims=True) - lost))
    instants, readings, _ = logged(true, powers if reaching is None else reaching, 1.0, 1, random, 0.03, warmer)
    readings, rows = readings[:, :count], np.arange(0, len(powers), 2)
    if kind == "noisy":
        readings = np.round(readings + random.normal(0.0, 0.5, readings.shape), 2)
    if kind == "coarse":
        readings = 0.5 * np.round(2.0 * readings)
    if kind == "uneven":
        rows = np.unique(np.cumsum(1 + random.geometric(0.2, len(powers) // 6)))
        gap = int(random.uniform(0.2, 0.8) * len(powers))
        rows = rows[(rows < len(powers)) & ~((rows > gap) & (rows < gap + 200))]
    return ZoneLog(name=kind, zones=network.zones, time_s=instants[rows], temperatures_degC=readings[rows],
                   powers_pct=powers[rows])


def _with_neighbour(network, powers, random):
    """Return the zones with a heater that nobody logs next to the last one, and the powers with its own."""
    count = len(network.zones)
    exchange = np.zeros((count + 1, count + 1))
    exchange[:count, :count] = network.exchange
    exchange[count - 1, count], exchange[count, count - 1] = random.uniform(0.2, 1.5, 2)
    wider = replace(network, zones=(*network.zones, "unlogged"), exchange=exchange, **{
        name: (*getattr(network, name), getattr(network, name)[-1])
        for name in ("gains_degC_per_pct", "time_constants_s", "dead_times_s", "ambients_degC", "second_time_constants_s")})
    own = np.where(np.arange(len(powers)) < random.uniform(0.2, 0.6) * len(powers), 15.0, random.uniform(20.0, 40.0))
    return wider, np.column_stack([powers, own])


def case(kind, seed):
    """Return what becomes of one drawn case of a kind."""
    begun, random = time.process_time(), np.random.default_rng([seed, KINDS.index(kind)])
    network = heaters(kind, random)
    log = log_of(kind, network, random)
    cold, rise = at_rest(network)
    setpoints = (cold + rise @ random.uniform(*HELD_PCT.get(kind, (25.0, 40.0)), len(network.zones))).round(1)
    try:
        proof = design_zones(fit_network(log), TARGETS[seed % 2], list(setpoints), scaling=Scaling(low_degC=0.0, high_degC=400.0),
                             **SETTINGS.get(kind, {}))
    except HeatertuneError as problem:
        return Case("refused", "", time.process_time() - begun, str(problem))
    complaint = ""
    if proof.verdict == "PASS" and kind == "pid":  # the eigenvalues of the judge are those of PI
        complaint = judge(network, proof, settle_s=settling(network, proof, proof.design.radius), seed=seed)
    elif proof.verdict == "PASS":
        complaint = complaint_of(network, proof, random)
    return Case(proof.verdict, complaint, time.process_time() - begun, proof.summary())


def run(count=3, first=0, kinds=KINDS):
    """Print a line for each case, and the totals of each kind."""
    for kind in kinds:
        verdicts, false = Counter(), 0
        for seed in range(first, first + count):
            found = case(kind, seed)
            verdicts[found.verdict] += 1
            false += bool(found.complaint)
            why = "" if found.verdict == "PASS" else " | ".join(found.summary.splitlines()[:3])
            print(f"{kind} {seed}: {found.verdict}{f', FALSE: {found.complaint}' if found.complaint else ''} {found.seconds:.1f} s {why}",
                  flush=True)
        print(f"{kind}: {dict(verdicts)}; {false} false PASS", flush=True)


if __name__ == "__main__":
    run(*map(int, sys.argv[1:3]), *([tuple(sys.argv[3:])] if len(sys.argv) > 3 else []))
