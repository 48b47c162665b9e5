/* SPDX-License-Identifier: MIT-0 */
/*
 * Bounded optimal control on a matrix group: an augmented Lagrangian around box-constrained differential dynamic programming.
 *
 *     minimise sum_k l(x_k, u_k) + phi(x_N)   subject to   x_{k+1} = F(x_k, u_k),  lower <= u_k <= upper,
 *     g(x_k, u_k) <= 0,  g_N(x_N) <= 0,  e(x_N) = 0,        x = (X in G, z in R^q)
 *
 * One text for all groups and all problems. The file that includes it defines the sizes, as macros, and the functions of the
 * model, as static functions; `OCP_(name)` puts the problem's name before a symbol. Derivatives are by d in
 * x (+) d = (X exp(d_X^), z + d_z); the model gives them from 2-jets, so that no logarithm is differentiated.
 *
 * No allocation, no globals, bounded iterations. References: Tassa, Mansard, Todorov, ICRA 2014 (bounds by a quadratic
 * program a stage); Nocedal and Wright, chapter 17 (augmented Lagrangian).
 */

typedef OCP_REAL real;
typedef OCP_(workspace) workspace;

enum {
    NX = OCP_DIM + OCP_Q,       /* local coordinates of a state */
    NV = NX + OCP_M,            /* and of a control */
    NS = OCP_PACKED + OCP_Q,    /* numbers of a stored state */
    NC = OCP_DIM + NX + OCP_M,  /* arguments of a Runge-Kutta stage: eta, theta, z, u */
    NEND = OCP_NG_END + OCP_NE  /* conditions at the end */
};

/* Small products are worth their place in the caller, where their sizes are constants. */
#if defined(__GNUC__)
#define OCP_INLINE static inline __attribute__((always_inline))
#else
#define OCP_INLINE static
#endif

#define OCP_LOOSE(round) ((real)(round == 0 ? 1e-3 : round == 1 ? 1e-4 : round == 2 ? 1e-5 : 1e-7))
#define LARGEST_PENALTY ((real)1e7)
#define CLEAN_PENALTY ((real)1e5)
#define FIRST_SHIFT ((real)0.1)

typedef struct {
    workspace *w;
    const real *p;      /* parameters, a row a stage */
    ptrdiff_t stride;   /* from one row to the next; 0 where they are constant */
    real t0;
    int exact;          /* curvature of dynamics and constraints too, not Gauss-Newton alone */
} task;

/* Where a step is asked for its state: at its end, by rk_b, and within it, by rk_inner, at the inner node of a quadrature that has one. */
enum { AT_END = 0, INNER = 1, PLACES = OCP_INNER ? 2 : 1 };

/* A linearised step: its stages, and the totals at the places of it. */
typedef struct {
    real y[OCP_STAGES][NX];             /* argument of each Runge-Kutta stage, as (theta, change of z) */
    real slope[OCP_STAGES][NX * NV];    /* its derivative by (d, u) */
    real stage[OCP_STAGES][NX * NC];    /* derivative of the stage by its own arguments */
    real total[PLACES][NX];
    real total_slope[PLACES][NX * NV];
    real Ad[OCP_DIM * OCP_DIM];         /* of exp(-total), of the place last asked for */
    real right[OCP_DIM * OCP_DIM];      /* right Jacobian at the total */
} chain;

static const real *row(const task *s, int k) { return s->p + k * s->stride; }
static real time_of(const task *s, int k) { return s->t0 + (real)k * OCP_H; }
static real largest(real a, real b) { return a > b ? a : b; }
static int is_finite(real a) { return a - a == 0; }

static int all_finite(const real *a, int count)
{
    int i;
    for (i = 0; i < count; ++i) {
        if (!is_finite(a[i])) {
            return 0;
        }
    }
    return 1;
}

OCP_INLINE void copy(real *to, const real *from, int count) { memcpy(to, from, (size_t)count * sizeof *to); }
OCP_INLINE void clear(real *to, int count) { memset(to, 0, (size_t)count * sizeof *to); }

OCP_INLINE real dot(const real *a, const real *b, int count)
{
    real total = 0;
    int i;
    for (i = 0; i < count; ++i) {
        total += a[i] * b[i];
    }
    return total;
}

/*
 * c (columns) += sum_k a_k B_k, a_k at a + k `apart`, B_k the rows of B. Four rows at a time: c is read and written once for them. Zeros
 * of a, where derivatives vanish, cost nothing.
 */
OCP_INLINE void add_rows(real *c, const real *a, int apart, const real *B, int inner, int columns, real factor)
{
    int k, j;
    for (k = 0; k + 4 <= inner; k += 4) {
        const real a0 = factor * a[k * apart], a1 = factor * a[(k + 1) * apart], a2 = factor * a[(k + 2) * apart];
        const real a3 = factor * a[(k + 3) * apart], *b = B + k * columns;
        if (a0 != 0 || a1 != 0 || a2 != 0 || a3 != 0) {
            for (j = 0; j < columns; ++j) {
                c[j] += (a0 * b[j] + a1 * b[columns + j]) + (a2 * b[2 * columns + j] + a3 * b[3 * columns + j]);
            }
        }
    }
    for (; k < inner; ++k) {
        const real a0 = factor * a[k * apart];
        for (j = 0; j < columns; ++j) {
            c[j] += a0 * B[k * columns + j];
        }
    }
}

/* C (rows x columns) += factor A (rows x inner) B (inner x columns). */
OCP_INLINE void add_product(real *C, const real *A, const real *B, int rows, int inner, int columns, real factor)
{
    int i;
    for (i = 0; i < rows; ++i) {
        add_rows(C + i * columns, A + i * inner, 1, B, inner, columns, factor);
    }
}

/* C (rows x columns) += A' B, A (inner x rows), B (inner x columns). */
OCP_INLINE void add_transposed(real *C, const real *A, const real *B, int inner, int rows, int columns)
{
    int i;
    for (i = 0; i < rows; ++i) {
        add_rows(C + i * columns, A + i, rows, B, inner, columns, 1);
    }
}

/* Adds L' W L to Q (NV x NV) and L' w to q, for L = (J; 0 I): what a cost of (F(x, u), u) is as one of (d, u). */
static void add_pulled_back(real *Q, real *q, const real *W, const real *w, const real *J)
{
    real T[NV * NV];
    int i;
    clear(T, NV * NV);
    for (i = 0; i < NV; ++i) {
        copy(T + i * NV + NX, W + i * NV + NX, OCP_M);
        add_product(T + i * NV, W + i * NV, J, 1, NX, NV, 1);
    }
    add_transposed(Q, J, T, NX, NV, NV);
    for (i = 0; i < OCP_M * NV; ++i) {
        Q[NX * NV + i] += T[NX * NV + i];
    }
    add_transposed(q, J, w, NX, NV, 1);
    for (i = 0; i < OCP_M; ++i) {
        q[NX + i] += w[NX + i];
    }
}

