/*
 * Steering by reaching first and descending afterwards: many starts side by side, one in each lane of a vector of doubles.
 *
 *     Y = L X0 E_1 ... E_K R,   E_k = exp(a_k + sum_i (p_k u[s_k, i] + q_k u[s_k + 1, i]) b_ki)
 *
 * must become a given matrix (or a phase times it) by the choice of the controls u within their bounds. The sizes of the
 * group (D, PARTS, N, M) stand in direct_sizes.h; everything else arrives at run time, so that one library serves every
 * problem of a group. Nothing is allocated here: the caller lends the memory.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "direct_sizes.h"

/* LANES starts run side by side in one vector of doubles; other compilers run one start at a time. */
#if defined(__GNUC__) && !defined(LIE_CODEGEN_ONE_LANE)
#define LANES 8
#define LANE(v, l) ((v)[l])
#define LESS(a, b) ((Mask)((a) < (b)))
#define SELECT(mask, a, b) ((V)(((mask) & (Mask)(a)) | (~(mask) & (Mask)(b))))
#define NOT(mask) (~(mask))
#define TRUE_LANE (-1)
typedef double V __attribute__((vector_size(64)));
typedef int64_t Mask __attribute__((vector_size(64)));
#else
#define LANES 1
#define LANE(v, l) (*(&(v) + (l)))
#define LESS(a, b) ((a) < (b))
#define SELECT(mask, a, b) ((mask) ? (a) : (b))
#define NOT(mask) (!(mask))
#define TRUE_LANE 1
typedef double V;
typedef int Mask;
#endif

enum {
    ENTRIES = D * D * PARTS, /* doubles of a matrix, complex ones as pairs */
    PACKED = N * (N + 1) / 2 /* entries of a lower triangle */
};

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
    V *Z;                /* (N, ENTRIES) rows that reduce the residual */
    point at, trial, kept;
} task;

static V spread(double value)
{
    const V zero = {0.0};
    return zero + value;
}

static V largest(V a, V b)
{
    return SELECT(LESS(a, b), b, a);
}

static V least(V a, V b)
{
    return SELECT(LESS(b, a), b, a);
}

static int any(Mask mask)
{
    int l, found = 0;
    for (l = 0; l < LANES; ++l) {
        found |= LANE(mask, l) != 0;
    }
    return found;
}

static V root(V a)
{
    int l;
    for (l = 0; l < LANES; ++l) {
        LANE(a, l) = sqrt(LANE(a, l));
    }
    return a;
}

/* c = a b, or c += a b; row by row, so that the sums of a row stay in registers. c may be a, not b. */
static void multiply(const V *a, const V *b, int add, V *c)
{
    int i, j, k;
    for (i = 0; i < D; ++i) {
        V sum[D * PARTS];
        for (j = 0; j < D * PARTS; ++j) {
            sum[j] = add ? c[i * D * PARTS + j] : spread(0.0);
        }
        for (k = 0; k < D; ++k) {
            const V *row = b + k * D * PARTS;
            const V x = a[(i * D + k) * PARTS];
#if PARTS == 2
            const V y = a[(i * D + k) * PARTS + 1];
#pragma GCC unroll 8
            for (j = 0; j < D; ++j) {
                sum[2 * j] += x * row[2 * j];
                sum[2 * j + 1] += x * row[2 * j + 1];
                sum[2 * j] -= y * row[2 * j + 1];
                sum[2 * j + 1] += y * row[2 * j];
            }
#else
#pragma GCC unroll 8
            for (j = 0; j < D; ++j) {
                sum[j] += x * row[j];
            }
#endif
        }
        memcpy(c + i * D * PARTS, sum, sizeof sum);
    }
}

/* c += b a for a matrix b of which most entries are zero; `there` tells which are not. */
static void multiply_sparse(const V *b, const unsigned char *there, const V *a, V *c)
{
    int i, j, k;
    for (i = 0; i < D; ++i) {
        for (k = 0; k < D; ++k) {
            const V *row = a + k * D * PARTS;
            V *sum = c + i * D * PARTS;
            if (there[(i * D + k) * PARTS]) {
                const V x = b[(i * D + k) * PARTS];
                for (j = 0; j < D * PARTS; ++j) {
                    sum[j] += x * row[j];
                }
            }
#if PARTS == 2
            if (there[(i * D + k) * PARTS + 1]) {
                const V y = b[(i * D + k) * PARTS + 1];
                for (j = 0; j < D; ++j) {
                    sum[2 * j] -= y * row[2 * j + 1];
                    sum[2 * j + 1] += y * row[2 * j];
                }
            }
#endif
        }
    }
}

