/* The exponent Omega of a step, X(t + h) = X(t) exp(Omega), from its generators; and the brackets and products it needs. */
#ifndef MAGNUS_EXPONENT_H
#define MAGNUS_EXPONENT_H

/* ---- matrices: real parts, then imaginary ones, ROWS x SIZE each; below are zeros ---- */

/* One entry of z = x y; y's rows from ROWS on are zero. */
static inline void entry(const V *x, const V *y, V *z, int i, int j)
{
    V re = x[i * SIZE] * y[j];
#if PARTS == 2
    V im = x[i * SIZE] * y[MATRIX / 2 + j] + x[MATRIX / 2 + i * SIZE] * y[j];
    re -= x[MATRIX / 2 + i * SIZE] * y[MATRIX / 2 + j];
#endif
    for (int m = 1; m < ROWS; ++m) {
        re += x[i * SIZE + m] * y[m * SIZE + j];
#if PARTS == 2
        re -= x[MATRIX / 2 + i * SIZE + m] * y[MATRIX / 2 + m * SIZE + j];
        im += x[i * SIZE + m] * y[MATRIX / 2 + m * SIZE + j];
        im += x[MATRIX / 2 + i * SIZE + m] * y[m * SIZE + j];
#endif
    }
    z[i * SIZE + j] = re;
#if PARTS == 2
    z[MATRIX / 2 + i * SIZE + j] = im;
#endif
}

#if MATRIX > 32 && PARTS == 2
/* Four entries at once, two rows by two columns: what is loaded is used twice, and eight sums do not wait for each other. */
static inline void four_entries(const V *x, const V *y, V *z, int i, int j)
{
    const V *const p = x + i * SIZE, *const q = p + SIZE;
    V re00 = splat(0.0), re01 = re00, re10 = re00, re11 = re00, im00 = re00, im01 = re00, im10 = re00, im11 = re00;
    for (int m = 0; m < ROWS; ++m) {
        const V *const u = y + m * SIZE + j;
        const V a = p[m], b = q[m], ai = p[MATRIX / 2 + m], bi = q[MATRIX / 2 + m];
        const V c = u[0], d = u[1], ci = u[MATRIX / 2], di = u[MATRIX / 2 + 1];
        re00 += a * c;
        re01 += a * d;
        re10 += b * c;
        re11 += b * d;
        im00 += a * ci;
        im01 += a * di;
        im10 += b * ci;
        im11 += b * di;
        re00 -= ai * ci;
        re01 -= ai * di;
        re10 -= bi * ci;
        re11 -= bi * di;
        im00 += ai * c;
        im01 += ai * d;
        im10 += bi * c;
        im11 += bi * d;
    }
    z += i * SIZE + j;
    z[0] = re00;
    z[1] = re01;
    z[SIZE] = re10;
    z[SIZE + 1] = re11;
    z += MATRIX / 2;
    z[0] = im00;
    z[1] = im01;
    z[SIZE] = im10;
    z[SIZE + 1] = im11;
}

/* z = x y. */
static __attribute__((noinline)) void multiply(const V *x, const V *y, V *z)
{
    for (int i = 0; i + 1 < ROWS; i += 2) {
        for (int j = 0; j + 1 < SIZE; j += 2) {
            four_entries(x, y, z, i, j);
        }
        if (SIZE % 2) {
            entry(x, y, z, i, SIZE - 1);
            entry(x, y, z, i + 1, SIZE - 1);
        }
    }
    if (ROWS % 2) {
        EACH(j, SIZE) { entry(x, y, z, ROWS - 1, j); }
    }
}
#else
/* z = x y. */
#if MATRIX > 16
__attribute__((noinline))
#endif
static void multiply(const V *x, const V *y, V *z)
{
    EACH(i, ROWS) {
        EACH(j, SIZE) { entry(x, y, z, i, j); }
    }
}
#endif

