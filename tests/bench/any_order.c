/* A day of events at any instants, lived by the loop of second_opinion.c; of each scan, and of what is left of it before and
 * behind an event, the highest and the lowest temperature are kept, and of each event's time what second_opinion.c
 * measures at rest. */
#include "second_opinion.c"

static int64_t keep(Sim *s, double *highest, double *lowest, int64_t record)
{
    double asked = s->c->asked[s->phase];
    highest[record] = asked + s->highest;
    lowest[record] = asked + s->lowest;
    s->highest = s->lowest = s->y - asked;
    return record + 1;
}

/* highest, lowest: one number for each scan and each part; first: number of the record with which each part begins, and how
 * many there are; 1 where too many pulses were under way */
int any_order(const Case *c, Found *found, double *highest, double *lowest, int64_t *first)
{
    Sim *s = calloc(1, sizeof *s);
    int64_t record = 0;
    s->c = c;
    s->y = s->x = c->start;
    s->mains = c->power[0];
    for (int p = 0; p < c->phases; p++) {
        begins(s, p);
        first[p] = record;
        long double until = c->begin[p + 1] * (long double)c->tick;
        for (;;) {
            long double a = scan_at(s), b = pulse_at(s), next = a < b ? a : b;
            if (next >= until) break;
            reach(s, next);
            if (a <= b) { record = keep(s, highest, lowest, record); scan(s); } else pulse(s);
        }
        reach(s, until);
        record = keep(s, highest, lowest, record);
        found[p].settled = s->outside ? INFINITY : s->settled;
        found[p].rest_integral = s->rest_integral;
        found[p].rest_highest = s->rest_highest;
        found[p].rest_lowest = s->rest_lowest;
    }
    first[c->phases] = record;
    int wrong = s->wrong;
    free(s);
    return wrong;
}
