/* The chain of exponentials, its end, and the derivatives of that end: of direct_core.c. */
#ifndef DIRECT_CHAIN_H
#define DIRECT_CHAIN_H

#include "direct_lanes.h"

enum { PACKED = N * (N + 1) / 2 }; /* entries of a lower triangle */

/* As `_Programme` of compiled.py. */
typedef struct {
    int exponentials, slots, rows, entry_lanes, free_phase, fuel, reach_iterations, descend_iterations, wanted;
    double enough, damping, relative;
    const double *start;      /* (D, D) L X0 */
    const double *right;      /* (D, D) R */
    const double *value;      /* (lanes, D, D) */
    const double *basis;      /* (N, D, D) */
    const double *drifts;     /* (rows, D, D) */
    const double *directions; /* (rows, M, D, D) */
    const double *share;      /* (exponentials, 2) p_k, q_k */
    const double *low, *high; /* (slots, M) */
    const double *weight;     /* (slots, M) */
    const double *mass;       /* (slots) */
    const int *entry;         /* (entry_lanes, exponentials) the row of each exponential */
    const int *slot;          /* (exponentials) */
} programme;

/* Controls and what is known there: the residual's norm, its reduced coordinates r and their derivative J. */
typedef struct {
    V *u;   /* (C) */
    V *J;   /* (N, C) */
    V r[N];
    V size;
} point;

