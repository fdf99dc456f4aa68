"""How many heaters of eight equal zones at 45 % duty are on at once, on 1,000 drawn plants, with the offsets of the proof.

    python -m tests.bench.peak_heaters [PLANTS] [SEED]

All plants run side by side: PI in double precision, PWM counted in its smallest steps, Euler steps of the heat balance.
Gains and lags of each zone are drawn ±5 %, exchange ±50 %, so the duties of the zones differ from those of the offsets.
Burst firing is a period of 1 s in half waves of 10 ms; what whole half waves leave is carried over.
"""

import sys

import numpy as np

from heatertune.zones.joint_loop import offsets_for

ZONES, DUTY_PCT, PERIOD_S, TICK_S = 8, 45.0, 10.0, 0.1
GAIN, LAG_S, DEAD_S, AMBIENT_DEGC, EXCHANGE = 1.0, 240.0, 12.0, 22.0, 0.5
K, TN_S, INTERVAL_S = 4.0, 80.0, 5.0
BURSTS = {"period_s": 1.0, "tick_s": 0.01, "carries": True, "held_s": 200.0, "settle_s": 4.0 * LAG_S}
TOLERANCE_DEGC = 1.0


def run(plants=1000, seed=1, *, staggered=True, held_s=600.0, period_s=PERIOD_S, tick_s=TICK_S, carries=False,
        settle_s=12.0 * LAG_S):
    """Return the share of periods with no more heaters than ⌈Σ duty⌉ on, and the largest error of a zone at rest [°C].

    The first plant is the nominal one. The bound is that of each plant's own mean duties, as in the proof.
    """
    random = np.random.default_rng(seed)
    shape = (plants, ZONES)
    gain, lag = GAIN * random.uniform(0.95, 1.05, shape), LAG_S * random.uniform(0.95, 1.05, shape)
    exchange = EXCHANGE * random.uniform(0.5, 1.5, (plants, ZONES - 1))
    gain[0], lag[0], exchange[0] = GAIN, LAG_S, EXCHANGE
    setpoint = AMBIENT_DEGC + GAIN * DUTY_PCT  # of equal zones: no heat is exchanged at rest
    ticks, late, scan = round(period_s / tick_s), round(DEAD_S / tick_s), round(INTERVAL_S / tick_s)
    offsets = np.zeros(ZONES)
    if staggered:
        likely = [DUTY_PCT * share for share in (1.0, 0.9, 1.05, 1.1)]
        offsets = np.array(offsets_for([[duty] * ZONES for duty in likely], period_s, tick_s))
    begin = np.round(offsets / tick_s).astype(int)
    pulse, rest = np.round(np.full(shape, DUTY_PCT) * ticks / 100.0), np.zeros(shape)
    temperature, sums, power = np.full(shape, setpoint), np.full(shape, DUTY_PCT), np.full(shape, DUTY_PCT)
    pending = np.repeat(power[None] / 100.0, late, axis=0)
    settle, total = round(settle_s / tick_s), round((settle_s + held_s) / tick_s)
    most, duty, worst, periods = np.zeros(plants, dtype=int), np.zeros(shape), 0.0, []
    for k in range(total):
        if k % scan == 0:
            error = setpoint - temperature
            sums += K * INTERVAL_S / TN_S * error
            power = np.clip(K * error + sums, 0.0, 100.0)
        starts = k % ticks == begin
        if np.any(starts):
            asked = power[:, starts] * ticks / 100.0 + rest[:, starts]
            pulse[:, starts] = np.clip(np.round(asked), 0.0, ticks)
            rest[:, starts] = asked - pulse[:, starts] if carries else 0.0
        on = (k - begin) % ticks < pulse
        heat = pending[k % late].copy()
        pending[k % late] = on
        flow = np.zeros(shape)
        flow[:, :-1] += exchange * (temperature[:, 1:] - temperature[:, :-1])
        flow[:, 1:] += exchange * (temperature[:, :-1] - temperature[:, 1:])
        temperature = temperature + tick_s / lag * (AMBIENT_DEGC + 100.0 * gain * heat - temperature + flow)
        if k >= settle:
            most = np.maximum(most, on.sum(axis=1))
            duty += on
            worst = max(worst, float(np.abs(temperature - setpoint).max()))
            if (k - settle) % ticks == ticks - 1:
                periods.append(most)
                most = np.zeros(plants, dtype=int)
    bound = np.ceil(duty.sum(axis=1) / (total - settle) - 1e-9)
    return float(np.mean(np.array(periods) <= bound)), worst, int(np.max(periods))


if __name__ == "__main__":
    arguments = [int(each) for each in sys.argv[1:]]
    print("staggered: share within the bound, largest error [°C], most on at once:", run(*arguments))
    print("all at once:", run(*arguments, staggered=False))
    print("bursts of half waves, staggered:", run(*arguments, **BURSTS))
