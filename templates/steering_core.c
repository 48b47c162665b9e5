/* SPDX-License-Identifier: MIT-0 */
/*
 * Minimum-energy steering by shooting on the Lie-Poisson equations: GROUP starts side by side, in vectors of doubles where the
 * compiler has them. What belongs to one group and its controls (sizes, brackets, flows, names of the functions) stands in
 * steering_problem.h; what the functions do is said in the header that it includes.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "steering_problem.h"

/*
 * GROUP starts go on together and decide together when to stop, in as many vectors of LANES as that takes, so that the answers do not
 * depend on LANES; LIE_CODEGEN_ONE_LANE saves memory by groups of one.
 */
#if defined(LIE_CODEGEN_ONE_LANE)
#define GROUP 1
#else
#define GROUP 8
#endif

enum {
    PACKS = GROUP / LANES, /* vectors of a group */
    WAVE = 2 * SEED_STEPS - 1,
    FLOW = N + SIZE, /* mu and X */
    ROWS = 8,        /* of the extrapolation: order 16 */
    MOST_STEPS = 64, /* extrapolated steps */
    MOST_NODES = 128, /* Runge-Kutta steps */
    KEPT = 8 /* candidates kept for polishing */
};

/*
 * One step h of (mu, X), y[N + SIZE], by the modified midpoint rule with 2, 4, ... 2 ROWS substeps, extrapolated in the
 * square of the substep (Gragg, Bulirsch and Stoer): order 2 ROWS. Adds up the largest differences, in any lane, of the
 * last two extrapolations.
 */
static void extrapolated_step(const V *inverse_weights, double h, V *y, double *error)
{
    V table[ROWS][FLOW], other[FLOW], v[M], largest;
    double worst = 0.0;
    int row, s, i, l, column;
    for (row = 0; row < ROWS; ++row) {
        const int substeps = 2 * (row + 1);
        V *here = table[row], *before = other;
        for (i = 0; i < M; ++i) {
            v[i] = (h / substeps) * inverse_weights[i];
        }
        memcpy(before, y, sizeof other);
        leap(v, y, y + N, y, y + N, here, here + N);
        for (i = 0; i < M; ++i) {
            v[i] *= 2.0;
        }
        for (s = 1; s < substeps; s += 2) {
            leap(v, before, before + N, here, here + N, before, before + N);
            if (s + 1 < substeps) {
                leap(v, here, here + N, before, before + N, here, here + N);
            }
        }
        memcpy(here, before, sizeof other);
        /* With an even number of substeps the rule's error has even powers of the substep alone: each column takes the next one away. */
        for (column = row - 1; column >= 0; --column) {
            const double ratio = (double)(row + 1) / (column + 1);
            const double factor = 1.0 / (ratio * ratio - 1.0);
            for (i = 0; i < FLOW; ++i) {
                table[column][i] = table[column + 1][i] + factor * (table[column + 1][i] - table[column][i]);
            }
        }
    }
    fill(&largest, 1, 0.0);
    for (i = 0; i < FLOW; ++i) {
        const V difference = table[0][i] - table[1][i];
        const V size = SELECT(LESS(difference, -difference), -difference, difference);
        largest = SELECT(LESS(largest, size), size, largest);
    }
    for (l = 0; l < LANES; ++l) {
        worst = fmax(worst, LANE(largest, l));
    }
    *error += worst;
    memcpy(y, table[0], sizeof other);
}

/* X(1) from mu(0), nearly to rounding: the number of steps doubles until the estimate is negligible. */
static void integrate(const V *inverse_weights, const V *mu0, int *steps, V *X1)
{
    V y[FLOW];
    double error;
    int s, i;
    for (;; *steps *= 2) {
        error = 0.0;
        memcpy(y, mu0, N * sizeof *y);
        for (i = 0; i < SIZE; ++i) {
            fill(y + N + i, 1, identity[i]);
        }
        for (s = 0; s < *steps && (error < 1e-11 || 2 * *steps > MOST_STEPS); ++s) {
            extrapolated_step(inverse_weights, 1.0 / *steps, y, &error);
        }
        if (error < 1e-11 || 2 * *steps > MOST_STEPS) {
            memcpy(X1, y + N, SIZE * sizeof *y);
            return;
        }
    }
}

/*
 * What a lane is to solve. Directions that take brackets of l controls move like r^l under controls of size r, and their
 * costates like r^(2 - l): with r the size of the target so measured (at most 1) all unknowns and all errors are of
 * order one, whatever the target's size.
 */
typedef struct {
    V inverse_weights[M];
    V target[SIZE];
    V column[N]; /* r^(2 - l): mu(0)_k = column_k p_k */
    V row[N];    /* r^(-2 l): of the squared coordinates of the error */
    V size;      /* r */
    V radius;    /* the same, neither bounded below nor above */
    V graded;    /* 1: the error in coordinates so scaled (small targets), 0: in the entries of X */
    V floor;     /* the square of the graded error that rounding leaves */
    struct workspace *space;
} problem;

/* Sets one start of the group to the size r. */
static void set_size(problem *task, int l, double r)
{
    const double least = pow(1e-11, 1.0 / (double)DEPTH);
    double power[DEPTH + 1];
    int k;
    task += l / LANES;
    l %= LANES;
    LANE(task->radius, l) = r;
    r = r < 1.0 ? (r > least ? r : least) : 1.0;
    power[0] = 1.0;
    for (k = 1; k <= DEPTH; ++k) {
        power[k] = power[k - 1] * r;
    }
    for (k = 0; k < N; ++k) {
        LANE(task->column[k], l) = r * r / power[length_of[k]];
        LANE(task->row[k], l) = 1.0 / (power[length_of[k]] * power[length_of[k]]);
    }
    LANE(task->size, l) = r;
    LANE(task->graded, l) = r < 0.3 ? 1.0 : 0.0;
    LANE(task->floor, l) = 1e-28 / (power[DEPTH] * power[DEPTH]);
}

typedef struct {
    V F;         /* the square of the error */
    V E;         /* |X(1) - target|^2 */
    V Z;         /* the part of E along the group, or F if graded */
    V p[N];      /* mu(0)_k / column_k */
    V g[N];      /* half the gradient of F */
    V z[N];      /* coordinates of what is missing at the end, by least squares */
    V H[N * N];  /* Gauss-Newton matrix, lower triangle */
    V xi[N][N];  /* xi[c]: vee(X^-1 dX(1) / dp_c) */
} point;

