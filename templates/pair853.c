/*
 * X' = X hat(xi), y' = F(t, X, y) on a group by the explicit pair 8(5,3), to a tolerance.
 *
 * y holds Theta (the first `group` entries), then xi, then what else there is. Within a step X = X_0 exp(Theta), Theta' = dexp^-1 xi, so
 * that the pair sees a vector; after it X_0 <- X_0 exp(Theta), Theta = 0. F and the product are kernels, given by address:
 *     rate(X_0, y, t, numbers...) -> y'        move(X_0, Theta) -> X_0 exp(Theta)
 * Or y begins with the elements themselves, unit quaternions and other entries, the first `front` of it, and there is no Theta (`group` is 0):
 *     rate(y, t, numbers...) -> y'             move(y) -> X                lift(X) -> the elements of y
 * After a step q <- q/|q|. One member; many go on lanes, with pair_lanes.c.
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
#include "pair_two.h"

typedef void (*Call)(const double *const *in, double *const *out);

typedef struct {
    Call rate, move, lift;          /* lift: NULL if y begins with Theta */
    ptrdiff_t packed, group, front, quaternions, size, numbers;
    const double *const *number;    /* inputs of the rate beside X, y and t */
    double t, t_low, h, rtol, atol, reach, longest; /* |Theta| stays within reach; h at most longest (the step to begin with, or 0) */
    double *X, *y;                  /* packed, size with room for the padding behind; with elements in y X is where they begin */
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
    Both both;                      /* the steps of two runs at once; NULL if there is none for this rate */
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
    int first = 0;
    if (!p->lift) {
        in[first++] = X;
    }
    in[first++] = y;
    in[first++] = &t;
    out[0] = to;
    for (ptrdiff_t k = 0; k < p->numbers; ++k) {
        in[first + k] = p->number[k];
    }
    ++p->evaluations;
    p->rate(in, out);
}

/* X <- X exp(Theta), Theta = 0; or q <- q/|q|. */
static APART void settle(Pair *p, double *X, double *y)
{
    const Room room = room_of(p);
    double *out[1] = {room.scratch};
    const double *in[2] = {X, y};
    if (p->lift) {
        for (ptrdiff_t k = 0; k < p->quaternions; ++k) {
            double *q = y + 4 * k;
            const double square = (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]), off = square - 1.0;
            /* the series of 1/sqrt(1 + off), which nearly always is all of it: a root and a quotient are what the next step would wait for */
            const double by = fabs(off) < 1e-4 ? 1.0 - off * (0.5 - off * (0.375 - 0.3125 * off)) : 1.0 / sqrt(square);
            for (int i = 0; i < 4; ++i) {
                q[i] *= by;
            }
        }
        return;
    }
    p->move(in, out);
    memcpy(X, room.scratch, (size_t)p->packed * sizeof(double));
    memset(y, 0, (size_t)p->group * sizeof(double));
}

/* The elements of y from X, where y holds them. */
EXPORT void pair_lift(Pair *p);
EXPORT void pair_lift(Pair *p)
{
    const double *in[1] = {p->X};
    double *out[1] = {p->y};
    if (p->lift) {
        p->lift(in, out);
        settle(p, p->X, p->y);
    }
}

/* X of a state. */
static void express(const Pair *p, const double *X, const double *y, double *to)
{
    const double *in[1] = {y};
    double *out[1] = {to};
    if (p->lift) {
        p->move(in, out);
    } else {
        memcpy(to, X, (size_t)p->packed * sizeof(double));
    }
}

/* What a knot keeps of X. */
static ptrdiff_t kept(const Pair *p)
{
    return p->lift ? 0 : p->packed;
}

