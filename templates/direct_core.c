/*
 * Steering by reaching first and descending afterwards: many starts side by side, one in each lane of a vector of doubles, GROUP in turn.
 *
 *     Y = L X0 E_1 ... E_K R,   E_k = exp(a_k + sum_i (p_k u[s_k, i] + q_k u[s_k + 1, i]) b_ki)
 *
 * must become a given matrix (or a phase times it) by the choice of the controls u within their bounds. The sizes of the
 * group (D, PARTS, N, M) stand in direct_sizes.h; everything else arrives at run time, so that one library serves every
 * problem of a group. Nothing is allocated here: the caller lends the memory.
 */
#include "direct_newton.h"

enum { NEWTON = 6 }; /* proximal steps before the first of Newton's, which far from the end lead anywhere */
/* A lane whose cost less this many times the gain to expect stays above what another has ended at is left where it is. */
#define HOPE 2.0

/* Keeps of `bracket` what acts: of sixteen Pauli strings four controls and a drift are five. Numbers go to `value`, pairs of indices to `indices`. */
static void restrict_bracket(task *w, double *value, void *indices)
{
    const programme *p = w->p;
    const sparse *all = &p->bracket;
    int *j = indices, *k = j + all->first[N];
    unsigned char there[N] = {0};
    int i, n, m, row, count = 0;
    for (row = 0; row < p->rows; ++row) {
        for (i = 0; i < N; ++i) {
            there[i] |= p->drifts[row * N + i] != 0.0;
            for (m = 0; m < M; ++m) {
                there[i] |= p->directions[(row * M + m) * N + i] != 0.0;
            }
        }
    }
    for (i = 0; i < N; ++i) {
        w->first[i] = count;
        for (n = all->first[i]; n < all->first[i + 1]; ++n) {
            if (there[all->j[n]]) {
                value[count] = all->value[n];
                j[count] = all->j[n];
                k[count] = all->k[n];
                ++count;
            }
        }
    }
    w->first[N] = count;
    w->acting.first = w->first;
    w->acting.j = j;
    w->acting.k = k;
    w->acting.value = value;
}

/* Takes the memory that is lent, and the vector of lanes from `first` on; lanes beyond the last repeat it. */
static void begin(task *w, const programme *p, int lanes, int first, double *memory)
{
    V *next = (V *)memory;
    const size_t columns = (size_t)p->slots * M, K = (size_t)p->exponentials;
    V **rows[] = {&w->at.u, &w->trial.u, &w->kept.u, &w->f, &w->t, &w->v, &w->z, &w->g, &w->s, &w->d, &w->n};
    V **slopes[] = {&w->at.J, &w->trial.J, &w->kept.J};
    size_t i;
    int l, e;
    w->p = p;
    w->columns = (int)columns;
    for (i = 0; i < sizeof rows / sizeof *rows; ++i) {
        *rows[i] = next;
        next += columns;
    }
    for (i = 0; i < sizeof slopes / sizeof *slopes; ++i) {
        *slopes[i] = next;
        next += N * columns;
    }
    w->E = next;
    w->x = w->E + K * ENTRIES;
    w->bodily = w->x + K * N;
    w->moved = w->bodily + K * M * N;
    w->within = w->moved + K * N;
    w->twice = w->within + K * M * M;
    w->Z = w->twice + N * N;
    w->ad = w->Z + N * ENTRIES;
    next = w->ad + p->bracket.first[N];
    restrict_bracket(w, (double *)next, (double *)next + p->bracket.first[N]);
    w->plain = 1;
    for (e = 0; e < ENTRIES; ++e) {
        w->plain &= p->right[e] == (e % ((D + 1) * PARTS) == 0 ? 1.0 : 0.0);
    }
    for (l = 0; l < LANES; ++l) {
        w->lane[l] = first + l < lanes ? first + l : lanes - 1;
        for (e = 0; e < ENTRIES; ++e) {
            LANE(w->value[e], l) = p->value[(size_t)w->lane[l] * ENTRIES + e];
        }
    }
}

static void read_lanes(const task *w, const double *u, V *to)
{
    int l, c;
    for (c = 0; c < w->columns; ++c) {
        for (l = 0; l < LANES; ++l) {
            const double value = u[(size_t)w->lane[l] * w->columns + c];
            LANE(to[c], l) = fmin(fmax(value, w->p->low[c]), w->p->high[c]);
        }
    }
}

