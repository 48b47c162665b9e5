/* What pair853.c gives to pair_two.c, which is compiled for one rate. */
#ifndef LIE_CODEGEN_PAIR_TWO_H
#define LIE_CODEGEN_PAIR_TWO_H

/* Of a step: the sums of squares of both error estimates over what is allowed, and |Theta|^2 behind it. */
typedef struct {
    double five, three, angle;
} Errors;

/* Of one of two runs of a system: where its step begins (X only if y begins with Theta), its length, what is allowed; y' there, the state behind. */
typedef struct {
    const double *X, *y;
    double t, h, rtol, atol;
    double *slope, *after;
    Errors *found;
} Half;

/* The steps of both at once; `number` are the inputs of the rate beside X, y and t. */
typedef void (*Both)(const Half *of, const double *const *number);

#endif
