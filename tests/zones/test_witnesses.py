"""python-control and CasADi beside joint designs: they take the words alone, and SciPy's heat balance.

PI and PID of the S7-300's tip and of OB251; two zones and three.
"""

from dataclasses import replace
from itertools import permutations

import casadi
import control
import numpy as np
import pytest

from heatertune.plc import Scaling, controller_for
from heatertune.zones import network_by_hand
from heatertune.zones.joint_tuning import JointTuner
from tests.zones.networks import balance, chain

INTERVAL_S = 4.0
SCANS_LATE = (3, 2, 4)  # dead time and the controller's own delay together

CASES = [("s7-300", "pi", 2), ("s7-300", "pid", 2), ("s5-ob251", "pi", 2), ("s5-ob251", "pid", 2),
         ("s7-300", "pi", 3), ("s5-ob251", "pi", 3)]


class Case:
    """A network, its design for a target, and what the witnesses make of both."""

    def __init__(self, target, structure, count):
        delay = controller_for(target).delayed_s(Scaling())
        self.count = count
        self.network = replace(
            chain(count, 2.0), time_constants_s=(240.0, 180.0, 300.0)[:count], gains_degC_per_pct=(1.2, 0.9, 1.4)[:count],
            dead_times_s=tuple(INTERVAL_S * scans - delay for scans in SCANS_LATE[:count]))
        self.design = next(JointTuner(
            network_by_hand(self.network), target, structure=structure, sample_time_s=INTERVAL_S).designs())
        terms = {"s7-300": tip_terms, "s5-ob251": ob251_terms}[target]
        #: share of the D part that is that of the scan before; table 11-11 of OB251 takes the mean of both
        self.of_last = {"s7-300": 0.0, "s5-ob251": 0.5}[target]
        #: proportional [%/°C], integral and derivative [of it, per scan] parts of each zone
        self.terms = np.array([terms(words.values) for words in self.design.words])

    def plant(self):
        """Return the sampled network, a state for each scan that a power is on its way."""
        states, inputs, _ = balance(self.network)
        late = control.append(*(
            control.ss(np.eye(scans, k=-1), np.eye(scans, 1), np.eye(1, scans, k=scans - 1), 0.0, INTERVAL_S)
            for scans in SCANS_LATE[:self.count]))
        return control.series(late, control.c2d(control.ss(states, inputs, np.eye(self.count), 0.0), INTERVAL_S, "zoh"))

    def controllers(self):
        """Return the controllers, each with the sum of its errors, its last error and its last D part as states."""
        gain, share, slope = self.terms.T
        one, none, moved = np.eye(self.count), np.zeros((self.count, self.count)), np.diag((1.0 - self.of_last) * slope)
        return control.ss(
            np.block([[one, none, none], [none, none, none], [none, -moved, self.of_last * one]]),
            np.vstack([one, one, moved]), np.diag(gain) @ np.hstack([np.diag(share), -moved, self.of_last * one]),
            np.diag(gain) @ (np.diag(1.0 + share) + moved), INTERVAL_S)


def tip_terms(values):
    """Return the parts of the tip's words, as it is printed: GAIN·(e + SAMPLE/RESET·Σe + RATE/SAMPLE·Δ), 0…100 °C as 0…100 %."""
    return values["GAIN"], values["SAMPLE"] / values["RESET"], values["RATE"] / values["SAMPLE"]


def ob251_terms(values):
    """Return the parts of OB251's words, tables 11-10 and 11-11: K·(R·e + TI·Σe + TD·Δe), K, R and TI in 1/1024."""
    return values["K"] * values["R"] / 1024.0**2, values["TI"] / values["R"], 1024.0 * values["TD"] / values["R"]


#: IPOPT's optimum is 1.15 times better there: of OB251's derivative time, only whole multiples of TA can be entered
COARSE = ("s5-ob251", "pid", 2)


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(map(str, case)))
def case(request):
    return Case(*request.param)


def response_of(system, omega):
    """Return the frequency response, shape (outputs, inputs, n)."""
    return system(np.exp(1j * omega * INTERVAL_S), squeeze=False)


