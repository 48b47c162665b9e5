/*
 * X' = X hat(xi), y' = F(t, X, y) on a group by the explicit pair 8(5,3), to a tolerance.
 *
 * y holds Theta (the first `group` entries), then xi, then what else there is. Within a step X = X_0 exp(Theta), Theta' = dexp^-1 xi, so
 * that the pair sees a vector; after it X_0 <- X_0 exp(Theta), Theta = 0. F and the product are kernels, given by address:
 *     rate(X_0, y, t, numbers...) -> y'        move(X_0, Theta) -> X_0 exp(Theta)
 * One member; many go on lanes, with pair_lanes.c.
 *
 * States are wanted at given times. A step ends there if two or more such times lie in it; a single one is reached by a step
 * of its own beside, since the interpolant of the pair errs a hundred times more than its steps. Where xi is part of y and the rate does not
 * read t, steps go as they like, and pair_between interpolates over several of them (pair_hermite.h).
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "pair_control.h"
#include "pair_hermite.h"
#include "pair_step.h"

typedef void (*Call)(const double *const *in, double *const *out);

typedef struct {
    Call rate, move;
    ptrdiff_t packed, group, size, numbers;
    const double *const *number;    /* inputs of the rate beside X, y and t */
    double t, t_low, h, rtol, atol, reach, longest; /* |Theta| stays within reach; h at most longest (the step to begin with, or 0) */
    double *X, *y;                  /* packed, size with room for the padding behind */
    const double *times;            /* that are wanted, all after t at the start */
    ptrdiff_t count, next;          /* of them; those that are done */
    double *X_out, *y_out;          /* count x packed, count x size */
    double *knot_t, *knot_h, *knot_X, *knot_y; /* accepted steps; NULL if not wanted */
    double *knot_slope, *knot_theta; /* y' at their beginning, Theta at their end; NULL if nothing lies between them; or with a knot more, the end */
    ptrdiff_t room, knots;
    double *work;                   /* (STAGES + 4) vectors, each padded to whole eights, + 2 packed */
    ptrdiff_t steps, rejected, evaluations;
    Brackets brackets;              /* of pair_between, as what follows: of the algebra, if xi are the entries of y behind Theta */
    double *dense;                  /* room for `between_size` */
    double between;                 /* the largest error that an interpolated state was found to have, over what steps are allowed */
} Pair;

/* The parts of `work`. */
typedef struct {
    double *k, *stage, *after, *more, *last; /* STAGES, 1, 1, 1 and 1 vectors */
    double *scratch, *aside;                 /* elements */
} Room;

/* Entries of y, padded to whole eights: sums go eight at a time, and nobody reads what they make of the padding. */
static ptrdiff_t wide(const Pair *p)
{
    return (p->size + 7) / 8 * 8;
}

static Room room_of(const Pair *p)
{
    const ptrdiff_t all = wide(p);
    Room room;
    room.k = p->work;
    room.stage = room.k + all * STAGES;
    room.after = room.stage + all;
    room.more = room.after + all;
    room.last = room.more + all;
    room.scratch = room.last + all;
    room.aside = room.scratch + p->packed;
    return room;
}

static void rates(Pair *p, const double *X, const double *y, double t, double *to)
{
    const double *in[3 + MOST_NUMBERS];
    double *out[1];
    in[0] = X;
    in[1] = y;
    in[2] = &t;
    out[0] = to;
    for (ptrdiff_t k = 0; k < p->numbers; ++k) {
        in[3 + k] = p->number[k];
    }
    ++p->evaluations;
    p->rate(in, out);
}

/* X <- X exp(Theta), Theta = 0. */
static void settle(Pair *p, double *X, double *y)
{
    const Room room = room_of(p);
    double *out[1] = {room.scratch};
    const double *in[2] = {X, y};
    p->move(in, out);
    memcpy(X, room.scratch, (size_t)p->packed * sizeof(double));
    memset(y, 0, (size_t)p->group * sizeof(double));
}

/* Where in a run the slopes are asked for: within a step X stays. */
typedef struct {
    Pair *pair;
    const double *X;
} Within;

