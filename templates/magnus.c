/*
 * X' = X hat(u(t)) by Magnus steps of order 4, 6 or 8, eight at once.
 *
 * The equation is linear in X, so steps do not wait for each other. One trajectory is cut into eight runs of steps, a lane
 * each, every run from the identity; their products are multiplied at the end. Many trajectories go eight at a time,
 * a lane each. A step is X <- X + X (exp(Omega) - 1): the increment is added, since 1 + (cos - 1) would be rounded the
 * same way in every step. Memory does not grow with the number of steps; everything is given, nothing is kept.
 *
 * magnus_group.h, made for the group, says: DIM (of the algebra), SIZE (of the matrices), PARTS (2 where they are complex),
 * ROWS (all basis matrices vanish below), SKEW (they are skew-Hermitian), COORDINATES (brackets from structure
 * constants, else as matrices), QUATERNION; and hat(), lie_bracket(), quaternion_matrix().
 */
#include "magnus_lanes.h"

#include "magnus_group.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

#define MATRIX (PARTS * ROWS * SIZE)
#define FULL (PARTS * SIZE * SIZE)
#if COORDINATES
#define WORK DIM
#else
#define WORK MATRIX
#endif
#if QUATERNION
#define STATE 4
#else
#define STATE MATRIX
#endif

#include "magnus_input.h"
#include "magnus_exponent.h"
#include "magnus_move.h"

/* One step of every lane; keeps the largest squared |a_1|. */
static __attribute__((noinline)) void step(const Input *u, const Source *source, int order, V middle, V low, V h, const double *const *table,
    V *state, V *most)
{
    V a[ORDERS][DIM], omega[WORK], norm = splat(0.0);
    generators(u, source, middle, low, h, table, a);
#if COORDINATES
#define IN_WORK a
#else
    V work[ORDERS][MATRIX];
    EACH(j, ORDERS) { hat(a[j], work[j]); }
#define IN_WORK work
#endif
    if (order == 8) {
        Stages stages;
        exponent8((const V (*)[WORK])IN_WORK, &stages, omega);
    } else if (order == 6) {
        exponent6((const V (*)[WORK])IN_WORK, omega);
    } else {
        exponent4((const V (*)[WORK])IN_WORK, omega);
    }
    EACH(i, DIM) { norm += a[0][i] * a[0][i]; }
    *most = (V)(((norm > *most) & (I)norm) | (~(norm > *most) & (I)*most)) + 0.0 * norm;
    move(omega, state);
}

/* The middle of step `inside` of a span, to twice the precision. */
static inline V middle_of(V knot, V inside, V h, V *low)
{
    const V count = inside + 0.5, offset = count * h, rest = fused(count, h, -offset);
    const V sum = knot + offset, v = sum - knot;
    *low = ((knot - (sum - v)) + (offset - v)) + rest;
    return sum;
}

static void lay_out(const Input *u, V *space, Source *source)
{
    source->cosines = space;
    source->sines = source->cosines + u->rates * DIM;
    source->rate = source->sines + u->rates * DIM;
    source->rate_low = source->rate + u->rates;
    source->weights = source->rate_low + u->rates;
    source->left = source->weights + u->rates * ORDERS;
    source->slope = source->left + DIM;
    source->series = source->slope + DIM;
    EACH(l, LANES) { source->h[l] = -1.0; }
    source->start = splat(0.0);
    source->width = splat(1.0);
    source->factor = splat(1.0);
    EACH(i, DIM) { source->left[i] = source->slope[i] = splat(0.0); }
    for (ptrdiff_t k = 0; k < u->rates * ORDERS; ++k) {
        source->weights[k] = splat(0.0);
    }
    for (ptrdiff_t k = 0; k < u->terms * DIM; ++k) {
        source->series[k] = splat(0.0);
    }
}

static void set_waves(const Input *u, Source *source, int lane, ptrdiff_t who)
{
    for (ptrdiff_t k = 0; k < u->rates * DIM; ++k) {
        source->cosines[k][lane] = u->cosines[who * u->wave_stride + k];
        source->sines[k][lane] = u->sines[who * u->wave_stride + k];
    }
    for (ptrdiff_t f = 0; f < u->rates; ++f) {
        source->rate[f][lane] = u->rate[who * u->rate_stride + f];
        source->rate_low[f][lane] = u->rate_low[who * u->rate_stride + f];
    }
    source->h[lane] = -1.0;
    source->factor[lane] = u->factor[who * u->factor_stride];
}

