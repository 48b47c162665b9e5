/* SPDX-License-Identifier: MIT-0 */
/* se2. Written by lie_codegen; documented in se2.h. */
#include "se2.h"

#include <math.h>

static void se2_log_candidate(const double X[9], double x[3])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = t3 - t1;
    const double t8 = t6 / 2.0;
    const double t9 = t0 + t4;
    const double t10 = t9 / 2.0;
    const double t11 = atan2(t8, t10);
    const double t12 = t11 * t11;
    const double t14 = (double)(t12 < 12.0);
    const double t16 = t14 != 0.0 ? t12 : 1.0;
    const double t18 = 39.47841760435743 - t16;
    const double t19 = 2.0 / t18;
    const double t37 = 8.470227328650247e-38 * t16;
    const double t38 = (-1.3375664093215244e-35) - t37;
    const double t39 = t38 * t16;
    const double t40 = 2.1122063323183885e-33 - t39;
    const double t41 = t40 * t16;
    const double t42 = (-3.3354842988221443e-31) - t41;
    const double t43 = t42 * t16;
    const double t44 = 5.267262996834231e-29 - t43;
    const double t45 = t44 * t16;
    const double t46 = (-8.318003195189264e-27) - t45;
    const double t47 = t46 * t16;
    const double t48 = 1.3136241807166534e-24 - t47;
    const double t49 = t48 * t16;
    const double t50 = (-2.0747401878593604e-22) - t49;
    const double t51 = t50 * t16;
    const double t52 = 3.277539174701792e-20 - t51;
    const double t53 = t52 * t16;
    const double t54 = (-5.180118196169724e-18) - t53;
    const double t55 = t54 * t16;
    const double t56 = 8.196052055691008e-16 - t55;
    const double t57 = t56 * t16;
    const double t58 = (-1.3000482138698975e-13) - t57;
    const double t59 = t58 * t16;
    const double t60 = 2.0742872904166045e-11 - t59;
    const double t61 = t60 * t16;
    const double t62 = (-3.357141926657451e-09) - t61;
    const double t63 = t62 * t16;
    const double t64 = 5.637370282876845e-07 - t63;
    const double t65 = t64 * t16;
    const double t66 = (-0.000105641107053347) - t65;
    const double t67 = t66 * t16;
    const double t68 = 0.03267274151216445 - t67;
    const double t69 = t19 + t68;
    const double t70 = t16 * t69;
    const double t71 = 1.0 - t70;
    const double t72 = t14 != 0.0 ? 12.0 : t12;
    const double t73 = sqrt(t72);
    const double t74 = t73 / 2.0;
    const double t75 = cos(t74);
    const double t76 = sin(t74);
    const double t77 = t74 * t75;
    const double t78 = t77 / t76;
    const double t79 = t14 != 0.0 ? t71 : t78;
    const double t80 = t0 * t2;
    const double t81 = t3 * t5;
    const double t82 = t80 + t81;
    const double t83 = t79 * t82;
    const double t85 = t1 * t2;
    const double t86 = t4 * t5;
    const double t87 = t85 + t86;
    const double t88 = t11 * t87;
    const double t89 = 0.5 * t88;
    const double t90 = t83 - t89;
    const double t91 = t79 * t87;
    const double t92 = t11 * t82;
    const double t93 = 0.5 * t92;
    const double t94 = t91 + t93;
    x[0] = t11;
    x[1] = t90;
    x[2] = t94;
}

