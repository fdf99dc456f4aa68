"""The optimum by brute force, sharing nothing with the program: a grid of gains, bisection, the delay equation by
Runge and Kutta's method, all candidates at once."""

import numpy as np

N = 10.0


def loops(plant, tn, tv, omega):
    """L/K of candidates (arrays of shape (m,)) at frequencies (n,); plant is (k, T, L)."""
    k, lag, dead = plant
    s = 1j * omega[None, :]
    c = 1.0 + 1.0 / (tn[:, None] * s) + tv[:, None] * s / (1.0 + tv[:, None] * s / N)
    return c * k * np.exp(-s * dead) / (lag * s + 1.0)


def keeps(loop, gain, ms):
    """Whether |S| stays at or below the limit at every frequency, shape (m,)."""
    real, imaginary = 1.0 + gain[:, None] * loop.real, gain[:, None] * loop.imag
    return np.min(real * real + imaginary * imaginary, axis=1) >= 1.0 / ms**2


def grid(plant, n=700):
    _, lag, dead = plant
    return np.concatenate([np.geomspace(0.01 / (lag + dead), 2.0 / dead, n // 3),
                           np.linspace(2.0 / dead, (60.0 + 25.0 * dead / lag) / dead, n)])


@np.errstate(all="ignore")  # an unstable candidate may grow without bound
def iae_load(plant, gain, tn, tv, per_dead_time=32, dead_times=60):
    """∫|e| dt after a unit load step, shape (m,): classical Runge–Kutta steps, delayed power by cubic interpolation."""
    k, lag, dead = plant
    per_dead_time = max(per_dead_time, int(10 * dead / lag))
    h = dead / per_dead_time
    steps = int(max(dead_times, 8.0 * lag / dead) * per_dead_time)
    m = len(gain)
    fast = np.where(tv > 0.0, N / np.where(tv > 0.0, tv, 1.0), 0.0)
    y, summed, slow = np.zeros(m), np.zeros(m), np.zeros(m)
    power = np.zeros((steps + 3, m))
    area, moving = np.zeros(m), np.zeros(m)

    def late(step, share):
        j = step - per_dead_time
        if j < 0:
            return 0.0
        if share == 0.0:
            return power[j]
        if share == 1.0:
            return power[j + 1]
        return 0.5 * (power[j] + power[j + 1]) if j == 0 else (-power[j - 1] + 9 * power[j] + 9 * power[j + 1] - power[j + 2]) / 16

    def rates(step, share, y, slow):
        return (k * (1.0 + late(step, share)) - y) / lag, fast * (-y - slow)

    for step in range(steps):
        a = rates(step, 0.0, y, slow)
        b = rates(step, 0.5, y + h / 2 * a[0], slow + h / 2 * a[1])
        c = rates(step, 0.5, y + h / 2 * b[0], slow + h / 2 * b[1])
        d = rates(step, 1.0, y + h * c[0], slow + h * c[1])
        after = y + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        slow = slow + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        middle = 0.5 * (y + after) + h / 8 * (a[0] - (k * (1.0 + late(step, 1.0)) - after) / lag)
        summed = summed - h / 6 * (y + 4 * middle + after)
        area += h / 6 * (np.abs(y) + 4 * np.abs(middle) + np.abs(after))
        y = after
        power[step + 1] = gain * (-y + summed / tn + np.where(tv > 0.0, N * (-y - slow), 0.0))
        moving = np.abs(y)
        if step % per_dead_time == 0 and step > 4 * per_dead_time and np.all(~(moving < 1e9)):
            break
    area[~(moving < 1e-3 * k)] = np.inf  # not at rest: unstable, or too slow to be the best
    return area


def tops(plant, ms, tn, tv, gains=60):
    """The two highest gains of each candidate that keep the limit, by a scan from the top and bisection; shape (2, m)."""
    k, lag, dead = plant
    loop = loops(plant, tn, tv, grid(plant))
    ladder = np.geomspace(0.02, 3.0, gains)[::-1] * (lag / dead + 1.0) / k
    found = np.zeros((2, len(tn)))
    count = np.zeros(len(tn), dtype=int)
    above = np.zeros(len(tn), dtype=bool)
    for i, gain in enumerate(ladder):
        kept = keeps(loop, np.full(len(tn), gain), ms)
        edge = np.flatnonzero(kept & ~above & (count < 2))
        if len(edge) and i > 0:
            low, high = np.full(len(edge), gain), np.full(len(edge), ladder[i - 1])
            for _ in range(14):
                middle = np.sqrt(low * high)
                good = keeps(loop[edge], middle, ms)
                low, high = np.where(good, middle, low), np.where(good, high, middle)
            found[count[edge], edge] = low
            count[edge] += 1
        above = kept
    return found


def best(plant, ms, pid, rounds=4, n_tn=14, n_tv=9):
    """Return (IAE, K, TN, TV) of the best candidate: a grid, and finer grids around its best point."""
    _, lag, dead = plant
    tns = np.geomspace(0.3 * dead * lag / (dead + lag), 2.5 * (dead + lag), n_tn)
    tvs = np.geomspace(0.08 * dead, 0.9 * dead, n_tv) if pid else np.zeros(1)
    winner = (np.inf,)
    for _ in range(rounds):
        tn, tv = (a.ravel() for a in np.meshgrid(tns, tvs, indexing="ij"))
        for gain in tops(plant, ms, tn, tv):
            use = gain > 0.0
            use[use] &= tn[use] / gain[use] < winner[0]  # ∫|e| dt is at least ∫e dt = TN/K
            if use.any():
                for share in (1.0, 0.97):
                    cost = iae_load(plant, share * gain[use], tn[use], tv[use])
                    i = int(np.argmin(cost))
                    if cost[i] < winner[0]:
                        winner = (cost[i], share * gain[use][i], tn[use][i], tv[use][i])
        ratio = (tns[1] / tns[0]) ** 1.1
        tns = np.geomspace(winner[2] / ratio, winner[2] * ratio, 7)
        if pid:
            ratio = (tvs[1] / tvs[0]) ** 1.1
            tvs = np.geomspace(winner[3] / ratio, winner[3] * ratio, 7)
    return winner
