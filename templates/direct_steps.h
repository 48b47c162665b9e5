/* Steps towards the goal, and steps that make the controls cheaper while they stay there: of direct_core.c. */
#ifndef DIRECT_STEPS_H
#define DIRECT_STEPS_H

#include "direct_chain.h"

enum {
    FACES = 4,     /* times that a step is taken again without the controls it would push out of the bounds */
    PATIENCE = 4,  /* steps that all may take, in units of those after which half of the lanes are there */
    RESTORE = 30,  /* most steps back to the goal; fewer than ten where that can be done at all */
    CONJUGATE = 12 /* most conjugate gradients of a Newton step: curvatures come in few clusters */
};
/* Conjugate gradients end when the square of the slope has fallen to this: the step is restored to the goal and repeated anyhow. */
#define ENOUGH_CURVED 1e-2
/* Residual up to which controls are so near to those before that the derivative there serves. */
#define NEARBY 1e-2

/* The lower triangle of J diag(f) J'. */
static void gram(const task *w, const V *J, const V *f, V *t, V *A)
{
    const int columns = w->columns;
    int i, j, c;
    for (i = 0; i < N; ++i) {
        const V *a = J + (size_t)i * columns;
        for (c = 0; c < columns; ++c) {
            t[c] = a[c] * f[c];
        }
        for (j = 0; j + 3 <= i; j += 4) {
            const V *b = J + (size_t)j * columns;
            V s0 = spread(0.0), s1 = s0, s2 = s0, s3 = s0;
            for (c = 0; c < columns; ++c) {
                s0 += t[c] * b[c];
                s1 += t[c] * b[columns + c];
                s2 += t[c] * b[2 * columns + c];
                s3 += t[c] * b[3 * columns + c];
            }
            A[i * (i + 1) / 2 + j] = s0;
            A[i * (i + 1) / 2 + j + 1] = s1;
            A[i * (i + 1) / 2 + j + 2] = s2;
            A[i * (i + 1) / 2 + j + 3] = s3;
        }
        for (; j <= i; ++j) {
            const V *b = J + (size_t)j * columns;
            V sum = spread(0.0);
            for (c = 0; c < columns; ++c) {
                sum += t[c] * b[c];
            }
            A[i * (i + 1) / 2 + j] = sum;
        }
    }
}

/* z = J'y */
static void transposed(const task *w, const V *J, const V *y, V *z)
{
    int row, c;
    for (c = 0; c < w->columns; ++c) {
        z[c] = J[c] * y[0];
    }
    for (row = 1; row < N; ++row) {
        for (c = 0; c < w->columns; ++c) {
            z[c] += J[(size_t)row * w->columns + c] * y[row];
        }
    }
}

/* F = J x */
static void times(const task *w, const V *J, const V *x, V *F)
{
    int row, c;
    for (row = 0; row < N; ++row) {
        V sum = spread(0.0);
        for (c = 0; c < w->columns; ++c) {
            sum += J[(size_t)row * w->columns + c] * x[c];
        }
        F[row] = sum;
    }
}

/*
 * The next controls of a damped step towards the goal. Levenberg and Marquardt's step is -(J'J + mu)^-1 J'r = -J' (J J' + mu)^-1 r: the
 * right side solves N equations, the left one as many as there are controls. A slot counts by its length, as in an integral over
 * time: with M the lengths it is -M^-1 J' (J M^-1 J' + mu)^-1 r. A control at a bound that the slope, or the step itself, would push out of it
 * is held, and the step taken again without it: clipped instead, it would leave a residual, and steps gain a digit each, not two.
 */
static void damped_step(task *w, const point *at, V lambda, V *next)
{
    const programme *p = w->p;
    const V zero = {0.0};
    V A[PACKED], inverse[N], y[N], trace, shift;
    int c, i, again;
    transposed(w, at->J, at->r, w->z);
    for (c = 0; c < w->columns; ++c) {
        w->f[c] = spread(1.0 / p->mass[c / M]);
    }
    for (again = 0; again < FACES; ++again) {
        Mask met = LESS(zero, zero);
        for (c = 0; c < w->columns; ++c) {
            const V low = spread(p->low[c]), high = spread(p->high[c]);
            const Mask down = NOT(LESS(low, at->u[c])) & LESS(zero, w->z[c]);
            const Mask up = NOT(LESS(at->u[c], high)) & LESS(w->z[c], zero);
            const Mask held = (down | up) & LESS(zero, w->f[c]);
            met |= held;
            w->f[c] = SELECT(held, zero, w->f[c]);
        }
        if (again > 0 && !any(met)) {
            break;
        }
        gram(w, at->J, w->f, w->t, A);
        trace = zero;
        for (i = 0; i < N; ++i) {
            trace += A[i * (i + 1) / 2 + i];
        }
        shift = lambda * trace * (1.0 / N) + 1e-300;
        for (i = 0; i < N; ++i) {
            A[i * (i + 1) / 2 + i] += shift;
            y[i] = at->r[i];
        }
        factor(A, inverse);
        substitute(A, inverse, y);
        transposed(w, at->J, y, w->z);
    }
    for (c = 0; c < w->columns; ++c) {
        const V wanted = at->u[c] - w->f[c] * w->z[c];
        next[c] = least(largest(wanted, spread(p->low[c])), spread(p->high[c]));
    }
}

