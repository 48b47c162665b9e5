/*
 * Ordinary differential equations y' = f(t, y) of compiled kernels: steps of order 8(5, 3) with error control, events, and
 * plain steps of order 4. The solution between two knots is a fresh, shorter step from the first, or, of several times in one step, a
 * polynomial that a fresh step has checked. Plain C99, no allocation: the caller gives the workspace.
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "pair_dense.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

/* So many times within a step are worth the three slopes of its polynomial and the step that checks it. */
enum { FEWEST_DENSE = 4 };
enum { MOST_PORTS = 32, REACHED = 0, EVENT = 1, FULL = 2, STUCK = 3 };

typedef void (*kernel_call)(const double *const *, double *const *);
typedef int (*python_call)(double, const double *, double *);

/* A kernel whose input number `state` is y and `time` is t (-1: none); its first output is f, or the values of the events. */
typedef struct {
    kernel_call call;
    python_call other; /* in place of a kernel */
    ptrdiff_t size, inputs, state, time, outputs;
    const double *const *in;
    double *const *out;
} Field;

typedef struct {
    double rtol;
    const double *atol; /* size */
    double first, longest;
    const ptrdiff_t *direction; /* events: 1 rising, -1 falling, 0 both */
    ptrdiff_t events;
} Rules;

EXPORT ptrdiff_t lie_codegen_ode_work(ptrdiff_t size, ptrdiff_t events);
EXPORT ptrdiff_t lie_codegen_ode_work(ptrdiff_t size, ptrdiff_t events)
{
    return (DENSE_STAGES + DENSE_TERMS + 3) * size + 3 * (events + 1);
}

static int evaluate(const Field *field, double t, const double *y, double *result)
{
    const double *in[MOST_PORTS];
    double *out[MOST_PORTS];
    if (field->other) {
        return field->other(t, y, result);
    }
    memcpy(in, field->in, (size_t)field->inputs * sizeof *in);
    memcpy(out, field->out, (size_t)field->outputs * sizeof *out);
    in[field->state] = y;
    if (field->time >= 0) {
        in[field->time] = &t;
    }
    out[0] = result;
    field->call(in, out);
    return 0;
}

static int slope_of(const void *who, double t, const double *y, double *slope)
{
    return evaluate(who, t, y, slope);
}

/* The stages k_2 .. k_12 of a step of length h from (t, y), k_1 being known, and the state after it. */
static int step(const Field *field, double t, const double *y, double h, double *k, double *next)
{
    return pair_step(slope_of, field, field->size, t, y, h, k, next, next);
}

/* Root mean square of the error in units of the tolerance; NaN counts as infinite. */
static double error_of(const Field *field, const Rules *rules, const double *y, const double *next, double h, const double *k)
{
    const ptrdiff_t n = field->size;
    double five = 0.0, three = 0.0, both;
    ptrdiff_t i;
    for (i = 0; i < n; ++i) {
        const double scale = rules->atol[i] + rules->rtol * fmax(fabs(y[i]), fabs(next[i]));
        double e5, e3;
        pair_errors_1(k + i, n, &e5, &e3);
        five += e5 * e5 / (scale * scale);
        three += e3 * e3 / (scale * scale);
        if (!(fabs(next[i]) < HUGE_VAL)) {
            return HUGE_VAL;
        }
    }
    both = pair_error(five, three, h, n);
    return both < HUGE_VAL ? both : HUGE_VAL;
}

/*
 * How long the first step may be: tau, the time in which y or its slope changes by its own size, times the part of it after
 * which a term of order 8 is small (Hairer, Norsett, Wanner, II.4, who take the unit of time for tau: a slow motion told in
 * seconds would start with steps of a second).
 */
