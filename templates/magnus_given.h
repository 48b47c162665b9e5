/* What Python gives: u and the steps, in doubles whatever the lanes compute in. */
#ifndef MAGNUS_GIVEN_H
#define MAGNUS_GIVEN_H

typedef double Given;

/* Strides in doubles from one trajectory to the next; 0 where all share. */
typedef struct {
    ptrdiff_t rates, wave_stride, rate_stride;
    const double *rate, *rate_low;         /* w_f and what rounding left of it */
    const double *cosines, *sines;         /* rates x DIM */
    const double *times;                   /* ends of the pieces; NULL without */
    const double *left, *right;            /* pieces x DIM: at the start and the end of each, straight between */
    ptrdiff_t line_stride;
    ptrdiff_t terms;                       /* of Legendre series instead, on [-1, 1] of each piece; 0 without */
    const double *series;                  /* pieces x terms x DIM */
    ptrdiff_t nodes, table_stride;
    const double *table;                   /* steps x nodes x DIM: values at the nodes of every step; NULL without */
    const double *projection;              /* ORDERS x nodes: from values at nodes to generators, over h */
    ptrdiff_t tangents, tangent_stride;
    const double *tangent;                 /* steps x nodes x tangents x DIM: derivatives of the values */
    const double *factor;                  /* of u */
    ptrdiff_t factor_stride;
} Input;

/* Spans between knots, parts[s] equal steps each; `first` are their running sums. */
typedef struct {
    ptrdiff_t spans;
    const double *knots;
    const ptrdiff_t *parts, *first, *piece, *slot; /* piece of the input; where the state at the end goes, or -1 */
} Grid;

#endif