/* One group of lanes at work. */
typedef struct {
    const programme *p;
    int columns;         /* C = slots M */
    int lane[LANES];     /* the caller's number of each lane */
    V value[ENTRIES];
    V *E, *dE, *before;  /* (exponentials, ...) */
    V *f, *t, *v, *z;    /* (C) each */
    V *g, *s, *d, *x;    /* (C) each, of Newton's steps */
    V *Z;                /* (N, ENTRIES) rows that reduce the residual */
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

/* Whether any lane finds a number other than zero there. */
static unsigned char given(const task *w, const double *table, int width, int k, int e)
{
    const programme *p = w->p;
    int l, found = 0;
    if (p->entry_lanes == 1) {
        return table[(size_t)p->entry[k] * width + e] != 0.0;
    }
    for (l = 0; l < LANES; ++l) {
        found |= table[(size_t)p->entry[w->lane[l] * p->exponentials + k] * width + e] != 0.0;
    }
    return (unsigned char)found;
}

/* The exponent of E_k, its derivatives b by the controls of its slot, and which of their entries are not zero. */
static void exponent(const task *w, int k, const V *u, V *a, V *b, unsigned char *there)
{
    const programme *p = w->p;
    const V *first = u + p->slot[k] * M, *second = p->share[2 * k + 1] != 0.0 ? first + M : first;
    int e, i;
    for (e = 0; e < ENTRIES; ++e) {
        a[e] = looked_up(w, p->drifts, ENTRIES, k, e);
    }
    for (i = 0; i < M; ++i) {
        const V driven = p->share[2 * k] * first[i] + p->share[2 * k + 1] * second[i];
        for (e = 0; e < ENTRIES; ++e) {
            const int place = i * ENTRIES + e;
            there[place] = given(w, p->directions, M * ENTRIES, k, place);
            b[place] = there[place] ? looked_up(w, p->directions, M * ENTRIES, k, place) : spread(0.0);
            if (there[place]) {
                a[e] += driven * b[place];
            }
        }
    }
}

/* The lower triangle A becomes its Cholesky factor; a pivot that rounding made negative is as good as none. */
static void factor(V *A, V *inverse)
{
    int i, j, k;
    for (i = 0; i < N; ++i) {
        for (j = 0; j <= i; ++j) {
            V sum = A[i * (i + 1) / 2 + j];
            for (k = 0; k < j; ++k) {
                sum -= A[i * (i + 1) / 2 + k] * A[j * (j + 1) / 2 + k];
            }
            if (j < i) {
                A[i * (i + 1) / 2 + j] = sum * inverse[j];
            } else {
                sum = root(largest(sum, spread(1e-300)));
                A[i * (i + 1) / 2 + i] = sum;
                inverse[i] = 1.0 / sum;
            }
        }
    }
}

/* x with (L L') x = y, in place. */
static void substitute(const V *L, const V *inverse, V *y)
{
    int i, k;
    for (i = 0; i < N; ++i) {
        for (k = 0; k < i; ++k) {
            y[i] -= L[i * (i + 1) / 2 + k] * y[k];
        }
        y[i] *= inverse[i];
    }
    for (i = N - 1; i >= 0; --i) {
        y[i] *= inverse[i];
        for (k = 0; k < i; ++k) {
            y[k] -= L[i * (i + 1) / 2 + k] * y[i];
        }
    }
}

/*
 * The residual at Y = L X, and rows Z that reduce it to N numbers: with D = dr/dx along X hat(x) and D'D = G G',
 * the rows G^-1 D' are an orthonormal basis of what motions of X can change. Entries that no motion changes drop out.
 */
static void reduce(const task *w, const V *Y, point *at, V *Z)
{
    const programme *p = w->p;
    V here[ENTRIES], right[ENTRIES], G[PACKED], inverse[N], trace = spread(0.0), full = spread(0.0);
    V value[ENTRIES];
#if PARTS == 2
    V overlap_r = spread(0.0), overlap_i = spread(0.0);
#endif
    int e, i, j, k, x, y;
    for (e = 0; e < ENTRIES; ++e) {
        right[e] = spread(p->right[e]);
    }
    multiply(Y, right, 0, here);
    memcpy(value, w->value, sizeof value);
#if PARTS == 2
    if (p->free_phase) { /* |Y R - e^(i phi) U| is least where e^(i phi) is the direction of <U, Y R>: U is turned there */
        V scale, c, s;
        for (e = 0; e < ENTRIES; e += 2) {
            overlap_r += value[e] * here[e] + value[e + 1] * here[e + 1];
            overlap_i += value[e] * here[e + 1] - value[e + 1] * here[e];
        }
        scale = 1.0 / root(overlap_r * overlap_r + overlap_i * overlap_i + 1e-300);
        c = overlap_r * scale;
        s = overlap_i * scale;
        for (e = 0; e < ENTRIES; e += 2) {
            value[e] = c * w->value[e] - s * w->value[e + 1];
            value[e + 1] = s * w->value[e] + c * w->value[e + 1];
        }
    }
#endif
    for (e = 0; e < ENTRIES; ++e) {
        here[e] -= value[e];
        full += here[e] * here[e];
    }
    at->size = root(full);
    for (i = 0; i < N; ++i) {
        V turned[ENTRIES], *slope = Z + i * ENTRIES;
        /* hat(A_i) R in plain doubles: one of each for all lanes */
        for (x = 0; x < D; ++x) {
            for (y = 0; y < D; ++y) {
                double re = 0.0, im = 0.0;
                for (k = 0; k < D; ++k) {
                    const double *a = p->basis + i * ENTRIES + (x * D + k) * PARTS;
                    const double *b = p->right + (k * D + y) * PARTS;
                    re += a[0] * b[0];
#if PARTS == 2
                    re -= a[1] * b[1];
                    im += a[0] * b[1] + a[1] * b[0];
#endif
                }
                turned[(x * D + y) * PARTS] = spread(re);
                turned[(x * D + y) * PARTS + PARTS - 1] = spread(PARTS == 2 ? im : re);
            }
        }
        multiply(Y, turned, 0, slope);
#if PARTS == 2
        if (p->free_phase) {
            /* the phase follows: its rate is Im(<U, X A> / <U, X>) */
            const V norm = 1.0 / (overlap_r * overlap_r + overlap_i * overlap_i + 1e-300);
            V along_r = spread(0.0), along_i = spread(0.0), rate;
            for (e = 0; e < ENTRIES; e += 2) {
                along_r += w->value[e] * slope[e] + w->value[e + 1] * slope[e + 1];
                along_i += w->value[e] * slope[e + 1] - w->value[e + 1] * slope[e];
            }
            rate = (along_i * overlap_r - along_r * overlap_i) * norm;
            for (e = 0; e < ENTRIES; e += 2) {
                slope[e] += rate * value[e + 1];
                slope[e + 1] -= rate * value[e];
            }
        }
#endif
    }
    for (i = 0; i < N; ++i) {
        for (j = 0; j <= i; ++j) {
            V sum = spread(0.0);
            for (e = 0; e < ENTRIES; ++e) {
                sum += Z[i * ENTRIES + e] * Z[j * ENTRIES + e];
            }
            G[i * (i + 1) / 2 + j] = sum;
        }
        trace += G[i * (i + 1) / 2 + i];
    }
    /* Motions that the goal leaves free change nothing: G is singular along them, and rounding may make it indefinite. */
    for (i = 0; i < N; ++i) {
        G[i * (i + 1) / 2 + i] += 1e-13 / N * trace + 1e-300;
    }
    factor(G, inverse);
    /* Forward substitution with G's factor is Gram and Schmidt's process: rows before the i-th are orthonormal when it is reached. */
    for (i = 0; i < N; ++i) {
        V *row = Z + i * ENTRIES, sum = spread(0.0);
        for (j = 0; j < i; ++j) {
            for (e = 0; e < ENTRIES; ++e) {
                row[e] -= G[i * (i + 1) / 2 + j] * Z[j * ENTRIES + e];
            }
        }
        for (e = 0; e < ENTRIES; ++e) {
            row[e] *= inverse[i];
            sum += row[e] * here[e];
        }
        at->r[i] = sum;
    }
}

/* The exponentials of the controls u, `count` of their derivatives (M or none), and the products L X0 E_1 .. E_k up to Y. */
static void chain(task *w, const V *u, int count)
{
    const programme *p = w->p;
    V a[ENTRIES], b[M * ENTRIES];
    unsigned char there[M * ENTRIES];
    int k, e;
    for (e = 0; e < ENTRIES; ++e) {
        w->before[e] = spread(p->start[e]);
    }
    for (k = 0; k < p->exponentials; ++k) {
        exponent(w, k, u, a, b, there);
        exponentials(a, count, b, there, w->E + k * ENTRIES, w->dE + (size_t)k * M * ENTRIES);
        multiply(w->before + k * ENTRIES, w->E + k * ENTRIES, 0, w->before + (k + 1) * ENTRIES);
    }
}

/* Residual at at->u, and the rows Z that reduce it there. */
static void examine(task *w, point *at)
{
    chain(w, at->u, 0);
    reduce(w, w->before + w->p->exponentials * ENTRIES, at, w->Z);
}

/* Residual and derivative at at->u: dY/du = (L X0 E_1 .. E_k-1) dE_k (E_k+1 .. E_K R). */
static void linearise(task *w, point *at)
{
    const programme *p = w->p;
    V tail[ENTRIES], moved[ENTRIES], column[ENTRIES], *Z = w->Z;
    int k, i, e, row;
    for (e = 0; e < ENTRIES; ++e) {
        tail[e] = spread(p->right[e]);
    }
    chain(w, at->u, M);
    reduce(w, w->before + p->exponentials * ENTRIES, at, Z);
    memset(at->J, 0, (size_t)N * w->columns * sizeof *at->J);
    for (k = p->exponentials - 1; k >= 0; --k) {
        const double first = p->share[2 * k], second = p->share[2 * k + 1];
        for (i = 0; i < M; ++i) {
            multiply(w->dE + ((size_t)k * M + i) * ENTRIES, tail, 0, moved);
            multiply(w->before + k * ENTRIES, moved, 0, column);
            for (row = 0; row < N; ++row) {
                V *J = at->J + (size_t)row * w->columns + p->slot[k] * M + i, sum = spread(0.0);
                for (e = 0; e < ENTRIES; ++e) {
                    sum += Z[row * ENTRIES + e] * column[e];
                }
                J[0] += first * sum;
                if (second != 0.0) {
                    J[M] += second * sum;
                }
            }
        }
        multiply(w->E + k * ENTRIES, tail, 0, moved);
        memcpy(tail, moved, sizeof tail);
    }
}

/*
 * Derivative z of <R, Y(u)> by the controls, for one matrix R: re tr(dE_k G_k) with G_k = (E_k+1 .. E_K R') R* (L X0 .. E_k-1), and
 * tr(dexp(a; b) G) = tr(b dexp(a; G)), so that one derivative of each exponential serves all controls.
 */
static void slope(task *w, const V *u, const V *row, V *z)
{
    const programme *p = w->p;
    V tail[ENTRIES], moved[ENTRIES], G[ENTRIES], adjoint[ENTRIES], a[ENTRIES], b[M * ENTRIES], E[ENTRIES], turned[ENTRIES];
    unsigned char there[M * ENTRIES];
    int k, i, x, y, e;
    for (x = 0; x < D; ++x) {
        for (y = 0; y < D; ++y) {
            adjoint[(y * D + x) * PARTS] = row[(x * D + y) * PARTS];
#if PARTS == 2
            adjoint[(y * D + x) * PARTS + 1] = -row[(x * D + y) * PARTS + 1];
#endif
        }
    }
    for (e = 0; e < ENTRIES; ++e) {
        tail[e] = spread(p->right[e]);
    }
    chain(w, u, 0);
    multiply(tail, adjoint, 0, moved);
    memcpy(tail, moved, sizeof tail);
    memset(z, 0, (size_t)w->columns * sizeof *z);
    for (k = p->exponentials - 1; k >= 0; --k) {
        const double first = p->share[2 * k], second = p->share[2 * k + 1];
        multiply(tail, w->before + k * ENTRIES, 0, G);
        exponent(w, k, u, a, b, there);
        exponentials(a, 1, G, NULL, E, turned);
        for (i = 0; i < M; ++i) {
            V sum = spread(0.0), *to = z + p->slot[k] * M + i;
            for (x = 0; x < D; ++x) {
                for (y = 0; y < D; ++y) {
                    const int place = i * ENTRIES + (x * D + y) * PARTS;
                    sum += b[place] * turned[(y * D + x) * PARTS];
#if PARTS == 2
                    sum -= b[place + 1] * turned[(y * D + x) * PARTS + 1];
#endif
                }
            }
            to[0] += first * sum;
            if (second != 0.0) {
                to[M] += second * sum;
            }
        }
        multiply(w->E + k * ENTRIES, tail, 0, moved);
        memcpy(tail, moved, sizeof tail);
    }
}

#endif