#if !COORDINATES
/* [x, y]; of skew-Hermitian matrices y x = (x y)^H, so that one product is enough. */
static void matrix_bracket(const V *x, const V *y, V *z)
{
    V xy[MATRIX];
    multiply(x, y, xy);
#if SKEW
    EACH(i, SIZE) {
        EACH(j, SIZE) {
            z[i * SIZE + j] = xy[i * SIZE + j] - xy[j * SIZE + i];
#if PARTS == 2
            z[MATRIX / 2 + i * SIZE + j] = xy[MATRIX / 2 + i * SIZE + j] + xy[MATRIX / 2 + j * SIZE + i];
#endif
        }
    }
#else
    V yx[MATRIX];
    multiply(y, x, yx);
    EACH(i, MATRIX) { z[i] = xy[i] - yx[i]; }
#endif
}
#define BRACKET matrix_bracket
#else
#define BRACKET lie_bracket
#endif

/* ---- the exponent: brackets have the sign of X' = X A, c(a, b) = -[a, b] ---- */

/* Intermediate values that the derivative needs again. */
typedef struct {
    V x1[WORK], y1[WORK], s1[WORK], w1[WORK], r1[WORK], x2[WORK], y2[WORK], s2[WORK], t2[WORK], x3[WORK], y3[WORK], r2[WORK], x4[WORK], y4[WORK];
} Stages;

/* Blanes, Casas and Ros, BIT 40 (2000) 434. */
#if DIM > 6
__attribute__((noinline))
#endif
static void exponent8(const V a[ORDERS][WORK], Stages *st, V *omega)
{
    V s3[WORK];
    EACH(k, WORK) {
        st->x1[k] = a[0][k] + a[2][k] * (1.0 / 28);
        st->y1[k] = a[1][k] + a[3][k] * (3.0 / 28);
    }
    BRACKET(st->x1, st->y1, st->s1);
    EACH(k, WORK) {
        st->s1[k] *= 1.0 / 28;
        st->w1[k] = st->s1[k] - a[2][k] * (1.0 / 14);
    }
    BRACKET(a[0], st->w1, st->r1);
    EACH(k, WORK) {
        st->r1[k] *= -1.0 / 3;
        st->x2[k] = st->x1[k] + st->s1[k];
        st->y2[k] = st->y1[k] + st->r1[k];
    }
    BRACKET(st->x2, st->y2, st->s2);
    BRACKET(a[1], st->s1, st->t2);
    EACH(k, WORK) {
        st->s2[k] = -st->s2[k];
        st->t2[k] = -st->t2[k];
        st->x3[k] = a[0][k] + 1.25 * st->s1[k];
        st->y3[k] = 2.0 * a[2][k] + st->s2[k] + 0.5 * st->t2[k];
    }
    BRACKET(st->x3, st->y3, st->r2);
    EACH(k, WORK) {
        st->r2[k] = -st->r2[k];
        st->x4[k] = a[0][k] + a[2][k] * (1.0 / 12) - st->s1[k] * (7.0 / 3) - st->s2[k] * (1.0 / 6);
        st->y4[k] = -9.0 * a[1][k] - 2.25 * a[3][k] + 63.0 * st->r1[k] + st->r2[k];
    }
    BRACKET(st->x4, st->y4, s3);
    EACH(k, WORK) { omega[k] = (a[0][k] + a[2][k] * (1.0 / 12)) - st->s2[k] * (7.0 / 120) - s3[k] * (1.0 / 360); }
}

/* From moments of four orders, a_2 of three is a_2 + 3 a_4 / 20. */
static inline void exponent6(const V a[ORDERS][WORK], V *omega)
{
    V b[WORK], first[WORK], x[WORK], second[WORK];
    EACH(k, WORK) { b[k] = a[1][k] + 0.15 * a[3][k]; }
    BRACKET(a[0], b, first);
    EACH(k, WORK) { x[k] = 2.0 * a[2][k] - first[k]; }
    BRACKET(a[0], x, second);
    EACH(k, WORK) {
        x[k] = -20.0 * a[0][k] - a[2][k] - first[k];
        b[k] += second[k] * (1.0 / 60);
    }
    BRACKET(x, b, second);
    EACH(k, WORK) { omega[k] = (a[0][k] + a[2][k] * (1.0 / 12)) - second[k] * (1.0 / 240); }
}

static inline void exponent4(const V a[ORDERS][WORK], V *omega)
{
    V b[WORK], first[WORK];
    EACH(k, WORK) { b[k] = a[1][k] + 0.15 * a[3][k]; }
    BRACKET(a[0], b, first);
    EACH(k, WORK) { omega[k] = (a[0][k] + a[2][k] * (1.0 / 12)) + first[k] * (1.0 / 12); }
}

#endif