/* Doubles that the workspace needs, with 8 more for its alignment. */
EXPORT ptrdiff_t magnus_work(ptrdiff_t rates, ptrdiff_t terms, ptrdiff_t slots);
EXPORT ptrdiff_t magnus_work(ptrdiff_t rates, ptrdiff_t terms, ptrdiff_t slots)
{
    return LANES * (rates * (2 * DIM + 2 + ORDERS) + (terms + 2) * DIM + 1) + slots * (STATE + 1);
}

static V *aligned(double *space)
{
    return (V *)(((size_t)space + sizeof(V) - 1) / sizeof(V) * sizeof(V));
}

/*
 * One trajectory, steps from .. to - 1, from X0: lanes over time. X: (slots, SIZE, SIZE), `end` (SIZE, SIZE) the last state.
 * Returns the largest |a_1| of any step (the length of h u, averaged).
 */
EXPORT double magnus_one(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t from, ptrdiff_t to, const double *X0, ptrdiff_t slots,
    double *space, double *X, double *end);
EXPORT double magnus_one(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t from, ptrdiff_t to, const double *X0, ptrdiff_t slots,
    double *space, double *X, double *end)
{
    V *work = aligned(space);
    Source source;
    lay_out(u, work, &source);
    double *kept = (double *)(source.series + u->terms * DIM), *lane_of = kept + slots * STATE;
    ptrdiff_t span[LANES], inside[LANES], left[LANES], at[LANES];
    V state[STATE], most = splat(0.0), knot = splat(0.0), h = splat(0.0), place = splat(0.0);
    double prefix[LANES + 1][FULL];
    identity(state);
    for (ptrdiff_t k = 0; k < slots; ++k) {
        lane_of[k] = -1.0;
    }
    EACH(l, LANES) {
        const ptrdiff_t first = from + (to - from) / LANES * l + ((to - from) % LANES) * l / LANES;
        const ptrdiff_t last = from + (to - from) / LANES * (l + 1) + ((to - from) % LANES) * (l + 1) / LANES;
        ptrdiff_t low = 0, high = grid->spans;
        set_waves(u, &source, l, 0);
        left[l] = last - first;
        at[l] = left[l] ? first : 0;
        while (high - low > 1) { /* the span in which the first step lies */
            const ptrdiff_t half = (low + high) / 2;
            if (grid->first[half] <= first) { low = half; } else { high = half; }
        }
        span[l] = low;
        inside[l] = first - grid->first[low];
        if (left[l]) {
            knot[l] = grid->knots[low];
            h[l] = (grid->knots[low + 1] - grid->knots[low]) / (double)grid->parts[low];
            place[l] = (double)inside[l];
            enter(u, grid, &source, l, low, h[l], 0);
        }
    }
    for (;;) {
        ptrdiff_t count = 0;
        EACH(l, LANES) {
            if (left[l]) {
                const ptrdiff_t rest = grid->parts[span[l]] - inside[l], mine = rest < left[l] ? rest : left[l];
                count = count == 0 || mine < count ? mine : count;
            }
        }
        if (count == 0) {
            break;
        }
        for (ptrdiff_t k = 0; k < count; ++k) {
            const double *table[LANES];
            V low;
            const V middle = middle_of(knot, place, h, &low);
            EACH(l, LANES) { table[l] = u->table + (u->table ? (left[l] ? at[l] + k : 0) * u->nodes * DIM : 0); }
            step(u, &source, (int)order, middle, low, h, table, state, &most);
            place += 1.0;
        }
        EACH(l, LANES) {
            if (!left[l]) {
                continue;
            }
            inside[l] += count;
            left[l] -= count;
            at[l] += count;
            if (inside[l] == grid->parts[span[l]]) {
                const ptrdiff_t slot = grid->slot[span[l]];
                if (slot >= 0) {
                    EACH(k, STATE) { kept[slot * STATE + k] = state[k][l]; }
                    lane_of[slot] = l;
                }
                inside[l] = 0;
                place[l] = 0.0;
                ++span[l];
                if (left[l]) {
                    knot[l] = grid->knots[span[l]];
                    h[l] = (grid->knots[span[l] + 1] - grid->knots[span[l]]) / (double)grid->parts[span[l]];
                    enter(u, grid, &source, l, span[l], h[l], 0);
                }
            }
            if (!left[l]) {
                h[l] = 0.0; /* waits, at the identity of a step */
            }
        }
    }
    get(X0, prefix[0]);
    EACH(l, LANES) {
        double one[STATE], matrix[FULL];
        EACH(k, STATE) { one[k] = state[k][l]; }
        to_matrix(one, matrix);
        multiply_one(prefix[l], matrix, prefix[l + 1]);
    }
    put(prefix[LANES], end);
    for (ptrdiff_t slot = 0; slot < slots; ++slot) {
        if (lane_of[slot] >= 0.0) {
            double matrix[FULL], moved[FULL];
            to_matrix(kept + slot * STATE, matrix);
            multiply_one(prefix[(int)lane_of[slot]], matrix, moved);
            put(moved, X + slot * PARTS * SIZE * SIZE);
        }
    }
    return sqrt(largest(most));
}

