/*
 * One step of the explicit pair of order 8(5, 3) of Dormand and Prince: what ode.c (vectors) and pair853.c (groups) share.
 * The coefficients stand in ode_table.h, which is written from runtime/dop853.py.
 */
#ifndef LIE_CODEGEN_PAIR_STEP_H
#define LIE_CODEGEN_PAIR_STEP_H

#include <math.h>
#include <stddef.h>

#include "ode_table.h" /* A, B, C, E3, E5 of twelve stages; USED, USES: which entries of A and B are not 0, and how many */

/* y' = slope(t, y); not 0 where it cannot be had. */
typedef int (*Slope)(const void *who, double t, const double *y, double *slope);

/* As many doubles as the processor adds at once, anywhere in an array of them: of loops over arrays gcc 12 makes scalar sums. */
#if !defined(__GNUC__)
typedef double PairVector;
#elif defined(__AVX512F__)
typedef double PairVector __attribute__((vector_size(64), aligned(8), may_alias));
#elif defined(__AVX__)
typedef double PairVector __attribute__((vector_size(32), aligned(8), may_alias));
#else
typedef double PairVector __attribute__((vector_size(16), aligned(8), may_alias));
#endif

/*
 * WIDTH entries of y + h sum_j a_j k_j, kept in registers: a sum over the stages in their order, so that the bits depend
 * neither on who calls nor on the width. `used` are the j with a_j other than 0, half of all.
 */
#define PAIR_SUM(WIDTH, TYPE)                                                                       \
    static inline void pair_sum_##WIDTH(const double *a, const unsigned char *used, int count, ptrdiff_t n, const double *k, const double *y, double h, double *to) \
    {                                                                                               \
        enum { PARTS = WIDTH * sizeof(double) / sizeof(TYPE) };                                     \
        TYPE sum[PARTS];                                                                            \
        int u, l;                                                                                   \
        for (l = 0; l < PARTS; ++l) {                                                               \
            sum[l] = (TYPE){0.0};                                                                   \
        }                                                                                           \
        for (u = 0; u < count; ++u) {                                                               \
            const double weight = a[used[u]];                                                       \
            const TYPE *from = (const TYPE *)(k + used[u] * n);                                     \
            for (l = 0; l < PARTS; ++l) {                                                           \
                sum[l] += weight * from[l];                                                         \
            }                                                                                       \
        }                                                                                           \
        for (l = 0; l < PARTS; ++l) {                                                               \
            ((TYPE *)to)[l] = ((const TYPE *)y)[l] + h * sum[l];                                    \
        }                                                                                           \
    }
PAIR_SUM(1, double)
PAIR_SUM(2, double)
PAIR_SUM(4, double)
PAIR_SUM(8, PairVector)
PAIR_SUM(16, PairVector)

/* gcc makes vectors of a loop in a function of its own; within other loops it unrolls it first, and a long one it copies to all who call it. */
#if defined(__GNUC__)
#define APART __attribute__((noinline))
#else
#define APART
#endif

/* The state at which stage s of a step of length h from y asks for its slope, or behind the last one the state after the step: n doubles. */
static APART void pair_stage(int s, ptrdiff_t n, const double *y, double h, const double *k, double *to)
{
    const double *a = s < STAGES ? A[s] : B;
    const unsigned char *used = USED[s];
    const int count = USES[s];
    ptrdiff_t i = 0;
    for (; i + 16 <= n; i += 16) {
        pair_sum_16(a, used, count, n, k + i, y + i, h, to + i);
    }
    for (; i + 8 <= n; i += 8) {
        pair_sum_8(a, used, count, n, k + i, y + i, h, to + i);
    }
    if (i + 4 <= n) {
        pair_sum_4(a, used, count, n, k + i, y + i, h, to + i);
        i += 4;
    }
    if (i + 2 <= n) {
        pair_sum_2(a, used, count, n, k + i, y + i, h, to + i);
        i += 2;
    }
    if (i < n) {
        pair_sum_1(a, used, count, n, k + i, y + i, h, to + i);
    }
}

/*
 * The slopes k_2 .. k_12 of a step of length h from (t, y), k_1 being known, and the state after it: n doubles each. `stage` may be
 * `after`.
 */
static int pair_step(Slope slope, const void *who, ptrdiff_t n, double t, const double *y, double h, double *k, double *stage, double *after)
{
    int s;
    for (s = 1; s < STAGES; ++s) {
        pair_stage(s, n, y, h, k, stage);
        if (slope(who, t + C[s] * h, stage, k + s * n)) {
            return 1;
        }
    }
    pair_stage(STAGES, n, y, h, k, after);
    return 0;
}

/* The two error estimates of WIDTH entries of n, stage after stage. */
#define PAIR_ERRORS(WIDTH, TYPE)                                                                    \
    static inline void pair_errors_##WIDTH(const double *k, ptrdiff_t n, double *five, double *three) \
    {                                                                                               \
        enum { PARTS = WIDTH * sizeof(double) / sizeof(TYPE) };                                     \
        TYPE e5[PARTS], e3[PARTS];                                                                  \
        int u, l;                                                                                   \
        for (l = 0; l < PARTS; ++l) {                                                               \
            e5[l] = e3[l] = (TYPE){0.0};                                                            \
        }                                                                                           \
        for (u = 0; u < USES[STAGES]; ++u) { /* the others have weight 0 */                         \
            const int s = USED[STAGES][u];                                                          \
            const TYPE *from = (const TYPE *)(k + s * n);                                           \
            for (l = 0; l < PARTS; ++l) {                                                           \
                e5[l] += E5[s] * from[l];                                                           \
                e3[l] += E3[s] * from[l];                                                           \
            }                                                                                       \
        }                                                                                           \
        for (l = 0; l < PARTS; ++l) {                                                               \
            ((TYPE *)five)[l] = e5[l];                                                              \
            ((TYPE *)three)[l] = e3[l];                                                             \
        }                                                                                           \
    }
PAIR_ERRORS(1, double)
PAIR_ERRORS(2, double)
PAIR_ERRORS(8, PairVector)

/* The two error estimates of all n entries. */
static APART void pair_errors(const double *k, ptrdiff_t n, double *five, double *three)
{
    ptrdiff_t i = 0;
    for (; i + 8 <= n; i += 8) {
        pair_errors_8(k + i, n, five + i, three + i);
    }
    for (; i + 2 <= n; i += 2) {
        pair_errors_2(k + i, n, five + i, three + i);
    }
    if (i < n) {
        pair_errors_1(k + i, n, five + i, three + i);
    }
}

/*
 * The error of a step over what is allowed, from those sums over n entries: that of order 5, damped by that of order 3 (Hairer,
 * Norsett and Wanner, II.10). 0 where both vanish, NaN where a slope is. With e5 of order h^5 and e3 of order h^3 the quotient
 * h e5^2 / e3 is of order h^8, as the error of the step itself: so the next length goes by its eighth root. Where e3 happens to
 * vanish e5 alone remains, which is larger, and safe.
 */
static double pair_error(double five, double three, double h, ptrdiff_t n)
{
    const double down = five + 0.01 * three, safe = down > 0.0 ? down : 1.0;
    const double error = fabs(h) * five / sqrt(safe * (double)n); /* computed in any case: so lanes need no branches */
    return down > 0.0 ? error : down;
}

#endif