/* The share of a stage in what is reached at a place. */
static real share_of(int place, int s)
{
#if OCP_INNER
    if (place == INNER) {
        return rk_inner[s];
    }
#endif
    (void)place;
    return rk_b[s];
}

/*
 * x_{k+1} = F(x, u): an explicit Runge-Kutta step in canonical coordinates around X, theta' = dexpinv_theta(xi). `inner`, unless it is
 * null, gets the state at the inner node, by the method's own interpolant: its stages serve both.
 */
static void step(const real *x, const real *u, const real *p, real t, real h, real *next, real *inner)
{
    real y[NX], k[NX], total[PLACES][NX];
    int i, s, place;
    clear(y, NX);
    clear(total[0], PLACES * NX);
    for (s = 0; s < OCP_STAGES; ++s) {
        for (i = 0; s > 0 && i < NX; ++i) {
            y[i] = h * rk_a[s] * k[i];
        }
        model_stage(x, y, u, p, t + rk_c[s] * h, k);
        for (place = 0; place < PLACES; ++place) {
            for (i = 0; i < NX; ++i) {
                total[place][i] += h * share_of(place, s) * k[i];
            }
        }
    }
    model_move(x, total[AT_END], next);
    if (PLACES > 1 && inner) {
        model_move(x, total[PLACES - 1], inner);
    }
}

/* The stages of a step with their derivatives by (d, u), by the chain rule, and the totals. */
static void linear_stages(const real *x, const real *u, const real *p, real t, real h, chain *c)
{
    real k[NX], slope[NX * NV];
    int i, s, place;
    clear(c->total[0], PLACES * NX);
    clear(c->total_slope[0], PLACES * NX * NV);
    for (s = 0; s < OCP_STAGES; ++s) {
        real *y = c->y[s], *Y = c->slope[s], *S = c->stage[s];
        clear(y, NX);
        clear(Y, NX * NV);
        for (i = 0; s > 0 && i < NX; ++i) {
            y[i] = h * rk_a[s] * k[i];
        }
        for (i = 0; s > 0 && i < NX * NV; ++i) {
            Y[i] = h * rk_a[s] * slope[i];
        }
        model_stage_jacobian(x, y, u, p, t + rk_c[s] * h, k, S);
        /* arguments are (eta, theta, z, u): d and u enter directly, y through theta and, with d_z, through z */
        for (i = 0; i < NX; ++i) {
            const real *from = S + i * NC;
            copy(slope + i * NV, from, OCP_DIM);
            copy(slope + i * NV + OCP_DIM, from + 2 * OCP_DIM, OCP_Q + OCP_M);
            if (s > 0) {
                add_rows(slope + i * NV, from + OCP_DIM, 1, Y, NX, NV, 1);
            }
        }
        for (place = 0; place < PLACES; ++place) {
            const real weight = h * share_of(place, s);
            for (i = 0; i < NX; ++i) {
                c->total[place][i] += weight * k[i];
            }
            for (i = 0; i < NX * NV; ++i) {
                c->total_slope[place][i] += weight * slope[i];
            }
        }
    }
}

/*
 * F at a place of the step and J = dF / d(d, u) (NX x NV). With F_X = X exp(Theta):  F_X^-1 F_X(moved) = Ad(exp(-Theta)) eta +
 * J_r(Theta) dTheta to first order.
 */
static void reached(const real *x, chain *c, int place, real *next, real *J)
{
    const real *slope = c->total_slope[place];
    int i, j;
    model_move(x, c->total[place], next);
    model_move_jacobian(c->total[place], c->Ad, c->right);
    clear(J, NX * NV);
    add_product(J, c->right, slope, OCP_DIM, OCP_DIM, NV, 1);
    for (i = 0; i < OCP_DIM; ++i) {
        for (j = 0; j < OCP_DIM; ++j) {
            J[i * NV + j] += c->Ad[i * OCP_DIM + j];
        }
    }
    for (i = OCP_DIM; i < NX; ++i) {
        copy(J + i * NV, slope + i * NV, NV);
        J[i * NV + i] += 1;
    }
}

#if OCP_SECOND_ORDER
/* Adds L' H L for the L of a stage's arguments by (d, u): eta and u are unit rows, theta those of Y, z a unit row and one of Y. */
static void add_chained(real *Q, const real *H, const real *Y)
{
    real T[NC * NV];
    int i, j;
    for (i = 0; i < NC; ++i) {
        copy(T + i * NV, H + i * NC, OCP_DIM);
        copy(T + i * NV + OCP_DIM, H + i * NC + 2 * OCP_DIM, OCP_Q + OCP_M);
        add_product(T + i * NV, H + i * NC + OCP_DIM, Y, 1, NX, NV, 1);
    }
    for (i = 0; i < NV; ++i) {
        const real *row_of = T + (i < OCP_DIM ? i : i + OCP_DIM) * NV;
        for (j = 0; j < NV; ++j) {
            Q[i * NV + j] += row_of[j];
        }
    }
    add_transposed(Q, Y, T + OCP_DIM * NV, NX, NV, NV);
}

/*
 * Of the Hessian of mu . F by (d, u), F at the place last asked for, what the end of the chain adds to H (NV x NV); what mu asks of
 * each stage is added to `loads`, for add_stage_curvature.
 */
static void add_end_curvature(const chain *c, int place, const real *mu, real h, real (*loads)[NX], real *H)
{
    real S[OCP_DIM * OCP_DIM], C[OCP_DIM * OCP_DIM], CJ[OCP_DIM * NV], T[OCP_DIM * NV], nu[NX];
    const real *slope = c->total_slope[place];
    int i, j, s;
    /*
     * X exp(eta) exp(Theta + dTheta), to second order in (eta, dTheta): dTheta' S dTheta / 2 from the right Jacobian, and
     * a' C b / 2 from the bracket [a, b], a = Ad eta, b = J_r dTheta, twice for its two places in the Hessian.
     */
    model_move_hessian(c->total[place], mu, S, C);
    clear(T, OCP_DIM * NV);
    add_product(T, S, slope, OCP_DIM, OCP_DIM, NV, 1);
    add_transposed(H, slope, T, OCP_DIM, NV, NV);
    clear(T, OCP_DIM * NV);
    clear(CJ, OCP_DIM * NV);
    add_product(T, c->right, slope, OCP_DIM, OCP_DIM, NV, (real)0.5);
    add_product(CJ, C, T, OCP_DIM, OCP_DIM, NV, 1);
    clear(T, OCP_DIM * NV);
    add_transposed(T, c->Ad, CJ, OCP_DIM, OCP_DIM, NV);
    for (i = 0; i < OCP_DIM; ++i) {
        for (j = 0; j < NV; ++j) {
            H[i * NV + j] += T[i * NV + j];
            H[j * NV + i] += T[i * NV + j];
        }
    }
    clear(nu, NX);
    add_transposed(nu, c->right, mu, OCP_DIM, OCP_DIM, 1);
    copy(nu + OCP_DIM, mu + OCP_DIM, OCP_Q);
    for (s = 0; s < OCP_STAGES; ++s) {
        for (i = 0; i < NX; ++i) {
            loads[s][i] += h * share_of(place, s) * nu[i];
        }
    }
}

