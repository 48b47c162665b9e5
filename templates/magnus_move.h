/* The state of a lane, a unit quaternion or the rows of X that vary: X <- X exp(Omega), and X as a whole matrix. */
#ifndef MAGNUS_MOVE_H
#define MAGNUS_MOVE_H

#if QUATERNION
/*
 * q (dq - 1) is added; cos - 1 and sin / x in even powers of the half angle, no root and no division. Of small angles, as steps to a tight
 * tolerance have them, the powers from the sixth on add less than 2e-17 of the sums.
 */
static inline void move(V *omega, V *q)
{
    const V x = omega[0] * HALF, y = omega[1] * HALF, z = omega[2] * HALF;
    V r = x * x + y * y + z * z, scale = splat(1.0);
    int halvings = 0;
    const double first = largest(r);
    for (double most = first; most > 0.6 && halvings < 60; most *= 0.25) {
        ++halvings;
        scale *= 0.5;
    }
    r *= scale * scale;
    V c = splat(-1.0 / 3628800), s = splat(-1.0 / 39916800);
    if (!(first <= 0.02)) {
        c += r * (1.0 / 479001600 + r * (-1.0 / 87178291200.0 + r * (1.0 / 20922789888000.0)));
        s += r * (1.0 / 6227020800.0 + r * (-1.0 / 1307674368000.0 + r * (1.0 / 355687428096000.0)));
    }
    c = r * (-0.5 + r * (1.0 / 24 + r * (-1.0 / 720 + r * (1.0 / 40320 + r * c))));
    s = scale * (1.0 + r * (-1.0 / 6 + r * (1.0 / 120 + r * (-1.0 / 5040 + r * (1.0 / 362880 + r * s)))));
    for (; halvings; --halvings) { /* cos 2x - 1 and sin 2x */
        s = 2.0 * s * (1.0 + c);
        c = 2.0 * c * (2.0 + c);
    }
    const V vx = s * x, vy = s * y, vz = s * z, q0 = q[0], qx = q[1], qy = q[2], qz = q[3];
    q[0] += q0 * c - (qx * vx + qy * vy + qz * vz);
    q[1] += qx * c + (q0 * vx + (qy * vz - qz * vy));
    q[2] += qy * c + (q0 * vy + (qz * vx - qx * vz));
    q[3] += qz * c + (q0 * vz + (qx * vy - qy * vx));
}
#else
static const double inverse_factorial[22] = {1.0, 1.0, 1.0 / 2, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720, 1.0 / 5040,
    1.0 / 40320, 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800.0, 1.0 / 87178291200.0,
    1.0 / 1307674368000.0, 1.0 / 20922789888000.0, 1.0 / 355687428096000.0, 1.0 / 6402373705728000.0,
    1.0 / 121645100408832000.0, 1.0 / 2432902008176640000.0, 1.0 / 51090942171709440000.0};

/* A scaled by a power of 2 so that its norm, which is returned, is at most `most`; how often it was halved. */
static double halve(V *A, double most, int *halvings)
{
    V norm = splat(0.0), second = norm; /* two sums, since one would wait for itself */
    for (int k = 0; k + 1 < MATRIX; k += 2) {
        norm += A[k] * A[k];
        second += A[k + 1] * A[k + 1];
    }
    if (MATRIX % 2) {
        norm += A[MATRIX - 1] * A[MATRIX - 1];
    }
    double size = sqrt(largest(norm + second));
    for (*halvings = 0; size > most && *halvings < 60; size *= 0.5) {
        ++*halvings;
    }
    if (*halvings) {
        EACH(k, MATRIX) { A[k] *= ldexp(1.0, -*halvings); }
    }
    return size;
}

#if SKEW
/*
 * d = exp(A) - 1 = (cosh A - 1) + sinh A, Hermitian and skew-Hermitian: polynomials of degree 2 m in S = A^2, the second times A, by Paterson
 * and Stockmeyer in powers of S^m. All that is multiplied commutes, so that of every product half is enough.
 */
