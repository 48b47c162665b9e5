/*
 * X' = X hat(xi), y' = F(t, X, y) of many members by the explicit pair 8(5,3), to a tolerance: pair853.c over twice eight lanes.
 *
 * A lane takes one member from its start to the last time with steps of its own, and then the next that waits: what a member comes to
 * does not depend on its neighbours. All that is in work is kept as the kernels take it, entry i of lane l at 8 i + l:
 *     rate(X_0, y, t, numbers...) -> y'        move(X_0, Theta) -> X_0 exp(Theta)
 * or, where y begins with the elements,
 *     rate(y, t, numbers...) -> y'             move(y) -> X, lift(X) -> the elements of y: of one member
 * The two halves go stage by stage in turn: a stage waits for the one before, and meanwhile the processor has the other half under way.
 * A step that would pass a wanted time ends there: it costs what a step of its own to that time would, and goes on from it.
 */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "pair_control.h"
#include "pair_step.h"

enum { WIDE = 8, HALVES = 2, PARTS = WIDE * sizeof(double) / sizeof(PairVector) };

typedef void (*Block)(const double *const *in, double *const *out); /* of eight members at once, or of one */

typedef struct {
    Block rate, move, lift;                       /* lift: NULL if y begins with Theta */
    ptrdiff_t members, packed, group, front, quaternions, size, numbers;
    const double *const *number;                  /* inputs of the rate beside X, y and t */
    const ptrdiff_t *number_stride, *number_size; /* in doubles, from member to member (0: all have the same), and of one */
    double rtol, atol, reach;                     /* |Theta| stays within reach */
    const double *X, *y;                          /* members x packed, members x size: where they start, Theta = 0 */
    const double *times;                          /* the start, and those that are wanted */
    ptrdiff_t count, row;                         /* of the wanted ones; members of all rows of the outputs */
    double *X_out, *y_out;                        /* count x row x packed, count x row x size */
    double *work;                                 /* as `Room` divides it */
    ptrdiff_t most;                               /* attempts of a member at a step */
    ptrdiff_t begun;                              /* members that have been given a lane, of the first half for both */
    ptrdiff_t steps, rejected, evaluations;       /* of all members together; of eight at a time */
    double stopped;                               /* the time of the member that cannot go on */
    double t[WIDE], t_low[WIDE], h[WIDE], goal[WIDE]; /* of lanes; h = 0: not known yet; the next wanted time */
    ptrdiff_t member[WIDE], next[WIDE], tries[WIDE]; /* member -1: the lane stands still */
} Lanes;

typedef struct {
    double *X, *y, *after, *moved, *k, *five, *three, *size, *number;
} Room; /* with elements in y, X and moved hold a member's state */

static Room room_of(const Lanes *p)
{
    const ptrdiff_t all = WIDE * p->size;
    Room room;
    room.X = p->work;
    room.moved = room.X + WIDE * p->packed;
    room.y = room.moved + WIDE * p->packed;
    room.after = room.y + all;
    room.five = room.after + all;
    room.three = room.five + all;
    room.size = room.three + all;
    room.k = room.size + all;
    room.number = room.k + STAGES * all;
    return room;
}

/* `size` numbers into a lane. */
static void put(double *to, ptrdiff_t lane, const double *from, ptrdiff_t size)
{
    for (ptrdiff_t i = 0; i < size; ++i) {
        to[WIDE * i + lane] = from[i];
    }
}

static void get(double *to, ptrdiff_t lane, const double *from, ptrdiff_t size)
{
    for (ptrdiff_t i = 0; i < size; ++i) {
        to[i] = from[WIDE * i + lane];
    }
}