/* The stages' part of those Hessians, once for all places, from the end of the chain to its beginning. */
static void add_stage_curvature(const real *x, const real *u, const real *p, real t, real h, const chain *c, real (*loads)[NX], real *H)
{
    real curve[NC * NC];
    int i, j, s;
    for (s = OCP_STAGES - 1; s >= 0; --s) {
        const real *m = loads[s];
        model_stage_hessian(x, c->y[s], u, p, t + rk_c[s] * h, m, curve);
        add_chained(H, curve, c->slope[s]);
        for (i = 0; s > 0 && i < NX; ++i) {
            for (j = 0; j < NX; ++j) {
                loads[s - 1][j] += h * rk_a[s] * c->stage[s][i * NC + OCP_DIM + j] * m[i];
            }
        }
    }
}
#endif

#if OCP_NG + OCP_NG_END + OCP_NE > 0
/* What bounds a multiplier: lambda + rho g where that is positive. */
static real pressed(real lambda, real rho, real g) { return largest(0, lambda + rho * g); }
#endif

#if OCP_NG > 0
/* A path condition on the state alone cannot be changed at the start, where the state is given. */
static int is_given(int k, int i) { return k == 0 && !needs_control[i]; }
#endif

static real cost_at(const real *x, const real *u, const real *p, real t)
{
    real value;
    model_cost(x, u, p, t, &value);
    return value;
}

/* Cost of the interval k at the nodes of the quadrature; `inner` is the state at the node within it, where there is one. */
static real interval_cost(const task *s, int k, const real *x, const real *u, const real *next, const real *inner)
{
    real total = 0;
    int j;
    for (j = 0; j < OCP_NODES; ++j) {
        if (node_c[j] == 0) {
            total += node_w[j] * cost_at(x, u, row(s, k), time_of(s, k));
        } else if (node_c[j] == 1) {
            total += node_w[j] * cost_at(next, u, row(s, k + 1), time_of(s, k + 1));
        } else {
            total += node_w[j] * cost_at(inner, u, row(s, k), time_of(s, k) + node_c[j] * OCP_H);
        }
    }
    return total;
}

/* What the augmented Lagrangian adds to the cost at the stage k. */
static real path_terms(const task *s, int k, const real *x, const real *u)
{
    real total = 0;
#if OCP_NG > 0
    real g[OCP_NG];
    int i;
    model_path(x, u, row(s, k), time_of(s, k), g);
    for (i = 0; i < OCP_NG; ++i) {
        const real lambda = s->w->lambda[k][i], a = pressed(lambda, s->w->rho, g[i]);
        if (!is_given(k, i)) {
            total += (a * a - lambda * lambda) / (2 * s->w->rho);
        }
    }
#else
    (void)s, (void)k, (void)x, (void)u;
#endif
    return total;
}

static real end_terms(const task *s, const real *x)
{
    real total;
    model_end_cost(x, row(s, OCP_N), time_of(s, OCP_N), &total);
#if OCP_NG_END + OCP_NE > 0
    real c[NEND];
    int i;
    model_end(x, row(s, OCP_N), time_of(s, OCP_N), c);
    for (i = 0; i < NEND; ++i) {
        const real lambda = s->w->lambda_end[i], rho = s->w->rho;
        const real a = pressed(lambda, rho, c[i]);
        total += i < OCP_NG_END ? (a * a - lambda * lambda) / (2 * rho) : lambda * c[i] + rho * c[i] * c[i] / 2;
    }
#endif
    return total;
}

#if OCP_PLANS
/* The same of a trajectory that is known, the state within the interval being found once more. */
static real cost_between(const task *s, int k, const real *x, const real *u, const real *next)
{
    real again[NS], inner[NS];
    if (OCP_INNER) {
        step(x, u, row(s, k), time_of(s, k), OCP_H, again, inner);
    }
    return interval_cost(s, k, x, u, next, OCP_INNER ? inner : next);
}

static real merit(const task *s, real (*x)[NS], real (*u)[OCP_M])
{
    real total = end_terms(s, x[OCP_N]);
    int k;
    for (k = 0; k < OCP_N; ++k) {
        total += cost_between(s, k, x[k], u[k], x[k + 1]) + path_terms(s, k, x[k], u[k]);
    }
    return total;
}
static real plain_cost(const task *s)
{
    const workspace *w = s->w;
    real total;
    int k;
    model_end_cost(w->x[OCP_N], row(s, OCP_N), time_of(s, OCP_N), &total);
    for (k = 0; k < OCP_N; ++k) {
        total += cost_between(s, k, w->x[k], w->u[k], w->x[k + 1]);
    }
    return total;
}
#endif

/* Notes the worst condition: by how much, which, at which stage. Rows of g come first, then those of the end. */
static void find_violation(const task *s)
{
    workspace *w = s->w;
    w->violation = 0;
    w->worst = -1;
    w->worst_stage = -1;
#if OCP_NG > 0
    {
        real g[OCP_NG];
        int k, i;
        for (k = 0; k < OCP_N; ++k) {
            model_path(w->x[k], w->u[k], row(s, k), time_of(s, k), g);
            for (i = 0; i < OCP_NG; ++i) {
                if (!is_given(k, i) && !(g[i] <= w->violation)) {
                    w->violation = g[i];
                    w->worst = i;
                    w->worst_stage = k;
                }
            }
        }
    }
#endif
#if OCP_NG_END + OCP_NE > 0
    {
        real c[NEND];
        int i;
        model_end(w->x[OCP_N], row(s, OCP_N), time_of(s, OCP_N), c);
        for (i = 0; i < NEND; ++i) {
            const real off = i < OCP_NG_END || c[i] > 0 ? c[i] : -c[i];
            if (!(off <= w->violation)) {
                w->violation = off;
                w->worst = OCP_NG + i;
                w->worst_stage = OCP_N;
            }
        }
    }
#endif
}

