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

enum { KNOTS = 6, TURNS = 3, TURN_NODES = 3 * TURNS, FOUR = 4 };

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
 * Hermite's polynomial through values and slopes at the KNOTS places, in lengths h of a step: the same weights for all entries. With
 * l_k the polynomials of Lagrange, s_k = l_k'(x_k), the value at x is sum_k l_k^2 ((1 - 2 s_k (x - x_k)) y_k + (x - x_k) h y_k').
 */
typedef struct {
    double place[KNOTS];
    double steep[KNOTS], scale[KNOTS];           /* s_k, 1/prod_j (x_k - x_j) */
    const double *value[KNOTS], *slope[KNOTS];   /* n entries each */
    double *before, *last;                       /* the last two terms of Newton's form, whose nodes are the places one after another, each twice */
} Hermite;

/* Four doubles anywhere in an array: of loops over local arrays gcc 12 makes scalar sums. */
#if defined(__GNUC__)
typedef double Quad __attribute__((vector_size(32), aligned(8), may_alias));
#else
typedef double Quad;
#endif

/* sum_k a_k y_k + b_k y_k', MANY entries from the first on. */
#define WEIGHED(MANY, TYPE)                                                                         \
    static inline void weighed_##MANY(const Hermite *p, const double *a, const double *b, ptrdiff_t first, double *to) \
    {                                                                                               \
        enum { PARTS = MANY * sizeof(double) / sizeof(TYPE) };                                      \
        TYPE sum[PARTS], more[PARTS];                                                               \
        int k, l;                                                                                   \
        for (l = 0; l < PARTS; ++l) {                                                               \
            sum[l] = more[l] = (TYPE){0.0};                                                         \
        }                                                                                           \
        for (k = 0; k < KNOTS; ++k) {                                                               \
            for (l = 0; l < PARTS; ++l) {                                                           \
                sum[l] += a[k] * ((const TYPE *)(p->value[k] + first))[l];                          \
                more[l] += b[k] * ((const TYPE *)(p->slope[k] + first))[l];                         \
            }                                                                                       \
        }                                                                                           \
        for (l = 0; l < PARTS; ++l) {                                                               \
            ((TYPE *)(to + first))[l] = sum[l] + more[l];                                           \
        }                                                                                           \
    }
WEIGHED(1, double)
WEIGHED(4, Quad)

/* The same of n entries: four at a time, the last four perhaps again. */
static APART void weighed(const Hermite *p, const double *a, const double *b, ptrdiff_t n, double *to)
{
    ptrdiff_t i = 0;
    for (; i + FOUR <= n; i += FOUR) {
        weighed_4(p, a, b, i, to);
    }
    if (i < n && n >= FOUR) {
        weighed_4(p, a, b, n - FOUR, to);
        return;
    }
    for (; i < n; ++i) {
        weighed_1(p, a, b, i, to);
    }
}

/*
 * What `hermite_at` needs of places, values and slopes. A divided difference is a sum of residues: with all places twice that of f/prod_j
 * (x - x_j)^2, in which 1/prod_(j != k) (x - x_j)^2 has at x_k the value W_k = scale_k^2 and the slope -2 s_k W_k; with the last place once, one
 * factor (x_k - x_last) more.
 */
static void hermite(Hermite *p, ptrdiff_t n, double h)
{
    enum { LAST = KNOTS - 1 };
    double a[KNOTS], b[KNOTS];
    int k, j;
    for (k = 0; k < KNOTS; ++k) {
        p->steep[k] = 0.0;
        p->scale[k] = 1.0;
    }
    for (k = 1; k < KNOTS; ++k) {
        for (j = 0; j < k; ++j) {
            const double over = 1.0 / (p->place[k] - p->place[j]);
            p->steep[k] += over;
            p->steep[j] -= over;
            p->scale[k] *= over;
            p->scale[j] *= -over;
        }
    }
    for (k = 0; k < KNOTS; ++k) {
        const double W = p->scale[k] * p->scale[k];
        a[k] = -2.0 * p->steep[k] * W;
        b[k] = h * W;
    }
    weighed(p, a, b, n, p->last);
    for (k = 0; k < KNOTS; ++k) {
        const double apart = p->place[k] - p->place[LAST], W = p->scale[k] * p->scale[k];
        a[k] = apart * a[k] + W;
        b[k] *= apart;
    }
    weighed(p, a, b, n, p->before);
}

/* The value at x, and in `left` what the last two terms of Newton's form add to it: without them there is one knot less. */
static APART void hermite_at(const Hermite *p, ptrdiff_t n, double h, double x, double *value, double *left)
{
    double away[KNOTS], others[KNOTS], a[KNOTS], b[KNOTS], low = 1.0, high = 1.0, few = 1.0;
    int k;
    for (k = 0; k < KNOTS; ++k) {
        away[k] = x - p->place[k];
        others[k] = low * p->scale[k];
        few = low; /* in the end without the last place */
        low *= away[k];
    }
    for (k = KNOTS - 1; k >= 0; --k) {
        const double l = others[k] * high, square = l * l;
        high *= away[k];
        a[k] = square * (1.0 - 2.0 * p->steep[k] * away[k]);
        b[k] = h * square * away[k];
    }
    weighed(p, a, b, n, value);
    for (ptrdiff_t i = 0; i < n; ++i) {
        left[i] = few * few * (p->before[i] + away[KNOTS - 1] * p->last[i]);
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
