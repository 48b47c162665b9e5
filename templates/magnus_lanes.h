/* Eight doubles at once, whatever the processor has: the compiler makes two or four of it where its vectors are shorter. */
#ifndef MAGNUS_LANES_H
#define MAGNUS_LANES_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

enum { LANES = 8, ORDERS = 4, MOST_NODES = 12, AFRESH = 64 };
#define TABLES 1

typedef double V __attribute__((vector_size(8 * LANES)));
typedef long long I __attribute__((vector_size(8 * LANES)));

/* Degrees of the series of exp in magnus_move.h: what they leave out is some 1e-17 for each unit of |Omega|. */
#define POWERS(size) ((size) <= 0.0044 ? 1 : (size) <= 0.09 ? 2 : (size) <= 0.36 ? 3 : (size) <= 0.85 ? 4 : 5)
#define DEGREE(size) ((size) <= 0.006 ? 6 : (size) <= 0.07 ? 9 : (size) <= 0.24 ? 12 : (size) <= 0.56 ? 15 : 18)

#define EACH(k, n) for (int k = 0; k < (n); ++k)

static inline V splat(double x)
{
    const V v = {x, x, x, x, x, x, x, x};
    return v;
}

static double largest(V x)
{
    double most = x[0];
    for (int l = 1; l < LANES; ++l) {
        most = x[l] > most || x[l] != x[l] ? x[l] : most; /* a NaN shows */
    }
    return most;
}

/* a b + c, rounded once. */
static inline V fused(V a, V b, V c)
{
    V r;
    EACH(l, LANES) { r[l] = __builtin_fma(a[l], b[l], c[l]); }
    return r;
}

/* cos and sin of p + e, e small: p less the nearest multiple of pi/2, in three pieces, then Taylor to 1e-18. */
static inline void cos_sin(V p, V e, V *c, V *s)
{
    const double magic = 6755399441055744.0;
    const V n = (p * 0.6366197723675814 + magic) - magic;
    const I k = (I)(n + magic);
    const V r = (fused(-n, splat(6.123233995736766e-17), fused(-n, splat(1.5707963267948966), p))
        - n * -1.4973849048591833e-33) + e;
    const V z = r * r;
    const V sine = r + r * z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800
        + z * (1.0 / 6227020800.0 + z * (-1.0 / 1307674368000.0 + z * (1.0 / 355687428096000.0))))))));
    const V cosine = 1.0 + z * (-0.5 + z * (1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800
        + z * (1.0 / 479001600 + z * (-1.0 / 87178291200.0 + z * (1.0 / 20922789888000.0))))))));
    const I odd = -(k & 1), minus_sine = (k & 2) << 62, minus_cosine = ((k + 1) & 2) << 62;
    *s = (V)(((odd & (I)cosine) | (~odd & (I)sine)) ^ minus_sine);
    *c = (V)(((odd & (I)sine) | (~odd & (I)cosine)) ^ minus_cosine);
}

#endif
