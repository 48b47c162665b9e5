/*
 * X over equal steps of order 8 with its exact derivatives along tangents of u; compiled when they are first asked for.
 */
#include "magnus_words.h"

/* [dx, y] + [x, dy]. */
#if DIM > 6
__attribute__((noinline))
#endif
static void both(const V *x, const V *dx, const V *y, const V *dy, V *z)
{
    V other[WORK];
    BRACKET(dx, y, z);
    BRACKET(x, dy, other);
    EACH(k, WORK) { z[k] += other[k]; }
}

/* The derivative of exponent8 along da, every bracket by the product rule, from the stages that were kept. */
static inline void tangent8(const V a[ORDERS][WORK], const V da[ORDERS][WORK], const Stages *st, V *domega)
{
    V dx1[WORK], dy1[WORK], ds1[WORK], dw1[WORK], dr1[WORK], dx[WORK], dy[WORK], ds2[WORK], dt2[WORK], dr2[WORK], ds3[WORK];
    EACH(k, WORK) {
        dx1[k] = da[0][k] + da[2][k] * (1.0 / 28);
        dy1[k] = da[1][k] + da[3][k] * (3.0 / 28);
    }
    both(st->x1, dx1, st->y1, dy1, ds1);
    EACH(k, WORK) {
        ds1[k] *= 1.0 / 28;
        dw1[k] = ds1[k] - da[2][k] * (1.0 / 14);
    }
    both(a[0], da[0], st->w1, dw1, dr1);
    EACH(k, WORK) {
        dr1[k] *= -1.0 / 3;
        dx[k] = dx1[k] + ds1[k];
        dy[k] = dy1[k] + dr1[k];
    }
    both(st->x2, dx, st->y2, dy, ds2);
    both(a[1], da[1], st->s1, ds1, dt2);
    EACH(k, WORK) {
        ds2[k] = -ds2[k];
        dt2[k] = -dt2[k];
        dx[k] = da[0][k] + 1.25 * ds1[k];
        dy[k] = 2.0 * da[2][k] + ds2[k] + 0.5 * dt2[k];
    }
    both(st->x3, dx, st->y3, dy, dr2);
    EACH(k, WORK) {
        dr2[k] = -dr2[k];
        dx[k] = da[0][k] + da[2][k] * (1.0 / 12) - ds1[k] * (7.0 / 3) - ds2[k] * (1.0 / 6);
        dy[k] = -9.0 * da[1][k] - 2.25 * da[3][k] + 63.0 * dr1[k] + dr2[k];
    }
    both(st->x4, dx, st->y4, dy, ds3);
    EACH(k, WORK) { domega[k] = (da[0][k] + da[2][k] * (1.0 / 12)) - ds2[k] * (7.0 / 120) - ds3[k] * (1.0 / 360); }
}

/*
 * eta = X^-1 dX over a step: Ad(exp(-Omega)) eta + rjac(Omega) dOmega. Since Ad(exp(-Omega)) = 1 - rjac(Omega) ad(Omega), one
 * series serves both: eta + rjac(Omega) (dOmega - [Omega, eta]), rjac(Omega) y = sum_k (-ad(Omega))^k y / (k + 1)!.
 */
static inline void carry(const V *omega, const V *domega, V *eta)
{
    V term[WORK], next[WORK];
    BRACKET(omega, eta, next);
    EACH(k, WORK) {
        term[k] = domega[k] - next[k];
        eta[k] += term[k];
    }
    for (int j = 2; j < 40; ++j) {
        V size = splat(0.0), whole = splat(0.0);
        BRACKET(omega, term, next);
        EACH(k, WORK) {
            term[k] = next[k] * (-1.0 / j);
            eta[k] += term[k];
            size += term[k] * term[k];
            whole += eta[k] * eta[k];
        }
        if (!(largest(size) > 1e-36 * largest(whole))) {
            break;
        }
    }
}

/* Doubles of the workspace of magnus_tangents, its alignment included. */
EXPORT ptrdiff_t magnus_tangents_work(ptrdiff_t tangents);
EXPORT ptrdiff_t magnus_tangents_work(ptrdiff_t tangents)
{
    return LANES * (source_vectors(0, 0) + WORK * tangents + 1);
}

