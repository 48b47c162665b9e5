/* By what rules steps of the pair 8(5, 3) on groups follow each other: of one member (pair853.c), and of each on its lane (pair_lanes.c). */
#ifndef LIE_CODEGEN_PAIR_CONTROL_H
#define LIE_CODEGEN_PAIR_CONTROL_H

#include <math.h>
#include <stddef.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

/* Inputs of a rate beside X, y and t; results of a run, as flow/pair_library.py knows them. */
enum { MOST_NUMBERS = 32, DONE = 0, FULL = 1, STUCK = 2, LOST = 3, MANY = 4 };

/* A first step: by the size of Theta and of what the rates k change of y, of which entry i lies at i * apart. */
static double first_step(ptrdiff_t size, ptrdiff_t apart, const double *y, const double *k)
{
    double fastest = 0.0;
    for (ptrdiff_t i = 0; i < size; ++i) {
        const double rate = fabs(k[apart * i]) / (fabs(y[apart * i]) + 1.0);
        fastest = rate > fastest ? rate : fastest;
    }
    return fastest > 0.0 ? 0.3 / fastest : INFINITY;
}

/* The length behind one that was refused. 0.2 of it where the factor is NaN, and where the stages ran away: how far says nothing. */
static double shorter(double h, double factor)
{
    return h * (factor > 0.2 ? factor : 0.2);
}

/* By how much a step may grow for an error of order 8, over what is allowed, or has to shrink. */
static double longer(double error)
{
    return 0.9 / sqrt(sqrt(sqrt(error)));
}

/* Whether a step is so short that t + h would be t. */
static int vanishes(double h, double t)
{
    return !(h > 1e-15 * fabs(t)) || h < 1e-300;
}

/* The length behind a step of length h, where `wish` could have been: a step that was cut says nothing against its length. */
static double next_length(double h, double wish, double factor)
{
    const double next = h * (factor > 6.0 ? 6.0 : factor < 0.2 ? 0.2 : factor);
    return h < wish && next < wish ? wish : next;
}

/* t + h, the sum in two doubles. */
static void later(double *t, double *low, double h)
{
    const double sum = *t + h, rest = (*t - sum) + h + *low;
    *t = sum + rest;
    *low = rest - (*t - sum);
}

#endif