static int slope_of(const void *who, double t, const double *y, double *slope)
{
    const Within *within = who;
    rates(within->pair, within->X, y, t, slope);
    return 0;
}

/* The stages of a step of length h behind the first, k[0], and the state after it. */
static void advance(Pair *p, const double *X, const double *y, double t, double h, double *k, double *stage, double *after)
{
    Within within = {p, X};
    pair_step(slope_of, &within, wide(p), t, y, h, k, stage, after);
}

/*
 * The error of a step over what is allowed. Entries of Theta are those of X, whose size is one. Negative where |Theta| goes beyond its reach; NaN shows.
 */
static double judged(const Pair *p, const double *y, const double *after, double h, const double *k)
{
    const Room room = room_of(p);
    double five = 0.0, three = 0.0, angle = 0.0, error;
    pair_errors(k, wide(p), room.more, room.last);
    for (ptrdiff_t i = 0; i < p->size; ++i) {
        const double a = fabs(y[i]), b = fabs(after[i]), size = i < p->group ? 1.0 : a > b ? a : b;
        const double units = 1.0 / (p->atol + p->rtol * size), e5 = units * room.more[i], e3 = units * room.last[i];
        five += e5 * e5;
        three += e3 * e3;
        angle += i < p->group ? after[i] * after[i] : 0.0;
    }
    error = pair_error(five, three, h, p->size);
    return error <= 1e300 && angle > p->reach * p->reach ? -sqrt(angle) / p->reach : error;
}

static void keep(Pair *p, const double *X, const double *y)
{
    memcpy(p->X_out + p->next * p->packed, X, (size_t)p->packed * sizeof(double));
    memcpy(p->y_out + p->next * p->size, y, (size_t)p->size * sizeof(double));
    ++p->next;
}

/* Where the step of length h began, with its first slope; Theta at its end. */
static void mark(Pair *p, double h, const double *slope, const double *theta)
{
    const ptrdiff_t at = p->knots;
    p->knot_t[at] = p->t;
    p->knot_h[at] = h;
    memcpy(p->knot_X + at * p->packed, p->X, (size_t)p->packed * sizeof(double));
    memcpy(p->knot_y + at * p->size, p->y, (size_t)p->size * sizeof(double));
    if (p->knot_slope) {
        memcpy(p->knot_slope + at * p->size, slope, (size_t)p->size * sizeof(double));
        memcpy(p->knot_theta + at * p->group, theta, (size_t)p->group * sizeof(double));
    }
}

