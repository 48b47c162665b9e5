/* One step of every lane, X <- X exp(Omega). */
#ifndef MAGNUS_STEP_H
#define MAGNUS_STEP_H

/* One step of every lane. */
static __attribute__((noinline)) void step(const Input *u, Source *source, int order, V middle, V low, V h, const double *const *table,
    V *state)
{
    V a[ORDERS][DIM], omega[WORK];
    generators(u, source, middle, low, h, table, a);
#if COORDINATES
#define IN_WORK a
#else
    V work[ORDERS][MATRIX];
    EACH(j, ORDERS) { hat_work(a[j], work[j]); }
#if ABOVE
    EACH(j, 2) { /* brackets read these two */
        EACH_ABOVE(k) { SET_SKEW(work[j], work[j][k]); }
    }
#endif
#define IN_WORK work
#endif
    if (order == 8) {
        Stages stages;
        exponent8((const V (*)[WORK])IN_WORK, &stages, omega);
    } else if (order == 6) {
        exponent6((const V (*)[WORK])IN_WORK, omega);
    } else {
        exponent4((const V (*)[WORK])IN_WORK, omega);
    }
    move(omega, state);
}

#endif
