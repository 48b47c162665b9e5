/* SPDX-License-Identifier: MIT-0 */
/* so3. Written by lie_codegen; documented in so3.h. */
#include "so3.h"

#include <math.h>

static void so3_log_candidate(const double X[9], double x[3])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = X[6];
    const double t7 = X[7];
    const double t8 = X[8];
    const double t12 = 1.0 + t0;
    const double t13 = t12 + t4;
    const double t14 = t13 + t8;
    const double t15 = t12 - t4;
    const double t16 = t15 - t8;
    const double t17 = (double)(t14 < t16);
    const double t18 = t17 != 0.0 ? t16 : t14;
    const double t19 = 1.0 - t0;
    const double t20 = t19 + t4;
    const double t21 = t20 - t8;
    const double t22 = (double)(t18 < t21);
    const double t23 = t22 != 0.0 ? t21 : t18;
    const double t24 = t19 - t4;
    const double t25 = t24 + t8;
    const double t26 = (double)(t23 < t25);
    const double t27 = t3 - t1;
    const double t28 = t2 - t6;
    const double t29 = t7 - t5;
    const double t30 = t17 != 0.0 ? t29 : t14;
    const double t31 = t22 != 0.0 ? t28 : t30;
    const double t32 = t26 != 0.0 ? t27 : t31;
    const double t34 = (double)(t32 < 0.0);
    const double t36 = t34 != 0.0 ? (-1.0) : 1.0;
    const double t37 = t2 + t6;
    const double t38 = t1 + t3;
    const double t39 = t17 != 0.0 ? t16 : t29;
    const double t40 = t22 != 0.0 ? t38 : t39;
    const double t41 = t26 != 0.0 ? t37 : t40;
    const double t42 = t36 * t41;
    const double t43 = t42 * t42;
    const double t44 = t5 + t7;
    const double t45 = t17 != 0.0 ? t38 : t28;
    const double t46 = t22 != 0.0 ? t21 : t45;
    const double t47 = t26 != 0.0 ? t44 : t46;
    const double t48 = t36 * t47;
    const double t49 = t48 * t48;
    const double t50 = t43 + t49;
    const double t51 = t17 != 0.0 ? t37 : t27;
    const double t52 = t22 != 0.0 ? t44 : t51;
    const double t53 = t26 != 0.0 ? t25 : t52;
    const double t54 = t36 * t53;
    const double t55 = t54 * t54;
    const double t56 = t50 + t55;
    const double t57 = t36 * t32;
    const double t58 = t57 * t57;
    const double t59 = t58 + t56;
    const double t60 = sqrt(t59);
    const double t61 = t57 + t60;
    const double t62 = t60 * t61;
    const double t63 = 2.0 * t62;
    const double t64 = sqrt(t63);
    const double t65 = t61 + t64;
    const double t66 = t64 * t65;
    const double t67 = 2.0 * t66;
    const double t68 = sqrt(t67);
    const double t69 = t65 + t68;
    const double t70 = 1.0 / t69;
    const double t71 = t70 * t70;
    const double t72 = t56 * t71;
    const double t73 = t72 * t72;
    const double t74 = 0.047619047619047616 * t73;
    const double t76 = t74 + 0.058823529411764705;
    const double t77 = t76 * t73;
    const double t79 = t77 + 0.07692307692307693;
    const double t80 = t79 * t73;
    const double t82 = t80 + 0.1111111111111111;
    const double t83 = t82 * t73;
    const double t85 = t83 + 0.2;
    const double t86 = t85 * t73;
    const double t87 = t86 + 1.0;
    const double t89 = (-0.043478260869565216) * t73;
    const double t91 = t89 + (-0.05263157894736842);
    const double t92 = t91 * t73;
    const double t94 = t92 + (-0.06666666666666667);
    const double t95 = t94 * t73;
    const double t97 = t95 + (-0.09090909090909091);
    const double t98 = t97 * t73;
    const double t100 = t98 + (-0.14285714285714285);
    const double t101 = t100 * t73;
    const double t103 = t101 + (-0.3333333333333333);
    const double t104 = t72 * t103;
    const double t105 = t87 + t104;
    const double t106 = t105 / t69;
    const double t107 = 16.0 * t106;
    const double t108 = t107 * t42;
    const double t109 = t107 * t48;
    const double t110 = t107 * t54;
    x[0] = t108;
    x[1] = t109;
    x[2] = t110;
}

