/*
 * Reverse derivatives of Magnus steps of order 8: what a covector of X(T) is on the values of u at the nodes of every step. The cost
 * is that of some steps, whatever the number of values.
 *
 * Where brackets come from structure constants a covector c of the algebra is its values on the basis, and so is all else; states are the
 * group's own short ones. Of larger groups everything is a whole matrix, and c is the matrix C with c(x) = Re tr(C^H hat(x)). In that
 * product the transposes of x -> [x, y] and of y -> [x, y] are Z -> [Z, y^H] and Z -> [x^H, Z]. group_view.py makes
 * magnus_group.h for this file.
 */
#include "magnus_words.h"

#if COORDINATES
/* What a covector factor Z of [x, y] is on x and on y. */
static inline void bracket_back(const V *x, const V *y, double factor, const V *Z, V *on_x, V *on_y)
{
    V scaled[WORK];
    EACH(k, WORK) { scaled[k] = factor * Z[k]; }
    lie_bracket_back(x, y, scaled, on_x, on_y);
}

/* z = ad(omega)^T Z, `star` being what `starred` makes of omega. */
#define starred(omega, star) memcpy((star), (omega), WORK * sizeof(V))
#define along_back(star, Z, z) lie_along_back((star), (Z), (z))
#else
static void starred(const V *x, V *z)
{
#if SKEW
    EACH(k, MATRIX) { z[k] = -x[k]; }
#else
    EACH(i, SIZE) {
        EACH(j, SIZE) {
            z[i * SIZE + j] = x[j * SIZE + i];
#if PARTS == 2
            z[MATRIX / 2 + i * SIZE + j] = -x[MATRIX / 2 + j * SIZE + i];
#endif
        }
    }
#endif
}

/* What a covector factor Z of [x, y] is on x and on y. */
static __attribute__((noinline)) void bracket_back(const V *x, const V *y, double factor, const V *Z, V *on_x, V *on_y)
{
    V scaled[MATRIX], other[MATRIX];
    EACH(k, MATRIX) { scaled[k] = factor * Z[k]; }
    starred(y, other);
    BRACKET(scaled, other, on_x);
    starred(x, other);
    BRACKET(other, scaled, on_y);
}

/* z = ad(omega)^T Z, `star` being omega^H. */
#define along_back(star, Z, z) BRACKET((star), (Z), (z))
#endif

/* exponent8 line by line from the last to the first: `out` on Omega becomes `on` on the generators. */
static void exponent8_back(const V a[ORDERS][WORK], const Stages *st, const V *out, V on[ORDERS][WORK])
{
    V x[WORK], y[WORK], s1[WORK], s2[WORK], r1[WORK], x1[WORK], y1[WORK];
    bracket_back(st->x4, st->y4, -1.0 / 360, out, x, y);
    EACH(k, WORK) {
        on[0][k] = out[k] + x[k];
        on[1][k] = -9.0 * y[k];
        on[2][k] = (out[k] + x[k]) * (1.0 / 12);
        on[3][k] = -2.25 * y[k];
        s1[k] = x[k] * (-7.0 / 3);
        s2[k] = out[k] * (-7.0 / 120) - x[k] * (1.0 / 6);
        r1[k] = 63.0 * y[k];
    }
    EACH(k, WORK) { y1[k] = y[k]; } /* on r2 */
    bracket_back(st->x3, st->y3, -1.0, y1, x, y);
    EACH(k, WORK) {
        on[0][k] += x[k];
        on[2][k] += 2.0 * y[k];
        s1[k] += 1.25 * x[k];
        s2[k] += y[k];
    }
    EACH(k, WORK) { y1[k] = y[k]; } /* twice what it is on t2 */
    bracket_back(a[1], st->s1, -0.5, y1, x, y);
    EACH(k, WORK) {
        on[1][k] += x[k];
        s1[k] += y[k];
    }
    bracket_back(st->x2, st->y2, -1.0, s2, x1, y1);
    EACH(k, WORK) {
        s1[k] += x1[k];
        r1[k] += y1[k];
    }
    bracket_back(a[0], st->w1, -1.0 / 3, r1, x, y);
    EACH(k, WORK) {
        on[0][k] += x[k];
        on[2][k] -= y[k] * (1.0 / 14);
        s1[k] += y[k];
    }
    bracket_back(st->x1, st->y1, 1.0 / 28, s1, x, y);
    EACH(k, WORK) {
        x1[k] += x[k];
        y1[k] += y[k];
        on[0][k] += x1[k];
        on[1][k] += y1[k];
        on[2][k] += x1[k] * (1.0 / 28);
        on[3][k] += y1[k] * (3.0 / 28);
    }
}

/*
 * C after a step becomes C before it, and `out` what it is on Omega: out = rjac(Omega)^T C, and since
 * Ad(exp(-Omega)) = 1 - rjac(Omega) ad(Omega), C <- C - ad(Omega)^T out.
 */
