/*
 * A vector of doubles, or of floats where SINGLE is 1; u and time are given in doubles. How many lanes it has is chosen here, when this is
 * compiled: what the processor's registers hold. Wider vectors than that go through memory, narrower ones leave half idle.
 */
#ifndef MAGNUS_LANES_H
#define MAGNUS_LANES_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

#ifndef SINGLE
#define SINGLE 0
#endif
/* Doubles, or floats, of a register. */
#if defined(__AVX512F__)
#define WIDTH (8 << SINGLE)
#elif defined(__AVX2__) && defined(__FMA__)
#define WIDTH (4 << SINGLE)
#else
#define WIDTH (2 << SINGLE)
#endif
#ifndef LANES
#define LANES WIDTH
#endif

/* One entry for each lane, in braces: each(0), each(1), ... */
#define TWO(each, l) each(l), each(l + 1)
#define FOUR(each, l) TWO(each, l), TWO(each, l + 2)
#define EIGHT(each, l) FOUR(each, l), FOUR(each, l + 4)
#if LANES == 2
#define LANEWISE(each) {TWO(each, 0)}
#elif LANES == 4
#define LANEWISE(each) {FOUR(each, 0)}
#elif LANES == 8
#define LANEWISE(each) {EIGHT(each, 0)}
#elif LANES == 16
#define LANEWISE(each) {EIGHT(each, 0), EIGHT(each, 8)}
#else
#error "LANES is 2, 4, 8 or 16"
#endif

#define TABLES (!SINGLE)
#if SINGLE
/* Angles are taken afresh often: every turn rounds them by 1e-7. */
enum { ORDERS = 4, AFRESH = 8 };
typedef float Real;
typedef int Bits;

/* Degrees of the series of exp in magnus_move.h: what they leave out is some 1e-8 for each unit of |Omega|. */
#define POWERS(size) ((size) <= 0.13f ? 1 : (size) <= 0.71f ? 2 : 3)
#define DEGREE(size) ((size) <= 0.24f ? 6 : (size) <= 0.71f ? 9 : 12)
#else
enum { ORDERS = 4, MOST_NODES = 12, AFRESH = 64 };
typedef double Real;
typedef long long Bits;

/* Degrees of the series of exp in magnus_move.h: what they leave out is some 1e-17 for each unit of |Omega|. */
#define POWERS(size) ((size) <= 0.0044 ? 1 : (size) <= 0.09 ? 2 : (size) <= 0.36 ? 3 : (size) <= 0.85 ? 4 : 5)
#define DEGREE(size) ((size) <= 0.006 ? 6 : (size) <= 0.07 ? 9 : (size) <= 0.24 ? 12 : (size) <= 0.56 ? 15 : 18)
#endif

typedef Real V __attribute__((vector_size(LANES * sizeof(Real))));
typedef Bits I __attribute__((vector_size(LANES * sizeof(Real))));

#define EACH(k, n) for (int k = 0; k < (n); ++k)

/* x stays in its register: tuned for Zen, gcc reads it from memory again for every product, and loads become the limit. */
#if defined(__FMA__) && !defined(__clang__) && LANES <= WIDTH
#define HELD(x) __asm__("" : "+v"(x))
#else
#define HELD(x) (void)(x)
#endif

static inline V splat(Real x)
{
#define SAME(l) x
    return (V)LANEWISE(SAME);
#undef SAME
}

/*
 * The largest of numbers that are not negative; a NaN shows, of either sign. Bits without the sign have the order of the numbers, those of a
 * NaN come last: lanes are compared as integers, in pairs.
 */
static inline Real largest(V x)
{
    const Bits second_highest = (Bits)1 << (8 * (int)sizeof(Real) - 2);
    I most = (I)x & (second_highest - 1 + second_highest);
#define ACROSS(l) most[(l) ^ (LANES / 2)]
#define NEAR(l) most[(l) ^ (LANES / 4)]
#define NEXT(l) most[(l) ^ (LANES / 8)]
#define LARGER_OF(other) \
    do { \
        const I second = (I)LANEWISE(other), larger = most > second; \
        most = (most & larger) | (second & ~larger); \
    } while (0)
    LARGER_OF(ACROSS);
#if LANES > 2
    LARGER_OF(NEAR);
#endif
#if LANES > 4
    LARGER_OF(NEXT);
#endif
#undef LARGER_OF
#undef ACROSS
#undef NEAR
#undef NEXT
    x = (V)most;
#if LANES > 8
    return x[0] > x[1] || x[0] != x[0] ? x[0] : x[1];
#else
    return x[0];
#endif
}

/* a b + c, rounded once: one instruction where the processor has it, else a call for each lane. */
static inline V fused(V a, V b, V c)
{
    V r;
#if SINGLE
    EACH(l, LANES) { r[l] = __builtin_fmaf(a[l], b[l], c[l]); }
#else
    EACH(l, LANES) { r[l] = __builtin_fma(a[l], b[l], c[l]); }
#endif
    return r;
}

/* cos and sin of p + e, e small: p less the nearest multiple of pi/2, in three pieces, then Taylor to 1e-18, of floats to 1e-9. */
static inline void cos_sin(V p, V e, V *c, V *s)
{
    enum { TOP = 8 * (int)sizeof(Real) - 2 }; /* moves 2 to the sign */
#if SINGLE
    const Real magic = 12582912.0f, quarters = 0.63661977f, turn = 1.570796251296997f, rest = 7.549789415861596e-8f, last = 5.390302529957765e-15f;
#else
    const Real magic = 6755399441055744.0, quarters = 0.6366197723675814, turn = 1.5707963267948966, rest = 6.123233995736766e-17,
        last = -1.4973849048591833e-33;
#endif
    const V n = (p * quarters + magic) - magic;
    const I k = (I)(n + magic);
    const V r = (fused(-n, splat(rest), fused(-n, splat(turn), p)) - n * last) + e, z = r * r;
#if SINGLE
    const V sine_tail = splat(1.0f / 362880), cosine_tail = splat(-1.0f / 3628800);
#else
    const V sine_tail = 1.0 / 362880 + z * (-1.0 / 39916800 + z * (1.0 / 6227020800.0 + z * (-1.0 / 1307674368000.0
        + z * (1.0 / 355687428096000.0))));
    const V cosine_tail = -1.0 / 3628800 + z * (1.0 / 479001600 + z * (-1.0 / 87178291200.0 + z * (1.0 / 20922789888000.0)));
#endif
    const Real one = 1;
    const V sine = r + r * z * (-one / 6 + z * (one / 120 + z * (-one / 5040 + z * sine_tail)));
    const V cosine = one + z * (-one / 2 + z * (one / 24 + z * (-one / 720 + z * (one / 40320 + z * cosine_tail))));
    const I odd = -(k & 1), minus_sine = (k & 2) << TOP, minus_cosine = ((k + 1) & 2) << TOP;
    *s = (V)(((odd & (I)cosine) | (~odd & (I)sine)) ^ minus_sine);
    *c = (V)(((odd & (I)sine) | (~odd & (I)cosine)) ^ minus_cosine);
}

#endif
