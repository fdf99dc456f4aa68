/* The closed loop a second time, from the manuals' equations and the story's documentation; nothing of heatertune is used.
 *
 * Heater: its differential equations by Runge-Kutta of fourth order in steps of a fortieth of the larger lag or a twentieth
 * of the smaller one, not the exponentials that the proof uses. Time: whole ticks, in which scan and PWM period are whole
 * numbers. Controllers: long double, float and int where the controller has decimal fractions, REAL or whole numbers.
 *
 * Each phase of the story is followed beyond its end, without the next event, until the loop repeats itself or the time
 * given for it is over; then the story goes on from where it was.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define RING 524288                        /* six hours of dead time with bursts every tenth of a second */
#define MEMORY 16

enum { S5, WEG, FB41, S7300, S7200, S7200PID, COMPACT, KLIPPER, IECPID, ARDUINO, SIMPLE, ESPHOME, MARLIN, PBAND };
enum { START, STEP, LOAD, SETPOINT, MAINS, PLC, LED };

typedef struct {
    int target, sw[8];
    double words[16];                      /* in the order in which false_passes.py gives them */
    double low, span, counts;              /* of the sensor */
    int64_t scan, period;                  /* [ticks] */
    double tick;                           /* [s] */
    double resolution, least_on, least_off; /* [s] */
    int carries;
    double gain, lag, inner, dead, ambient, start, per_lag, per_inner;
    double ramp, hold;                     /* step of the setpoint word, how far from the reading it may be; 0: none */
    int64_t ramp_calls;
    double within, again;                  /* full power until so near, and again from so far on [degC]; 0: never */
    int phases;
    int64_t *begin;                        /* of each phase, and the end [ticks] */
    double *rest;                          /* from when on each phase has to be at rest [s]; its end: never */
    int *kind;                             /* of the event at its begin */
    double *value;
    double *asked;                         /* setpoint [degC]; of LED at its end */
    double *from;                          /* setpoint at the begin of LED, led straight to the end of the phase [degC] */
    double *power;                         /* share of the rated power that mains and PLC let through */
    int *supplied;
    double band;                           /* [degC] */
    const double *noise;                   /* of each scan of the story, or NULL */
    int64_t noises;
    double sigma;                          /* of the noise after the story */
    const double *late;                    /* by how much each scan of the story comes late [s], or NULL */
    int64_t lates;
    double longer;                         /* the time beyond each rest, of the story's duration */
    int64_t before;                        /* calls of ten at a start-up, of which the tenth is missed */
    double added;                          /* to the output of FB41, its DISV [%] */
} Case;

typedef struct {                           /* of one phase, all temperatures from the setpoint [degC, s] */
    double highest, lowest, absolute, settled, rest_integral, rest_highest, rest_lowest;
    double later_highest, later_lowest, later_mean, later_swing, later_s, repeats;
} Found;

typedef struct {
    long double e, pw, d, y;               /* OB251 */
    float f[8];                            /* blocks in REAL */
    int64_t n[6];                          /* program in whole numbers */
    double g[4];                           /* printer */
    int side, begun;
} Memory;

typedef struct { long double due; double level; } Edge;

typedef struct {
    const Case *c;
    Memory m;
    long double now;
    int64_t k, j, calls, origin;           /* origin: of the PWM periods, of which j have begun [ticks] */
    double shift;                          /* by how much they begin late [s] */
    double y, x, level, carried, asked_pct, word;
    int phase, dark, arrived;              /* dark: no supply at the last scan; arrived: events whose power has reached the heater */
    double mains, load;
    int64_t scans, limited, faults, pulses;
    double last_level;
    uint64_t seed;
    int beyond, wrong;
    /* measured */
    double highest, lowest, absolute, settled;
    int outside, resting;
    double rest_integral, rest_highest, rest_lowest;
    int first, count;
    Edge ring[RING];                       /* last: see copy */
} Sim;

/* ---- heater -------------------------------------------------------------------------------------------------- */

typedef struct { double y, x, area; } Point;

static double target_of(const Sim *s)
{
    return s->c->ambient + s->c->gain * (100.0 * s->level * s->mains + s->load);
}

static Point step(const Case *c, Point p, double to, double h)
{
    if (c->inner == 0.0) {                 /* the four stages of one lag, multiplied out */
        double a = h * c->per_lag, left = p.y - to;
        double kept = 1.0 - a * (1.0 - a * (0.5 - a * (1.0 / 6.0 - a / 24.0)));
        double sum = h * (1.0 - a * (0.5 - a * (1.0 / 6.0 - a / 24.0)));
        Point q = { to + left * kept, to, p.area + to * h + left * sum };
        return q;
    }
    double m = 0.5 * h, f = c->per_lag, g = c->per_inner;
    double u1 = (to - p.x) * g, v1 = (p.x - p.y) * f;
    double x2 = p.x + m * u1, y2 = p.y + m * v1, u2 = (to - x2) * g, v2 = (x2 - y2) * f;
    double x3 = p.x + m * u2, y3 = p.y + m * v2, u3 = (to - x3) * g, v3 = (x3 - y3) * f;
    double x4 = p.x + h * u3, y4 = p.y + h * v3, u4 = (to - x4) * g, v4 = (x4 - y4) * f;
    m = h * (1.0 / 6.0);
    Point q = { p.y + m * (v1 + 2.0 * (v2 + v3) + v4), p.x + m * (u1 + 2.0 * (u2 + u3) + u4),
                p.area + m * (p.y + 2.0 * (y2 + y3) + y4) };
    return q;
}

static double off(Point p, int which, double level) { return which ? p.x - p.y : p.y - level; }

/* the part of a step after which `which` (0: temperature from a level, 1: its slope) changes its sign; the whole step where it
 * does not: false position, the value at an end that stays twice being halved (Illinois) */