static void so3_log_error(const double x[3], const double X[9], double u[3], double error[2])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t3 = X[0];
    const double t4 = X[1];
    const double t5 = X[2];
    const double t6 = X[3];
    const double t7 = X[4];
    const double t8 = X[5];
    const double t9 = X[6];
    const double t10 = X[7];
    const double t11 = X[8];
    const double t13 = t0 * t0;
    const double t14 = t1 * t1;
    const double t15 = t13 + t14;
    const double t16 = t2 * t2;
    const double t17 = t15 + t16;
    const double t19 = (double)(t17 < 1.0);
    const double t21 = (-4.110317623312165e-19) * t17;
    const double t23 = t21 + 1.5619206968586225e-16;
    const double t24 = t23 * t17;
    const double t26 = t24 + (-4.779477332387385e-14);
    const double t27 = t26 * t17;
    const double t29 = t27 + 1.1470745597729725e-11;
    const double t30 = t29 * t17;
    const double t32 = t30 + (-2.08767569878681e-09);
    const double t33 = t32 * t17;
    const double t35 = t33 + 2.755731922398589e-07;
    const double t36 = t35 * t17;
    const double t38 = t36 + (-2.48015873015873e-05);
    const double t39 = t38 * t17;
    const double t41 = t39 + 0.001388888888888889;
    const double t42 = t41 * t17;
    const double t44 = t42 + (-0.041666666666666664);
    const double t45 = t44 * t17;
    const double t47 = t45 + 0.5;
    const double t48 = t19 != 0.0 ? 1.0 : t17;
    const double t49 = sqrt(t48);
    const double t50 = cos(t49);
    const double t51 = sin(t49);
    const double t52 = 1.0 - t50;
    const double t53 = t52 / t48;
    const double t54 = t19 != 0.0 ? t47 : t53;
    const double t55 = t0 * t1;
    const double t56 = t54 * t55;
    const double t58 = (-8.22063524662433e-18) * t17;
    const double t60 = t58 + 2.8114572543455206e-15;
    const double t61 = t60 * t17;
    const double t63 = t61 + (-7.647163731819816e-13);
    const double t64 = t63 * t17;
    const double t66 = t64 + 1.6059043836821613e-10;
    const double t67 = t66 * t17;
    const double t69 = t67 + (-2.505210838544172e-08);
    const double t70 = t69 * t17;
    const double t72 = t70 + 2.7557319223985893e-06;
    const double t73 = t72 * t17;
    const double t75 = t73 + (-0.0001984126984126984);
    const double t76 = t75 * t17;
    const double t78 = t76 + 0.008333333333333333;
    const double t79 = t78 * t17;
    const double t81 = t79 + (-0.16666666666666666);
    const double t82 = t81 * t17;
    const double t83 = t82 + 1.0;
    const double t84 = t51 / t49;
    const double t85 = t19 != 0.0 ? t83 : t84;
    const double t86 = t85 * t2;
    const double t87 = t56 - t86;
    const double t88 = t87 * t5;
    const double t89 = t13 + t16;
    const double t90 = t54 * t89;
    const double t91 = 1.0 - t90;
    const double t92 = t91 * t8;
    const double t93 = t88 + t92;
    const double t94 = t1 * t2;
    const double t95 = t54 * t94;
    const double t96 = t85 * t0;
    const double t97 = t95 + t96;
    const double t98 = t97 * t11;
    const double t99 = t93 + t98;
    const double t100 = (-0.5) * t99;
    const double t101 = t0 * t2;
    const double t102 = t54 * t101;
    const double t103 = t85 * t1;
    const double t104 = t102 + t103;
    const double t105 = t104 * t4;
    const double t106 = t95 - t96;
    const double t107 = t106 * t7;
    const double t108 = t105 + t107;
    const double t109 = t54 * t15;
    const double t110 = 1.0 - t109;
    const double t111 = t110 * t10;
    const double t112 = t108 + t111;
    const double t113 = 0.5 * t112;
    const double t114 = t100 + t113;
    const double t115 = t14 + t16;
    const double t116 = t54 * t115;
    const double t117 = 1.0 - t116;
    const double t118 = t117 * t5;
    const double t119 = t56 + t86;
    const double t120 = t119 * t8;
    const double t121 = t118 + t120;
    const double t122 = t102 - t103;
    const double t123 = t122 * t11;
    const double t124 = t121 + t123;
    const double t125 = 0.5 * t124;
    const double t126 = t104 * t3;
    const double t127 = t106 * t6;
    const double t128 = t126 + t127;
    const double t129 = t110 * t9;
    const double t130 = t128 + t129;
    const double t131 = (-0.5) * t130;
    const double t132 = t125 + t131;
    const double t133 = t117 * t4;
    const double t134 = t119 * t7;
    const double t135 = t133 + t134;
    const double t136 = t122 * t10;
    const double t137 = t135 + t136;
    const double t138 = (-0.5) * t137;
    const double t139 = t87 * t3;
    const double t140 = t91 * t6;
    const double t141 = t139 + t140;
    const double t142 = t97 * t9;
    const double t143 = t141 + t142;
    const double t144 = 0.5 * t143;
    const double t145 = t138 + t144;
    const double t146 = t117 * t3;
    const double t147 = t119 * t6;
    const double t148 = t146 + t147;
    const double t149 = t122 * t9;
    const double t150 = t148 + t149;
    const double t152 = t150 + (-1.0);
    const double t153 = fabs(t152);
    const double t154 = fabs(t137);
    const double t155 = t153 + t154;
    const double t156 = fabs(t124);
    const double t157 = t155 + t156;
    const double t158 = fabs(t143);
    const double t159 = t157 + t158;
    const double t160 = t87 * t4;
    const double t161 = t91 * t7;
    const double t162 = t160 + t161;
    const double t163 = t97 * t10;
    const double t164 = t162 + t163;
    const double t165 = t164 + (-1.0);
    const double t166 = fabs(t165);
    const double t167 = t159 + t166;
    const double t168 = fabs(t99);
    const double t169 = t167 + t168;
    const double t170 = fabs(t130);
    const double t171 = t169 + t170;
    const double t172 = fabs(t112);
    const double t173 = t171 + t172;
    const double t174 = t104 * t5;
    const double t175 = t106 * t8;
    const double t176 = t174 + t175;
    const double t177 = t110 * t11;
    const double t178 = t176 + t177;
    const double t179 = t178 + (-1.0);
    const double t180 = fabs(t179);
    const double t181 = t173 + t180;
    const double t183 = (double)(t181 < HUGE_VAL);
    const double t184 = t137 + t145;
    const double t185 = fabs(t184);
    const double t186 = (double)(t153 < t185);
    const double t187 = t186 != 0.0 ? t185 : t153;
    const double t188 = t124 - t132;
    const double t189 = fabs(t188);
    const double t190 = (double)(t187 < t189);
    const double t191 = t190 != 0.0 ? t189 : t187;
    const double t192 = t143 - t145;
    const double t193 = fabs(t192);
    const double t194 = (double)(t191 < t193);
    const double t195 = t194 != 0.0 ? t193 : t191;
    const double t196 = (double)(t195 < t166);
    const double t197 = t196 != 0.0 ? t166 : t195;
    const double t198 = t99 + t114;
    const double t199 = fabs(t198);
    const double t200 = (double)(t197 < t199);
    const double t201 = t200 != 0.0 ? t199 : t197;
    const double t202 = t130 + t132;
    const double t203 = fabs(t202);
    const double t204 = (double)(t201 < t203);
    const double t205 = t204 != 0.0 ? t203 : t201;
    const double t206 = t112 - t114;
    const double t207 = fabs(t206);
    const double t208 = (double)(t205 < t207);
    const double t209 = t208 != 0.0 ? t207 : t205;
    const double t210 = (double)(t209 < t180);
    const double t211 = t210 != 0.0 ? t180 : t209;
    const double t213 = t183 != 0.0 ? t211 : (double)NAN;
    const double t214 = fabs(t145);
    const double t215 = fabs(t132);
    const double t216 = (double)(t214 < t215);
    const double t217 = t216 != 0.0 ? t215 : t214;
    const double t218 = (double)(t217 < t214);
    const double t219 = t218 != 0.0 ? t214 : t217;
    const double t220 = fabs(t114);
    const double t221 = (double)(t219 < t220);
    const double t222 = t221 != 0.0 ? t220 : t219;
    const double t223 = (double)(t222 < t215);
    const double t224 = t223 != 0.0 ? t215 : t222;
    const double t225 = (double)(t224 < t220);
    const double t226 = t225 != 0.0 ? t220 : t224;
    const double t227 = t183 != 0.0 ? t226 : (double)NAN;
    u[0] = t114;
    u[1] = t132;
    u[2] = t145;
    error[0] = t213;
    error[1] = t227;
}



