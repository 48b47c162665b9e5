/*
 * X' = X hat(u(t)) by Magnus steps of order 4, 6 or 8, as many at once as magnus_lanes.h has lanes.
 *
 * The equation is linear in X, so steps do not wait for each other. One trajectory is cut into as many runs of steps, a lane
 * each, every run from the identity; their products are multiplied at the end. Many trajectories go side by side,
 * a lane each. A step is X <- X + X (exp(Omega) - 1): the increment is added, since 1 + (cos - 1) would be rounded the
 * same way in every step. Memory does not grow with the number of steps; everything is given, nothing is kept.
 *
 * magnus_group.h, made for the group, says: DIM (of the algebra), SIZE (of the matrices), PARTS (2 where they are complex),
 * ROWS (all basis matrices vanish below), SKEW (they are skew-Hermitian), COORDINATES (brackets from structure
 * constants, else as matrices), QUATERNION; and hat(), lie_bracket(), quaternion_matrix().
 */
#define HALVES 1 /* of skew-Hermitian matrices what lies above the diagonal is enough here */
#include "magnus_words.h"

#include "magnus_step.h"

/* The middle of step `inside` of a span, to twice the precision. */
static inline V middle_of(V knot, V inside, V h, V *low)
{
    const V count = inside + 0.5, offset = count * h, rest = fused(count, h, -offset);
    const V sum = knot + offset, v = sum - knot;
    *low = ((knot - (sum - v)) + (offset - v)) + rest;
    return sum;
}

/* Doubles that the workspace needs, its alignment included. */
EXPORT ptrdiff_t magnus_work(ptrdiff_t rates, ptrdiff_t terms, ptrdiff_t slots);
EXPORT ptrdiff_t magnus_work(ptrdiff_t rates, ptrdiff_t terms, ptrdiff_t slots)
{
    return LANES * (source_vectors(rates, terms) + 1) + slots * (STATE + 1);
}

/*
 * One trajectory, steps from .. to - 1, from X0: lanes over time. X: (slots, SIZE, SIZE), `end` (SIZE, SIZE) the last state.
 */
EXPORT void magnus_one(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t from, ptrdiff_t to, const double *X0, ptrdiff_t slots,
    double *space, double *X, double *end);
EXPORT void magnus_one(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t from, ptrdiff_t to, const double *X0, ptrdiff_t slots,
    double *space, double *X, double *end)
{
    V *work = aligned(space);
    Source source;
    lay_out(u, work, &source);
    double *kept = space + LANES * (source_vectors(u->rates, u->terms) + 1), *lane_of = kept + slots * STATE;
    ptrdiff_t span[LANES], inside[LANES], left[LANES], at[LANES];
    V state[STATE], knot = splat(0.0), h = splat(0.0), place = splat(0.0);
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
    find_driven(u, &source);
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
            step(u, &source, (int)order, middle, low, h, table, state);
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
}

/*
 * `count` trajectories, all steps, a lane each; X0: (count, SIZE, SIZE), or one of all where X0_stride is 0.
 * X: (count, slots, SIZE, SIZE).
 */
EXPORT void magnus_many(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t count, const double *X0, ptrdiff_t X0_stride,
    ptrdiff_t slots, double *space, double *X);
EXPORT void magnus_many(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t count, const double *X0, ptrdiff_t X0_stride,
    ptrdiff_t slots, double *space, double *X)
{
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
        find_driven(u, &source);
        for (ptrdiff_t s = 0; s < grid->spans; ++s) {
            const double h = (grid->knots[s + 1] - grid->knots[s]) / (double)grid->parts[s];
            EACH(l, LANES) { enter(u, grid, &source, l, s, h, row + l < count ? row + l : count - 1); }
            for (ptrdiff_t k = 0; k < grid->parts[s]; ++k, ++at) {
                V low;
                const V middle = middle_of(splat(grid->knots[s]), splat((double)k), splat(h), &low);
                step(u, &source, (int)order, middle, low, splat(h), table, state);
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
}

#include "magnus_solve.h"