/* Doubles of memory for one vector of lanes: vectors in whole, too, what is behind them. */
static size_t memory_of_pack(const programme *p)
{
    const size_t columns = (size_t)p->slots * M, K = (size_t)p->exponentials, brackets = (size_t)p->bracket.first[N];
    return LANES
        * ((11 + 3 * N) * columns + K * (ENTRIES + (2 + M) * N + M * M) + N * (N + ENTRIES) + brackets
            + (2 * brackets + LANES - 1) / LANES);
}

/* Doubles of memory for a programme, to be aligned to 64 bytes. */
size_t direct_memory(const programme *p)
{
    return PACKS * memory_of_pack(p);
}

/* Takes the memory for the group of starts from `first` on, with the controls u in the `at` of each; returns how many there are. */
static int begin_group(task *w, const programme *p, int lanes, int first, const double *u, double *memory)
{
    const int count = lanes - first < GROUP ? lanes - first : GROUP;
    int k;
    for (k = 0; k < packs_of(count); ++k) {
        begin(w + k, p, lanes, first + k * LANES, memory + (size_t)k * memory_of_pack(p));
        read_lanes(w + k, u, w[k].at.u);
    }
    return count;
}

static void write_lanes(const task *w, int lanes, int first, const point *at, double *u, double *size)
{
    int l, c;
    for (l = 0; l < LANES && first + l < lanes; ++l) {
        for (c = 0; c < w->columns; ++c) {
            u[(size_t)(first + l) * w->columns + c] = LANE(at->u[c], l);
        }
        size[first + l] = LANE(at->size, l);
    }
}

/*
 * Stage 1: from the controls u (lanes, slots, M) to controls that reach the goal; the residual each lane is left with, and by what phase its
 * end is ahead of the value, where that is free.
 */
void direct_reach(const programme *p, int lanes, double *u, double *size, double *phase, int *used, double *memory)
{
    int first, k, l;
    for (first = 0; first < lanes; first += GROUP) {
        task w[PACKS];
        int steps[GROUP] = {0};
        const int count = begin_group(w, p, lanes, first, u, memory);
        arrive(w, count, steps);
        for (k = 0; k < packs_of(count); ++k) {
            write_lanes(w + k, lanes, first + k * LANES, &w[k].at, u, size);
            if (p->free_phase) {
                examine(w + k, &w[k].at);
            }
        }
        for (l = 0; l < count; ++l) {
            used[first + l] = steps[l];
            if (p->free_phase) {
                const V *ahead = w[l / LANES].ahead;
                phase[first + l] = atan2(LANE(ahead[1], l % LANES), LANE(ahead[0], l % LANES));
            }
        }
    }
}

/* Residual, its reduced coordinates (lanes, N) and their derivative (lanes, N, slots M) at u. */
void direct_linearise(const programme *p, int lanes, const double *u, double *size, double *r, double *J, double *memory)
{
    int first, l, i, c;
    for (first = 0; first < lanes; first += LANES) {
        task w;
        begin(&w, p, lanes, first, memory);
        for (c = 0; c < w.columns; ++c) {
            for (l = 0; l < LANES; ++l) {
                LANE(w.at.u[c], l) = u[(size_t)w.lane[l] * w.columns + c];
            }
        }
        linearise(&w, &w.at);
        for (l = 0; l < LANES && first + l < lanes; ++l) {
            size[first + l] = LANE(w.at.size, l);
            for (i = 0; i < N; ++i) {
                r[(size_t)(first + l) * N + i] = LANE(w.at.r[i], l);
                for (c = 0; c < w.columns; ++c) {
                    J[((size_t)(first + l) * N + i) * w.columns + c] = LANE(w.at.J[(size_t)i * w.columns + c], l);
                }
            }
        }
    }
}

/* Where one vector of lanes stands in its descent. */
typedef struct {
    V rho, sigma; /* what keeps proximal steps and Newton's short */
    V best;       /* the objective at `kept` */
    V dual[N];    /* multipliers of the reduced residual */
    V next[N];    /* the same after the step in hand */
    V expected;   /* what that step is to gain */
    V quiet;      /* small gains in a row */
    Mask open;
} descent;

/* The step of round `curved` from what is kept, within the bounds, to `at`. */
static void propose(task *w, descent *d, int curved)
{
    const programme *p = w->p;
    int c;
    memcpy(d->next, d->dual, sizeof d->next);
    linearise(w, &w->kept);
    if (curved) {
        d->expected = newton(w, &w->kept, d->rho, d->sigma, d->next, w->v);
    } else {
        proximal(w, &w->kept, d->rho, d->next, w->v);
    }
    for (c = 0; c < w->columns; ++c) {
        w->at.u[c] = least(largest(w->v[c], spread(p->low[c])), spread(p->high[c]));
    }
}