/* Multipliers go the same share of the way to their next values as the step that was taken went of its own. */
static void update_multipliers(const task *s, real share)
{
    workspace *w = s->w;
#if OCP_NG > 0
    {
        real g[OCP_NG];
        int k, i;
        for (k = 0; k < OCP_N; ++k) {
            model_path(w->x[k], w->u[k], row(s, k), time_of(s, k), g);
            for (i = 0; i < OCP_NG; ++i) {
                const real next = is_given(k, i) ? 0 : pressed(w->lambda[k][i], w->rho, g[i]);
                w->lambda[k][i] += share * (next - w->lambda[k][i]);
            }
        }
    }
#endif
#if OCP_NG_END + OCP_NE > 0
    {
        real c[NEND];
        int i;
        model_end(w->x[OCP_N], row(s, OCP_N), time_of(s, OCP_N), c);
        for (i = 0; i < NEND; ++i) {
            const real next = w->lambda_end[i] + w->rho * c[i];
            w->lambda_end[i] += share * ((i < OCP_NG_END ? largest(0, next) : next) - w->lambda_end[i]);
        }
    }
#endif
    (void)w, (void)share;
}

/* Lower Cholesky factor of the rows and columns `index` of Q (M x M); 0 where it is not positive definite. */
static int cholesky(const real *Q, const int *index, int count, real *L)
{
    int i, j, k;
    for (i = 0; i < count; ++i) {
        for (j = 0; j <= i; ++j) {
            real value = Q[index[i] * OCP_M + index[j]];
            for (k = 0; k < j; ++k) {
                value -= L[i * OCP_M + k] * L[j * OCP_M + k];
            }
            if (i == j) {
                const real scale = Q[index[i] * OCP_M + index[i]];
                if (!(value > OCP_EPSILON * 64 * (scale > 0 ? scale : -scale)) || !is_finite(value)) {
                    return 0;
                }
                L[i * OCP_M + i] = OCP_SQRT(value);
            } else {
                L[i * OCP_M + j] = value / L[j * OCP_M + j];
            }
        }
    }
    return 1;
}

static void cholesky_solve(const real *L, int count, real *b)
{
    int i, k;
    for (i = 0; i < count; ++i) {
        for (k = 0; k < i; ++k) {
            b[i] -= L[i * OCP_M + k] * b[k];
        }
        b[i] /= L[i * OCP_M + i];
    }
    for (i = count - 1; i >= 0; --i) {
        for (k = i + 1; k < count; ++k) {
            b[i] -= L[k * OCP_M + i] * b[k];
        }
        b[i] /= L[i * OCP_M + i];
    }
}

/*
 * argmin s'Qs/2 + q's over low <= s <= high, by projected Newton steps from s = 0. Leaves the free rows in `index` and the
 * factor of their block in L; -1 where that block is not positive definite, else the number of free rows.
 */
static int box_program(const real *Q, const real *q, const real *low, const real *high, real *s, int *index, real *L)
{
    real gradient[OCP_M], move[OCP_M], trial[OCP_M], before = 0, scale = 0;
    int iteration, i, count = 0;
    for (i = 0; i < OCP_M; ++i) {
        s[i] = 0;
        scale = largest(scale, q[i] > 0 ? q[i] : -q[i]);
    }
    for (iteration = 0; iteration < 25; ++iteration) {
        real size = 0, alpha = 1, decrease = 0;
        int same = iteration > 0, old = count;
        count = 0;
        for (i = 0; i < OCP_M; ++i) {
            gradient[i] = q[i] + dot(Q + i * OCP_M, s, OCP_M);
            if (!((s[i] <= low[i] && gradient[i] > 0) || (s[i] >= high[i] && gradient[i] < 0))) {
                same = same && count < old && index[count] == i;
                index[count++] = i;
                size = largest(size, gradient[i] > 0 ? gradient[i] : -gradient[i]);
            }
        }
        same = same && count == old;
        if (!same && count > 0 && !cholesky(Q, index, count, L)) {
            return -1;
        }
        if (count == 0 || size <= OCP_EPSILON * 16 * scale) {
            return count;
        }
        for (i = 0; i < count; ++i) {
            move[i] = -gradient[index[i]];
        }
        cholesky_solve(L, count, move);
        for (;;) {
            real value = 0;
            copy(trial, s, OCP_M);
            for (i = 0; i < count; ++i) {
                const real to = s[index[i]] + alpha * move[i];
                trial[index[i]] = to < low[index[i]] ? low[index[i]] : to > high[index[i]] ? high[index[i]] : to;
            }
            decrease = 0;
            for (i = 0; i < OCP_M; ++i) {
                value += trial[i] * (q[i] + dot(Q + i * OCP_M, trial, OCP_M) / 2);
                decrease -= gradient[i] * (trial[i] - s[i]);
            }
            if (before - value >= (real)0.1 * decrease || alpha < (real)1e-3) {
                before = value;
                break;
            }
            alpha /= 2;
        }
        if (decrease <= OCP_EPSILON * (1 + (before > 0 ? before : -before))) {
            copy(s, trial, OCP_M);
            return count;
        }
        copy(s, trial, OCP_M);
    }
    return count;
}

static real cost_terms(const task *s, const real *x, const real *u, const real *p, real t, real *gradient, real *H)
{
    real value;
#if OCP_SECOND_ORDER
    if (s->exact) {
        model_cost_exact(x, u, p, t, &value, gradient, H);
        return value;
    }
#endif
    (void)s;
    model_cost_square(x, u, p, t, &value, gradient, H);
    return value;
}

/* Hessian P and gradient v of what the last state costs; the value of it is returned. */
static real end_model(const task *s, real *P, real *v)
{
    const real *x = s->w->x[OCP_N], *p = row(s, OCP_N);
    const real t = time_of(s, OCP_N);
    real value;
#if OCP_SECOND_ORDER
    if (s->exact) {
        model_end_cost_exact(x, p, t, &value, v, P);
    } else
#endif
    {
        model_end_cost_square(x, p, t, &value, v, P);
    }
#if OCP_NG_END + OCP_NE > 0
    {
        real c[NEND], C[NEND * NX], a[NEND];
        const real rho = s->w->rho;
        int i, j, m;
        model_end_jacobian(x, p, t, c, C);
        for (i = 0; i < NEND; ++i) {
            const real lambda = s->w->lambda_end[i];
            a[i] = lambda + rho * c[i];
            if (i < OCP_NG_END) {
                a[i] = largest(0, a[i]);
                value += (a[i] * a[i] - lambda * lambda) / (2 * rho);
            } else {
                value += lambda * c[i] + rho * c[i] * c[i] / 2;
            }
            if (i >= OCP_NG_END || a[i] > 0) {
                for (j = 0; j < NX; ++j) {
                    v[j] += a[i] * C[i * NX + j];
                    for (m = 0; m < NX; ++m) {
                        P[j * NX + m] += rho * C[i * NX + j] * C[i * NX + m];
                    }
                }
            }
        }
#if OCP_SECOND_ORDER
        if (s->exact) {
            real H[NX * NX];
            model_end_hessian(x, p, t, a, H);
            for (i = 0; i < NX * NX; ++i) {
                P[i] += H[i];
            }
        }
#endif
    }
#endif
    return value;
}