/* On to the last time, or until there is no room for more knots (FULL: call again). */
EXPORT ptrdiff_t pair_run(Pair *p, ptrdiff_t most_steps);
EXPORT ptrdiff_t pair_run(Pair *p, ptrdiff_t most_steps)
{
    const Room room = room_of(p);
    double *k = room.k, *stage = room.stage, *after = room.after;
    int fresh = 0;
    p->knots = 0;
    memset(k, 0, (size_t)(wide(p) * STAGES) * sizeof(double));
    rates(p, p->X, p->y, p->t, k);
    if (p->h <= 0.0) {
        p->h = first_step(p->size, 1, p->y, k);
    }
    for (ptrdiff_t taken = 0; p->next < p->count; ++taken) {
        const double gap = p->times[p->next] - p->t - p->t_low;
        double wish = p->h < p->longest ? p->h : p->longest, h = wish, error;
        int ends = 0;
        if (taken == most_steps || (p->knot_t && p->knots == p->room)) {
            return FULL;
        }
        if (gap <= h * (1 + 1e-10)) { /* the next time lies within: end there if it is the last, or not alone */
            ends = p->next + 1 == p->count || p->times[p->next + 1] - p->t <= h || gap > 0.7 * h;
            h = ends ? gap : h;
        } else if (gap < 1.9 * h) {
            h = 0.5 * gap; /* not a step and a crumb */
        }
        if (fresh) { /* the last slope of the step before is of no use: it was at Theta, and now X holds exp(Theta) and Theta is zero */
            rates(p, p->X, p->y, p->t, k);
            fresh = 0;
        }
        advance(p, p->X, p->y, p->t, h, k, stage, after);
        error = judged(p, p->y, after, h, k);
        if (!(error <= 1.0) || error < 0.0) {
            ++p->rejected;
            /* Theta grows about as h does: the first length ends at 0.9 of its reach */
            const double factor = error < 0.0 ? 0.9 / -error : 0.9 * pow(error, -1.0 / 8);
            p->h = shorter(h, factor);
            if (vanishes(p->h, p->t)) {
                return error <= 1e300 ? STUCK : LOST;
            }
            continue;
        }
        if (p->knot_t) {
            mark(p, h, k, after);
            ++p->knots;
        }
        ++p->steps;
        if (!ends && gap <= h * (1 + 1e-10)) { /* a step of its own to the time within, from the same first stage */
            double *X = room.aside, *next = room.more;
            memcpy(X, p->X, (size_t)p->packed * sizeof(double));
            advance(p, p->X, p->y, p->t, gap, k, stage, next);
            settle(p, X, next);
            keep(p, X, next);
        }
        memcpy(p->y, after, (size_t)p->size * sizeof(double));
        settle(p, p->X, p->y);
        if (ends) {
            p->t = p->times[p->next];
            p->t_low = 0.0;
            keep(p, p->X, p->y);
        } else {
            later(&p->t, &p->t_low, h);
        }
        p->h = next_length(h, wish, error > 0.0 ? 0.9 * pow(error, -1.0 / 8) : 6.0);
        fresh = 1;
    }
    if (p->knot_slope) {
        rates(p, p->X, p->y, p->t, k);
        mark(p, 0.0, k, p->y);
    }
    return DONE;
}

/* The state of one member `part` of the way through the step from a knot, by a step of its own. */
static void afresh(Pair *p, ptrdiff_t from, double part, double *X_out, double *y_out)
{
    const Room room = room_of(p);
    const double *X = p->knot_X + from * p->packed, t = p->knot_t[from];
    double *y = room.more;
    memset(y, 0, (size_t)wide(p) * sizeof(double));
    memcpy(y, p->knot_y + from * p->size, (size_t)p->size * sizeof(double));
    memcpy(X_out, X, (size_t)p->packed * sizeof(double));
    rates(p, X, y, t, room.k);
    advance(p, X, y, t, part * p->knot_h[from], room.k, room.stage, room.after);
    settle(p, X_out, room.after);
    memcpy(y_out, room.after, (size_t)p->size * sizeof(double));
}

/* States so many parts of the way through steps, part in [0, 1]. */
EXPORT void pair_within(Pair *p, ptrdiff_t count, const ptrdiff_t *from, const double *part, double *X_out, double *y_out);
EXPORT void pair_within(Pair *p, ptrdiff_t count, const ptrdiff_t *from, const double *part, double *X_out, double *y_out)
{
    const Room room = room_of(p);
    memset(room.k, 0, (size_t)(wide(p) * STAGES) * sizeof(double));
    for (ptrdiff_t c = 0; c < count; ++c) {
        afresh(p, from[c], part[c], X_out + c * p->packed, y_out + c * p->size);
    }
}

/* Doubles that `dense` needs: for pair_between. */
EXPORT ptrdiff_t between_size(ptrdiff_t group, ptrdiff_t size);
EXPORT ptrdiff_t between_size(ptrdiff_t group, ptrdiff_t size)
{
    return fours(size - group) * NODES + fours(group) * TURN_NODES + 9 * group + turn_room(group) + 2 * (fours(group) + fours(size - group));
}

/* Newton's polynomials about one step. */
typedef struct {
    double place[KNOTS], turn_place[TURNS]; /* of knots, in lengths of the step from its beginning */
    double *c, *turn, *spare;               /* coefficients of the vectors, and of Theta in the chart of the knot `centre`; nine of Theta, and more room */
    ptrdiff_t centre;
} Between;