static void exponential_less_one(V *A, double size, V *d)
{
    const int m = POWERS(size);
    const double *const even = inverse_factorial, *const odd = inverse_factorial + 1;
    enum { ROOM = MATRIX + APART };
    V power[6][ROOM], cosh[ROOM], sinh[ROOM], high[ROOM];
    half_product(A, A, power[1], 1.0);
    for (int p = 2; p <= m; ++p) {
        half_product(power[p / 2], power[p - p / 2], power[p], 1.0);
    }
    EACH_ABOVE(k) {
        V c = even[2 * (m + 1)] * power[1][k], s = odd[2 * (m + 1)] * power[1][k];
        for (int p = 2; p <= m; ++p) {
            c += even[2 * (m + p)] * power[p][k];
            s += odd[2 * (m + p)] * power[p][k];
        }
        SET_HERMITIAN(cosh, c);
        SET_HERMITIAN(sinh, s);
    }
    half_product(power[m], cosh, high, 1.0);
    half_product(power[m], sinh, d, 1.0);
    EACH_ABOVE(k) {
        V c = high[k], s = d[k];
        for (int p = m; p > 0; --p) { /* the largest last */
            c += even[2 * p] * power[p][k];
            s += odd[2 * p] * power[p][k];
        }
        cosh[k] = c;
        SET_HERMITIAN(sinh, s);
    }
    half_product(A, sinh, high, -1.0);
    EACH_ABOVE(k) {
        const V s = A[k] + high[k];
        d[k] = cosh[k] + s;
        d[mirror] = (1.0 - 2.0 * part) * (cosh[k] - s);
    }
}
#define MOST_SIZE 1.5
#else
/* d = exp(A) - 1: Taylor of degree 6, 9, 12, 15 or 18 by Paterson and Stockmeyer in powers of A^3. */
static void exponential_less_one(V *A, double size, V *d)
{
    V square[MATRIX], cube[MATRIX], next[MATRIX];
    const int degree = DEGREE(size);
    multiply(A, A, square);
    multiply(square, A, cube);
    EACH(k, MATRIX) {
        d[k] = inverse_factorial[degree - 2] * A[k] + inverse_factorial[degree - 1] * square[k] + inverse_factorial[degree] * cube[k];
    }
    for (int low = degree - 5; low > 0; low -= 3) {
        multiply(cube, d, next);
        EACH(k, MATRIX) {
            d[k] = inverse_factorial[low] * A[k] + (inverse_factorial[low + 1] * square[k]
                + (inverse_factorial[low + 2] * cube[k] + next[k]));
        }
    }
}
#define MOST_SIZE 1.0
#endif

/* d = exp(A) - 1, of A halved until it is small, squared again. */
static void increment(V *A, V *d)
{
    int halvings;
    const double size = halve(A, MOST_SIZE, &halvings);
    exponential_less_one(A, size, d);
    for (; halvings; --halvings) { /* (1 + d)^2 - 1 */
        V next[MATRIX];
        multiply(d, d, next);
        EACH(k, MATRIX) { d[k] = 2.0 * d[k] + next[k]; }
    }
}

static inline void move(V *omega, V *X)
{
    V d[MATRIX + APART], Xd[MATRIX];
#if COORDINATES
    V A[MATRIX];
    hat(omega, A);
    increment(A, d);
#else
    increment(omega, d);
#endif
    multiply(X, d, Xd);
    EACH(k, MATRIX) { X[k] += Xd[k]; }
}
#endif

static inline void identity(V *state)
{
#if QUATERNION
    EACH(k, 4) { state[k] = splat(k == 0 ? 1.0 : 0.0); }
#else
    EACH(k, MATRIX) { state[k] = splat(0.0); }
    EACH(i, ROWS) { state[i * SIZE + i] = splat(1.0); }
#endif
}

/* One lane of a state as a whole matrix: real parts, then imaginary ones. */
static void to_matrix(const double *state, double *X)
{
    memset(X, 0, FULL * sizeof(double));
#if QUATERNION
    {
        const double scale = 1.0 / sqrt(state[0] * state[0] + state[1] * state[1] + state[2] * state[2] + state[3] * state[3]);
        const double unit[4] = {state[0] * scale, state[1] * scale, state[2] * scale, state[3] * scale};
        quaternion_matrix(unit, X);
    }
#else
    EACH(p, PARTS) { memcpy(X + p * SIZE * SIZE, state + p * ROWS * SIZE, ROWS * SIZE * sizeof(double)); }
    for (int i = ROWS; i < SIZE; ++i) {
        X[i * SIZE + i] = 1.0;
    }
#endif
}

/* z = x y of whole matrices, one lane. */
static void multiply_one(const double *x, const double *y, double *z)
{
    EACH(i, SIZE) {
        EACH(j, SIZE) {
            double re = 0.0, im = 0.0;
            EACH(m, SIZE) {
                re += x[i * SIZE + m] * y[m * SIZE + j];
#if PARTS == 2
                re -= x[FULL / 2 + i * SIZE + m] * y[FULL / 2 + m * SIZE + j];
                im += x[i * SIZE + m] * y[FULL / 2 + m * SIZE + j] + x[FULL / 2 + i * SIZE + m] * y[m * SIZE + j];
#endif
            }
            z[i * SIZE + j] = re;
            if (PARTS == 2) {
                z[FULL / 2 + i * SIZE + j] = im;
            }
        }
    }
}

/* Numpy's order: row by row, (re, im) together where complex. */
static void put(const double *X, double *to)
{
    EACH(k, SIZE * SIZE) {
        EACH(p, PARTS) { to[PARTS * k + p] = X[p * SIZE * SIZE + k]; }
    }
}

static void get(const double *from, double *X)
{
    EACH(k, SIZE * SIZE) {
        EACH(p, PARTS) { X[p * SIZE * SIZE + k] = from[PARTS * k + p]; }
    }
}

#endif