/* Extremals found for one target, the cheapest first, and the target's size. */
typedef struct {
    int count;
    int ended[KEPT]; /* starts that ended there */
    int loose[KEPT]; /* 1: near the target, but not on it: a long valley, or a dead end */
    double energy[KEPT];
    double p[KEPT][N];
    double size;
} candidates;

/* All that is large: the caller's, or on the stack of the function that is called. */
typedef struct workspace {
    union { /* of one vector of starts after the other */
        V mu[MOST_NODES + 1][N];            /* of an extremal, while its end is differentiated */
        V column[2 * SEED_STEPS + 1][N][N]; /* costates along a path of given controls, before that */
    } along;
    V u[PACKS][2 * SEED_STEPS + 1][M];      /* first guesses */
    V change[PACKS][2 * SEED_STEPS + 1][M]; /* of them, by relaxing */
    point at[PACKS], next[PACKS];
    candidates list[GROUP];
} workspace;

/* The header's size holds it wherever the memory begins; a negative size does not compile. */
typedef char workspace_has_room[STEERING_WORKSPACE >= sizeof(workspace) + sizeof(V) ? 1 : -1];

/*
 * s = -(H + lambda D)^-1 g by L D L^T; D is the mean of H's diagonal (Levenberg), which finds the global minimum of a large
 * manoeuvre more often, or that diagonal (Marquardt). Only the lower triangle of H is read.
 */
static void damped_step(const V *H, const V *g, const V *lambda, int scaled, V *s)
{
    V A[N * N], d[N], inverse[N], shift;
    int i, j, k;
    shift = H[0];
    for (i = 1; i < N; ++i) {
        shift += H[i * N + i];
    }
    shift = shift * ((scaled ? 1e-8 : 1.0) / (double)N) * lambda[0] + 1e-300;
    for (i = 0; i < N; ++i) {
        for (j = 0; j <= i; ++j) {
            V sum = H[i * N + j];
            for (k = 0; k < j; ++k) {
                sum -= A[i * N + k] * A[j * N + k] * d[k];
            }
            if (j < i) {
                A[i * N + j] = sum * inverse[j];
            } else {
                d[i] = scaled ? sum + lambda[0] * H[i * N + i] + shift : sum + shift;
                inverse[i] = 1.0 / d[i];
            }
        }
    }
    for (i = 0; i < N; ++i) {
        s[i] = -g[i];
        for (k = 0; k < i; ++k) {
            s[i] -= A[i * N + k] * s[k];
        }
    }
    for (i = N - 1; i >= 0; --i) {
        s[i] *= inverse[i];
        for (k = i + 1; k < N; ++k) {
            s[i] -= A[k * N + i] * s[k];
        }
    }
}

/* X(1) and xi of the extremal of p: `steps` Runge-Kutta steps for mu and X, half as many for the sensitivities. */
static void tangent(const problem *task, int steps, const V *p, V *X, V (*xi)[N])
{
    V(*mu)[N] = task->space->along.mu, v[M], psi[N];
    int i, c, s;
    for (i = 0; i < N; ++i) {
        mu[0][i] = task->column[i] * p[i];
    }
    for (i = 0; i < M; ++i) {
        v[i] = (1.0 / steps) * task->inverse_weights[i];
    }
    for (i = 0; i < SIZE; ++i) {
        fill(X + i, 1, identity[i]);
    }
    for (s = 0; s < steps; ++s) {
        flow_step(v, mu[s], X, mu[s + 1], X);
    }
    for (i = 0; i < M; ++i) {
        v[i] *= 2.0;
    }
    for (c = 0; c < N; ++c) {
        fill(psi, N, 0.0);
        fill(xi[c], N, 0.0);
        psi[c] = task->column[c];
        for (s = 0; s < steps; s += 2) {
            column_step(v, mu[s], mu[s + 1], mu[s + 2], psi, xi[c], psi, xi[c]);
        }
    }
}

/* How at->xi is found. */
typedef enum {
    KNOWN, /* it stands there */
    PLAIN, /* by Runge-Kutta steps */
    FINE   /* by the most steps there are, extrapolated */
} slopes;

/* F and its linearisation at at->p, X(1) by Runge-Kutta steps, or nearly to rounding in `*exact` extrapolated steps if given. */
static void linearise(const problem *task, int steps, int *exact, slopes kind, point *at)
{
    V X[SIZE], q[N], G[N * N], Gx[N], graded, zero;
    Mask mask;
    int a, b, k, j, any = 0;
    if (kind == PLAIN) {
        tangent(task, steps, at->p, X, at->xi);
    }
    if (kind == FINE) {
        V coarse[N][N];
        tangent(task, MOST_NODES / 2, at->p, X, coarse);
        tangent(task, MOST_NODES, at->p, X, at->xi);
        /* Steps of order four: of two runs the finer, with steps half as long, errs by a fifteenth of their difference. */
        for (a = 0; a < N; ++a) {
            for (k = 0; k < N; ++k) {
                at->xi[a][k] += (1.0 / 15.0) * (at->xi[a][k] - coarse[a][k]);
            }
        }
    }
    if (exact != NULL) {
        V mu[N];
        for (k = 0; k < N; ++k) {
            mu[k] = task->column[k] * at->p[k];
        }
        integrate(task->inverse_weights, mu, exact, X);
    }
    endpoint(task->target, X, &at->E, q, G);
    at->F = at->E;
    for (k = 0; k < LANES; ++k) {
        any |= LANE(task->graded, k) > 0.0;
    }
    fill(&zero, 1, 0.0);
    /* Z = q'G^-1 q is what a motion of the end along the group could take from E, to first order; the rest lies across the group. */
    damped_step(G, q, &zero, 0, at->z);
    at->Z = zero;
    for (k = 0; k < N; ++k) {
        at->Z -= q[k] * at->z[k];
    }
    if (any) { /* F = sum row z^2; z is what is missing, so that it falls by xi dp where the end moves by that, to first order */
        mask = LESS(zero, task->graded);
        graded = zero;
        for (k = 0; k < N; ++k) {
            graded += task->row[k] * at->z[k] * at->z[k];
            q[k] = SELECT(mask, -task->row[k] * at->z[k], q[k]);
            for (j = 0; j < N; ++j) {
                G[k * N + j] = SELECT(mask, k == j ? task->row[k] : zero, G[k * N + j]);
            }
        }
        at->F = SELECT(mask, graded, at->E);
        at->Z = SELECT(mask, graded, at->Z);
    }
    for (a = 0; a < N; ++a) {
        at->g[a] = q[0] * at->xi[a][0];
        for (k = 1; k < N; ++k) {
            at->g[a] += q[k] * at->xi[a][k];
        }
        for (k = 0; k < N; ++k) {
            Gx[k] = G[k * N] * at->xi[a][0];
            for (j = 1; j < N; ++j) {
                Gx[k] += G[k * N + j] * at->xi[a][j];
            }
        }
        for (b = 0; b <= a; ++b) {
            V sum = Gx[0] * at->xi[b][0];
            for (k = 1; k < N; ++k) {
                sum += Gx[k] * at->xi[b][k];
            }
            at->H[a * N + b] = sum;
        }
    }
}