/* Terms after which Taylor's series of exp is exact to rounding for matrices of that norm. */
static int degree(double size)
{
    double left = size;
    int j = 1;
    while (left > 1e-17 && j < 40) {
        ++j;
        left *= size / j;
    }
    return j > 2 ? j : 2;
}

static void add_identity(V *a)
{
    int i;
    for (i = 0; i < D; ++i) {
        a[(i * D + i) * PARTS] += 1.0;
    }
}

/*
 * exp(a) and its derivatives along the b_i: Taylor's polynomial by Horner's rule, then squarings. Scales a and b. The derivatives are
 * those of the very operations: of E <- 1 + a E / j it is (a E' + b E) / j, of E <- E E it is E E' + E' E; so they belong to the
 * E that is computed, to rounding, and Newton's steps on it converge. E' goes first, for it needs the E before.
 */
static void exponentials(V *a, V *b, const unsigned char *there, V *E, V *dE)
{
    V square = spread(0.0), next[ENTRIES];
    double size = 0.0;
    int e, i, j, l, halvings = 0, terms;
    for (e = 0; e < ENTRIES; ++e) {
        square += a[e] * a[e];
    }
    for (l = 0; l < LANES; ++l) {
        size = fmax(size, sqrt(LANE(square, l)));
    }
    size = size < 1e6 ? size : 1e6; /* a lane that is lost must not cost the others their time */
    while (size > 1.5) {
        size /= 2.0;
        ++halvings;
    }
    terms = degree(size);
    for (e = 0; e < ENTRIES; ++e) {
        a[e] *= ldexp(1.0, -halvings);
        E[e] = a[e] * (1.0 / terms);
    }
    add_identity(E);
    for (e = 0; e < M * ENTRIES; ++e) {
        b[e] *= ldexp(1.0, -halvings);
        dE[e] = b[e] * (1.0 / terms);
    }
    for (j = terms - 1; j > 0; --j) {
        for (i = 0; i < M; ++i) {
            multiply(a, dE + i * ENTRIES, 0, next);
            multiply_sparse(b + i * ENTRIES, there + i * ENTRIES, E, next);
            for (e = 0; e < ENTRIES; ++e) {
                dE[i * ENTRIES + e] = next[e] * (1.0 / j);
            }
        }
        multiply(a, E, 0, next);
        for (e = 0; e < ENTRIES; ++e) {
            E[e] = next[e] * (1.0 / j);
        }
        add_identity(E);
    }
    for (j = 0; j < halvings; ++j) {
        for (i = 0; i < M; ++i) {
            multiply(E, dE + i * ENTRIES, 0, next);
            multiply(dE + i * ENTRIES, E, 1, next);
            memcpy(dE + i * ENTRIES, next, sizeof next);
        }
        multiply(E, E, 0, next);
        memcpy(E, next, sizeof next);
    }
}

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

