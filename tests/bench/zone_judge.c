/* Several heaters that exchange heat, each with the controller, reading and PWM of second_opinion.c: integer words and all.
 *
 * The network moves in steps of h by the exact solution that the caller computed, with the mean of each heater's power
 * within the step. Scans and PWM periods of all zones begin at whole steps; pulses end within them.
 */
#include "second_opinion.c"

typedef struct {
    int zones, bodies, scans;              /* of the run; the first bodies are the zones */
    double h;                              /* [s] */
    int64_t scan, period;                  /* [steps] */
    const double *move, *drive, *constant; /* T(t + h) = move T + drive u + constant, m x m, m x n, m; u [%] */
    const double *dead;                    /* of each zone, with the controller's own delay [s] */
    const double *asked, *load, *noise;    /* of each scan and zone [degC, %, degC] */
    const double *shares;                  /* that all others lose while a heater is on; dead times are equal where any do */
    const int64_t *begins;                 /* scan at which each zone's controller is started */
    const double *offsets;                 /* begin of each zone's first PWM period [s] */
    const double *factors, *references;    /* power that zone i adds for the reading of zone j beyond a reference, n x n
                                              [% per unit], n [units]; NULL: none adds any */
    double *pulses;                        /* zone, begin and end of each pulse at the switch, rows of 3 [s]; with places for */
    int64_t places;                        /* so many; how many there are comes back here */
} Network;

typedef struct { double due, level; } Turn;

typedef struct {
    Turn turns[4096];
    int first, count;
    double sent, level;                    /* what the switch does, and what has reached the heater */
    double asked_pct, carried, word;
    int calls;
    Memory m;
} Zone;

static int turn(Zone *z, double due, double level)
{
    if (z->sent == level) return 0;
    if (z->count == 4096) return 1;
    z->turns[(z->first + z->count++) % 4096] = (Turn){ due, level };
    z->sent = level;
    return 0;
}

static int zone_pulse(Network *w, int i, const Case *c, Zone *z, double now, double dead, double period, int64_t *rows)
{
    double on = on_time(c, z->asked_pct, period, &z->carried);
    if (on > 0.0) {
        if (*rows == w->places) return 1;
        double *row = w->pulses + 3 * (*rows)++;
        row[0] = i, row[1] = now, row[2] = now + on;
    }
    if (on > 0.0 && turn(z, now + dead, 1.0)) return 1;
    return on < period && turn(z, now + on + dead, 0.0);
}

/* share of the step from `from` on in which the heater is on */
static double zone_power(Zone *z, double from, double h)
{
    double on = 0.0, at = from, to = from + h;
    while (z->count && z->turns[z->first].due < to) {
        double due = z->turns[z->first].due > at ? z->turns[z->first].due : at;
        on += z->level * (due - at);
        at = due;
        z->level = z->turns[z->first].level;
        z->first = (z->first + 1) % 4096;
        z->count--;
    }
    return (on + z->level * (to - at)) / h;
}

/* mean power of each heater within the step, each less the shares that heaters take from it that are on meanwhile */
static void powers_within(Zone *zones, int n, const double *shares, double from, double h, double *u)
{
    double at = from, to = from + h;
    for (int i = 0; i < n; i++) u[i] = 0.0;
    for (;;) {
        int first = -1;
        double until = to;
        for (int i = 0; i < n; i++) {
            Zone *z = &zones[i];
            if (z->count && z->turns[z->first].due < until) { first = i; until = z->turns[z->first].due; }
        }
        if (until < at) until = at;
        for (int i = 0; i < n; i++) {
            double left = 1.0;
            for (int j = 0; j < n; j++) if (j != i) left -= shares[j] * zones[j].level;
            u[i] += zones[i].level * (left > 0.0 ? left : 0.0) * (until - at) / h;
        }
        at = until;
        if (first < 0) return;
        Zone *z = &zones[first];
        z->level = z->turns[z->first].level;
        z->first = (z->first + 1) % 4096;
        z->count--;
    }
}