static double part(const Case *c, Point p, double to, double h, int which, double level)
{
    double low = 0.0, high = h, before = off(p, which, level), after = off(step(c, p, to, h), which, level), last = h;
    if ((before > 0.0) == (after > 0.0)) return h;
    for (int i = 0, stayed = 0; i < 60; i++) {
        double mid = low + (high - low) * before / (before - after);
        double there = off(step(c, p, to, mid), which, level);
        if ((there > 0.0) == (before > 0.0)) {
            low = mid; before = there;
            if (stayed == 1) after *= 0.5;
            stayed = 1;
        } else {
            high = mid; after = there;
            if (stayed == -1) before *= 0.5;
            stayed = -1;
        }
        if (fabs(mid - last) <= 1e-15 * h) {        /* there, or a hair beyond it */
            for (double hair = 1e-15 * h; stayed == 1 && mid < high; hair *= 2.0) {
                mid = mid + hair < high ? mid + hair : high;
                if ((off(step(c, p, to, mid), which, level) > 0.0) != (before > 0.0)) break;
            }
            return mid;
        }
        last = mid;
    }
    return high;
}

static void measure(Sim *s, Point p, Point q, double to, double h)
{
    const Case *c = s->c;
    double asked = c->asked[s->phase], e = p.y - asked, f = q.y - asked;
    double area = q.area - p.area - asked * h;
    if (f > s->highest) s->highest = f;
    if (f < s->lowest) s->lowest = f;
    if (e * f < 0.0) {
        double t = part(c, p, to, h, 0, asked);
        Point z = step(c, p, to, t);
        double one = z.area - p.area - asked * t;
        s->absolute += fabs(one) + fabs(area - one);
    } else
        s->absolute += fabs(area);
    int out = fabs(f) > c->band;
    if (s->outside && !out)
        s->settled = (double)s->now + part(c, p, to, h, 0, asked + (e > 0.0 ? c->band : -c->band));
    s->outside = out;
    if (s->resting) {
        s->rest_integral += area;
        if (f > s->rest_highest) s->rest_highest = f;
        if (f < s->rest_lowest) s->rest_lowest = f;
    }
}

static void move(Sim *s, long double until)
{
    const Case *c = s->c;
    double longest = c->lag / 40.0, to = target_of(s);
    if (c->inner > 0.0 && c->inner / 20.0 < longest) longest = c->inner / 20.0;
    while (s->now < until) {
        double left = (double)(until - s->now), h = left;
        int last = left <= longest;
        if (!last) h = left / ceil(left / longest);
        Point p = { s->y, s->x, 0.0 }, q = step(c, p, to, h);
        if (c->inner > 0.0 && (p.x - p.y) * (q.x - q.y) < 0.0) {
            double t = part(c, p, to, h, 1, 0.0);
            if (t < h) { h = t; last = 0; q = step(c, p, to, h); }
        }
        measure(s, p, q, to, h);
        s->y = q.y;
        s->x = c->inner > 0.0 ? q.x : q.y;
        s->now = last ? until : s->now + h;
    }
}

/* the heater up to an instant, the power's changes on the way arriving after the dead time */
static void advance(Sim *s, long double until)
{
    const Case *c = s->c;
    for (;;) {
        long double edge = s->count ? s->ring[s->first].due : INFINITY;
        long double event = s->arrived < s->phase ? c->begin[s->arrived + 1] * (long double)c->tick + c->dead : INFINITY;
        long double due = edge < event ? edge : event;
        if (due > until) break;
        if (due > s->now) move(s, due);
        if (event <= edge) {
            s->arrived++;
            if (c->kind[s->arrived] == LOAD) s->load += c->value[s->arrived];
            s->mains = c->power[s->arrived];
        } else {
            s->level = s->ring[s->first].level;
            s->first = (s->first + 1) % RING;
            s->count--;
        }
    }
    move(s, until);
}

static void send(Sim *s, long double at, double level)
{
    if (s->count == RING) { s->wrong = 1; return; }
    s->ring[(s->first + s->count++) % RING] = (Edge){ at + s->c->dead, level };
    if (level > s->last_level && !s->beyond) s->pulses++;
    s->last_level = level;
}

/* ---- controllers --------------------------------------------------------------------------------------------- */

static double whole_count(const Case *c, double degrees)
{
    double n = (degrees - c->low) * c->counts / c->span + 1e-9; /* a whole count stays one */
    return floor(n < 0.0 ? 0.0 : n > c->counts ? c->counts : n);
}

/* a temperature as the controller has it */
static double reading_of(const Case *c, double degrees)
{
    double n = whole_count(c, degrees);
    if (c->target == WEG || c->target == IECPID || c->target == ESPHOME || c->target == MARLIN || c->target == ARDUINO || c->target == SIMPLE)
        return (float)(c->low + c->span * n / c->counts);
    if (c->target == COMPACT) {
        float low = (float)c->low, high = (float)(c->low + c->span), share = (float)n / 27648.0f, span = high - low;
        share = share * span;
        return share + low;
    }
    if (c->target == KLIPPER || c->target == PBAND) return c->low + c->span * n / c->counts;
    return c->target == S7200PID ? 8.0 * n : n;
}

static double within(double v, double low, double high) { return v < low ? low : v > high ? high : v; }

/* the limit that a sum has reached, or gone beyond: 1 upper, -1 lower */
static int at(long double y, long double low, long double high, int beyond)
{
    if (beyond)
        return y > high ? 1 : y < low ? -1 : 0;
    return y >= high ? 1 : y <= low ? -1 : 0;
}

/* OB251: K, R, TI in 1024ths, TD; position algorithm, derivative of the error; limits BGUG, BGOG in units of 2047 */
static double ob251(const Case *c, Memory *m, double w, double x)
{
    long double k = c->words[0] / 1024.0L, r = c->words[1] / 1024.0L, ti = c->words[2] / 1024.0L, td = c->words[3];
    long double high = c->words[4], low = c->words[5];
    long double e = w - x, pw = e - m->e, qw = pw - m->pw, d = (td * qw + m->d) / 2.0L;
    long double others = k * (r * pw + d), sum = k * ti * e;
    int kept_limited = c->sw[0], same_call = c->sw[1], inward = c->sw[2], whole = c->sw[3];
    int beyond = c->sw[4];
    int side = m->side;
    if (same_call) {
        long double all = others + sum, there = m->y + (whole ? truncl(all) : all);
        side = at(there, low, high, beyond);
    }
    int off = side != 0 && !(inward && side * sum <= 0.0L);
    long double dy = off ? others : others + sum;
    long double y = m->y + (whole ? truncl(dy) : dy);
    long double ya = y > high ? high : y < low ? low : y;
    m->side = at(y, low, high, beyond);
    m->e = e; m->pw = pw; m->d = d;
    m->y = kept_limited ? ya : y;
    return within((double)(100.0L * truncl(ya) / 2047.0L), 0.0, 100.0);
}