static void carry_back(const V *omega, V *C, V *out)
{
    V star[WORK], term[WORK], next[WORK];
    starred(omega, star);
    EACH(k, WORK) { out[k] = term[k] = C[k]; }
    for (int j = 2; j < 40; ++j) {
        V size = splat(0.0), whole = splat(0.0);
        along_back(star, term, next);
        EACH(k, WORK) {
            term[k] = next[k] * (-1.0 / j);
            out[k] += term[k];
            size += term[k] * term[k];
            whole += out[k] * out[k];
        }
        if (!(largest(size) > 1e-36 * largest(whole))) {
            break;
        }
    }
    along_back(star, out, next);
    EACH(k, WORK) { C[k] -= next[k]; }
}

/* The steps of each lane: from first[l] on, as many as `longest` at most. */
static ptrdiff_t share(ptrdiff_t steps, ptrdiff_t *first)
{
    ptrdiff_t longest = 0;
    for (int l = 0; l <= LANES; ++l) {
        first[l] = steps / LANES * l + (steps % LANES) * l / LANES;
        longest = l && first[l] - first[l - 1] > longest ? first[l] - first[l - 1] : longest;
    }
    return longest;
}

/* Omega of step k of every lane, with its generators and stages; a lane that has no such step gets zero. */
static void exponent_of(const Input *u, const double *lengths, const ptrdiff_t *first, ptrdiff_t k, V *h, V a[ORDERS][WORK],
    Stages *st, V *omega)
{
    V coordinates[ORDERS][DIM];
    const double *table[LANES];
    EACH(l, LANES) {
        const ptrdiff_t at = first[l] + k < first[l + 1] ? first[l] + k : 0;
        (*h)[l] = first[l] + k < first[l + 1] ? lengths[at] : 0.0;
        table[l] = u->table + at * u->nodes * DIM;
    }
    EACH(j, ORDERS) {
        EACH(i, DIM) { coordinates[j][i] = splat(0.0); }
    }
    from_nodes(u, table, DIM, *h, coordinates);
#if COORDINATES
    memcpy(a, coordinates, sizeof coordinates);
#else
    EACH(j, ORDERS) { hat(coordinates[j], a[j]); }
#endif
    exponent8((const V (*)[WORK])a, st, omega);
}

/* In how many runs the steps are cut. */
EXPORT ptrdiff_t magnus_lanes(void);
EXPORT ptrdiff_t magnus_lanes(void)
{
    return LANES;
}

/* X: (LANES, SIZE, SIZE) the product of the steps of each lane, all steps in LANES runs. */
EXPORT void magnus_lane_products(const Input *u, const double *lengths, ptrdiff_t steps, double *X);
EXPORT void magnus_lane_products(const Input *u, const double *lengths, ptrdiff_t steps, double *X)
{
    ptrdiff_t first[LANES + 1];
    const ptrdiff_t longest = share(steps, first);
    V state[STATE], a[ORDERS][WORK], omega[WORK], h = splat(0.0);
    Stages stages;
    identity(state);
    for (ptrdiff_t k = 0; k < longest; ++k) {
        exponent_of(u, lengths, first, k, &h, a, &stages, omega);
        move(omega, state);
    }
    EACH(l, LANES) {
        double one[STATE], matrix[FULL];
        EACH(k, STATE) { one[k] = state[k][l]; }
        to_matrix(one, matrix);
        put(matrix, X + l * PARTS * SIZE * SIZE);
    }
}

/*
 * C: (LANES, SIZE, SIZE) the covector after the steps of each lane (of skew-Hermitian groups skew-Hermitian).
 * slopes: (steps, nodes, DIM), what it is on the values at the nodes of every step.
 */
EXPORT void magnus_pullback(const Input *u, const double *lengths, ptrdiff_t steps, const double *C, double *slopes);
EXPORT void magnus_pullback(const Input *u, const double *lengths, ptrdiff_t steps, const double *C, double *slopes)
{
    ptrdiff_t first[LANES + 1];
    const ptrdiff_t longest = share(steps, first);
    V given[FULL], covector[WORK], out[WORK], a[ORDERS][WORK], on[ORDERS][WORK], omega[WORK], h = splat(0.0);
    Stages stages;
    EACH(l, LANES) {
        double whole[FULL];
        get(C + l * PARTS * SIZE * SIZE, whole);
        EACH(k, FULL) { given[k][l] = whole[k]; }
    }
#if COORDINATES
    hat_back(given, covector);
#else
    memcpy(covector, given, sizeof covector);
#endif
    for (ptrdiff_t k = longest - 1; k >= 0; --k) {
#if COORDINATES
#define on_a on
#else
        V on_a[ORDERS][DIM];
#endif
        exponent_of(u, lengths, first, k, &h, a, &stages, omega);
        carry_back(omega, covector, out);
        exponent8_back((const V (*)[WORK])a, &stages, out, on);
#if !COORDINATES
        EACH(j, ORDERS) { hat_back(on[j], on_a[j]); }
#endif
        for (ptrdiff_t g = 0; g < u->nodes; ++g) {
            EACH(i, DIM) {
                V value = splat(0.0);
                EACH(j, ORDERS) { value += u->projection[j * u->nodes + g] * on_a[j][i]; }
                value *= h;
                EACH(l, LANES) {
                    if (first[l] + k < first[l + 1]) {
                        slopes[((first[l] + k) * u->nodes + g) * DIM + i] = value[l];
                    }
                }
            }
        }
    }
}