/* Of step s of so many: the knots s, s + 1 first, then those beside, the nearer before the farther. */
static void prepare_between(const Pair *p, ptrdiff_t steps, ptrdiff_t s, Between *b)
{
    const ptrdiff_t n = p->group, rest = p->size - n;
    const double h = p->knot_h[s];
    Jet jets[KNOTS], turns[TURNS];
    ptrdiff_t low = s, high = s + 1;
    double below = 0.0, above = 1.0;
    for (int j = 0; j < KNOTS; ++j) {
        ptrdiff_t at = j ? high : low;
        b->place[j] = j ? above : below;
        if (j > 1) { /* one further on the side that is nearer, or that is there at all */
            const double down = low > 0 ? below - p->knot_h[low - 1] / h : -INFINITY, up = high < steps ? above + p->knot_h[high] / h : INFINITY;
            if (-down < up - 1.0) {
                at = --low;
                b->place[j] = below = down;
            } else {
                at = ++high;
                b->place[j] = above = up;
            }
        }
        jets[j].of[0] = p->knot_y + at * p->size + n;
        jets[j].of[1] = p->knot_slope + at * p->size + n;
    }
    newton_2(rest, b->place, jets, h, b->c);
    b->centre = s > 0 ? s : 1;
    for (int j = 0; j < TURNS; ++j) { /* the middle, the other end of the step, the knot on the far side */
        const ptrdiff_t c = b->centre, at = j == 0 ? c : (j == 1) == (c == s) ? c + 1 : c - 1;
        double *theta = b->spare + 3 * j * n, *first = theta + n, *second = first + n;
        const double *xi = p->knot_y + at * p->size + n, *xi_dot = p->knot_slope + at * p->size + n;
        for (ptrdiff_t i = 0; i < n; ++i) {
            theta[i] = at == c ? 0.0 : at > c ? p->knot_theta[c * n + i] : -p->knot_theta[at * n + i];
        }
        if (j) {
            turn_jet(&p->brackets, theta, xi, xi_dot, 0.1 * (p->atol + p->rtol) / h, first, second, b->spare + 9 * n);
        } else {
            memcpy(first, xi, (size_t)n * sizeof(double));
            memcpy(second, xi_dot, (size_t)n * sizeof(double));
        }
        turns[j].of[0] = theta;
        turns[j].of[1] = first;
        turns[j].of[2] = second;
        b->turn_place[j] = at == s ? 0.0 : at == s + 1 ? 1.0 : at < s ? -p->knot_h[at] / h : 1.0 + p->knot_h[s + 1] / h;
    }
    newton_3(n, b->turn_place, turns, h, b->turn);
}

/*
 * States at all wanted times, which lie within the `steps` steps of a run that is done. What is left away with the last terms
 * of an interpolant errs more than it does; where that is more than `most` times what a step may err, a step of its own goes there.
 */
EXPORT void pair_between(Pair *p, ptrdiff_t steps, double most);
EXPORT void pair_between(Pair *p, ptrdiff_t steps, double most)
{
    const Room room = room_of(p);
    const ptrdiff_t n = p->group, rest = p->size - n;
    Between b;
    ptrdiff_t s = 0, made = -1;
    b.c = p->dense;
    b.turn = b.c + NODES * fours(rest);
    b.spare = b.turn + TURN_NODES * fours(n);
    memset(room.k, 0, (size_t)(wide(p) * STAGES) * sizeof(double));
    for (ptrdiff_t w = 0; w < p->count; ++w) {
        const double t = p->times[w];
        double *X = p->X_out + w * p->packed, *y = p->y_out + w * p->size, part, error = INFINITY;
        while (s + 1 < steps && p->knot_t[s + 1] <= t) {
            ++s;
        }
        part = w + 1 == p->count ? 1.0 : (t - p->knot_t[s]) / p->knot_h[s];
        if (steps + 1 >= KNOTS) {
            double *theta = b.spare + 9 * n + turn_room(n), *behind = theta + fours(n), *last = behind + fours(rest), *after = last + fours(n);
            if (made != s) {
                prepare_between(p, steps, s, &b);
                made = s;
            }
            newton_3_at(n, b.turn_place, b.turn, part, theta, last);
            newton_2_at(rest, b.place, b.c, part, behind, after);
            error = 0.0;
            for (ptrdiff_t i = 0; i < n; ++i) {
                const double e = fabs(last[i]) / (p->atol + p->rtol);
                error = e > error || e != e ? e : error;
            }
            for (ptrdiff_t i = 0; i < rest; ++i) {
                const double e = fabs(after[i]) / (p->atol + p->rtol * fabs(behind[i]));
                error = e > error || e != e ? e : error;
            }
            if (error <= most) {
                memcpy(X, p->knot_X + b.centre * p->packed, (size_t)p->packed * sizeof(double));
                memset(y, 0, (size_t)n * sizeof(double));
                memcpy(y + n, behind, (size_t)rest * sizeof(double));
                settle(p, X, theta);
                p->between = error > p->between ? error : p->between;
                continue;
            }
        }
        afresh(p, s, part, X, y);
    }
}