/*
 * Hessian Q (NV x NV) and gradient q of stage k's cost-to-go in (d, u), from that of the next one (P, v); returns the
 * stage's own cost. Everything is linearised here and forgotten again: nothing of it is stored.
 */
static real stage_model(const task *s, int k, const real *P, const real *v, real *Q, real *q)
{
    workspace *w = s->w;
    const real *x = w->x[k], *u = w->u[k], *p = row(s, k);
    const real t = time_of(s, k);
    real W[NV * NV], weighted[NV], H[NV * NV], gradient[NV], J[NX * NV], next[NS], value = 0;
#if OCP_SECOND_ORDER
    real loads[OCP_STAGES][NX];
#endif
    chain c;
    int i, j, n;
    clear(Q, NV * NV);
    clear(q, NV);
    clear(W, NV * NV);
    clear(weighted, NV);
    for (i = 0; i < NX; ++i) {
        copy(W + i * NV, P + i * NX, NX);
    }
    copy(weighted, v, NX);
    for (n = 0; n < OCP_NODES; ++n) {
        if (node_c[n] == 1) {
            value += node_w[n] * cost_terms(s, w->x[k + 1], u, row(s, k + 1), time_of(s, k + 1), gradient, H);
            for (i = 0; i < NV * NV; ++i) {
                W[i] += node_w[n] * H[i];
            }
            for (i = 0; i < NV; ++i) {
                weighted[i] += node_w[n] * gradient[i];
            }
        }
    }
    linear_stages(x, u, p, t, OCP_H, &c);
    reached(x, &c, AT_END, next, J);
    add_pulled_back(Q, q, W, weighted, J);
#if OCP_SECOND_ORDER
    clear(loads[0], OCP_STAGES * NX);
    if (s->exact) {
        add_end_curvature(&c, AT_END, weighted, OCP_H, loads, Q);
    }
#endif
    for (n = 0; n < OCP_NODES; ++n) {
        if (node_c[n] == 0) {
            value += node_w[n] * cost_terms(s, x, u, p, t, gradient, H);
            for (i = 0; i < NV * NV; ++i) {
                Q[i] += node_w[n] * H[i];
            }
            for (i = 0; i < NV; ++i) {
                q[i] += node_w[n] * gradient[i];
            }
        } else if (node_c[n] < 1) {
            reached(x, &c, PLACES - 1, next, J);
            value += node_w[n] * cost_terms(s, next, u, p, t + node_c[n] * OCP_H, gradient, H);
            for (i = 0; i < NV * NV; ++i) {
                H[i] *= node_w[n];
            }
            for (i = 0; i < NV; ++i) {
                gradient[i] *= node_w[n];
            }
            add_pulled_back(Q, q, H, gradient, J);
#if OCP_SECOND_ORDER
            if (s->exact) {
                add_end_curvature(&c, PLACES - 1, gradient, OCP_H, loads, Q);
            }
#endif
        }
    }
#if OCP_SECOND_ORDER
    if (s->exact) {
        add_stage_curvature(x, u, p, t, OCP_H, &c, loads, Q);
    }
#endif
#if OCP_NG > 0
    {
        real g[OCP_NG], G[OCP_NG * NV], a[OCP_NG];
        model_path_jacobian(x, u, p, t, g, G);
        for (n = 0; n < OCP_NG; ++n) {
            const real lambda = w->lambda[k][n];
            a[n] = is_given(k, n) ? 0 : pressed(lambda, w->rho, g[n]);
            value += is_given(k, n) ? 0 : (a[n] * a[n] - lambda * lambda) / (2 * w->rho);
            for (i = 0; a[n] > 0 && i < NV; ++i) {
                const real by = G[n * NV + i];
                q[i] += a[n] * by;
                for (j = 0; by != 0 && j < NV; ++j) {
                    Q[i * NV + j] += w->rho * by * G[n * NV + j];
                }
            }
        }
#if OCP_SECOND_ORDER
        if (s->exact) {
            model_path_hessian(x, u, p, t, a, H);
            for (i = 0; i < NV * NV; ++i) {
                Q[i] += H[i];
            }
        }
#endif
    }
#endif
    (void)j;
    return value;
}

/*
 * One sweep backwards: gains and feed-forward of every stage. Returns 0 where a block is not positive definite.
 * `gain`: what the model promises; `value`: the merit of the trajectory; P, v: Hessian and gradient of the cost-to-go of x_0.
 */
static int backward(const task *s, real shift, real *gain, real *value, real *P, real *v)
{
    workspace *w = s->w;
    real Q[NV * NV], q[NV];
    int i, j, k;
    *gain = 0;
    *value = end_model(s, P, v);
    for (k = OCP_N - 1; k >= 0; --k) {
        real shifted[OCP_M * OCP_M], low[OCP_M], high[OCP_M], L[OCP_M * OCP_M], column[OCP_M], Qk[OCP_M];
        real half[OCP_M * NX], sides[NX * NX]; /* Q_ux + Q_uu K / 2, and K' of it */
        real *K = w->K[k], *kappa = w->kappa[k];
        int index[OCP_M], count;
        *value += stage_model(s, k, P, v, Q, q);
        for (i = 0; i < OCP_M; ++i) {
            for (j = 0; j < OCP_M; ++j) {
                shifted[i * OCP_M + j] = Q[(NX + i) * NV + NX + j] + (i == j ? shift : 0);
            }
            low[i] = lower_bound[i] - w->u[k][i];
            high[i] = upper_bound[i] - w->u[k][i];
        }
        count = box_program(shifted, q + NX, low, high, kappa, index, L);
        if (count < 0) {
            return 0;
        }
        clear(K, OCP_M * NX);
        for (j = 0; j < NX; ++j) {
            for (i = 0; i < count; ++i) {
                column[i] = -Q[(NX + index[i]) * NV + j];
            }
            cholesky_solve(L, count, column);
            for (i = 0; i < count; ++i) {
                K[index[i] * NX + j] = column[i];
            }
        }
        /* the cost-to-go under u + kappa + K d, with the true Q_uu: the shift only shortens the step */
        clear(half, OCP_M * NX);
        for (i = 0; i < OCP_M; ++i) {
            const real *quu = Q + (NX + i) * NV + NX;
            Qk[i] = dot(quu, kappa, OCP_M);
            add_rows(half + i * NX, quu, 1, K, OCP_M, NX, (real)0.5);
            for (j = 0; j < NX; ++j) {
                half[i * NX + j] += Q[(NX + i) * NV + j];
            }
            *gain -= kappa[i] * (q[NX + i] + Qk[i] / 2);
        }
        clear(sides, NX * NX);
        add_transposed(sides, K, half, OCP_M, NX, NX);
        for (i = 0; i < NX; ++i) {
            real total = q[i];
            for (j = 0; j < OCP_M; ++j) {
                total += K[j * NX + i] * (q[NX + j] + Qk[j]) + Q[(NX + j) * NV + i] * kappa[j];
            }
            v[i] = total;
            for (j = 0; j <= i; ++j) {
                P[i * NX + j] = (Q[i * NV + j] + Q[j * NV + i]) / 2 + sides[i * NX + j] + sides[j * NX + i];
                P[j * NX + i] = P[i * NX + j];
            }
        }
        if (!is_finite(v[0]) || !is_finite(P[0])) {
            return 0;
        }
    }
    return is_finite(*value) && is_finite(*gain);
}

