"""What a controller's words do on a heater whose truth is known: stable or not, and the largest sensitivity.

Nothing of heatertune is used. The heater is linearised where it is to be held, by differences, on either side; sampled
exactly, the dead time with its fraction; closed by the words as their manuals give them; judged by the eigenvalues of
the closed loop and by 1/|1 + L| on a dense grid of frequencies.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

_MOST_STATES = 400  # beyond them encirclements are counted instead of eigenvalues
_S7_200_COUNTS = 255.0  # one byte over the sensor range


@dataclass(frozen=True)
class Law:
    """u = K·(e + I-part + D-part) at calls every `interval` seconds.

    Attributes:
        k: [%/°C].
        i_now, i_before: what this and the last error add to the integral at a call, as a share of K.
        d: what a change of the error gives, as a share of K.
        past: weight of its own past in the D part.
        interval: [s].
        slope: weights of the latest errors, the newest first, whose sum is the change that the D part takes.
    """

    k: float
    i_now: float
    i_before: float
    d: float
    past: float
    interval: float
    slope: tuple[float, ...] = (1.0, -1.0)

    def polynomials(self):
        """Return numerator and denominator in powers of 1/z."""
        one = np.array([1.0, -1.0])
        filtered = np.array([1.0, -self.past])
        p = np.convolve(one, filtered)
        i = np.convolve([self.i_now, self.i_before], filtered)
        slope = np.array(self.slope) * self.d * (1.0 - self.past)
        d = np.convolve(one, slope)
        if self.i_now == self.i_before == 0.0:  # without an I part the pole at 1 would stay uncontrolled
            return self.k * _sum(filtered, slope), _longer(filtered, len(slope))
        return self.k * _sum(p, i, d), _longer(p, len(d))


def _sum(*polynomials):
    return sum(_longer(each, max(map(len, polynomials))) for each in polynomials)


def _longer(polynomial, length):
    """Return it with zeros behind: as many coefficients of powers of 1/z as another one has."""
    return np.pad(polynomial, (0, max(0, length - len(polynomial))))


#: names of the three gains, and the output at full power
_PARALLEL = {"arduino-pid": (("Kp", "Ki", "Kd"), 255.0), "simple-pid": (("Kp", "Ki", "Kd"), 100.0), "esphome": (("kp", "ki", "kd"), 1.0)}


def law_of(target, v, low, high, interval):
    """Return what words do, by the manuals' equations.

    Args:
        target: name of the controller.
        v: word → number.
        low, high: ends of the sensor's range [°C].
        interval: at which the controller is called [s].
    """
    span = high - low
    if target == "s5-ob251":  # dY = K·(R·(e − e₋) + TI·e + dD), 1/1024 each, shares of the ranges
        r, ti = v["R"] / 1024.0, v["TI"] / 1024.0
        return Law(v["K"] / 1024.0 * r * 100.0 / span, ti / r, 0.0, v["TD"] / r, 0.5, interval)
    if target == "s7-300":  # shares of the ranges, RESET and RATE in ms, SAMPLE is the interval they count with
        reset = v["SAMPLE"] / v["RESET"] if v["RESET"] else 0.0
        return Law(v["GAIN"] * 100.0 / span, reset, 0.0, v["RATE"] / v["SAMPLE"], 0.0, interval)
    if target == "fb41":  # PV = percent·PV_FAC + PV_OFF; trapezoids; D part of a bilinear lag
        ta, ti, td = float(v["CYCLE"]), max(v["TI"], v["CYCLE"] / 2.0), max(v["TD"], v["CYCLE"])
        lag = max(v["TM_LAG"], ta / 2.0)
        half = ta / (2.0 * ti) if v["I_SEL"] else 0.0
        past = (lag - ta / 2.0) / (lag + ta / 2.0)
        d = td / (ta / 2.0 + lag) / (1.0 - past) if v["D_SEL"] else 0.0
        return Law(v["GAIN"] * v["PV_FAC"] * v["LMN_FAC"] * 100.0 / span, half, half, d, past if d else 0.0, interval)
    if target == "weg":  # academic: Kp·(e + Ki·Ts·Σe + Kd/Ts·Δe); parallel: Kp, Ki, Kd each alone
        kp, ts = v["Kp"], v["Ts"] / 1000.0
        own = kp if v["Type"] else 1.0
        return Law(-kp if v["Action"] else kp, v["Ki"] / own * ts, 0.0, v["Kd"] / own / ts, 0.0, interval)
    if target == "s7-200":  # ms/2^SCALE per count: KP·Δe + KI·(e + e₋) − KD·Δ²x
        cycle_ms = v["TICK"] * v["TICKS"]
        unit = 2.0 ** -v["SCALE"] * 100.0 / cycle_ms * _S7_200_COUNTS / span
        return Law(v["KP"] * unit, v["KI"] / v["KP"], v["KI"] / v["KP"], v["KD"] / v["KP"], 0.0, interval)
    return _law_in_seconds(target, v, interval)


def _law_in_seconds(target, v, interval):
    """Return what the words of controllers do that take °C and seconds."""
    if target == "iec-pid":  # seconds; DERIVATIVE: (3·(x − x₋₃) + x₋₁ − x₋₂)/(10·CYCLE), IEC 61131-3, annex F
        return Law(v["KP"], interval / v["TR"] if v["TR"] else 0.0, 0.0, v["TD"] / interval, 0.0, interval,
                   (0.3, 0.1, -0.1, -0.3) if v["TD"] else (1.0, -1.0))
    if target in _PARALLEL:  # gains by the second, of an output whose full power is told
        names, full = _PARALLEL[target]
        kp, ki, kd = (v[name] for name in names)
        return Law(100.0 * kp / full, ki / kp * interval, 0.0, kd / kp / interval, 0.0, interval)
    if target == "pband":  # tenths of a degree, seconds; the derivative's lag is Td/8
        past = v["td"] / 8.0 / (v["td"] / 8.0 + interval)
        return Law(1000.0 / v["Pb"], interval / v["ti"] if v["ti"] else 0.0, 0.0, v["td"] / interval, past, interval)
    raise ValueError(target)


def linearised(heater, temperature):
    """Return [(A, B)] of small deviations from a temperature, y being the last state; None where it cannot be held.

    One pair, or where the two sides of the point differ, one for each side.
    """
    power = heater.power_at(temperature)
    if power is None:
        return None
    dt, dp = 1e-5 * max(1.0, abs(temperature - heater.ambient)), 1e-5 * max(1.0, power)
    pairs = []
    for side in (1.0, -1.0):
        lag = heater.lags[0] * (1.0 if side > 0.0 else heater.cooling)

        def net(t, p):
            return heater.heat(p, t) - heater.loss(t, heater.ambient)

        by_t = (net(temperature + side * dt, power) - net(temperature, power)) / (side * dt) / lag
        by_p = (net(temperature, power + side * dp) - net(temperature, power)) / (side * dp) / lag
        pairs.append(_chain(by_t, by_p, heater.lags[1:]))
    same = all(np.allclose(a, b, rtol=1e-3, atol=0.0) for a, b in zip(*pairs, strict=True))
    return pairs[:1] if same else pairs


def _chain(by_t, by_p, lags):
    n = 1 + len(lags)
    a, b = np.zeros((n, n)), np.zeros(n)
    a[0, 0], b[0] = by_t, by_p
    for i, lag in enumerate(lags, start=1):
        a[i, i - 1], a[i, i] = 1.0 / lag, -1.0 / lag
    return a, b


def _held(a, b, seconds):
    """Return e^(A·s) and what one unit held for so long leaves in the state."""
    n = len(b)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = a * seconds, b * seconds
    found = expm(whole)
    return found[:n, :n], found[:n, n]


@dataclass(frozen=True)
class Sampled:
    """x₊ = Φ·x + Γ₀·u(k − whole) + Γ₁·u(k − whole − 1)."""

    phi: np.ndarray
    now: np.ndarray
    before: np.ndarray
    whole: int
    interval: float

    def response(self, omega):
        """Return the response at frequencies [rad/s]."""
        z = np.exp(1j * omega * self.interval)
        n = len(self.phi)
        driven = self.now[None, :] + self.before[None, :] / z[:, None]
        states = np.linalg.solve(z[:, None, None] * np.eye(n) - self.phi, driven[:, :, None])
        return states[:, -1, 0] * z ** -float(self.whole)


def sampled(a, b, dead, interval):
    """Return a heater behind a zero-order hold and a dead time, exactly at the sampling instants."""
    whole = math.floor(dead / interval + 1e-12)
    late = dead - whole * interval
    if late < 1e-9 * interval:
        late = 0.0
    phi, _ = _held(a, b, interval)
    after, now = _held(a, b, interval - late)
    _, held = _held(a, b, late)
    return Sampled(phi, now, after @ held, whole, interval)


def stable(plant, law):
    """Return whether the closed loop's eigenvalues lie inside the unit circle."""
    num, den = law.polynomials()
    n, m = len(plant.phi), len(num) - 1
    past = plant.whole + 1
    if n + past + m > _MOST_STATES:
        return _not_encircled(plant, law)
    # controller in observer form: u = b₀·e + s₁, sᵢ₊ = sᵢ₊₁ + bᵢ·e − aᵢ·u
    size = n + past + m
    u = np.zeros(size)  # u as a function of all states, e being −y
    u[n - 1] = -num[0]
    if m:
        u[n + past] = 1.0
    whole = np.zeros((size, size))
    whole[:n, :n] = plant.phi
    for which, gamma in ((plant.whole, plant.now), (plant.whole + 1, plant.before)):
        if which == 0:
            whole[:n] += np.outer(gamma, u)
        else:
            whole[:n, n + which - 1] += gamma
    whole[n] = u
    for i in range(1, past):
        whole[n + i, n + i - 1] = 1.0
    for i in range(m):
        row = n + past + i
        whole[row] = -den[i + 1] * u
        whole[row, n - 1] -= num[i + 1]
        if i + 1 < m:
            whole[row, row + 1] += 1.0
    return bool(np.max(np.abs(np.linalg.eigvals(whole))) < 1.0)