static void se2_log_error(const double x[3], const double X[9], double u[3], double error[2])
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
    const double t15 = (double)(t13 < 1.0);
    const double t17 = (-4.110317623312165e-19) * t13;
    const double t19 = t17 + 1.5619206968586225e-16;
    const double t20 = t19 * t13;
    const double t22 = t20 + (-4.779477332387385e-14);
    const double t23 = t22 * t13;
    const double t25 = t23 + 1.1470745597729725e-11;
    const double t26 = t25 * t13;
    const double t28 = t26 + (-2.08767569878681e-09);
    const double t29 = t28 * t13;
    const double t31 = t29 + 2.755731922398589e-07;
    const double t32 = t31 * t13;
    const double t34 = t32 + (-2.48015873015873e-05);
    const double t35 = t34 * t13;
    const double t37 = t35 + 0.001388888888888889;
    const double t38 = t37 * t13;
    const double t40 = t38 + (-0.041666666666666664);
    const double t41 = t40 * t13;
    const double t43 = t41 + 0.5;
    const double t44 = t13 * t43;
    const double t45 = 1.0 - t44;
    const double t46 = t15 != 0.0 ? 1.0 : t13;
    const double t47 = sqrt(t46);
    const double t48 = cos(t47);
    const double t49 = sin(t47);
    const double t50 = t15 != 0.0 ? t45 : t48;
    const double t51 = t50 * t4;
    const double t53 = (-8.22063524662433e-18) * t13;
    const double t55 = t53 + 2.8114572543455206e-15;
    const double t56 = t55 * t13;
    const double t58 = t56 + (-7.647163731819816e-13);
    const double t59 = t58 * t13;
    const double t61 = t59 + 1.6059043836821613e-10;
    const double t62 = t61 * t13;
    const double t64 = t62 + (-2.505210838544172e-08);
    const double t65 = t64 * t13;
    const double t67 = t65 + 2.7557319223985893e-06;
    const double t68 = t67 * t13;
    const double t70 = t68 + (-0.0001984126984126984);
    const double t71 = t70 * t13;
    const double t73 = t71 + 0.008333333333333333;
    const double t74 = t73 * t13;
    const double t76 = t74 + (-0.16666666666666666);
    const double t77 = t76 * t13;
    const double t78 = t77 + 1.0;
    const double t79 = t49 / t47;
    const double t80 = t15 != 0.0 ? t78 : t79;
    const double t81 = t80 * t0;
    const double t82 = t81 * t7;
    const double t83 = t51 + t82;
    const double t84 = 1.0 - t48;
    const double t85 = t84 / t46;
    const double t86 = t15 != 0.0 ? t43 : t85;
    const double t87 = t0 * t2;
    const double t88 = t86 * t87;
    const double t89 = t80 * t1;
    const double t90 = t88 + t89;
    const double t91 = t90 * t10;
    const double t92 = t83 - t91;
    const double t93 = (-0.5) * t92;
    const double t94 = t50 * t6;
    const double t95 = t81 * t3;
    const double t96 = t94 - t95;
    const double t97 = t0 * t1;
    const double t98 = t86 * t97;
    const double t99 = t80 * t2;
    const double t100 = t98 - t99;
    const double t101 = t100 * t9;
    const double t102 = t96 + t101;
    const double t103 = 0.5 * t102;
    const double t104 = t93 + t103;
    const double t105 = t50 * t5;
    const double t106 = t81 * t8;
    const double t107 = t105 + t106;
    const double t108 = t90 * t11;
    const double t109 = t107 - t108;
    const double t110 = t50 * t8;
    const double t111 = t81 * t5;
    const double t112 = t110 - t111;
    const double t113 = t100 * t11;
    const double t114 = t112 + t113;
    const double t115 = t50 * t3;
    const double t116 = t81 * t6;
    const double t117 = t115 + t116;
    const double t118 = t90 * t9;
    const double t119 = t117 - t118;
    const double t121 = t119 + (-1.0);
    const double t122 = fabs(t121);
    const double t123 = fabs(t92);
    const double t124 = t122 + t123;
    const double t125 = fabs(t109);
    const double t126 = t124 + t125;
    const double t127 = fabs(t102);
    const double t128 = t126 + t127;
    const double t129 = t50 * t7;
    const double t130 = t81 * t4;
    const double t131 = t129 - t130;
    const double t132 = t100 * t10;
    const double t133 = t131 + t132;
    const double t134 = t133 + (-1.0);
    const double t135 = fabs(t134);
    const double t136 = t128 + t135;
    const double t137 = fabs(t114);
    const double t138 = t136 + t137;
    const double t139 = fabs(t9);
    const double t140 = t138 + t139;
    const double t141 = fabs(t10);
    const double t142 = t140 + t141;
    const double t143 = t11 + (-1.0);
    const double t144 = fabs(t143);
    const double t145 = t142 + t144;
    const double t147 = (double)(t145 < HUGE_VAL);
    const double t148 = fabs(t50);
    const double t149 = fabs(t3);
    const double t150 = t148 * t149;
    const double t151 = fabs(t81);
    const double t152 = fabs(t6);
    const double t153 = t151 * t152;
    const double t154 = t150 + t153;
    const double t155 = fabs(t90);
    const double t156 = t155 * t139;
    const double t157 = t154 + t156;
    const double t158 = (double)(1.0 < t157);
    const double t159 = t158 != 0.0 ? t157 : 1.0;
    const double t160 = t122 / t159;
    const double t161 = t92 + t104;
    const double t162 = fabs(t161);
    const double t163 = fabs(t4);
    const double t164 = t148 * t163;
    const double t165 = fabs(t7);
    const double t166 = t151 * t165;
    const double t167 = t164 + t166;
    const double t168 = t155 * t141;
    const double t169 = t167 + t168;
    const double t170 = (double)(1.0 < t169);
    const double t171 = t170 != 0.0 ? t169 : 1.0;
    const double t172 = t162 / t171;
    const double t173 = (double)(t160 < t172);
    const double t174 = t173 != 0.0 ? t172 : t160;
    const double t176 = (double)(t174 < 0.0);
    const double t177 = (double)(t176 == 0.0);
    const double t178 = t177 != 0.0 ? t174 : 0.0;
    const double t179 = t102 - t104;
    const double t180 = fabs(t179);
    const double t181 = t151 * t149;
    const double t182 = t148 * t152;
    const double t183 = t181 + t182;
    const double t184 = fabs(t100);
    const double t185 = t184 * t139;
    const double t186 = t183 + t185;
    const double t187 = (double)(1.0 < t186);
    const double t188 = t187 != 0.0 ? t186 : 1.0;
    const double t189 = t180 / t188;
    const double t190 = (double)(t178 < t189);
    const double t191 = t190 != 0.0 ? t189 : t178;
    const double t192 = t151 * t163;
    const double t193 = t148 * t165;
    const double t194 = t192 + t193;
    const double t195 = t184 * t141;
    const double t196 = t194 + t195;
    const double t197 = (double)(1.0 < t196);
    const double t198 = t197 != 0.0 ? t196 : 1.0;
    const double t199 = t135 / t198;
    const double t200 = (double)(t191 < t199);
    const double t201 = t200 != 0.0 ? t199 : t191;
    const double t202 = (double)(t201 < 0.0);
    const double t203 = (double)(t202 == 0.0);
    const double t204 = t203 != 0.0 ? t201 : 0.0;
    const double t205 = (double)(1.0 < t139);
    const double t206 = t205 != 0.0 ? t139 : 1.0;
    const double t207 = t139 / t206;
    const double t208 = (double)(t204 < t207);
    const double t209 = t208 != 0.0 ? t207 : t204;
    const double t210 = (double)(1.0 < t141);
    const double t211 = t210 != 0.0 ? t141 : 1.0;
    const double t212 = t141 / t211;
    const double t213 = (double)(t209 < t212);
    const double t214 = t213 != 0.0 ? t212 : t209;
    const double t215 = fabs(t11);
    const double t216 = (double)(1.0 < t215);
    const double t217 = t216 != 0.0 ? t215 : 1.0;
    const double t218 = t144 / t217;
    const double t219 = (double)(t214 < t218);
    const double t220 = t219 != 0.0 ? t218 : t214;
    const double t222 = t147 != 0.0 ? t220 : (double)NAN;
    const double t223 = fabs(t104);
    const double t224 = t223 / t171;
    const double t225 = fabs(t5);
    const double t226 = t148 * t225;
    const double t227 = fabs(t8);
    const double t228 = t151 * t227;
    const double t229 = t226 + t228;
    const double t230 = t155 * t215;
    const double t231 = t229 + t230;
    const double t232 = (double)(1.0 < t231);
    const double t233 = t232 != 0.0 ? t231 : 1.0;
    const double t234 = t125 / t233;
    const double t235 = (double)(t224 < t234);
    const double t236 = t235 != 0.0 ? t234 : t224;
    const double t237 = t223 / t188;
    const double t238 = (double)(t236 < t237);
    const double t239 = t238 != 0.0 ? t237 : t236;
    const double t240 = t151 * t225;
    const double t241 = t148 * t227;
    const double t242 = t240 + t241;
    const double t243 = t184 * t215;
    const double t244 = t242 + t243;
    const double t245 = (double)(1.0 < t244);
    const double t246 = t245 != 0.0 ? t244 : 1.0;
    const double t247 = t137 / t246;
    const double t248 = (double)(t239 < t247);
    const double t249 = t248 != 0.0 ? t247 : t239;
    const double t250 = t147 != 0.0 ? t249 : (double)NAN;
    u[0] = t104;
    u[1] = t109;
    u[2] = t114;
    error[0] = t222;
    error[1] = t250;
}



