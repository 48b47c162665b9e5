/*
 * The states between the steps of one member of a second-order system, X' = X hat(xi), (xi, ...)' = F, without a further rate: what is
 * known where steps meet is enough.
 *
 * The vectors behind Theta and their slopes are known there: Hermite's polynomial over the KNOTS nearest, of degree 2 KNOTS - 1. So are all of
 * y where it begins with the elements. Theta is known at three knots of one chart: with X_c the element of the one in the middle, X_(c-1) = X_c exp(-Theta_(c-1)), X_(c+1) = X_c
 * exp(Theta_c), and its first two derivatives follow from xi and xi': degree 8. Newton's form: its last terms say how far the polynomial
 * is from that of less data, which errs more.
 */
#ifndef LIE_CODEGEN_PAIR_HERMITE_H
#define LIE_CODEGEN_PAIR_HERMITE_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "pair_step.h"

enum { KNOTS = 6, TURNS = 3, TURN_NODES = 3 * TURNS, FOUR = 4, EIGHT = 8 };

/* [A_i, A_j] = sum_k c A_k of so many (i, j, k), i < j. */
typedef struct {
    ptrdiff_t n, count;
    const ptrdiff_t *index;
    const double *c;
} Brackets;

/* Where `times` derivatives (the value is the first) of n entries are known. */
typedef struct {
    const double *of[3];
} Jet;

/* n padded to whole fours. */
static ptrdiff_t fours(ptrdiff_t n)
{
    return (n + FOUR - 1) / FOUR * FOUR;
}

/* The matrix of [x, .], column after column in whole fours. */
static void ad_matrix(const Brackets *g, const double *x, double *ad)
{
    const ptrdiff_t wide = fours(g->n);
    memset(ad, 0, (size_t)(wide * g->n) * sizeof(double));
    for (ptrdiff_t e = 0; e < g->count; ++e) {
        const ptrdiff_t i = g->index[3 * e], j = g->index[3 * e + 1], k = g->index[3 * e + 2];
        ad[wide * j + k] += g->c[e] * x[i];
        ad[wide * i + k] -= g->c[e] * x[j];
    }
}

/* (A v)[first .. first + FOUR), added to `sum`. */
static inline void add_product(ptrdiff_t n, ptrdiff_t wide, const double *A, const double *v, ptrdiff_t first, double *sum)
{
    for (ptrdiff_t j = 0; j < n; ++j) {
        for (int l = 0; l < FOUR; ++l) {
            sum[l] += A[wide * j + first + l] * v[j];
        }
    }
}

/* B_k / k! of k = 1, 2, ..., that of 1 with the sign for X' = X hat(xi). */
enum { BERNOULLIS = 10 };
static const double bernoulli[BERNOULLIS] = {0.5, 1.0 / 12, 0.0, -1.0 / 720, 0.0, 1.0 / 30240, 0.0, -1.0 / 1209600, 0.0, 1.0 / 47900160};

/* Doubles that turn_jet works with. */
static ptrdiff_t turn_room(ptrdiff_t n)
{
    return fours(n) * (2 * n + 4);
}

/*
 * Theta' = dexp^-1 xi = sum_k b_k ad^k xi and Theta'' at Theta, from xi and xi'; terms below `small` are left away.
 * v_k = ad v_(k-1) has the derivative v_k' = [Theta', v_(k-1)] + [Theta, v_(k-1)'], in which Theta' is what the first sum gives.
 */
static void turn_jet(const Brackets *g, const double *theta, const double *xi, const double *xi_dot, double small, double *first, double *second, double *room)
{
    const ptrdiff_t n = g->n, wide = fours(n);
    double *ad = room, *ad_dot = ad + n * wide, *v = ad_dot + n * wide, *v_dot = v + wide, *w = v_dot + wide, *w_dot = w + wide, size;
    int used = 0;
    ad_matrix(g, theta, ad);
    memcpy(first, xi, (size_t)n * sizeof(double));
    memcpy(v, xi, (size_t)n * sizeof(double));
    do {
        size = 0.0;
        for (ptrdiff_t i = 0; i < wide; i += FOUR) {
            double sum[FOUR] = {0.0};
            add_product(n, wide, ad, v, i, sum);
            memcpy(w + i, sum, sizeof sum);
        }
        for (ptrdiff_t i = 0; i < n; ++i) {
            first[i] += bernoulli[used] * w[i];
            v[i] = w[i];
            size = fabs(w[i]) > size ? fabs(w[i]) : size;
        }
        ++used; /* of two that follow each other one coefficient is not zero */
    } while (used + 1 < BERNOULLIS && size * fabs(bernoulli[used] + bernoulli[used + 1]) > small);
    ad_matrix(g, first, ad_dot);
    memcpy(second, xi_dot, (size_t)n * sizeof(double));
    memcpy(v, xi, (size_t)n * sizeof(double));
    memcpy(v_dot, xi_dot, (size_t)n * sizeof(double));
    for (int k = 0; k < used; ++k) {
        for (ptrdiff_t i = 0; i < wide; i += FOUR) {
            double sum[FOUR] = {0.0}, dot[FOUR] = {0.0};
            add_product(n, wide, ad, v, i, sum);
            add_product(n, wide, ad_dot, v, i, dot);
            add_product(n, wide, ad, v_dot, i, dot);
            memcpy(w + i, sum, sizeof sum);
            memcpy(w_dot + i, dot, sizeof dot);
        }
        for (ptrdiff_t i = 0; i < n; ++i) {
            second[i] += bernoulli[k] * w_dot[i];
            v[i] = w[i];
            v_dot[i] = w_dot[i];
        }
    }
}

