/* ---- Second gradients of one polynomial on the cell, beside first gradients in pieces ----
 * The rows of the first gradient, f, are others at every point. Those of the second one are g = sum_j m_j V_j everywhere,
 * with the few monomials m_j of its degree. So what is multiplied with g is summed over the points before it meets the
 * basis: with the blocks i, k of components,
 *   Z_ik = sum_q w m_j D_gf f,   M_ik = sum_q w m_j m_l D_gg,   K_ik += V' Z_ik + (V' Z_ki)' + V' M_ik V,
 * where the first two are moments of the Hessian. This is a third less work than rows of g at every point, and the same
 * numbers; it pays while g is linear.
 */

enum {
  SMOOTH_MONOMIALS = 3,                                     /* at most: 1, xi and eta */
  SMOOTH_ROWS = (N_ROWS - N_FIRST_ROWS) * SMOOTH_MONOMIALS, /* V, [r][j] */
  SMOOTH_PAIRS = SMOOTH_MONOMIALS * (SMOOTH_MONOMIALS + 1) / 2,
  SMOOTH_ENTRIES = N_G * (N_G + 1) / 2, /* of the symmetric D_gg */
  SMOOTH_POINTS = 6                    /* that are summed at once */
};

_Static_assert(N_ROWS == N_FIRST_ROWS || SMOOTH_POINTS * N_FIRST_ROWS <= POINTS_AT_ONCE * N_ROWS,
               "their products w D B have the room of those of all rows");

/* Whether a batch takes this way; rows of the basis at points are then those of the first gradient alone. */
static inline int is_smooth_apart(const tmc_batch *batch) {
  return N_ROWS > N_FIRST_ROWS && is_piecewise(batch) && batch->n_lower == SMOOTH_MONOMIALS;
}

/* What is summed over the points of LANES cells. Sizes are one more than is used, as there are energies without second
 * gradients, and C has no empty arrays. */
typedef struct {
  vec left_kmr[4][SMOOTH_POINTS * N_FIRST_ROWS][SMOOTH_ROWS + 1]; /* w m_j D_gf at some points, blocks xx, xy, yx, yy */
  vec entries_qe[SMOOTH_POINTS][SMOOTH_ENTRIES + 1], pairs_qp[SMOOTH_POINTS][SMOOTH_PAIRS];
  vec moments_ep[SMOOTH_ENTRIES + 1][SMOOTH_PAIRS];
  vec gradient_ri[SMOOTH_ROWS + 1][N_COMPONENTS], forces_ri[SMOOTH_ROWS + 1][N_COMPONENTS]; /* V u, and on V u */
  vec average_sr[SMOOTH_ROWS + 1][SMOOTH_ROWS + 1];
} smooth_sums;

/* Begin with the displacement's own polynomials. */
static void smooth_begin(const workspace *work, int n, smooth_sums *sums) {
  memset(sums->moments_ep, 0, sizeof sums->moments_ep);
  memset(sums->forces_ri, 0, sizeof sums->forces_ri);
  memset(work->Z_krb, 0, 4 * SMOOTH_ROWS * (size_t)n * sizeof(vec));
  for (int r = 0; r < SMOOTH_ROWS; ++r) {
    vec x = {0.0}, y = {0.0};
    for (int a = 0; a < n; ++a) {
      x += work->derivative_xma[r * n + a] * work->u_ai[2 * a];
      y += work->derivative_xma[r * n + a] * work->u_ai[2 * a + 1];
    }
    sums->gradient_ri[r][0] = x;
    sums->gradient_ri[r][1] = y;
  }
}

/* The second gradient at a point. */
static void smooth_gradient(const smooth_sums *sums, const vec *m_j, int stride, vec *x_ri) {
  for (int r = 0; r < N_ROWS - N_FIRST_ROWS; ++r)
    for (int i = 0; i < N_COMPONENTS; ++i) {
      vec sum = {0.0};
      for (int j = 0; j < SMOOTH_MONOMIALS; ++j) sum += m_j[j * stride] * sums->gradient_ri[SMOOTH_MONOMIALS * r + j][i];
      x_ri[N_F + N_COMPONENTS * r + i] = sum;
    }
}

static void smooth_forces(smooth_sums *sums, const vec *w, const vec *m_j, int stride, const vec *g_ri) {
  for (int j = 0; j < SMOOTH_MONOMIALS; ++j) {
    const vec weight = *w * m_j[j * stride];
    for (int r = 0; r < N_ROWS - N_FIRST_ROWS; ++r)
      for (int i = 0; i < N_COMPONENTS; ++i)
        sums->forces_ri[SMOOTH_MONOMIALS * r + j][i] += weight * g_ri[N_F + N_COMPONENTS * r + i];
  }
}