/* q <- q/|q| in all lanes of y. */
static APART void unit(const Lanes *p, double *y)
{
    for (ptrdiff_t k = 0; k < p->quaternions; ++k) {
        double *q = y + 4 * WIDE * k;
        for (int l = 0; l < WIDE; ++l) {
            const double a = q[l], b = q[WIDE + l], c = q[2 * WIDE + l], d = q[3 * WIDE + l];
            const double square = a * a + b * b + c * c + d * d, by = square > 0.0 ? 1.0 / sqrt(square) : 0.0;
            q[l] = by * a;
            q[WIDE + l] = by * b;
            q[2 * WIDE + l] = by * c;
            q[3 * WIDE + l] = by * d;
        }
    }
}

/* A member at its start into a lane. */
static void enter(Lanes *p, ptrdiff_t lane, ptrdiff_t member)
{
    const Room room = room_of(p);
    double *number = room.number;
    put(room.y, lane, p->y + member * p->size, p->size);
    if (p->lift) {
        const double *in[1] = {p->X + member * p->packed};
        double *out[1] = {room.moved};
        p->lift(in, out);
        put(room.y, lane, room.moved, p->front);
        unit(p, room.y);
    } else {
        put(room.X, lane, p->X + member * p->packed, p->packed);
    }
    for (ptrdiff_t k = 0; k < p->numbers; ++k) {
        put(number, lane, p->number[k] + member * p->number_stride[k], p->number_size[k]);
        number += WIDE * p->number_size[k];
    }
    p->t[lane] = p->times[0];
    p->t_low[lane] = p->h[lane] = 0.0;
    p->goal[lane] = p->times[1];
    p->next[lane] = p->tries[lane] = 0;
    p->member[lane] = member;
}

static void rates(Lanes *p, const double *y, const double *t, double *to)
{
    const Room room = room_of(p);
    const double *in[3 + MOST_NUMBERS], *number = room.number;
    double *out[1];
    int first = 0;
    if (!p->lift) {
        in[first++] = room.X;
    }
    in[first++] = y;
    in[first++] = t;
    out[0] = to;
    for (ptrdiff_t k = 0; k < p->numbers; ++k) {
        in[first + k] = number;
        number += WIDE * p->number_size[k];
    }
    ++p->evaluations;
    p->rate(in, out);
}

/* y + h sum_j a_j k_j of ENTRIES entries of all lanes, each with its own h, in registers; see PAIR_SUM. */
#define LANES_SUM(ENTRIES)                                                                          \
    static inline void lanes_sum_##ENTRIES(const double *a, const unsigned char *used, int count, ptrdiff_t n, const double *k, const double *y, const double *h, double *to) \
    {                                                                                               \
        PairVector sum[ENTRIES * PARTS];                                                            \
        int u, l;                                                                                   \
        for (l = 0; l < ENTRIES * PARTS; ++l) {                                                     \
            sum[l] = (PairVector){0.0};                                                             \
        }                                                                                           \
        for (u = 0; u < count; ++u) {                                                               \
            const double weight = a[used[u]];                                                       \
            const PairVector *from = (const PairVector *)(k + used[u] * n);                         \
            for (l = 0; l < ENTRIES * PARTS; ++l) {                                                 \
                sum[l] += weight * from[l];                                                         \
            }                                                                                       \
        }                                                                                           \
        for (l = 0; l < ENTRIES * PARTS; ++l) {                                                     \
            ((PairVector *)to)[l] = ((const PairVector *)y)[l] + ((const PairVector *)h)[l % PARTS] * sum[l]; \
        }                                                                                           \
    }
LANES_SUM(1)
LANES_SUM(4)

/* Where stage s asks for its slope, or the state after the step: in `after`, lane by lane with its length h. Four entries at a time, the last perhaps again. */
static APART void stage(const Lanes *p, int s, const double *h)
{
    const Room room = room_of(p);
    const double *a = s < STAGES ? A[s] : B;
    const ptrdiff_t n = WIDE * p->size;
    ptrdiff_t i = 0;
    for (; i + 4 <= p->size; i += 4) {
        lanes_sum_4(a, USED[s], USES[s], n, room.k + WIDE * i, room.y + WIDE * i, h, room.after + WIDE * i);
    }
    if (i < p->size && p->size >= 4) {
        i = p->size - 4;
        lanes_sum_4(a, USED[s], USES[s], n, room.k + WIDE * i, room.y + WIDE * i, h, room.after + WIDE * i);
        return;
    }
    for (; i < p->size; ++i) {
        lanes_sum_1(a, USED[s], USES[s], n, room.k + WIDE * i, room.y + WIDE * i, h, room.after + WIDE * i);
    }
}

