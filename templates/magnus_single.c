/*
 * magnus_many of magnus.c on lanes of floats, for screening: u and time in doubles, steps and X in floats. Its headers are those of
 * magnus.c written in floats, except what Python gives.
 */
#define SINGLE 1
#define HALVES 1
#define SIDE_BY_SIDE 1
#include "magnus_words.h"

#include "magnus_step.h"

/* Floats that the workspace needs, its alignment included. */
EXPORT ptrdiff_t magnus_single_work(ptrdiff_t rates, ptrdiff_t terms);
EXPORT ptrdiff_t magnus_single_work(ptrdiff_t rates, ptrdiff_t terms)
{
    return FRONT * source_vectors(rates, terms) + LANES;
}

/* As magnus_many; X0 and X in floats. Time is known to twice their precision. */
EXPORT void magnus_many_single(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t count, const float *X0, ptrdiff_t X0_stride,
    ptrdiff_t slots, float *space, float *X);
EXPORT void magnus_many_single(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t count, const float *X0, ptrdiff_t X0_stride,
    ptrdiff_t slots, float *space, float *X)
{
    Team team[TOGETHER];
    gather(u, space, team);
    for (ptrdiff_t row = 0; row < count; row += FRONT) {
        float start[FRONT][FULL];
        EACH(part, TOGETHER) { identity(team[part].state); }
        EACH(l, FRONT) {
            const ptrdiff_t who = row + l < count ? row + l : count - 1; /* spare lanes repeat the last */
            set_waves(u, &team[l / LANES].source, l % LANES, who);
            get(X0 + who * X0_stride, start[l]);
        }
        EACH(part, TOGETHER) { find_driven(u, &team[part].source); }
        for (ptrdiff_t s = 0; s < grid->spans; ++s) {
            const double h = (grid->knots[s + 1] - grid->knots[s]) / (double)grid->parts[s];
            EACH(l, FRONT) { enter(u, grid, &team[l / LANES].source, l % LANES, s, (float)h, row + l < count ? row + l : count - 1); }
            double carry = 0.0; /* a length rounded alike in every step would add up */
            for (ptrdiff_t k = 0; k < grid->parts[s]; ++k) {
                const double t = grid->knots[s] + ((double)k + 0.5) * h;
                const float middle = (float)t, length = (float)(h + carry);
                carry += h - length;
                EACH(part, TOGETHER) {
                    team[part].middle = splat(middle);
                    team[part].low = splat((float)(t - middle));
                    team[part].h = splat(length);
                }
                step(u, team, (int)order);
            }
            if (grid->slot[s] >= 0) {
                for (int l = 0; l < FRONT && row + l < count; ++l) {
                    float matrix[FULL], moved[FULL];
                    state_of(team, l, matrix);
                    multiply_one(start[l], matrix, moved);
                    put(moved, X + ((row + l) * slots + grid->slot[s]) * PARTS * SIZE * SIZE);
                }
            }
        }
    }
}
