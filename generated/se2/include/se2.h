/* SPDX-License-Identifier: MIT-0 */
/*
 * se2
 * planar rigid motions; body angular velocity, then body velocity
 * Basis, row by row:
 * omega = [0 -1 0; 1 0 0; 0 0 0]
 * vx = [0 0 1; 0 0 0; 0 0 0]
 * vy = [0 0 0; 0 0 1; 0 0 0]
 *
 * Written by lie_codegen. This file is yours: use, change and ship it under MIT-0, without attribution.
 *
 * Conventions
 *   Left-invariant: X' = X hat(u), u in the body frame.
 *   Product of exponentials: X = exp(g1 A1) ... exp(gn An), in basis order.
 *   SI units and radians.
 *   Numerics version 1 of lie_codegen: the same number and definition, the same arithmetic.
 *   Order of the basis, and so of every vector:
 *     0: omega [rad]
 *     1: vx [m]
 *     2: vy [m]
 *   Matrices are row-major; a complex entry is two doubles, (re, im).
 *
 * Every function is plain C99 over libm: no allocation, no globals, re-entrant and thread-safe. All inputs are
 * read before the first output is written, so an output array may be an input array; two outputs may not overlap.
 * NaN and infinity in an input are not looked for: they come out as IEEE arithmetic makes them.
 */
#ifndef SE2_LIE_CODEGEN_H
#define SE2_LIE_CODEGEN_H

#ifdef __cplusplus
extern "C" {
#endif

/*
 * se2_product_exp
 *   X = exp(g_1 A_1) ... exp(g_n A_n)
 *   in  g: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out X: (3, 3) matrix, row-major; element of the group
 *   Source: Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15)
 */
void se2_product_exp(const double g[3], double X[9]);

/*
 * se2_wei_norman_matrix
 *   g' = M(g) u for X = exp(g_1 A_1) ... exp(g_n A_n) and X' = X hat(u)
 *   in  g: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out M: (3, 3) matrix, row-major
 *   Source: Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15)
 */
void se2_wei_norman_matrix(const double g[3], double M[9]);

/*
 * se2_wei_norman_rate
 *   g' = M(g) u
 *   in  g: (3) vector, [rad, m, m]; components omega, vx, vy
 *   in  u: (3) vector, [rad/s, m/s, m/s]; components omega, vx, vy
 *   out g_dot: (3) vector, [rad/s, m/s, m/s]; components omega, vx, vy
 *   Source: Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15)
 */
void se2_wei_norman_rate(const double g[3], const double u[3], double g_dot[3]);

/*
 * se2_exp
 *   X = exp(x_1 A_1 + ... + x_n A_n)
 *   in  x: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out X: (3, 3) matrix, row-major; element of the group
 *   Source: the power series, summed in closed form on the spectrum of hat(x)
 */
void se2_exp(const double x[3], double X[9]);

/*
 * se2_log
 *   exp(x_1 A_1 + ... + x_n A_n) = X with the least sum of squares of turning angles; NaN where there is none
 *   in  X: (3, 3) matrix, row-major; element of the group
 *   out x: (3) vector, [rad, m, m]; components omega, vx, vy
 *   Source: checked: closed forms by membership, iterations by exp(-hat x) X; within 1e-5 of the group that of
 *   the nearest element
 */
void se2_log(const double X[9], double x[3]);

/*
 * se2_compose
 *   Z = X Y
 *   in  X: (3, 3) matrix, row-major; element of the group
 *   in  Y: (3, 3) matrix, row-major; element of the group
 *   out Z: (3, 3) matrix, row-major; element of the group
 *   Source: the group's own product
 */
void se2_compose(const double X[9], const double Y[9], double Z[9]);

/*
 * se2_inverse
 *   X X_inverse = I
 *   in  X: (3, 3) matrix, row-major; element of the group
 *   out X_inverse: (3, 3) matrix, row-major; element of the group
 *   Source: the group's own product
 */
void se2_inverse(const double X[9], double X_inverse[9]);

/*
 * se2_Ad
 *   hat(Ad_X y) = X hat(y) X^{-1}
 *   in  X: (3, 3) matrix, row-major; element of the group
 *   out Ad_X: (3, 3) matrix, row-major
 *   Source: X' = X hat(u) = hat(Ad_X u) X
 */
void se2_Ad(const double X[9], double Ad_X[9]);

/*
 * se2_ad
 *   ad_x y = [x, y]
 *   in  x: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out ad_x: (3, 3) matrix, row-major
 *   Source: the structure constants: [A_i, A_j] = sum_k c_ijk A_k
 */
void se2_ad(const double x[3], double ad_x[9]);

/*
 * se2_bracket
 *   z = [x, y]
 *   in  x: (3) vector, [rad, m, m]; components omega, vx, vy
 *   in  y: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out z: (3) vector
 *   Source: the structure constants: [A_i, A_j] = sum_k c_ijk A_k
 */
void se2_bracket(const double x[3], const double y[3], double z[3]);

/*
 * se2_ljac
 *   d/dt exp(x) = hat(J x') exp(x)
 *   in  x: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out J: (3, 3) matrix, row-major
 *   Source: ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x)
 *   hat(rjac x')
 */
void se2_ljac(const double x[3], double J[9]);

/*
 * se2_rjac
 *   d/dt exp(x) = exp(x) hat(J x')
 *   in  x: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out J: (3, 3) matrix, row-major
 *   Source: ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x)
 *   hat(rjac x')
 */
void se2_rjac(const double x[3], double J[9]);

/*
 * se2_ljac_inv
 *   d/dt exp(x) = hat(J x') exp(x), inverted: J_inv J = I
 *   in  x: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out J_inv: (3, 3) matrix, row-major
 *   Source: ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x)
 *   hat(rjac x')
 */
void se2_ljac_inv(const double x[3], double J_inv[9]);

/*
 * se2_rjac_inv
 *   d/dt exp(x) = exp(x) hat(J x'), inverted: J_inv J = I
 *   in  x: (3) vector, [rad, m, m]; components omega, vx, vy
 *   out J_inv: (3, 3) matrix, row-major
 *   Source: ljac(x) = sum_k ad_x^k / (k + 1)!, rjac(x) = ljac(-x); exp(x)' = hat(ljac x') exp(x) = exp(x)
 *   hat(rjac x')
 */
void se2_rjac_inv(const double x[3], double J_inv[9]);

/*
 * se2_defect
 *   the largest relative violation of what every element keeps: forms, determinant, fixed entries, signs
 *   in  X: (3, 3) matrix, row-major; element of the group
 *   out defect: scalar
 *   Source: the conditions that the basis implies, found exactly
 */
void se2_defect(const double X[9], double defect[1]);

/*
 * se2_renormalise
 *   one step towards the group: X (3 - X* X)/2 on blocks that keep a form, X det(X)^(-1/n)
 *   in  X: (3, 3) matrix, row-major; element of the group
 *   out Y: (3, 3) matrix, row-major; element of the group
 *   Source: Higham, Functions of Matrices (2008), (8.20); any form in place of 1
 */
void se2_renormalise(const double X[9], double Y[9]);

#ifdef __cplusplus
}
#endif

#endif
