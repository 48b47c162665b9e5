/* The chain of exponentials, its end, and the derivatives of that end: of direct_core.c. */
#ifndef DIRECT_CHAIN_H
#define DIRECT_CHAIN_H

#include "direct_algebra.h"

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
 * The residual at Y = L X, and its derivatives Z along X hat(A_i). With Z'Z = G G', the rows G^-1 Z' are an orthonormal
 * basis of what motions of X can change: r are the residual's coordinates in it. Entries that no motion changes drop out.
 */
static void reduce(task *w, point *at)
{
    const programme *p = w->p;
    const V *Y = w->end;
    V here[ENTRIES], right[ENTRIES], value[ENTRIES], turned[ENTRIES], trace = spread(0.0), full = spread(0.0);
#if PARTS == 2
    V overlap_r = spread(0.0), overlap_i = spread(0.0);
#endif
    int e, i, j;
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
        w->ahead[0] = overlap_r;
        w->ahead[1] = overlap_i;
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
        const int first = p->basis.first[i], count = p->basis.first[i + 1] - first;
        V *slope = w->Z + i * ENTRIES, along = spread(0.0);
        multiply_given(Y, p->basis.k + first, p->basis.value + first, count, w->plain ? slope : turned);
        if (!w->plain) {
            multiply(turned, right, 0, slope);
        }
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
        for (e = 0; e < ENTRIES; ++e) {
            along += slope[e] * here[e];
        }
        at->r[i] = along;
        for (j = 0; j <= i; ++j) {
            const V *other = w->Z + j * ENTRIES;
            V even = spread(0.0), odd = even; /* two sums side by side, for each waits for itself */
            for (e = 0; e + 1 < ENTRIES; e += 2) {
                even += slope[e] * other[e];
                odd += slope[e + 1] * other[e + 1];
            }
            if (ENTRIES % 2) {
                even += slope[ENTRIES - 1] * other[ENTRIES - 1];
            }
            w->G[i * (i + 1) / 2 + j] = even + odd;
        }
        trace += w->G[i * (i + 1) / 2 + i];
    }
    /* Motions that the goal leaves free change nothing: G is singular along them, and rounding may make it indefinite. */
    for (i = 0; i < N; ++i) {
        w->G[i * (i + 1) / 2 + i] += 1e-13 / N * trace + 1e-300;
    }
    factor(w->G, w->over);
    for (i = 0; i < N; ++i) {
        /* a row of length zero but for rounding and that shift: what it says is rounding, so it says nothing */
        const V pivot = w->G[i * (i + 1) / 2 + i];
        const Mask rounding = NOT(LESS(4e-13 / N * trace, pivot * pivot));
        w->over[i] = SELECT(rounding, spread(0.0), w->over[i]);
        for (j = i; j < N; ++j) {
            w->G[j * (j + 1) / 2 + i] = SELECT(rounding, spread(0.0), w->G[j * (j + 1) / 2 + i]);
        }
        for (j = 0; j < i; ++j) {
            at->r[i] -= w->G[i * (i + 1) / 2 + j] * at->r[j];
        }
        at->r[i] *= w->over[i];
    }
}

/* Residual at at->u, with the exponentials and the rows Z there. */
static void examine(task *w, point *at)
{
    const programme *p = w->p;
    V a[ENTRIES];
    int k, e;
    for (e = 0; e < ENTRIES; ++e) {
        w->end[e] = spread(p->start[e]);
    }
    for (k = 0; k < p->exponentials; ++k) {
        exponent(w, k, at->u, w->x + k * N);
        hat(p, w->x + k * N, a);
        exponential(a, w->E + k * ENTRIES);
        multiply(w->end, w->E + k * ENTRIES, 0, w->end);
    }
    reduce(w, at);
}

/*
 * The derivative at what was examined last: with S = E_k+1 .. E_K the end moves by X hat(S^-1 g S), g = E_k^-1 dE_k, and the reduced residual
 * by G' times that, for Z = (orthonormal rows)' G'.
 */
static void differentiate(task *w, point *at)
{
    const programme *p = w->p;
    V S[ENTRIES], over[ENTRIES], E[ENTRIES], g[N * M];
    int k, i, j, c, e;
    memset(at->J, 0, (size_t)N * w->columns * sizeof *at->J);
    for (k = p->exponentials - 1; k >= 0; --k) {
        const double first = p->share[2 * k], second = p->share[2 * k + 1];
        V *rows = w->bodily + (size_t)k * M * N;
        turning(w, k, g);
        for (i = 0; i < M; ++i) {
            V *row = rows + i * N;
            for (j = 0; j < N; ++j) {
                row[j] = g[j * M + i];
            }
            if (k < p->exponentials - 1) {
                turn(p, over, S, row);
            }
            for (j = 0; j < N; ++j) {
                V *J = at->J + (size_t)j * w->columns + p->slot[k] * M + i;
                J[0] += first * row[j];
                if (second != 0.0) {
                    J[M] += second * row[j];
                }
            }
        }
        inverse_of(p, w->x + k * N, w->E + k * ENTRIES, E);
        if (k == p->exponentials - 1) {
            memcpy(S, w->E + k * ENTRIES, sizeof S);
            memcpy(over, E, sizeof over);
        } else {
            V moved[ENTRIES];
            multiply(w->E + k * ENTRIES, S, 0, moved);
            memcpy(S, moved, sizeof S);
            multiply(over, E, 0, moved);
            memcpy(over, moved, sizeof over);
        }
    }
    for (c = 0; c < w->columns; c += M) {
        for (i = 0; i < N; ++i) { /* row i of G' has its first entry in column i: rows below are still those of X^-1 dX */
            V *row = at->J + (size_t)i * w->columns + c, sum[M];
            for (e = 0; e < M; ++e) {
                sum[e] = w->G[i * (i + 1) / 2 + i] * row[e];
            }
            for (j = i + 1; j < N; ++j) {
                const V entry = w->G[j * (j + 1) / 2 + i], *below = at->J + (size_t)j * w->columns + c;
                for (e = 0; e < M; ++e) {
                    sum[e] += entry * below[e];
                }
            }
            memcpy(row, sum, sizeof sum);
        }
    }
}

/* Residual and derivative at at->u. */
static void linearise(task *w, point *at)
{
    examine(w, at);
    differentiate(w, at);
}

#endif