/* y = x + rjac_inv(x) u, rjac = (1 - e^{-ad x})/ad x: its series after scaling, doubled, then elimination. 0 where it is singular. */
static int so3_log_checked_newton(const double *x, const double *u, double *y)
{
    static const int place[6][3] = {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {2, 0, 1}, {1, 2, 0}, {2, 1, 0} };
    static const double value[6] = {1.0, -1.0, -1.0, 1.0, 1.0, -1.0 };
    double B[3][3], E[3][3], F[3][4], P[3][3], R[3][3];
    double size = 0.0;
    int i, j, k, step, doublings = 0;
    for (i = 0; i < 3; ++i) {
        for (j = 0; j < 3; ++j) {
            B[i][j] = 0.0;
        }
    }
    for (k = 0; k < 6; ++k) {
        B[place[k][2]][place[k][1]] -= value[k] * x[place[k][0]];
    }
    for (i = 0; i < 3; ++i) {
        double sum = 0.0;
        for (j = 0; j < 3; ++j) {
            sum += fabs(B[i][j]);
        }
        size = fmax(size, sum);
    }
    if (!(size < 1e6)) {
        return 0;
    }
    for (; size > 0.5; size /= 2.0) {
        ++doublings;
    }
    for (i = 0; i < 3; ++i) {
        for (j = 0; j < 3; ++j) {
            B[i][j] = ldexp(B[i][j], -doublings);
            P[i][j] = i == j ? 1.0 : 0.0;
            E[i][j] = P[i][j];
            F[i][j] = P[i][j];
        }
    }
    for (step = 1; step <= 14; ++step) {
        /* P = B^k / k!; E = sum of P, F = sum of P / (k + 1). */
        for (i = 0; i < 3; ++i) {
            for (j = 0; j < 3; ++j) {
                R[i][j] = 0.0;
                for (k = 0; k < 3; ++k) {
                    R[i][j] += P[i][k] * B[k][j];
                }
            }
        }
        for (i = 0; i < 3; ++i) {
            for (j = 0; j < 3; ++j) {
                P[i][j] = R[i][j] / (double)step;
                E[i][j] += P[i][j];
                F[i][j] += P[i][j] / (double)(step + 1);
            }
        }
    }
    for (step = 0; step < doublings; ++step) {
        for (i = 0; i < 3; ++i) {
            for (j = 0; j < 3; ++j) {
                R[i][j] = F[i][j] / 2.0;
                P[i][j] = 0.0;
                for (k = 0; k < 3; ++k) {
                    R[i][j] += F[i][k] * E[k][j] / 2.0;
                    P[i][j] += E[i][k] * E[k][j];
                }
            }
        }
        for (i = 0; i < 3; ++i) {
            for (j = 0; j < 3; ++j) {
                F[i][j] = R[i][j];
                E[i][j] = P[i][j];
            }
        }
    }
    for (i = 0; i < 3; ++i) {
        F[i][3] = u[i];
    }
    for (k = 0; k < 3; ++k) {
        int best = k;
        for (i = k + 1; i < 3; ++i) {
            best = fabs(F[i][k]) > fabs(F[best][k]) ? i : best;
        }
        if (!(fabs(F[best][k]) > 1e-13)) {
            return 0;
        }
        for (j = 0; j <= 3; ++j) {
            const double t = F[k][j];
            F[k][j] = F[best][j];
            F[best][j] = t;
        }
        for (i = 0; i < 3; ++i) {
            const double factor = i == k ? 0.0 : F[i][k] / F[k][k];
            for (j = k; i != k && j <= 3; ++j) {
                F[i][j] -= factor * F[k][j];
            }
        }
    }
    for (i = 0; i < 3; ++i) {
        y[i] = x[i] + F[i][3] / F[i][i];
    }
    return 1;
}

/* x is taken if exp(hat x) = X (1 + hat u) with u of the size of rounding, after Newton steps as long as u falls: the fixed point is the logarithm
   of the nearest element. error = (distance from the group, size of u), both relative to what rounding is measured by. */
static int so3_log_checked_certified(const double *X, double *x)
{
    double u[3], error[2];
    int k, step;
    so3_log_error(x, X, u, error);
    for (step = 0; step < 3 && !(error[1] <= 4e-15); ++step) {
        double y[3], v[3], fresh[2];
        if (!so3_log_checked_newton(x, u, y)) {
            break;
        }
        so3_log_error(y, X, v, fresh);
        if (!(fresh[1] < error[1])) {
            break;
        }
        for (k = 0; k < 3; ++k) {
            x[k] = y[k];
            u[k] = v[k];
        }
        error[0] = fresh[0];
        error[1] = fresh[1];
    }
    return error[1] <= 1e-12 && error[0] <= 1e-05;
}

static void so3_log_checked(const double *X, double *x)
{
    int k;
    do {
        so3_log_candidate(X, x);
        if (so3_log_checked_certified(X, x)) {
            return;
        }
    } while (0);
    for (k = 0; k < 3; ++k) {
        x[k] = (double)NAN;
    }
}

void so3_product_exp(const double g[3], double X[9])
{
    const double t0 = g[0];
    const double t1 = g[1];
    const double t2 = g[2];
    const double t3 = cos(t1);
    const double t4 = sin(t1);
    const double t5 = cos(t2);
    const double t6 = sin(t2);
    const double t7 = t3 * t5;
    const double t8 = t3 * t6;
    const double t9 = -t8;
    const double t10 = cos(t0);
    const double t11 = sin(t0);
    const double t12 = t10 * t6;
    const double t13 = t4 * t5;
    const double t14 = t11 * t13;
    const double t15 = t12 + t14;
    const double t16 = t10 * t5;
    const double t17 = t4 * t6;
    const double t18 = t11 * t17;
    const double t19 = t16 - t18;
    const double t20 = t11 * t3;
    const double t21 = -t20;
    const double t22 = t11 * t6;
    const double t23 = t10 * t13;
    const double t24 = t22 - t23;
    const double t25 = t11 * t5;
    const double t26 = t10 * t17;
    const double t27 = t25 + t26;
    const double t28 = t10 * t3;
    X[0] = t7;
    X[1] = t9;
    X[2] = t4;
    X[3] = t15;
    X[4] = t19;
    X[5] = t21;
    X[6] = t24;
    X[7] = t27;
    X[8] = t28;
}

void so3_wei_norman_matrix(const double g[3], double M[9])
{
    const double t0 = g[1];
    const double t1 = g[2];
    const double t2 = cos(t1);
    const double t3 = sin(t1);
    const double t4 = cos(t0);
    const double t5 = sin(t0);
    const double t6 = t2 / t4;
    const double t7 = t3 / t4;
    const double t8 = -t7;
    const double t10 = t5 * t6;
    const double t11 = -t10;
    const double t12 = t5 * t7;
    M[0] = t6;
    M[1] = t8;
    M[2] = 0.0;
    M[3] = t3;
    M[4] = t2;
    M[5] = 0.0;
    M[6] = t11;
    M[7] = t12;
    M[8] = 1.0;
}

void so3_wei_norman_rate(const double g[3], const double u[3], double g_dot[3])
{
    const double t0 = g[1];
    const double t1 = g[2];
    const double t2 = u[0];
    const double t3 = u[1];
    const double t4 = u[2];
    const double t5 = cos(t1);
    const double t6 = sin(t1);
    const double t7 = t5 * t2;
    const double t8 = t6 * t3;
    const double t9 = t7 - t8;
    const double t10 = cos(t0);
    const double t11 = sin(t0);
    const double t12 = t9 / t10;
    const double t13 = t6 * t2;
    const double t14 = t5 * t3;
    const double t15 = t13 + t14;
    const double t16 = t11 * t12;
    const double t17 = t4 - t16;
    g_dot[0] = t12;
    g_dot[1] = t15;
    g_dot[2] = t17;
}