@pytest.mark.long
def test_python_control_finds_the_largest_sensitivity_and_the_poles_of_the_words(case):
    loop = control.series(case.controllers(), case.plant())
    sensitivity = control.feedback(control.ss([], [], [], np.eye(case.count), INTERVAL_S), loop)
    assert np.abs(control.poles(sensitivity)).max() == pytest.approx(case.design.radius, abs=1e-9)
    omega = np.geomspace(1e-4, np.pi / INTERVAL_S, 2000)
    largest = np.linalg.svd(np.moveaxis(response_of(sensitivity, omega), 2, 0), compute_uv=False)
    assert largest.max() == pytest.approx(case.design.joint_ms, rel=2e-3)
    alone = [np.abs(1.0 / (1.0 + response_of(loop[zone, zone], omega))).max() for zone in range(case.count)]
    assert max(alone) == pytest.approx(case.design.alone_ms, rel=2e-3)


def product(factors):
    """Return the product of complex numbers of real and imaginary part."""
    real, imaginary = 1.0, 0.0
    for one, two in factors:
        real, imaginary = real * one - imaginary * two, real * two + imaginary * one
    return real, imaginary


def determinant(matrix):
    """Return the real part of the determinant of a matrix of such numbers, by Leibniz's formula."""
    places = range(len(matrix))
    return sum((-1.0) ** sum(order[i] > order[j] for i in places for j in places[i + 1:])
               * product([matrix[i][order[i]] for i in places])[0] for order in permutations(places))


@pytest.mark.long
@pytest.mark.parametrize("case", [each for each in CASES if each != COARSE], indirect=True)
def test_an_optimum_of_casadi_under_the_same_robustness_is_little_better(case):
    """IPOPT minimises Σ TN/K, the sum of the integrated errors of loads, under the joint and single Ms that the words have.

    Derivative times stay those of the words. σ, the smallest singular value of M = I + G·C, keeps its limit while the
    determinant of MᴴM − σ²·I stays positive.
    """
    places, (_, shares, slopes) = range(case.count), case.terms.T
    omega = np.geomspace(5e-3, np.pi / INTERVAL_S, 80)
    response = response_of(case.plant(), omega)
    before = np.exp(-1j * omega * INTERVAL_S)
    integral, past = 1.0 / (1.0 - before), (1.0 - case.of_last) * (1.0 - before) / (1.0 - case.of_last * before)
    logs = casadi.SX.sym("log_gain_and_time", 2 * case.count)
    gains, times = casadi.exp(logs[:case.count]), casadi.exp(logs[case.count:])
    least, limits = 1.0 / case.design.joint_ms**2, []
    for k in range(len(omega)):
        parts = [(1.0 + INTERVAL_S / times[zone] * integral[k].real + slopes[zone] * past[k].real,
                  INTERVAL_S / times[zone] * integral[k].imag + slopes[zone] * past[k].imag) for zone in places]
        entry = [[product([(response[i, j, k].real, response[i, j, k].imag), (gains[j], 0.0), parts[j]]) for j in places]
                 for i in places]
        entry = [[(real + (i == j), imaginary) for j, (real, imaginary) in enumerate(row)] for i, row in enumerate(entry)]
        squares = [[(0.0, 0.0)] * case.count for _ in places]
        for i in places:
            for j in places:
                terms = [product([(entry[row][i][0], -entry[row][i][1]), entry[row][j]]) for row in places]
                squares[i][j] = sum(real for real, _ in terms) - least * (i == j), sum(imaginary for _, imaginary in terms)
        limits.append(determinant(squares))
        limits += [entry[zone][zone][0] ** 2 + entry[zone][zone][1] ** 2 - 1.0 / case.design.alone_ms**2 for zone in places]
    start = np.log(np.concatenate([case.terms[:, 0], INTERVAL_S / shares]))
    solver = casadi.nlpsol("joint", "ipopt", {"x": logs, "f": casadi.sum1(times / gains), "g": casadi.vertcat(*limits)},
                           {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"})
    calm = np.repeat([0.2, -0.2], case.count)
    found = solver(x0=start - calm, lbg=0.0, ubg=np.inf, lbx=start - 3.0, ubx=start + 3.0)
    assert solver.stats()["success"]
    ours = float(np.sum(np.exp(start[case.count:] - start[:case.count])))
    # all zones are tuned for one Ms; IPOPT trades gain for a shorter integral time, most in the slowest of three
    assert 1.0 <= ours / float(found["f"]) <= (1.1 if case.count == 2 else 1.15)
    optimum = np.exp(np.array(found["x"]).ravel())
    factors = optimum[:case.count, None] * (
        1.0 + INTERVAL_S / optimum[case.count:, None] * integral + slopes[:, None] * past)
    difference = np.moveaxis(response * factors, 2, 0) + np.eye(case.count)
    assert 1.0 / np.linalg.svd(difference, compute_uv=False).min() == pytest.approx(case.design.joint_ms, rel=1e-2)