static void take(const Mask *where, point *to, const point *from)
{
    const Mask mask = *where;
    int i, j;
    to->F = SELECT(mask, from->F, to->F);
    to->E = SELECT(mask, from->E, to->E);
    to->Z = SELECT(mask, from->Z, to->Z);
    for (i = 0; i < N; ++i) {
        to->p[i] = SELECT(mask, from->p[i], to->p[i]);
        to->g[i] = SELECT(mask, from->g[i], to->g[i]);
        to->z[i] = SELECT(mask, from->z[i], to->z[i]);
        for (j = 0; j < N; ++j) {
            to->H[i * N + j] = SELECT(mask, from->H[i * N + j], to->H[i * N + j]);
            to->xi[i][j] = SELECT(mask, from->xi[i][j], to->xi[i][j]);
        }
    }
}

/*
 * Newton's step, xi s = z, by elimination with the largest pivots first: near a conjugate point one direction of p moves
 * the end a million times less than the others, and normal equations do not see it. Each unknown is at most `most`,
 * the weakest first, so that the others follow what is left of it. After a long step along a weak direction the next one
 * leaves it alone (`settle`), so that what is left over is its own.
 */
static void newton_step(const problem *task, const point *at, const V *most, int *settle, V *s)
{
    double A[N][N + 1];
    int l, i, j, k, far, unknown[N];
    for (l = 0; l < LANES; ++l) {
        for (i = 0; i < N; ++i) {
            const double scale = sqrt(LANE(task->row[i], l));
            unknown[i] = i;
            for (j = 0; j < N; ++j) {
                A[i][j] = scale * LANE(at->xi[j][i], l);
            }
            A[i][N] = scale * LANE(at->z[i], l);
        }
        for (k = 0; k < N; ++k) {
            int row = k, column = k, kept;
            for (i = k; i < N; ++i) {
                for (j = k; j < N; ++j) {
                    if (fabs(A[i][j]) > fabs(A[row][column])) {
                        row = i;
                        column = j;
                    }
                }
            }
            for (j = 0; j <= N; ++j) {
                const double other = A[k][j];
                A[k][j] = A[row][j];
                A[row][j] = other;
            }
            for (i = 0; i < N; ++i) {
                const double other = A[i][k];
                A[i][k] = A[i][column];
                A[i][column] = other;
            }
            kept = unknown[k];
            unknown[k] = unknown[column];
            unknown[column] = kept;
            for (i = k + 1; i < N && A[k][k] != 0.0; ++i) {
                const double factor = A[i][k] / A[k][k];
                for (j = k; j <= N; ++j) {
                    A[i][j] -= factor * A[k][j];
                }
            }
        }
        far = 0;
        for (i = N - 1; i >= 0; --i) {
            const double bound = LANE(*most, l);
            const int weak = fabs(A[i][i]) < 0.03 * fabs(A[0][0]);
            double sum = A[i][N];
            for (j = i + 1; j < N; ++j) {
                sum -= A[i][j] * LANE(s[unknown[j]], l);
            }
            sum = A[i][i] == 0.0 || (weak && settle[l]) ? 0.0 : sum / A[i][i];
            far |= weak && fabs(sum) > 0.05 * bound;
            LANE(s[unknown[i]], l) = sum > bound ? bound : sum < -bound ? -bound : sum;
        }
        settle[l] = far;
    }
}

/* When and where Levenberg-Marquardt stops. */
typedef struct {
    int steps;     /* Runge-Kutta steps, even */
    int *exact;    /* (PACKS) extrapolated steps, or NULL: the coarse grid alone */
    int most;      /* iterations */
    double enough; /* coarse: decrease of F that is still predicted; exact: F, if not graded */
    double near;   /* coarse: F; exact: E */
    int wanted;    /* starts */
    int scaled;    /* Marquardt's damping */
} rules;

/* Whether one of the starts of that vector has something to do. */
static int has_own(const int *own, int k)
{
    int l, found = 0;
    for (l = 0; l < LANES; ++l) {
        found |= own[k * LANES + l];
    }
    return found;
}

/*
 * Levenberg-Marquardt in every lane, from at->p; returns the number of linearisations. On the coarse grid a start is done
 * when F is below `near`, its part along the group well below, and the decrease that is still predicted below `enough` (X
 * is not quite on the group there, so F itself does not vanish); on the exact flow when F is. It stops when `wanted` starts are done, or all
 * are done or stalled, and after `most` iterations at the latest. Nobody waits for starts that are not `own`.
 */
