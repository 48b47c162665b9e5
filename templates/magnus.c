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
#define SIDE_BY_SIDE 1
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
    return FRONT * source_vectors(rates, terms) + LANES + slots * (STATE + 1);
}

/*
 * One trajectory, steps from .. to - 1, from X0: lanes over time. X: (slots, SIZE, SIZE), `end` (SIZE, SIZE) the last state.
 */
EXPORT void magnus_one(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t from, ptrdiff_t to, const double *X0, ptrdiff_t slots,
    double *space, double *X, double *end);
EXPORT void magnus_one(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t from, ptrdiff_t to, const double *X0, ptrdiff_t slots,
    double *space, double *X, double *end)
{
    Team team[TOGETHER];
    double *kept = space + FRONT * source_vectors(u->rates, u->terms) + LANES, *lane_of = kept + slots * STATE;
    ptrdiff_t span[FRONT], inside[FRONT], left[FRONT], at[FRONT];
    V knot[TOGETHER], place[TOGETHER]; /* where a span begins, how many of its steps are done */
    double prefix[FRONT + 1][FULL];
    gather(u, space, team);
    EACH(part, TOGETHER) { knot[part] = place[part] = team[part].h = splat(0.0); }
    for (ptrdiff_t k = 0; k < slots; ++k) {
        lane_of[k] = -1.0;
    }
    EACH(l, FRONT) {
        Team *const mine = team + l / LANES;
        const int lane = l % LANES;
        const ptrdiff_t first = from + (to - from) / FRONT * l + ((to - from) % FRONT) * l / FRONT;
        const ptrdiff_t last = from + (to - from) / FRONT * (l + 1) + ((to - from) % FRONT) * (l + 1) / FRONT;
        ptrdiff_t low = 0, high = grid->spans;
        set_waves(u, &mine->source, lane, 0);
        left[l] = last - first;
        at[l] = left[l] ? first : 0;
        while (high - low > 1) { /* the span in which the first step lies */
            const ptrdiff_t half = (low + high) / 2;
            if (grid->first[half] <= first) { low = half; } else { high = half; }
        }
        span[l] = low;
        inside[l] = first - grid->first[low];
        if (left[l]) {
            knot[l / LANES][lane] = grid->knots[low];
            mine->h[lane] = (grid->knots[low + 1] - grid->knots[low]) / (double)grid->parts[low];
            place[l / LANES][lane] = (double)inside[l];
            enter(u, grid, &mine->source, lane, low, mine->h[lane], 0);
        }
    }
    EACH(part, TOGETHER) { find_driven(u, &team[part].source); }
    for (;;) {
        ptrdiff_t count = 0;
        EACH(l, FRONT) {
            if (left[l]) {
                const ptrdiff_t rest = grid->parts[span[l]] - inside[l], mine = rest < left[l] ? rest : left[l];
                count = count == 0 || mine < count ? mine : count;
            }
        }
        if (count == 0) {
            break;
        }
        for (ptrdiff_t k = 0; k < count; ++k) {
            EACH(part, TOGETHER) {
                team[part].middle = middle_of(knot[part], place[part], team[part].h, &team[part].low);
                place[part] += 1.0;
            }
            if (u->table) {
                EACH(l, FRONT) { team[l / LANES].table[l % LANES] = u->table + (left[l] ? at[l] + k : 0) * u->nodes * DIM; }
            }
            step(u, team, (int)order);
        }
        EACH(l, FRONT) {
            Team *const mine = team + l / LANES;
            const int lane = l % LANES;
            if (!left[l]) {
                continue;
            }
            inside[l] += count;
            left[l] -= count;
            at[l] += count;
            if (inside[l] == grid->parts[span[l]]) {
                const ptrdiff_t slot = grid->slot[span[l]];
                if (slot >= 0) {
                    EACH(k, STATE) { kept[slot * STATE + k] = mine->state[k][lane]; }
                    lane_of[slot] = l;
                }
                inside[l] = 0;
                place[l / LANES][lane] = 0.0;
                ++span[l];
                if (left[l]) {
                    knot[l / LANES][lane] = grid->knots[span[l]];
                    mine->h[lane] = (grid->knots[span[l] + 1] - grid->knots[span[l]]) / (double)grid->parts[span[l]];
                    enter(u, grid, &mine->source, lane, span[l], mine->h[lane], 0);
                }
            }
            if (!left[l]) {
                mine->h[lane] = 0.0; /* waits, at the identity of a step */
            }
        }
    }
    get(X0, prefix[0]);
    double matrices[FRONT][FULL];
    EACH(l, FRONT) { state_of(team, l, matrices[l]); }
    EACH(l, FRONT) { multiply_one(prefix[l], matrices[l], prefix[l + 1]); }
    put(prefix[FRONT], end);
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
    Team team[TOGETHER];
    gather(u, space, team);
    for (ptrdiff_t row = 0; row < count; row += FRONT) {
        double start[FRONT][FULL];
        EACH(part, TOGETHER) { identity(team[part].state); }
        EACH(l, FRONT) {
            const ptrdiff_t who = row + l < count ? row + l : count - 1; /* spare lanes repeat the last */
            set_waves(u, &team[l / LANES].source, l % LANES, who);
            get(X0 + who * X0_stride, start[l]);
            team[l / LANES].table[l % LANES] = u->table ? u->table + who * u->table_stride : NULL;
        }
        EACH(part, TOGETHER) { find_driven(u, &team[part].source); }
        for (ptrdiff_t s = 0; s < grid->spans; ++s) {
            const double h = (grid->knots[s + 1] - grid->knots[s]) / (double)grid->parts[s];
            EACH(l, FRONT) { enter(u, grid, &team[l / LANES].source, l % LANES, s, h, row + l < count ? row + l : count - 1); }
            EACH(part, TOGETHER) { team[part].h = splat(h); }
            for (ptrdiff_t k = 0; k < grid->parts[s]; ++k) {
                V low;
                const V middle = middle_of(splat(grid->knots[s]), splat((double)k), splat(h), &low);
                EACH(part, TOGETHER) {
                    team[part].middle = middle;
                    team[part].low = low;
                }
                step(u, team, (int)order);
                if (u->table) {
                    EACH(l, FRONT) { team[l / LANES].table[l % LANES] += u->nodes * DIM; }
                }
            }
            if (grid->slot[s] >= 0) {
                for (int l = 0; l < FRONT && row + l < count; ++l) {
                    double matrix[FULL], moved[FULL];
                    state_of(team, l, matrix);
                    multiply_one(start[l], matrix, moved);
                    put(moved, X + ((row + l) * slots + grid->slot[s]) * PARTS * SIZE * SIZE);
                }
            }
        }
    }
}

#include "magnus_solve.h"