/* Keeps what is at the goal and cheaper; where the gain was not small the lane goes on. */
static void judge(task *w, descent *d, int curved)
{
    const programme *p = w->p;
    const V found = objective(w, w->at.u);
    const Mask better = d->open & LESS(w->at.size, spread(100.0 * p->enough)) & LESS(found, d->best);
    const V gain = SELECT(better, d->best - found, spread(0.0));
    const Mask small = better & NOT(LESS(p->relative * d->best, gain));
    int i;
    take(w, better, &w->kept, &w->at);
    for (i = 0; i < N; ++i) {
        d->dual[i] = SELECT(better, d->next[i], d->dual[i]);
    }
    d->best = SELECT(better, found, d->best);
    if (curved) {
        d->sigma = SELECT(better, 0.1 * d->sigma, largest(8.0 * d->sigma, spread(0.01)));
    } else {
        d->rho = SELECT(better, largest(d->rho * (1.0 / 3.0), spread(1e-6)), 4.0 * d->rho);
        d->quiet = SELECT(small, d->quiet + 1.0, SELECT(better, spread(0.0), d->quiet));
    }
}

/*
 * Stage 2: from controls that reach the goal to cheaper ones that reach it too. Each round takes the proximal step of the
 * linearised problem and restores the goal by a few undamped steps; rho, which keeps the step short, falls with success.
 * y (lanes, N) are the multipliers of the reduced residual at the end.
 */
void direct_descend(const programme *p, int lanes, double *u, double *size, double *cost, double *y, int *used, double *memory)
{
    double leader = INFINITY; /* the least of what lanes have ended at */
    int first, k, l, i, round, busy;
    for (first = 0; first < lanes; first += GROUP) {
        task w[PACKS];
        descent state[PACKS];
        const int count = begin_group(w, p, lanes, first, u, memory), packs = packs_of(count);
        memset(state, 0, sizeof state);
        for (k = 0; k < packs; ++k) {
            descent *const d = state + k;
            memcpy(w[k].kept.u, w[k].at.u, (size_t)w->columns * sizeof *w->at.u);
            d->rho = spread(1.0);
            d->sigma = spread(0.01);
            d->best = objective(w + k, w[k].kept.u);
            d->open = LESS(d->quiet, d->rho);
        }
        for (l = 0; l < count; ++l) {
            used[first + l] = 0;
        }
        for (round = 0, busy = 1; round < p->descend_iterations && busy; ++round) {
            const int curved = !p->fuel && round >= NEWTON && round % 2;
            Mask active[PACKS];
            int idle[PACKS] = {0};
            for (k = 0; k < PACKS; ++k) {
                active[k] = state[k].open;
            }
            for (k = 0; k < packs; ++k) {
                const descent *d = state + k;
                /* lanes that have closed go on where what they end at may become the least of all */
                idle[k] = !any(p->fuel ? d->open : d->open | LESS(d->best, spread(leader)));
                if (!idle[k]) {
                    propose(w + k, state + k, curved);
                }
            }
            restore(w, packs, active);
            for (k = 0; k < packs; ++k) {
                if (!idle[k]) {
                    judge(w + k, state + k, curved);
                }
                /* a step that has next to nothing to gain is the end, and not even enough to catch up with the cheapest is, too */
                for (l = 0; curved && !idle[k] && l < LANES; ++l) {
                    const double best = LANE(state[k].best, l);
                    if (!(LANE(state[k].expected, l) > p->relative * best)) {
                        leader = fmin(leader, best);
                    }
                }
            }
            for (k = 0, busy = 0; k < packs; ++k) {
                descent *const d = state + k;
                if (!any(d->open)) {
                    continue;
                }
                if (curved) {
                    d->open &= LESS(p->relative * d->best, d->expected) & LESS(d->best - HOPE * d->expected, spread(leader));
                }
                for (l = 0; l < LANES && k * LANES + l < count; ++l) {
                    used[first + k * LANES + l] += LANE(d->open, l) != 0;
                }
                if (!curved) { /* done after two small gains in a row, or where no step however short is a gain */
                    d->open &= LESS(d->quiet, spread(1.5)) & LESS(d->rho, spread(1e6));
                }
                busy |= any(d->open);
            }
        }
        for (k = 0; k < packs; ++k) {
            write_lanes(w + k, lanes, first + k * LANES, &w[k].kept, u, size);
        }
        for (l = 0; l < count; ++l) {
            cost[first + l] = LANE(state[l / LANES].best, l % LANES);
            for (i = 0; i < N; ++i) {
                y[(size_t)(first + l) * N + i] = LANE(state[l / LANES].dual[i], l % LANES);
            }
        }
    }
}