static void take(const task *w, Mask where, point *to, const point *from)
{
    int i;
    to->size = SELECT(where, from->size, to->size);
    for (i = 0; i < N; ++i) {
        to->r[i] = SELECT(where, from->r[i], to->r[i]);
    }
    for (i = 0; i < w->columns; ++i) {
        to->u[i] = SELECT(where, from->u[i], to->u[i]);
    }
}

static void take_slopes(const task *w, Mask where, point *to, const point *from)
{
    int i;
    for (i = 0; i < N * w->columns; ++i) {
        to->J[i] = SELECT(where, from->J[i], to->J[i]);
    }
}

/*
 * Levenberg and Marquardt's steps from at->u, projected on the bounds, in lanes of `active`: the normal matrix is that of
 * the goal (N x N), not that of the controls. Ends when `wanted` lanes are there. Adds the steps of each lane to `used`.
 */
static void arrive(task *w, point *at, Mask active, int iterations, double enough, double damping, int wanted, int *used)
{
    V lambda = spread(damping);
    Mask better = active & ~active;
    int step, l;
    linearise(w, at);
    for (step = 0; step < iterations; ++step) {
        const Mask open = active & LESS(spread(enough), at->size) & LESS(lambda, spread(1e8));
        int there = 0;
        for (l = 0; l < LANES; ++l) {
            there += LANE(at->size, l) <= enough;
        }
        if (!any(open) || there >= wanted) {
            return;
        }
        if (2 * there >= LANES && iterations > PATIENCE * (step + 1)) {
            iterations = PATIENCE * (step + 1); /* enough to go on with: nobody waits for ever for a start that stalls */
        }
        if (any(better)) { /* not before: the last steps need no derivative, nor do those that fail */
            differentiate(w, &w->trial);
            take_slopes(w, better, at, &w->trial);
        }
        damped_step(w, at, lambda, w->trial.u);
        examine(w, &w->trial);
        better = open & LESS(w->trial.size, at->size);
        take(w, better, at, &w->trial);
        lambda = SELECT(better, largest(0.2 * lambda, spread(1e-13)), 6.0 * lambda);
        for (l = 0; l < LANES; ++l) {
            used[l] += LANE(open, l) != 0;
        }
    }
}

/*
 * Undamped steps that bring controls near the goal back to it, in lanes of `active`, with the derivative J that is known nearby: it is kept as
 * long as it gets there in three more steps, since a residual alone costs a third; where the residual does not fall with a new
 * derivative, a lane gives up. Leaves no derivative.
 */
static void restore(task *w, point *at, const V *J, Mask active)
{
    int step, i, c, fresh = 0;
    memcpy(at->J, J, (size_t)N * w->columns * sizeof *J);
    examine(w, at);
    if (any(active & LESS(spread(NEARBY), at->size))) {
        differentiate(w, at);
        fresh = 1;
    }
    for (step = 0; step < RESTORE; ++step) {
        const Mask open = active & LESS(spread(w->p->enough), at->size);
        Mask better;
        V rate;
        int slow;
        if (!any(open)) {
            break;
        }
        damped_step(w, at, spread(1e-9), w->trial.u);
        examine(w, &w->trial);
        better = open & LESS(w->trial.size, at->size);
        rate = w->trial.size / at->size;
        slow = any(open & NOT(LESS(w->trial.size * rate * rate * rate, spread(w->p->enough))));
        active &= NOT(open) | better | (fresh ? NOT(open) : open);
        at->size = SELECT(better, w->trial.size, at->size);
        for (i = 0; i < N; ++i) {
            at->r[i] = SELECT(better, w->trial.r[i], at->r[i]);
        }
        for (c = 0; c < w->columns; ++c) {
            at->u[c] = SELECT(better, w->trial.u[c], at->u[c]);
        }
        fresh = slow;
        if (slow && any(open & NOT(better))) {
            linearise(w, at);
        } else if (slow) {
            differentiate(w, at); /* the trial was at the same controls, in all lanes that still move */
        }
    }
}