/*
 * X at the end of equal steps over one span, from the identity, and dX: (tangents, SIZE, SIZE), its exact derivatives along
 * the tangents of the table: the derivative of what is computed, not an approximation of another. Order 8, lanes over time.
 */
EXPORT void magnus_tangents(const Input *u, double length, ptrdiff_t steps, double *space, double *X, double *dX);
EXPORT void magnus_tangents(const Input *u, double length, ptrdiff_t steps, double *space, double *X, double *dX)
{
    V *work = aligned(space), *eta = work + source_vectors(0, 0), state[STATE];
    Source source;
    Input plain = *u;
    const V h = splat(length / (double)steps);
    ptrdiff_t first[LANES + 1], longest = 0;
    double before[FULL], after[FULL];
    plain.rates = plain.terms = 0;
    lay_out(&plain, work, &source);
    identity(state);
    for (ptrdiff_t k = 0; k < WORK * u->tangents; ++k) {
        eta[k] = splat(0.0);
    }
    for (int l = 0; l <= LANES; ++l) {
        first[l] = steps / LANES * l + (steps % LANES) * l / LANES;
        longest = l && first[l] - first[l - 1] > longest ? first[l] - first[l - 1] : longest;
    }
    for (ptrdiff_t k = 0; k < longest; ++k) {
        const double *table[LANES], *tangent[LANES];
        V a[ORDERS][DIM], da[ORDERS][DIM], omega[WORK], domega[WORK], length_now = h;
        Stages stages;
        EACH(l, LANES) {
            const ptrdiff_t at = first[l] + k < first[l + 1] ? first[l] + k : 0;
            length_now[l] = first[l] + k < first[l + 1] ? h[l] : 0.0; /* a lane that is done waits */
            table[l] = u->table + at * u->nodes * DIM;
            tangent[l] = u->tangent + at * u->nodes * u->tangents * DIM;
        }
        generators(&plain, &source, splat(0.0), splat(0.0), length_now, table, a);
#if !COORDINATES
        V wa[ORDERS][MATRIX], wda[ORDERS][MATRIX];
        EACH(j, ORDERS) { hat(a[j], wa[j]); }
#else
#define wa a
#define wda da
#endif
        exponent8((const V (*)[WORK])wa, &stages, omega);
        for (ptrdiff_t p = 0; p < u->tangents; ++p) {
            EACH(j, ORDERS) {
                EACH(i, DIM) { da[j][i] = splat(0.0); }
            }
            from_nodes(u, tangent, u->tangents * DIM, length_now, da);
#if !COORDINATES
            EACH(j, ORDERS) { hat(da[j], wda[j]); }
#endif
            tangent8((const V (*)[WORK])wa, (const V (*)[WORK])wda, &stages, domega);
            carry(omega, domega, eta + p * WORK);
            EACH(l, LANES) { tangent[l] += DIM; }
        }
        move(omega, state);
    }
    /* d(P X) = dP X + P X hat(eta), lane by lane. */
    memset(dX, 0, (size_t)(u->tangents * PARTS * SIZE * SIZE) * sizeof(double));
    memset(before, 0, sizeof before);
    EACH(i, SIZE) { before[i * SIZE + i] = 1.0; }
    EACH(l, LANES) {
        double one[STATE], matrix[FULL];
        EACH(k, STATE) { one[k] = state[k][l]; }
        to_matrix(one, matrix);
        multiply_one(before, matrix, after);
        for (ptrdiff_t p = 0; p < u->tangents; ++p) {
            double *to = dX + p * PARTS * SIZE * SIZE, old[FULL], moved[FULL], generator[FULL], more[FULL];
            V A[MATRIX];
#if COORDINATES
            hat(eta + p * WORK, A);
#else
            EACH(k, MATRIX) { A[k] = eta[p * WORK + k]; }
#endif
            memset(generator, 0, sizeof generator);
            EACH(q, PARTS) {
                EACH(i, ROWS * SIZE) { generator[q * SIZE * SIZE + i] = A[q * ROWS * SIZE + i][l]; }
            }
            get(to, old);
            multiply_one(old, matrix, moved);
            multiply_one(after, generator, more);
            EACH(k, FULL) { moved[k] += more[k]; }
            put(moved, to);
        }
        memcpy(before, after, sizeof before);
    }
    put(before, X);
}