/*
 * Hermite's polynomial through values and slopes at the KNOTS places, in lengths h of a step, in Newton's form: its nodes are the places one
 * after another, each twice.
 */
enum { NODES = 2 * KNOTS };
typedef struct {
    double place[KNOTS];
    const double *value[KNOTS], *slope[KNOTS]; /* n entries each */
    double *c;                                 /* coefficients, n entries a node */
} Hermite;

/* Four doubles anywhere in an array: of loops over local arrays gcc 12 makes scalar sums. */
#if defined(__GNUC__)
typedef double Quad __attribute__((vector_size(32), aligned(8), may_alias));
#else
typedef double Quad;
#endif

#if defined(__GNUC__) && !defined(__clang__)
#define UNROLLED _Pragma("GCC unroll 12")
#elif defined(__clang__)
#define UNROLLED _Pragma("clang loop unroll(full)")
#else
#define UNROLLED
#endif

/* Where 1/(x_k - x_j) of j < k stands among all. */
#define PAST(k, j) ((k) * ((k) - 1) / 2 + (j))
enum { PASTS = 16 };

/* Of MANY entries from the first on: the coefficients, and the value at a place `away` from each of the knots. */
#define HERMITE(MANY, TYPE)                                                                         \
    static inline void hermite_##MANY(const Hermite *p, ptrdiff_t n, const double *over, double h, ptrdiff_t first) \
    {                                                                                               \
        enum { PARTS = MANY * sizeof(double) / sizeof(TYPE) };                                      \
        int i, j, l;                                                                                \
        for (l = 0; l < PARTS; ++l) {                                                               \
            TYPE c[NODES];                                                                          \
            UNROLLED                                                                                \
            for (i = 0; i < NODES; ++i) {                                                           \
                c[i] = ((const TYPE *)(p->value[i / 2] + first))[l];                                \
            }                                                                                       \
            UNROLLED                                                                                \
            for (j = 1; j < NODES; ++j) {                                                           \
                UNROLLED                                                                            \
                for (i = NODES - 1; i >= j; --i) { /* two nodes that follow each other may be one place */ \
                    c[i] = j == 1 && i % 2 ? h * ((const TYPE *)(p->slope[i / 2] + first))[l] : over[PAST(i / 2, (i - j) / 2)] * (c[i] - c[i - 1]); \
                }                                                                                   \
            }                                                                                       \
            UNROLLED                                                                                \
            for (i = 0; i < NODES; ++i) {                                                           \
                ((TYPE *)(p->c + i * n + first))[l] = c[i];                                         \
            }                                                                                       \
        }                                                                                           \
    }                                                                                               \
    static inline void hermite_at_##MANY(const Hermite *p, ptrdiff_t n, const double *away, double few, ptrdiff_t first, double *value, double *left) \
    {                                                                                               \
        enum { PARTS = MANY * sizeof(double) / sizeof(TYPE) };                                      \
        int i, l;                                                                                   \
        for (l = 0; l < PARTS; ++l) {                                                               \
            TYPE sum = ((const TYPE *)(p->c + (NODES - 1) * n + first))[l];                         \
            UNROLLED                                                                                \
            for (i = NODES - 2; i >= 0; --i) {                                                      \
                sum = ((const TYPE *)(p->c + i * n + first))[l] + away[i / 2] * sum;                \
                if (i == NODES - 2) {                                                               \
                    ((TYPE *)(left + first))[l] = few * sum;                                        \
                }                                                                                   \
            }                                                                                       \
            ((TYPE *)(value + first))[l] = sum;                                                     \
        }                                                                                           \
    }
HERMITE(1, double)
HERMITE(4, Quad)

