/* Newton's steps of the least energy on the goal, with the second derivatives of the chain: of direct_core.c. */
#ifndef DIRECT_NEWTON_H
#define DIRECT_NEWTON_H

#include "direct_steps.h"

enum { CONJUGATE = 12 }; /* most conjugate gradients of a step: curvatures come in few clusters */
/* They end when the square of the slope has fallen to this: the step is restored to the goal and repeated anyhow. */
#define ENOUGH_CURVED 1e-2

/* y that leaves least of s - J'y in the free controls (f: their inverse lengths, zero where held), and z = f (s - J'y). */
static void project(const task *w, const V *J, const V *L, const V *inverse, const V *s, V *y, V *z)
{
    int c;
    for (c = 0; c < w->columns; ++c) {
        z[c] = w->f[c] * s[c];
    }
    times(w, J, z, y);
    substitute(L, inverse, y);
    transposed(w, J, y, z);
    for (c = 0; c < w->columns; ++c) {
        z[c] = w->f[c] * (s[c] - z[c]);
    }
}

static V inner(const task *w, const V *a, const V *b)
{
    V sum = spread(0.0);
    int c;
    for (c = 0; c < w->columns; ++c) {
        sum += a[c] * b[c];
    }
    return sum;
}

/* re tr(A a) for the matrices A = A_i of the basis. */
static void traces(const programme *p, const V *a, V *x)
{
    int i, n;
    for (i = 0; i < N; ++i) {
        V sum = spread(0.0);
        for (n = p->basis.first[i]; n < p->basis.first[i + 1]; ++n) {
            const int e = p->basis.k[n], row = e / (D * PARTS), column = e % (D * PARTS) / PARTS;
            const double sign = PARTS == 2 && e % 2 ? -1.0 : 1.0;
            sum += sign * p->basis.value[n] * a[(column * D + row) * PARTS + (PARTS == 2 ? e % 2 : 0)];
        }
        x[i] = sum;
    }
}

/*
 * Derivatives of c' rjac(x) b_i along b_j, (M, M) over E_k: rjac' c = sum_j W_j / (j + 1)!, W_j+1 = -ad_x' W_j, is differentiated
 * term by term.
 */
static void bending(task *w, int k, const V *at_end, V *within)
{
    const programme *p = w->p;
    const sparse *c = &w->acting;
    V power[N], slopes[N * M], next[N], bent[N * M], sum[N * M], along[N * M];
    double size;
    int i, j, m, n, last;
    for (i = 0; i < N; ++i) {
        for (m = 0; m < M; ++m) {
            along[i * M + m] = looked_up(w, p->directions, M * N, k, m * N + i);
        }
    }
    size = adjoint_action(w, w->x + k * N);
    last = size > 8.0 ? 0 : terms(size); /* of pieces that turn more than once they are left out: steps are longer or shorter for it */
    memcpy(power, at_end, sizeof power);
    memset(slopes, 0, sizeof slopes);
    memset(sum, 0, sizeof sum);
    for (j = 1; j <= last; ++j) {
        const double share = -1.0 / (j + 1);
        memset(next, 0, sizeof next);
        memset(bent, 0, sizeof bent);
        for (i = 0; i < N; ++i) {
            for (n = c->first[i]; n < c->first[i + 1]; ++n) {
                const V entry = share * w->ad[n], here = share * c->value[n] * power[i], *way = along + c->j[n] * M;
                V *to = bent + c->k[n] * M;
                next[c->k[n]] += entry * power[i];
                for (m = 0; m < M; ++m) {
                    to[m] += entry * slopes[i * M + m] + here * way[m];
                }
            }
        }
        for (i = 0; i < N * M; ++i) {
            sum[i] += bent[i];
        }
        memcpy(power, next, sizeof next);
        memcpy(slopes, bent, sizeof bent);
    }
    for (i = 0; i < M; ++i) {
        for (m = 0; m < M; ++m) {
            V total = spread(0.0);
            for (j = 0; j < N; ++j) {
                total += sum[j * M + m] * along[j * M + i];
            }
            within[i * M + m] = total;
        }
    }
}

