/* Vectors of doubles, a start in each, matrices of them, and exp: of direct_core.c. */
#ifndef DIRECT_LANES_H
#define DIRECT_LANES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "direct_sizes.h"
#include "lane_vectors.h"

enum {
    GROUP = 8,              /* starts that go on together, and decide together when to stop: no answer depends on LANES */
    PACKS = GROUP / LANES,  /* vectors of a group */
    ENTRIES = D * D * PARTS /* doubles of a matrix, complex ones as pairs */
};

static V spread(double value)
{
    const V zero = {0.0};
    return zero + value;
}

static V largest(V a, V b)
{
    return SELECT(LESS(a, b), b, a);
}

static V least(V a, V b)
{
    return SELECT(LESS(b, a), b, a);
}

static int any(Mask mask)
{
    int l, found = 0;
    for (l = 0; l < LANES; ++l) {
        found |= LANE(mask, l) != 0;
    }
    return found;
}

static V root(V a)
{
    int l;
    for (l = 0; l < LANES; ++l) {
        LANE(a, l) = sqrt(LANE(a, l));
    }
    return a;
}

/* c = a b, or c += a b; row by row, so that the sums of a row stay in registers. c may be a, not b. */
static void multiply(const V *a, const V *b, int add, V *c)
{
    int i, j, k;
    for (i = 0; i < D; ++i) {
        V sum[D * PARTS];
        for (j = 0; j < D * PARTS; ++j) {
            sum[j] = add ? c[i * D * PARTS + j] : spread(0.0);
        }
        for (k = 0; k < D; ++k) {
            const V *row = b + k * D * PARTS;
            const V x = a[(i * D + k) * PARTS];
#if PARTS == 2
            const V y = a[(i * D + k) * PARTS + 1];
#pragma GCC unroll 8
            for (j = 0; j < D; ++j) {
                sum[2 * j] += x * row[2 * j];
                sum[2 * j + 1] += x * row[2 * j + 1];
                sum[2 * j] -= y * row[2 * j + 1];
                sum[2 * j + 1] += y * row[2 * j];
            }
#else
#pragma GCC unroll 8
            for (j = 0; j < D; ++j) {
                sum[j] += x * row[j];
            }
#endif
        }
        memcpy(c + i * D * PARTS, sum, sizeof sum);
    }
}

/* c = a b for a matrix b of plain doubles, given by those of its entries that are not zero. */
static void multiply_given(const V *a, const int *entry, const double *value, int count, V *c)
{
    int n, x;
    memset(c, 0, ENTRIES * sizeof *c);
    for (n = 0; n < count; ++n) {
        const int k = entry[n] / (D * PARTS), y = entry[n] % (D * PARTS) / PARTS;
        const double b = value[n];
        for (x = 0; x < D; ++x) {
            const V *from = a + (x * D + k) * PARTS;
            V *to = c + (x * D + y) * PARTS;
#if PARTS == 2
            if (entry[n] % 2) {
                to[0] -= b * from[1];
                to[1] += b * from[0];
                continue;
            }
            to[1] += b * from[1];
#endif
            to[0] += b * from[0];
        }
    }
}

/* c = a^H */
static void adjoint(const V *a, V *c)
{
    int x, y;
    for (x = 0; x < D; ++x) {
        for (y = 0; y < D; ++y) {
            c[(y * D + x) * PARTS] = a[(x * D + y) * PARTS];
#if PARTS == 2
            c[(y * D + x) * PARTS + 1] = -a[(x * D + y) * PARTS + 1];
#endif
        }
    }
}

/* Blocks of four terms after the first four that make Taylor's series of exp exact to rounding for matrices of that norm. */
static int blocks(double size)
{
    return size < 0.054 ? 1 : size < 0.28 ? 2 : size < 0.7 ? 3 : 4; /* size^(m + 1) / (m + 1)! < 1e-17 for m = 8, 12, 16, 20 */
}

/* c = one / first! + sum_i powers_i / (first + i)!, i = 1 .. 3, and 4 if `last`. */
static void combine(const V *const *powers, int last, int first, V *c)
{
    double share[5] = {1.0};
    int e, i;
    for (i = 2; i <= first; ++i) {
        share[0] /= i;
    }
    for (i = 1; i < 5; ++i) {
        share[i] = share[i - 1] / (first + i);
    }
    for (e = 0; e < ENTRIES; ++e) {
        c[e] = share[1] * powers[0][e] + share[2] * powers[1][e] + share[3] * powers[2][e];
    }
    for (e = 0; e < ENTRIES && last; ++e) {
        c[e] += share[4] * powers[3][e];
    }
    for (i = 0; i < D; ++i) {
        c[(i * D + i) * PARTS] += share[0];
    }
}

/* The largest of all lanes, at most 1e12: a lane that is lost must not cost the others their time. */
static double widest(V a)
{
    double size = 0.0;
    int l;
    for (l = 0; l < LANES; ++l) {
        size = fmax(size, LANE(a, l));
    }
    return size < 1e12 ? size : 1e12;
}

/*
 * E = exp(a). Taylor's polynomial in blocks of four terms, C_0 + a^4 (C_1 + a^4 (C_2 + ...)), takes a third of the products that
 * Horner's rule does; then squarings. How many of both is told by the norm of a^2, which bounds all even powers, and may be far less than
 * that of a. Scales a.
 */
static void exponential(V *a, V *E)
{
    V square = spread(0.0), next[ENTRIES], a2[ENTRIES], a3[ENTRIES], a4[ENTRIES];
    const V *powers[] = {a, a2, a3, a4};
    double size, scale = 1.0;
    int e, j, halvings = 0, last;
    multiply(a, a, 0, a2);
    for (e = 0; e < ENTRIES; ++e) {
        square += a2[e] * a2[e];
    }
    for (size = sqrt(widest(root(square))); size > 1.3; size /= 2.0) {
        scale /= 2.0;
        ++halvings;
    }
    for (e = 0; e < ENTRIES && halvings > 0; ++e) {
        a[e] *= scale;
        a2[e] *= scale * scale;
    }
    multiply(a2, a, 0, a3);
    multiply(a2, a2, 0, a4);
    last = blocks(size);
    combine(powers, 1, 4 * last, E);
    for (j = last - 1; j >= 0; --j) {
        combine(powers, 0, 4 * j, next);
        multiply(a4, E, 1, next);
        memcpy(E, next, sizeof next);
    }
    for (j = 0; j < halvings; ++j) {
        multiply(E, E, 0, next);
        memcpy(E, next, sizeof next);
    }
}

#endif
