/* Sixteen floats at once, in the place of magnus_lanes.h; u and time are given in doubles. */
#ifndef MAGNUS_LANES_H
#define MAGNUS_LANES_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

/* Angles are taken afresh often: every turn rounds them by 1e-7. */
enum { LANES = 16, ORDERS = 4, AFRESH = 8 };
#define TABLES 0

typedef float V __attribute__((vector_size(4 * LANES)));
typedef int I __attribute__((vector_size(4 * LANES)));

/* Degrees of the series of exp in magnus_move.h: what they leave out is some 1e-8 for each unit of |Omega|. */
#define POWERS(size) ((size) <= 0.13f ? 1 : (size) <= 0.71f ? 2 : 3)
#define DEGREE(size) ((size) <= 0.24f ? 6 : (size) <= 0.71f ? 9 : 12)

#define EACH(k, n) for (int k = 0; k < (n); ++k)

static inline V splat(float x)
{
    const V v = {x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x};
    return v;
}

static float largest(V x)
{
    float most = x[0];
    for (int l = 1; l < LANES; ++l) {
        most = x[l] > most || x[l] != x[l] ? x[l] : most; /* a NaN shows */
    }
    return most;
}

/* a b + c, rounded once. */
static inline V fused(V a, V b, V c)
{
    V r;
    EACH(l, LANES) { r[l] = __builtin_fmaf(a[l], b[l], c[l]); }
    return r;
}

/* cos and sin of p + e, e small: p less the nearest multiple of pi/2, in three pieces, then Taylor to 1e-9. */
static inline void cos_sin(V p, V e, V *c, V *s)
{
    const float magic = 12582912.0f;
    const V n = (p * 0.63661977f + magic) - magic;
    const I k = (I)(n + magic);
    const V r = (fused(-n, splat(7.549789415861596e-8f), fused(-n, splat(1.570796251296997f), p)) - n * 5.390302529957765e-15f) + e;
    const V z = r * r;
    const V sine = r + r * z * (-1.0f / 6 + z * (1.0f / 120 + z * (-1.0f / 5040 + z * (1.0f / 362880))));
    const V cosine = 1.0f + z * (-0.5f + z * (1.0f / 24 + z * (-1.0f / 720 + z * (1.0f / 40320 + z * (-1.0f / 3628800)))));
    const I odd = -(k & 1), minus_sine = (k & 2) << 30, minus_cosine = ((k + 1) & 2) << 30;
    *s = (V)(((odd & (I)cosine) | (~odd & (I)sine)) ^ minus_sine);
    *c = (V)(((odd & (I)sine) | (~odd & (I)cosine)) ^ minus_cosine);
}

#endif