static int descend(const problem *task, const rules *rule, const int *own, point *at, int *done)
{
    point *const next = task->space->next;
    V lambda[PACKS], bound[PACKS], clip[PACKS], scale[PACKS], s[PACKS][N], zero;
    slopes kind = PLAIN;
    int iteration, i, k, l, settle[GROUP] = {0};
    fill(lambda, PACKS, rule->exact == NULL ? 1e-2 : 1e-12);
    fill(bound, PACKS, 1e-2);
    fill(clip, PACKS, 0.3);
    fill(scale, PACKS, 0.0);
    fill(&zero, 1, 0.0);
    memset(next, 0, PACKS * sizeof *next);
    memset(done, 0, GROUP * sizeof *done);
    for (k = 0; k < PACKS; ++k) {
        if (has_own(own, k)) {
            linearise(task + k, rule->steps, rule->exact == NULL ? NULL : rule->exact + k, kind, at + k);
        }
    }
    for (iteration = 0;; ++iteration) {
        const int bold = rule->exact != NULL && iteration >= 6 && 4 * iteration < 3 * rule->most;
        const int afresh = bold && kind != FINE;
        double open = 0.0;
        int busy = 0, finished = 0;
        for (k = 0; k < PACKS; ++k) {
            V reach = zero, most = zero, size = zero, decrease = zero;
            if (!has_own(own, k)) {
                continue;
            }
            for (i = 0; i < N; ++i) {
                reach += at[k].p[i] * at[k].p[i];
            }
            for (l = 0; l < LANES; ++l) {
                LANE(most, l) = LANE(clip[k], l) * sqrt(LANE(reach, l));
            }
            if (afresh) {
                linearise(task + k, rule->steps, rule->exact + k, FINE, at + k);
            }
            if (bold) {
                newton_step(task + k, at + k, &most, settle + k * LANES, s[k]);
            } else {
                damped_step(at[k].H, at[k].g, lambda + k, rule->scaled, s[k]);
            }
            for (i = 0; i < N; ++i) {
                size += s[k][i] * s[k][i];
                decrease -= s[k][i] * at[k].g[i];
            }
            for (l = 0; l < LANES; ++l) {
                const double F = LANE(at[k].F, l);
                const double far = 1.0 + 0.5 * sqrt(LANE(reach, l));
                const double length = sqrt(LANE(size, l));
                const int mine = own[k * LANES + l];
                int there;
                if (rule->exact == NULL) {
                    there = LANE(decrease, l) <= rule->enough && F <= rule->near && LANE(at[k].Z, l) <= 0.1 * rule->near;
                } else {
                    there = F <= (LANE(task[k].graded, l) > 0.0 ? 1e-20 + LANE(task[k].floor, l) : rule->enough)
                        && LANE(at[k].E, l) <= rule->near;
                }
                done[k * LANES + l] = there;
                finished += mine && there;
                if (mine && !there && (bold || LANE(lambda[k], l) < MOST_DAMPING)) {
                    ++busy;
                    open = fmax(open, F);
                }
                LANE(scale[k], l) = length > far ? far / length : 1.0;
            }
        }
        if (busy == 0 || finished >= rule->wanted || iteration == rule->most) {
            return iteration + 1;
        }
        /* near the end the last Jacobian serves, but not twice */
        kind = bold ? FINE : rule->exact != NULL && kind != KNOWN && open < 1e-10 ? KNOWN : PLAIN;
        for (k = 0; k < PACKS; ++k) {
            Mask better;
            if (!has_own(own, k)) {
                continue;
            }
            for (i = 0; i < N; ++i) {
                next[k].p[i] = at[k].p[i] + scale[k] * s[k][i];
            }
            if (kind == KNOWN) {
                memcpy(next[k].xi, at[k].xi, sizeof next[k].xi);
            }
            linearise(task + k, rule->steps, rule->exact == NULL ? NULL : rule->exact + k, kind, next + k);
            better = LESS(next[k].F, bold ? bound[k] : at[k].F);
            for (l = 0; l < LANES; ++l) {
                const double gain = LANE(next[k].F, l) / LANE(at[k].F, l);
                if (bold) {
                    if (LANE(next[k].F, l) < LANE(bound[k], l)) {
                        LANE(clip[k], l) = fmin(0.3, 1.5 * LANE(clip[k], l));
                    } else {
                        LANE(clip[k], l) *= 0.3;
                        settle[k * LANES + l] = 0;
                    }
                } else if (gain < 1.0) {
                    LANE(lambda[k], l) *= gain < 0.25 ? 0.05 : gain < 0.75 ? 0.3 : 1.0;
                } else {
                    LANE(lambda[k], l) = fmax(LANE(lambda[k], l) * 8.0, 1e-8);
                }
            }
            take(&better, at + k, next + k);
        }
    }
}

/* Uniform in [-1, 1], the same for the same start on every machine (xorshift64*). */
static double uniform(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return (double)((*state * UINT64_C(2685821657736338717)) >> 11) / 4503599627370496.0 - 1.0;
}

/*
 * Coordinates of the target's logarithm, the shortest that is found from a guess in each lane of a group; near enough for a first
 * guess of controls. First order where none is found.
 */
static void logarithm(const V *target, V *x)
{
    V Y[SIZE], theta[N], delta[N], back[N], far;
    uint64_t state = UINT64_C(0x9E3779B97F4A7C15);
    double guess[N][GROUP], best[N], shortest = HUGE_VAL;
    int iteration, i, k, l, part;
    offset(target, delta);
    /* Not from 0: half a turn has no first-order offset there. */
    for (i = 0; i < N; ++i) {
        best[i] = LANE(delta[i], 0) + 0.5 * (1.0 + i) / (double)N;
        guess[i][0] = 0.05 * (1.0 + i) / (double)N;
        for (l = 1; l < GROUP; ++l) {
            guess[i][l] = 2.0 * uniform(&state);
        }
    }
    for (k = 0; k < PACKS; ++k) {
        for (i = 0; i < N; ++i) {
            fill(x + i, 1, 0.0);
            for (l = 0; l < LANES; ++l) {
                LANE(x[i], l) = guess[i][k * LANES + l];
            }
        }
        for (iteration = 0; iteration < 6; ++iteration) {
            memcpy(Y, target, sizeof Y);
            for (i = 0; i < N; ++i) {
                theta[i] = -0.25 * x[i];
            }
            for (part = 0; part < 4; ++part) {
                advance(Y, theta, Y);
            }
            offset(Y, delta);
            for (i = 0; i < N; ++i) {
                delta[i] = -delta[i];
                back[i] = -x[i];
            }
            correction(back, delta, theta);
            for (i = 0; i < N; ++i) {
                x[i] = -theta[i];
            }
        }
        fill(&far, 1, 0.0);
        for (i = 0; i < SIZE; ++i) {
            const V difference = Y[i] - identity[i];
            far += difference * difference;
        }
        for (l = 0; l < LANES; ++l) {
            double size = 0.0;
            for (i = 0; i < N; ++i) {
                size += LANE(x[i], l) * LANE(x[i], l);
            }
            if (size < 0.999 * shortest && size < 400.0 && LANE(far, l) < 0.01) {
                shortest = size;
                for (i = 0; i < N; ++i) {
                    best[i] = LANE(x[i], l);
                }
            }
        }
    }
    for (i = 0; i < N; ++i) {
        fill(x + i, 1, best[i]);
    }
}

/*
 * Controls of the area rule in every lane, start number first + lane: a straight part, one circle a pair of controls with
 * its harmonic and the start's phase, and from the second round on random waves. Dear controls move less: circles are
 * ellipses of the same area.
 */