/* WEG: Kp, Ki, Kd, Ts [ms], MaximumOutput [%]; academic form; f: error before, integral part, reference */
static double weg(const Case *c, Memory *m, float w, float x)
{
    float kp = c->words[0], ki = c->words[1], kd = c->words[2], ts = (float)c->words[3] / 1000.0f;
    float high = (float)c->words[4], low = 0.0f, kits = ki * ts, kdts = kd / ts;
    int windup = c->sw[0], by_parts = c->sw[1], at_once = c->sw[2], zero = c->sw[3];
    if (c->within > 0.0 && w - x > (float)(m->begun ? c->again : c->within)) { m->begun = 0; return high; }
    int starts = !m->begun;
    if (starts) { m->begun = 1; m->f[0] = 0.0f; m->f[1] = 0.0f; m->f[2] = zero ? 0.0f : w; }
    float reference = m->f[2] + (w - m->f[2]), e = reference - x;
    if (starts && !zero) m->f[0] = e;
    if (starts && !at_once) return 0.0;
    float before = m->f[0], i = m->f[1], growth = kp * kits, wanted;
    growth = growth * e;
    if (by_parts) {
        float p = kp * e, d = kdts * (e - before), sum = i + growth;
        d = kp * d;
        sum = p + sum;
        wanted = sum + d;
    } else {
        float now = 1.0f + kits;
        now = now + kdts;
        float one = now * e, two = kdts * before, bracket = one - two;
        bracket = kp * bracket;
        wanted = i + bracket;
    }
    float out = wanted < low ? low : wanted > high ? high : wanted;
    float next = i + growth;
    if (windup == 1 && out != wanted) next = i;
    if (windup == 0 && kits != 0.0f) {
        float p = kp * e, least = low - p, most = high - p;
        next = next < least ? least : next > most ? most : next;
    }
    m->f[0] = e; m->f[1] = next; m->f[2] = reference;
    return out;
}

/* FB41: GAIN, TI, TD, TM_LAG, CYCLE [ms], PV_FAC, PV_OFF, I_SEL, D_SEL, LMN_HLM [%]; f: E, I, its rest, D, F, its rest */
static float pv_of(const Case *c, float n)
{
    float v = n * 100.0f;
    v = v / 27648.0f;
    v = v * (float)c->words[5];
    return v + (float)c->words[6];
}

static double fb41(const Case *c, Memory *m, float w, float x)
{
    float gain = c->words[0], ti = (float)c->words[1] / 1000.0f, td = (float)c->words[2] / 1000.0f;
    float lag = (float)c->words[3] / 1000.0f, cycle = (float)c->words[4] / 1000.0f, half = cycle * 0.5f;
    float high = (float)c->words[9];
    int rectangle = c->sw[0], whole_cycle = c->sw[1], only_held = c->sw[2];
    float e = pv_of(c, w) - pv_of(c, x);
    e = gain * e;
    float i = 0.0f, d = 0.0f, f = e, i_rest = 0.0f, f_rest = 0.0f;
    if (c->words[7] != 0.0) {
        float mean = e, t = ti > half ? ti : half, share = cycle / t;
        if (!rectangle) { mean = e + m->f[0]; mean = mean * 0.5f; }
        float change = share * mean;
        change = change + m->f[2];
        if ((m->side > 0 && change > 0.0f) || (m->side < 0 && change < 0.0f)) change = 0.0f;
        i = m->f[1] + change;
        i_rest = m->f[1] - i;
        i_rest = i_rest + change;
    }
    if (c->words[8] != 0.0) {
        float t = td > cycle ? td : cycle, l = lag > half ? lag : half, both = (whole_cycle ? cycle : half) + l;
        float share = t / both, change = cycle / t;
        d = e - m->f[4];
        d = d * share;
        change = change * d;
        change = change + m->f[5];
        f = change + m->f[4];
        f_rest = m->f[4] - f;
        f_rest = f_rest + change;
    }
    float sum = e + i, added = (float)c->added, top = high - added, bottom = 0.0f - added;
    sum = sum + d;
    sum = sum + added;
    if (c->words[7] != 0.0 && !only_held) {
        float without = sum - m->f[3];
        if (i > top && sum > high && without > high) {
            float own = i - top, over = sum - high;
            i = i - (own < over ? own : over);
        } else if (i < bottom && sum < 0.0f && without < 0.0f) {
            float own = i - bottom;
            i = i - (own > sum ? own : sum);
        }
    }
    m->side = sum >= high ? 1 : sum <= 0.0f ? -1 : 0;
    m->f[0] = e; m->f[1] = i; m->f[2] = i_rest; m->f[3] = d; m->f[4] = f; m->f[5] = f_rest;
    return sum >= high ? high : sum <= 0.0f ? 0.0f : sum;
}

/* PID tip No. 2: GAIN, RATE, RESET, SAMPLE [ms]; f: bias, reading before */
static double s7300(const Case *c, Memory *m, float w, float x)
{
    float gain = c->words[0], rate = c->words[1], reset = c->words[2], sample = c->words[3];
    int cuts = c->sw[0], always = c->sw[1], zero = c->sw[2];
    float sp = w / 27648.0f, pv = x / 27648.0f, before = m->begun || zero ? m->f[1] : pv;
    float ci = 0.0f, cd = rate / sample, e = sp - pv, mp = gain * e;
    if (reset != 0.0f) { ci = sample / reset; ci = ci * gain; }
    cd = cd * gain;
    float mi = ci * e, md = before - pv;
    mi = mi + m->f[0];
    md = cd * md;
    float out = mp + mi, other = mp + md, bias = mi;
    out = out + md;
    if (out > 1.0f) bias = 1.0f - other;
    if (out < 0.0f) bias = 0.0f - other;
    if (out > 1.0f || out < 0.0f || always) bias = bias < 0.0f ? 0.0f : bias > 1.0f ? 1.0f : bias;
    out = out < 0.0f ? 0.0f : out > 1.0f ? 1.0f : out;
    float units = out * 27648.0f;
    m->begun = 1; m->f[0] = bias; m->f[1] = pv;
    return 100.0 * (cuts ? truncf(units) : nearbyintf(units)) / 27648.0;
}