/*
 * `count` trajectories, all steps, a lane each; X0: (count, SIZE, SIZE), or one of all where X0_stride is 0.
 * X: (count, slots, SIZE, SIZE).
 */
EXPORT double magnus_many(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t count, const double *X0, ptrdiff_t X0_stride,
    ptrdiff_t slots, double *space, double *X);
EXPORT double magnus_many(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t count, const double *X0, ptrdiff_t X0_stride,
    ptrdiff_t slots, double *space, double *X)
{
    V most = splat(0.0);
    Source source;
    lay_out(u, aligned(space), &source);
    for (ptrdiff_t row = 0; row < count; row += LANES) {
        double start[LANES][FULL];
        const double *table[LANES];
        V state[STATE];
        ptrdiff_t at = 0;
        identity(state);
        EACH(l, LANES) {
            const ptrdiff_t who = row + l < count ? row + l : count - 1; /* spare lanes repeat the last */
            set_waves(u, &source, l, who);
            get(X0 + who * X0_stride, start[l]);
            table[l] = u->table ? u->table + who * u->table_stride : NULL;
        }
        for (ptrdiff_t s = 0; s < grid->spans; ++s) {
            const double h = (grid->knots[s + 1] - grid->knots[s]) / (double)grid->parts[s];
            EACH(l, LANES) { enter(u, grid, &source, l, s, h, row + l < count ? row + l : count - 1); }
            for (ptrdiff_t k = 0; k < grid->parts[s]; ++k, ++at) {
                V low;
                const V middle = middle_of(splat(grid->knots[s]), splat((double)k), splat(h), &low);
                step(u, &source, (int)order, middle, low, splat(h), table, state, &most);
                EACH(l, LANES) { table[l] = u->table ? table[l] + u->nodes * DIM : NULL; }
            }
            if (grid->slot[s] >= 0) {
                for (int l = 0; l < LANES && row + l < count; ++l) {
                    double one[STATE], matrix[FULL], moved[FULL];
                    EACH(k, STATE) { one[k] = state[k][l]; }
                    to_matrix(one, matrix);
                    multiply_one(start[l], matrix, moved);
                    put(moved, X + ((row + l) * slots + grid->slot[s]) * PARTS * SIZE * SIZE);
                }
            }
        }
    }
    return sqrt(largest(most));
}

/* Doubles of the workspace of magnus_tangents, with 8 more for its alignment. */
EXPORT ptrdiff_t magnus_tangents_work(ptrdiff_t tangents);
EXPORT ptrdiff_t magnus_tangents_work(ptrdiff_t tangents)
{
    return LANES * (WORK * tangents + 2 * DIM + 1);
}

/*
 * X at the end of equal steps over one span, from the identity, and dX: (tangents, SIZE, SIZE), its exact derivatives along
 * the tangents of the table: the derivative of what is computed, not an approximation of another. Order 8, lanes over time.
 */
