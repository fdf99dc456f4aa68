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
    """Return A, B and the constant of dT/dt = A·T + B·u(t − L) + constant, straight from the heat balance."""
    exchange, lag = np.asarray(network.exchange), np.array(network.time_constants_s)[:, None]
    states = (exchange - np.diag(1.0 + exchange.sum(axis=1))) / lag
    powers = np.diag(np.array(network.gains_degC_per_pct)) / lag
    return states, powers, np.array(network.ambients_degC) / lag[:, 0]


def logged(network, powers, step_s, every, random=None, noise=0.0):
    """Return instants, readings and powers: the powers change on the grid of `step_s`, every so many steps a row."""
    states, inputs, constant = balance(network)
    count = len(constant)
    block = np.zeros((2 * count, 2 * count))
    block[:count, :count], block[:count, count:] = states, np.eye(count)
    exact = expm(block * step_s)
    move, drive = exact[:count, :count], exact[:count, count:]
    late = [round(dead / step_s) for dead in network.dead_times_s]
    temperature = np.linalg.solve(states, -(inputs @ powers[0] + constant))
    rows = []
    for k in range(len(powers)):
        rows.append(temperature)
        arriving = np.array([powers[max(k - late[i], 0), i] for i in range(count)])
        temperature = move @ temperature + drive @ (inputs @ arriving + constant)
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


def radius(network, designs, interval_s, delay_s):
    """Return the largest eigenvalue of the coupled sampled PI loops, dead times in whole samples, rounded up."""
    states, inputs, _ = balance(network)
    count = len(designs)
    block = np.zeros((2 * count, 2 * count))
    block[:count, :count], block[:count, count:] = states, inputs
    exact = expm(block * interval_s)
    late = int(np.ceil((max(network.dead_times_s) + delay_s) / interval_s))
    gain = np.diag([design.gain_pct_per_degC for design in designs])
    share = np.diag([interval_s / design.integral_time_s for design in designs])
    size = count * (late + 2)
    matrix, one = np.zeros((size, size)), np.eye(count)
    at = [slice(k * count, (k + 1) * count) for k in range(late + 2)]  # temperatures, powers on their way, sums
    matrix[at[0], at[0]], matrix[at[0], at[late]] = exact[:count, :count], exact[:count, count:]
    matrix[at[-1], at[-1]], matrix[at[-1], at[0]] = one, -one
    matrix[at[1], at[0]], matrix[at[1], at[-1]] = -gain @ (one + share), gain @ share
    for k in range(2, late + 1):
        matrix[at[k], at[k - 1]] = one
    return float(np.abs(np.linalg.eigvals(matrix)).max())
