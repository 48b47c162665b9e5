/* Eight doubles at once, whatever the processor has: the compiler makes two or four of it where its vectors are shorter. */
#ifndef MAGNUS_LANES_H
#define MAGNUS_LANES_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

enum { LANES = 8, ORDERS = 4, MOST_NODES = 12 };

typedef double V __attribute__((vector_size(8 * LANES)));
typedef long long I __attribute__((vector_size(8 * LANES)));

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

#endif