void so3_exp(const double x[3], double X[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t4 = t0 * t0;
    const double t5 = t1 * t1;
    const double t6 = t4 + t5;
    const double t7 = t2 * t2;
    const double t8 = t6 + t7;
    const double t9 = (double)(t8 < 1.0);
    const double t11 = (-4.110317623312165e-19) * t8;
    const double t13 = t11 + 1.5619206968586225e-16;
    const double t14 = t13 * t8;
    const double t16 = t14 + (-4.779477332387385e-14);
    const double t17 = t16 * t8;
    const double t19 = t17 + 1.1470745597729725e-11;
    const double t20 = t19 * t8;
    const double t22 = t20 + (-2.08767569878681e-09);
    const double t23 = t22 * t8;
    const double t25 = t23 + 2.755731922398589e-07;
    const double t26 = t25 * t8;
    const double t28 = t26 + (-2.48015873015873e-05);
    const double t29 = t28 * t8;
    const double t31 = t29 + 0.001388888888888889;
    const double t32 = t31 * t8;
    const double t34 = t32 + (-0.041666666666666664);
    const double t35 = t34 * t8;
    const double t37 = t35 + 0.5;
    const double t38 = t9 != 0.0 ? 1.0 : t8;
    const double t39 = sqrt(t38);
    const double t40 = cos(t39);
    const double t41 = sin(t39);
    const double t42 = 1.0 - t40;
    const double t43 = t42 / t38;
    const double t44 = t9 != 0.0 ? t37 : t43;
    const double t45 = t5 + t7;
    const double t46 = t44 * t45;
    const double t47 = 1.0 - t46;
    const double t48 = t0 * t1;
    const double t49 = t44 * t48;
    const double t51 = (-8.22063524662433e-18) * t8;
    const double t53 = t51 + 2.8114572543455206e-15;
    const double t54 = t53 * t8;
    const double t56 = t54 + (-7.647163731819816e-13);
    const double t57 = t56 * t8;
    const double t59 = t57 + 1.6059043836821613e-10;
    const double t60 = t59 * t8;
    const double t62 = t60 + (-2.505210838544172e-08);
    const double t63 = t62 * t8;
    const double t65 = t63 + 2.7557319223985893e-06;
    const double t66 = t65 * t8;
    const double t68 = t66 + (-0.0001984126984126984);
    const double t69 = t68 * t8;
    const double t71 = t69 + 0.008333333333333333;
    const double t72 = t71 * t8;
    const double t74 = t72 + (-0.16666666666666666);
    const double t75 = t74 * t8;
    const double t76 = t75 + 1.0;
    const double t77 = t41 / t39;
    const double t78 = t9 != 0.0 ? t76 : t77;
    const double t79 = t78 * t2;
    const double t80 = t49 - t79;
    const double t81 = t0 * t2;
    const double t82 = t44 * t81;
    const double t83 = t78 * t1;
    const double t84 = t82 + t83;
    const double t85 = t49 + t79;
    const double t86 = t4 + t7;
    const double t87 = t44 * t86;
    const double t88 = 1.0 - t87;
    const double t89 = t1 * t2;
    const double t90 = t44 * t89;
    const double t91 = t78 * t0;
    const double t92 = t90 - t91;
    const double t93 = t82 - t83;
    const double t94 = t90 + t91;
    const double t95 = t44 * t6;
    const double t96 = 1.0 - t95;
    X[0] = t47;
    X[1] = t80;
    X[2] = t84;
    X[3] = t85;
    X[4] = t88;
    X[5] = t92;
    X[6] = t93;
    X[7] = t94;
    X[8] = t96;
}

void so3_log(const double X[9], double x[3])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = X[6];
    const double t7 = X[7];
    const double t8 = X[8];
    const double t9 = t3 * t7;
    const double t10 = t6 * t4;
    const double t11 = t9 - t10;
    const double t12 = t11 - t2;
    const double t13 = t12 * t12;
    const double t14 = t6 * t1;
    const double t15 = t0 * t7;
    const double t16 = t14 - t15;
    const double t17 = t16 - t5;
    const double t18 = t17 * t17;
    const double t19 = t13 + t18;
    const double t20 = t0 * t4;
    const double t21 = t3 * t1;
    const double t22 = t20 - t21;
    const double t23 = t22 - t8;
    const double t24 = t23 * t23;
    const double t25 = t19 + t24;
    const double t26 = t0 * t0;
    const double t27 = t3 * t3;
    const double t28 = t26 + t27;
    const double t29 = t6 * t6;
    const double t30 = t28 + t29;
    const double t32 = t30 - 1.0;
    const double t33 = t32 * t32;
    const double t34 = t25 + t33;
    const double t35 = t1 * t1;
    const double t36 = t4 * t4;
    const double t37 = t35 + t36;
    const double t38 = t7 * t7;
    const double t39 = t37 + t38;
    const double t40 = t39 - 1.0;
    const double t41 = t40 * t40;
    const double t42 = t34 + t41;
    const double t43 = t0 * t1;
    const double t44 = t3 * t4;
    const double t45 = t43 + t44;
    const double t46 = t6 * t7;
    const double t47 = t45 + t46;
    const double t48 = t47 * t47;
    const double t49 = t42 + t48;
    const double t51 = (double)(t49 < 1e-26);
    const double t54 = 1.0 + t0;
    const double t55 = t54 + t4;
    const double t56 = t55 + t8;
    const double t57 = t54 - t4;
    const double t58 = t57 - t8;
    const double t59 = (double)(t56 < t58);
    const double t60 = t59 != 0.0 ? t58 : t56;
    const double t61 = 1.0 - t0;
    const double t62 = t61 + t4;
    const double t63 = t62 - t8;
    const double t64 = (double)(t60 < t63);
    const double t65 = t64 != 0.0 ? t63 : t60;
    const double t66 = t61 - t4;
    const double t67 = t66 + t8;
    const double t68 = (double)(t65 < t67);
    const double t69 = t3 - t1;
    const double t70 = t2 - t6;
    const double t71 = t7 - t5;
    const double t72 = t59 != 0.0 ? t71 : t56;
    const double t73 = t64 != 0.0 ? t70 : t72;
    const double t74 = t68 != 0.0 ? t69 : t73;
    const double t76 = (double)(t74 < 0.0);
    const double t78 = t76 != 0.0 ? (-1.0) : 1.0;
    const double t79 = t2 + t6;
    const double t80 = t1 + t3;
    const double t81 = t59 != 0.0 ? t58 : t71;
    const double t82 = t64 != 0.0 ? t80 : t81;
    const double t83 = t68 != 0.0 ? t79 : t82;
    const double t84 = t78 * t83;
    const double t85 = t84 * t84;
    const double t86 = t5 + t7;
    const double t87 = t59 != 0.0 ? t80 : t70;
    const double t88 = t64 != 0.0 ? t63 : t87;
    const double t89 = t68 != 0.0 ? t86 : t88;
    const double t90 = t78 * t89;
    const double t91 = t90 * t90;
    const double t92 = t85 + t91;
    const double t93 = t59 != 0.0 ? t79 : t69;
    const double t94 = t64 != 0.0 ? t86 : t93;
    const double t95 = t68 != 0.0 ? t67 : t94;
    const double t96 = t78 * t95;
    const double t97 = t96 * t96;
    const double t98 = t92 + t97;
    const double t99 = t78 * t74;
    const double t100 = t99 * t99;
    const double t101 = t100 + t98;
    const double t102 = sqrt(t101);
    const double t103 = t99 + t102;
    const double t104 = t102 * t103;
    const double t105 = 2.0 * t104;
    const double t106 = sqrt(t105);
    const double t107 = t103 + t106;
    const double t108 = t106 * t107;
    const double t109 = 2.0 * t108;
    const double t110 = sqrt(t109);
    const double t111 = t107 + t110;
    const double t112 = 1.0 / t111;
    const double t113 = t112 * t112;
    const double t114 = t98 * t113;
    const double t115 = t114 * t114;
    const double t116 = 0.047619047619047616 * t115;
    const double t118 = t116 + 0.058823529411764705;
    const double t119 = t118 * t115;
    const double t121 = t119 + 0.07692307692307693;
    const double t122 = t121 * t115;
    const double t124 = t122 + 0.1111111111111111;
    const double t125 = t124 * t115;
    const double t127 = t125 + 0.2;
    const double t128 = t127 * t115;
    const double t129 = t128 + 1.0;
    const double t131 = (-0.043478260869565216) * t115;
    const double t133 = t131 + (-0.05263157894736842);
    const double t134 = t133 * t115;
    const double t136 = t134 + (-0.06666666666666667);
    const double t137 = t136 * t115;
    const double t139 = t137 + (-0.09090909090909091);
    const double t140 = t139 * t115;
    const double t142 = t140 + (-0.14285714285714285);
    const double t143 = t142 * t115;
    const double t145 = t143 + (-0.3333333333333333);
    const double t146 = t114 * t145;
    const double t147 = t129 + t146;
    const double t148 = t147 / t111;
    const double t149 = 16.0 * t148;
    const double t150 = t149 * t84;
    const double t151 = t51 != 0.0 ? 1.0 : 0.0;
    const double t153 = (double)(t151 < 0.5);
    double t154[3] = {0};
    if (t153 != 0) {
        const double t154_of[9] = {t0, t1, t2, t3, t4, t5, t6, t7, t8};
        so3_log_checked(t154_of, t154);
    }
    const double t155 = t154[0];
    const double t156 = t154[1];
    const double t157 = t154[2];
    const double t158 = t51 != 0.0 ? t150 : t155;
    const double t159 = t149 * t90;
    const double t160 = t51 != 0.0 ? t159 : t156;
    const double t161 = t149 * t96;
    const double t162 = t51 != 0.0 ? t161 : t157;
    x[0] = t158;
    x[1] = t160;
    x[2] = t162;
}

