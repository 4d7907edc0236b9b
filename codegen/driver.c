/* ---- Cell driver ------------------------------------------------------------------------------------------------
 * Both displacement components share one scalar basis, so all products run on the scalar rows B_ra and the tangent is
 * built from its component blocks xx, xy and yy. LANES quadrature points are evaluated at once.
 */

enum { N_X = 12, N_H = 78, N_ALL_ROWS = 6, MAX_TILE = 4 };

typedef struct {
  double x[N_X][LANES], psi[LANES], g[N_X][LANES], h[N_H][LANES];
} point_batch;

/* Position of (row, column), row <= column, in the packed upper triangle of the 12 x 12 Hessian. */
static inline int packed(int row, int column) { return row * N_X - row * (row - 1) / 2 + column - row; }

static inline int hessian_index(int a, int b) { return a <= b ? packed(a, b) : packed(b, a); }

static void evaluate_points(int level, point_batch *batch, const double *parameters) {
  if (level == TMC_ENERGY)
    point_energy((const double(*)[LANES])batch->x, parameters, batch->psi);
  else if (level == TMC_GRADIENT)
    point_gradient((const double(*)[LANES])batch->x, parameters, batch->psi, batch->g);
  else
    point_tangent((const double(*)[LANES])batch->x, parameters, batch->psi, batch->g, batch->h);
}

static void clear_derivatives(point_batch *batch) {
  memset(batch->g, 0, sizeof batch->g); /* entries that vanish identically are never written */
  memset(batch->h, 0, sizeof batch->h);
}

static inline void displacement_gradient(int n_rows, int n_basis, int stride, const double *B_ra, const double *u_ai,
                                         double *x) {
  for (int r = 0; r < n_rows; ++r) {
    double x0 = 0.0, x1 = 0.0;
    for (int a = 0; a < n_basis; ++a) {
      x0 += B_ra[r * stride + a] * u_ai[2 * a];
      x1 += B_ra[r * stride + a] * u_ai[2 * a + 1];
    }
    x[2 * r] = x0;
    x[2 * r + 1] = x1;
  }
}

/* K_ab = sum_m left_ma right_mb for one component block; stride is a constant where this is inlined. */
static inline __attribute__((always_inline)) void contract_block(const int stride, int n_basis, int n_m,
                                                                 const double *restrict left_ma,
                                                                 const double *restrict right_mb,
                                                                 double *restrict K_ab) {
  for (int a0 = 0; a0 < n_basis; a0 += MAX_TILE) { /* stride is a multiple of MAX_TILE: reading padding is safe */
    double acc[MAX_TILE][stride];
    for (int t = 0; t < MAX_TILE; ++t)
      for (int b = 0; b < stride; ++b) acc[t][b] = 0.0;
    for (int m = 0; m < n_m; ++m)
      for (int t = 0; t < MAX_TILE; ++t)
        for (int b = 0; b < stride; ++b) acc[t][b] += left_ma[m * stride + a0 + t] * right_mb[m * stride + b];
    for (int t = 0; t < MAX_TILE; ++t)
      for (int b = 0; b < stride; ++b) K_ab[(a0 + t) * stride + b] = acc[t][b];
  }
}

static void contract(int stride, int n_basis, int n_m, const double *left_ma, const double *right_mb, double *K_ab) {
  switch (stride) {
    case 8: contract_block(8, n_basis, n_m, left_ma, right_mb, K_ab); break;
    case 12: contract_block(12, n_basis, n_m, left_ma, right_mb, K_ab); break;
    case 16: contract_block(16, n_basis, n_m, left_ma, right_mb, K_ab); break;
    case 20: contract_block(20, n_basis, n_m, left_ma, right_mb, K_ab); break;
    case 24: contract_block(24, n_basis, n_m, left_ma, right_mb, K_ab); break;
    default: contract_block(stride, n_basis, n_m, left_ma, right_mb, K_ab);
  }
}

/* Scaled products w D B of one quadrature point for the blocks xx, xy, yy. */
static void material_rows(int stride, double w, const point_batch *batch, int lane, const double *B_ra,
                          double *D_xx, double *D_xy, double *D_yy) {
  for (int r = 0; r < N_ROWS; ++r) {
    double *xx = D_xx + r * stride, *xy = D_xy + r * stride, *yy = D_yy + r * stride;
    for (int b = 0; b < stride; ++b) xx[b] = xy[b] = yy[b] = 0.0;
    for (int s = 0; s < N_ROWS; ++s) {
      const double c_xx = w * batch->h[hessian_index(2 * r, 2 * s)][lane];
      const double c_xy = w * batch->h[hessian_index(2 * r, 2 * s + 1)][lane];
      const double c_yy = w * batch->h[hessian_index(2 * r + 1, 2 * s + 1)][lane];
      for (int b = 0; b < stride; ++b) {
        const double B = B_ra[s * stride + b];
        xx[b] += c_xx * B;
        xy[b] += c_xy * B;
        yy[b] += c_yy * B;
      }
    }
  }
}