/* the repaired program: KP, KI, KD, SCALE, cycle [ms]; n: error, two readings, rest, width */
static double s7200(const Case *c, Memory *m, double w, double x)
{
    int64_t kp = c->words[0], ki = c->words[1], kd = c->words[2], scale = c->words[3], cycle = c->words[4];
    int64_t pv = x, e = (int64_t)w - pv, unit = (int64_t)1 << scale;
    if (!m->begun) { m->begun = 1; m->n[1] = m->n[2] = pv; }
    int64_t all = kp * (e - m->n[0]) + ki * (e + m->n[0]) - kd * (pv - 2 * m->n[1] + m->n[2]) + m->n[3];
    int64_t rest = ((all % unit) + unit) % unit, before = m->n[4], width = before + (all - rest) / unit;
    width = width < 0 ? 0 : width > cycle ? cycle : width;
    m->n[0] = e; m->n[2] = m->n[1]; m->n[1] = pv; m->n[3] = rest; m->n[4] = width;
    return 100.0 * (c->sw[0] ? before : width) / cycle;
}

/* PID instruction: KC, TS [s], TI, TD [min], cycle [ms]; f: bias, reading before; n: width. A start initialises nothing (p. 9-92), and
 * the program writes bias and reading before, not the setpoint */
static double s7200pid(const Case *c, Memory *m, float w, float x)
{
    float kc = c->words[0], ts = c->words[1], ti = c->words[2], td = c->words[3];
    float sp = w / 32000.0f, pv = x / 32000.0f, before = m->begun ? m->f[1] : pv;
    float e = sp - pv, mp = kc * e, ci = 60.0f * ti, cd = 60.0f * td;
    ci = ts / ci;
    ci = kc * ci;
    cd = cd / ts;
    cd = kc * cd;
    float mi = ci * e, md = before - pv;
    mi = mi + m->f[0];
    md = cd * md;
    float out = mp + mi, other = mp + md, bias = mi;
    out = out + md;
    if (out > 1.0f) bias = 1.0f - other;
    if (out < 0.0f) bias = 0.0f - other;
    bias = bias < 0.0f ? 0.0f : bias > 1.0f ? 1.0f : bias;
    out = out < 0.0f ? 0.0f : out > 1.0f ? 1.0f : out;
    float units = out * (float)c->words[4];
    int64_t last = m->n[0];
    m->begun = 1; m->f[0] = bias; m->f[1] = pv; m->n[0] = (int64_t)floor((double)units + 0.5);
    return 100.0 * (double)(c->sw[0] ? last : m->n[0]) / c->words[4];
}

/* PID_Compact: Gain, Ti, Td, TdFiltRatio, Cycle [s], OutputUpperLimit [%]; b = 1, c = 0; f: e, v, I, D, the sum */
static double compact(const Case *c, Memory *m, float w, float x)
{
    float kp = (float)c->words[0], ti = (float)c->words[1], td = (float)c->words[2], t = (float)c->words[4];
    float high = (float)c->words[5], low = 0.0f, e = w - x, v = -x, p = kp * e, d = 0.0f, i = m->f[2], change = 0.0f;
    float before_e = m->begun ? m->f[0] : c->sw[3] ? 0.0f : e, before_v = m->begun ? m->f[1] : c->sw[3] ? 0.0f : v;
    if (ti > 0.0f) {
        float k = kp * t, mean = e + before_e;
        k = k / ti;
        change = k * (c->sw[1] == 0 ? e : c->sw[1] == 1 ? before_e : mean * 0.5f);
    }
    if (td > 0.0f) {
        float lag = (float)c->words[3] * td, keep, move, kt = kp * td;
        if (c->sw[2] == 0) { float all = lag + t; keep = lag / all; move = kt / all; }
        else if (c->sw[2] == 1) {
            float half = 0.5f * t, l = lag > half ? lag : half, all = l + half, less = l - half;
            keep = less / all; move = kt / all;
        } else {
            float ratio = t / lag, rate = kt / t;
            keep = (float)exp(-(double)ratio);
            float rest = 1.0f - keep;
            move = c->sw[2] == 3 && lag > 0.0f ? kt / lag : rate * rest;
        }
        float moved = v - before_v, one = keep * m->f[3];
        moved = move * moved;
        d = one + moved;
    }
    float next = i + change, sum = p + next;
    sum = sum + d;
    if (ti > 0.0f) {
        int over = c->sw[0] == 1 ? m->begun && m->f[4] >= high : sum > high;
        int under = c->sw[0] == 1 ? m->begun && m->f[4] <= low : sum < low;
        if (c->sw[0] == 3) {
            float least = low - p, most = high - p;
            next = next < least ? least : next > most ? most : next;
        } else if ((over && change > 0.0f) || (under && change < 0.0f))
            next = i;
        if (c->sw[0] == 2) next = next < low ? low : next > high ? high : next;
        sum = p + next;
        sum = sum + d;
    }
    m->begun = 1; m->f[0] = e; m->f[1] = v; m->f[2] = next; m->f[3] = d; m->f[4] = sum;
    return sum < low ? low : sum > high ? high : sum;
}

