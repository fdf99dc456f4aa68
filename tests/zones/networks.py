"""Networks and their logs, by SciPy alone: an integrator of its own, and nothing of heatertune's solution."""

import numpy as np
from scipy.linalg import expm

from heatertune.zones.network import ThermalNetwork


def chain(count, exchange, *, gain=1.2, lag=240.0, dead=12.0, ambient=22.0):
    """Return equal zones in a row, each exchanging heat with its neighbours."""
    matrix = np.zeros((count, count))
    for zone in range(count - 1):
        matrix[zone, zone + 1] = matrix[zone + 1, zone] = exchange
    return ThermalNetwork(
        zones=tuple("abcdefgh"[:count]), gains_degC_per_pct=(gain,) * count, time_constants_s=(lag,) * count,
        dead_times_s=(dead,) * count, ambients_degC=(ambient,) * count, exchange=matrix)


def drawn(random, count):
    """Return a chain with drawn gains, lags, dead times and exchange."""
    matrix = np.zeros((count, count))
    for zone in range(count - 1):
        matrix[zone, zone + 1], matrix[zone + 1, zone] = random.uniform(0.2, 3.0, 2)
    lags = random.uniform(120.0, 500.0, count)
    return ThermalNetwork(
        zones=tuple("abcdefgh"[:count]), gains_degC_per_pct=tuple(random.uniform(0.8, 2.0, count)),
        time_constants_s=tuple(lags), dead_times_s=tuple(random.uniform(5.0, 20.0, count)),
        ambients_degC=tuple(random.uniform(18.0, 24.0, count)), exchange=matrix)


def balance(network):
    """Return A, B and the constant of dT/dt = A·T + B·u(t − L) + constant, straight from the heat balance.

    Behind the zones' temperatures stand the powers of their heating elements [%], where any has a lag of its own. A network
    with other bodies states its own matrices.
    """
    if hasattr(network, "matrices"):
        return network.matrices
    exchange, lag = np.asarray(network.exchange), np.array(network.time_constants_s)[:, None]
    states = (exchange - np.diag(1.0 + exchange.sum(axis=1))) / lag
    powers = np.diag(np.array(network.gains_degC_per_pct)) / lag
    constant = np.array(network.ambients_degC) / lag[:, 0]
    if not any(network.second_time_constants_s):
        return states, powers, constant
    elements = np.diag(1.0 / np.array(network.second_time_constants_s))
    zero = np.zeros_like(states)
    return (np.block([[states, powers], [zero, -elements]]), np.vstack([zero, elements]),
            np.concatenate([constant, np.zeros(len(constant))]))


def at_rest(network):
    """Return the zones' temperatures without power and their rise per percent of each power, shapes (n,) and (n, n)."""
    states, inputs, constant = balance(network)
    count = inputs.shape[1]
    return np.linalg.solve(states, -constant)[:count], np.linalg.solve(states, -inputs)[:count]


def stepped(network, step_s):
    """Return the exact step of a network: its states, of its powers, and of its constant, shapes (m, m), (m, n), (m,)."""
    states, inputs, constant = balance(network)
    size = len(constant)
    block = np.zeros((2 * size, 2 * size))
    block[:size, :size], block[:size, size:] = states, np.eye(size)
    exact = expm(block * step_s)
    return exact[:size, :size], exact[:size, size:] @ inputs, exact[:size, size:] @ constant


def logged(network, powers, step_s, every, random=None, noise=0.0, warmer_degC=None):
    """Return instants, readings and powers: the powers change on the grid of `step_s`, every so many steps a row.

    Args:
        network: the heaters.
        powers: at each step, shape (N, n) [%].
        step_s: [s].
        every: so many steps a row.
        random: of the noise.
        noise: standard deviation of the readings' noise [°C].
        warmer_degC: by how much the ambient of all zones differs at each step, shape (N,); None: not at all [°C].
    """
    states, inputs, constant = balance(network)
    count = inputs.shape[1]
    move, drive, still = stepped(network, step_s)
    late = [round(dead / step_s) for dead in network.dead_times_s]
    state = np.linalg.solve(states, -(inputs @ powers[0] + constant))
    rows, warmth = [], np.zeros(len(powers)) if warmer_degC is None else warmer_degC
    for k in range(len(powers)):
        rows.append(state[:count])
        arriving = np.array([powers[max(k - late[i], 0), i] for i in range(count)])
        state = move @ (state - warmth[k]) + warmth[k] + drive @ arriving + still
    readings = np.array(rows)[::every]
    if noise:
        readings = np.round(readings + random.normal(0.0, noise, readings.shape), 2)
    return np.arange(len(powers))[::every] * step_s, readings, powers[::every]


def steps(count, length, low=20.0, high=50.0):
    """Return powers that rise and fall zone after zone, shape (length, count)."""
    powers = np.full((length, count), low)
    for zone in range(count):
        begin = int((zone + 0.3) * length / (count + 0.5))
        powers[begin : begin + length // (count + 1), zone] = high
    return powers


def radius(network, designs, interval_s, delay_s, added=0.0):
    """Return the largest eigenvalue of the coupled sampled PI loops, dead times in whole samples, rounded up.

    `added`: power that zone i gets for each degree of zone j, shape (n, n) [%/°C].
    """
    move, drive, _ = stepped(network, interval_s)
    bodies, count = len(move), len(designs)
    late = int(np.ceil((max(network.dead_times_s) + delay_s) / interval_s))
    gain = np.diag([design.gain_pct_per_degC for design in designs])
    share = np.diag([interval_s / design.integral_time_s for design in designs])
    size = bodies + count * (late + 1)
    matrix, one = np.zeros((size, size)), np.eye(count)
    begins = [bodies + k * count for k in range(late + 1)]
    at = [slice(0, count), *(slice(begin, begin + count) for begin in begins)]  # temperatures, powers on their way, sums
    matrix[:bodies, :bodies], matrix[:bodies, at[late]] = move, drive
    matrix[at[-1], at[-1]], matrix[at[-1], at[0]] = one, -one
    matrix[at[1], at[0]], matrix[at[1], at[-1]] = added - gain @ (one + share), gain @ share
    for k in range(2, late + 1):
        matrix[at[k], at[k - 1]] = one
    return float(np.abs(np.linalg.eigvals(matrix)).max())