void so3_compose(const double X[9], const double Y[9], double Z[9])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = X[6];
    const double t7 = X[7];
    const double t8 = X[8];
    const double t9 = Y[0];
    const double t10 = Y[1];
    const double t11 = Y[2];
    const double t12 = Y[3];
    const double t13 = Y[4];
    const double t14 = Y[5];
    const double t15 = Y[6];
    const double t16 = Y[7];
    const double t17 = Y[8];
    const double t18 = t0 * t9;
    const double t19 = t1 * t12;
    const double t20 = t18 + t19;
    const double t21 = t2 * t15;
    const double t22 = t20 + t21;
    const double t23 = t0 * t10;
    const double t24 = t1 * t13;
    const double t25 = t23 + t24;
    const double t26 = t2 * t16;
    const double t27 = t25 + t26;
    const double t28 = t0 * t11;
    const double t29 = t1 * t14;
    const double t30 = t28 + t29;
    const double t31 = t2 * t17;
    const double t32 = t30 + t31;
    const double t33 = t3 * t9;
    const double t34 = t4 * t12;
    const double t35 = t33 + t34;
    const double t36 = t5 * t15;
    const double t37 = t35 + t36;
    const double t38 = t3 * t10;
    const double t39 = t4 * t13;
    const double t40 = t38 + t39;
    const double t41 = t5 * t16;
    const double t42 = t40 + t41;
    const double t43 = t3 * t11;
    const double t44 = t4 * t14;
    const double t45 = t43 + t44;
    const double t46 = t5 * t17;
    const double t47 = t45 + t46;
    const double t48 = t6 * t9;
    const double t49 = t7 * t12;
    const double t50 = t48 + t49;
    const double t51 = t8 * t15;
    const double t52 = t50 + t51;
    const double t53 = t6 * t10;
    const double t54 = t7 * t13;
    const double t55 = t53 + t54;
    const double t56 = t8 * t16;
    const double t57 = t55 + t56;
    const double t58 = t6 * t11;
    const double t59 = t7 * t14;
    const double t60 = t58 + t59;
    const double t61 = t8 * t17;
    const double t62 = t60 + t61;
    Z[0] = t22;
    Z[1] = t27;
    Z[2] = t32;
    Z[3] = t37;
    Z[4] = t42;
    Z[5] = t47;
    Z[6] = t52;
    Z[7] = t57;
    Z[8] = t62;
}

void so3_inverse(const double X[9], double X_inverse[9])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = X[6];
    const double t7 = X[7];
    const double t8 = X[8];
    X_inverse[0] = t0;
    X_inverse[1] = t3;
    X_inverse[2] = t6;
    X_inverse[3] = t1;
    X_inverse[4] = t4;
    X_inverse[5] = t7;
    X_inverse[6] = t2;
    X_inverse[7] = t5;
    X_inverse[8] = t8;
}

void so3_Ad(const double X[9], double Ad_X[9])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = X[6];
    const double t7 = X[7];
    const double t8 = X[8];
    Ad_X[0] = t0;
    Ad_X[1] = t1;
    Ad_X[2] = t2;
    Ad_X[3] = t3;
    Ad_X[4] = t4;
    Ad_X[5] = t5;
    Ad_X[6] = t6;
    Ad_X[7] = t7;
    Ad_X[8] = t8;
}

void so3_ad(const double x[3], double ad_x[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t4 = -t2;
    const double t5 = -t0;
    const double t6 = -t1;
    ad_x[0] = 0.0;
    ad_x[1] = t4;
    ad_x[2] = t1;
    ad_x[3] = t2;
    ad_x[4] = 0.0;
    ad_x[5] = t5;
    ad_x[6] = t6;
    ad_x[7] = t0;
    ad_x[8] = 0.0;
}

void so3_bracket(const double x[3], const double y[3], double z[3])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t3 = y[0];
    const double t4 = y[1];
    const double t5 = y[2];
    const double t6 = t1 * t5;
    const double t7 = t2 * t4;
    const double t8 = t6 - t7;
    const double t9 = t0 * t5;
    const double t10 = t2 * t3;
    const double t11 = t9 - t10;
    const double t12 = -t11;
    const double t13 = t0 * t4;
    const double t14 = t1 * t3;
    const double t15 = t13 - t14;
    z[0] = t8;
    z[1] = t12;
    z[2] = t15;
}