static void area_rule(const problem *task, const V *x, int start, V (*u)[M])
{
    const int quarter = 3 * SEED_STEPS / 2;
    const double r = LANE(task->radius, 0);
    double ease[M];
    int t, i, l;
    int order[PAIRS + 1];
    double area[PAIRS + 1];
    int a, b;
    for (i = 0; i < M; ++i) {
        ease[i] = sqrt(LANE(task->inverse_weights[i], 0));
    }
    for (t = 0; t <= 2 * SEED_STEPS; ++t) {
        for (i = 0; i < M; ++i) {
            u[t][i] = x[control_of[i]];
        }
    }
    for (l = 0; l < LANES; ++l) {
        const int number = start + l;
        uint64_t state = UINT64_C(0x9E3779B97F4A7C15) * (uint64_t)(number + 1);
        double wave[M][4], size = 0.0;
        int phase = (SEED_STEPS / 4) * number;
        double stretch = 1.0;
        for (i = 0; i < N; ++i) {
            size += LANE(x[i], l) * LANE(x[i], l);
        }
        size = number < 8 * QUIET_ROUNDS ? 0.0 : WAVE_SIZE * (sqrt(size) + r);
        for (i = 0; i < M; ++i) {
            for (t = 0; t < 4; ++t) {
                wave[i][t] = size * uniform(&state) * 1.7 * ease[i];
            }
        }
        if (number >= 8) {
            phase += SEED_STEPS / 8;
            stretch = 1.0 + 0.5 * uniform(&state);
        }
        /* A circle of energy 4 pi |area| times its harmonic: the largest area goes round once, the next one twice ... */
        for (a = 0; a < PAIRS; ++a) {
            area[a] = 0.0;
            for (i = 0; i < N; ++i) {
                area[a] += area_of[a][i] * LANE(x[i], l);
            }
            for (b = a; b > 0 && fabs(area[order[b - 1]]) < fabs(area[a]); --b) {
                order[b] = order[b - 1];
            }
            order[b] = a;
        }
        for (b = 0; b < PAIRS; ++b) {
            const double size_of = area[order[b]];
            const int harmonic = b + 1, one = first_of[order[b]], two = second_of[order[b]];
            /* `harmonic` rounds of radius sqrt(area / (harmonic pi)); circles of unlike harmonics enclose no area with each other */
            const double w = 6.283185307179586 * harmonic;
            const double shape = sqrt(ease[one] / ease[two]);
            const double radius = stretch * sqrt(fabs(size_of) / (harmonic * 3.141592653589793)) * w;
            if (fabs(size_of) > 1e-9 * r * r) {
                for (t = 0; t <= 2 * SEED_STEPS; ++t) {
                    const int k = (harmonic * t + phase) & WAVE;
                    LANE(u[t][one], l) -= shape * radius * cosine[(k + 3 * SEED_STEPS / 2) & WAVE];
                    LANE(u[t][two], l) += (size_of > 0.0 ? radius : -radius) / shape * cosine[k];
                }
            }
        }
        for (t = 0; number >= 8 * QUIET_ROUNDS && t <= 2 * SEED_STEPS; ++t) {
            for (i = 0; i < M; ++i) {
                LANE(u[t][i], l) += wave[i][0] * cosine[t & WAVE] + wave[i][1] * cosine[(t + quarter) & WAVE]
                    + wave[i][2] * cosine[(2 * t) & WAVE] + wave[i][3] * cosine[(2 * t + quarter) & WAVE];
            }
        }
    }
}

/* The flow of every costate along the controls u, mu' = ad*_u mu, at all nodes: column[0][c] is column_c e_c. */
static void costates_along(const problem *task, V (*u)[M], V (*column)[N][N])
{
    V h[3][M];
    int t, c, i, a;
    fill(column[0][0], N * N, 0.0);
    for (c = 0; c < N; ++c) {
        column[0][c][c] = task->column[c];
    }
    for (t = 0; t < 2 * SEED_STEPS; t += 2) {
        for (i = 0; i < M; ++i) {
            for (a = 0; a < 3; ++a) {
                h[a][i] = (1.0 / (double)SEED_STEPS) * u[t + a][i];
            }
        }
        for (c = 0; c < N; ++c) {
            costate_step(h[0], h[1], h[2], column[t][c], column[t + 1][c], column[t + 2][c]);
        }
    }
}

/* The normal equations, H p = -g, of w_i u_i(t) = <mu(t), A_i>, which is linear in mu(0). */
static void normal_equations(const problem *task, V (*u)[M], V (*column)[N][N], V *H, V *g)
{
    int t, i, a, b;
    fill(H, N * N, 0.0);
    fill(g, N, 0.0);
    for (t = 0; t <= 2 * SEED_STEPS; t += 2) {
        const double share = (t == 0 || t == 2 * SEED_STEPS ? 0.5 : 1.0) / (double)SEED_STEPS;
        for (i = 0; i < M; ++i) {
            const V weight = share * task->inverse_weights[i], control = share * u[t][i];
            for (a = 0; a < N; ++a) {
                const V row = column[t][a][control_of[i]];
                g[a] -= row * control;
                for (b = 0; b <= a; ++b) {
                    H[a * N + b] += weight * row * column[t][b][control_of[i]];
                }
            }
        }
    }
}

/* The p whose extremal's controls are nearest to u. */
static void nearest_costate(const problem *task, V (*u)[M], V *p)
{
    V(*column)[N][N] = task->space->along.column, H[N * N], g[N], lambda;
    costates_along(task, u, column);
    normal_equations(task, u, column, H, g);
    fill(&lambda, 1, 1e-4);
    damped_step(H, g, &lambda, 0, p);
}

/* X(1) under the controls u. */
static void path_along(V (*u)[M], V *X)
{
    V h[3][M];
    int t, i, a;
    for (i = 0; i < SIZE; ++i) {
        fill(X + i, 1, identity[i]);
    }
    for (t = 0; t < 2 * SEED_STEPS; t += 2) {
        for (i = 0; i < M; ++i) {
            for (a = 0; a < 3; ++a) {
                h[a][i] = (1.0 / (double)SEED_STEPS) * u[t + a][i];
            }
        }
        path_step(h[0], h[1], h[2], X, X);
    }
}