typedef struct {
  double *B_ma, *D_xx, *D_xy, *D_yy; /* m = (q, r) over all points of a cell */
  double *K_xx, *K_xy, *K_yy;
} tangent_buffers;

static void store_tangent(int n_basis, int stride, const tangent_buffers *buffers, double *tangent_aibj) {
  const int n_row = 2 * n_basis;
  for (int a = 0; a < n_basis; ++a)
    for (int b = 0; b < n_basis; ++b) {
      double *block = tangent_aibj + (int64_t)2 * a * n_row + 2 * b;
      block[0] = buffers->K_xx[a * stride + b];
      block[1] = buffers->K_xy[a * stride + b];
      block[n_row] = buffers->K_xy[b * stride + a];
      block[n_row + 1] = buffers->K_yy[a * stride + b];
    }
}

int64_t tmc_cells(int level, int64_t n_cells, int n_basis, int stride, int n_points, const int32_t *shape_c,
                  const double *B_sqra, const double *w_sq, const double *u_cai, const double *parameters,
                  double *energy_c, double *min_j_c, double *residual_cai, double *tangent_caibj) {
  const int n_m = n_points * N_ROWS;
  double *work = NULL;
  tangent_buffers buffers = {NULL, NULL, NULL, NULL, NULL, NULL, NULL};
  if (level >= TMC_TANGENT) {
    const size_t rows = (size_t)n_m * stride, block = (size_t)stride * stride;
    work = malloc((4 * rows + 3 * block) * sizeof *work);
    if (!work) return -2;
    buffers = (tangent_buffers){work,          work + rows, work + 2 * rows,         work + 3 * rows,
                                work + 4 * rows, work + 4 * rows + block, work + 4 * rows + 2 * block};
  }
  point_batch batch;
  memset(&batch, 0, sizeof batch);
  clear_derivatives(&batch);
  int64_t inadmissible = -1;

  for (int64_t c = 0; c < n_cells; ++c) {
    const double *B_qra = B_sqra + (int64_t)shape_c[c] * n_points * N_ALL_ROWS * stride;
    const double *w_q = w_sq + (int64_t)shape_c[c] * n_points;
    const double *u_ai = u_cai + c * n_basis * 2;
    double *residual_ai = residual_cai ? residual_cai + c * n_basis * 2 : NULL;
    double energy = 0.0, min_j = INFINITY;
    if (level >= TMC_GRADIENT) memset(residual_ai, 0, (size_t)n_basis * 2 * sizeof *residual_ai);

    for (int q0 = 0; q0 < n_points; q0 += LANES) {
      const int n_lanes = n_points - q0 < LANES ? n_points - q0 : LANES;
      for (int v = 0; v < LANES; ++v) { /* lanes past the end repeat the last point */
        double x[N_X] = {0.0};
        const int q = v < n_lanes ? q0 + v : n_points - 1;
        displacement_gradient(N_ROWS, n_basis, stride, B_qra + (int64_t)q * N_ALL_ROWS * stride, u_ai, x);
        for (int k = 0; k < N_X; ++k) batch.x[k][v] = x[k];
        const double J = jacobian(x[0], x[1], x[2], x[3]);
        if (!(J >= min_j) && min_j == min_j) min_j = J; /* a NaN is taken over and stays */
      }
      evaluate_points(level, &batch, parameters);
      for (int v = 0; v < n_lanes; ++v) {
        const int q = q0 + v;
        const double *B_ra = B_qra + (int64_t)q * N_ALL_ROWS * stride;
        const double w = w_q[q];
        energy += w * batch.psi[v];
        if (level >= TMC_GRADIENT)
          for (int r = 0; r < N_ROWS; ++r) {
            const double g0 = w * batch.g[2 * r][v], g1 = w * batch.g[2 * r + 1][v];
            for (int a = 0; a < n_basis; ++a) {
              residual_ai[2 * a] += g0 * B_ra[r * stride + a];
              residual_ai[2 * a + 1] += g1 * B_ra[r * stride + a];
            }
          }
        if (level >= TMC_TANGENT) {
          const size_t m = (size_t)q * N_ROWS * stride;
          memcpy(buffers.B_ma + m, B_ra, (size_t)N_ROWS * stride * sizeof *B_ra);
          material_rows(stride, w, &batch, v, B_ra, buffers.D_xx + m, buffers.D_xy + m, buffers.D_yy + m);
        }
      }
    }
    if (level >= TMC_TANGENT) {
      contract(stride, n_basis, n_m, buffers.B_ma, buffers.D_xx, buffers.K_xx);
      contract(stride, n_basis, n_m, buffers.B_ma, buffers.D_xy, buffers.K_xy);
      contract(stride, n_basis, n_m, buffers.B_ma, buffers.D_yy, buffers.K_yy);
      store_tangent(n_basis, stride, &buffers, tangent_caibj + c * 4 * n_basis * n_basis);
    }
    energy_c[c] = energy;
    min_j_c[c] = min_j;
    if (inadmissible < 0 && !(min_j > 0.0)) inadmissible = c;
  }
  free(work);
  return inadmissible;
}