/* The slope of stage s, at what `stage` has made. */
static void slope(Lanes *p, int s, const double *h)
{
    const Room room = room_of(p);
    double t[WIDE];
    for (int l = 0; l < WIDE; ++l) {
        t[l] = p->t[l] + C[s] * h[l];
    }
    rates(p, room.after, t, room.k + s * WIDE * p->size);
}

/* The lengths of the next steps, at most to the next times, 0 of lanes that stand still; whether they end there. Without branches. */
static APART void cut(const Lanes *p, double *lengths, int *ends)
{
    for (int l = 0; l < WIDE; ++l) {
        const double gap = p->goal[l] - p->t[l] - p->t_low[l], h = p->h[l];
        const double before = gap < 1.9 * h ? 0.5 * gap : h; /* not a step and a crumb */
        const double length = gap <= h * (1 + 1e-10) ? gap : before;
        lengths[l] = p->member[l] < 0 ? 0.0 : length;
        ends[l] = gap <= h * (1 + 1e-10);
    }
}

/* Squares of entries over what is allowed; of entries of Theta, which are those of X, the size is one, of elements at least one. */
static APART void weigh(const Lanes *p)
{
    const Room room = room_of(p);
    const ptrdiff_t angles = WIDE * p->group, elements = WIDE * p->front, all = WIDE * p->size;
    for (ptrdiff_t at = 0; at < angles; ++at) {
        room.size[at] = 1.0 / (p->atol + p->rtol);
    }
    for (ptrdiff_t at = angles; at < elements; ++at) {
        const double a = fabs(room.y[at]), b = fabs(room.after[at]), c = a > b ? a : b;
        room.size[at] = 1.0 / (p->atol + p->rtol * (c > 1.0 ? c : 1.0));
    }
    for (ptrdiff_t at = elements; at < all; ++at) {
        const double a = fabs(room.y[at]), b = fabs(room.after[at]);
        room.size[at] = 1.0 / (p->atol + p->rtol * (a > b ? a : b));
    }
    for (ptrdiff_t at = 0; at < all; ++at) {
        const double e5 = room.size[at] * room.five[at], e3 = room.size[at] * room.three[at];
        room.five[at] = e5 * e5;
        room.three[at] = e3 * e3;
    }
}

/* Of each lane with its step h: the error over what is allowed (pair853.c), |Theta|^2, and by how much the step may grow for that error. */
static APART void judge(const Lanes *p, const double *h, double *error, double *angle, double *growth)
{
    const Room room = room_of(p);
    PairVector five[PARTS], three[PARTS], squares[PARTS];
    memset(five, 0, sizeof five);
    memset(three, 0, sizeof three);
    memset(squares, 0, sizeof squares);
    pair_errors(room.k, WIDE * p->size, room.five, room.three);
    weigh(p);
    for (ptrdiff_t i = 0; i < p->size; ++i) {
        for (int part = 0; part < PARTS; ++part) {
            five[part] += ((const PairVector *)(room.five + WIDE * i))[part];
            three[part] += ((const PairVector *)(room.three + WIDE * i))[part];
        }
    }
    for (ptrdiff_t i = 0; i < p->group; ++i) {
        for (int part = 0; part < PARTS; ++part) {
            const PairVector theta = ((const PairVector *)(room.after + WIDE * i))[part];
            squares[part] += theta * theta;
        }
    }
    memcpy(angle, squares, sizeof squares);
    for (int l = 0; l < WIDE; ++l) {
        error[l] = pair_error(((const double *)five)[l], ((const double *)three)[l], h[l], p->size);
    }
    for (int l = 0; l < WIDE; ++l) {
        growth[l] = longer(error[l]);
    }
}

