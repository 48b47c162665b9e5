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

/* Complex matrices in blocks of 2 x 2; of 4 x 4 single entries where a vector has eight doubles, blocks where it has fewer (measured). */
#define BLOCKS (PARTS == 2 && MATRIX >= (LANES == 8 << SINGLE ? 33 : 32))

/* Real matrices in tiles of 3 x 3, which sixteen registers hold; small ones of small algebras are written out whole by the compiler (measured). */
#define TILES (PARTS == 1 && (DIM > 8 || MATRIX > 16))
#define SIDE 3

#if BLOCKS
/* Four entries at once, two rows by two columns: what is loaded is used twice, and eight sums do not wait for each other. */
static inline __attribute__((always_inline)) void four_entries(const V *x, const V *y, int i, int j, V block[8])
{
    const V *const p = x + i * SIZE, *const q = p + SIZE;
    V re00 = splat(0.0), re01 = re00, re10 = re00, re11 = re00, im00 = re00, im01 = re00, im10 = re00, im11 = re00;
    for (int m = 0; m < ROWS; ++m) {
        const V *const u = y + m * SIZE + j;
        V a = p[m], b = q[m], ai = p[MATRIX / 2 + m], bi = q[MATRIX / 2 + m];
        V c = u[0], d = u[1], ci = u[MATRIX / 2], di = u[MATRIX / 2 + 1];
        HELD(a);
        HELD(b);
        HELD(ai);
        HELD(bi);
        HELD(c);
        HELD(d);
        HELD(ci);
        HELD(di);
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
    block[0] = re00;
    block[1] = re01;
    block[2] = re10;
    block[3] = re11;
    block[4] = im00;
    block[5] = im01;
    block[6] = im10;
    block[7] = im11;
}

/* Such a block where its first entry lies in the matrix. */
static inline void put_block(const V block[8], V *to)
{
    V *const next = to + SIZE;
    to[0] = block[0];
    to[1] = block[1];
    next[0] = block[2];
    next[1] = block[3];
    to[MATRIX / 2] = block[4];
    to[MATRIX / 2 + 1] = block[5];
    next[MATRIX / 2] = block[6];
    next[MATRIX / 2 + 1] = block[7];
}

/* z = x y. */
static __attribute__((noinline)) void multiply(const V *x, const V *y, V *z)
{
    for (int i = 0; i + 1 < ROWS; i += 2) {
        for (int j = 0; j + 1 < SIZE; j += 2) {
            V block[8];
            four_entries(x, y, i, j, block);
            put_block(block, z + i * SIZE + j);
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
#elif TILES
/* The loop is written out: what runs over a tile has to be in registers. */
#define EACH_OF(k, n) _Pragma("GCC unroll 4") EACH(k, n)
/* Entries of a real z = x y, `rows` by `columns` of them from (i, j) on, both constants: what is loaded is used as often, and the sums do not wait for each other. */
static inline __attribute__((always_inline)) void tile(const V *x, const V *y, V *z, int i, int j, int rows, int columns)
{
    V sum[SIDE][SIDE];
    EACH_OF(r, rows) {
        EACH_OF(c, columns) { sum[r][c] = splat(0.0); }
    }
    for (int m = 0; m < ROWS; ++m) {
        V left[SIDE], right[SIDE];
        EACH_OF(r, rows) {
            left[r] = x[(i + r) * SIZE + m];
            HELD(left[r]);
        }
        EACH_OF(c, columns) {
            right[c] = y[m * SIZE + j + c];
            HELD(right[c]);
        }
        EACH_OF(r, rows) {
            EACH_OF(c, columns) { sum[r][c] += left[r] * right[c]; }
        }
    }
    EACH_OF(r, rows) {
        EACH_OF(c, columns) { z[(i + r) * SIZE + j + c] = sum[r][c]; }
    }
}

/* `rows` of z = x y from row i on, from column j on. */
static inline __attribute__((always_inline)) void strip(const V *x, const V *y, V *z, int i, int j, int rows)
{
    for (; j + SIDE <= SIZE; j += SIDE) {
        tile(x, y, z, i, j, rows, SIDE);
    }
    if (SIZE % SIDE) {
        tile(x, y, z, i, j, rows, SIZE % SIDE);
    }
}

/* z = x y. */
static __attribute__((noinline)) void multiply(const V *x, const V *y, V *z)
{
    int i = 0;
    for (; i + SIDE <= ROWS; i += SIDE) {
        strip(x, y, z, i, 0, SIDE);
    }
    if (ROWS % SIDE) {
        strip(x, y, z, i, 0, ROWS % SIDE);
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

#if SKEW
/*
 * The entries k on and above the diagonal of both parts, and those across it, `mirror`: of Hermitian and of skew-Hermitian matrices the
 * former are enough. A whole matrix has twice as many, and what moves them, not what computes, takes the time.
 */
#define EACH_ABOVE(k) \
    EACH(part, PARTS) EACH(row, SIZE) \
        for (int k = part * (MATRIX / 2) + row * (SIZE + 1), mirror = k; k < part * (MATRIX / 2) + (row + 1) * SIZE; ++k, mirror += SIZE)
#define SET_HERMITIAN(x, value) ((x)[mirror] = (1.0 - 2.0 * part) * ((x)[k] = (value)))
#define SET_SKEW(x, value) ((x)[mirror] = (2.0 * part - 1.0) * ((x)[k] = (value)))

/* z = x y where x and y commute and each is Hermitian or skew-Hermitian; then so is z, sign being 1 or -1, and half of it is computed. */
#if MATRIX > 16
static __attribute__((noinline))
#else
static inline
#endif
void half_product(const V *x, const V *y, V *z, double sign)
{
#if BLOCKS
    for (int i = 0; i + 1 < SIZE; i += 2) {
        for (int j = i; j + 1 < SIZE; j += 2) {
            V block[8];
            four_entries(x, y, i, j, block);
            put_block(block, z + i * SIZE + j);
        }
    }
    if (SIZE % 2) {
        EACH(i, SIZE) { entry(x, y, z, i, SIZE - 1); }
    }
#elif TILES
    int first = 0;
    for (; first + SIDE <= SIZE; first += SIDE) {
        strip(x, y, z, first, first, SIDE);
    }
    if (SIZE % SIDE) {
        strip(x, y, z, first, first, SIZE % SIDE);
    }
#else
    EACH(i, SIZE) {
        for (int j = i; j < SIZE; ++j) { entry(x, y, z, i, j); }
    }
#endif
    EACH(i, SIZE) {
        EACH(j, i) {
            z[i * SIZE + j] = sign * z[j * SIZE + i];
#if PARTS == 2
            z[MATRIX / 2 + i * SIZE + j] = -sign * z[MATRIX / 2 + j * SIZE + i];
#endif
        }
    }
}
#endif

/* ABOVE: of elements of the algebra the entries above the diagonal are kept, and the others where a bracket is to read them. */
#define ABOVE (SKEW && !COORDINATES && HALVES)
#if ABOVE
#define EACH_WORK(k) EACH_ABOVE(k)
#define hat_work hat_above
#define SET_WORK(x, value) SET_SKEW(x, value)
#else
#define EACH_WORK(k) EACH(k, WORK)
#define hat_work hat
#define SET_WORK(x, value) ((x)[k] = (value))
#endif

#if !COORDINATES
/* [x, y]; of skew-Hermitian matrices y x = (x y)^H, so that one product is enough. */
#if MATRIX > 32
static __attribute__((noinline))
#else
static
#endif
void matrix_bracket(const V *x, const V *y, V *z)
{
#if SKEW && BLOCKS && SIZE % 2 == 0
    for (int i = 0; i < SIZE; i += 2) {
        for (int j = i; j < SIZE; j += 2) {
            V block[8], beyond[8], *across = block;
            four_entries(x, y, i, j, block);
            if (j > i) {
                four_entries(x, y, j, i, across = beyond);
            }
            /* entry (r, s) of the block less the conjugate of (s, r) across */
            const V difference[8] = {block[0] - across[0], block[1] - across[2], block[2] - across[1], block[3] - across[3],
                block[4] + across[4], block[5] + across[6], block[6] + across[5], block[7] + across[7]};
            put_block(difference, z + i * SIZE + j);
            if (!ABOVE && j > i) {
                const V mirrored[8] = {-difference[0], -difference[2], -difference[1], -difference[3],
                    difference[4], difference[6], difference[5], difference[7]};
                put_block(mirrored, z + j * SIZE + i);
            }
        }
    }
#elif SKEW
    V xy[MATRIX];
    multiply(x, y, xy);
    EACH(i, SIZE) {
        for (int j = ABOVE ? i : 0; j < SIZE; ++j) {
            z[i * SIZE + j] = xy[i * SIZE + j] - xy[j * SIZE + i];
#if PARTS == 2
            z[MATRIX / 2 + i * SIZE + j] = xy[MATRIX / 2 + i * SIZE + j] + xy[MATRIX / 2 + j * SIZE + i];
#endif
        }
    }
#else
    V xy[MATRIX], yx[MATRIX];
    multiply(x, y, xy);
    multiply(y, x, yx);
    EACH(i, MATRIX) { z[i] = xy[i] - yx[i]; }
#endif
}
#define BRACKET matrix_bracket
#else
#define BRACKET(x, y, z) \
    EACH(vector, TOGETHER) { lie_bracket((x) + vector * DIM, (y) + vector * DIM, (z) + vector * DIM); }
#endif

/* ---- the exponent: brackets have the sign of X' = X A, c(a, b) = -[a, b] ---- */

/* Intermediate values that the derivative needs again. */
enum { KEPT = WORK + APART };
typedef struct {
    V x1[KEPT], y1[KEPT], s1[KEPT], w1[KEPT], r1[KEPT], x2[KEPT], y2[KEPT], s2[KEPT], t2[KEPT], x3[KEPT], y3[KEPT], r2[KEPT], x4[KEPT], y4[KEPT];
} Stages;

/* Blanes, Casas and Ros, BIT 40 (2000) 434. */
#if DIM > 6
__attribute__((noinline))
#endif
static void exponent8(const V a[ORDERS][WORK], Stages *st, V *omega)
{
    V s3[KEPT];
    EACH_WORK(k) {
        SET_WORK(st->x1, a[0][k] + a[2][k] * (1.0 / 28));
        SET_WORK(st->y1, a[1][k] + a[3][k] * (3.0 / 28));
    }
    BRACKET(st->x1, st->y1, st->s1);
    EACH_WORK(k) {
        SET_WORK(st->s1, st->s1[k] * (1.0 / 28));
        SET_WORK(st->w1, st->s1[k] - a[2][k] * (1.0 / 14));
    }
    BRACKET(a[0], st->w1, st->r1);
    EACH_WORK(k) {
        st->r1[k] *= -1.0 / 3;
        SET_WORK(st->x2, st->x1[k] + st->s1[k]);
        SET_WORK(st->y2, st->y1[k] + st->r1[k]);
    }
    BRACKET(st->x2, st->y2, st->s2);
    BRACKET(a[1], st->s1, st->t2);
    EACH_WORK(k) {
        st->s2[k] = -st->s2[k];
        st->t2[k] = -st->t2[k];
        SET_WORK(st->x3, a[0][k] + 1.25 * st->s1[k]);
        SET_WORK(st->y3, 2.0 * a[2][k] + st->s2[k] + 0.5 * st->t2[k]);
    }
    BRACKET(st->x3, st->y3, st->r2);
    EACH_WORK(k) {
        st->r2[k] = -st->r2[k];
        SET_WORK(st->x4, a[0][k] + a[2][k] * (1.0 / 12) - st->s1[k] * (7.0 / 3) - st->s2[k] * (1.0 / 6));
        SET_WORK(st->y4, -9.0 * a[1][k] - 2.25 * a[3][k] + 63.0 * st->r1[k] + st->r2[k]);
    }
    BRACKET(st->x4, st->y4, s3);
    EACH_WORK(k) { SET_WORK(omega, (a[0][k] + a[2][k] * (1.0 / 12)) - st->s2[k] * (7.0 / 120) - s3[k] * (1.0 / 360)); }
}

/* From moments of four orders, a_2 of three is a_2 + 3 a_4 / 20. */
static inline void exponent6(const V a[ORDERS][WORK], V *omega)
{
    V b[KEPT], first[KEPT], x[KEPT], second[KEPT];
    EACH_WORK(k) { SET_WORK(b, a[1][k] + 0.15 * a[3][k]); }
    BRACKET(a[0], b, first);
    EACH_WORK(k) { SET_WORK(x, 2.0 * a[2][k] - first[k]); }
    BRACKET(a[0], x, second);
    EACH_WORK(k) {
        SET_WORK(x, -20.0 * a[0][k] - a[2][k] - first[k]);
        SET_WORK(b, b[k] + second[k] * (1.0 / 60));
    }
    BRACKET(x, b, second);
    EACH_WORK(k) { SET_WORK(omega, (a[0][k] + a[2][k] * (1.0 / 12)) - second[k] * (1.0 / 240)); }
}

static inline void exponent4(const V a[ORDERS][WORK], V *omega)
{
    V b[KEPT], first[KEPT];
    EACH_WORK(k) { SET_WORK(b, a[1][k] + 0.15 * a[3][k]); }
    BRACKET(a[0], b, first);
    EACH_WORK(k) { SET_WORK(omega, (a[0][k] + a[2][k] * (1.0 / 12)) + first[k] * (1.0 / 12)); }
}

#endif