/* y = x + rjac_inv(x) u, rjac = (1 - e^{-ad x})/ad x: its series after scaling, doubled, then elimination. 0 where it is singular. */
static int se2_log_checked_newton(const double *x, const double *u, double *y)
{
    static const int place[4][3] = {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {2, 0, 1} };
    static const double value[4] = {1.0, -1.0, -1.0, 1.0 };
    double B[3][3], E[3][3], F[3][4], P[3][3], R[3][3];
    double size = 0.0;
    int i, j, k, step, doublings = 0;
    for (i = 0; i < 3; ++i) {
        for (j = 0; j < 3; ++j) {
            B[i][j] = 0.0;
        }
    }
    for (k = 0; k < 4; ++k) {
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
static int se2_log_checked_certified(const double *X, double *x)
{
    double u[3], error[2];
    int k, step;
    se2_log_error(x, X, u, error);
    for (step = 0; step < 3 && !(error[1] <= 4e-15); ++step) {
        double y[3], v[3], fresh[2];
        if (!se2_log_checked_newton(x, u, y)) {
            break;
        }
        se2_log_error(y, X, v, fresh);
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

static void se2_log_checked(const double *X, double *x)
{
    int k;
    do {
        se2_log_candidate(X, x);
        if (se2_log_checked_certified(X, x)) {
            return;
        }
    } while (0);
    for (k = 0; k < 3; ++k) {
        x[k] = (double)NAN;
    }
}

void se2_product_exp(const double g[3], double X[9])
{
    const double t0 = g[0];
    const double t1 = g[1];
    const double t2 = g[2];
    const double t3 = cos(t0);
    const double t4 = sin(t0);
    const double t5 = -t4;
    const double t6 = t3 * t1;
    const double t7 = t4 * t2;
    const double t8 = t6 - t7;
    const double t9 = t4 * t1;
    const double t10 = t3 * t2;
    const double t11 = t9 + t10;
    X[0] = t3;
    X[1] = t5;
    X[2] = t8;
    X[3] = t4;
    X[4] = t3;
    X[5] = t11;
    X[6] = 0.0;
    X[7] = 0.0;
    X[8] = 1.0;
}

void se2_wei_norman_matrix(const double g[3], double M[9])
{
    const double t0 = g[1];
    const double t1 = g[2];
    const double t4 = -t0;
    M[0] = 1.0;
    M[1] = 0.0;
    M[2] = 0.0;
    M[3] = t1;
    M[4] = 1.0;
    M[5] = 0.0;
    M[6] = t4;
    M[7] = 0.0;
    M[8] = 1.0;
}

void se2_wei_norman_rate(const double g[3], const double u[3], double g_dot[3])
{
    const double t0 = g[1];
    const double t1 = g[2];
    const double t2 = u[0];
    const double t3 = u[1];
    const double t4 = u[2];
    const double t5 = t1 * t2;
    const double t6 = t5 + t3;
    const double t7 = t0 * t2;
    const double t8 = t4 - t7;
    g_dot[0] = t2;
    g_dot[1] = t6;
    g_dot[2] = t8;
}

void se2_exp(const double x[3], double X[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t3 = t0 * t0;
    const double t5 = (double)(t3 < 1.0);
    const double t7 = (-4.110317623312165e-19) * t3;
    const double t9 = t7 + 1.5619206968586225e-16;
    const double t10 = t9 * t3;
    const double t12 = t10 + (-4.779477332387385e-14);
    const double t13 = t12 * t3;
    const double t15 = t13 + 1.1470745597729725e-11;
    const double t16 = t15 * t3;
    const double t18 = t16 + (-2.08767569878681e-09);
    const double t19 = t18 * t3;
    const double t21 = t19 + 2.755731922398589e-07;
    const double t22 = t21 * t3;
    const double t24 = t22 + (-2.48015873015873e-05);
    const double t25 = t24 * t3;
    const double t27 = t25 + 0.001388888888888889;
    const double t28 = t27 * t3;
    const double t30 = t28 + (-0.041666666666666664);
    const double t31 = t30 * t3;
    const double t33 = t31 + 0.5;
    const double t34 = t3 * t33;
    const double t35 = 1.0 - t34;
    const double t36 = t5 != 0.0 ? 1.0 : t3;
    const double t37 = sqrt(t36);
    const double t38 = cos(t37);
    const double t39 = sin(t37);
    const double t40 = t5 != 0.0 ? t35 : t38;
    const double t42 = (-8.22063524662433e-18) * t3;
    const double t44 = t42 + 2.8114572543455206e-15;
    const double t45 = t44 * t3;
    const double t47 = t45 + (-7.647163731819816e-13);
    const double t48 = t47 * t3;
    const double t50 = t48 + 1.6059043836821613e-10;
    const double t51 = t50 * t3;
    const double t53 = t51 + (-2.505210838544172e-08);
    const double t54 = t53 * t3;
    const double t56 = t54 + 2.7557319223985893e-06;
    const double t57 = t56 * t3;
    const double t59 = t57 + (-0.0001984126984126984);
    const double t60 = t59 * t3;
    const double t62 = t60 + 0.008333333333333333;
    const double t63 = t62 * t3;
    const double t65 = t63 + (-0.16666666666666666);
    const double t66 = t65 * t3;
    const double t67 = t66 + 1.0;
    const double t68 = t39 / t37;
    const double t69 = t5 != 0.0 ? t67 : t68;
    const double t70 = t69 * t0;
    const double t71 = -t70;
    const double t72 = t69 * t1;
    const double t73 = 1.0 - t38;
    const double t74 = t73 / t36;
    const double t75 = t5 != 0.0 ? t33 : t74;
    const double t76 = t0 * t2;
    const double t77 = t75 * t76;
    const double t78 = t72 - t77;
    const double t79 = t0 * t1;
    const double t80 = t75 * t79;
    const double t81 = t69 * t2;
    const double t82 = t80 + t81;
    X[0] = t40;
    X[1] = t71;
    X[2] = t78;
    X[3] = t70;
    X[4] = t40;
    X[5] = t82;
    X[6] = 0.0;
    X[7] = 0.0;
    X[8] = 1.0;
}

void se2_log(const double X[9], double x[3])
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
    const double t9 = t6 * t6;
    const double t10 = t7 * t7;
    const double t11 = t9 + t10;
    const double t13 = t8 + (-1.0);
    const double t14 = t13 * t13;
    const double t15 = t11 + t14;
    const double t16 = t0 - t4;
    const double t17 = t16 * t16;
    const double t18 = t15 + t17;
    const double t19 = t3 + t1;
    const double t20 = t19 * t19;
    const double t21 = t18 + t20;
    const double t22 = t0 * t0;
    const double t23 = t3 * t3;
    const double t24 = t22 + t23;
    const double t26 = t24 - 1.0;
    const double t27 = t26 * t26;
    const double t28 = t21 + t27;
    const double t30 = (double)(t28 < 1e-26);
    const double t31 = t3 - t1;
    const double t33 = t31 / 2.0;
    const double t34 = t0 + t4;
    const double t35 = t34 / 2.0;
    const double t36 = atan2(t33, t35);
    const double t37 = t30 != 0.0 ? 1.0 : 0.0;
    const double t39 = (double)(t37 < 0.5);
    double t40[3] = {0};
    if (t39 != 0) {
        const double t40_of[9] = {t0, t1, t2, t3, t4, t5, t6, t7, t8};
        se2_log_checked(t40_of, t40);
    }
    const double t41 = t40[0];
    const double t42 = t40[1];
    const double t43 = t40[2];
    const double t44 = t30 != 0.0 ? t36 : t41;
    const double t45 = t36 * t36;
    const double t47 = (double)(t45 < 12.0);
    const double t48 = t47 != 0.0 ? t45 : 1.0;
    const double t50 = 39.47841760435743 - t48;
    const double t51 = 2.0 / t50;
    const double t69 = 8.470227328650247e-38 * t48;
    const double t70 = (-1.3375664093215244e-35) - t69;
    const double t71 = t70 * t48;
    const double t72 = 2.1122063323183885e-33 - t71;
    const double t73 = t72 * t48;
    const double t74 = (-3.3354842988221443e-31) - t73;
    const double t75 = t74 * t48;
    const double t76 = 5.267262996834231e-29 - t75;
    const double t77 = t76 * t48;
    const double t78 = (-8.318003195189264e-27) - t77;
    const double t79 = t78 * t48;
    const double t80 = 1.3136241807166534e-24 - t79;
    const double t81 = t80 * t48;
    const double t82 = (-2.0747401878593604e-22) - t81;
    const double t83 = t82 * t48;
    const double t84 = 3.277539174701792e-20 - t83;
    const double t85 = t84 * t48;
    const double t86 = (-5.180118196169724e-18) - t85;
    const double t87 = t86 * t48;
    const double t88 = 8.196052055691008e-16 - t87;
    const double t89 = t88 * t48;
    const double t90 = (-1.3000482138698975e-13) - t89;
    const double t91 = t90 * t48;
    const double t92 = 2.0742872904166045e-11 - t91;
    const double t93 = t92 * t48;
    const double t94 = (-3.357141926657451e-09) - t93;
    const double t95 = t94 * t48;
    const double t96 = 5.637370282876845e-07 - t95;
    const double t97 = t96 * t48;
    const double t98 = (-0.000105641107053347) - t97;
    const double t99 = t98 * t48;
    const double t100 = 0.03267274151216445 - t99;
    const double t101 = t51 + t100;
    const double t102 = t48 * t101;
    const double t103 = 1.0 - t102;
    const double t104 = t47 != 0.0 ? 12.0 : t45;
    const double t105 = sqrt(t104);
    const double t106 = t105 / 2.0;
    const double t107 = cos(t106);
    const double t108 = sin(t106);
    const double t109 = t106 * t107;
    const double t110 = t109 / t108;
    const double t111 = t47 != 0.0 ? t103 : t110;
    const double t112 = t0 * t2;
    const double t113 = t3 * t5;
    const double t114 = t112 + t113;
    const double t115 = t111 * t114;
    const double t116 = t1 * t2;
    const double t117 = t4 * t5;
    const double t118 = t116 + t117;
    const double t119 = t36 * t118;
    const double t120 = 0.5 * t119;
    const double t121 = t115 - t120;
    const double t122 = t30 != 0.0 ? t121 : t42;
    const double t123 = t111 * t118;
    const double t124 = t36 * t114;
    const double t125 = 0.5 * t124;
    const double t126 = t123 + t125;
    const double t127 = t30 != 0.0 ? t126 : t43;
    x[0] = t44;
    x[1] = t122;
    x[2] = t127;
}

void se2_compose(const double X[9], const double Y[9], double Z[9])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = Y[0];
    const double t7 = Y[1];
    const double t8 = Y[2];
    const double t9 = Y[3];
    const double t10 = Y[4];
    const double t11 = Y[5];
    const double t12 = t0 * t6;
    const double t13 = t1 * t9;
    const double t14 = t12 + t13;
    const double t15 = t0 * t7;
    const double t16 = t1 * t10;
    const double t17 = t15 + t16;
    const double t18 = t0 * t8;
    const double t19 = t1 * t11;
    const double t20 = t18 + t19;
    const double t21 = t20 + t2;
    const double t22 = t3 * t6;
    const double t23 = t4 * t9;
    const double t24 = t22 + t23;
    const double t25 = t3 * t7;
    const double t26 = t4 * t10;
    const double t27 = t25 + t26;
    const double t28 = t3 * t8;
    const double t29 = t4 * t11;
    const double t30 = t28 + t29;
    const double t31 = t30 + t5;
    Z[0] = t14;
    Z[1] = t17;
    Z[2] = t21;
    Z[3] = t24;
    Z[4] = t27;
    Z[5] = t31;
    Z[6] = 0.0;
    Z[7] = 0.0;
    Z[8] = 1.0;
}

void se2_inverse(const double X[9], double X_inverse[9])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = t0 * t2;
    const double t7 = t3 * t5;
    const double t8 = t6 + t7;
    const double t9 = -t8;
    const double t10 = t1 * t2;
    const double t11 = t4 * t5;
    const double t12 = t10 + t11;
    const double t13 = -t12;
    X_inverse[0] = t0;
    X_inverse[1] = t3;
    X_inverse[2] = t9;
    X_inverse[3] = t1;
    X_inverse[4] = t4;
    X_inverse[5] = t13;
    X_inverse[6] = 0.0;
    X_inverse[7] = 0.0;
    X_inverse[8] = 1.0;
}

void se2_Ad(const double X[9], double Ad_X[9])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t6 = t1 * t3;
    const double t7 = t0 * t4;
    const double t8 = t6 - t7;
    const double t9 = -t8;
    const double t11 = t1 * t2;
    const double t12 = t4 * t5;
    const double t13 = t11 + t12;
    const double t14 = t0 * t13;
    const double t15 = t0 * t2;
    const double t16 = t3 * t5;
    const double t17 = t15 + t16;
    const double t18 = t1 * t17;
    const double t19 = t14 - t18;
    const double t20 = t3 * t13;
    const double t21 = t4 * t17;
    const double t22 = t20 - t21;
    Ad_X[0] = t9;
    Ad_X[1] = 0.0;
    Ad_X[2] = 0.0;
    Ad_X[3] = t19;
    Ad_X[4] = t0;
    Ad_X[5] = t1;
    Ad_X[6] = t22;
    Ad_X[7] = t3;
    Ad_X[8] = t4;
}

void se2_ad(const double x[3], double ad_x[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t4 = -t0;
    const double t5 = -t1;
    ad_x[0] = 0.0;
    ad_x[1] = 0.0;
    ad_x[2] = 0.0;
    ad_x[3] = t2;
    ad_x[4] = 0.0;
    ad_x[5] = t4;
    ad_x[6] = t5;
    ad_x[7] = t0;
    ad_x[8] = 0.0;
}

void se2_bracket(const double x[3], const double y[3], double z[3])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t3 = y[0];
    const double t4 = y[1];
    const double t5 = y[2];
    const double t7 = t0 * t5;
    const double t8 = t2 * t3;
    const double t9 = t7 - t8;
    const double t10 = -t9;
    const double t11 = t0 * t4;
    const double t12 = t1 * t3;
    const double t13 = t11 - t12;
    z[0] = 0.0;
    z[1] = t10;
    z[2] = t13;
}

void se2_ljac(const double x[3], double J[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t5 = t0 * t0;
    const double t6 = (double)(t5 < 1.0);
    const double t8 = (-1.9572941063391263e-20) * t5;
    const double t10 = t8 + 8.22063524662433e-18;
    const double t11 = t10 * t5;
    const double t13 = t11 + (-2.8114572543455206e-15);
    const double t14 = t13 * t5;
    const double t16 = t14 + 7.647163731819816e-13;
    const double t17 = t16 * t5;
    const double t19 = t17 + (-1.6059043836821613e-10);
    const double t20 = t19 * t5;
    const double t22 = t20 + 2.505210838544172e-08;
    const double t23 = t22 * t5;
    const double t25 = t23 + (-2.7557319223985893e-06);
    const double t26 = t25 * t5;
    const double t28 = t26 + 0.0001984126984126984;
    const double t29 = t28 * t5;
    const double t31 = t29 + (-0.008333333333333333);
    const double t32 = t31 * t5;
    const double t34 = t32 + 0.16666666666666666;
    const double t35 = t6 != 0.0 ? 1.0 : t5;
    const double t36 = sqrt(t35);
    const double t37 = sin(t36);
    const double t38 = cos(t36);
    const double t39 = t37 / t36;
    const double t40 = 1.0 - t39;
    const double t41 = t40 / t35;
    const double t42 = t6 != 0.0 ? t34 : t41;
    const double t43 = t0 * t1;
    const double t44 = t42 * t43;
    const double t46 = (-4.110317623312165e-19) * t5;
    const double t48 = t46 + 1.5619206968586225e-16;
    const double t49 = t48 * t5;
    const double t51 = t49 + (-4.779477332387385e-14);
    const double t52 = t51 * t5;
    const double t54 = t52 + 1.1470745597729725e-11;
    const double t55 = t54 * t5;
    const double t57 = t55 + (-2.08767569878681e-09);
    const double t58 = t57 * t5;
    const double t60 = t58 + 2.755731922398589e-07;
    const double t61 = t60 * t5;
    const double t63 = t61 + (-2.48015873015873e-05);
    const double t64 = t63 * t5;
    const double t66 = t64 + 0.001388888888888889;
    const double t67 = t66 * t5;
    const double t69 = t67 + (-0.041666666666666664);
    const double t70 = t69 * t5;
    const double t72 = t70 + 0.5;
    const double t73 = 1.0 - t38;
    const double t74 = t73 / t35;
    const double t75 = t6 != 0.0 ? t72 : t74;
    const double t76 = t75 * t2;
    const double t77 = t44 + t76;
    const double t78 = t5 * t34;
    const double t79 = 1.0 - t78;
    const double t80 = t6 != 0.0 ? t79 : t39;
    const double t81 = t75 * t0;
    const double t82 = -t81;
    const double t83 = t0 * t2;
    const double t84 = t42 * t83;
    const double t85 = t75 * t1;
    const double t86 = t84 - t85;
    J[0] = 1.0;
    J[1] = 0.0;
    J[2] = 0.0;
    J[3] = t77;
    J[4] = t80;
    J[5] = t82;
    J[6] = t86;
    J[7] = t81;
    J[8] = t80;
}

void se2_rjac(const double x[3], double J[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t5 = t0 * t0;
    const double t6 = (double)(t5 < 1.0);
    const double t8 = (-1.9572941063391263e-20) * t5;
    const double t10 = t8 + 8.22063524662433e-18;
    const double t11 = t10 * t5;
    const double t13 = t11 + (-2.8114572543455206e-15);
    const double t14 = t13 * t5;
    const double t16 = t14 + 7.647163731819816e-13;
    const double t17 = t16 * t5;
    const double t19 = t17 + (-1.6059043836821613e-10);
    const double t20 = t19 * t5;
    const double t22 = t20 + 2.505210838544172e-08;
    const double t23 = t22 * t5;
    const double t25 = t23 + (-2.7557319223985893e-06);
    const double t26 = t25 * t5;
    const double t28 = t26 + 0.0001984126984126984;
    const double t29 = t28 * t5;
    const double t31 = t29 + (-0.008333333333333333);
    const double t32 = t31 * t5;
    const double t34 = t32 + 0.16666666666666666;
    const double t35 = t6 != 0.0 ? 1.0 : t5;
    const double t36 = sqrt(t35);
    const double t37 = sin(t36);
    const double t38 = cos(t36);
    const double t39 = t37 / t36;
    const double t40 = 1.0 - t39;
    const double t41 = t40 / t35;
    const double t42 = t6 != 0.0 ? t34 : t41;
    const double t43 = t0 * t1;
    const double t44 = t42 * t43;
    const double t46 = (-4.110317623312165e-19) * t5;
    const double t48 = t46 + 1.5619206968586225e-16;
    const double t49 = t48 * t5;
    const double t51 = t49 + (-4.779477332387385e-14);
    const double t52 = t51 * t5;
    const double t54 = t52 + 1.1470745597729725e-11;
    const double t55 = t54 * t5;
    const double t57 = t55 + (-2.08767569878681e-09);
    const double t58 = t57 * t5;
    const double t60 = t58 + 2.755731922398589e-07;
    const double t61 = t60 * t5;
    const double t63 = t61 + (-2.48015873015873e-05);
    const double t64 = t63 * t5;
    const double t66 = t64 + 0.001388888888888889;
    const double t67 = t66 * t5;
    const double t69 = t67 + (-0.041666666666666664);
    const double t70 = t69 * t5;
    const double t72 = t70 + 0.5;
    const double t73 = 1.0 - t38;
    const double t74 = t73 / t35;
    const double t75 = t6 != 0.0 ? t72 : t74;
    const double t76 = t75 * t2;
    const double t77 = t44 - t76;
    const double t78 = t5 * t34;
    const double t79 = 1.0 - t78;
    const double t80 = t6 != 0.0 ? t79 : t39;
    const double t81 = t75 * t0;
    const double t82 = t0 * t2;
    const double t83 = t42 * t82;
    const double t84 = t75 * t1;
    const double t85 = t83 + t84;
    const double t86 = -t81;
    J[0] = 1.0;
    J[1] = 0.0;
    J[2] = 0.0;
    J[3] = t77;
    J[4] = t80;
    J[5] = t81;
    J[6] = t85;
    J[7] = t86;
    J[8] = t80;
}

void se2_ljac_inv(const double x[3], double J_inv[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t5 = t0 * t0;
    const double t7 = (double)(t5 < 12.0);
    const double t10 = t7 != 0.0 ? t5 : 1.0;
    const double t11 = 39.47841760435743 - t10;
    const double t12 = 2.0 / t11;
    const double t30 = 8.470227328650247e-38 * t10;
    const double t31 = (-1.3375664093215244e-35) - t30;
    const double t32 = t31 * t10;
    const double t33 = 2.1122063323183885e-33 - t32;
    const double t34 = t33 * t10;
    const double t35 = (-3.3354842988221443e-31) - t34;
    const double t36 = t35 * t10;
    const double t37 = 5.267262996834231e-29 - t36;
    const double t38 = t37 * t10;
    const double t39 = (-8.318003195189264e-27) - t38;
    const double t40 = t39 * t10;
    const double t41 = 1.3136241807166534e-24 - t40;
    const double t42 = t41 * t10;
    const double t43 = (-2.0747401878593604e-22) - t42;
    const double t44 = t43 * t10;
    const double t45 = 3.277539174701792e-20 - t44;
    const double t46 = t45 * t10;
    const double t47 = (-5.180118196169724e-18) - t46;
    const double t48 = t47 * t10;
    const double t49 = 8.196052055691008e-16 - t48;
    const double t50 = t49 * t10;
    const double t51 = (-1.3000482138698975e-13) - t50;
    const double t52 = t51 * t10;
    const double t53 = 2.0742872904166045e-11 - t52;
    const double t54 = t53 * t10;
    const double t55 = (-3.357141926657451e-09) - t54;
    const double t56 = t55 * t10;
    const double t57 = 5.637370282876845e-07 - t56;
    const double t58 = t57 * t10;
    const double t59 = (-0.000105641107053347) - t58;
    const double t60 = t59 * t10;
    const double t61 = 0.03267274151216445 - t60;
    const double t62 = t12 + t61;
    const double t63 = t7 != 0.0 ? 12.0 : t5;
    const double t64 = sqrt(t63);
    const double t65 = t64 / 2.0;
    const double t66 = cos(t65);
    const double t67 = sin(t65);
    const double t68 = t65 * t66;
    const double t69 = t68 / t67;
    const double t70 = 1.0 - t69;
    const double t71 = t70 / t63;
    const double t72 = t7 != 0.0 ? t62 : t71;
    const double t73 = t0 * t1;
    const double t74 = t72 * t73;
    const double t76 = (-0.5) * t2;
    const double t77 = t74 + t76;
    const double t78 = t10 * t62;
    const double t79 = 1.0 - t78;
    const double t80 = t7 != 0.0 ? t79 : t69;
    const double t81 = (-0.5) * t0;
    const double t82 = -t81;
    const double t83 = t0 * t2;
    const double t84 = t72 * t83;
    const double t85 = (-0.5) * t1;
    const double t86 = t84 - t85;
    J_inv[0] = 1.0;
    J_inv[1] = 0.0;
    J_inv[2] = 0.0;
    J_inv[3] = t77;
    J_inv[4] = t80;
    J_inv[5] = t82;
    J_inv[6] = t86;
    J_inv[7] = t81;
    J_inv[8] = t80;
}

void se2_rjac_inv(const double x[3], double J_inv[9])
{
    const double t0 = x[0];
    const double t1 = x[1];
    const double t2 = x[2];
    const double t5 = t0 * t0;
    const double t7 = (double)(t5 < 12.0);
    const double t10 = t7 != 0.0 ? t5 : 1.0;
    const double t11 = 39.47841760435743 - t10;
    const double t12 = 2.0 / t11;
    const double t30 = 8.470227328650247e-38 * t10;
    const double t31 = (-1.3375664093215244e-35) - t30;
    const double t32 = t31 * t10;
    const double t33 = 2.1122063323183885e-33 - t32;
    const double t34 = t33 * t10;
    const double t35 = (-3.3354842988221443e-31) - t34;
    const double t36 = t35 * t10;
    const double t37 = 5.267262996834231e-29 - t36;
    const double t38 = t37 * t10;
    const double t39 = (-8.318003195189264e-27) - t38;
    const double t40 = t39 * t10;
    const double t41 = 1.3136241807166534e-24 - t40;
    const double t42 = t41 * t10;
    const double t43 = (-2.0747401878593604e-22) - t42;
    const double t44 = t43 * t10;
    const double t45 = 3.277539174701792e-20 - t44;
    const double t46 = t45 * t10;
    const double t47 = (-5.180118196169724e-18) - t46;
    const double t48 = t47 * t10;
    const double t49 = 8.196052055691008e-16 - t48;
    const double t50 = t49 * t10;
    const double t51 = (-1.3000482138698975e-13) - t50;
    const double t52 = t51 * t10;
    const double t53 = 2.0742872904166045e-11 - t52;
    const double t54 = t53 * t10;
    const double t55 = (-3.357141926657451e-09) - t54;
    const double t56 = t55 * t10;
    const double t57 = 5.637370282876845e-07 - t56;
    const double t58 = t57 * t10;
    const double t59 = (-0.000105641107053347) - t58;
    const double t60 = t59 * t10;
    const double t61 = 0.03267274151216445 - t60;
    const double t62 = t12 + t61;
    const double t63 = t7 != 0.0 ? 12.0 : t5;
    const double t64 = sqrt(t63);
    const double t65 = t64 / 2.0;
    const double t66 = cos(t65);
    const double t67 = sin(t65);
    const double t68 = t65 * t66;
    const double t69 = t68 / t67;
    const double t70 = 1.0 - t69;
    const double t71 = t70 / t63;
    const double t72 = t7 != 0.0 ? t62 : t71;
    const double t73 = t0 * t1;
    const double t74 = t72 * t73;
    const double t76 = 0.5 * t2;
    const double t77 = t74 + t76;
    const double t78 = t10 * t62;
    const double t79 = 1.0 - t78;
    const double t80 = t7 != 0.0 ? t79 : t69;
    const double t81 = 0.5 * t0;
    const double t82 = -t81;
    const double t83 = t0 * t2;
    const double t84 = t72 * t83;
    const double t85 = 0.5 * t1;
    const double t86 = t84 - t85;
    J_inv[0] = 1.0;
    J_inv[1] = 0.0;
    J_inv[2] = 0.0;
    J_inv[3] = t77;
    J_inv[4] = t80;
    J_inv[5] = t82;
    J_inv[6] = t86;
    J_inv[7] = t81;
    J_inv[8] = t80;
}

void se2_defect(const double X[9], double defect[1])
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
    const double t28 = t1 + t3;
    const double t29 = fabs(t28);
    const double t31 = (double)(t9 < t10);
    const double t32 = t31 != 0.0 ? t10 : t9;
    const double t33 = (double)(t32 < t14);
    const double t34 = t33 != 0.0 ? t14 : t32;
    const double t35 = (double)(t34 < t16);
    const double t36 = t35 != 0.0 ? t16 : t34;
    const double t37 = (double)(1.0 < t36);
    const double t38 = t37 != 0.0 ? t36 : 1.0;
    const double t39 = t29 / t38;
    const double t40 = t0 - 1.0;
    const double t41 = t4 - 1.0;
    const double t42 = t40 - t41;
    const double t43 = fabs(t42);
    const double t44 = t43 / t38;
    const double t45 = (double)(t39 < t44);
    const double t46 = t45 != 0.0 ? t44 : t39;
    const double t47 = (double)(t46 < t20);
    const double t48 = t47 != 0.0 ? t20 : t46;
    const double t49 = (double)(t48 < t22);
    const double t50 = t49 != 0.0 ? t22 : t48;
    const double t51 = t8 - 1.0;
    const double t52 = fabs(t51);
    const double t53 = (double)(t50 < t52);
    const double t54 = t53 != 0.0 ? t52 : t50;
    const double t55 = t0 * t4;
    const double t56 = t1 * t3;
    const double t57 = t55 - t56;
    const double t59 = t57 + (-1.0);
    const double t60 = fabs(t59);
    const double t61 = t38 * t38;
    const double t62 = t60 / t61;
    const double t63 = (double)(t54 < t62);
    const double t64 = t63 != 0.0 ? t62 : t54;
    const double t66 = t27 != 0.0 ? t64 : (double)NAN;
    defect[0] = t66;
}

void se2_renormalise(const double X[9], double Y[9])
{
    const double t0 = X[0];
    const double t1 = X[1];
    const double t2 = X[2];
    const double t3 = X[3];
    const double t4 = X[4];
    const double t5 = X[5];
    const double t8 = t0 + (-1.0);
    const double t9 = (-0.4999999999999999) * t8;
    const double t11 = t4 + (-1.0);
    const double t12 = 0.5 * t11;
    const double t13 = t9 + t12;
    const double t14 = t0 + t13;
    const double t16 = 0.5 * t8;
    const double t18 = (-0.5000000000000001) * t11;
    const double t19 = t16 + t18;
    const double t20 = t4 + t19;
    const double t21 = t14 * t20;
    const double t22 = (-0.4999999999999999) * t1;
    const double t23 = (-0.4999999999999999) * t3;
    const double t24 = t22 + t23;
    const double t25 = t1 + t24;
    const double t26 = t3 + t24;
    const double t27 = t25 * t26;
    const double t28 = t21 - t27;
    const double t29 = log(t28);
    const double t30 = (-0.5) * t29;
    const double t31 = exp(t30);
    const double t32 = t14 * t31;
    const double t33 = t25 * t31;
    const double t34 = t26 * t31;
    const double t35 = t20 * t31;
    Y[0] = t32;
    Y[1] = t33;
    Y[2] = t2;
    Y[3] = t34;
    Y[4] = t35;
    Y[5] = t5;
    Y[6] = 0.0;
    Y[7] = 0.0;
    Y[8] = 1.0;
}