/* one call of a zone's controller; what its program adds for the readings of the others, in REALs: FB41 takes it as DISV,
 * the PID of IEC 61131-3 gets limits that are lower by it, and it is added to the output */
static double called(const Network *w, const Case *cases, int i, Zone *z, const double *seen)
{
    float added = 0.0f;
    Case c = cases[i];
    double reading = reading_of(&c, seen[i]);
    if (!w->factors) return controlled(&c, &z->m, z->word, reading);
    for (int j = 0; j < w->zones; j++) {
        float factor = (float)w->factors[i * w->zones + j], away;
        if (factor == 0.0f) continue;
        away = (float)reading_of(&cases[j], seen[j]) - (float)w->references[j];
        added = added + away * factor;
    }
    if (c.target == FB41) {
        c.added = added;
        return controlled(&c, &z->m, z->word, reading);
    }
    c.words[3] = (float)c.words[3] - added;
    c.words[4] = (float)c.words[4] - added;
    float sum = (float)controlled(&c, &z->m, z->word, reading) + added;
    return sum < 0.0f ? 0.0 : sum > 100.0f ? 100.0 : sum;
}

/* temperatures: of each scan and zone; highest: of each scan up to the next one; start: of each zone; 1: too many pulses */
int zone_judge(Network *w, const Case *cases, const double *start, double *temperatures, double *highest, double *powers)
{
    int n = w->zones, m = w->bodies, wrong = 0;
    Zone *zones = calloc((size_t)n, sizeof *zones);
    double t[64], next[64], u[64], sensed[64], length = (double)w->period * w->h;
    int64_t rows = 0, periods[64] = { 0 };
    memcpy(t, start, (size_t)m * sizeof *t);
    int64_t steps = (int64_t)w->scans * w->scan;
    for (int64_t k = 0; k < steps && !wrong; k++) {
        int64_t s = k / w->scan;
        double now = (double)k * w->h;
        if (k % w->scan == 0) {
            for (int i = 0; i < n; i++) sensed[i] = t[i] + w->noise[s * n + i];
            for (int i = 0; i < n; i++) {
                const Case *c = &cases[i];
                double asked = w->asked[s * n + i], seen = sensed[i];
                temperatures[s * n + i] = highest[s * n + i] = t[i];
                if (s < w->begins[i]) continue;
                if (c->ramp == 0.0) zones[i].word = reading_of(c, asked);
                else {
                    if (zones[i].calls == 0) zones[i].word = reading_of(c, seen);
                    zones[i].calls++;
                    zones[i].word = led(c, zones[i].word, reading_of(c, asked), reading_of(c, seen), zones[i].calls % c->ramp_calls == 0);
                }
                zones[i].asked_pct = called(w, cases, i, &zones[i], sensed);
                powers[s * n + i] = zones[i].asked_pct;
            }
        }
        for (int i = 0; i < n; i++)
            for (; w->offsets[i] + (double)periods[i] * length < now + w->h - 1e-9; periods[i]++)
                wrong |= zone_pulse(w, i, &cases[i], &zones[i], w->offsets[i] + (double)periods[i] * length, w->dead[i], length,
                                    &rows);
        if (w->shares) powers_within(zones, n, w->shares, now, w->h, u);
        else for (int i = 0; i < n; i++) u[i] = zone_power(&zones[i], now, w->h);
        for (int i = 0; i < n; i++) u[i] = 100.0 * u[i] - w->load[s * n + i];
        for (int i = 0; i < m; i++) {
            next[i] = w->constant[i];
            for (int j = 0; j < m; j++) next[i] += w->move[i * m + j] * t[j];
            for (int j = 0; j < n; j++) next[i] += w->drive[i * n + j] * u[j];
        }
        memcpy(t, next, (size_t)m * sizeof *t);
        for (int i = 0; i < n; i++)
            if (t[i] > highest[s * n + i]) highest[s * n + i] = t[i];
    }
    w->places = rows;
    free(zones);
    return wrong;
}