/*
 * Second derivatives of <R, Y(u)>, for one matrix R, at what was differentiated last. With v the coordinates of X^-1 dX, that by controls of
 * E_k and of a later E_l is <R, L X hat(v_k) hat(v_l) R'> = v_k' Q v_l, Q_ij = re tr(R' R^H L X A_i A_j): N x N numbers serve all pairs.
 * Within one exponential v_k itself changes, too.
 */
static void curvature(task *w, const V *row)
{
    const programme *p = w->p;
    V right[ENTRIES], turned[ENTRIES], whole[ENTRIES], moved[ENTRIES], other[ENTRIES], c[N];
    int e, i, j, k, m;
    for (e = 0; e < ENTRIES; ++e) {
        right[e] = spread(p->right[e]);
    }
    adjoint(row, turned);
    multiply(right, turned, 0, moved);
    multiply(moved, w->end, 0, whole);
    for (i = 0; i < N; ++i) {
        const int first = p->basis.first[i];
        multiply_given(whole, p->basis.k + first, p->basis.value + first, p->basis.first[i + 1] - first, moved);
        traces(p, moved, w->twice + i * N);
    }
    for (k = p->exponentials - 1; k >= 0; --k) {
        const V *rows = w->bodily + (size_t)k * M * N;
        V *within = w->within + (size_t)k * M * M;
        traces(p, whole, c);
        bending(w, k, c, within);
        for (i = 0; i < M; ++i) {
            V Qv[N];
            for (j = 0; j < N; ++j) {
                V sum = spread(0.0);
                for (m = 0; m < N; ++m) {
                    sum += w->twice[j * N + m] * rows[i * N + m];
                }
                Qv[j] = sum;
            }
            for (m = 0; m < M; ++m) {
                for (j = 0; j < N; ++j) {
                    within[i * M + m] += rows[m * N + j] * Qv[j];
                }
            }
        }
        inverse_of(p, w->x + k * N, w->E + k * ENTRIES, other);
        multiply(w->E + k * ENTRIES, whole, 0, moved);
        multiply(moved, other, 0, whole);
    }
}

/* z = these second derivatives times d. */
static void bend(task *w, const V *d, V *z)
{
    const programme *p = w->p;
    V later[N], before[N];
    int k, i, j, m;
    memset(later, 0, sizeof later);
    memset(before, 0, sizeof before);
    memset(z, 0, (size_t)w->columns * sizeof *z);
    for (k = 0; k < p->exponentials; ++k) {
        const double first = p->share[2 * k], second = p->share[2 * k + 1];
        V *moved = w->moved + k * N;
        memset(moved, 0, N * sizeof *moved);
        for (i = 0; i < M; ++i) {
            const V *row = w->bodily + ((size_t)k * M + i) * N, *at = d + p->slot[k] * M + i;
            const V by = second != 0.0 ? first * at[0] + second * at[M] : first * at[0];
            for (j = 0; j < N; ++j) {
                moved[j] += by * row[j];
            }
        }
        for (j = 0; j < N; ++j) {
            later[j] += moved[j];
        }
    }
    for (k = 0; k < p->exponentials; ++k) {
        const double first = p->share[2 * k], second = p->share[2 * k + 1];
        const V *moved = w->moved + k * N;
        V both[N];
        for (j = 0; j < N; ++j) {
            later[j] -= moved[j];
        }
        for (i = 0; i < N; ++i) {
            V sum = spread(0.0);
            for (j = 0; j < N; ++j) {
                sum += w->twice[i * N + j] * later[j] + w->twice[j * N + i] * before[j];
            }
            both[i] = sum;
        }
        for (j = 0; j < N; ++j) {
            before[j] += moved[j];
        }
        for (i = 0; i < M; ++i) {
            const V *row = w->bodily + ((size_t)k * M + i) * N;
            V sum = spread(0.0), *to = z + p->slot[k] * M + i;
            for (j = 0; j < N; ++j) {
                sum += row[j] * both[j];
            }
            for (m = 0; m < M; ++m) {
                const V *at = d + p->slot[k] * M + m;
                sum += w->within[((size_t)k * M + i) * M + m] * (second != 0.0 ? first * at[0] + second * at[M] : first * at[0]);
            }
            to[0] += first * sum;
            if (second != 0.0) {
                to[M] += second * sum;
            }
        }
    }
}