/* Energy 1/2 sum w u^2, or fuel sum w |u|; every slot counts by its length. */
static V objective(const task *w, const V *u)
{
    const programme *p = w->p;
    V sum = spread(0.0);
    int c;
    for (c = 0; c < w->columns; ++c) {
        const double scale = p->mass[c / M] * p->weight[c];
        sum += p->fuel ? scale * largest(u[c], -u[c]) : 0.5 * scale * u[c] * u[c];
    }
    return sum;
}

/* The controls that belong to the multipliers y, which of them are free to move (f: by how much), and what J v misses. */
static void primal(task *w, const point *at, V rho, const V *y, const V *want, V *v, V *F)
{
    const programme *p = w->p;
    const V zero = {0.0}, inverse = 1.0 / rho;
    int c, row;
    transposed(w, at->J, y, w->z);
    for (c = 0; c < w->columns; ++c) {
        const double per = 1.0 / p->mass[c / M];
        const V low = spread(p->low[c]), high = spread(p->high[c]);
        V value, rate;
        if (p->fuel) { /* w |v| + rho/2 (v - s)^2 is least at s drawn towards zero by w / rho, and at zero where s is nearer than that */
            const V s = at->u[c] + per * inverse * w->z[c], t = p->weight[c] * inverse;
            value = SELECT(LESS(t, s), s - t, SELECT(LESS(s, -t), s + t, zero));
            rate = SELECT(LESS(t, s) | LESS(s, -t), inverse, zero);
        } else {
            rate = 1.0 / (p->weight[c] + rho);
            value = (per * w->z[c] + rho * at->u[c]) * rate;
        }
        /* dv/dy: none at a bound. There and at the corners of |v| the derivative is one of several, which semismooth Newton allows. */
        w->f[c] = SELECT(LESS(low, value) & LESS(value, high), per * rate, zero);
        v[c] = least(largest(value, low), high);
    }
    times(w, at->J, v, F);
    for (row = 0; row < N; ++row) {
        F[row] -= want[row];
    }
}

static V length(const V *F)
{
    V sum = spread(0.0);
    int i;
    for (i = 0; i < N; ++i) {
        sum += F[i] * F[i];
    }
    return root(sum);
}

/*
 * min objective(v) + rho/2 |v - u|^2 over the bounds with J v = J u - r, by semismooth Newton's method on the dual: N unknowns
 * y, whatever the number of controls. The step is halved until the equations' residual falls.
 */
static void proximal(task *w, const point *at, V rho, V *y, V *v)
{
    const programme *p = w->p;
    V want[N], F[N], trace = spread(0.0), norm;
    int c, i, round, half;
    times(w, at->J, at->u, want);
    for (i = 0; i < N; ++i) {
        want[i] -= at->r[i];
    }
    for (i = 0; i < N; ++i) {
        for (c = 0; c < w->columns; ++c) {
            const V entry = at->J[(size_t)i * w->columns + c];
            trace += (1.0 / p->mass[c / M]) * entry * entry;
        }
    }
    primal(w, at, rho, y, want, v, F);
    norm = length(F);
    for (round = 0; round < 30; ++round) {
        V A[PACKED], inverse[N], step[N], t = spread(1.0);
        Mask open = LESS(spread(1e-13), norm), moved = open ^ open;
        if (!any(open)) {
            return;
        }
        gram(w, at->J, w->f, w->t, A);
        for (i = 0; i < N; ++i) {
            A[i * (i + 1) / 2 + i] += 1e-10 * trace + 1e-300;
            step[i] = -F[i];
        }
        factor(A, inverse);
        substitute(A, inverse, step);
        for (half = 0; half < 8 && any(open); ++half) {
            V other[N], G[N], found;
            Mask falls;
            for (i = 0; i < N; ++i) {
                other[i] = y[i] + SELECT(open, t, spread(0.0)) * step[i];
            }
            primal(w, at, rho, other, want, v, G);
            found = length(G);
            falls = open & LESS(found, norm);
            for (i = 0; i < N; ++i) {
                y[i] = SELECT(falls, other[i], y[i]);
                F[i] = SELECT(falls, G[i], F[i]);
            }
            norm = SELECT(falls, found, norm);
            moved |= falls;
            open &= NOT(falls);
            t *= 0.5;
        }
        primal(w, at, rho, y, want, v, F); /* f and v of the y that was kept, in every lane */
        if (!any(moved)) {
            return;
        }
    }
}

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
