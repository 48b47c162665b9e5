/*
 * Steering by reaching first and descending afterwards: many starts side by side, one in each lane of a vector of doubles.
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

/* Takes the memory that is lent, and the lanes from `first` on; lanes beyond the last repeat it. */
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

/* Doubles of memory for a programme, to be aligned to 64 bytes. */
size_t direct_memory(const programme *p)
{
    const size_t columns = (size_t)p->slots * M, K = (size_t)p->exponentials;
    return LANES * ((11 + 3 * N) * columns + K * (ENTRIES + (2 + M) * N + M * M) + N * (N + ENTRIES))
        + (size_t)(LANES + 2) * (size_t)p->bracket.first[N];
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

static Mask everywhere(void)
{
    return LESS(spread(0.0), spread(1.0));
}

/*
 * Stage 1: from the controls u (lanes, slots, M) to controls that reach the goal; the residual each lane is left with, and by what phase its
 * end is ahead of the value, where that is free.
 */
void direct_reach(const programme *p, int lanes, double *u, double *size, double *phase, int *used, double *memory)
{
    int first, l;
    for (first = 0; first < lanes; first += LANES) {
        task w;
        int steps[LANES] = {0};
        begin(&w, p, lanes, first, memory);
        read_lanes(&w, u, w.at.u);
        arrive(&w, &w.at, everywhere(), p->reach_iterations, p->enough, p->damping, p->wanted, steps);
        write_lanes(&w, lanes, first, &w.at, u, size);
        if (p->free_phase) {
            examine(&w, &w.at);
        }
        for (l = 0; l < LANES && first + l < lanes; ++l) {
            used[first + l] = steps[l];
            if (p->free_phase) {
                phase[first + l] = atan2(LANE(w.ahead[1], l), LANE(w.ahead[0], l));
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

/*
 * Stage 2: from controls that reach the goal to cheaper ones that reach it too. Each round takes the proximal step of the
 * linearised problem and restores the goal by a few undamped steps; rho, which keeps the step short, falls with success.
 * y (lanes, N) are the multipliers of the reduced residual at the end.
 */
void direct_descend(const programme *p, int lanes, double *u, double *size, double *cost, double *y, int *used, double *memory)
{
    const double enough = 100.0 * p->enough;
    double leader = INFINITY; /* the least of what lanes have ended at */
    int first, l, i, c, round;
    for (first = 0; first < lanes; first += LANES) {
        task w;
        V rho = spread(1.0), sigma = spread(0.01), best, dual[N], quiet = spread(0.0), next[N];
        Mask open = everywhere();
        begin(&w, p, lanes, first, memory);
        read_lanes(&w, u, w.kept.u);
        best = objective(&w, w.kept.u);
        for (i = 0; i < N; ++i) {
            dual[i] = spread(0.0);
        }
        for (l = 0; l < LANES && first + l < lanes; ++l) {
            used[first + l] = 0;
        }
        for (round = 0; round < p->descend_iterations && any(open); ++round) {
            const int curved = !p->fuel && round >= NEWTON && round % 2;
            V found, gain, expected = spread(INFINITY);
            Mask better, small;
            memcpy(next, dual, sizeof next);
            linearise(&w, &w.kept);
            if (curved) {
                expected = newton(&w, &w.kept, rho, sigma, next, w.v);
            } else {
                proximal(&w, &w.kept, rho, next, w.v);
            }
            for (c = 0; c < w.columns; ++c) {
                w.at.u[c] = least(largest(w.v[c], spread(p->low[c])), spread(p->high[c]));
            }
            restore(&w, &w.at, w.kept.J, open);
            found = objective(&w, w.at.u);
            better = open & LESS(w.at.size, spread(enough)) & LESS(found, best);
            gain = SELECT(better, best - found, spread(0.0));
            small = better & NOT(LESS(p->relative * best, gain));
            take(&w, better, &w.kept, &w.at);
            for (i = 0; i < N; ++i) {
                dual[i] = SELECT(better, next[i], dual[i]);
            }
            best = SELECT(better, found, best);
            if (curved) {
                sigma = SELECT(better, 0.1 * sigma, largest(8.0 * sigma, spread(0.01)));
                /* a step that has next to nothing to gain is the end, and not even enough to catch up with the cheapest is, too */
                for (l = 0; l < LANES; ++l) {
                    if (!(LANE(expected, l) > p->relative * LANE(best, l))) {
                        leader = fmin(leader, LANE(best, l));
                    }
                }
                open &= LESS(p->relative * best, expected) & LESS(best - HOPE * expected, spread(leader));
                for (l = 0; l < LANES && first + l < lanes; ++l) {
                    used[first + l] += LANE(open, l) != 0;
                }
                continue;
            }
            rho = SELECT(better, largest(rho * (1.0 / 3.0), spread(1e-6)), 4.0 * rho);
            /* done after two small gains in a row, or where no step however short is a gain */
            quiet = SELECT(small, quiet + 1.0, SELECT(better, spread(0.0), quiet));
            for (l = 0; l < LANES && first + l < lanes; ++l) {
                used[first + l] += LANE(open, l) != 0;
            }
            open &= LESS(quiet, spread(1.5)) & LESS(rho, spread(1e6));
        }
        write_lanes(&w, lanes, first, &w.kept, u, size);
        for (l = 0; l < LANES && first + l < lanes; ++l) {
            cost[first + l] = LANE(best, l);
            for (i = 0; i < N; ++i) {
                y[(size_t)(first + l) * N + i] = LANE(dual[i], l);
            }
        }
    }
}