/*
 * Newton's step of the least energy on the goal, from controls u that reach it: the proximal step first, which tells which
 * controls go to their bounds and what the multipliers y are, then conjugate gradients on the Lagrange function's second
 * derivative in the others, on the linearised goal. What was differentiated last is at. Where the curvature is negative they end. Returns the gain to expect.
 */
static V newton(task *w, point *at, V rho, V sigma, V *y, V *v)
{
    const programme *p = w->p;
    const V zero = {0.0};
    V A[PACKED], inverse[N], row[ENTRIES], trace = zero, first, size, slack[N], gain = zero;
    Mask open;
    int c, i, j, e, step;
    proximal(w, at, rho, y, v);
    for (c = 0; c < w->columns; ++c) {
        w->f[c] = SELECT(LESS(zero, w->f[c]), spread(1.0 / p->mass[c / M]), zero);
        w->n[c] = v[c] - at->u[c];
    }
    gram(w, at->J, w->f, w->t, A);
    for (i = 0; i < N; ++i) {
        trace += A[i * (i + 1) / 2 + i];
    }
    for (i = 0; i < N; ++i) {
        A[i * (i + 1) / 2 + i] += 1e-13 * trace + 1e-300;
    }
    factor(A, inverse);
    for (i = N - 1; i >= 0; --i) { /* y'r = (G'^-1 y)' Z' (Y R - value) */
        slack[i] = y[i];
        for (j = i + 1; j < N; ++j) {
            slack[i] -= w->G[j * (j + 1) / 2 + i] * slack[j];
        }
        slack[i] *= w->over[i];
    }
    memset(row, 0, sizeof row);
    for (i = 0; i < N; ++i) {
        for (e = 0; e < ENTRIES; ++e) {
            row[e] += slack[i] * w->Z[i * ENTRIES + e];
        }
    }
    transposed(w, at->J, y, w->g);
    curvature(w, row);
    bend(w, w->n, w->t);
    for (c = 0; c < w->columns; ++c) {
        w->s[c] = w->g[c] + w->t[c] - p->mass[c / M] * (p->weight[c] * (at->u[c] + w->n[c]) + sigma * w->n[c]);
    }
    project(w, at->J, A, inverse, w->s, slack, w->z);
    memcpy(w->d, w->z, (size_t)w->columns * sizeof *w->d);
    size = first = inner(w, w->s, w->z);
    open = LESS(zero, first);
    for (step = 0; step < CONJUGATE && any(open); ++step) {
        V bent, rate, next;
        bend(w, w->d, w->t);
        for (c = 0; c < w->columns; ++c) {
            w->t[c] = p->mass[c / M] * (p->weight[c] + sigma) * w->d[c] - w->t[c];
        }
        bent = inner(w, w->d, w->t);
        open &= LESS(zero, bent);
        rate = SELECT(open, size / bent, zero);
        for (c = 0; c < w->columns; ++c) {
            w->n[c] += rate * w->d[c];
            w->s[c] -= rate * w->t[c];
        }
        project(w, at->J, A, inverse, w->s, slack, w->z);
        next = inner(w, w->s, w->z);
        open &= LESS(ENOUGH_CURVED * first, next);
        rate = SELECT(open, next / size, zero);
        for (c = 0; c < w->columns; ++c) {
            w->d[c] = w->z[c] + rate * w->d[c];
        }
        size = next;
    }
    for (c = 0; c < w->columns; ++c) {
        const double weight = p->mass[c / M] * p->weight[c];
        gain += 0.5 * w->n[c] * (w->s[c] - weight * at->u[c] + w->g[c]);
        v[c] = at->u[c] + w->n[c];
    }
    return gain;
}

#endif
