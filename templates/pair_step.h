/*
 * One step of the explicit pair of order 8(5, 3) of Dormand and Prince: what ode.c (vectors) and pair853.c (groups) share.
 * The coefficients stand in ode_table.h, which is written from runtime/dop853.py.
 */
#ifndef LIE_CODEGEN_PAIR_STEP_H
#define LIE_CODEGEN_PAIR_STEP_H

#include <math.h>
#include <stddef.h>

#include "ode_table.h" /* A, B, C, E3, E5 of twelve stages */

/* y' = slope(t, y); not 0 where it cannot be had. */
typedef int (*Slope)(const void *who, double t, const double *y, double *slope);

/*
 * The slopes k_2 .. k_12 of a step of length h from (t, y), k_1 being known, and the state after it: n doubles each. Entry by entry a
 * sum over the stages in their order, so that the bits do not depend on who calls; `stage` may be `after`. Zero weights, half of
 * them, are passed over.
 */
static int pair_step(Slope slope, const void *who, ptrdiff_t n, double t, const double *y, double h, double *k, double *stage, double *after)
{
    ptrdiff_t i;
    int s, j;
    for (s = 1; s <= STAGES; ++s) {
        const double *a = s < STAGES ? A[s] : B;
        double *to = s < STAGES ? stage : after;
        for (i = 0; i < n; ++i) {
            to[i] = 0.0;
        }
        for (j = 0; j < s; ++j) {
            if (a[j] != 0.0) {
                const double w = a[j], *from = k + j * n;
                for (i = 0; i < n; ++i) {
                    to[i] += w * from[i];
                }
            }
        }
        for (i = 0; i < n; ++i) {
            to[i] = y[i] + h * to[i];
        }
        if (s < STAGES && slope(who, t + C[s] * h, stage, k + s * n)) {
            return 1;
        }
    }
    return 0;
}

/* Entry `at` of n: the squares of its two error estimates in units of its scale are added. */
static void pair_error_add(const double *k, ptrdiff_t n, ptrdiff_t at, double scale, double *five, double *three)
{
    double e5 = 0.0, e3 = 0.0;
    int s;
    for (s = 0; s < STAGES; ++s) {
        e5 += E5[s] * k[s * n + at];
        e3 += E3[s] * k[s * n + at];
    }
    *five += e5 * e5 / (scale * scale);
    *three += e3 * e3 / (scale * scale);
}

/*
 * The error of a step over what is allowed, from those sums over n entries: that of order 5, damped by that of order 3 (Hairer,
 * Norsett and Wanner, II.10). 0 where both vanish, NaN where a slope is. With e5 of order h^5 and e3 of order h^3 the quotient
 * h e5^2 / e3 is of order h^8, as the error of the step itself: so the next length goes by its eighth root. Where e3 happens to
 * vanish e5 alone remains, which is larger, and safe.
 */
static double pair_error(double five, double three, double h, ptrdiff_t n)
{
    const double down = five + 0.01 * three;
    return down > 0.0 ? fabs(h) * five / sqrt(down * (double)n) : down;
}

#endif