/* Which lanes take their steps, and how many; all that work have tried once more, the one that tried most so many times. Without branches. */
static APART int accepted(Lanes *p, const double *error, const double *angle, int *take, ptrdiff_t *tried)
{
    const double far = p->reach * p->reach;
    ptrdiff_t most = 0;
    int taken = 0;
    for (int l = 0; l < WIDE; ++l) {
        const int works = p->member[l] >= 0;
        take[l] = works & (error[l] <= 1.0) & (angle[l] <= far);
        taken += take[l];
        p->tries[l] += works;
        most = p->tries[l] > most ? p->tries[l] : most;
    }
    *tried = most;
    return taken;
}

/* A lane whose step of length h is not taken: the next is shorter. DONE, or why it cannot be. */
static ptrdiff_t refuse(Lanes *p, int l, double h, double error, double growth, double angle)
{
    const int runs = error <= 1e300, far = runs && angle > p->reach * p->reach;
    /* Theta grows about as h does: the first length ends at 0.9 of its reach */
    const double factor = far ? 0.9 * p->reach / sqrt(angle) : growth;
    ++p->rejected;
    p->h[l] = shorter(h, factor);
    return !vanishes(p->h[l], p->t[l]) ? DONE : runs ? STUCK : LOST;
}

/* Lanes behind steps of these lengths that they take: their times and the lengths of the next. Without branches. */
static APART void go_on(Lanes *p, const double *h, const double *growth, const int *take, const int *ends)
{
    for (int l = 0; l < WIDE; ++l) {
        const double next = next_length(h[l], p->h[l], growth[l]);
        double t = p->t[l], low = p->t_low[l];
        later(&t, &low, h[l]);
        t = ends[l] ? p->goal[l] : t;
        low = ends[l] ? 0.0 : low;
        p->h[l] = take[l] ? next : p->h[l];
        p->t[l] = take[l] ? t : p->t[l];
        p->t_low[l] = take[l] ? low : p->t_low[l];
    }
}

/* A lane at a wanted time: its output, and the next wanted time, or it stands still. */
static void put_out(Lanes *p, int l)
{
    const Room room = room_of(p);
    const ptrdiff_t at = p->next[l] * p->row + p->member[l];
    get(p->y_out + at * p->size, l, room.y, p->size);
    if (p->lift) {
        const double *in[1] = {p->y_out + at * p->size};
        double *out[1] = {p->X_out + at * p->packed};
        p->move(in, out);
    } else {
        get(p->X_out + at * p->packed, l, room.X, p->packed);
    }
    if (++p->next[l] < p->count) {
        p->goal[l] = p->times[p->next[l] + 1];
    } else {
        p->member[l] = -1;
    }
}

/* The state behind the steps of the lanes that `take` it, or of all: X exp(Theta); Theta in y stays 0. Or q/|q|. */
static void settle(Lanes *p, const int *take, int all)
{
    const Room room = room_of(p);
    const double *in[2] = {room.X, room.after};
    double *out[1] = {room.moved};
    if (p->lift) {
        unit(p, room.after);
    } else {
        p->move(in, out);
    }
    if (all && p->lift) {
        memcpy(room.y, room.after, (size_t)(WIDE * p->size) * sizeof(double));
        return;
    }
    if (all) {
        memcpy(room.X, room.moved, (size_t)(WIDE * p->packed) * sizeof(double));
        memcpy(room.y + WIDE * p->group, room.after + WIDE * p->group, (size_t)(WIDE * (p->size - p->group)) * sizeof(double));
        return;
    }
    for (int l = 0; l < WIDE; ++l) {
        for (ptrdiff_t i = 0; take[l] && !p->lift && i < p->packed; ++i) {
            room.X[WIDE * i + l] = room.moved[WIDE * i + l];
        }
        for (ptrdiff_t i = p->group; take[l] && i < p->size; ++i) {
            room.y[WIDE * i + l] = room.after[WIDE * i + l];
        }
    }
}