static double first_step(const Field *field, const Rules *rules, double t, const double *y, const double *k, double span, double *other, double *slope)
{
    const ptrdiff_t n = field->size;
    double d0 = 0.0, d1 = 0.0, d2 = 0.0, tau = fabs(span), probe, moved;
    ptrdiff_t i;
    for (i = 0; i < n; ++i) {
        const double scale = rules->atol[i] + rules->rtol * fabs(y[i]);
        d0 += y[i] * y[i] / (scale * scale);
        d1 += k[i] * k[i] / (scale * scale);
    }
    d0 = sqrt(d0 / (double)n);
    d1 = sqrt(d1 / (double)n);
    if (d0 > 1e-5 && d1 > 0.0) {
        tau = fmin(tau, d0 / d1);
        probe = 0.01 * tau;
    } else {
        probe = 1e-6 * tau;
    }
    probe = copysign(probe, span);
    for (i = 0; i < n; ++i) {
        other[i] = y[i] + probe * k[i];
    }
    if (!(tau < HUGE_VAL) || evaluate(field, t + probe, other, slope)) {
        return probe;
    }
    for (i = 0; i < n; ++i) {
        const double scale = rules->atol[i] + rules->rtol * fabs(y[i]);
        d2 += (slope[i] - k[i]) * (slope[i] - k[i]) / (scale * scale);
    }
    d2 = sqrt(d2 / (double)n) / fabs(probe);
    if (d1 > 0.0 && d2 > 0.0) {
        tau = fmin(tau, d1 / d2);
    }
    moved = fmax(d1 * tau, d2 * tau * tau);
    /* At rest there is nothing to measure: a step that still sees what comes. */
    tau *= moved > 0.0 ? pow(0.01 / moved, 1.0 / 8.0) : 1e-3;
    return tau > 0.0 ? copysign(fmin(tau, fabs(span)), span) : probe;
}

static int crossed(double before, double after, ptrdiff_t direction)
{
    return (before < 0.0 && after >= 0.0 && direction >= 0) || (before > 0.0 && after <= 0.0 && direction <= 0);
}

/* Where within the step the event changes sign, as a fraction of it just behind the change: regula falsi, halved where it lags. */
static double locate(const Field *field, const Field *events, ptrdiff_t which, double t, const double *y, double h, double *k, double *next, double *values, double before, double after)
{
    double low = 0.0, high = 1.0, a = before, b = after;
    int i, side = 0;
    for (i = 0; i < 100 && high - low > 1e-15; ++i) {
        double middle = i % 3 == 2 ? 0.5 * (low + high) : (low * b - high * a) / (b - a);
        double value;
        if (!(middle > low && middle < high)) {
            middle = 0.5 * (low + high);
            if (middle == low || middle == high) {
                break;
            }
        }
        if (step(field, t, y, middle * h, k, next) || evaluate(events, t + middle * h, next, values)) {
            break;
        }
        value = values[which];
        if ((value > 0.0) == (before > 0.0) && value != 0.0) {
            low = middle;
            a = value;
            b = side == -1 ? 0.5 * b : b;
            side = -1;
        } else {
            high = middle;
            b = value;
            a = side == 1 ? 0.5 * a : a;
            side = 1;
            if (value == 0.0) {
                break;
            }
        }
    }
    return high;
}

/*
 * Steps from knot 0 (its time and state are given in `times` and `states`) towards `end` until there, until an event, or until
 * `most` knots are written. result: number of knots, length of the next step, the event, evaluations.
 */
