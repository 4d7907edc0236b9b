/* ---- Arithmetic at a point --------------------------------------------------------------------------------------
 * Everything here is branch-free once inlined, so the loops over points that use it vectorise.
 */

/* No energy needs all of them, and clang warns about the others. */
#define UNUSED_IN_SOME __attribute__((unused))

/* a b - c d with a relative error of about one rounding: Kahan's method, analysed by Jeannerod, Louvet & Muller,
 * Math. Comp. 82 (2013) 2245-2264. */
UNUSED_IN_SOME static inline double difference_of_products(double a, double b, double c, double d) {
  const double cd = c * d;
#ifdef __FMA__
  const double rounding = __builtin_fma(-c, d, cd);
  return __builtin_fma(a, b, -cd) + rounding;
#else /* no fused multiply-add: split the factors (Dekker 1971) and keep the errors of both products */
  const double split = 134217729.0; /* 2^27 + 1 */
  const double a1 = split * a - (split * a - a), b1 = split * b - (split * b - b);
  const double c1 = split * c - (split * c - c), d1 = split * d - (split * d - d);
  const double ab = a * b;
  const double error_ab = ((a1 * b1 - ab) + a1 * (b - b1) + (a - a1) * b1) + (a - a1) * (b - b1);
  const double error_cd = ((c1 * d1 - cd) + c1 * (d - d1) + (c - c1) * d1) + (c - c1) * (d - d1);
  return (ab - cd) + (error_ab - error_cd);
#endif
}

/* What rounding took away from sum = 1 + h (Knuth's two-sum). */
UNUSED_IN_SOME static inline double lost_from_one_plus(double h, double sum) {
  const double h_seen = sum - 1.0;
  return (1.0 - (sum - h_seen)) + (h - h_seen);
}

/* J = det(I + H) with a relative error of a few roundings also where J is tiny and its products are not. */
UNUSED_IN_SOME static inline double jacobian(double H11, double H21, double H12, double H22) {
  const double F11 = 1.0 + H11, F22 = 1.0 + H22;
  const double lost = lost_from_one_plus(H11, F11) * F22 + lost_from_one_plus(H22, F22) * F11;
  return difference_of_products(F11, F22, H12, H21) + lost;
}

/* J - 1, accurate near F = I, and equal to what J says far from it. */
UNUSED_IN_SOME static inline double jacobian_minus_1(double H11, double H21, double H12, double H22, double J) {
  const double near = (H11 + H22) + (H11 * H22 - H12 * H21);
  return fabs(near) < 0.5 ? near : J - 1.0;
}

/* log(1 + d) - d without cancellation, given log_1d = log(1 + d). */
UNUSED_IN_SOME static inline double log_remainder(double d, double log_1d) {
  const double even = /* of 1/2 - d/3 + d^2/4 - ...: what is left out is below 1e-15 of it for |d| < 1/16 */
      1.0 / 2 + d * d * (1.0 / 4 + d * d * (1.0 / 6 + d * d * (1.0 / 8 + d * d * (1.0 / 10 + d * d * (1.0 / 12)))));
  const double odd =
      1.0 / 3 + d * d * (1.0 / 5 + d * d * (1.0 / 7 + d * d * (1.0 / 9 + d * d * (1.0 / 11 + d * d * (1.0 / 13)))));
  return fabs(d) < 0.0625 ? d * d * (d * odd - even) : log_1d - d;
}

/* log(1 + d), given its remainder and a value that is good away from d = 0. */
UNUSED_IN_SOME static inline double log_from_remainder(double d, double remainder, double log_1d) {
  return fabs(d) < 0.0625 ? d + remainder : log_1d;
}

/* exp(d) - 1 - d without cancellation, given exp_d = exp(d). */
UNUSED_IN_SOME static inline double exp_remainder(double d, double exp_d) {
  const double even = /* of 1/2 + d/6 + d^2/24 + ...: what is left out is below 1e-15 of it for |d| < 1/8 */
      1.0 / 2 + d * d * (1.0 / 24 + d * d * (1.0 / 720 + d * d * (1.0 / 40320 + d * d * (1.0 / 3628800))));
  const double odd = 1.0 / 6 + d * d * (1.0 / 120 + d * d * (1.0 / 5040 + d * d * (1.0 / 362880)));
  return fabs(d) < 0.125 ? d * d * (even + d * odd) : (exp_d - 1.0) - d;
}