/* E_k and its derivatives by the controls of its slot. */
static void exponential(task *w, int k, const V *u)
{
    const programme *p = w->p;
    const V *first = u + p->slot[k] * M, *second = p->share[2 * k + 1] != 0.0 ? first + M : first;
    V a[ENTRIES], b[M * ENTRIES], driven[M];
    const V zero = {0.0};
    unsigned char there[M * ENTRIES];
    int e, i;
    for (i = 0; i < M; ++i) {
        driven[i] = p->share[2 * k] * first[i] + p->share[2 * k + 1] * second[i];
    }
    for (e = 0; e < ENTRIES; ++e) {
        a[e] = looked_up(w, p->drifts, ENTRIES, k, e);
    }
    for (i = 0; i < M; ++i) {
        for (e = 0; e < ENTRIES; ++e) {
            const int place = i * ENTRIES + e;
            b[place] = looked_up(w, p->directions, M * ENTRIES, k, place);
            there[place] = (unsigned char)(any(LESS(zero, b[place])) || any(LESS(b[place], zero)));
            if (there[place]) {
                a[e] += driven[i] * b[place];
            }
        }
    }
    exponentials(a, b, there, w->E + k * ENTRIES, w->dE + (size_t)k * M * ENTRIES);
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

/* Residual and derivative at at->u: dY/du = (L X0 E_1 .. E_k-1) dE_k (E_k+1 .. E_K R). */
static void linearise(task *w, point *at)
{
    const programme *p = w->p;
    V tail[ENTRIES], moved[ENTRIES], column[ENTRIES], *Z = w->Z;
    int k, i, e, row;
    for (e = 0; e < ENTRIES; ++e) {
        w->before[e] = spread(p->start[e]);
        tail[e] = spread(p->right[e]);
    }
    for (k = 0; k < p->exponentials; ++k) {
        exponential(w, k, at->u);
        multiply(w->before + k * ENTRIES, w->E + k * ENTRIES, 0, w->before + (k + 1) * ENTRIES);
    }
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
 * The next controls of a damped step towards the goal; a control at a bound that pulls outwards stays there. The step of Levenberg and
 * Marquardt is -(J'J + mu)^-1 J'r = -J' (J J' + mu)^-1 r: the right side solves N equations, the left one as many as there are controls.
 * A slot counts by its length, as in an integral over time: with M the lengths it is -M^-1 J' (J M^-1 J' + mu)^-1 r.
 */
static void damped_step(task *w, const point *at, V lambda, V *next)
{
    const programme *p = w->p;
    const V zero = {0.0};
    V A[PACKED], inverse[N], y[N], trace = zero, shift;
    int c, i;
    transposed(w, at->J, at->r, w->z);
    for (c = 0; c < w->columns; ++c) {
        const V low = spread(p->low[c]), high = spread(p->high[c]);
        const Mask down = NOT(LESS(low, at->u[c])) & LESS(zero, w->z[c]);
        const Mask up = NOT(LESS(at->u[c], high)) & LESS(w->z[c], zero);
        w->f[c] = SELECT(down | up, zero, spread(1.0 / p->mass[c / M]));
    }
    gram(w, at->J, w->f, w->t, A);
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
    int step, l;
    linearise(w, at);
    for (step = 0; step < iterations; ++step) {
        const Mask open = active & LESS(spread(enough), at->size) & LESS(lambda, spread(1e8));
        Mask better;
        int there = 0;
        for (l = 0; l < LANES; ++l) {
            there += LANE(at->size, l) <= enough;
        }
        if (!any(open) || there >= wanted) {
            return;
        }
        damped_step(w, at, lambda, w->trial.u);
        linearise(w, &w->trial);
        better = open & LESS(w->trial.size, at->size);
        take(w, better, at, &w->trial);
        lambda = SELECT(better, largest(0.2 * lambda, spread(1e-13)), 6.0 * lambda);
        for (l = 0; l < LANES && used != NULL; ++l) {
            used[l] += LANE(open, l) != 0;
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

/* Takes the memory that is lent, and the lanes from `first` on; lanes beyond the last repeat it. */
static void begin(task *w, const programme *p, int lanes, int first, double *memory)
{
    V *next = (V *)memory;
    const size_t columns = (size_t)p->slots * M, K = (size_t)p->exponentials;
    V **rows[] = {&w->at.u, &w->trial.u, &w->kept.u, &w->f, &w->t, &w->v, &w->z};
    V **slopes[] = {&w->at.J, &w->trial.J, &w->kept.J};
    size_t i;
    int l, e;
    w->p = p;
    w->columns = (int)columns;
    for (i = 0; i < sizeof rows / sizeof *rows; ++i) {
        *rows[i] = next;
        next += columns;
    }
    for (i = 0; i < sizeof slopes / sizeof *slopes; ++i) {
        *slopes[i] = next;
        next += N * columns;
    }
    w->E = next;
    w->dE = w->E + K * ENTRIES;
    w->before = w->dE + K * M * ENTRIES;
    w->Z = w->before + (K + 1) * ENTRIES;
    for (l = 0; l < LANES; ++l) {
        w->lane[l] = first + l < lanes ? first + l : lanes - 1;
        for (e = 0; e < ENTRIES; ++e) {
            LANE(w->value[e], l) = p->value[(size_t)w->lane[l] * ENTRIES + e];
        }
    }
}

/* Doubles of memory for a programme, to be aligned to 64 bytes. */
size_t direct_memory(const programme *p)
{
    const size_t columns = (size_t)p->slots * M, K = (size_t)p->exponentials;
    return LANES * ((7 + 3 * N) * columns + (K * (2 + M) + 1 + N) * ENTRIES);
}

static void read_lanes(const task *w, const double *u, V *to)
{
    int l, c;
    for (c = 0; c < w->columns; ++c) {
        for (l = 0; l < LANES; ++l) {
            const double value = u[(size_t)w->lane[l] * w->columns + c];
            LANE(to[c], l) = fmin(fmax(value, w->p->low[c]), w->p->high[c]);
        }
    }
}

static void write_lanes(const task *w, int lanes, int first, const point *at, double *u, double *size)
{
    int l, c;
    for (l = 0; l < LANES && first + l < lanes; ++l) {
        for (c = 0; c < w->columns; ++c) {
            u[(size_t)(first + l) * w->columns + c] = LANE(at->u[c], l);
        }
        size[first + l] = LANE(at->size, l);
    }
}

static Mask everywhere(void)
{
    return LESS(spread(0.0), spread(1.0));
}

/* Stage 1: from the controls u (lanes, slots, M) to controls that reach the goal; the residual each lane is left with. */
void direct_reach(const programme *p, int lanes, double *u, double *size, int *used, double *memory)
{
    int first, l;
    for (first = 0; first < lanes; first += LANES) {
        task w;
        int steps[LANES] = {0};
        begin(&w, p, lanes, first, memory);
        read_lanes(&w, u, w.at.u);
        arrive(&w, &w.at, everywhere(), p->reach_iterations, p->enough, p->damping, p->wanted, steps);
        write_lanes(&w, lanes, first, &w.at, u, size);
        for (l = 0; l < LANES && first + l < lanes; ++l) {
            used[first + l] = steps[l];
        }
    }
}

/* Residual, its reduced coordinates (lanes, N) and their derivative (lanes, N, slots M) at u. */
void direct_linearise(const programme *p, int lanes, const double *u, double *size, double *r, double *J, double *memory)
{
    int first, l, i, c;
    for (first = 0; first < lanes; first += LANES) {
        task w;
        begin(&w, p, lanes, first, memory);
        for (c = 0; c < w.columns; ++c) {
            for (l = 0; l < LANES; ++l) {
                LANE(w.at.u[c], l) = u[(size_t)w.lane[l] * w.columns + c];
            }
        }
        linearise(&w, &w.at);
        for (l = 0; l < LANES && first + l < lanes; ++l) {
            size[first + l] = LANE(w.at.size, l);
            for (i = 0; i < N; ++i) {
                r[(size_t)(first + l) * N + i] = LANE(w.at.r[i], l);
                for (c = 0; c < w.columns; ++c) {
                    J[((size_t)(first + l) * N + i) * w.columns + c] = LANE(w.at.J[(size_t)i * w.columns + c], l);
                }
            }
        }
    }
}

/*
 * Stage 2: from controls that reach the goal to cheaper ones that reach it too. Each round takes the proximal step of the
 * linearised problem and restores the goal by a few undamped steps; rho, which keeps the step short, falls with success.
 * y (lanes, N) are the multipliers of the reduced residual at the end.
 */
void direct_descend(const programme *p, int lanes, double *u, double *size, double *cost, double *y, int *used, double *memory)
{
    const double enough = 100.0 * p->enough;
    int first, l, i, c, round;
    for (first = 0; first < lanes; first += LANES) {
        task w;
        V rho = spread(1.0), best, dual[N], quiet = spread(0.0), next[N];
        Mask open = everywhere();
        begin(&w, p, lanes, first, memory);
        read_lanes(&w, u, w.kept.u);
        linearise(&w, &w.kept);
        best = objective(&w, w.kept.u);
        for (i = 0; i < N; ++i) {
            dual[i] = spread(0.0);
        }
        for (l = 0; l < LANES && first + l < lanes; ++l) {
            used[first + l] = 0;
        }
        for (round = 0; round < p->descend_iterations && any(open); ++round) {
            V found, gain;
            Mask better, small;
            memcpy(next, dual, sizeof next);
            proximal(&w, &w.kept, rho, next, w.v);
            for (c = 0; c < w.columns; ++c) {
                w.at.u[c] = w.v[c];
            }
            arrive(&w, &w.at, open, 12, p->enough, 1e-9, LANES + 1, NULL);
            found = objective(&w, w.at.u);
            better = open & LESS(w.at.size, spread(enough)) & LESS(found, best);
            gain = SELECT(better, best - found, spread(0.0));
            small = better & NOT(LESS(p->relative * best, gain));
            take(&w, better, &w.kept, &w.at);
            for (i = 0; i < N; ++i) {
                dual[i] = SELECT(better, next[i], dual[i]);
            }
            best = SELECT(better, found, best);
            rho = SELECT(better, largest(rho * (1.0 / 3.0), spread(1e-6)), 4.0 * rho);
            /* done after two small gains in a row, or where no step however short is a gain */
            quiet = SELECT(small, quiet + 1.0, SELECT(better, spread(0.0), quiet));
            for (l = 0; l < LANES && first + l < lanes; ++l) {
                used[first + l] += LANE(open, l) != 0;
            }
            open &= LESS(quiet, spread(1.5)) & LESS(rho, spread(1e6));
        }
        write_lanes(&w, lanes, first, &w.kept, u, size);
        for (l = 0; l < LANES && first + l < lanes; ++l) {
            cost[first + l] = LANE(best, l);
            for (i = 0; i < N; ++i) {
                y[(size_t)(first + l) * N + i] = LANE(dual[i], l);
            }
        }
    }
}