/* Klipper: pid_Kp, pid_Ki, pid_Kd of 255, max_power, smooth_time; g: reading before, slope, integral, duty; n: reports since it was sent */
static double klipper(const Case *c, Memory *m, double w, double x)
{
    double p = c->words[0] / 255.0, i = c->words[1] / 255.0, d = c->words[2] / 255.0, most = c->words[3], smooth = c->words[4];
    double t = 0.3, rise = m->begun ? x - m->g[0] : 0.0, sum = m->g[2] + (w - x) * t, room = i > 0.0 ? most / i : 0.0;
    m->begun = 1;
    m->g[0] = x;
    m->g[1] = t < smooth ? (m->g[1] * (smooth - t) + rise) / smooth : rise / t;
    sum = within(sum, 0.0, room);
    double free_ = p * (w - x) + i * sum - d * m->g[1], duty = within(free_, 0.0, most);
    if (free_ == duty) m->g[2] = sum;
    if (w <= 0.0) duty = 0.0;
    double least = c->sw[0] == 0 ? 0.05 * most : 0.05;
    int64_t holds = c->sw[0] == 2 ? 14 : 8;
    m->n[0]++;
    if (fabs(duty - m->g[3]) >= least || (m->g[3] > 0.0 && m->n[0] >= holds)) {
        m->g[3] = duty;
        m->n[0] = 0;
    }
    if (m->n[0] > holds) m->n[0] = holds;      /* for `same`: a heater that is off counts no further */
    return 100.0 * m->g[3];
}

/* IEC 61131-3, repaired: KP, TR, TD [s], XMIN, XMAX [%], CYCLE [ms]; f: errors of the last three calls, I part [%] */
static double iec(const Case *c, Memory *m, float w, float x)
{
    float kp = (float)c->words[0], tr = (float)c->words[1], td = (float)c->words[2];
    float least = (float)c->words[3], most = (float)c->words[4], e = w - x, t;
    double ms = c->words[5];
    if (c->sw[0] == 0) t = (float)(ms / 1000.0);
    else if (c->sw[0] == 1) t = (float)floor(ms / 10.0) / 100.0f;
    else { t = (float)(1e6 * ms); t = t / 1e9f; }
    if (c->within > 0.0 && e > (float)(m->begun ? c->again : c->within)) { m->begun = 0; return most; }
    if (!m->begun) { m->begun = 1; m->f[0] = m->f[1] = m->f[2] = e; m->f[3] = 0.0f; }
    float p = kp * e, out, slope = e - m->f[2], span = 10.0f * t;
    if (tr == 0.0f) m->f[3] = 0.0f;
    else {
        float share = kp * t, bottom = least - p, top = most - p;
        share = share / tr;
        share = share * e;
        share = m->f[3] + share;
        m->f[3] = share < bottom ? bottom : share > top ? top : share;
    }
    out = p + m->f[3];
    if (td != 0.0f) {
        slope = 3.0f * slope;
        slope = slope + m->f[0];
        slope = slope - m->f[1];
        slope = slope / span;
        slope = td * slope;
        slope = kp * slope;
        out = out + slope;
    }
    m->f[2] = m->f[1]; m->f[1] = m->f[0]; m->f[0] = e;
    return out >= least ? out > most ? most : out : least;
}

/* whether this call is the tenth that is missed; n: calls since the last one missed, whether the one before was, whether it counts */
static int missed(const Case *c, Memory *m, int late)
{
    if (!m->n[2]) m->n[0] = c->before;
    m->n[2] = 1;
    m->n[0] = (m->n[0] + 1) % 10;
    m->n[1] = late && m->n[0] == 1 && m->begun;
    return late && m->n[0] == 0;
}

/* PID_v1, P_ON_E: Kp, Ki, Kd, OutMax, Full, SampleTime [ms]; interval not measured; g: sum, reading before, power [%] */
static double rounded(const Case *c, double v) { return c->sw[0] ? (float)v : v; }

/* whether the program around a controller gives full power, which takes note of that; side: the program has it, or nobody yet */
static int full_power(const Case *c, Memory *m, double away)
{
    int had = m->begun && !m->side;
    m->side = c->within > 0.0 && isfinite(away) && away > (had ? c->again : c->within);
    return m->side;
}

static double arduino(const Case *c, Memory *m, double w, double x)
{
    double kp = rounded(c, c->words[0]), ki = rounded(c, c->words[1]), kd = rounded(c, c->words[2]);
    double most = rounded(c, c->words[3]), tenth = rounded(c, rounded(c, 100.0) / 1000.0), ratio = rounded(c, c->words[5] / 100.0);
    ki = rounded(c, rounded(c, ki * tenth) * ratio);
    kd = rounded(c, rounded(c, kd / tenth) / ratio);
    w = rounded(c, w);
    x = rounded(c, x);
    if (missed(c, m, c->sw[1])) return m->g[2];
    if (full_power(c, m, rounded(c, w - x))) {         /* by hand at 0 */
        m->begun = 0;
        return m->g[2] = within(100.0 * most / c->words[4], 0.0, 100.0);
    }
    if (!m->begun) { m->g[0] = 0.0; m->g[1] = x; }
    m->begun = 1;
    double e = rounded(c, w - x), d = rounded(c, kd * rounded(c, x - m->g[1]));
    m->g[0] = within(rounded(c, m->g[0] + rounded(c, ki * e)), 0.0, most);
    m->g[1] = x;
    double out = rounded(c, rounded(c, kp * e) + rounded(c, m->g[0] - d));
    m->g[2] = within(100.0 * within(out, 0.0, most) / c->words[4], 0.0, 100.0);
    return m->g[2];
}

/* simple-pid: Kp, Ki, Kd, output_max, PERIOD_MS; P on the error, D on the reading, interval measured; g: I part, reading
 * before, power [%] */
static double simple(const Case *c, Memory *m, double w, double x)
{
    double most = c->words[3], t = c->words[4] / 1000.0;
    if (missed(c, m, c->sw[0])) return m->g[2];
    if (full_power(c, m, w - x)) {                     /* no object */
        m->begun = 0;
        m->g[0] = 0.0;
        return m->g[2] = most;
    }
    if (m->n[1] && m->begun) t += t;
    double change = m->begun ? x - m->g[1] : 0.0;
    m->begun = 1;
    m->g[0] = within(m->g[0] + c->words[1] * (w - x) * t, 0.0, most);
    m->g[1] = x;
    m->g[2] = within(c->words[0] * (w - x) + m->g[0] - c->words[2] * change / t, 0.0, most);
    return m->g[2];
}

/* ESPHome: kp, ki, kd, min_integral, max_integral, update_interval [ms]; one sample, interval measured, 0 at the first
 * reading; f: I part, reading before, level */
