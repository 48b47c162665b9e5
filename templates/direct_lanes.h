/* Vectors of doubles, a start in each, matrices of them, and exp with its derivatives: of direct_core.c. */
#ifndef DIRECT_LANES_H
#define DIRECT_LANES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "direct_sizes.h"

/* LANES starts run side by side in one vector of doubles; other compilers run one start at a time. */
#if defined(__GNUC__) && !defined(LIE_CODEGEN_ONE_LANE)
#define LANES 8
#define LANE(v, l) ((v)[l])
#define LESS(a, b) ((Mask)((a) < (b)))
#define SELECT(mask, a, b) ((V)(((mask) & (Mask)(a)) | (~(mask) & (Mask)(b))))
#define NOT(mask) (~(mask))
#define TRUE_LANE (-1)
typedef double V __attribute__((vector_size(64)));
typedef int64_t Mask __attribute__((vector_size(64)));
#else
#define LANES 1
#define LANE(v, l) (*(&(v) + (l)))
#define LESS(a, b) ((a) < (b))
#define SELECT(mask, a, b) ((mask) ? (a) : (b))
#define NOT(mask) (!(mask))
#define TRUE_LANE 1
typedef double V;
typedef int Mask;
#endif

enum { ENTRIES = D * D * PARTS }; /* doubles of a matrix, complex ones as pairs */

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

/* c += b a for a matrix b of which most entries are zero; `there` tells which are not, or null that none is. */
static void multiply_sparse(const V *b, const unsigned char *there, const V *a, V *c)
{
    int i, j, k;
    if (there == NULL) {
        multiply(b, a, 1, c);
        return;
    }
    for (i = 0; i < D; ++i) {
        for (k = 0; k < D; ++k) {
            const V *row = a + k * D * PARTS;
            V *sum = c + i * D * PARTS;
            if (there[(i * D + k) * PARTS]) {
                const V x = b[(i * D + k) * PARTS];
                for (j = 0; j < D * PARTS; ++j) {
                    sum[j] += x * row[j];
                }
            }
#if PARTS == 2
            if (there[(i * D + k) * PARTS + 1]) {
                const V y = b[(i * D + k) * PARTS + 1];
                for (j = 0; j < D; ++j) {
                    sum[2 * j] -= y * row[2 * j + 1];
                    sum[2 * j + 1] += y * row[2 * j];
                }
            }
#endif
        }
    }
}

/* Blocks of four terms after the first four that make Taylor's series of exp exact to rounding for matrices of that norm. */
static int blocks(double size)
{
    return size < 0.054 ? 1 : size < 0.28 ? 2 : 3; /* size^(m + 1) / (m + 1)! < 1e-17 for m = 8, 12, 16 = 4 (blocks + 1) */
}

/* c = one / first! + sum_i powers_i / (first + i)!, i = 1 .. 3, and 4 if `last`. */
static void combine(const V *const *powers, int last, int first, double one, V *c)
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
        c[(i * D + i) * PARTS] += share[0] * one;
    }
}

/*
 * exp(a) and its derivatives along `count` matrices b_i, of which `there` tells the entries that are not zero (all, if null). Taylor's polynomial in blocks of four terms, C_0 + a^4 (C_1 + a^4 (C_2 + ...)), takes a
 * third of the products that Horner's rule does; then squarings. Scales a and b.
 * The derivatives are those of the very operations: of C + a^4 S it is C' + a^4 S' + (a^4)' S, of E <- E E it is E E' + E' E; so they belong
 * to the E that is computed, to rounding, and Newton's steps on it converge. E' goes first, for it needs the E before.
 */
static void exponentials(V *a, int count, V *b, const unsigned char *there, V *E, V *dE)
{
    V square = spread(0.0), next[ENTRIES], a2[ENTRIES], a3[ENTRIES], a4[ENTRIES], sums[4][ENTRIES];
    const V *powers[] = {a, a2, a3, a4};
    double size = 0.0;
    int e, i, j, l, halvings = 0, last;
    for (e = 0; e < ENTRIES; ++e) {
        square += a[e] * a[e];
    }
    for (l = 0; l < LANES; ++l) {
        size = fmax(size, sqrt(LANE(square, l)));
    }
    size = size < 1e6 ? size : 1e6; /* a lane that is lost must not cost the others their time */
    while (size > 0.7) {            /* a squaring costs as much as a block, which reaches less than twice as far */
        size /= 2.0;
        ++halvings;
    }
    for (e = 0; e < ENTRIES; ++e) {
        a[e] *= ldexp(1.0, -halvings);
    }
    for (e = 0; e < count * ENTRIES; ++e) {
        b[e] *= ldexp(1.0, -halvings);
    }
    multiply(a, a, 0, a2);
    multiply(a2, a, 0, a3);
    multiply(a2, a2, 0, a4);
    last = blocks(size);
    combine(powers, 1, 4 * last, 1.0, sums[last]);
    for (j = last - 1; j >= 0; --j) {
        combine(powers, 0, 4 * j, 1.0, sums[j]);
        multiply(a4, sums[j + 1], 1, sums[j]);
    }
    memcpy(E, sums[0], sizeof sums[0]);
    for (i = 0; i < count; ++i) {
        const V *along = b + i * ENTRIES;
        const unsigned char *entries = there == NULL ? NULL : there + i * ENTRIES;
        V b2[ENTRIES], b3[ENTRIES], b4[ENTRIES], *turned = dE + i * ENTRIES;
        const V *slopes[] = {along, b2, b3, b4};
        multiply(a, along, 0, b2);
        multiply_sparse(along, entries, a, b2);
        multiply(a, b2, 0, b3);
        multiply_sparse(along, entries, a2, b3);
        multiply(a2, b2, 0, b4);
        multiply(b2, a2, 1, b4);
        combine(slopes, 1, 4 * last, 0.0, turned);
        for (j = last - 1; j >= 0; --j) {
            combine(slopes, 0, 4 * j, 0.0, next);
            multiply(a4, turned, 1, next);
            multiply(b4, sums[j + 1], 1, next);
            memcpy(turned, next, sizeof next);
        }
    }
    for (j = 0; j < halvings; ++j) {
        for (i = 0; i < count; ++i) {
            multiply(E, dE + i * ENTRIES, 0, next);
            multiply(dE + i * ENTRIES, E, 1, next);
            memcpy(dE + i * ENTRIES, next, sizeof next);
        }
        multiply(E, E, 0, next);
        memcpy(E, next, sizeof next);
    }
}

#endif
