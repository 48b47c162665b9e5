/* One step of every lane of the vectors that go together, X <- X exp(Omega). */
#ifndef MAGNUS_STEP_H
#define MAGNUS_STEP_H

/* The lanes of one vector, TOGETHER of which take their steps side by side. */
typedef struct {
    Source source;
    V middle, low, h;           /* of the step, its middle to twice the precision */
    const double *table[LANES]; /* of values at nodes */
    V state[STATE];
} Team;

/* `space`: FRONT * source_vectors + LANES numbers. */
static void gather(const Input *u, Real *space, Team *team)
{
    EACH(part, TOGETHER) {
        lay_out(u, aligned(space) + part * source_vectors(u->rates, u->terms), &team[part].source);
        team[part].source.before = part ? &team[part - 1].source : NULL;
        EACH(l, LANES) { team[part].table[l] = NULL; }
        identity(team[part].state);
    }
}

/* The state of one of the FRONT lanes as a whole matrix. */
static void state_of(const Team *team, int lane, Real *matrix)
{
    Real one[STATE];
    EACH(k, STATE) { one[k] = team[lane / LANES].state[k][lane % LANES]; }
    to_matrix(one, matrix);
}

/* The next step of every lane. */
static __attribute__((noinline)) void step(const Input *u, Team *team, int order)
{
    V a[ORDERS][TOGETHER * DIM], omega[WORK];
    EACH(part, TOGETHER) {
        Team *const t = team + part;
        generators(u, &t->source, t->middle, t->low, t->h, t->table, (V (*)[TOGETHER * DIM])(a[0] + part * DIM));
    }
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
    EACH(part, TOGETHER) { move(omega + part * DIM, team[part].state); }
}

#endif