/* The Hessian at point p of those that are summed next. */
static void smooth_hessian(smooth_sums *sums, int p, const vec *w, const vec *m_j, int stride, const vec *h) {
  for (int k = 0; k < 4; ++k)
    for (int r = 0; r < N_FIRST_ROWS; ++r)
      for (int s = 0; s < N_ROWS - N_FIRST_ROWS; ++s) {
        const vec entry = *w * h[hessian_index(N_F + 2 * s + k / 2, 2 * r + k % 2)];
        for (int j = 0; j < SMOOTH_MONOMIALS; ++j)
          sums->left_kmr[k][N_FIRST_ROWS * p + r][SMOOTH_MONOMIALS * s + j] = entry * m_j[j * stride];
      }
  for (int e = 0, a = 0; a < N_G; ++a)
    for (int b = a; b < N_G; ++b, ++e) sums->entries_qe[p][e] = *w * h[packed(N_F + a, N_F + b)];
  for (int c = 0, j = 0; j < SMOOTH_MONOMIALS; ++j)
    for (int l = j; l < SMOOTH_MONOMIALS; ++l, ++c) sums->pairs_qp[p][c] = m_j[j * stride] * m_j[l * stride];
}

/* Sum over n_p points whose rows of the first gradient are f_mb. */
static void smooth_sum(const workspace *work, int n, int n_p, const vec *f_mb, smooth_sums *sums) {
  for (int k = 0; k < 4; ++k)
    product(0, 1, SMOOTH_ROWS, n, N_FIRST_ROWS * n_p, *sums->left_kmr[k], SMOOTH_ROWS + 1, f_mb, n,
            work->Z_krb + (size_t)k * SMOOTH_ROWS * n, n);
  product(0, 1, SMOOTH_ENTRIES, SMOOTH_PAIRS, n_p, *sums->entries_qe, SMOOTH_ENTRIES + 1, *sums->pairs_qp, SMOOTH_PAIRS,
          *sums->moments_ep, SMOOTH_PAIRS);
}

/* M_ik times ``factor`` for the block of components i and k. */
static void smooth_average(smooth_sums *sums, int i, int k, double factor) {
  for (int s = 0; s < N_ROWS - N_FIRST_ROWS; ++s)
    for (int r = 0; r < N_ROWS - N_FIRST_ROWS; ++r) {
      const int a = 2 * r + i, b = 2 * s + k, low = a < b ? a : b, high = a < b ? b : a;
      const vec *moments_p = sums->moments_ep[low * N_G - low * (low - 1) / 2 + high - low];
      for (int c = 0, j = 0; j < SMOOTH_MONOMIALS; ++j)
        for (int l = j; l < SMOOTH_MONOMIALS; ++l, ++c)
          sums->average_sr[SMOOTH_MONOMIALS * s + l][SMOOTH_MONOMIALS * r + j] =
              sums->average_sr[SMOOTH_MONOMIALS * s + j][SMOOTH_MONOMIALS * r + l] = factor * moments_p[c];
    }
}

/* The sums meet the basis: K_kab += V' (Z + M V) and transposed, half of symmetric blocks; forces become those on nodes. */
static void smooth_end(const workspace *work, int n, int with_residual, smooth_sums *sums) {
  const vec *V_ra = work->derivative_xma;
  vec *Z_krb = work->Z_krb;
  static const int blocks[3] = {0, 1, 3};
  for (int k = 0; k < 3; ++k) {
    const int block = blocks[k]; /* of symmetric ones a half is enough, as they are added twice */
    smooth_average(sums, block / 2, block % 2, k == 1 ? 1.0 : 0.5);
    product(0, 1, SMOOTH_ROWS, n, SMOOTH_ROWS, *sums->average_sr, SMOOTH_ROWS + 1, V_ra, n,
            Z_krb + (size_t)block * SMOOTH_ROWS * n, n);
  }
  for (int k = 0; k < 3; ++k) {
    vec *K_ab = work->K_kab + (size_t)k * n * n;
    const vec *Z_rb = Z_krb + (size_t)blocks[k] * SMOOTH_ROWS * n, *Zt_rb = k == 1 ? Z_krb + 2 * SMOOTH_ROWS * (size_t)n : Z_rb;
    product(k != 1, 1, n, n, SMOOTH_ROWS, V_ra, n, Z_rb, n, K_ab, n);
    product(k != 1, 1, n, n, SMOOTH_ROWS, Zt_rb, n, V_ra, n, K_ab, n);
  }
  for (int a = 0; with_residual && a < n; ++a)
    for (int r = 0; r < SMOOTH_ROWS; ++r)
      for (int i = 0; i < N_COMPONENTS; ++i) work->R_ai[2 * a + i] += V_ra[r * n + a] * sums->forces_ri[r][i];
}