/*
 * Gauss and Newton in the controls: the controls of least energy among those that, to first order, end at the target, are
 * u_i(t) = <mu(t), A_i> / w_i along the path as it is, and half a step is made towards them. Far more forgiving than
 * shooting where brackets of brackets are needed, and its fixed points are the extremals; p is their costate. Returns the share of `change`
 * to take; *open counts the starts that are not there yet.
 */
static V relaxing_step(const problem *task, V (*u)[M], V (*change)[M], V *p, int *open)
{
    V(*column)[N][N] = task->space->along.column, X[SIZE];
    V H[N * N], G[N * N], g[N], q[N], z[N], E, lambda, error, step, length;
    V zero = {0.0}, scale = {0.0};
    int t, c, i, l;
    costates_along(task, u, column);
    normal_equations(task, u, column, H, g);
    path_along(u, X);
    /* z: coordinates of the error at the end; what is missing, carried to the origin, is Ad_X(1) z */
    endpoint(task->target, X, &E, q, G);
    damped_step(G, q, &zero, 0, z);
    error = zero;
    for (i = 0; i < N; ++i) {
        error += task->row[i] * z[i] * z[i];
    }
    for (l = 0; l < LANES; ++l) {
        LANE(scale, l) = LANE(error, l) > 1.0 ? 1.0 / sqrt(LANE(error, l)) : 1.0;
    }
    for (c = 0; c < N; ++c) {
        for (i = 0; i < N; ++i) {
            g[c] -= scale * column[2 * SEED_STEPS][c][i] * z[i];
        }
    }
    fill(&lambda, 1, 1e-6);
    damped_step(H, g, &lambda, 0, p);
    step = zero;
    length = zero;
    for (t = 0; t <= 2 * SEED_STEPS; ++t) {
        for (i = 0; i < M; ++i) {
            V sum = p[0] * column[t][0][control_of[i]];
            for (c = 1; c < N; ++c) {
                sum += p[c] * column[t][c][control_of[i]];
            }
            change[t][i] = task->inverse_weights[i] * sum - u[t][i];
            step += (0.5 / (double)SEED_STEPS) * change[t][i] * change[t][i];
            length += (0.5 / (double)SEED_STEPS) * u[t][i] * u[t][i];
        }
    }
    for (l = 0; l < LANES; ++l) {
        const double reach = sqrt(LANE(length, l)) + LANE(task->size, l), far = sqrt(LANE(step, l));
        LANE(scale, l) = far > reach ? 0.5 * reach / far : 0.5;
        *open += !(LANE(error, l) < 1e-4 && far < 0.05 * reach);
    }
    return scale;
}

/* Such steps of all starts of a group, until three quarters of them are there. */
static void relax(const problem *task, int most, V (*u)[2 * SEED_STEPS + 1][M], point *at)
{
    V(*change)[2 * SEED_STEPS + 1][M] = task->space->change, scale[PACKS];
    int iteration, k, t, i;
    for (iteration = 0;; ++iteration) {
        int open = 0;
        for (k = 0; k < PACKS; ++k) {
            scale[k] = relaxing_step(task + k, u[k], change[k], at[k].p, &open);
        }
        if (open <= GROUP / 4 || iteration == most) {
            return;
        }
        for (k = 0; k < PACKS; ++k) {
            for (t = 0; t <= 2 * SEED_STEPS; ++t) {
                for (i = 0; i < M; ++i) {
                    u[k][t][i] += scale[k] * change[k][t][i];
                }
            }
        }
    }
}

/* An even number of Runge-Kutta steps, no more than there is room for. */
static int even(int steps)
{
    steps += steps & 1;
    return steps < 2 ? 2 : steps < MOST_NODES ? steps : MOST_NODES;
}

static double energy_of(const problem *task, const V *p, int l)
{
    double energy = 0.0;
    int i;
    for (i = 0; i < M; ++i) {
        const double mu = LANE(task->column[control_of[i]], l) * LANE(p[control_of[i]], l);
        energy += LANE(task->inverse_weights[i], l) * mu * mu;
    }
    return energy;
}

static void move_candidate(candidates *list, int to, int from)
{
    list->energy[to] = list->energy[from];
    list->ended[to] = list->ended[from];
    list->loose[to] = list->loose[from];
    memcpy(list->p[to], list->p[from], sizeof list->p[to]);
}

/*
 * Keeps what one start found: a place of its own, by energy, or a count more for one that is there already. Loose ones
 * take half the places at most: a dead end may be cheaper than every extremal.
 */
static void keep(candidates *list, double energy, int loose, const point *at, int l)
{
    int place, i, number = 0, dearest = 0;
    if (!(energy < HUGE_VAL)) {
        return;
    }
    for (place = 0; place < list->count; ++place) {
        double apart = 0.0, size = 0.0;
        for (i = 0; i < N; ++i) {
            const double p = list->p[place][i];
            apart += (LANE(at->p[i], l) - p) * (LANE(at->p[i], l) - p);
            size += p * p;
        }
        if (apart <= 1e-6 * size) {
            ++list->ended[place];
            return;
        }
        if (list->loose[place]) {
            ++number;
            dearest = place;
        }
    }
    if (loose && number == KEPT / 2) {
        if (energy >= list->energy[dearest]) {
            return;
        }
        --list->count;
        for (place = dearest; place < list->count; ++place) {
            move_candidate(list, place, place + 1);
        }
    }
    if (list->count == KEPT && energy >= list->energy[KEPT - 1]) {
        return;
    }
    place = list->count < KEPT ? list->count++ : KEPT - 1;
    for (; place > 0 && list->energy[place - 1] > energy; --place) {
        move_candidate(list, place, place - 1);
    }
    list->energy[place] = energy;
    list->ended[place] = 1;
    list->loose[place] = loose;
    for (i = 0; i < N; ++i) {
        list->p[place][i] = LANE(at->p[i], l);
    }
}

/* Prepares one target, in all lanes: its logarithm x, its size, an empty list. */
static void begin(problem *task, V *x, candidates *list)
{
    double r = 0.0;
    int i, l;
    logarithm(task->target, x);
    for (i = 0; i < N; ++i) {
        r = fmax(r, pow(fabs(LANE(x[i], 0)), 1.0 / length_of[i]));
    }
    for (l = 0; l < GROUP; ++l) {
        set_size(task, l, r);
    }
    list->size = r;
    list->count = 0;
}

/*
 * Runs starts for one target, from number `first` to `last`, and then, while none has converged, to four times `last`.
 * Where weights differ much, brackets of brackets are needed, or one round was not enough, the guesses are relaxed. The
 * second time, `again`, the grid is finer, and what is near a large target without an end in sight is dropped.
 */