void so3_ljac(const double x[3], double J[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t4 = t0 * t0;
    const double t5 = t1 * t1;
    const double t6 = t4 + t5;
    const double t7 = t2 * t2;
    const double t8 = t6 + t7;
    const double t9 = (double)(t8 < 1.0);
    const double t11 = (-1.9572941063391263e-20) * t8;
    const double t13 = t11 + 8.22063524662433e-18;
    const double t14 = t13 * t8;
    const double t16 = t14 + (-2.8114572543455206e-15);
    const double t17 = t16 * t8;
    const double t19 = t17 + 7.647163731819816e-13;
    const double t20 = t19 * t8;
    const double t22 = t20 + (-1.6059043836821613e-10);
    const double t23 = t22 * t8;
    const double t25 = t23 + 2.505210838544172e-08;
    const double t26 = t25 * t8;
    const double t28 = t26 + (-2.7557319223985893e-06);
    const double t29 = t28 * t8;
    const double t31 = t29 + 0.0001984126984126984;
    const double t32 = t31 * t8;
    const double t34 = t32 + (-0.008333333333333333);
    const double t35 = t34 * t8;
    const double t37 = t35 + 0.16666666666666666;
    const double t38 = t9 != 0.0 ? 1.0 : t8;
    const double t39 = sqrt(t38);
    const double t40 = sin(t39);
    const double t41 = cos(t39);
    const double t42 = t40 / t39;
    const double t43 = 1.0 - t42;
    const double t44 = t43 / t38;
    const double t45 = t9 != 0.0 ? t37 : t44;
    const double t46 = t5 + t7;
    const double t47 = t45 * t46;
    const double t48 = 1.0 - t47;
    const double t49 = t0 * t1;
    const double t50 = t45 * t49;
    const double t52 = (-4.110317623312165e-19) * t8;
    const double t54 = t52 + 1.5619206968586225e-16;
    const double t55 = t54 * t8;
    const double t57 = t55 + (-4.779477332387385e-14);
    const double t58 = t57 * t8;
    const double t60 = t58 + 1.1470745597729725e-11;
    const double t61 = t60 * t8;
    const double t63 = t61 + (-2.08767569878681e-09);
    const double t64 = t63 * t8;
    const double t66 = t64 + 2.755731922398589e-07;
    const double t67 = t66 * t8;
    const double t69 = t67 + (-2.48015873015873e-05);
    const double t70 = t69 * t8;
    const double t72 = t70 + 0.001388888888888889;
    const double t73 = t72 * t8;
    const double t75 = t73 + (-0.041666666666666664);
    const double t76 = t75 * t8;
    const double t78 = t76 + 0.5;
    const double t79 = 1.0 - t41;
    const double t80 = t79 / t38;
    const double t81 = t9 != 0.0 ? t78 : t80;
    const double t82 = t81 * t2;
    const double t83 = t50 - t82;
    const double t84 = t0 * t2;
    const double t85 = t45 * t84;
    const double t86 = t81 * t1;
    const double t87 = t85 + t86;
    const double t88 = t50 + t82;
    const double t89 = t4 + t7;
    const double t90 = t45 * t89;
    const double t91 = 1.0 - t90;
    const double t92 = t1 * t2;
    const double t93 = t45 * t92;
    const double t94 = t81 * t0;
    const double t95 = t93 - t94;
    const double t96 = t85 - t86;
    const double t97 = t93 + t94;
    const double t98 = t45 * t6;
    const double t99 = 1.0 - t98;
    J[0] = t48;
    J[1] = t83;
    J[2] = t87;
    J[3] = t88;
    J[4] = t91;
    J[5] = t95;
    J[6] = t96;
    J[7] = t97;
    J[8] = t99;
}

void so3_rjac(const double x[3], double J[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t4 = t0 * t0;
    const double t5 = t1 * t1;
    const double t6 = t4 + t5;
    const double t7 = t2 * t2;
    const double t8 = t6 + t7;
    const double t9 = (double)(t8 < 1.0);
    const double t11 = (-1.9572941063391263e-20) * t8;
    const double t13 = t11 + 8.22063524662433e-18;
    const double t14 = t13 * t8;
    const double t16 = t14 + (-2.8114572543455206e-15);
    const double t17 = t16 * t8;
    const double t19 = t17 + 7.647163731819816e-13;
    const double t20 = t19 * t8;
    const double t22 = t20 + (-1.6059043836821613e-10);
    const double t23 = t22 * t8;
    const double t25 = t23 + 2.505210838544172e-08;
    const double t26 = t25 * t8;
    const double t28 = t26 + (-2.7557319223985893e-06);
    const double t29 = t28 * t8;
    const double t31 = t29 + 0.0001984126984126984;
    const double t32 = t31 * t8;
    const double t34 = t32 + (-0.008333333333333333);
    const double t35 = t34 * t8;
    const double t37 = t35 + 0.16666666666666666;
    const double t38 = t9 != 0.0 ? 1.0 : t8;
    const double t39 = sqrt(t38);
    const double t40 = sin(t39);
    const double t41 = cos(t39);
    const double t42 = t40 / t39;
    const double t43 = 1.0 - t42;
    const double t44 = t43 / t38;
    const double t45 = t9 != 0.0 ? t37 : t44;
    const double t46 = t5 + t7;
    const double t47 = t45 * t46;
    const double t48 = 1.0 - t47;
    const double t49 = t0 * t1;
    const double t50 = t45 * t49;
    const double t52 = (-4.110317623312165e-19) * t8;
    const double t54 = t52 + 1.5619206968586225e-16;
    const double t55 = t54 * t8;
    const double t57 = t55 + (-4.779477332387385e-14);
    const double t58 = t57 * t8;
    const double t60 = t58 + 1.1470745597729725e-11;
    const double t61 = t60 * t8;
    const double t63 = t61 + (-2.08767569878681e-09);
    const double t64 = t63 * t8;
    const double t66 = t64 + 2.755731922398589e-07;
    const double t67 = t66 * t8;
    const double t69 = t67 + (-2.48015873015873e-05);
    const double t70 = t69 * t8;
    const double t72 = t70 + 0.001388888888888889;
    const double t73 = t72 * t8;
    const double t75 = t73 + (-0.041666666666666664);
    const double t76 = t75 * t8;
    const double t78 = t76 + 0.5;
    const double t79 = 1.0 - t41;
    const double t80 = t79 / t38;
    const double t81 = t9 != 0.0 ? t78 : t80;
    const double t82 = t81 * t2;
    const double t83 = t50 + t82;
    const double t84 = t0 * t2;
    const double t85 = t45 * t84;
    const double t86 = t81 * t1;
    const double t87 = t85 - t86;
    const double t88 = t50 - t82;
    const double t89 = t4 + t7;
    const double t90 = t45 * t89;
    const double t91 = 1.0 - t90;
    const double t92 = t1 * t2;
    const double t93 = t45 * t92;
    const double t94 = t81 * t0;
    const double t95 = t93 + t94;
    const double t96 = t85 + t86;
    const double t97 = t93 - t94;
    const double t98 = t45 * t6;
    const double t99 = 1.0 - t98;
    J[0] = t48;
    J[1] = t83;
    J[2] = t87;
    J[3] = t88;
    J[4] = t91;
    J[5] = t95;
    J[6] = t96;
    J[7] = t97;
    J[8] = t99;
}

void so3_ljac_inv(const double x[3], double J_inv[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t4 = t0 * t0;
    const double t5 = t1 * t1;
    const double t6 = t4 + t5;
    const double t7 = t2 * t2;
    const double t8 = t6 + t7;
    const double t10 = (double)(t8 < 12.0);
    const double t13 = t10 != 0.0 ? t8 : 1.0;
    const double t14 = 39.47841760435743 - t13;
    const double t15 = 2.0 / t14;
    const double t33 = 8.470227328650247e-38 * t13;
    const double t34 = (-1.3375664093215244e-35) - t33;
    const double t35 = t34 * t13;
    const double t36 = 2.1122063323183885e-33 - t35;
    const double t37 = t36 * t13;
    const double t38 = (-3.3354842988221443e-31) - t37;
    const double t39 = t38 * t13;
    const double t40 = 5.267262996834231e-29 - t39;
    const double t41 = t40 * t13;
    const double t42 = (-8.318003195189264e-27) - t41;
    const double t43 = t42 * t13;
    const double t44 = 1.3136241807166534e-24 - t43;
    const double t45 = t44 * t13;
    const double t46 = (-2.0747401878593604e-22) - t45;
    const double t47 = t46 * t13;
    const double t48 = 3.277539174701792e-20 - t47;
    const double t49 = t48 * t13;
    const double t50 = (-5.180118196169724e-18) - t49;
    const double t51 = t50 * t13;
    const double t52 = 8.196052055691008e-16 - t51;
    const double t53 = t52 * t13;
    const double t54 = (-1.3000482138698975e-13) - t53;
    const double t55 = t54 * t13;
    const double t56 = 2.0742872904166045e-11 - t55;
    const double t57 = t56 * t13;
    const double t58 = (-3.357141926657451e-09) - t57;
    const double t59 = t58 * t13;
    const double t60 = 5.637370282876845e-07 - t59;
    const double t61 = t60 * t13;
    const double t62 = (-0.000105641107053347) - t61;
    const double t63 = t62 * t13;
    const double t64 = 0.03267274151216445 - t63;
    const double t65 = t15 + t64;
    const double t66 = t10 != 0.0 ? 12.0 : t8;
    const double t67 = sqrt(t66);
    const double t68 = t67 / 2.0;
    const double t69 = cos(t68);
    const double t70 = sin(t68);
    const double t71 = t68 * t69;
    const double t72 = t71 / t70;
    const double t73 = 1.0 - t72;
    const double t74 = t73 / t66;
    const double t75 = t10 != 0.0 ? t65 : t74;
    const double t76 = t5 + t7;
    const double t77 = t75 * t76;
    const double t78 = 1.0 - t77;
    const double t79 = t0 * t1;
    const double t80 = t75 * t79;
    const double t82 = (-0.5) * t2;
    const double t83 = t80 - t82;
    const double t84 = t0 * t2;
    const double t85 = t75 * t84;
    const double t86 = (-0.5) * t1;
    const double t87 = t85 + t86;
    const double t88 = t80 + t82;
    const double t89 = t4 + t7;
    const double t90 = t75 * t89;
    const double t91 = 1.0 - t90;
    const double t92 = t1 * t2;
    const double t93 = t75 * t92;
    const double t94 = (-0.5) * t0;
    const double t95 = t93 - t94;
    const double t96 = t85 - t86;
    const double t97 = t93 + t94;
    const double t98 = t75 * t6;
    const double t99 = 1.0 - t98;
    J_inv[0] = t78;
    J_inv[1] = t83;
    J_inv[2] = t87;
    J_inv[3] = t88;
    J_inv[4] = t91;
    J_inv[5] = t95;
    J_inv[6] = t96;
    J_inv[7] = t97;
    J_inv[8] = t99;
}

void so3_rjac_inv(const double x[3], double J_inv[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t4 = t0 * t0;
    const double t5 = t1 * t1;
    const double t6 = t4 + t5;
    const double t7 = t2 * t2;
    const double t8 = t6 + t7;
    const double t10 = (double)(t8 < 12.0);
    const double t13 = t10 != 0.0 ? t8 : 1.0;
    const double t14 = 39.47841760435743 - t13;
    const double t15 = 2.0 / t14;
    const double t33 = 8.470227328650247e-38 * t13;
    const double t34 = (-1.3375664093215244e-35) - t33;
    const double t35 = t34 * t13;
    const double t36 = 2.1122063323183885e-33 - t35;
    const double t37 = t36 * t13;
    const double t38 = (-3.3354842988221443e-31) - t37;
    const double t39 = t38 * t13;
    const double t40 = 5.267262996834231e-29 - t39;
    const double t41 = t40 * t13;
    const double t42 = (-8.318003195189264e-27) - t41;
    const double t43 = t42 * t13;
    const double t44 = 1.3136241807166534e-24 - t43;
    const double t45 = t44 * t13;
    const double t46 = (-2.0747401878593604e-22) - t45;
    const double t47 = t46 * t13;
    const double t48 = 3.277539174701792e-20 - t47;
    const double t49 = t48 * t13;
    const double t50 = (-5.180118196169724e-18) - t49;
    const double t51 = t50 * t13;
    const double t52 = 8.196052055691008e-16 - t51;
    const double t53 = t52 * t13;
    const double t54 = (-1.3000482138698975e-13) - t53;
    const double t55 = t54 * t13;
    const double t56 = 2.0742872904166045e-11 - t55;
    const double t57 = t56 * t13;
    const double t58 = (-3.357141926657451e-09) - t57;
    const double t59 = t58 * t13;
    const double t60 = 5.637370282876845e-07 - t59;
    const double t61 = t60 * t13;
    const double t62 = (-0.000105641107053347) - t61;
    const double t63 = t62 * t13;
    const double t64 = 0.03267274151216445 - t63;
    const double t65 = t15 + t64;
    const double t66 = t10 != 0.0 ? 12.0 : t8;
    const double t67 = sqrt(t66);
    const double t68 = t67 / 2.0;
    const double t69 = cos(t68);
    const double t70 = sin(t68);
    const double t71 = t68 * t69;
    const double t72 = t71 / t70;
    const double t73 = 1.0 - t72;
    const double t74 = t73 / t66;
    const double t75 = t10 != 0.0 ? t65 : t74;
    const double t76 = t5 + t7;
    const double t77 = t75 * t76;
    const double t78 = 1.0 - t77;
    const double t79 = t0 * t1;
    const double t80 = t75 * t79;
    const double t82 = 0.5 * t2;
    const double t83 = t80 - t82;
    const double t84 = t0 * t2;
    const double t85 = t75 * t84;
    const double t86 = 0.5 * t1;
    const double t87 = t85 + t86;
    const double t88 = t80 + t82;
    const double t89 = t4 + t7;
    const double t90 = t75 * t89;
    const double t91 = 1.0 - t90;
    const double t92 = t1 * t2;
    const double t93 = t75 * t92;
    const double t94 = 0.5 * t0;
    const double t95 = t93 - t94;
    const double t96 = t85 - t86;
    const double t97 = t93 + t94;
    const double t98 = t75 * t6;
    const double t99 = 1.0 - t98;
    J_inv[0] = t78;
    J_inv[1] = t83;
    J_inv[2] = t87;
    J_inv[3] = t88;
    J_inv[4] = t91;
    J_inv[5] = t95;
    J_inv[6] = t96;
    J_inv[7] = t97;
    J_inv[8] = t99;
}

void so3_defect(const double X[9], double defect[1])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = X[6];
    const double t7 = X[7];
    const double t8 = X[8];
    const double t9 = fabs(t0);
    const double t10 = fabs(t1);
    const double t11 = t9 + t10;
    const double t12 = fabs(t2);
    const double t13 = t11 + t12;
    const double t14 = fabs(t3);
    const double t15 = t13 + t14;
    const double t16 = fabs(t4);
    const double t17 = t15 + t16;
    const double t18 = fabs(t5);
    const double t19 = t17 + t18;
    const double t20 = fabs(t6);
    const double t21 = t19 + t20;
    const double t22 = fabs(t7);
    const double t23 = t21 + t22;
    const double t24 = fabs(t8);
    const double t25 = t23 + t24;
    const double t27 = (double)(t25 < HUGE_VAL);
    const double t28 = t0 * t0;
    const double t29 = t3 * t3;
    const double t30 = t28 + t29;
    const double t31 = t6 * t6;
    const double t32 = t30 + t31;
    const double t34 = t32 + (-1.0);
    const double t35 = fabs(t34);
    const double t36 = t0 * t1;
    const double t37 = t3 * t4;
    const double t38 = t36 + t37;
    const double t39 = t6 * t7;
    const double t40 = t38 + t39;
    const double t41 = fabs(t40);
    const double t42 = (double)(t35 < t41);
    const double t43 = t42 != 0.0 ? t41 : t35;
    const double t44 = t0 * t2;
    const double t45 = t3 * t5;
    const double t46 = t44 + t45;
    const double t47 = t6 * t8;
    const double t48 = t46 + t47;
    const double t49 = fabs(t48);
    const double t50 = (double)(t43 < t49);
    const double t51 = t50 != 0.0 ? t49 : t43;
    const double t52 = t1 * t1;
    const double t53 = t4 * t4;
    const double t54 = t52 + t53;
    const double t55 = t7 * t7;
    const double t56 = t54 + t55;
    const double t57 = t56 + (-1.0);
    const double t58 = fabs(t57);
    const double t59 = (double)(t51 < t58);
    const double t60 = t59 != 0.0 ? t58 : t51;
    const double t61 = t1 * t2;
    const double t62 = t4 * t5;
    const double t63 = t61 + t62;
    const double t64 = t7 * t8;
    const double t65 = t63 + t64;
    const double t66 = fabs(t65);
    const double t67 = (double)(t60 < t66);
    const double t68 = t67 != 0.0 ? t66 : t60;
    const double t69 = t2 * t2;
    const double t70 = t5 * t5;
    const double t71 = t69 + t70;
    const double t72 = t8 * t8;
    const double t73 = t71 + t72;
    const double t74 = t73 + (-1.0);
    const double t75 = fabs(t74);
    const double t76 = (double)(t68 < t75);
    const double t77 = t76 != 0.0 ? t75 : t68;
    const double t79 = (double)(t9 < t10);
    const double t80 = t79 != 0.0 ? t10 : t9;
    const double t81 = (double)(t80 < t12);
    const double t82 = t81 != 0.0 ? t12 : t80;
    const double t83 = (double)(t82 < t14);
    const double t84 = t83 != 0.0 ? t14 : t82;
    const double t85 = (double)(t84 < t16);
    const double t86 = t85 != 0.0 ? t16 : t84;
    const double t87 = (double)(t86 < t18);
    const double t88 = t87 != 0.0 ? t18 : t86;
    const double t89 = (double)(t88 < t20);
    const double t90 = t89 != 0.0 ? t20 : t88;
    const double t91 = (double)(t90 < t22);
    const double t92 = t91 != 0.0 ? t22 : t90;
    const double t93 = (double)(t92 < t24);
    const double t94 = t93 != 0.0 ? t24 : t92;
    const double t95 = (double)(1.0 < t94);
    const double t96 = t95 != 0.0 ? t94 : 1.0;
    const double t97 = t96 * t96;
    const double t98 = t77 / t97;
    const double t100 = (-1e-13) * t96;
    const double t101 = t100 * t96;
    const double t102 = t101 * t96;
    const double t103 = t4 * t8;
    const double t104 = t5 * t7;
    const double t105 = t103 - t104;
    const double t106 = t0 * t105;
    const double t107 = t3 * t8;
    const double t108 = t5 * t6;
    const double t109 = t107 - t108;
    const double t110 = t1 * t109;
    const double t111 = t106 - t110;
    const double t112 = t3 * t7;
    const double t113 = t4 * t6;
    const double t114 = t112 - t113;
    const double t115 = t2 * t114;
    const double t116 = t111 + t115;
    const double t117 = (double)(t102 < t116);
    const double t118 = (double)(t117 == 0.0);
    const double t120 = t118 != 0.0 ? 2.0 : 0.0;
    const double t121 = (double)(t98 < t120);
    const double t122 = t121 != 0.0 ? t120 : t98;
    const double t124 = t27 != 0.0 ? t122 : (double)NAN;
    defect[0] = t124;
}

void so3_renormalise(const double X[9], double Y[9])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = X[6];
    const double t7 = X[7];
    const double t8 = X[8];
    const double t11 = t0 * t0;
    const double t12 = t3 * t3;
    const double t13 = t11 + t12;
    const double t14 = t6 * t6;
    const double t15 = t13 + t14;
    const double t16 = 1.0 - t15;
    const double t17 = 0.5 * t16;
    const double t18 = t0 * t17;
    const double t19 = t1 * t0;
    const double t20 = t4 * t3;
    const double t21 = t19 + t20;
    const double t22 = t7 * t6;
    const double t23 = t21 + t22;
    const double t24 = 0.5 * t23;
    const double t25 = t1 * t24;
    const double t26 = t18 - t25;
    const double t27 = t2 * t0;
    const double t28 = t5 * t3;
    const double t29 = t27 + t28;
    const double t30 = t8 * t6;
    const double t31 = t29 + t30;
    const double t32 = 0.5 * t31;
    const double t33 = t2 * t32;
    const double t34 = t26 - t33;
    const double t35 = t0 + t34;
    const double t36 = t1 * t1;
    const double t37 = t4 * t4;
    const double t38 = t36 + t37;
    const double t39 = t7 * t7;
    const double t40 = t38 + t39;
    const double t41 = 1.0 - t40;
    const double t42 = 0.5 * t41;
    const double t43 = t1 * t42;
    const double t44 = t0 * t1;
    const double t45 = t3 * t4;
    const double t46 = t44 + t45;
    const double t47 = t6 * t7;
    const double t48 = t46 + t47;
    const double t49 = 0.5 * t48;
    const double t50 = t0 * t49;
    const double t51 = t43 - t50;
    const double t52 = t2 * t1;
    const double t53 = t5 * t4;
    const double t54 = t52 + t53;
    const double t55 = t8 * t7;
    const double t56 = t54 + t55;
    const double t57 = 0.5 * t56;
    const double t58 = t2 * t57;
    const double t59 = t51 - t58;
    const double t60 = t1 + t59;
    const double t61 = t2 * t2;
    const double t62 = t5 * t5;
    const double t63 = t61 + t62;
    const double t64 = t8 * t8;
    const double t65 = t63 + t64;
    const double t66 = 1.0 - t65;
    const double t67 = 0.5 * t66;
    const double t68 = t2 * t67;
    const double t69 = t0 * t2;
    const double t70 = t3 * t5;
    const double t71 = t69 + t70;
    const double t72 = t6 * t8;
    const double t73 = t71 + t72;
    const double t74 = 0.5 * t73;
    const double t75 = t0 * t74;
    const double t76 = t1 * t2;
    const double t77 = t4 * t5;
    const double t78 = t76 + t77;
    const double t79 = t7 * t8;
    const double t80 = t78 + t79;
    const double t81 = 0.5 * t80;
    const double t82 = t1 * t81;
    const double t83 = t75 + t82;
    const double t84 = t68 - t83;
    const double t85 = t2 + t84;
    const double t86 = t3 * t17;
    const double t87 = t4 * t24;
    const double t88 = t86 - t87;
    const double t89 = t5 * t32;
    const double t90 = t88 - t89;
    const double t91 = t3 + t90;
    const double t92 = t4 * t42;
    const double t93 = t3 * t49;
    const double t94 = t92 - t93;
    const double t95 = t5 * t57;
    const double t96 = t94 - t95;
    const double t97 = t4 + t96;
    const double t98 = t5 * t67;
    const double t99 = t3 * t74;
    const double t100 = t4 * t81;
    const double t101 = t99 + t100;
    const double t102 = t98 - t101;
    const double t103 = t5 + t102;
    const double t104 = t6 * t17;
    const double t105 = t7 * t24;
    const double t106 = t104 - t105;
    const double t107 = t8 * t32;
    const double t108 = t106 - t107;
    const double t109 = t6 + t108;
    const double t110 = t7 * t42;
    const double t111 = t6 * t49;
    const double t112 = t110 - t111;
    const double t113 = t8 * t57;
    const double t114 = t112 - t113;
    const double t115 = t7 + t114;
    const double t116 = t8 * t67;
    const double t117 = t6 * t74;
    const double t118 = t7 * t81;
    const double t119 = t117 + t118;
    const double t120 = t116 - t119;
    const double t121 = t8 + t120;
    Y[0] = t35;
    Y[1] = t60;
    Y[2] = t85;
    Y[3] = t91;
    Y[4] = t97;
    Y[5] = t103;
    Y[6] = t109;
    Y[7] = t115;
    Y[8] = t121;
}
