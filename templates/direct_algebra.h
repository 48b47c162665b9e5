/* What the search knows, and exponentials E_k = exp(x) with their derivatives in coordinates of the algebra: of direct_core.c. */
#ifndef DIRECT_ALGEBRA_H
#define DIRECT_ALGEBRA_H

#include "direct_lanes.h"

enum { PACKED = N * (N + 1) / 2 }; /* entries of a lower triangle */

/* The entries (i, j, k) of a table that are not zero, those of i from first[i] to first[i + 1]. */
typedef struct {
    const int *first, *j, *k;
    const double *value;
} sparse;

/* As `_Programme` of compiled.py. */
typedef struct {
    int exponentials, slots, rows, entry_lanes, free_phase, fuel, reach_iterations, descend_iterations, wanted, unitary;
    double enough, damping, relative;
    const double *start;      /* (D, D) L X0 */
    const double *right;      /* (D, D) R */
    const double *value;      /* (lanes, D, D) */
    const double *drifts;     /* (rows, N) coordinates in the algebra, as of the directions */
    const double *directions; /* (rows, M, N) */
    const double *share;      /* (exponentials, 2) p_k, q_k */
    const double *low, *high; /* (slots, M) */
    const double *weight;     /* (slots, M) */
    const double *mass;       /* (slots) */
    const int *entry;         /* (entry_lanes, exponentials) the row of each exponential */
    const int *slot;          /* (exponentials) */
    sparse basis;             /* (i, 0, e): entry e of the matrix A_i */
    sparse matrix;            /* (e, 0, i): the same by entries */
    sparse dual;              /* (i, 0, e): x_i = sum value matrix[e] for a matrix sum x_i A_i */
    sparse bracket;           /* (i, j, k): component i of [A_j, A_k] */
} programme;

/* Controls and what is known there: the residual's norm, its reduced coordinates r and their derivative J. */
typedef struct {
    V *u;   /* (C) */
    V *J;   /* (N, C) */
    V r[N];
    V size;
} point;

/* One vector of lanes at work. */
typedef struct {
    const programme *p;
    int columns;        /* C = slots M */
    int plain;          /* whether R is the identity */
    int lane[LANES];    /* the caller's number of each lane */
    V value[ENTRIES];
    V *E;               /* (exponentials, ENTRIES) */
    V *x;               /* (exponentials, N) coordinates of the exponents */
    V *bodily;          /* (exponentials, M, N) coordinates of X^-1 dX along each control */
    V *ad;              /* entries of ad_x, one for each of `acting` */
    int first[N + 1];
    sparse acting;      /* those of `bracket` whose j some exponent has */
    V *f, *t, *v, *z;   /* (C) each */
    V *g, *s, *d, *n;   /* (C) each, of Newton's steps */
    V *twice, *within;  /* (N, N) and (exponentials, M, M): second derivatives across exponentials and within one */
    V *moved;           /* (exponentials, N) */
    V *Z;               /* (N, ENTRIES) derivatives of the residual along the basis */
    V end[ENTRIES];     /* L X */
    V ahead[2];         /* <value, L X R> as re, im, where the phase is free */
    V G[PACKED], over[N]; /* Cholesky factor of Z'Z, the inverse of its diagonal */
    point at, trial, kept;
} task;

/* Entry e of the table's row that exponential k takes, lane by lane if words differ. */
static V looked_up(const task *w, const double *table, int width, int k, int e)
{
    const programme *p = w->p;
    V value = spread(0.0);
    int l;
    if (p->entry_lanes == 1) {
        return spread(table[(size_t)p->entry[k] * width + e]);
    }
    for (l = 0; l < LANES; ++l) {
        LANE(value, l) = table[(size_t)p->entry[w->lane[l] * p->exponentials + k] * width + e];
    }
    return value;
}

/* Coordinates x of the exponent of E_k. */
static void exponent(const task *w, int k, const V *u, V *x)
{
    const programme *p = w->p;
    const V *first = u + p->slot[k] * M, *second = p->share[2 * k + 1] != 0.0 ? first + M : first;
    int c, i;
    for (c = 0; c < N; ++c) {
        x[c] = looked_up(w, p->drifts, N, k, c);
    }
    for (i = 0; i < M; ++i) {
        const V driven = p->share[2 * k] * first[i] + p->share[2 * k + 1] * second[i];
        for (c = 0; c < N; ++c) {
            x[c] += driven * looked_up(w, p->directions, M * N, k, i * N + c);
        }
    }
}

/* The matrix sum x_i A_i. */
static void hat(const programme *p, const V *x, V *a)
{
    const sparse *c = &p->matrix;
    int e, n;
    for (e = 0; e < ENTRIES; ++e) {
        V sum = spread(0.0);
        for (n = c->first[e]; n < c->first[e + 1]; ++n) {
            sum += c->value[n] * x[c->k[n]];
        }
        a[e] = sum;
    }
}

