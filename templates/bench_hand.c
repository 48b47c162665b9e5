/*
 * What an engineer would write: RK4 of the SO(3) Wei-Norman equations, X = exp(g1 A1) exp(g2 A2) exp(g3 A3), with libm;
 * and the limits of one core: reading, writing past the caches, multiply-adds.
 */
#include <math.h>
#include <stddef.h>

static void rate(const double *g, const double *u, double *out)
{
    const double s2 = sin(g[1]), c2 = cos(g[1]), s3 = sin(g[2]), c3 = cos(g[2]);
    const double first = (u[0] * c3 - u[1] * s3) / c2;
    out[0] = first;
    out[1] = u[0] * s3 + u[1] * c3;
    out[2] = u[2] - s2 * first;
}

void hand_scan(ptrdiff_t n, const double *g0, const double *u0, const double *um, const double *u1, double h, double *to);
void hand_scan(ptrdiff_t n, const double *g0, const double *u0, const double *um, const double *u1, double h, double *to)
{
    double g[3], x[3], k1[3], k2[3], k3[3], k4[3];
    ptrdiff_t k;
    int i;
    for (i = 0; i < 3; ++i) {
        to[i] = g[i] = g0[i];
    }
    for (k = 0; k < n; ++k, u0 += 3, um += 3, u1 += 3) {
        rate(g, u0, k1);
        for (i = 0; i < 3; ++i) {
            x[i] = g[i] + 0.5 * h * k1[i];
        }
        rate(x, um, k2);
        for (i = 0; i < 3; ++i) {
            x[i] = g[i] + 0.5 * h * k2[i];
        }
        rate(x, um, k3);
        for (i = 0; i < 3; ++i) {
            x[i] = g[i] + h * k3[i];
        }
        rate(x, u1, k4);
        to += 3;
        for (i = 0; i < 3; ++i) {
            to[i] = g[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
    }
}

typedef double wide __attribute__((vector_size(64), aligned(8)));

double read_all(ptrdiff_t n, const double *x);
double read_all(ptrdiff_t n, const double *x)
{
    wide a = {0.0}, b = a, c = a, d = a;
    ptrdiff_t k;
    for (k = 0; k + 32 <= n; k += 32) {
        a += *(const wide *)(x + k);
        b += *(const wide *)(x + k + 8);
        c += *(const wide *)(x + k + 16);
        d += *(const wide *)(x + k + 24);
    }
    a += b + c + d;
    return a[0] + a[1] + a[2] + a[3] + a[4] + a[5] + a[6] + a[7];
}

/* x is aligned to 64 bytes. */
void write_all(ptrdiff_t n, double *x);
void write_all(ptrdiff_t n, double *x)
{
    typedef double line __attribute__((vector_size(64)));
    const line one = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
    ptrdiff_t k;
    for (k = 0; k + 8 <= n; k += 8) {
#if defined(__clang__)
        __builtin_nontemporal_store(one, (line *)(x + k));
#elif defined(__AVX512F__)
        __builtin_ia32_movntpd512(x + k, one);
#else
        *(line *)(x + k) = one;
#endif
    }
    __sync_synchronize();
}

/* 12 n independent multiply-adds of 8 doubles. */
double multiply_add(ptrdiff_t n, double x);
double multiply_add(ptrdiff_t n, double x)
{
    wide s[12], f, total = {0.0};
    ptrdiff_t k;
    int i;
    for (i = 0; i < 8; ++i) {
        f[i] = x;
    }
    for (i = 0; i < 12; ++i) {
        s[i] = f * (double)i;
    }
    for (k = 0; k < n; ++k) {
        for (i = 0; i < 12; ++i) {
            s[i] = s[i] * f + f;
        }
    }
    for (i = 0; i < 12; ++i) {
        total += s[i];
    }
    return total[0] + total[7];
}