/* What `hermite_at` needs of places, values and slopes: four entries at a time, the last four perhaps again. */
static APART void hermite(const Hermite *p, ptrdiff_t n, double h)
{
    double over[PASTS];
    ptrdiff_t i = 0;
    over[PASTS - 1] = 1.0;
    UNROLLED
    for (int k = 1; k < KNOTS; ++k) {
        UNROLLED
        for (int j = 0; j < k; ++j) {
            over[PAST(k, j)] = p->place[k] - p->place[j];
        }
    }
    for (int l = 0; l < (int)(PASTS * sizeof(double) / sizeof(Quad)); ++l) { /* four at a time */
        Quad *some = (Quad *)over + l;
        *some = 1.0 / *some;
    }
    for (; i + FOUR <= n; i += FOUR) {
        hermite_4(p, n, over, h, i);
    }
    if (i < n && n >= FOUR) {
        hermite_4(p, n, over, h, n - FOUR);
        return;
    }
    for (; i < n; ++i) {
        hermite_1(p, n, over, h, i);
    }
}

/* The value at x, and in `left` what the last two terms add to it: without them there is one knot less. */
static APART void hermite_at(const Hermite *p, ptrdiff_t n, double x, double *value, double *left)
{
    double away[KNOTS], few = 1.0;
    ptrdiff_t i = 0;
    for (int k = 0; k < KNOTS; ++k) {
        away[k] = x - p->place[k];
        few *= k < KNOTS - 1 ? away[k] * away[k] : 1.0;
    }
    for (; i + FOUR <= n; i += FOUR) {
        hermite_at_4(p, n, away, few, i, value, left);
    }
    if (i < n && n >= FOUR) {
        hermite_at_4(p, n, away, few, n - FOUR, value, left);
        return;
    }
    for (; i < n; ++i) {
        hermite_at_1(p, n, away, few, i, value, left);
    }
}

/*
 * Newton's polynomial of n entries of which the values and two derivatives are known at each of TURNS places, in lengths h: `newton` makes
 * the coefficients, four entries a node, for registers; those behind the last entry are zeros. `newton_at` gives its value at x, and in
 * `last` what the last term adds to it: both with room for whole fours. Loops of known length, which the compiler unrolls.
 */
static void newton(ptrdiff_t n, const double *place, const Jet *jets, double h, double *to)
{
    enum { ALL = TURN_NODES };
    const double scale[3] = {1.0, h, 0.5 * h * h};
    double over[TURNS][TURNS];
    ptrdiff_t first;
    int i, j, k, l;
    for (i = 0; i < TURNS; ++i) {
        for (j = 0; j < i; ++j) {
            over[i][j] = 1.0 / (place[i] - place[j]);
        }
    }
    for (first = 0; first < n; first += FOUR, to += FOUR * ALL) {
        const int wide = n - first < FOUR ? (int)(n - first) : FOUR;
        double known[ALL][FOUR] = {{0.0}}, c[ALL][FOUR]; /* of a place its derivatives over the factorials */
        for (k = 0; k < ALL; ++k) {
            for (l = 0; l < wide; ++l) {
                known[k][l] = scale[k % 3] * jets[k / 3].of[k % 3][first + l];
            }
        }
        for (k = 0; k < ALL; ++k) {
            memcpy(c[k], known[k - k % 3], sizeof c[k]);
        }
        for (j = 1; j < ALL; ++j) {
            for (i = ALL - 1; i >= j; --i) {
                if (i % 3 >= j) { /* the node and that j before it are one place */
                    memcpy(c[i], known[i - i % 3 + j], sizeof c[i]);
                } else {
                    const double by = over[i / 3][(i - j) / 3];
                    for (l = 0; l < FOUR; ++l) {
                        c[i][l] = by * (c[i][l] - c[i - 1][l]);
                    }
                }
            }
        }
        memcpy(to, c, sizeof c);
    }
}

static void newton_at(ptrdiff_t n, const double *place, const double *c, double x, double *value, double *last)
{
    enum { ALL = TURN_NODES, FEW = ALL - 1 };
    double by[TURNS], whole = 1.0;
    ptrdiff_t first;
    int i, l;
    for (i = 0; i < TURNS; ++i) {
        by[i] = x - place[i];
    }
    for (i = 0; i < FEW; ++i) {
        whole *= by[i / 3];
    }
    for (first = 0; first < n; first += FOUR, c += FOUR * ALL) {
        double sum[FOUR];
        memcpy(sum, c + FOUR * (ALL - 1), sizeof sum);
        for (i = ALL - 2; i >= FEW; --i) {
            for (l = 0; l < FOUR; ++l) {
                sum[l] = c[FOUR * i + l] + by[i / 3] * sum[l];
            }
        }
        for (l = 0; l < FOUR; ++l) {
            last[first + l] = whole * sum[l];
        }
        for (i = FEW - 1; i >= 0; --i) {
            for (l = 0; l < FOUR; ++l) {
                sum[l] = c[FOUR * i + l] + by[i / 3] * sum[l];
            }
        }
        memcpy(value + first, sum, sizeof sum);
    }
}

#endif