EXPORT void magnus_tangents(const Input *u, double length, ptrdiff_t steps, double *space, double *X, double *dX);
EXPORT void magnus_tangents(const Input *u, double length, ptrdiff_t steps, double *space, double *X, double *dX)
{
    V *work = aligned(space), *eta = work + 2 * DIM, state[STATE];
    Source source;
    Input plain = *u;
    const V h = splat(length / (double)steps);
    ptrdiff_t first[LANES + 1], longest = 0;
    double before[FULL], after[FULL];
    plain.rates = plain.terms = 0;
    lay_out(&plain, work, &source);
    identity(state);
    for (ptrdiff_t k = 0; k < WORK * u->tangents; ++k) {
        eta[k] = splat(0.0);
    }
    for (int l = 0; l <= LANES; ++l) {
        first[l] = steps / LANES * l + (steps % LANES) * l / LANES;
        longest = l && first[l] - first[l - 1] > longest ? first[l] - first[l - 1] : longest;
    }
    for (ptrdiff_t k = 0; k < longest; ++k) {
        const double *table[LANES], *tangent[LANES];
        V a[ORDERS][DIM], da[ORDERS][DIM], omega[WORK], domega[WORK], length_now = h;
        Stages stages;
        EACH(l, LANES) {
            const ptrdiff_t at = first[l] + k < first[l + 1] ? first[l] + k : 0;
            length_now[l] = first[l] + k < first[l + 1] ? h[l] : 0.0; /* a lane that is done waits */
            table[l] = u->table + at * u->nodes * DIM;
            tangent[l] = u->tangent + at * u->nodes * u->tangents * DIM;
        }
        generators(&plain, &source, splat(0.0), splat(0.0), length_now, table, a);
#if !COORDINATES
        V wa[ORDERS][MATRIX], wda[ORDERS][MATRIX];
        EACH(j, ORDERS) { hat(a[j], wa[j]); }
#else
#define wa a
#define wda da
#endif
        exponent8((const V (*)[WORK])wa, &stages, omega);
        for (ptrdiff_t p = 0; p < u->tangents; ++p) {
            EACH(j, ORDERS) {
                EACH(i, DIM) { da[j][i] = splat(0.0); }
            }
            from_nodes(u, tangent, u->tangents * DIM, length_now, da);
#if !COORDINATES
            EACH(j, ORDERS) { hat(da[j], wda[j]); }
#endif
            tangent8((const V (*)[WORK])wa, (const V (*)[WORK])wda, &stages, domega);
            carry(omega, domega, eta + p * WORK);
            EACH(l, LANES) { tangent[l] += DIM; }
        }
        move(omega, state);
    }
    /* d(P X) = dP X + P X hat(eta), lane by lane. */
    memset(dX, 0, (size_t)(u->tangents * PARTS * SIZE * SIZE) * sizeof(double));
    memset(before, 0, sizeof before);
    EACH(i, SIZE) { before[i * SIZE + i] = 1.0; }
    EACH(l, LANES) {
        double one[STATE], matrix[FULL];
        EACH(k, STATE) { one[k] = state[k][l]; }
        to_matrix(one, matrix);
        multiply_one(before, matrix, after);
        for (ptrdiff_t p = 0; p < u->tangents; ++p) {
            double *to = dX + p * PARTS * SIZE * SIZE, old[FULL], moved[FULL], generator[FULL], more[FULL];
            V A[MATRIX];
#if COORDINATES
            hat(eta + p * WORK, A);
#else
            EACH(k, MATRIX) { A[k] = eta[p * WORK + k]; }
#endif
            memset(generator, 0, sizeof generator);
            EACH(q, PARTS) {
                EACH(i, ROWS * SIZE) { generator[q * SIZE * SIZE + i] = A[q * ROWS * SIZE + i][l]; }
            }
            get(to, old);
            multiply_one(old, matrix, moved);
            multiply_one(after, generator, more);
            EACH(k, FULL) { moved[k] += more[k]; }
            put(moved, to);
        }
        memcpy(before, after, sizeof before);
    }
    put(before, X);
}