static void search(problem *task, const steering_options *options, int first, int last, int relaxed, int again,
    candidates *list, steering_result *result)
{
    V x[N], (*u)[2 * SEED_STEPS + 1][M] = task->space->u;
    rules rule;
    point *const at = task->space->at;
    double size = 0.0;
    int l, k, i, own[GROUP], done[GROUP];
    begin(task, x, list);
    for (i = 0; i < SIZE; ++i) {
        size += (LANE(task->target[i], 0) - identity[i]) * (LANE(task->target[i], 0) - identity[i]);
    }
    size = LANE(task->graded, 0) > 0.0 ? 1.0 : fmin(size, 1.0);
    rule.steps = even(again ? 2 * options->search_steps : options->search_steps);
    rule.exact = NULL;
    rule.most = options->search_iterations;
    rule.enough = size * options->search_tolerance;
    rule.near = SEARCH_RESIDUAL * size;
    rule.wanted = GROUP - GROUP / 4; /* the slowest quarter is not waited for */
    memset(at, 0, PACKS * sizeof *at);
    for (l = 0; l < GROUP; ++l) {
        own[l] = 1;
    }
    for (; first < last || (list->count == 0 && first < 4 * last); first += GROUP) {
        const int relaxing = relaxed || first >= last;
        for (k = 0; k < PACKS; ++k) {
            area_rule(task, x, first + k * LANES, u[k]);
            if (!relaxing) {
                nearest_costate(task + k, u[k], at[k].p);
            }
        }
        if (relaxing) {
            relax(task, RELAXATIONS, u, at);
        }
        rule.scaled = IS_DEEP && (first / 8) % 2 != 0;
        result->linearisations += descend(task, &rule, own, at, done);
        for (l = 0; l < GROUP && (first + l < last || first >= last); ++l) {
            const point *here = at + l / LANES;
            const int loose = LANE(here->Z, l % LANES) > 1e-6 * size;
            ++result->starts;
            if (done[l] && !(loose && again && LANE(task->graded, 0) == 0.0)) {
                ++result->converged;
                keep(list, energy_of(task, here->p, l % LANES), loose, here, l % LANES);
            }
        }
    }
}

/*
 * Polishes the candidates of `count` targets side by side on the exact flow: first those that may be the cheapest, and if
 * they fail the others. Targets that are solved are left alone.
 */
static void polish(int count, const double *targets, problem *task, const steering_options *options,
    const candidates *list, steering_result *results)
{
    const int each = GROUP / count;
    const double near = options->tolerance * options->tolerance;
    rules rule;
    point *const at = task->space->at;
    int i, l, c, done, spent, steps[PACKS], ready[GROUP], own[GROUP];
    memset(at, 0, PACKS * sizeof *at);
    for (i = 0; i < PACKS; ++i) {
        steps[i] = 2;
    }
    rule.steps = even(options->polish_steps);
    rule.exact = steps;
    rule.most = options->polish_iterations;
    rule.enough = POLISH_SHARE * near;
    rule.near = near;
    rule.wanted = GROUP;
    rule.scaled = 1;
    for (done = 0; done < 2 * KEPT; done += each) {
        const double dear = done < KEPT ? 1.1 : HUGE_VAL;
        int open = 0;
        for (l = 0; l < GROUP; ++l) {
            const int of = l / each < count ? l / each : count - 1;
            const candidates *from = list + of;
            const int which = done % KEPT + l % each;
            /* a lane with nothing of its own to do repeats the best */
            own[l] = l / each < count && which < from->count && from->energy[which] <= dear * from->energy[0]
                && results[of].status != STEERING_SOLVED;
            open = open || own[l];
            set_size(task, l, from->size);
            for (i = 0; i < N; ++i) {
                LANE(at[l / LANES].p[i], l % LANES) = from->count == 0 ? 0.0 : from->p[own[l] ? which : 0][i];
            }
            for (i = 0; i < SIZE; ++i) {
                LANE(task[l / LANES].target[i], l % LANES) = targets[of * SIZE + i];
            }
        }
        if (!open) {
            continue;
        }
        spent = descend(task, &rule, own, at, ready);
        for (l = 0; l < GROUP; ++l) {
            steering_result *result = results + l / each;
            const point *here = at + l / LANES;
            const problem *of = task + l / LANES;
            const int lane = l % LANES;
            const double E = LANE(here->E, lane), F = LANE(here->F, lane);
            const int good = E <= near && (E == F || F <= 1e-14 + 1e2 * LANE(of->floor, lane));
            const double energy = energy_of(of, here->p, lane);
            if (!own[l]) {
                continue;
            }
            if (l % each == 0) {
                result->linearisations += spent;
            }
            if (good ? (result->status != STEERING_SOLVED || energy < result->cost)
                     : (result->status != STEERING_SOLVED && E < result->residual * result->residual)) {
                result->status = good ? STEERING_SOLVED : STEERING_NOT_CONVERGED;
                result->cost = energy;
                result->residual = sqrt(E);
                for (i = 0; i < N; ++i) {
                    result->mu0[i] = LANE(of->column[i], lane) * LANE(here->p[i], lane);
                    for (c = 0; c < N; ++c) {
                        result->jacobian[i][c] = LANE(here->xi[c][i], lane) / LANE(of->column[c], lane);
                    }
                }
            }
        }
    }
}

/*
 * Solves `count` <= GROUP targets: searches each, polishes the best candidates of all side by side, and goes on once with
 * those that are not solved.
 */