/* From the start, X then y, to the last time at this tolerance, and the states at all times. */
static ptrdiff_t whole(Pair *p, const double *start, const double *tolerance, ptrdiff_t most_steps, double most)
{
    const double *times = p->times, t = p->t;
    double *X = p->X_out, *y = p->y_out;
    const ptrdiff_t count = p->count, last = count - 1;
    ptrdiff_t status;
    memcpy(p->X, start, (size_t)p->packed * sizeof(double));
    memcpy(p->y, start + p->packed, (size_t)p->size * sizeof(double));
    p->rtol = tolerance[0];
    p->atol = tolerance[1];
    p->h = p->t_low = p->between = 0.0;
    p->next = p->steps = p->rejected = 0;
    p->times += last;
    p->X_out += last * p->packed;
    p->y_out += last * p->size;
    p->count = 1;
    status = pair_run(p, most_steps);
    p->times = times;
    p->X_out = X;
    p->y_out = y;
    p->count = count;
    if (status == DONE) {
        pair_between(p, p->steps, most);
    }
    p->t = t;
    return status;
}

/* The largest |a - b|, or |a| alone; NaN shows. */
static double largest(ptrdiff_t n, const double *a, const double *b)
{
    double most = 0.0;
    for (ptrdiff_t i = 0; i < n; ++i) {
        const double d = fabs(a[i] - (b ? b[i] : 0.0));
        most = d > most || d != d ? d : most;
    }
    return most;
}

/*
 * A run of one member at each of two tolerances (relative, absolute; of the first run, of the second; then by how
 * much the second keeps Theta shorter, so that it differs where the reach is what limits steps): the states of the first in
 * `other`, first those of X, and how far they are from those of the second: of X, of y, the size of the second, and the steps of the first.
 */
EXPORT ptrdiff_t pair_twice(Pair *p, const double *start, const double *tolerances, ptrdiff_t most_steps, double most, double *other, double *found);
EXPORT ptrdiff_t pair_twice(Pair *p, const double *start, const double *tolerances, ptrdiff_t most_steps, double most, double *other, double *found)
{
    double *X = p->X_out, *y = p->y_out;
    const ptrdiff_t elements = p->count * p->packed, vectors = p->count * p->size;
    ptrdiff_t status;
    double a, b;
    p->X_out = other;
    p->y_out = other + elements;
    status = whole(p, start, tolerances, most_steps, most);
    p->X_out = X;
    p->y_out = y;
    if (status != DONE) {
        return status;
    }
    found[3] = (double)p->steps;
    p->evaluations = 0;
    p->reach *= tolerances[4];
    status = whole(p, start, tolerances + 2, most_steps, most);
    if (status == DONE) {
        found[0] = largest(elements, other, X);
        found[1] = largest(vectors, other + elements, y);
        a = largest(elements, X, NULL);
        b = largest(vectors, y, NULL);
        found[2] = a > b ? a : b;
    }
    return status;
}