static double esphome(const Case *c, Memory *m, float w, float x)
{
    float kp = (float)c->words[0], ki = (float)c->words[1], kd = (float)c->words[2];
    float least = (float)c->words[3], most = (float)c->words[4], t = (float)c->words[5] / 1000.0f, e = w - x, d = 0.0f;
    if (missed(c, m, c->sw[0])) return 100.0 * m->f[2];
    if (m->n[1]) t = t + t;
    if (!m->begun) t = 0.0f;
    float change = e * t, p = kp * e;
    change = change * ki;
    change = m->f[0] + change;
    m->f[0] = change < least ? least : change > most ? most : change;
    if (t > 0.0f) {
        float moved = m->f[1] - x;
        moved = moved / t;
        d = kd * moved;
    }
    m->f[1] = x;
    int full = full_power(c, m, e);
    m->begun = 1;
    float level = p + m->f[0];
    level = level + d;
    m->f[2] = level < 0.0f ? 0.0f : level > 1.0f ? 1.0f : level;
    if (full) { m->f[0] = 0.0f; m->f[2] = 1.0f; }      /* the integral part is put to 0 after each reading */
    return 100.0 * m->f[2];
}

/* Marlin: Kp, Ki, Kd, PID_MAX, PID_FUNCTIONAL_RANGE, PID_K1, states of the reading; the gains are kept for 16 states of the
 * timer; full or none outside the window, where sum and derivative are forgotten; f: sum, reading before, derivative */
static double marlin(const Case *c, Memory *m, float w, float x)
{
    float timer = c->sw[0] ? 976.5625f : 1000.0f, t = 16.0f * (float)c->words[6] / timer;
    float kp = (float)c->words[0], ki = (float)c->words[1] * t, kd = (float)c->words[2] / t;
    float most = (float)c->words[3], window = (float)c->words[4], new = 1.0f - (float)c->words[5];
    int only_inside = c->sw[1];
    w = (float)floor((double)w + 0.5);                 /* M104 takes whole degrees */
    float e = w - x, before = m->f[1], out;
    if (!only_inside || fabsf(e) <= window) m->f[1] = x;
    if (w == 0.0f || e < -window || e > window) {
        m->begun = 0;
        out = w != 0.0f && e > window ? most : 0.0f;
    } else {
        if (!m->begun) m->f[0] = m->f[2] = 0.0f;
        m->begun = 1;
        float sum = m->f[0] + e, largest = most / ki, slope = kd * (before - x), rest = slope - m->f[2];
        m->f[0] = sum < 0.0f ? 0.0f : sum > largest ? largest : sum;
        rest = new * rest;
        m->f[2] = m->f[2] + rest;
        float p = kp * e, i = ki * m->f[0];
        out = p + i;
        out = out + m->f[2];
        out = out < 0.0f ? 0.0f : out > most ? most : out;
    }
    return 100.0 * (double)((int)out >> 1) / 127.0;
}

/* an instrument: band [degC], Ti, Td [s], upper limit [%], interval [s]; g: I part [%], what the derivative follows, its
 * filter, the setpoint's filter. What no manual prints: see plc/pband/DIFFERENCES.md */
static double tenths(const Case *c, double v) { return c->sw[5] && c->span / c->counts < 0.1 ? floor(10.0 * v + 0.5) / 10.0 : v; }

static double pband(const Case *c, Memory *m, double w, double x)
{
    double k = 100.0 / c->words[0], ti = c->words[1], td = c->words[2], high = c->words[3], t = c->words[4];
    int windup = c->sw[0], on_error = c->sw[1], quarter = c->sw[2], filtered = c->sw[3], whole = c->sw[4];
    w = tenths(c, w);
    x = tenths(c, x);
    m->g[3] = m->begun && ti > 0.0 ? m->g[3] + (w - m->g[3]) * t / (ti + t) : x;
    if (filtered && ti > 0.0) w = 0.65 * w + 0.35 * m->g[3];
    double e = w - x, follows = on_error ? e : -x, lag = td / (quarter ? 4.0 : 8.0);
    double slope = m->begun ? (follows - m->g[1]) / t : 0.0;
    m->g[2] += (td * slope - m->g[2]) * t / (lag + t);
    m->g[1] = follows;
    m->begun = 1;
    double p = k * e, d = k * m->g[2], i = 0.0;
    if (ti > 0.0) {
        i = m->g[0] + p * t / ti;
        if (whole) i = trunc(within(i, -127.0, 127.0) * 16777216.0) / 16777216.0;
        double sum = p + d + i;
        if (windup == 0 && ((sum > high && i > m->g[0]) || (sum < 0.0 && i < m->g[0]))) i = m->g[0];
        if (windup == 1) i = within(i, -p, high - p);
        if (windup == 2) i = fabs(e) >= c->words[0] ? 0.0 : within(i, -high, high);
    }
    m->g[0] = i;
    double out = p + d + i;
    if (whole) out = floor(10.0 * out + 0.5) / 10.0;
    return within(out, 0.0, high);
}

static double controlled(const Case *c, Memory *m, double w, double x)
{
    switch (c->target) {
    case S5: return ob251(c, m, w, x);
    case WEG: return weg(c, m, (float)w, (float)x);
    case FB41: return fb41(c, m, (float)w, (float)x);
    case S7300: return s7300(c, m, (float)w, (float)x);
    case S7200: return s7200(c, m, w, x);
    case COMPACT: return compact(c, m, (float)w, (float)x);
    case KLIPPER: return klipper(c, m, w, x);
    case IECPID: return iec(c, m, (float)w, (float)x);
    case ARDUINO: return arduino(c, m, w, x);
    case SIMPLE: return simple(c, m, w, x);
    case ESPHOME: return esphome(c, m, (float)w, (float)x);
    case MARLIN: return marlin(c, m, (float)w, (float)x);
    case PBAND: return pband(c, m, w, x);
    default: return s7200pid(c, m, (float)w, (float)x);
    }
}

/* ---- program, switch and story -------------------------------------------------------------------------------- */

static double normal(uint64_t *seed)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        *seed = *seed * 6364136223846793005ULL + 1442695040888963407ULL;
        sum += (double)(*seed >> 11) / 9007199254740992.0;
    }
    return sum;
}

static double sum_of(const Case *c, double a, double b) { return c->target == WEG || c->target == IECPID ? (float)(a + b) : a + b; }