EXPORT int lie_codegen_ode_run(const Field *field, const Field *events, const Rules *rules, double end, ptrdiff_t most, double *times, double *states, double *work, double *result);
EXPORT int lie_codegen_ode_run(const Field *field, const Field *events, const Rules *rules, double end, ptrdiff_t most, double *times, double *states, double *work, double *result)
{
    const ptrdiff_t n = field->size, count = rules->events;
    double *k = work, *next = k + STAGES * n, *spare = next + n, *slope = spare + n;
    double *before = slope + 2 * n, *after = before + count, *values = after + count;
    double h = rules->first, evaluations = 1.0;
    ptrdiff_t knots = 1, i;
    int refused = 0, status = REACHED;
    if (evaluate(field, times[0], states, k) || (count && evaluate(events, times[0], states, before))) {
        return STUCK;
    }
    if (h == 0.0) {
        h = first_step(field, rules, times[0], states, k, end - times[0], spare, slope);
        evaluations += 1.0;
    }
    while (times[knots - 1] != end) {
        const double t = times[knots - 1];
        const double *y = states + (knots - 1) * n;
        double error, factor, reached;
        ptrdiff_t first = -1;
        if (knots == most) {
            status = FULL;
            break;
        }
        if (fabs(h) > rules->longest) {
            h = copysign(rules->longest, h);
        }
        /* The last step ends exactly at the end, and no sliver is left for another. */
        reached = fabs(end - t) <= fabs(h) * (1.0 + 1e-10) ? end : t + h;
        /* Shorter, a step that is refused and cut by a tenth might round to itself. */
        if (!(fabs(reached - t) > 4e-15 * fabs(t))) {
            status = STUCK;
            break;
        }
        if (step(field, t, y, reached - t, k, next)) {
            status = STUCK;
            break;
        }
        evaluations += STAGES - 1;
        error = error_of(field, rules, y, next, reached - t, k);
        if (error >= 1.0) {
            h = (reached - t) * (error < HUGE_VAL ? fmax(0.2, 0.9 * pow(error, -1.0 / 8.0)) : 0.2);
            refused = 1;
            continue;
        }
        factor = error == 0.0 ? 10.0 : fmin(10.0, 0.9 * pow(error, -1.0 / 8.0));
        h = reached == end && fabs(h) > fabs(reached - t) ? h : (reached - t) * (refused ? fmin(1.0, factor) : fmax(0.2, factor));
        refused = 0;
        if (count) {
            double earliest = 2.0;
            if (evaluate(events, reached, next, after)) {
                status = STUCK;
                break;
            }
            for (i = 0; i < count; ++i) {
                if (crossed(before[i], after[i], rules->direction[i])) {
                    const double part = locate(field, events, i, t, y, reached - t, k, spare, values, before[i], after[i]);
                    if (part < earliest) {
                        earliest = part;
                        first = i;
                    }
                }
            }
            if (first >= 0 && earliest < 1.0) {
                reached = t + earliest * (reached - t);
                if (step(field, t, y, reached - t, k, next)) {
                    status = STUCK;
                    break;
                }
            }
            memcpy(before, after, (size_t)count * sizeof *before);
        }
        times[knots] = reached;
        memcpy(states + knots * n, next, (size_t)n * sizeof *next);
        ++knots;
        if (first >= 0) {
            result[2] = (double)first;
            status = EVENT;
            break;
        }
        evaluations += 1.0;
        if (evaluate(field, reached, next, k)) {
            status = STUCK;
            break;
        }
    }
    result[0] = (double)knots;
    result[1] = h;
    result[3] = evaluations;
    return status;
}

/* A fresh step from (from, y) to time t. */
static int fresh(const Field *field, double from, const double *y, double t, double *found, double *k)
{
    if (t == from) {
        memcpy(found, y, (size_t)field->size * sizeof *y);
        return 0;
    }
    return evaluate(field, from, y, k) || step(field, from, y, t - from, k, found);
}

/*
 * Times between `from` and `to`, whose states are y and `after`, on one polynomial. miss: by how much, in units of what is allowed, it
 * misses a fresh step to the time nearest to its middle, where it is least exact.
 */
static int on_polynomial(const Field *field, double from, const double *y, double to, const double *after, ptrdiff_t count, const double *wanted, const double *allowed, double *found, double *miss, double *work)
{
    const ptrdiff_t n = field->size;
    const double h = to - from;
    double *k = work, *stage = k + DENSE_STAGES * n, *F = stage + n, farthest = -1.0;
    ptrdiff_t i, middle = 0;
    if (evaluate(field, from, y, k) || step(field, from, y, h, k, stage)
        || pair_dense(slope_of, field, n, from, y, h, after, k, stage, F)) {
        return 1;
    }
    for (i = 0; i < count; ++i) {
        const double x = (wanted[i] - from) / h;
        pair_dense_at(n, y, F, x, found + i * n);
        if (x * (1.0 - x) > farthest) {
            farthest = x * (1.0 - x);
            middle = i;
        }
    }
    if (fresh(field, from, y, wanted[middle], stage, k)) {
        return 1;
    }
    *miss = 0.0;
    for (i = 0; i < n; ++i) {
        const double off = fabs(stage[i] - found[middle * n + i]);
        if (!(off <= *miss * allowed[i])) {
            *miss = off / allowed[i];
        }
    }
    return 0;
}

