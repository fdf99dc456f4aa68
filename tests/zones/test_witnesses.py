"""python-control and CasADi beside the joint design of two zones: they take the words alone, and SciPy's heat balance."""

from dataclasses import replace

import casadi
import control
import numpy as np
import pytest

from heatertune.plc import Scaling, controller_for
from heatertune.zones import network_by_hand
from heatertune.zones.joint_tuning import JointTuner
from tests.zones.networks import balance, chain

INTERVAL_S = 4.0
SCANS_LATE = (3, 2)  # dead time and the controller's own delay together


@pytest.fixture(scope="module")
def network():
    delay = controller_for("s7-300").delayed_s(Scaling())
    return replace(chain(2, 2.0, gain=1.2), time_constants_s=(240.0, 180.0), gains_degC_per_pct=(1.2, 0.9),
                   dead_times_s=tuple(INTERVAL_S * scans - delay for scans in SCANS_LATE))


@pytest.fixture(scope="module")
def design(network):
    return next(JointTuner(network_by_hand(network), "s7-300", sample_time_s=INTERVAL_S).designs())


def plant_of(network):
    """Return the sampled network, a state for each scan that a power is on its way."""
    states, inputs, _ = balance(network)
    late = control.append(*(control.ss(np.eye(scans, k=-1), np.eye(scans, 1), np.eye(1, scans, k=scans - 1), 0.0, INTERVAL_S)
                            for scans in SCANS_LATE))
    return control.series(late, control.c2d(control.ss(states, inputs, np.eye(2), 0.0), INTERVAL_S, "zoh"))


def controllers_of(words):
    """Return FB41's PI as its manual prints it: GAIN·(e + SAMPLE/RESET·Σe), the range 0…100 °C as 0…100 %."""
    gains, times = (np.array([each.values[name] for each in words]) for name in ("GAIN", "RESET"))
    share = np.diag(gains * INTERVAL_S * 1000.0 / times)
    return control.ss(np.eye(2), np.eye(2), share, np.diag(gains) + share, INTERVAL_S)


def response_of(system, omega):
    """Return the frequency response, shape (outputs, inputs, n)."""
    return system(np.exp(1j * omega * INTERVAL_S), squeeze=False)


def test_python_control_finds_the_largest_sensitivity_and_the_poles_of_the_words(network, design):
    loop = control.series(controllers_of(design.words), plant_of(network))
    sensitivity = control.feedback(control.ss([], [], [], np.eye(2), INTERVAL_S), loop)
    assert np.abs(control.poles(sensitivity)).max() == pytest.approx(design.radius, abs=1e-9)
    omega = np.geomspace(1e-4, np.pi / INTERVAL_S, 2000)
    largest = np.linalg.svd(np.moveaxis(response_of(sensitivity, omega), 2, 0), compute_uv=False)
    assert largest.max() == pytest.approx(design.joint_ms, rel=2e-3)
    alone = [np.abs(1.0 / (1.0 + response_of(loop[zone, zone], omega))).max() for zone in range(2)]
    assert max(alone) == pytest.approx(design.alone_ms, rel=2e-3)


def test_an_optimum_of_casadi_under_the_same_robustness_is_little_better(network, design):
    """IPOPT minimises Σ TN/K, the sum of the integrated errors of loads, under the joint and single Ms that the words have."""
    omega = np.geomspace(5e-3, np.pi / INTERVAL_S, 80)
    response = response_of(plant_of(network), omega)
    integral = 1.0 / (1.0 - np.exp(-1j * omega * INTERVAL_S))
    logs = casadi.SX.sym("log_gain_and_time", 4)
    gains, shares = casadi.exp(logs[:2]), INTERVAL_S / casadi.exp(logs[2:])

    def product(one, other):
        return one[0] * other[0] - one[1] * other[1], one[0] * other[1] + one[1] * other[0]

    limits = []
    for place in range(len(omega)):
        entry = [[None, None], [None, None]]  # of I + G·C, real and imaginary part
        for zone in range(2):
            for other in range(2):
                factor = gains[other] * (1.0 + shares[other] * integral[place].real), gains[other] * shares[other] * integral[place].imag
                real, imaginary = product((response[zone, other, place].real, response[zone, other, place].imag), factor)
                entry[zone][other] = real + (zone == other), imaginary
        squares = sum(part**2 for row in entry for each in row for part in each)
        one, two = product(entry[0][0], entry[1][1]), product(entry[0][1], entry[1][0])
        determinant = (one[0] - two[0]) ** 2 + (one[1] - two[1]) ** 2
        # σ² of the smaller singular value solves σ⁴ − squares·σ² + determinant = 0
        least = 1.0 / design.joint_ms**2
        limits.append(least**2 - squares * least + determinant)
        limits += [entry[zone][zone][0] ** 2 + entry[zone][zone][1] ** 2 - 1.0 / design.alone_ms**2 for zone in range(2)]
    start = [np.log(each.gain_pct_per_degC) for each in design.designs] + [np.log(each.integral_time_s) for each in design.designs]
    cost = casadi.sum1(casadi.exp(logs[2:] - logs[:2]))
    solver = casadi.nlpsol("joint", "ipopt", {"x": logs, "f": cost, "g": casadi.vertcat(*limits)},
                           {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"})
    found = solver(x0=np.array(start) - [0.2, 0.2, -0.2, -0.2], lbg=0.0, ubg=np.inf, lbx=np.array(start) - 3.0, ubx=np.array(start) + 3.0)
    assert solver.stats()["success"]
    ours = sum(each.integral_time_s / each.gain_pct_per_degC for each in design.designs)
    assert 1.0 <= ours / float(found["f"]) <= 1.1
    optimum = np.exp(np.array(found["x"]).ravel())
    factors = optimum[:2, None] * (1.0 + INTERVAL_S / optimum[2:, None] * integral)
    difference = np.moveaxis(response * factors, 2, 0) + np.eye(2)
    assert 1.0 / np.linalg.svd(difference, compute_uv=False).min() == pytest.approx(design.joint_ms, rel=1e-2)
