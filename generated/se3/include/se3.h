/* SPDX-License-Identifier: MIT-0 */
/*
 * se3
 * rigid motions of space; body angular velocity, then body velocity
 * Basis, row by row:
 * w1 = [0 0 0 0; 0 0 -1 0; 0 1 0 0; 0 0 0 0]
 * w2 = [0 0 1 0; 0 0 0 0; -1 0 0 0; 0 0 0 0]
 * w3 = [0 -1 0 0; 1 0 0 0; 0 0 0 0; 0 0 0 0]
 * v1 = [0 0 0 1; 0 0 0 0; 0 0 0 0; 0 0 0 0]
 * v2 = [0 0 0 0; 0 0 0 1; 0 0 0 0; 0 0 0 0]
 * v3 = [0 0 0 0; 0 0 0 0; 0 0 0 1; 0 0 0 0]
 *
 * Written by lie_codegen. This file is yours: use, change and ship it under MIT-0, without attribution.
 *
 * Conventions
 *   Left-invariant: X' = X hat(u), u in the body frame.
 *   Product of exponentials: X = exp(g1 A1) ... exp(gn An), in basis order.
 *   SI units and radians.
 *   Numerics version 1 of lie_codegen: the same number and definition, the same arithmetic.
 *   Order of the basis, and so of every vector:
 *     0: w1 [rad]
 *     1: w2 [rad]
 *     2: w3 [rad]
 *     3: v1 [m]
 *     4: v2 [m]
 *     5: v3 [m]
 *   Matrices are row-major; a complex entry is two doubles, (re, im).
 *
 * Every function is plain C99 over libm: no allocation, no globals, re-entrant and thread-safe. All inputs are
 * read before the first output is written, so an output array may be an input array; two outputs may not overlap.
 * NaN and infinity in an input are not looked for: they come out as IEEE arithmetic makes them.
 */
#ifndef SE3_LIE_CODEGEN_H
#define SE3_LIE_CODEGEN_H

#ifdef __cplusplus
extern "C" {
#endif

/*
 * se3_product_exp
 *   X = exp(g_1 A_1) ... exp(g_n A_n)
 *   in  g: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out X: (4, 4) matrix, row-major; element of the group
 *   Source: Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15)
 */
void se3_product_exp(const double g[6], double X[16]);

/*
 * se3_wei_norman_matrix
 *   g' = M(g) u for X = exp(g_1 A_1) ... exp(g_n A_n) and X' = X hat(u)
 *   in  g: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out M: (6, 6) matrix, row-major
 *   Source: Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15)
 */
void se3_wei_norman_matrix(const double g[6], double M[36]);

/*
 * se3_wei_norman_rate
 *   g' = M(g) u
 *   in  g: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   in  u: (6) vector, [rad/s, rad/s, rad/s, m/s, m/s, m/s]; components w1, w2, w3, v1, v2, v3
 *   out g_dot: (6) vector, [rad/s, rad/s, rad/s, m/s, m/s, m/s]; components w1, w2, w3, v1, v2, v3
 *   Source: Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15)
 */
void se3_wei_norman_rate(const double g[6], const double u[6], double g_dot[6]);

/*
 * se3_exp
 *   X = exp(x_1 A_1 + ... + x_n A_n)
 *   in  x: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out X: (4, 4) matrix, row-major; element of the group
 *   Source: the power series, summed in closed form on the spectrum of hat(x)
 */
void se3_exp(const double x[6], double X[16]);

/*
 * se3_log
 *   exp(x_1 A_1 + ... + x_n A_n) = X with the least sum of squares of turning angles; NaN where there is none
 *   in  X: (4, 4) matrix, row-major; element of the group
 *   out x: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   Source: checked: closed forms by membership, iterations by exp(-hat x) X; within 1e-5 of the group that of
 *   the nearest element
 */
void se3_log(const double X[16], double x[6]);

/*
 * se3_compose
 *   Z = X Y
 *   in  X: (4, 4) matrix, row-major; element of the group
 *   in  Y: (4, 4) matrix, row-major; element of the group
 *   out Z: (4, 4) matrix, row-major; element of the group
 *   Source: the group's own product
 */
void se3_compose(const double X[16], const double Y[16], double Z[16]);

/*
 * se3_inverse
 *   X X_inverse = I
 *   in  X: (4, 4) matrix, row-major; element of the group
 *   out X_inverse: (4, 4) matrix, row-major; element of the group
 *   Source: the group's own product
 */
void se3_inverse(const double X[16], double X_inverse[16]);

/*
 * se3_Ad
 *   hat(Ad_X y) = X hat(y) X^{-1}
 *   in  X: (4, 4) matrix, row-major; element of the group
 *   out Ad_X: (6, 6) matrix, row-major
 *   Source: X' = X hat(u) = hat(Ad_X u) X
 */
void se3_Ad(const double X[16], double Ad_X[36]);

/*
 * se3_ad
 *   ad_x y = [x, y]
 *   in  x: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out ad_x: (6, 6) matrix, row-major
 *   Source: the structure constants: [A_i, A_j] = sum_k c_ijk A_k
 */
void se3_ad(const double x[6], double ad_x[36]);

/*
 * se3_bracket
 *   z = [x, y]
 *   in  x: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   in  y: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out z: (6) vector
 *   Source: the structure constants: [A_i, A_j] = sum_k c_ijk A_k
 */
void se3_bracket(const double x[6], const double y[6], double z[6]);

/*
 * se3_ljac
 *   d/dt exp(x) = hat(J x') exp(x)
 *   in  x: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out J: (6, 6) matrix, row-major
 *   Source: ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x)
 *   hat(rjac x')
 */
void se3_ljac(const double x[6], double J[36]);

/*
 * se3_rjac
 *   d/dt exp(x) = exp(x) hat(J x')
 *   in  x: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out J: (6, 6) matrix, row-major
 *   Source: ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x)
 *   hat(rjac x')
 */
void se3_rjac(const double x[6], double J[36]);

/*
 * se3_ljac_inv
 *   d/dt exp(x) = hat(J x') exp(x), inverted: J_inv J = I
 *   in  x: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out J_inv: (6, 6) matrix, row-major
 *   Source: ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x)
 *   hat(rjac x')
 */
void se3_ljac_inv(const double x[6], double J_inv[36]);

/*
 * se3_rjac_inv
 *   d/dt exp(x) = exp(x) hat(J x'), inverted: J_inv J = I
 *   in  x: (6) vector, [rad, rad, rad, m, m, m]; components w1, w2, w3, v1, v2, v3
 *   out J_inv: (6, 6) matrix, row-major
 *   Source: ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x)
 *   hat(rjac x')
 */
void se3_rjac_inv(const double x[6], double J_inv[36]);

/*
 * se3_defect
 *   the largest relative violation of what every element keeps: forms, determinant, fixed entries, signs
 *   in  X: (4, 4) matrix, row-major; element of the group
 *   out defect: scalar
 *   Source: the conditions that the basis implies, found exactly
 */
void se3_defect(const double X[16], double defect[1]);

/*
 * se3_renormalise
 *   one step towards the group: X (3 - X* X)/2 on blocks that keep a form, X det(X)^(-1/n)
 *   in  X: (4, 4) matrix, row-major; element of the group
 *   out Y: (4, 4) matrix, row-major; element of the group
 *   Source: Higham, Functions of Matrices (2008), (8.20); any form in place of 1
 */
void se3_renormalise(const double X[16], double Y[16]);

#ifdef __cplusplus
}
#endif

#endif