/* Lanes of a half that stand still are given members that wait; whether one has work. */
static int fill(Lanes *p, ptrdiff_t *begun)
{
    int works = 0;
    for (int l = 0; l < WIDE; ++l) {
        if (p->member[l] < 0 && *begun < p->members) {
            enter(p, l, (*begun)++);
        }
        works |= p->member[l] >= 0;
    }
    return works;
}

/* The steps of a half that are tried next: their lengths, 0 of a lane that stands still, and whether they end at wanted times; the first stage. */
static void set_out(Lanes *p, double *h, int *ends)
{
    const Room room = room_of(p);
    rates(p, room.y, p->t, room.k);
    for (int l = 0; l < WIDE; ++l) {
        if (!(p->h[l] > 0.0)) {
            p->h[l] = first_step(p->size, WIDE, room.y + l, room.k + l);
        }
    }
    cut(p, h, ends);
}

/* All stages are there: the steps that are good enough are taken. DONE, or why a member cannot go on. */
static ptrdiff_t arrive(Lanes *p, const double *h, const int *ends)
{
    double error[WIDE], growth[WIDE], angle[WIDE];
    int take[WIDE], taken;
    ptrdiff_t tried;
    judge(p, h, error, angle, growth);
    taken = accepted(p, error, angle, take, &tried);
    for (int l = 0; l < WIDE && (taken < WIDE || tried > p->most); ++l) {
        if (p->member[l] >= 0) {
            const ptrdiff_t status = take[l] ? DONE : refuse(p, l, h[l], error[l], growth[l], angle[l]);
            if (status != DONE || p->tries[l] > p->most) {
                p->stopped = p->t[l];
                return status != DONE ? status : MANY;
            }
        }
    }
    if (taken) {
        settle(p, take, taken == WIDE);
    }
    p->steps += taken;
    go_on(p, h, growth, take, ends);
    for (int l = 0; l < WIDE; ++l) {
        if (take[l] && ends[l]) {
            put_out(p, l);
        }
    }
    return DONE;
}

/* All lanes of a half at the first member, but none at work. */
EXPORT void lanes_start(Lanes *p);
EXPORT void lanes_start(Lanes *p)
{
    for (int l = 0; l < WIDE; ++l) {
        enter(p, l, 0);
        p->member[l] = -1;
    }
}

/* So many steps of every lane of both halves, or until all members are at the last time; FULL: call again. `stopped` is of the first half. */
EXPORT ptrdiff_t lanes_run(Lanes *halves, ptrdiff_t rounds);
EXPORT ptrdiff_t lanes_run(Lanes *halves, ptrdiff_t rounds)
{
    for (ptrdiff_t round = 0;; ++round) {
        double h[HALVES][WIDE];
        int ends[HALVES][WIDE], works[HALVES], some = 0;
        for (int g = 0; g < HALVES; ++g) {
            works[g] = fill(halves + g, &halves[0].begun);
            some |= works[g];
        }
        if (!some || round == rounds) {
            return some ? FULL : DONE;
        }
        for (int g = 0; g < HALVES; ++g) {
            if (works[g]) {
                set_out(halves + g, h[g], ends[g]);
            }
        }
        for (int s = 1; s <= STAGES; ++s) {
            for (int g = 0; g < HALVES; ++g) {
                if (works[g]) {
                    stage(halves + g, s, h[g]);
                    if (s < STAGES) {
                        slope(halves + g, s, h[g]);
                    }
                }
            }
        }
        for (int g = 0; g < HALVES; ++g) {
            const ptrdiff_t status = works[g] ? arrive(halves + g, h[g], ends[g]) : DONE;
            if (status != DONE) {
                halves[0].stopped = halves[g].stopped;
                return status;
            }
        }
    }
}