/* Smallest positive root of c0 + c1 s + c2 s^2 with c0 > 0, or infinity; stable for c2 -> 0. */
static double smallest_positive_root(double c0, double c1, double c2) {
  const double discriminant = c1 * c1 - 4.0 * c0 * c2;
  if (!(discriminant >= 0.0)) return INFINITY;
  const double q = -0.5 * (c1 - sqrt(discriminant)); /* the larger root of q^2 + c1 q + c0 c2 */
  const double p = -0.5 * (c1 + sqrt(discriminant));
  double root = INFINITY;
  if (c1 <= 0.0) { /* q has no cancellation: roots are c0 / q and q / c2 */
    if (q > 0.0) root = c0 / q;
  } else if (c2 < 0.0) { /* p has no cancellation and is negative: the positive root is p / c2 */
    root = p / c2;
  }
  return root;
}

void tmc_max_step(int64_t n_cells, int n_basis, int stride, int n_points, const int32_t *shape_c,
                  const double *B_sqra, const double *u_cai, const double *du_cai, double *step_c) {
  for (int64_t c = 0; c < n_cells; ++c) {
    const double *B_qra = B_sqra + (int64_t)shape_c[c] * n_points * N_ALL_ROWS * stride;
    double step = INFINITY;
    for (int q = 0; q < n_points; ++q) {
      const double *B_ra = B_qra + (int64_t)q * N_ALL_ROWS * stride;
      double H[4], dH[4];
      displacement_gradient(2, n_basis, stride, B_ra, u_cai + c * n_basis * 2, H);
      displacement_gradient(2, n_basis, stride, B_ra, du_cai + c * n_basis * 2, dH);
      const double c0 = jacobian(H[0], H[1], H[2], H[3]);
      const double c1 = (1.0 + H[3]) * dH[0] - H[2] * dH[1] - H[1] * dH[2] + (1.0 + H[0]) * dH[3];
      const double c2 = dH[0] * dH[3] - dH[1] * dH[2];
      const double s = c0 > 0.0 ? smallest_positive_root(c0, c1, c2) : 0.0;
      if (s < step) step = s;
    }
    step_c[c] = step;
  }
}

void tmc_points(int level, int64_t n_states, const double *x_nx, const double *parameters, double *psi_n,
                double *g_nx, double *h_nk) {
  point_batch batch;
  memset(&batch, 0, sizeof batch);
  clear_derivatives(&batch);
  for (int64_t n0 = 0; n0 < n_states; n0 += LANES) {
    const int n_lanes = n_states - n0 < LANES ? (int)(n_states - n0) : LANES;
    for (int v = 0; v < LANES; ++v) {
      const int64_t n = v < n_lanes ? n0 + v : n_states - 1;
      for (int k = 0; k < N_X; ++k) batch.x[k][v] = x_nx[n * N_X + k];
    }
    evaluate_points(level, &batch, parameters);
    for (int v = 0; v < n_lanes; ++v) {
      const int64_t n = n0 + v;
      psi_n[n] = batch.psi[v];
      if (level >= TMC_GRADIENT)
        for (int k = 0; k < N_X; ++k) g_nx[n * N_X + k] = batch.g[k][v];
      if (level >= TMC_TANGENT)
        for (int k = 0; k < N_H; ++k) h_nk[n * N_H + k] = batch.h[k][v];
    }
  }
}
