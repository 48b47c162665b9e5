/* Steps towards the goal, and steps that make the controls cheaper while they stay there: of direct_core.c. */
#ifndef DIRECT_STEPS_H
#define DIRECT_STEPS_H

#include "direct_chain.h"

enum {
    FACES = 4,     /* times that a step is taken again without the controls it would push out of the bounds */
    PATIENCE = 4,  /* steps that all may take, in units of those after which half of the group is there */
    RESTORE = 30   /* most steps back to the goal; fewer than ten where that can be done at all */
};
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

/* Vectors in which `count` starts of a group lie. */
static int packs_of(int count)
{
    return (count + LANES - 1) / LANES;
}

/*
 * Levenberg and Marquardt's steps from the `at` of each of a group's `count` starts, projected on the bounds: the normal matrix is that of
 * the goal (N x N), not that of the controls. Ends when as many as are wanted are there. Adds the steps of each to `used`.
 */
static void arrive(task *w, int count, int *used)
{
    const programme *p = w->p;
    const int packs = packs_of(count);
    V lambda[PACKS];
    Mask better[PACKS];
    int iterations = p->reach_iterations, step, k, l;
    for (k = 0; k < PACKS; ++k) {
        lambda[k] = spread(p->damping);
        better[k] = LESS(lambda[k], lambda[k]);
    }
    for (k = 0; k < packs; ++k) {
        linearise(w + k, &w[k].at);
    }
    for (step = 0; step < iterations; ++step) {
        Mask open[PACKS];
        int there = 0, busy = 0;
        for (k = 0; k < packs; ++k) {
            open[k] = LESS(spread(p->enough), w[k].at.size) & LESS(lambda[k], spread(1e8));
            busy |= any(open[k]);
        }
        for (l = 0; l < GROUP; ++l) { /* the last start counts for those that are missing */
            const int from = l < count ? l : count - 1;
            there += LANE(w[from / LANES].at.size, from % LANES) <= p->enough;
        }
        if (!busy || there >= p->wanted) {
            return;
        }
        if (2 * there >= GROUP && iterations > PATIENCE * (step + 1)) {
            iterations = PATIENCE * (step + 1); /* enough to go on with: nobody waits for ever for a start that stalls */
        }
        for (k = 0; k < packs; ++k) {
            task *const own = w + k;
            if (!any(open[k])) {
                continue;
            }
            if (any(better[k])) { /* not before: the last steps need no derivative, nor do those that fail */
                differentiate(own, &own->trial);
                take_slopes(own, better[k], &own->at, &own->trial);
            }
            damped_step(own, &own->at, lambda[k], own->trial.u);
            examine(own, &own->trial);
            better[k] = open[k] & LESS(own->trial.size, own->at.size);
            take(own, better[k], &own->at, &own->trial);
            lambda[k] = SELECT(better[k], largest(0.2 * lambda[k], spread(1e-13)), 6.0 * lambda[k]);
            for (l = 0; l < LANES; ++l) {
                used[k * LANES + l] += LANE(open[k], l) != 0;
            }
        }
    }
}

/*
 * Undamped steps that bring the controls `at` near the goal back to it, in lanes of `active`, with the derivative that is `kept` nearby: it
 * serves as long as all of a group get there in three more steps, since a residual alone costs a third; where the residual does not fall with
 * a new derivative, a lane gives up. Leaves no derivative.
 */
static void restore(task *w, int packs, const Mask *active)
{
    Mask trusted[PACKS], open[PACKS], better[PACKS];
    int step, i, k, c, fresh = 0;
    memcpy(trusted, active, sizeof trusted);
    for (k = 0; k < packs; ++k) {
        if (any(active[k])) {
            memcpy(w[k].at.J, w[k].kept.J, (size_t)N * w->columns * sizeof *w->at.J);
            examine(w + k, &w[k].at);
            fresh |= any(active[k] & LESS(spread(NEARBY), w[k].at.size));
        }
    }
    for (k = 0; k < packs && fresh; ++k) {
        if (any(active[k])) {
            differentiate(w + k, &w[k].at);
        }
    }
    for (step = 0; step < RESTORE; ++step) {
        int slow = 0, busy = 0;
        for (k = 0; k < packs; ++k) {
            task *const own = w + k;
            point *const at = &own->at;
            V rate;
            open[k] = trusted[k] & LESS(spread(own->p->enough), at->size);
            if (!any(open[k])) {
                continue;
            }
            busy = 1;
            damped_step(own, at, spread(1e-9), own->trial.u);
            examine(own, &own->trial);
            better[k] = open[k] & LESS(own->trial.size, at->size);
            rate = own->trial.size / at->size;
            slow |= any(open[k] & NOT(LESS(own->trial.size * rate * rate * rate, spread(own->p->enough))));
            trusted[k] &= NOT(open[k]) | better[k] | (fresh ? NOT(open[k]) : open[k]);
            at->size = SELECT(better[k], own->trial.size, at->size);
            for (i = 0; i < N; ++i) {
                at->r[i] = SELECT(better[k], own->trial.r[i], at->r[i]);
            }
            for (c = 0; c < own->columns; ++c) {
                at->u[c] = SELECT(better[k], own->trial.u[c], at->u[c]);
            }
        }
        if (!busy) {
            break;
        }
        fresh = slow;
        for (k = 0; k < packs && slow; ++k) {
            if (any(open[k] & NOT(better[k]))) {
                linearise(w + k, &w[k].at);
            } else if (any(open[k])) {
                differentiate(w + k, &w[k].at); /* the trial was at the same controls, in all lanes that still move */
            }
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

#endif