def _loop(plant, law, omega):
    num, den = law.polynomials()
    back = np.exp(-1j * omega * plant.interval)
    return np.polyval(num[::-1], back) / np.polyval(den[::-1], back) * plant.response(omega)


def _grid(plant, slowest):
    nyquist = math.pi / plant.interval
    fine = np.linspace(nyquist * 1e-4, nyquist, 6000)
    return np.union1d(np.geomspace(min(1e-3 / slowest, nyquist * 1e-3), nyquist, 6000), fine)


def _not_encircled(plant, law):
    """Return whether 1 + L goes round zero as a stable loop's does: the poles at z = 1 make its half turns."""
    omega = _grid(plant, 1.0 / max(-np.log(np.abs(np.linalg.eigvals(plant.phi))).min() / plant.interval, 1e-12))
    around = 1.0 + _loop(plant, law, omega)
    turned = np.unwrap(np.angle(around))
    wanted = -math.pi / 2.0 if len(law.polynomials()[1]) > 1 and law.i_now else 0.0
    return bool(abs(turned[-1] - turned[0] + wanted) < 0.5 * math.pi)


def peak(plant, law, slowest):
    """Return the largest 1/|1 + L|."""
    omega = _grid(plant, slowest)
    found = 1.0 / np.abs(1.0 + _loop(plant, law, omega))
    top = int(np.argmax(found))
    near = np.linspace(omega[max(0, top - 1)], omega[min(len(omega) - 1, top + 1)], 400)
    return float(max(found[top], np.max(1.0 / np.abs(1.0 + _loop(plant, law, near)))))