/* Rolls out u + alpha kappa + K d from w->x_new[0] into x_new, u_new; returns the merit. */
static real forward(const task *s, real alpha)
{
    workspace *w = s->w;
    real total = 0, d[NX], inner[NS];
    int k, i;
    for (k = 0; k < OCP_N; ++k) {
        model_difference(w->x[k], w->x_new[k], d);
        for (i = 0; i < OCP_M; ++i) {
            const real u = w->u[k][i] + alpha * w->kappa[k][i] + dot(w->K[k] + i * NX, d, NX);
            w->u_new[k][i] = u > lower_bound[i] ? (u < upper_bound[i] ? u : upper_bound[i]) : lower_bound[i];
        }
        step(w->x_new[k], w->u_new[k], row(s, k), time_of(s, k), OCP_H, w->x_new[k + 1], inner);
        total += interval_cost(s, k, w->x_new[k], w->u_new[k], w->x_new[k + 1], OCP_INNER ? inner : w->x_new[k + 1]);
        total += path_terms(s, k, w->x_new[k], w->u_new[k]);
        if (!is_finite(total)) {
            return total;
        }
    }
    return total + end_terms(s, w->x_new[OCP_N]);
}

static void take_new(workspace *w)
{
    memcpy(w->x, w->x_new, sizeof w->x);
    memcpy(w->u, w->u_new, sizeof w->u);
}

#if OCP_FREE
/* The last state of all is T, how long the plan lasts, in units of which the equations count time. */
static real within_durations(real T)
{
    return T > shortest_duration ? (T < longest_duration ? T : longest_duration) : shortest_duration;
}

/* Where the quadratic model P, v of the cost-to-go is least in T, for a first state that is d away from the plan's. */
static real better_duration(const workspace *w, const real *P, const real *v, const real *d)
{
    const real slope = v[NX - 1] + dot(P + (NX - 1) * NX, d, NX - 1), curvature = P[NX * NX - 1], T = w->x[0][NS - 1];
    return curvature > 0 ? within_durations(T - slope / curvature) - T : 0;
}
#endif

/* The measured state as the first of the roll-out; the part `alpha` of the change of a free duration with it. */
static void place_first(workspace *w, const real *measured, real alpha, real change)
{
    copy(w->x_new[0], measured, NS);
#if OCP_FREE
    w->x_new[0][NS - 1] = w->x[0][NS - 1] + alpha * change;
#endif
    (void)alpha, (void)change;
}

#if OCP_PLANS
#if OCP_FREE
/* The same where a plan is sought, far from which the cost may bend downwards: then a large step the way that it falls. */
static real sought_duration(const workspace *w, const real *P, const real *v)
{
    const real none[NX] = { 0 }, T = w->x[0][NS - 1];
    return P[NX * NX - 1] > 0 ? better_duration(w, P, v, none) : within_durations(T * (v[NX - 1] > 0 ? (real)0.7 : (real)1.4)) - T;
}
#endif

static int roll_out(const task *s)
{
    workspace *w = s->w;
    int k, i;
    for (k = 0; k < OCP_N; ++k) {
        for (i = 0; i < OCP_M; ++i) {
            const real u = w->u[k][i];
            w->u[k][i] = u > lower_bound[i] ? (u < upper_bound[i] ? u : upper_bound[i]) : lower_bound[i];
        }
        step(w->x[k], w->u[k], row(s, k), time_of(s, k), OCP_H, w->x[k + 1], NULL);
    }
    return all_finite(w->x[0], (OCP_N + 1) * NS);
}

/* One iteration; returns 1 where M fell, 0 where it did not, 2 where there is nothing left to gain. */
static int iterate(task *s, real *M, real *shift, real least)
{
    workspace *w = s->w;
    real gain = 0, value, alpha, change = 0, P[NX * NX], v[NX];
    int tries;
    for (tries = 0; !backward(s, *shift, &gain, &value, P, v); ++tries) {
        if (tries == 20) {
            return 0;
        }
        ++w->sweeps;
        if (s->exact) {
            s->exact = 0; /* far from a minimum: a Gauss-Newton step leads on, a shifted one hardly moves */
            continue;
        }
        *shift = largest(10 * *shift, (real)1e-6);
    }
    ++w->sweeps;
#if OCP_FREE
    if (w->choose) {
        change = sought_duration(w, P, v);
        gain -= change * (v[NX - 1] + change * P[NX * NX - 1] / 2);
    }
#endif
    if (gain <= least) {
        return 2;
    }
    for (alpha = 1; alpha > (real)4e-4; alpha /= 2) {
        real trial;
        place_first(w, w->x[0], alpha, change);
        trial = forward(s, alpha);
        if (*M - trial >= (real)1e-4 * alpha * gain) {
            take_new(w);
            *M = trial;
            *shift = *shift * (real)0.3 < (real)1e-5 ? 0 : *shift * (real)0.3;
            return 1;
        }
    }
    return 0;
}

/* Minimises the augmented Lagrangian for the multipliers and the penalty at hand. */
static void inner(task *s, real tolerance, int most)
{
    workspace *w = s->w;
    real M = merit(s, w->x, w->u), shift = 0;
    int failures = 0;
    while (w->iterations < most && !w->stop) {
        const real before = M, size = 1 + (M > 0 ? M : -M);
        const int was_exact = s->exact;
        const int done = iterate(s, &M, &shift, OCP_EPSILON * size);
        ++w->iterations;
        if (done == 2) {
            return;
        }
        if (done == 0) {
            if (++failures > 8) {
                return;
            }
            shift = largest(10 * shift, s->exact ? (real)1e-3 : (real)1e-6);
            continue;
        }
        failures = 0;
        /* the last step is an exact one, or one that had to do without */
        if (before - M < tolerance * size && (was_exact || !OCP_SECOND_ORDER || !w->curvature)) {
            return;
        }
        if (before - M < (real)1e-2 * size && OCP_SECOND_ORDER && w->curvature) {
            s->exact = 1;
        }
    }
}