/* the setpoint word after a call of the exported program, as WEG's listing has it: due: the countdown is at its end */
static double led(const Case *c, double word, double asked, double reading, int due)
{
    if (due) {
        double limit = c->hold > 0.0 ? sum_of(c, reading, -c->hold) : asked;
        if (!(limit > asked)) limit = asked;
        if (word < asked) {
            word = sum_of(c, word, c->ramp);
            if (word > asked) word = asked;
        } else if (word > limit) {
            word = sum_of(c, word, -c->ramp);
            if (word < limit) word = limit;
        }
    }
    if (c->hold > 0.0 && word > sum_of(c, reading, c->hold)) word = sum_of(c, reading, c->hold);
    return word;
}

static double setpoint_of(const Sim *s)
{
    const Case *c = s->c;
    int p = s->phase;
    if (c->kind[p] != LED) return c->asked[p];
    double passed = (double)(s->k * c->scan - c->begin[p]) / (double)(c->begin[p + 1] - c->begin[p]);
    return c->from[p] + (c->asked[p] - c->from[p]) * passed;
}

/* the output falls with the supply */
static void falls(Sim *s, long double at)
{
    Edge *last = &s->ring[(s->first + s->count + RING - 1) % RING];
    if (s->last_level == 1.0) send(s, at, 0.0);
    else if (s->count && last->level == 0.0 && last->due > at + s->c->dead) last->due = at + s->c->dead;
}

static double late_by(const Sim *s) { return s->c->late != NULL && s->k < s->c->lates ? s->c->late[s->k] : 0.0; }
static long double scan_at(const Sim *s) { return s->k * s->c->scan * (long double)s->c->tick + late_by(s); }
static long double pulse_at(const Sim *s) { return (s->origin + s->j * s->c->period) * (long double)s->c->tick + s->shift; }

static void scan(Sim *s)
{
    const Case *c = s->c;
    int64_t now = s->k * c->scan;
    double late = late_by(s);
    double wanted = setpoint_of(s);
    double noise = 0.0;
    if (c->noise != NULL) noise = !s->beyond && s->k < c->noises ? c->noise[s->k] : c->sigma * normal(&s->seed);
    s->k++;
    if (!c->supplied[s->phase]) {
        s->calls = 0;
        s->dark = 1;
        falls(s, now * (long double)c->tick + late);
        s->asked_pct = 0.0;
        memset(&s->m, 0, sizeof s->m);
        return;
    }
    long double next = pulse_at(s) - now * (long double)c->tick;
    if (s->dark && fabsl(next) > 1e-9L && fabsl(next - c->period * (long double)c->tick) > 1e-9L) {
        s->origin = now;                   /* the exported PWM begins anew, with this scan */
        s->shift = late;
        s->j = 0;
    }
    s->dark = 0;
    double reading = reading_of(c, s->y + noise), asked = reading_of(c, wanted);
    if (c->ramp == 0.0)
        s->word = asked;
    else {
        if (s->calls == 0) s->word = reading;
        s->calls++;
        s->word = led(c, s->word, asked, reading, s->calls % c->ramp_calls == 0);
    }
    s->asked_pct = controlled(c, &s->m, s->word, reading);
    if (!s->beyond) {
        s->scans++;
        s->limited += s->asked_pct <= 0.0 || s->asked_pct >= 100.0;
        s->faults += isnan(s->asked_pct) != 0;
    }
}

/* how long a PWM period is on [s], with what the period before it left over and what is left now [s] */
static double on_time(const Case *c, double asked_pct, double period, double *carried)
{
    double wanted = asked_pct / 100.0 * period + *carried;
    double on = c->resolution * floor(wanted / c->resolution + 0.5 + 1e-9), near = 1e-9;
    if (wanted < c->least_on - near || on < c->least_on - near || on < near)
        on = 0.0;
    else if (wanted > period - c->least_off + near || on > period - c->least_off + near || on > period - near)
        on = period;
    *carried = c->carries ? wanted - on : 0.0;
    return on;
}

static void pulse(Sim *s)
{
    const Case *c = s->c;
    double period = (double)c->period * c->tick, on = on_time(c, s->asked_pct, period, &s->carried);
    long double begin = pulse_at(s);
    s->j++;
    if (on > 0.0 && s->last_level == 0.0) send(s, begin, 1.0);
    if (on < period && s->last_level == 1.0) send(s, begin + on, 0.0);
}

static void reach(Sim *s, long double until)
{
    double rest = s->c->rest[s->phase];
    if (!s->resting && rest < until) {
        advance(s, rest);
        s->resting = 1;
        s->rest_highest = s->rest_lowest = s->y - s->c->asked[s->phase];
    }
    advance(s, until);
}

/* everything before an instant [ticks], scans and pulses at that very instant not yet */
static void run(Sim *s, int64_t until)
{
    const Case *c = s->c;
    for (;;) {
        long double a = scan_at(s), b = pulse_at(s), next = a < b ? a : b;
        if (next >= until * (long double)c->tick) break;
        reach(s, next);
        if (a <= b) scan(s); else pulse(s);
    }
    reach(s, until * (long double)c->tick);
}

static void begins(Sim *s, int phase)
{
    const Case *c = s->c;
    s->phase = phase;
    if (c->kind[phase] == STEP) { s->y += c->value[phase]; s->x += c->value[phase]; }
    double e = s->y - c->asked[phase];
    s->highest = s->lowest = e;
    s->absolute = 0.0;
    s->outside = fabs(e) > c->band;
    s->settled = (double)s->now;
    s->resting = 0;
    s->rest_integral = s->rest_highest = s->rest_lowest = 0.0;
}

/* whether two loops do the same from here on: same memory, same pulses under way, and nearly the same heat */
static int same(const Sim *a, const Sim *b)
{
    if (memcmp(&a->m, &b->m, sizeof a->m) || a->count != b->count || a->level != b->level || a->word != b->word) return 0;
    if (fabs(a->y - b->y) > 1e-9 || fabs(a->x - b->x) > 1e-9 || fabs(a->carried - b->carried) > 1e-9) return 0;
    if ((a->calls - b->calls) % a->c->ramp_calls) return 0;
    int64_t ahead = a->k * a->c->scan - a->origin - a->j * a->c->period;
    if (ahead != b->k * b->c->scan - b->origin - b->j * b->c->period) return 0;
    for (int i = 0; i < a->count; i++) {
        const Edge *p = &a->ring[(a->first + i) % RING], *q = &b->ring[(b->first + i) % RING];
        if (p->level != q->level || fabsl((p->due - a->now) - (q->due - b->now)) > 1e-9L) return 0;
    }
    return 1;
}