/*
 * ---- Gauss collocation of order 6, equal steps: what is quadratic in y is kept to rounding, whatever the number of steps ----
 * Its coefficients fulfil b_i a_ij + b_j a_ji = b_i b_j. For an invariant y'Qy, y'Q F(y) = 0 at every stage, and in the change of y'Qy over
 * a step that is all there is: the sums of products of two stages cancel by that identity.
 */

enum { POINTS = 3, MOST_ROUNDS = 60 };
static const double gauss_c[POINTS] = {0.1127016653792583115, 0.5, 0.8872983346207416885};
static const double gauss_b[POINTS] = {5.0 / 18, 4.0 / 9, 5.0 / 18};
static const double gauss_a[POINTS][POINTS] = {
    {5.0 / 36, -0.03597666752493890346, 0.009789444015308326049},
    {0.3002631949808645924, 2.0 / 9, -0.02248541720308681464},
    {0.2679883337624694517, 0.4804211119693833479, 5.0 / 36}};

/*
 * `spans` times `parts` steps of length h, states kept at the ends of the spans, from p->X, p->y at p->t. The stages are
 * found by iterating until their change no longer shrinks; they begin with those of the step before.
 */
EXPORT ptrdiff_t gauss_run(Pair *p, ptrdiff_t spans, ptrdiff_t parts);
EXPORT ptrdiff_t gauss_run(Pair *p, ptrdiff_t spans, ptrdiff_t parts)
{
    const ptrdiff_t n = p->size;
    double *k = p->work, *stage = k + n * POINTS, *fresh = stage + n, *low = fresh + n;
    const double start = p->t;
    for (ptrdiff_t i = 0; i < n; ++i) { low[i] = 0.0; }
    rates(p, p->X, p->y, p->t, k);
    for (int s = 1; s < POINTS; ++s) { memcpy(k + s * n, k, (size_t)n * sizeof(double)); }
    for (ptrdiff_t step = 0; step < spans * parts; ++step) {
        double before = INFINITY, angle = 0.0;
        p->t = start + (double)step * p->h;
        for (int round = 0;; ++round) {
            double change = 0.0, size = 0.0;
            for (int s = 0; s < POINTS; ++s) { /* a stage uses those that were renewed before it */
                for (ptrdiff_t i = 0; i < n; ++i) {
                    stage[i] = p->y[i] + p->h * (gauss_a[s][0] * k[i] + gauss_a[s][1] * k[n + i] + gauss_a[s][2] * k[2 * n + i]);
                }
                rates(p, p->X, stage, p->t + gauss_c[s] * p->h, fresh);
                for (ptrdiff_t i = 0; i < n; ++i) {
                    const double d = fabs(fresh[i] - k[s * n + i]), x = fabs(fresh[i]);
                    change = !(d <= change) ? d : change;
                    size = !(x <= size) ? x : size;
                    k[s * n + i] = fresh[i];
                }
            }
            if (!(change <= 1e300)) {
                return round ? STUCK : LOST; /* the iteration runs away */
            }
            /* done; or as far as rounding lets it come: changes that no longer shrink, though they are small already */
            if (change <= 4e-16 * size || (change >= before && change <= 1e-13 * size)) {
                break;
            }
            if (round == MOST_ROUNDS) {
                return STUCK;
            }
            before = change;
        }
        for (ptrdiff_t i = 0; i < n; ++i) { /* the sum in two doubles, but for Theta, which begins at zero */
            const double more = p->h * (gauss_b[0] * (k[i] + k[2 * n + i]) + gauss_b[1] * k[n + i]);
            if (i < p->group) {
                p->y[i] = more;
                angle += more * more;
            } else {
                const double add = more + low[i], sum = p->y[i] + add;
                low[i] = add - (sum - p->y[i]);
                p->y[i] = sum;
            }
        }
        if (angle > p->reach * p->reach) {
            return STUCK;
        }
        settle(p, p->X, p->y);
        ++p->steps;
        if ((step + 1) % parts == 0) {
            keep(p, p->X, p->y);
        }
    }
    p->t = start + (double)(spans * parts) * p->h;
    return DONE;
}
