/*
 * The step of each of two runs of one system, for pair853.c. A rate is a chain of operations that wait for each other, and over lanes two of
 * them take as long as one; compiled together with the sums between, nothing goes through memory on the way from one stage to the next.
 *
 * Compiled for one rate: PAIR_SOURCE has its text over lanes, PAIR_RATE(X, y, t, number, rate) calls it; PAIR_SIZE, PAIR_PACKED and
 * PAIR_NUMBERS are the lengths of y, of X (0 if y holds the elements) and of all other inputs, PAIR_NUMBER_SIZES that of each and a 0 behind;
 * PAIR_TURNS and PAIR_FRONT `group` and `front` of pair853.c.
 */
#if defined(__AVX2__) && defined(__FMA__)
#define LCG_LANES 4 /* two would do; the builtins of gcc for four spare it a header of a hundred thousand lines */
#elif defined(__SSE2__) || (defined(__aarch64__) && defined(__ARM_NEON))
#define LCG_LANES 2
#endif

#if defined(LCG_LANES)
#define LCG_BLOCK /* nothing of the source but what is called here */
#include PAIR_SOURCE

#include "ode_table.h"
#include "pair_two.h"

#if defined(__clang__)
#define UNROLLED _Pragma("clang loop unroll(full)")
#else
#define UNROLLED _Pragma("GCC unroll 24")
#endif

/* Lane l belongs to run l % 2. */
LCG_INLINE lcg_v of_both(double one, double two)
{
    lcg_v both;
    for (int l = 0; l < LCG_LANES; ++l) {
        both[l] = l % 2 ? two : one;
    }
    return both;
}

/* sum + scale sum_j weight_j k_j. */
LCG_INLINE void add_weighed(const double *weight, int s, const lcg_v k[][PAIR_SIZE], lcg_v scale, lcg_v *sum)
{
    lcg_v all[PAIR_SIZE];
    UNROLLED
    for (int i = 0; i < PAIR_SIZE; ++i) {
        all[i] = sum[i];
    }
    for (int u = 0; u < USES[s]; ++u) { /* stage after stage: the newest, which is waited for, comes last */
        const lcg_v a = scale * weight[USED[s][u]], *from = k[USED[s][u]];
        UNROLLED
        for (int i = 0; i < PAIR_SIZE; ++i) {
            all[i] += a * from[i];
        }
    }
    UNROLLED
    for (int i = 0; i < PAIR_SIZE; ++i) {
        sum[i] = all[i];
    }
}

LCG_INLINE void give(const lcg_v *values, double *one, double *two)
{
    UNROLLED
    for (int i = 0; i < PAIR_SIZE; ++i) {
        one[i] = values[i][0];
        two[i] = values[i][1];
    }
}

/* As errors_of of pair853.c. */
LCG_INLINE void errors(const Half *of, const lcg_v *y, const lcg_v *after, const lcg_v k[][PAIR_SIZE])
{
    const lcg_v rtol = of_both(of[0].rtol, of[1].rtol), atol = of_both(of[0].atol, of[1].atol), one = lcg_splat(1.0);
    lcg_v e5[PAIR_SIZE], e3[PAIR_SIZE], five = lcg_splat(0.0), three = five, angle = five;
    UNROLLED
    for (int i = 0; i < PAIR_SIZE; ++i) {
        e5[i] = e3[i] = five;
    }
    add_weighed(E5, STAGES, k, one, e5);
    add_weighed(E3, STAGES, k, one, e3);
    UNROLLED
    for (int i = 0; i < PAIR_SIZE; ++i) {
        const lcg_v a = lcg_fabs(y[i]), b = lcg_fabs(after[i]);
        lcg_v size = lcg_select(lcg_lt(b, a), a, b);
        size = i < PAIR_TURNS ? one : i < PAIR_FRONT ? lcg_select(lcg_lt(size, one), one, size) : size;
        size = one / (atol + rtol * size);
        e5[i] *= size;
        e3[i] *= size;
        five += e5[i] * e5[i];
        three += e3[i] * e3[i];
        angle += i < PAIR_TURNS ? after[i] * after[i] : lcg_splat(0.0);
    }
    for (int r = 0; r < 2; ++r) {
        const Errors found = {five[r], three[r], angle[r]};
        *of[r].found = found;
    }
}

#if defined(__GNUC__) && !defined(__clang__)
__attribute__((externally_visible)) /* -fwhole-program: what nobody calls is not compiled */
#endif
void pair_two(const Half *of, const double *const *number);
void pair_two(const Half *of, const double *const *number)
{
    static const int sizes[] = {PAIR_NUMBER_SIZES};
    const lcg_v t = of_both(of[0].t, of[1].t), h = of_both(of[0].h, of[1].h);
    lcg_v X[PAIR_PACKED + 1], y[PAIR_SIZE], stage[PAIR_SIZE], k[STAGES][PAIR_SIZE], n[PAIR_NUMBERS + 1];
    int place = 0;
    for (int j = 0; sizes[j]; ++j) {
        for (int i = 0; i < sizes[j]; ++i, ++place) {
            n[place] = lcg_splat(number[j][i]);
        }
    }
    for (int i = 0; i < PAIR_PACKED; ++i) {
        X[i] = of_both(of[0].X[i], of[1].X[i]);
    }
    for (int i = 0; i < PAIR_SIZE; ++i) {
        y[i] = of_both(of[0].y[i], of[1].y[i]);
    }
    (void)X;
    (void)n;
    for (int s = 0; s < STAGES; ++s) {
        const lcg_v now = t + C[s] * h;
        memcpy(stage, y, sizeof stage);
        add_weighed(A[s], s, k, h, stage);
        PAIR_RATE(X, stage, &now, n, k[s]);
    }
    give(k[0], of[0].slope, of[1].slope);
    memcpy(stage, y, sizeof stage);
    add_weighed(B, STAGES, k, h, stage);
    give(stage, of[0].after, of[1].after);
    errors(of, y, stage, k);
}
#endif
