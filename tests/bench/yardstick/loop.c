/* The physical yardstick: the closed loop of the benchmark as tight as C can have it.
 *
 * Heater lag·y' = gain·u(t − dead) − y above ambient; PI with clamped integral, called every second; PWM of 10 s, on
 * time rounded to 10 ms; the response between switching instants is exact. Returns the sum of |e| at the calls.
 *
 * A pulse of period p heats from 10·p + dead on. With dead = whole + part, a call's own second holds `part` s of what
 * the PWM did in the call `whole + 1` s ago and 1 − part s of the call `whole` s ago; each is a table over the steps.
 *
 * gcc -O3 -march=native -ffast-math -fPIC -shared loop.c -o loop.so -lm
 */
#include <math.h>
#include <string.h>

enum { PERIOD = 10, STEPS = 100, LANES = 16, RING = 1024 }; /* calls per period; steps of 10 ms; calls remembered */

/* Heating at a call's end by a pulse of `on` steps: what falls into the call itself, and what spills into the next. */
static void tables(double lag, double part, double top, double *own, double *spilled, int stride)
{
    for (int on = 0; on <= STEPS; on++) {
        const double end = part + (double)on / STEPS;
        own[on * stride] = on ? top * (exp(fmin(end - 1.0, 0.0) / lag) - exp((part - 1.0) / lag)) : 0.0;
        spilled[on * stride] = end > 1.0 ? top * (exp((end - 2.0) / lag) - exp(-1.0 / lag)) : 0.0;
    }
}

double loop_scalar(double gain, double lag, double dead, double start, double setpoint, double kp, double ti, int calls)
{
    double own[STEPS + 1], spilled[STEPS + 1];
    const int whole = (int)floor(dead);
    tables(lag, dead - whole, 100.0 * gain, own, spilled, 1);
    const double a = exp(-1.0 / lag), ki = kp / ti;
    int done[RING]; /* steps that the heater is on in each call's second, before the dead time */
    memset(done, 0, sizeof done);
    double y = start, sum = 0.0, total = 0.0;
    int left = 0, before = 0, phase = 0;
    for (int k = 0; k < calls; k++) {
        const double e = setpoint - y;
        sum = fmin(fmax(sum + ki * e, 0.0), 100.0);
        total += fabs(e);
        if (phase == 0)
            left = (int)(fmin(fmax(kp * e + sum, 0.0), 100.0) * (PERIOD * STEPS / 100.0) + 0.5);
        done[k % RING] = left < STEPS ? left : STEPS;
        left -= done[k % RING];
        const int on = k < whole ? 0 : done[(k - whole) % RING];
        y = a * y + own[on] + spilled[before];
        before = on;
        phase = phase == PERIOD - 1 ? 0 : phase + 1;
    }
    return total;
}

/* The same for 16 heaters side by side, without a branch; arrays of 16, results to `total`. */
void loop_lanes(const double *gain, const double *lag, const double *dead, const double *start, double setpoint,
                const double *kp, const double *ti, int calls, double *total)
{
    static _Thread_local double own[(STEPS + 1) * LANES], spilled[(STEPS + 1) * LANES];
    static _Thread_local int done[RING][LANES];
    double a[LANES], ki[LANES], y[LANES], sum[LANES], all[LANES], p[LANES];
    int whole[LANES], left[LANES], before[LANES];
    memset(done, 0, sizeof done); /* what lies before the first call is off */
    for (int i = 0; i < LANES; i++) {
        whole[i] = (int)floor(dead[i]);
        tables(lag[i], dead[i] - whole[i], 100.0 * gain[i], own + i, spilled + i, LANES);
        a[i] = exp(-1.0 / lag[i]), ki[i] = kp[i] / ti[i], p[i] = kp[i], y[i] = start[i], sum[i] = all[i] = 0.0;
        left[i] = before[i] = 0;
    }
    for (int k = 0; k < calls; k++) {
        const int begins = k % PERIOD == 0;
        int *now = done[k % RING];
        for (int i = 0; i < LANES; i++) {
            const double e = setpoint - y[i];
            const double s = sum[i] + ki[i] * e;
            sum[i] = s < 0.0 ? 0.0 : s > 100.0 ? 100.0 : s;
            all[i] += fabs(e);
            const double u = p[i] * e + sum[i];
            const double limited = u < 0.0 ? 0.0 : u > 100.0 ? 100.0 : u;
            const int pulse = (int)(limited * (PERIOD * STEPS / 100.0) + 0.5);
            left[i] = begins ? pulse : left[i];
            now[i] = left[i] < STEPS ? left[i] : STEPS;
            left[i] -= now[i];
        }
        for (int i = 0; i < LANES; i++) {
            const int on = done[(unsigned)(k - whole[i]) % RING][i];
            y[i] = a[i] * y[i] + own[on * LANES + i] + spilled[before[i] * LANES + i];
            before[i] = on;
        }
    }
    memcpy(total, all, sizeof all);
}
