/* ---- J at points: the smallest, and the largest step with J > 0 ---- */

/* Smallest J so far; a NaN is taken over and stays. */
static void lower(vec *min_j, const vec *x) {
  const_lanes H = (const_lanes)x;
  for (int v = 0; v < LANES; ++v) {
    const double before = ((double *)min_j)[v], here = jacobian(H[0][v], H[1][v], H[2][v], H[3][v]);
    ((double *)min_j)[v] = !(here >= before) && before == before ? here : before;
  }
}

/* Smallest positive root of c0 + c1 s + c2 s^2, or infinity, for c0 > 0, else 0; stable for c2 -> 0 and without
 * branches. */
static inline double smallest_positive_root(double c0, double c1, double c2) {
  const double discriminant = c1 * c1 - 4.0 * c0 * c2;
  const double root = sqrt(discriminant), q = -0.5 * (c1 - root), p = -0.5 * (c1 + root);
  /* q, the larger root of q^2 + c1 q + c0 c2, has no cancellation for c1 <= 0: the roots are c0 / q and q / c2. Else p
   * has none and is negative: the positive root is p / c2, if c2 is negative. */
  const double above = c1 <= 0.0 ? c0 : -p, below = c1 <= 0.0 ? q : -c2;
  const double s = above / below;
  const double first = below > 0.0 ? s : INFINITY, real = discriminant >= 0.0 ? first : INFINITY;
  return c0 > 0.0 ? real : 0.0;
}

/* Steps become those to J = 0 where they are larger; gradients are [x][i], i of u and of du. */
static void limit(vec *steps, const vec *gradients) {
  const_lanes H = (const_lanes)gradients;
  double *step = (double *)steps;
  LANES_ARE_INDEPENDENT
  for (int v = 0; v < LANES; ++v) {
    const double H11 = H[0][v], H21 = H[1][v], H12 = H[4][v], H22 = H[5][v];
    const double d11 = H[2][v], d21 = H[3][v], d12 = H[6][v], d22 = H[7][v];
    const double c1 = (1.0 + H22) * d11 - H12 * d21 - H21 * d12 + (1.0 + H11) * d22;
    const double s = smallest_positive_root(jacobian(H11, H21, H12, H22), c1, d11 * d22 - d21 * d12);
    step[v] = s < step[v] ? s : step[v];
  }
}