static void copy(Sim *to, const Sim *from)
{
    memcpy(to, from, offsetof(Sim, ring));
    for (int i = 0; i < from->count; i++) {
        int at = (from->first + i) % RING;
        to->ring[at] = from->ring[at];
    }
}

static int64_t beat(int64_t a, int64_t b)
{
    int64_t x = a, y = b;
    while (y) { int64_t z = x % y; x = y; y = z; }
    return a / x * b;
}

/* a phase without an end: in windows as long as its rest, looked at where scan and PWM period begin together */
static void follow(const Sim *from, Sim *s, Sim *mark, int64_t until, int64_t window, Found *f)
{
    const Case *c = from->c;
    int64_t end = until + (int64_t)(c->longer * (double)c->begin[c->phases]), chunk = beat(c->scan, c->period);
    double asked = c->asked[from->phase];
    copy(s, from);
    copy(mark, s);
    s->beyond = s->resting = 1;
    f->later_highest = -INFINITY;
    f->later_lowest = INFINITY;
    int64_t now = until, marked = now, span = chunk;
    while (now < end && !f->repeats) {
        int64_t opened = now, closes = now + window;
        s->rest_integral = 0.0;
        s->rest_highest = s->rest_lowest = s->y - asked;
        while (now < closes) {
            now = now + chunk < closes ? now + chunk : closes;
            run(s, now);
            if (c->noise == NULL && same(s, mark)) f->repeats = 1.0;
            if (now - marked >= span) { copy(mark, s); marked = now; span *= 2; }
        }
        double mean = s->rest_integral / ((double)(now - opened) * c->tick);
        double swing = 0.5 * (s->rest_highest - s->rest_lowest);
        if (fabs(mean) > fabs(f->later_mean)) f->later_mean = mean;
        if (swing > f->later_swing) f->later_swing = swing;
        if (s->rest_highest > f->later_highest) f->later_highest = s->rest_highest;
        if (s->rest_lowest < f->later_lowest) f->later_lowest = s->rest_lowest;
    }
    f->later_s = (double)(now - until) * c->tick;
}

/* totals: scans, those at a limit, faults, pulses; returns 0, or 1 where too many pulses were under way */
int second_opinion(const Case *c, Found *found, double *totals)
{
    Sim *s = calloc(3, sizeof *s), *later = s + 1, *mark = s + 2;
    s->c = c;
    s->y = s->x = c->start;
    s->mains = c->power[0];
    s->seed = 88172645463325252ULL;
    for (int p = 0; p < c->phases; p++) {
        Found *f = &found[p];
        memset(f, 0, sizeof *f);
        begins(s, p);
        int64_t end = c->begin[p + 1], window = (int64_t)((double)end - c->rest[p] / c->tick);
        run(s, end);
        f->highest = s->highest;
        f->lowest = s->lowest;
        f->absolute = s->absolute;
        f->settled = s->outside ? INFINITY : s->settled;
        f->rest_integral = s->rest_integral;
        f->rest_highest = s->rest_highest;
        f->rest_lowest = s->rest_lowest;
        if (window > 0 && c->longer > 0.0 && c->kind[p] != LED) follow(s, later, mark, end, window, f);
    }
    totals[0] = (double)s->scans;
    totals[1] = (double)s->limited;
    totals[2] = (double)s->faults;
    totals[3] = (double)s->pulses;
    int wrong = s->wrong || later->wrong;
    free(s);
    return wrong;
}

/* the story in plain steps of h, the switch being known: on and off in turn at these instants; no rest gone on with */
void plain_steps(const Case *c, const double *edges, int64_t count, double h, Found *found)
{
    int64_t at = 0, i = 0;
    double y = c->start, x = c->start, level = 0.0, mains = c->power[0], load = 0.0;
    int arrived = 0;
    for (int p = 0; p < c->phases; p++) {
        Found *f = &found[p];
        memset(f, 0, sizeof *f);
        if (c->kind[p] == STEP) { y += c->value[p]; x += c->value[p]; }
        int64_t end = llround((double)c->begin[p + 1] * c->tick / h), rest = llround(c->rest[p] / h);
        double e = y - c->asked[p];
        f->highest = f->lowest = e;
        f->rest_highest = -INFINITY;
        f->rest_lowest = INFINITY;
        f->settled = fabs(e) > c->band ? INFINITY : (double)i * h;
        for (; i < end; i++) {
            double on = 0.0, from = (double)i * h, to = from + h;
            while (at < count && edges[at] + c->dead < to) {
                double due = edges[at] + c->dead;
                on += level * (due - from);
                from = due;
                level = at % 2 == 0 ? 1.0 : 0.0;
                at++;
            }
            on += level * (to - from);
            while (arrived < p && (double)c->begin[arrived + 1] * c->tick + c->dead < to) {
                arrived++;
                mains = c->power[arrived];
                if (c->kind[arrived] == LOAD) load += c->value[arrived];
            }
            double target = c->ambient + c->gain * (100.0 * on / h * mains + load), before = e;
            Point q = step(c, (Point){ y, x, 0.0 }, target, h);
            y = q.y;
            x = c->inner > 0.0 ? q.x : q.y;
            e = y - c->asked[p];
            f->absolute += 0.5 * h * (fabs(before) + fabs(e));
            if (e > f->highest) f->highest = e;
            if (e < f->lowest) f->lowest = e;
            if (fabs(e) > c->band) f->settled = INFINITY;
            else if (isinf(f->settled)) f->settled = (double)(i + 1) * h;
            if (i >= rest) {
                f->rest_integral += 0.5 * h * (before + e);
                if (e > f->rest_highest) f->rest_highest = e;
                if (e < f->rest_lowest) f->rest_lowest = e;
            }
        }
    }
}
