/* The lane mathematics as functions of arrays, for test_vector_math.py; n is a multiple of the lanes. */
#include "lie_codegen_lanes.h"

int lanes(void)
{
    return LCG_LANES;
}

#if LCG_LANES > 1
#define ONE(name) \
    void do_##name(ptrdiff_t n, const double *x, double *y) \
    { \
        ptrdiff_t k; \
        for (k = 0; k < n; k += LCG_LANES) { \
            const lcg_v v = *(const lcg_any *)(x + k); \
            *(lcg_any *)(y + k) = lcg_##name(v); \
        } \
    }
#define TWO(name) \
    void do_##name(ptrdiff_t n, const double *x, const double *z, double *y) \
    { \
        ptrdiff_t k; \
        for (k = 0; k < n; k += LCG_LANES) { \
            const lcg_v a = *(const lcg_any *)(x + k), b = *(const lcg_any *)(z + k); \
            *(lcg_any *)(y + k) = lcg_##name(a, b); \
        } \
    }
ONE(sin) ONE(cos) ONE(tan) ONE(exp) ONE(expm1) ONE(log) ONE(atan) ONE(asin) ONE(acos) ONE(sinh) ONE(cosh) ONE(tanh)
ONE(floor) ONE(ceil) ONE(fabs) ONE(sqrt) ONE(sign)
TWO(atan2) TWO(fmin) TWO(fmax) TWO(copysign)

/* Records of every size there and back: 0 if they arrive in their lanes and return unchanged, past the caches too. */
#define SIZE(s) \
    { \
        double from[s * LCG_LANES], to[s * LCG_LANES], lines[s * LCG_LANES] __attribute__((aligned(64))); \
        lcg_v columns[s]; \
        for (i = 0; i < s * LCG_LANES; ++i) { \
            from[i] = i + 1; \
        } \
        lcg_in(columns, from, s); \
        for (i = 0; i < s; ++i) { \
            for (lane = 0; lane < LCG_LANES; ++lane) { \
                wrong += columns[i][lane] != from[lane * s + i]; \
            } \
        } \
        lcg_out(to, columns, s, 0); \
        wrong += memcmp(from, to, sizeof from) != 0; \
        if (lcg_whole(s)) { \
            lcg_out(lines, columns, s, 1); \
            lcg_fence(); \
            wrong += memcmp(from, lines, sizeof from) != 0; \
        } \
    }

int records(void)
{
    int i, lane, wrong = 0;
    SIZE(1) SIZE(2) SIZE(3) SIZE(4) SIZE(5) SIZE(6) SIZE(7) SIZE(8) SIZE(9) SIZE(10) SIZE(11) SIZE(12) SIZE(13) SIZE(14)
    SIZE(15) SIZE(16) SIZE(17) SIZE(18) SIZE(23) SIZE(24) SIZE(25) SIZE(32) SIZE(36) SIZE(49) SIZE(64)
    return wrong;
}
#endif