int OCP_(solve)(workspace *w, const real *p, ptrdiff_t stride, real t0, real tolerance, real allowed, int outer, int most)
{
    task s;
    real last = (real)HUGE_VAL;
    int round, stuck = 0, conditions = OCP_NG + NEND > 0;
    s.w = w;
    s.p = p;
    s.stride = stride;
    s.t0 = t0;
    s.exact = OCP_SECOND_ORDER && w->curvature == 2;
    w->iterations = w->sweeps = 0;
    /* a tolerance without end would call anything solved, a negative one or NaN nothing */
    if (!(tolerance >= 0 && tolerance <= 1 && allowed >= 0 && is_finite(allowed)) || !is_finite(t0) || outer < 0 || most < 0
        || !(w->rho >= 0 && is_finite(w->rho)) || !all_finite(p, stride == 0 ? OCP_NP : (OCP_N + 1) * OCP_NP)) {
        w->cost = w->violation = (real)HUGE_VAL;
        w->status = OCP_INPUT;
        return w->status;
    }
    w->status = OCP_DIVERGED;
    if (!roll_out(&s)) {
        w->cost = w->violation = (real)HUGE_VAL;
        return w->status;
    }
    for (round = 0; round < outer; ++round) {
        const real loose = conditions && round < 4 ? largest(tolerance, OCP_LOOSE(round)) : tolerance;
        inner(&s, loose, most);
        find_violation(&s);
        if (conditions) {
            update_multipliers(&s, 1);
        }
        if (w->violation <= allowed && loose <= tolerance) {
            break;
        }
        if (w->iterations >= most || w->stop) {
            break;
        }
        if (!(w->violation <= allowed)) {
            w->rho = w->rho * 10 < LARGEST_PENALTY ? w->rho * 10 : LARGEST_PENALTY;
        }
        /* at the largest penalty and still no better: a corner between conditions that no small step leaves */
        stuck = !(w->violation <= allowed) && w->violation > last / 2 && w->rho >= LARGEST_PENALTY ? stuck + 1 : 0;
        if (stuck == 3) {
            break;
        }
        last = w->violation;
    }
    w->cost = plain_cost(&s);
    if (!is_finite(w->cost)) {
        w->status = OCP_DIVERGED;
    } else if (!(w->violation <= allowed)) {
        w->status = OCP_NOT_ADMISSIBLE;
    } else {
        w->status = round < outer && w->iterations < most && !w->stop && stuck < 3 ? OCP_SOLVED : OCP_ADMISSIBLE;
    }
    return w->status;
}

/* One clean sweep at the solution: K and P_0 are then derivatives of the optimum. Returns the shift that Q_uu needed. */
real OCP_(gains)(workspace *w, const real *p, ptrdiff_t stride, real t0)
{
    task s;
    real gain, value, shift = 0;
    int tries;
    s.w = w;
    s.p = p;
    s.stride = stride;
    s.t0 = t0;
    s.exact = OCP_SECOND_ORDER && w->curvature;
    w->rho = largest(w->rho, CLEAN_PENALTY);
    for (tries = 0; !backward(&s, shift, &gain, &value, w->P, w->v) && tries < 20; ++tries) {
        shift = largest(10 * shift, (real)1e-6);
    }
    return shift;
}

/* Controls that cost least at the first state, held: a first guess that hovers where hovering is cheap. */
void OCP_(first_guess)(workspace *w, const real *p, real t0)
{
    real gradient[NV], H[NV * NV], Q[OCP_M * OCP_M], low[OCP_M], high[OCP_M], move[OCP_M], L[OCP_M * OCP_M];
    real value;
    int k, i, j, round, index[OCP_M];
    for (i = 0; i < OCP_M; ++i) {
        w->u[0][i] = 0 > lower_bound[i] ? (0 < upper_bound[i] ? 0 : upper_bound[i]) : lower_bound[i];
    }
    for (round = 0; round < 10; ++round) {
        model_cost_square(w->x[0], w->u[0], p, t0, &value, gradient, H);
        for (i = 0; i < OCP_M; ++i) {
            for (j = 0; j < OCP_M; ++j) {
                Q[i * OCP_M + j] = H[(NX + i) * NV + NX + j];
            }
            low[i] = lower_bound[i] - w->u[0][i];
            high[i] = upper_bound[i] - w->u[0][i];
            gradient[i] = gradient[NX + i];
        }
        if (!all_finite(Q, OCP_M * OCP_M) || box_program(Q, gradient, low, high, move, index, L) < 0) {
            break;
        }
        for (i = 0; i < OCP_M; ++i) {
            w->u[0][i] += move[i];
        }
    }
    for (k = 1; k < OCP_N; ++k) {
        copy(w->u[k], w->u[0], OCP_M);
    }
}
#endif

#if OCP_PLANS
/* The model's own motion by h in `parts` steps, and its running cost: for simulations around a loop. */
void OCP_(advance)(const real *x, const real *u, const real *p, real t, real h, int parts, real *next)
{
    real from[NS];
    int i;
    copy(next, x, NS);
    for (i = 0; i < parts; ++i) {
        copy(from, next, NS);
        step(from, u, p, t + (real)i * h / (real)parts, h / (real)parts, next, NULL);
    }
}

real OCP_(running_cost)(const real *x, const real *u, const real *p, real t) { return cost_at(x, u, p, t); }

real OCP_(plan_cost)(workspace *w, const real *p, ptrdiff_t stride, real t0)
{
    task s;
    s.w = w;
    s.p = p;
    s.stride = stride;
    s.t0 = t0;
    s.exact = 0;
    return plain_cost(&s);
}
#endif

#if OCP_FREE
/* Takes a sample off the plan's duration; each stage takes what held in its middle: from further on, so that nothing is lost. */
static void shift_in_time(workspace *w)
{
    const real T = w->x[0][NS - 1], left = within_durations(T - w->sample);
    int k, j;
    for (k = 0; k < OCP_N; ++k) {
        const real middle = (w->sample + ((real)k + (real)0.5) * left / OCP_N) / T * OCP_N;
        const int from = middle < OCP_N - 1 ? (int)middle : OCP_N - 1;
        if (from != k) {
            copy(w->x[k], w->x[from], NS);
            copy(w->u[k], w->u[from], OCP_M);
            for (j = 0; j < (OCP_NG > 0 ? OCP_NG : 1); ++j) {
                w->lambda[k][j] = w->lambda[from][j];
            }
        }
    }
    for (k = 0; k <= OCP_N; ++k) {
        w->x[k][NS - 1] = left;
    }
}

/* Moves plan and multipliers a sample on; the states follow from where the plan is then. */
static void shift_plan(const task *s)
{
    workspace *w = s->w;
    real at[NS], next[NS], rest = w->sample / w->x[0][NS - 1];
    int k;
    copy(at, w->x[0], NS);
    for (k = 0; rest > 0 && k < OCP_N; ++k, rest -= OCP_H) {
        step(at, w->u[k], row(s, k), time_of(s, k), rest < OCP_H ? rest : OCP_H, next, NULL);
        copy(at, next, NS);
    }
    shift_in_time(w);
    copy(w->x[0], at, NS - 1);
    for (k = 0; k < OCP_N; ++k) {
        step(w->x[k], w->u[k], row(s, k), time_of(s, k), OCP_H, w->x[k + 1], NULL);
    }
}