/* Ordered times in the step behind a knot: on a polynomial over the whole of it, or over as much of it as it is exact for. */
static int within(const Field *field, const double *times, const double *states, ptrdiff_t knot, ptrdiff_t count, const double *wanted, const double *allowed, double *found, double *work)
{
    const ptrdiff_t n = field->size;
    const double end = times[knot + 1], way = end > times[knot] ? 1.0 : -1.0;
    double *y = work, *after = y + n, *rest = after + n, t = times[knot], to = end, last = HUGE_VAL;
    int helps = 1; /* 0: a shorter piece misses no less, for rounding or a kink; then every time is a fresh step */
    memcpy(y, states + knot * n, (size_t)n * sizeof *y);
    while (count > 0) {
        const double length = to - t;
        double miss = 0.0;
        ptrdiff_t piece = 0, i;
        while (piece < count && way * (wanted[piece] - to) <= 0.0) {
            ++piece;
        }
        if (to == end) {
            memcpy(after, states + (knot + 1) * n, (size_t)n * sizeof *after);
        } else if (fresh(field, t, y, to, after, rest)) {
            return 1;
        }
        if (helps && piece >= FEWEST_DENSE) {
            if (on_polynomial(field, t, y, to, after, piece, wanted, allowed, found, &miss, rest)) {
                return 1;
            }
            if (!(miss <= 1.0)) {
                helps = miss < 0.5 * last;
                to = t + length * fmax(0.2, 0.8 * pow(miss, -1.0 / 8.0));
                last = miss;
                continue;
            }
        } else {
            for (i = 0; i < piece; ++i) {
                if (fresh(field, t, y, wanted[i], found + i * n, rest)) {
                    return 1;
                }
            }
        }
        memcpy(y, after, (size_t)n * sizeof *y);
        t = to;
        to = way * (end - t - 1.5 * length) > 0.0 ? t + 1.5 * length : end;
        last = HUGE_VAL;
        count -= piece;
        wanted += piece;
        found += piece * n;
    }
    return 0;
}

/* The solution at `count` ordered times, each from the last of the knots at or before it (`knot`, in the sense of the run). */
EXPORT int lie_codegen_ode_at(const Field *field, const double *times, const double *states, ptrdiff_t knots, ptrdiff_t count, const double *wanted, const ptrdiff_t *knot, const double *allowed, double *found, double *work);
EXPORT int lie_codegen_ode_at(const Field *field, const double *times, const double *states, ptrdiff_t knots, ptrdiff_t count, const double *wanted, const ptrdiff_t *knot, const double *allowed, double *found, double *work)
{
    const ptrdiff_t n = field->size;
    ptrdiff_t i, next;
    for (i = 0; i < count; i = next) {
        for (next = i + 1; next < count && knot[next] == knot[i]; ++next) {
        }
        if (next - i >= FEWEST_DENSE && knot[i] + 1 < knots) {
            if (within(field, times, states, knot[i], next - i, wanted + i, allowed, found + i * n, work)) {
                return 1;
            }
            continue;
        }
        for (; i < next; ++i) {
            if (fresh(field, times[knot[i]], states + knot[i] * n, wanted[i], found + i * n, work)) {
                return 1;
            }
        }
    }
    return 0;
}

/* The classical method of order 4 with equal steps: `spans` outputs, `parts` steps between two. */
EXPORT int lie_codegen_ode_fixed(const Field *field, double start, double h, ptrdiff_t spans, ptrdiff_t parts, double *states, double *work);
EXPORT int lie_codegen_ode_fixed(const Field *field, double start, double h, ptrdiff_t spans, ptrdiff_t parts, double *states, double *work)
{
    const ptrdiff_t n = field->size;
    double *y = work, *z = y + n, *a = z + n, *b = a + n, *c = b + n, *d = c + n;
    ptrdiff_t i, j, s;
    memcpy(y, states, (size_t)n * sizeof *y);
    for (s = 0; s < spans; ++s) {
        for (j = 0; j < parts; ++j) {
            const double t = start + (double)(s * parts + j) * h;
            if (evaluate(field, t, y, a)) {
                return 1;
            }
            for (i = 0; i < n; ++i) {
                z[i] = y[i] + 0.5 * h * a[i];
            }
            if (evaluate(field, t + 0.5 * h, z, b)) {
                return 1;
            }
            for (i = 0; i < n; ++i) {
                z[i] = y[i] + 0.5 * h * b[i];
            }
            if (evaluate(field, t + 0.5 * h, z, c)) {
                return 1;
            }
            for (i = 0; i < n; ++i) {
                z[i] = y[i] + h * c[i];
            }
            if (evaluate(field, t + h, z, d)) {
                return 1;
            }
            for (i = 0; i < n; ++i) {
                y[i] += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
            }
        }
        memcpy(states + (s + 1) * n, y, (size_t)n * sizeof *y);
    }
    return 0;
}