static void solve_some(int count, const double *targets, const double *weights, const steering_options *options,
    steering_result *results, workspace *space)
{
    problem task[PACKS];
    candidates *const list = space->list;
    double mean = 1.0, least = HUGE_VAL, largest = 0.0;
    int i, k, c, attempt, open, starts = options->starts;
    memset(task, 0, sizeof task);
    for (i = 0; i < M; ++i) {
        mean *= pow(weights[i], 1.0 / (double)M);
        least = fmin(least, weights[i]);
        largest = fmax(largest, weights[i]);
    }
    for (k = 0; k < PACKS; ++k) {
        task[k].space = space;
        for (i = 0; i < M; ++i) {
            fill(task[k].inverse_weights + i, 1, mean / weights[i]);
        }
    }
    starts *= largest > 2.0 * least ? 2 : 1;
    for (attempt = 0; attempt < 2; ++attempt) {
        open = 0;
        for (k = 0; k < count; ++k) {
            steering_result *result = results + k;
            if (attempt == 0) {
                memset(result, 0, sizeof *result);
                result->cost = HUGE_VAL;
                result->residual = HUGE_VAL;
            }
            if (result->status != STEERING_SOLVED) {
                open = 1;
                for (c = 0; c < PACKS; ++c) {
                    for (i = 0; i < SIZE; ++i) {
                        fill(task[c].target + i, 1, targets[k * SIZE + i]);
                    }
                }
                search(task, options, result->starts, (attempt == 0 ? 1 : 4) * starts,
                    IS_DEEP || attempt > 0 || largest > 2.0 * least, attempt,
                    list + k, result);
            }
        }
        if (open) {
            polish(count, targets, task, options, list, results);
        }
    }
    for (k = 0; k < count; ++k) {
        results[k].cost *= mean;
        for (i = 0; i < N; ++i) {
            results[k].mu0[i] *= mean;
            for (c = 0; c < N; ++c) {
                results[k].jacobian[i][c] /= mean;
            }
        }
        for (i = 0; i < list[k].count; ++i) {
            results[k].agreeing += mean * list[k].energy[i] <= 1.01 * results[k].cost ? list[k].ended[i] : 0;
        }
    }
}

steering_options steering_defaults(void)
{
    steering_options options;
    options.starts = DEFAULT_STARTS;
    options.search_steps = DEFAULT_SEARCH_STEPS;
    options.search_iterations = DEFAULT_SEARCH_ITERATIONS;
    options.polish_steps = DEFAULT_POLISH_STEPS;
    options.polish_iterations = DEFAULT_POLISH_ITERATIONS;
    options.search_tolerance = DEFAULT_SEARCH_TOLERANCE;
    options.tolerance = DEFAULT_TOLERANCE;
    return options;
}

/* Whether a number lies from low to high; NaN does not. */
static int within(double value, double low, double high) { return value >= low && value <= high; }

/* Whether a call can be worked with: what is not finite, or no size that a start can have, would end in a wrong status. */
static int usable(const double *target, const double weights[M], const steering_options *options)
{
    int i, good = within(options->tolerance, 0.0, 1.0) && within(options->search_tolerance, 0.0, 1.0)
        && options->starts > 0 && options->starts <= 1000000 && options->search_steps > 0 && options->polish_steps > 0
        && options->search_iterations >= 0 && options->polish_iterations >= 0;
    for (i = 0; i < M; ++i) {
        good = good && within(weights[i], 1e-100, 1e100);
    }
    for (i = 0; i < FULL_SIZE; ++i) {
        good = good && within(target[i], -1e100, 1e100);
    }
    return good;
}

/* What a target that was not tried gets. */
static void refuse(steering_result *result)
{
    int i, c;
    memset(result, 0, sizeof *result);
    result->cost = result->residual = (double)NAN;
    for (i = 0; i < N; ++i) {
        result->mu0[i] = (double)NAN;
        for (c = 0; c < N; ++c) {
            result->jacobian[i][c] = (double)NAN;
        }
    }
    result->status = STEERING_INPUT;
}

static void solve_all(workspace *space, int count, const double *targets, const double weights[M],
    const steering_options *options, steering_result *results)
{
    double packed[GROUP * SIZE];
    int k, i, next;
    for (k = 0; k < count; k += GROUP) {
        const int some = count - k < GROUP ? count - k : GROUP;
        int any = 0;
        for (next = 0; next < some; ++next) {
            /* one that cannot be used stands in as the identity, so that its neighbours' lanes are what they would be */
            const int good = usable(targets + (ptrdiff_t)(k + next) * FULL_SIZE, weights, options);
            for (i = 0; i < SIZE; ++i) {
                packed[next * SIZE + i] = good ? targets[(ptrdiff_t)(k + next) * FULL_SIZE + varying[i]] : identity[i];
            }
            any = any || good;
        }
        if (any) {
            solve_some(some, packed, weights, options, results + k, space);
        }
        for (next = 0; next < some; ++next) {
            if (!usable(targets + (ptrdiff_t)(k + next) * FULL_SIZE, weights, options)) {
                refuse(results + k + next);
            }
        }
    }
}

void steering_solve(int count, const double *targets, const double weights[M],
    const steering_options *options, steering_result *results)
{
    workspace space;
    solve_all(&space, count, targets, weights, options, results);
}

void steering_solve_in(void *memory, int count, const double *targets, const double weights[M],
    const steering_options *options, steering_result *results)
{
    char *const start = memory;
    const size_t past = (size_t)((uintptr_t)start % sizeof(V)); /* vectors begin at multiples of their size */
    solve_all((workspace *)(void *)(start + (past ? sizeof(V) - past : 0)), count, targets, weights, options, results);
}

void steering_sample(const double mu0[N], const double weights[M], int count, double *u,
    double *X)
{
    V inverse_weights[M], y[FLOW];
    double size = 0.0, error = 0.0;
    int parts, k, s, i;
    for (i = 0; i < M; ++i) {
        fill(inverse_weights + i, 1, 1.0 / weights[i]);
    }
    for (i = 0; i < N; ++i) {
        fill(y + i, 1, mu0[i]);
        size += mu0[i] * mu0[i];
    }
    for (i = 0; i < SIZE; ++i) {
        fill(y + N + i, 1, identity[i]);
    }
    size = (4.0 + 2.0 * sqrt(size)) / (count - 1);
    parts = size < 256.0 ? (int)ceil(size) : 256; /* NaN too */
    for (k = 0;; ++k) {
        for (i = 0; u != NULL && i < M; ++i) {
            u[(ptrdiff_t)k * M + i] = LANE(y[control_of[i]], 0) / weights[i];
        }
        if (X != NULL) {
            double *out = X + (ptrdiff_t)k * FULL_SIZE;
            memset(out, 0, FULL_SIZE * sizeof *out);
            for (i = 0; i < DEGREE; ++i) {
                out[(FULL_SIZE / DEGREE + PARTS) * i] = 1.0;
            }
            for (i = 0; i < SIZE; ++i) {
                out[varying[i]] = LANE(y[N + i], 0);
            }
        }
        if (k + 1 >= count) {
            return;
        }
        for (s = 0; s < parts; ++s) {
            extrapolated_step(inverse_weights, 1.0 / ((double)(count - 1) * parts), y, &error);
        }
    }
}