/* The mean of the plan's control over a sample. */
static void held_control(const workspace *w, real *u)
{
    const real length = w->x[0][NS - 1] / OCP_N;
    real rest = w->sample;
    int k, i;
    for (i = 0; i < OCP_M; ++i) {
        u[i] = 0;
    }
    for (k = 0; k < OCP_N; ++k) {
        const real held = k == OCP_N - 1 || rest < length ? rest : length;
        for (i = 0; i < OCP_M; ++i) {
            u[i] += held / w->sample * w->u[k][i];
        }
        rest -= held;
    }
}
#else
static void shift_in_time(workspace *w)
{
    memmove(w->x[0], w->x[1], OCP_N * sizeof w->x[0]);
    memmove(w->u, w->u + 1, (OCP_N - 1) * sizeof w->u[0]);
}

/* Moves plan and multipliers one interval on; the last control is repeated and the last state rolled out. */
static void shift_plan(const task *s)
{
    workspace *w = s->w;
    shift_in_time(w);
#if OCP_NG > 0
    memmove(w->lambda, w->lambda + 1, (OCP_N - 1) * sizeof w->lambda[0]);
#endif
    step(w->x[OCP_N - 1], w->u[OCP_N - 1], row(s, OCP_N - 1), time_of(s, OCP_N - 1), OCP_H, w->x[OCP_N], NULL);
}

static void held_control(const workspace *w, real *u) { copy(u, w->u[0], OCP_M); }
#endif

/* The sample's own step: see the header. */
int OCP_(step)(workspace *w, const real *X, const real *z, const real *p, ptrdiff_t stride, real t0, int iterations, real *u)
{
    task s;
    real measured[NS], gain, value, P[NX * NX], v[NX], d[NX], shift, length = 1;
    int i, round, tries, numbers = stride == 0 ? OCP_NP : (OCP_N + 1) * OCP_NP;
    s.w = w;
    s.p = p;
    s.stride = stride;
    s.t0 = t0;
    s.exact = OCP_FREE && OCP_SECOND_ORDER; /* Gauss-Newton bends the cost the wrong way in T: -|u|^2 / T for |u|^2 / T */
    w->status = OCP_OK;
#if OCP_FREE
    if (!(w->sample > 0) || !is_finite(w->sample)) {
        copy(u, w->u[0], OCP_M);
        w->status = OCP_INPUT;
        return w->status;
    }
#endif
    for (i = 0; i < OCP_PACKED; ++i) {
        measured[i] = X[packed_from[i]];
    }
    for (i = 0; i < OCP_Q; ++i) {
        measured[OCP_PACKED + i] = z[i];
    }
    if (!all_finite(measured, NS) || !all_finite(p, numbers) || !is_finite(t0)) {
        /* the plan moves on without its model, whose parameters may be what is not a number */
        if (!w->fresh) {
            shift_in_time(w);
        }
        w->fresh = 0;
        held_control(w, u);
        w->status = OCP_INPUT;
        return w->status;
    }
    if (w->fresh) {
        w->shift = 0;
    } else {
        shift_plan(&s);
    }
    w->fresh = 0;
    shift = w->shift;
#if OCP_FREE
    measured[NS - 1] = w->x[0][NS - 1]; /* nobody measures how long it will take */
#endif
    for (round = 0; round < iterations; ++round) {
        real reference, trial = 0, alpha, change = 0, first[OCP_M];
        int swept = 0, tried, accepted = 0;
        for (tries = 0; tries <= 3 && !swept; ++tries) {
            swept = backward(&s, shift, &gain, &value, P, v);
            shift = swept || s.exact ? shift : largest(10 * shift, (real)1e-6);
            s.exact = s.exact && swept;
        }
        if (!swept) {
            if (round == 0) {
                memset(w->K, 0, sizeof w->K);
                w->status = OCP_HELD;
            }
            break;
        }
        /* the quadratic model's merit from the measured state; a roll-out that does about as well needs no comparison */
        model_difference(w->x[0], measured, d);
#if OCP_FREE
        d[NX - 1] = 0;
        change = better_duration(w, P, v, d);
        d[NX - 1] = change;
#endif
        place_first(w, measured, 1, change);
        reference = value + OCP_EPSILON * 256 * (1 + (value > 0 ? value : -value));
        for (i = 0; i < NX; ++i) {
            reference += d[i] * (v[i] + dot(P + i * NX, d, NX) / 2);
        }
        for (i = 0; i < OCP_M; ++i) {
            const real held = w->u[0][i] + dot(w->K[0] + i * NX, d, NX);
            first[i] = held > lower_bound[i] ? (held < upper_bound[i] ? held : upper_bound[i]) : lower_bound[i];
        }
        trial = forward(&s, 1);
        accepted = is_finite(trial) && trial <= reference;
        length = accepted ? 1 : length;
        if (!accepted) {
            const real full = trial;
            place_first(w, measured, 0, change);
            reference = forward(&s, 0);
            reference += OCP_EPSILON * 256 * (1 + (reference > 0 ? reference : -reference));
            if (is_finite(reference) && !(full <= reference)) {
                for (alpha = (real)0.5, tried = 1; tried < 4 && !accepted; ++tried, alpha /= 2) {
                    place_first(w, measured, alpha, change);
                    trial = forward(&s, alpha);
                    accepted = trial <= reference;
                    length = accepted ? alpha : length;
                }
            } else if (is_finite(full)) {
                place_first(w, measured, 1, change);
                trial = forward(&s, 1);
                accepted = 1;
                length = 1;
            }
            if (!accepted) {
                real held;
                place_first(w, measured, 0, change);
                held = forward(&s, 0);
                w->status = round == 0 ? OCP_HELD : w->status;
                shift = largest(10 * shift, FIRST_SHIFT); /* the next sweep tries a shorter step, not the same one again */
                if (is_finite(held)) {
                    take_new(w);
                    continue;
                }
                copy(w->x[0], measured, NS);
                copy(w->u[0], first, OCP_M);
                break;
            }
        }
        take_new(w);
        w->status = OCP_OK;
#if OCP_FREE
        measured[NS - 1] = w->x[0][NS - 1];
#endif
        shift = shift * (real)0.3 < (real)1e-5 ? 0 : shift * (real)0.3;
    }
    w->shift = shift;
    if (w->status == OCP_OK) {
        update_multipliers(&s, length);
        find_violation(&s);
    }
    held_control(w, u);
    for (i = 0; i < OCP_M; ++i) {
        const real value_of = u[i];
        u[i] = value_of > lower_bound[i] ? (value_of < upper_bound[i] ? value_of : upper_bound[i]) : lower_bound[i];
    }
    return w->status;
}