/* The size of entry i by which its relative error is judged. Entries of Theta are those of X, whose size is one; so are elements, at least. */
static double size_of(const Pair *p, ptrdiff_t i, double largest)
{
    return i < p->group || (i < p->front && largest < 1.0) ? 1.0 : largest;
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
static APART void advance(Pair *p, const double *X, const double *y, double t, double h, double *k, double *stage, double *after)
{
    Within within = {p, X};
    pair_step(slope_of, &within, wide(p), t, y, h, k, stage, after);
}

/* What the estimates of a step from y to `after` say of its error, from the slopes k. */
static APART Errors errors_of(const Pair *p, const double *y, const double *after, const double *k)
{
    const Room room = room_of(p);
    Errors found = {0.0, 0.0, 0.0};
    pair_errors(k, wide(p), room.more, room.last);
    for (ptrdiff_t i = 0; i < p->size; ++i) {
        const double a = fabs(y[i]), b = fabs(after[i]), size = size_of(p, i, a > b ? a : b);
        const double units = 1.0 / (p->atol + p->rtol * size), e5 = units * room.more[i], e3 = units * room.last[i];
        found.five += e5 * e5;
        found.three += e3 * e3;
        found.angle += i < p->group ? after[i] * after[i] : 0.0;
    }
    return found;
}

/* The error of a step over what is allowed. Negative where |Theta| goes beyond its reach; NaN shows. */
static double judged(const Pair *p, const Errors *found, double h)
{
    const double error = pair_error(found->five, found->three, h, p->size);
    return error <= 1e300 && found->angle > p->reach * p->reach ? -sqrt(found->angle) / p->reach : error;
}

static void keep(Pair *p, const double *X, const double *y)
{
    express(p, X, y, p->X_out + p->next * p->packed);
    memcpy(p->y_out + p->next * p->size, y, (size_t)p->size * sizeof(double));
    ++p->next;
}

/* Where the step of length h began, with its first slope; Theta at its end. */
static void mark(Pair *p, double h, const double *slope, const double *theta)
{
    const ptrdiff_t at = p->knots;
    p->knot_t[at] = p->t;
    p->knot_h[at] = h;
    memcpy(p->knot_X + at * kept(p), p->X, (size_t)kept(p) * sizeof(double));
    memcpy(p->knot_y + at * p->size, p->y, (size_t)p->size * sizeof(double));
    if (p->knot_slope) {
        memcpy(p->knot_slope + at * p->size, slope, (size_t)p->size * sizeof(double));
        memcpy(p->knot_theta + at * p->group, theta, (size_t)p->group * sizeof(double));
    }
}

/* Where a run is: the step that is tried next, of length h, where `wish` could be and the next wanted time is `gap` away. */
typedef struct {
    double gap, wish, h;
    Errors found; /* of the step that was tried */
    ptrdiff_t taken;
    int ends, fresh; /* whether the step ends at a wanted time; whether its first slope is still to be had */
} Course;

/* Behind the results of a run: there is a step to try. */
enum { GO = -1 };

static void begin(Pair *p, Course *c)
{
    const Room room = room_of(p);
    c->taken = c->fresh = 0;
    p->knots = 0;
    memset(room.k, 0, (size_t)(wide(p) * STAGES) * sizeof(double));
    rates(p, p->X, p->y, p->t, room.k);
    if (p->h <= 0.0) {
        p->h = first_step(p->size, 1, p->y, room.k);
    }
}

/* The next step to try and its first slope; DONE: the last time is reached, with what it needs as a knot; FULL: there is no room. */
static APART ptrdiff_t propose(Pair *p, Course *c, ptrdiff_t most_steps)
{
    const Room room = room_of(p);
    double gap;
    if (p->next >= p->count) {
        if (p->knot_slope) {
            rates(p, p->X, p->y, p->t, room.k);
            mark(p, 0.0, room.k, p->y);
        }
        return DONE;
    }
    if (c->taken == most_steps || (p->knot_t && p->knots == p->room)) {
        return FULL;
    }
    ++c->taken;
    c->gap = gap = p->times[p->next] - p->t - p->t_low;
    c->h = c->wish = p->h < p->longest ? p->h : p->longest;
    c->ends = 0;
    if (gap <= c->h * (1 + 1e-10)) { /* the next time lies within: end there if it is the last, or not alone */
        c->ends = p->next + 1 == p->count || p->times[p->next + 1] - p->t <= c->h || gap > 0.7 * c->h;
        c->h = c->ends ? gap : c->h;
    } else if (gap < 1.9 * c->h) {
        c->h = 0.5 * gap; /* not a step and a crumb */
    }
    return GO;
}

/* The step that is tried, as one of two over lanes. */
static Half half_of(Pair *p, Course *c)
{
    const Room room = room_of(p);
    const Half half = {p->X, p->y, p->t, c->h, p->rtol, p->atol, room.k, room.after, &c->found};
    p->evaluations += c->fresh ? STAGES : STAGES - 1;
    c->fresh = 0;
    return half;
}

/* The stages of the step that is tried, the state after it and what is known of its error. */
static APART void attempt(Pair *p, Course *c)
{
    const Room room = room_of(p);
    if (p->both) {
        const Half half = half_of(p, c), of[2] = {half, half};
        p->both(of, p->number);
        return;
    }
    if (c->fresh) { /* the last slope of the step before is of no use: it was at Theta, and now X holds exp(Theta) and Theta is zero */
        rates(p, p->X, p->y, p->t, room.k);
        c->fresh = 0;
    }
    advance(p, p->X, p->y, p->t, c->h, room.k, room.stage, room.after);
    c->found = errors_of(p, p->y, room.after, room.k);
}

/* The stages of the step are there: it is taken, or another is to be tried (GO); why there can be no other. */
static APART ptrdiff_t conclude(Pair *p, Course *c)
{
    const Room room = room_of(p);
    const double error = judged(p, &c->found, c->h);
    if (!(error <= 1.0) || error < 0.0) {
        ++p->rejected;
        /* Theta grows about as h does: the first length ends at 0.9 of its reach */
        p->h = shorter(c->h, error < 0.0 ? 0.9 / -error : longer(error));
        if (vanishes(p->h, p->t)) {
            return error <= 1e300 ? STUCK : LOST;
        }
        return GO;
    }
    if (p->knot_t) {
        mark(p, c->h, room.k, room.after);
        ++p->knots;
    }
    ++p->steps;
    if (!c->ends && c->gap <= c->h * (1 + 1e-10)) { /* a step of its own to the time within, from the same first stage */
        double *X = room.aside, *next = room.more;
        memcpy(X, p->X, (size_t)kept(p) * sizeof(double));
        advance(p, p->X, p->y, p->t, c->gap, room.k, room.stage, next);
        settle(p, X, next);
        keep(p, X, next);
    }
    settle(p, p->X, room.after);
    memcpy(p->y, room.after, (size_t)p->size * sizeof(double));
    if (c->ends) {
        p->t = p->times[p->next];
        p->t_low = 0.0;
        keep(p, p->X, p->y);
    } else {
        later(&p->t, &p->t_low, c->h);
    }
    p->h = next_length(c->h, c->wish, error > 0.0 ? longer(error) : 6.0);
    c->fresh = 1;
    return GO;
}

/* On to the last time, or until there is no room for more knots (FULL: call again). */
EXPORT ptrdiff_t pair_run(Pair *p, ptrdiff_t most_steps);
EXPORT ptrdiff_t pair_run(Pair *p, ptrdiff_t most_steps)
{
    Course c;
    ptrdiff_t status;
    begin(p, &c);
    while ((status = propose(p, &c, most_steps)) == GO) {
        attempt(p, &c);
        if ((status = conclude(p, &c)) != GO) {
            break;
        }
    }
    return status;
}

/* The state of one member `part` of the way through the step from a knot, by a step of its own. */
static APART void afresh(Pair *p, ptrdiff_t from, double part, double *X_out, double *y_out)
{
    const Room room = room_of(p);
    const double *X = p->knot_X + from * kept(p), t = p->knot_t[from];
    double *y = room.more;
    memset(y, 0, (size_t)wide(p) * sizeof(double));
    memcpy(y, p->knot_y + from * p->size, (size_t)p->size * sizeof(double));
    memcpy(X_out, X, (size_t)kept(p) * sizeof(double));
    rates(p, X, y, t, room.k);
    advance(p, X, y, t, part * p->knot_h[from], room.k, room.stage, room.after);
    settle(p, X_out, room.after);
    if (p->lift) {
        express(p, NULL, room.after, X_out);
    }
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
    return (NODES + 1) * (size - group) + fours(group) * (TURN_NODES + 2) + 9 * group + turn_room(group);
}

/* The polynomials about one step. */
typedef struct {
    Hermite behind;           /* of what follows Theta, or of all of y */
    double turn_place[TURNS]; /* of knots, in lengths of the step from its beginning */
    double *turn, *spare;     /* coefficients of Theta in the chart of the knot `centre`; nine of Theta, and more room */
    ptrdiff_t centre;
} Between;

/* Of step s of so many: the knots s, s + 1 first, then those beside, the nearer before the farther. */
static APART void prepare_between(const Pair *p, ptrdiff_t steps, ptrdiff_t s, Between *b)
{
    const ptrdiff_t n = p->group, rest = p->size - n;
    const double h = p->knot_h[s];
    Jet turns[TURNS];
    double *place = b->behind.place;
    ptrdiff_t low = s, high = s + 1;
    double below = 0.0, above = 1.0;
    for (int j = 0; j < KNOTS; ++j) {
        ptrdiff_t at = j ? high : low;
        place[j] = j ? above : below;
        if (j > 1) { /* one further on the side that is nearer, or that is there at all */
            const double down = low > 0 ? below - p->knot_h[low - 1] / h : -INFINITY, up = high < steps ? above + p->knot_h[high] / h : INFINITY;
            if (-down < up - 1.0) {
                at = --low;
                place[j] = below = down;
            } else {
                at = ++high;
                place[j] = above = up;
            }
        }
        b->behind.value[j] = p->knot_y + at * p->size + n;
        b->behind.slope[j] = p->knot_slope + at * p->size + n;
    }
    hermite(&b->behind, rest, h);
    b->centre = s > 0 ? s : 1;
    for (int j = 0; n && j < TURNS; ++j) { /* the middle, the other end of the step, the knot on the far side */
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
    if (n) {
        newton(n, b->turn_place, turns, h, b->turn);
    }
}

/* States that are wanted at so many times. */
typedef struct {
    ptrdiff_t count;
    const double *times;
    double *X, *y;
} Asked;

/*
 * States at times within the `steps` steps of a run that is done. What is left away with the last terms of an interpolant errs
 * more than it does; where that is more than `most` times what a step may err, a step of its own goes there. Two rows of times go together, so that a polynomial is made once. Returns the largest of what was left.
 */
static double states_at(Pair *p, ptrdiff_t steps, double most, Asked one, Asked two)
{
    const Room room = room_of(p);
    const ptrdiff_t n = p->group, rest = p->size - n;
    const double end = p->times[p->count - 1];
    Between b;
    ptrdiff_t s = 0, made = -1;
    double *left, *theta, *last, largest = 0.0;
    b.behind.c = p->dense;
    left = b.behind.c + NODES * rest;
    b.turn = left + rest;
    b.spare = b.turn + TURN_NODES * fours(n);
    theta = b.spare + 9 * n + turn_room(n);
    last = theta + fours(n);
    memset(room.k, 0, (size_t)(wide(p) * STAGES) * sizeof(double));
    while (one.count || two.count) {
        Asked *next = one.count && !(two.count && *two.times < *one.times) ? &one : &two;
        const double t = *next->times;
        double *X_out = next->X, *y_out = next->y, part;
        --next->count;
        ++next->times;
        next->X += p->packed;
        next->y += p->size;
        while (s + 1 < steps && p->knot_t[s + 1] <= t) {
            ++s;
        }
        part = t < end ? (t - p->knot_t[s]) / p->knot_h[s] : 1.0;
        if (steps + 1 >= KNOTS) {
            double most_left = 0.0;
            int good = 1;
            if (made != s) {
                prepare_between(p, steps, s, &b);
                made = s;
            }
            if (n) {
                newton_at(n, b.turn_place, b.turn, part, theta, last);
            }
            hermite_at(&b.behind, rest, part, y_out + n, left);
            for (ptrdiff_t i = 0; i < n; ++i) {
                good &= fabs(last[i]) <= most * (p->atol + p->rtol);
                most_left = fabs(last[i]) > most_left ? fabs(last[i]) : most_left;
            }
            for (ptrdiff_t i = 0; i < rest; ++i) {
                good &= fabs(left[i]) <= most * (p->atol + p->rtol * size_of(p, n + i, fabs(y_out[n + i])));
                most_left = fabs(left[i]) > most_left ? fabs(left[i]) : most_left;
            }
            if (good) {
                largest = most_left > largest ? most_left : largest;
                if (p->lift) {
                    settle(p, X_out, y_out);
                    express(p, NULL, y_out, X_out);
                } else {
                    memcpy(X_out, p->knot_X + b.centre * p->packed, (size_t)p->packed * sizeof(double));
                    settle(p, X_out, theta);
                    memset(y_out, 0, (size_t)n * sizeof(double));
                }
                continue;
            }
        }
        afresh(p, s, part, X_out, y_out);
    }
    return largest;
}

/* The same at all times that are wanted. */
EXPORT double pair_between(Pair *p, ptrdiff_t steps, double most);
EXPORT double pair_between(Pair *p, ptrdiff_t steps, double most)
{
    const Asked all = {p->count, p->times, p->X_out, p->y_out}, none = {0, NULL, NULL, NULL};
    return states_at(p, steps, most, all, none);
}

/* From the start, X then y, at this tolerance; where states between steps are interpolated to the last time, which alone is wanted on the way. */
static Pair from_start(const Pair *p, const double *start, const double *tolerance)
{
    Pair run = *p;
    const ptrdiff_t ahead = p->knot_slope ? p->count - 1 : 0;
    memcpy(run.X, start, (size_t)p->packed * sizeof(double));
    memcpy(run.y, start + p->packed, (size_t)p->size * sizeof(double));
    pair_lift(&run);
    run.rtol = tolerance[0];
    run.atol = tolerance[1];
    run.h = run.t_low = 0.0;
    run.next = run.steps = run.rejected = run.evaluations = 0;
    run.times += ahead;
    run.X_out += ahead * p->packed;
    run.y_out += ahead * p->size;
    run.count -= ahead;
    return run;
}

/* The largest |a - b|, b = 0 if NULL, and at least so much; NaN where there is one. */
static APART double farthest(ptrdiff_t n, const double *a, const double *b, double least)
{
    double off[EIGHT] = {0.0}, all[EIGHT] = {0.0}; /* a sum is NaN if a term is, and of these none cancel */
    ptrdiff_t i = 0;
    for (; i + EIGHT <= n; i += EIGHT) {
        for (int l = 0; l < EIGHT; ++l) {
            const double d = fabs(a[i + l] - (b ? b[i + l] : 0.0));
            off[l] = d > off[l] ? d : off[l];
            all[l] += d;
        }
    }
    for (; i < n; ++i) {
        const double d = fabs(a[i] - (b ? b[i] : 0.0));
        off[0] = d > off[0] ? d : off[0];
        all[0] += d;
    }
    for (int l = 0; l < EIGHT; ++l) {
        least = off[l] > least ? off[l] : least;
        least = all[l] != all[l] ? all[l] : least;
    }
    return least;
}

/* The same for each of two runs of one system: over lanes; or in turn, for neither waits for the other, and a processor has both under way. */
static void attempt_both(Pair *p, Course *c)
{
    const ptrdiff_t n = wide(p);
    const Room room[2] = {room_of(p), room_of(p + 1)};
    if (p->both) {
        const Half of[2] = {half_of(p, c), half_of(p + 1, c + 1)};
        p->both(of, p->number);
        return;
    }
    for (int r = 0; r < 2; ++r) {
        if (c[r].fresh) {
            rates(p + r, p[r].X, p[r].y, p[r].t, room[r].k);
            c[r].fresh = 0;
        }
    }
    for (int s = 1; s <= STAGES; ++s) {
        for (int r = 0; r < 2; ++r) {
            pair_stage(s, n, p[r].y, c[r].h, room[r].k, s < STAGES ? room[r].stage : room[r].after);
            if (s < STAGES) {
                rates(p + r, p[r].X, room[r].stage, p[r].t + C[s] * c[r].h, room[r].k + s * n);
            }
        }
    }
    for (int r = 0; r < 2; ++r) {
        c[r].found = errors_of(p + r, p[r].y, room[r].after, room[r].k);
    }
}

/* So many knots, a row each: t, h, X, y. */
static void rows_of_knots(const Pair *p, ptrdiff_t count, double *to)
{
    const ptrdiff_t elements = kept(p);
    for (ptrdiff_t k = 0; k < count; ++k) {
        to[0] = p->knot_t[k];
        to[1] = p->knot_h[k];
        memcpy(to + 2, p->knot_X + k * elements, (size_t)elements * sizeof(double));
        memcpy(to + 2 + elements, p->knot_y + k * p->size, (size_t)p->size * sizeof(double));
        to += 2 + elements + p->size;
    }
}

/* One member at two tolerances. What it points to may serve call after call: of the system nothing is written to but its arrays. */
typedef struct {
    const Pair *pair;    /* with room for all that is written; X_out, y_out begin with the start, times with its time: `count` of them */
    const double *start; /* X, then y */
    double tolerance[4]; /* relative and absolute, of the run with longer steps, of the one that is given */
    double shorter;      /* by how much the other keeps Theta shorter, so that it differs where the reach is what limits steps */
    double most;         /* of pair_between */
    ptrdiff_t apart;     /* the first run has all that it works with so many doubles behind that of the pair */
    double *other;       /* its states at the times behind the first, X before y; as many X behind */
    double *knots;       /* of the run that is given, row by row: t, h, X, y */
    double *found;       /* the largest difference of the two runs, the largest entry; steps of the first; steps, those rejected, evaluations of the other, what its interpolation left away */
} Twice;

/*
 * How far the states of two runs are apart: at the times that are wanted; or, where states between steps are known and these are fewer, where the
 * steps of the first end, at which it is as good as it gets. Where they are known those of the second come from here.
 */
static double difference(const Twice *w, const Pair *fine, Pair *runs)
{
    const ptrdiff_t elements = fine->packed, vectors = fine->size;
    ptrdiff_t count = fine->count;
    double *X = w->other, *y = X + count * elements, *X_ends = y + count * vectors;
    const double *X_fine = fine->X_out, *y_fine = fine->y_out;
    if (fine->knot_slope) {
        const int few = runs[0].steps < count;
        const Asked wanted = {count, fine->times, fine->X_out, fine->y_out}, ends = {few ? runs[0].steps : 0, runs[0].knot_t + 1, X, y};
        w->found[6] = states_at(runs + 1, runs[1].steps, w->most, wanted, ends);
        if (few) {
            count = runs[0].steps;
            X_fine = X;
            y_fine = y;
            X = X_ends;
            y = runs[0].knot_y + vectors;
            for (ptrdiff_t k = 0; k < count; ++k) {
                express(runs, runs[0].knot_X + (k + 1) * kept(runs), y + k * vectors, X + k * elements);
            }
        } else {
            const Asked same = {count, fine->times, X, y}, none = {0, NULL, NULL, NULL};
            states_at(runs, runs[0].steps, w->most, same, none);
        }
    }
    return farthest(count * elements, X_fine, X, farthest(count * vectors, y_fine, y, 0.0));
}

EXPORT ptrdiff_t pair_twice(const Twice *w);
EXPORT ptrdiff_t pair_twice(const Twice *w)
{
    Pair fine = *w->pair, coarse, runs[2];
    Course course[2];
    ptrdiff_t status[2];
    double **const parts[] = {&coarse.X, &coarse.y, &coarse.work, &coarse.dense, &coarse.knot_t, &coarse.knot_h, &coarse.knot_X, &coarse.knot_y, &coarse.knot_slope, &coarse.knot_theta};
    memcpy(fine.X_out, w->start, (size_t)fine.packed * sizeof(double));
    memcpy(fine.y_out, w->start + fine.packed, (size_t)fine.size * sizeof(double));
    fine.t = fine.times[0];
    fine.longest = fine.times[fine.count - 1] - fine.t;
    --fine.count;
    ++fine.times;
    fine.X_out += fine.packed;
    fine.y_out += fine.size;
    coarse = fine;
    for (size_t k = 0; k < sizeof parts / sizeof parts[0]; ++k) {
        *parts[k] += *parts[k] ? w->apart : 0;
    }
    coarse.X_out = w->other;
    coarse.y_out = w->other + fine.count * fine.packed;
    runs[0] = from_start(&coarse, w->start, w->tolerance);
    runs[1] = from_start(&fine, w->start, w->tolerance + 2);
    runs[1].reach *= w->shorter;
    for (int r = 0; r < 2; ++r) {
        begin(runs + r, course + r);
        status[r] = propose(runs + r, course + r, fine.room);
    }
    while (status[0] == GO || status[1] == GO) {
        if (status[0] == GO && status[1] == GO) {
            attempt_both(runs, course);
        } else {
            attempt(runs + (status[1] == GO), course + (status[1] == GO));
        }
        for (int r = 0; r < 2; ++r) {
            if (status[r] == GO && (status[r] = conclude(runs + r, course + r)) == GO) {
                status[r] = propose(runs + r, course + r, fine.room);
            }
        }
    }
    for (int r = 0; r < 2; ++r) {
        if (status[r] != DONE) {
            return status[r];
        }
        runs[r].times = fine.times;
        runs[r].count = fine.count;
    }
    w->found[6] = 0.0;
    w->found[0] = difference(w, &fine, runs);
    w->found[1] = farthest(fine.count * fine.packed, fine.X_out, NULL, farthest(fine.count * fine.size, fine.y_out, NULL, 0.0));
    w->found[2] = (double)runs[0].steps;
    w->found[3] = (double)runs[1].steps;
    w->found[4] = (double)runs[1].rejected;
    w->found[5] = (double)runs[1].evaluations;
    rows_of_knots(&fine, runs[1].steps, w->knots);
    return DONE;
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
