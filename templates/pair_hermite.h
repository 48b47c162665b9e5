/*
 * The states between the steps of one member of a second-order system, X' = X hat(xi), (xi, ...)' = F, without a further rate: what is
 * known where steps meet is enough.
 *
 * The vectors behind Theta and their slopes are known there: Hermite's polynomial over the KNOTS nearest, of degree 2 KNOTS - 1. Theta is
 * known at three knots of one chart: with X_c the element of the one in the middle, X_(c-1) = X_c exp(-Theta_(c-1)), X_(c+1) = X_c
 * exp(Theta_c), and its first two derivatives follow from xi and xi': degree 8. Newton's form: its last terms say how far the polynomial
 * is from that of less data, which errs more.
 */
#ifndef LIE_CODEGEN_PAIR_HERMITE_H
#define LIE_CODEGEN_PAIR_HERMITE_H

#include <math.h>
#include <stddef.h>
#include <string.h>

enum { KNOTS = 6, TURNS = 3, NODES = 2 * KNOTS, TURN_NODES = 3 * TURNS, FOUR = 4 };

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
 * Newton's polynomial of n entries of which TIMES derivatives are known at each of COUNT places, in lengths h: `newton_TIMES` makes the
 * coefficients, four entries a node, for registers; those behind the last entry are zeros. `newton_TIMES_at` gives its value at x, and in
 * `last` what the last BEHIND terms add to it: both with room for whole fours. Loops of known length, which the compiler unrolls.
 */
#define NEWTON(COUNT, TIMES, BEHIND)                                                                \
    static void newton_##TIMES(ptrdiff_t n, const double *place, const Jet *jets, double h, double *to) \
    {                                                                                               \
        enum { ALL = COUNT * TIMES };                                                               \
        const double scale[3] = {1.0, h, 0.5 * h * h};                                              \
        double over[COUNT][COUNT];                                                                  \
        ptrdiff_t first;                                                                            \
        int i, j, k, l;                                                                             \
        for (i = 0; i < COUNT; ++i) {                                                               \
            for (j = 0; j < i; ++j) {                                                               \
                over[i][j] = 1.0 / (place[i] - place[j]);                                           \
            }                                                                                       \
        }                                                                                           \
        for (first = 0; first < n; first += FOUR, to += FOUR * ALL) {                               \
            const int wide = n - first < FOUR ? (int)(n - first) : FOUR;                            \
            double known[ALL][FOUR] = {{0.0}}, c[ALL][FOUR]; /* of a place its derivatives over the factorials */ \
            for (k = 0; k < ALL; ++k) {                                                             \
                for (l = 0; l < wide; ++l) {                                                        \
                    known[k][l] = scale[k % TIMES] * jets[k / TIMES].of[k % TIMES][first + l];      \
                }                                                                                   \
            }                                                                                       \
            for (k = 0; k < ALL; ++k) {                                                             \
                memcpy(c[k], known[k - k % TIMES], sizeof c[k]);                                    \
            }                                                                                       \
            for (j = 1; j < ALL; ++j) {                                                             \
                for (i = ALL - 1; i >= j; --i) {                                                    \
                    if (i % TIMES >= j) { /* the node and that j before it are one place */         \
                        memcpy(c[i], known[i - i % TIMES + j], sizeof c[i]);                        \
                    } else {                                                                        \
                        const double by = over[i / TIMES][(i - j) / TIMES];                         \
                        for (l = 0; l < FOUR; ++l) {                                                \
                            c[i][l] = by * (c[i][l] - c[i - 1][l]);                                 \
                        }                                                                           \
                    }                                                                               \
                }                                                                                   \
            }                                                                                       \
            memcpy(to, c, sizeof c);                                                                \
        }                                                                                           \
    }                                                                                               \
                                                                                                    \
    static void newton_##TIMES##_at(ptrdiff_t n, const double *place, const double *c, double x, double *value, double *last) \
    {                                                                                               \
        enum { ALL = COUNT * TIMES, FEW = ALL - BEHIND };                                           \
        double by[COUNT], whole = 1.0;                                                              \
        ptrdiff_t first;                                                                            \
        int i, l;                                                                                   \
        for (i = 0; i < COUNT; ++i) {                                                               \
            by[i] = x - place[i];                                                                   \
        }                                                                                           \
        for (i = 0; i < FEW; ++i) {                                                                 \
            whole *= by[i / TIMES];                                                                 \
        }                                                                                           \
        for (first = 0; first < n; first += FOUR, c += FOUR * ALL) {                                \
            double sum[FOUR];                                                                       \
            memcpy(sum, c + FOUR * (ALL - 1), sizeof sum);                                          \
            for (i = ALL - 2; i >= FEW; --i) {                                                      \
                for (l = 0; l < FOUR; ++l) {                                                        \
                    sum[l] = c[FOUR * i + l] + by[i / TIMES] * sum[l];                              \
                }                                                                                   \
            }                                                                                       \
            for (l = 0; l < FOUR; ++l) {                                                            \
                last[first + l] = whole * sum[l];                                                   \
            }                                                                                       \
            for (i = FEW - 1; i >= 0; --i) {                                                        \
                for (l = 0; l < FOUR; ++l) {                                                        \
                    sum[l] = c[FOUR * i + l] + by[i / TIMES] * sum[l];                              \
                }                                                                                   \
            }                                                                                       \
            memcpy(value + first, sum, sizeof sum);                                                 \
        }                                                                                           \
    }
NEWTON(KNOTS, 2, 2) /* without the last two terms: one knot less */
NEWTON(TURNS, 3, 1) /* without the last one: a second derivative less */

#endif