@dataclass(frozen=True)
class Judgement:
    """What words are on a heater.

    Attributes:
        held: whether the heater can hold the setpoint.
        stable: whether both sides' loops are.
        ms: the larger of both sides; infinite where unstable.
    """

    held: bool
    stable: bool
    ms: float

    @property
    def danger(self):
        """Whether a PASS on such a heater is a false one."""
        return self.held and (not self.stable or self.ms > 2.5)


def judge(heater, law, setpoint, later=0.0):
    """Return what a controller is on a heater at a setpoint; `later` adds to the dead time [s]."""
    sides = linearised(heater, setpoint)
    if sides is None:
        return Judgement(False, True, 1.0)
    worst = Judgement(True, True, 1.0)
    for a, b in sides:
        plant = sampled(a, b, heater.dead + later, law.interval)
        if not stable(plant, law):
            return Judgement(True, False, math.inf)
        slowest = heater.dead + sum(heater.lags)
        worst = Judgement(True, True, max(worst.ms, peak(plant, law, slowest)))
    return worst


def swings(rig, law, setpoint, seconds):
    """Return whether the real, limited loop goes on swinging: from call to call, with a limited integral.

    The swing of the last eighth is more than a twentieth of the setpoint step and no less than 0.7 times that of the
    eighth before it.
    """
    interval, heater = law.interval, rig.heater
    integral = d = 0.0
    latest, readings = [], []
    for k in range(math.ceil(seconds / interval)):
        y = rig.run(k * interval)
        readings.append(y)
        e = setpoint - y
        latest = [e, *latest[:-1]] if latest else [e] * len(law.slope)
        d = law.past * d + (1.0 - law.past) * law.d * sum(weight * each for weight, each in zip(law.slope, latest, strict=True))
        ahead = integral + law.k * (law.i_now * e + law.i_before * latest[1])
        wanted = law.k * (e + d) + ahead
        if 0.0 <= wanted <= 100.0 or (wanted > 100.0) != (ahead > integral):
            integral = ahead
        rig.set(min(max(law.k * (e + d) + integral, 0.0), 100.0))
    eighth = max(4, len(readings) // 8)
    last, earlier = (float(np.ptp(part)) for part in (readings[-eighth:], readings[-2 * eighth : -eighth]))
    return last > 0.05 * abs(setpoint - heater.ambient) and last > 0.7 * earlier
