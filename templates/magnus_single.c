/*
 * magnus_many of magnus.c on lanes of floats, for screening: u and time in doubles, steps and X in floats. Its headers are those of
 * magnus.c written in floats, except what Python gives.
 */
#define SINGLE 1
#define HALVES 1
#include "magnus_words.h"

#include "magnus_step.h"

/* Floats that the workspace needs, its alignment included. */
EXPORT ptrdiff_t magnus_single_work(ptrdiff_t rates, ptrdiff_t terms);
EXPORT ptrdiff_t magnus_single_work(ptrdiff_t rates, ptrdiff_t terms)
{
    return LANES * (source_vectors(rates, terms) + 1);
}

/* As magnus_many; X0 and X in floats. Time is known to twice their precision. */
EXPORT void magnus_many_single(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t count, const float *X0, ptrdiff_t X0_stride,
    ptrdiff_t slots, float *space, float *X);
EXPORT void magnus_many_single(const Input *u, const Grid *grid, ptrdiff_t order, ptrdiff_t count, const float *X0, ptrdiff_t X0_stride,
    ptrdiff_t slots, float *space, float *X)
{
    Source source;
    lay_out(u, aligned(space), &source);
    for (ptrdiff_t row = 0; row < count; row += LANES) {
        float start[LANES][FULL];
        V state[STATE];
        identity(state);
        EACH(l, LANES) {
            const ptrdiff_t who = row + l < count ? row + l : count - 1; /* spare lanes repeat the last */
            set_waves(u, &source, l, who);
            get(X0 + who * X0_stride, start[l]);
        }
        find_driven(u, &source);
        for (ptrdiff_t s = 0; s < grid->spans; ++s) {
            const double h = (grid->knots[s + 1] - grid->knots[s]) / (double)grid->parts[s];
            EACH(l, LANES) { enter(u, grid, &source, l, s, (float)h, row + l < count ? row + l : count - 1); }
            double carry = 0.0; /* a length rounded alike in every step would add up */
            for (ptrdiff_t k = 0; k < grid->parts[s]; ++k) {
                const double t = grid->knots[s] + ((double)k + 0.5) * h;
                const float middle = (float)t, length = (float)(h + carry);
                carry += h - length;
                step(u, &source, (int)order, splat(middle), splat((float)(t - middle)), splat(length), NULL, state);
            }
            if (grid->slot[s] >= 0) {
                for (int l = 0; l < LANES && row + l < count; ++l) {
                    float one[STATE], matrix[FULL], moved[FULL];
                    EACH(k, STATE) { one[k] = state[k][l]; }
                    to_matrix(one, matrix);
                    multiply_one(start[l], matrix, moved);
                    put(moved, X + ((row + l) * slots + grid->slot[s]) * PARTS * SIZE * SIZE);
                }
            }
        }
    }
}
