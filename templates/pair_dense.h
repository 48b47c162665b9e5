/*
 * The solution within one step of the pair 8(5, 3) as a polynomial of order 7 (Hairer, Norsett and Wanner, II.6): three slopes more, and
 * any number of times from them. The coefficients stand in ode_dense.h, which is written from runtime/dop853.py.
 */
#ifndef LIE_CODEGEN_PAIR_DENSE_H
#define LIE_CODEGEN_PAIR_DENSE_H

#include "ode_dense.h" /* DENSE_A, DENSE_C, DENSE_D */
#include "pair_step.h"

enum { DENSE_TERMS = 7 };

/* F, n doubles a term, of a step of length h from (t, y) to `after`; k holds its STAGES slopes and room for DENSE_STAGES. */
static int pair_dense(Slope slope, const void *who, ptrdiff_t n, double t, const double *y, double h, const double *after, double *k, double *stage, double *F)
{
    double *end = k + STAGES * n;
    ptrdiff_t i;
    int s, j;
    if (slope(who, t + h, after, end)) {
        return 1;
    }
    for (s = 0; s < DENSE_STAGES - STAGES - 1; ++s) {
        for (i = 0; i < n; ++i) {
            double sum = 0.0;
            for (j = 0; j <= STAGES + s; ++j) {
                sum += DENSE_A[s][j] * k[j * n + i];
            }
            stage[i] = y[i] + h * sum;
        }
        if (slope(who, t + DENSE_C[s] * h, stage, end + (s + 1) * n)) {
            return 1;
        }
    }
    /*
     * In the form of pair_dense_at the slope at x = 0 is F_0 + F_1 and that at x = 1 is F_0 - F_1 - F_2: the first three terms are the
     * cubic with the values and slopes of both ends. Every further term has the factor x^2 (1 - x)^2 and leaves these as they are,
     * so that neighbouring steps fit together with their slopes, whatever the weights.
     */
    for (i = 0; i < n; ++i) {
        const double change = after[i] - y[i];
        F[i] = change;
        F[n + i] = h * k[i] - change;
        F[2 * n + i] = 2.0 * change - h * (k[i] + end[i]);
        for (s = 0; s < DENSE_TERMS - 3; ++s) {
            double sum = 0.0;
            for (j = 0; j < DENSE_STAGES; ++j) {
                sum += DENSE_D[s][j] * k[j * n + i];
            }
            F[(3 + s) * n + i] = h * sum;
        }
    }
    return 0;
}

/* y + x (F_0 + (1 - x) (F_1 + x (F_2 + ...))) at the part x of the step. */
static void pair_dense_at(ptrdiff_t n, const double *y, const double *F, double x, double *found)
{
    ptrdiff_t i;
    int s;
    for (i = 0; i < n; ++i) {
        double sum = 0.0;
        for (s = DENSE_TERMS - 1; s >= 0; --s) {
            sum = (sum + F[s * n + i]) * (s % 2 == 0 ? x : 1.0 - x);
        }
        found[i] = y[i] + sum;
    }
}

#endif