/* Coordinates x of a matrix of the algebra. */
static void coordinates(const programme *p, const V *a, V *x)
{
    const sparse *c = &p->dual;
    int i, n;
    for (i = 0; i < N; ++i) {
        V sum = spread(0.0);
        for (n = c->first[i]; n < c->first[i + 1]; ++n) {
            sum += c->value[n] * a[c->k[n]];
        }
        x[i] = sum;
    }
}

/* The inverse of E_k = exp(x). */
static void inverse_of(const programme *p, const V *x, const V *E, V *F)
{
    V a[ENTRIES];
    int e;
    if (p->unitary) {
        adjoint(E, F);
        return;
    }
    hat(p, x, a);
    for (e = 0; e < ENTRIES; ++e) {
        a[e] = -a[e];
    }
    exponential(a, F);
}

/* Coordinates of F hat(g) E, for E and its inverse F; in place. */
static void turn(const programme *p, const V *F, const V *E, V *g)
{
    V a[ENTRIES], b[ENTRIES];
    hat(p, g, a);
    multiply(F, a, 0, b);
    multiply(b, E, 0, a);
    coordinates(p, a, g);
}

/* The entries of ad_x; the largest sum of a row, which bounds its eigenvalues. */
static double adjoint_action(const task *w, const V *x)
{
    const sparse *c = &w->acting;
    V most = spread(0.0);
    int i, n;
    for (i = 0; i < N; ++i) {
        V sum = spread(0.0);
        for (n = c->first[i]; n < c->first[i + 1]; ++n) {
            const V entry = c->value[n] * x[c->j[n]];
            w->ad[n] = entry;
            sum += largest(entry, -entry);
        }
        most = largest(most, sum);
    }
    return fmin(widest(most), 1e6);
}

/* Terms after which sum ad^j / (j + 1)! is exact to rounding for ad of that size. */
static int terms(double size)
{
    double left = 1.0;
    int j = 0;
    while (left > 1e-15 && j < 100) {
        ++j;
        left *= size / (j + 1);
    }
    return j;
}

/*
 * Coordinates of E^-1 dE along the M directions of E_k = exp(x): g_i = sum_j (-ad_x)^j b_i / (j + 1)!, (N, M). In the algebra ad_x has few
 * entries, and vectors of N numbers take the place of matrices. Long x are halved: g(2 x) = (g(x) + E^-1 g(x) E) / 2 for E = exp(x).
 */
static void turning(task *w, int k, V *g)
{
    const programme *p = w->p;
    const sparse *c = &w->acting;
    V along[N * M], inner[N * M], x[N], *from = along, *to;
    int i, j, n, e, halvings = 0;
    double size, scale = 1.0;
    for (i = 0; i < N; ++i) {
        x[i] = w->x[k * N + i];
        for (j = 0; j < M; ++j) {
            along[i * M + j] = looked_up(w, p->directions, M * N, k, j * N + i);
        }
    }
    /* terms grow up to e^8 before they fall: that costs three digits of a derivative */
    for (size = adjoint_action(w, x); size > 8.0; size /= 2.0) {
        scale /= 2.0;
        ++halvings;
    }
    for (j = 2 * (terms(size) / 2) + 2; j >= 1; --j) { /* Horner's rule; an even number of steps ends in g */
        const double share = -scale / (j + 1);
        to = from == inner ? g : inner;
        for (i = 0; i < N; ++i) {
            V sum[M];
#pragma GCC unroll 8
            for (e = 0; e < M; ++e) {
                sum[e] = spread(0.0);
            }
            for (n = c->first[i]; n < c->first[i + 1]; ++n) {
                const V entry = w->ad[n], *row = from + c->k[n] * M;
#pragma GCC unroll 8
                for (e = 0; e < M; ++e) {
                    sum[e] += entry * row[e];
                }
            }
#pragma GCC unroll 8
            for (e = 0; e < M; ++e) {
                to[i * M + e] = along[i * M + e] + share * sum[e];
            }
        }
        from = to;
    }
    if (halvings > 0) {
        V a[ENTRIES], E[ENTRIES], F[ENTRIES], one[N];
        for (i = 0; i < N; ++i) {
            x[i] *= scale;
        }
        hat(p, x, a);
        exponential(a, E);
        inverse_of(p, x, E, F);
        for (j = 0; j < halvings; ++j) {
            for (e = 0; e < M; ++e) {
                for (i = 0; i < N; ++i) {
                    one[i] = g[i * M + e];
                }
                turn(p, F, E, one);
                for (i = 0; i < N; ++i) {
                    g[i * M + e] = 0.5 * (g[i * M + e] + one[i]);
                }
            }
            multiply(E, E, 0, a);
            memcpy(E, a, sizeof a);
            multiply(F, F, 0, a);
            memcpy(F, a, sizeof a);
        }
    }
}

#endif
