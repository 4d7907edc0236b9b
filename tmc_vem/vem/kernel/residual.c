/* ---- Energy and residual ----
 * Below the tangent there are no rows of the basis: the displacement gradient is made as polynomials, and the residual
 * goes the same way back, transposed. T_mxi and W_mri are forces on P and V.
 */

enum { STEP = sizeof(state) / sizeof(vec) }; /* how far apart states are */

static void add_to_nodes(const tmc_batch *batch, int64_t first_cell, const vec *R_ai, double *residual_ni) {
  for (int v = 0; v < LANES && first_cell + v < batch->n_cells; ++v) {
    const int32_t *nodes_a = batch->nodes_ca + (first_cell + v) * batch->n_basis;
    for (int a = 0; a < batch->n_basis; ++a)
      for (int i = 0; i < 2; ++i) residual_ni[2 * (int64_t)nodes_a[a] + i] += ((const_lanes)R_ai)[2 * a + i][v];
  }
}

/* Energies and smallest J of the cells; the first cell with J <= 0 becomes ``inadmissible`` if there was none. */
static void store_energies(const tmc_batch *batch, int64_t first_cell, const vec *energy, const vec *min_j,
                           double *energy_c, double *min_j_c, int64_t *inadmissible) {
  for (int v = 0; v < LANES && first_cell + v < batch->n_cells; ++v) {
    const int64_t c = first_cell + v;
    energy_c[c] = ((const double *)energy)[v];
    min_j_c[c] = ((const double *)min_j)[v];
    if (*inadmissible < 0 && !(min_j_c[c] > 0.0)) *inadmissible = c;
  }
}

/* The transposed way for ``rows`` basis functions: R_ai += sum_mx C_xma T_mxi. */
ALWAYS_INLINE void node_rows(const int rows, const int n_x, int n_m, int n_basis, const vec *C_xma, const vec *T_mxi,
                             vec *R_ai) {
  vec sum[4][2];
#pragma GCC unroll 4
  for (int a = 0; a < rows; ++a)
#pragma GCC unroll 2
    for (int i = 0; i < 2; ++i) sum[a][i] = R_ai[2 * a + i];
  for (int m = 0; m < n_m; ++m)
#pragma GCC unroll 2
    for (int x = 0; x < n_x; ++x) {
      vec T0 = T_mxi[2 * (n_x * m + x)], T1 = T_mxi[2 * (n_x * m + x) + 1];
      LOADED(T0);
      LOADED(T1);
#pragma GCC unroll 4
      for (int a = 0; a < rows; ++a) {
        vec C = C_xma[(x * n_m + m) * n_basis + a];
        LOADED(C);
        sum[a][0] += C * T0;
        sum[a][1] += C * T1;
      }
    }
#pragma GCC unroll 4
  for (int a = 0; a < rows; ++a)
#pragma GCC unroll 2
    for (int i = 0; i < 2; ++i) R_ai[2 * a + i] = sum[a][i];
}

/* Forces T on the coefficients are added to the residual. */
ALWAYS_INLINE void to_nodes(const int n_x, int n_m, int n_basis, const vec *C_xma, const vec *T_mxi, vec *R_ai) {
  for (int a = 0, end; a < n_basis; a = end) {
    end = tile_end(n_basis, a);
    if (end - a == 4)
      node_rows(4, n_x, n_m, n_basis, C_xma + a, T_mxi, R_ai + 2 * a);
    else if (end - a == 3)
      node_rows(3, n_x, n_m, n_basis, C_xma + a, T_mxi, R_ai + 2 * a);
    else
      for (; a < end; ++a) node_rows(1, n_x, n_m, n_basis, C_xma + a, T_mxi, R_ai + 2 * a);
  }
}

/* Derivatives the transposed way: forces on them are added to those on the polynomials. */
ALWAYS_INLINE void add_differentiated(const derivatives of, const tmc_batch *batch, const vec *inverse_h, const vec *to,
                                      vec *from) {
  for (int m = 0; m < of.n_m; ++m)
#pragma GCC unroll 2
    for (int x = 0; x < 2; ++x) {
      const vec factor = *inverse_h * batch->power_mx[2 * m + x];
      vec *f = from + batch->raised_mx[2 * m + x] * of.from_m;
      const vec *t = to + m * of.to_m + x * of.to_x;
      for (int k = 0; k < of.width; ++k) f[k] += factor * t[k];
    }
}

/* The transposed way: forces T on these polynomials are added to the residual, or to those on coefficients. */
static void first_forces(const workspace *work, const tmc_batch *batch, int piece, const vec *T_mxi) {
  const int n_1 = batch->n_first, n = batch->n_basis;
  if (!is_piecewise(batch)) {
    to_nodes(2, n_1, n, work->gradient + (size_t)piece * 2 * n_1 * n, T_mxi, work->R_ai);
    return;
  }
  const vec *slope_px = work->slope_tpx + 4 * piece;
  const int32_t *raised_p = batch->raised_tmp + (size_t)piece * n_1 * 3;
  for (int m = 0; m < n_1; ++m, raised_p += 3)
    for (int i = 0; i < 2; ++i) {
      const vec T0 = T_mxi[4 * m + i], T1 = T_mxi[4 * m + 2 + i];
      const vec s = slope_px[0] * T0 + slope_px[1] * T1, t = slope_px[2] * T0 + slope_px[3] * T1;
      work->force_bi[2 * raised_p[1] + i] += s;
      work->force_bi[2 * raised_p[2] + i] += t;
      work->force_bi[2 * raised_p[0] + i] -= s + t;
    }
}

/* Forces on the coefficients of piecewise polynomials are added to the residual; nothing is done where there are none. */
static void piecewise_forces(const workspace *work, const tmc_batch *batch) {
  if (!is_piecewise(batch)) return;
  const int n_j = batch->n_trace;
  for (int b = 0; b < batch->n_boundary; ++b)
    for (int j = b * n_j; j < (b + 1) * n_j; ++j)
      for (int i = 0; i < 2; ++i) work->R_ai[2 * batch->trace_bj[j] + i] += batch->trace_value_bj[j] * work->force_bi[2 * b + i];
  to_nodes(1, batch->n_inside, batch->n_basis, work->gradient, work->force_bi + 2 * batch->n_boundary, work->R_ai);
}

static void weight_polynomials(workspace *work, const tmc_batch *batch) {
  const int n_1 = batch->n_first, n_lower = N_ROWS > N_FIRST_ROWS ? batch->n_lower : 0, n_q = batch->n_points;
  for (int q = 0; q < n_q; ++q) {
    const vec *f_m = first_values(work, batch, q);
    for (int m = 0; m < n_1; ++m) work->wf_qm[q * n_1 + m] = work->weights[q] * f_m[m * first_stride(batch)];
    for (int m = 0; m < n_lower; ++m) work->wm_qm[q * n_lower + m] = work->weights[q] * work->m_mq[m * n_q + q];
  }
}

static int64_t cells_below_tangent(const tmc_batch *batch, const double *u_ni, const double *parameters,
                                   double *energy_c, double *min_j_c, double *residual_ni) {
  workspace work;
  if (!allocate(&work, batch, 0)) return -2;
  const int n = batch->n_basis, n_q = batch->n_points, n_1 = batch->n_first, f_stride = first_stride(batch);
  const int n_2 = batch->n_second, n_lower = N_ROWS > N_FIRST_ROWS ? batch->n_lower : 0;
  /* d1 of both directions of S, then d2 */
  const derivatives second = {.width = N_F, .n_m = n_lower, .from_m = N_F, .to_m = N_G, .to_x = N_F};
  /* the second gradient is often that of the first gradient's own polynomials */
  const int own = N_ROWS > N_FIRST_ROWS && batch->n_pieces == 1 && batch->second_spxma == batch->gradient_sptxma;
  vec *P_mxi = work.polynomials, *T_mxi = P_mxi + N_F * n_1, *S_mxi = T_mxi + N_F * n_1;
  vec *V_mri = S_mxi + N_F * n_2, *W_mri = V_mri + N_G * n_lower;
  state states[STATES];
  memset(states, 0, sizeof states); /* entries that vanish identically are never written */
  int64_t inadmissible = -1;
  double read[N_READ];

  for (int64_t c0 = 0; c0 < batch->n_cells; c0 += LANES) {
    const double *values = parameters_read(c0, batch->n_cells, parameters, batch->factor_ck, read);
    if (take_shapes(&work, batch, c0) && residual_ni) weight_polynomials(&work, batch);
    gather_nodes(batch, c0, u_ni, 2, work.u_ai);
    piecewise_coefficients(2, &work, batch);
    vec energy = {0.0}, min_j = (vec){0.0} + INFINITY;
    const const_lanes friction = friction_of(batch, c0);
    if (residual_ni) {
      memset(work.R_ai, 0, 2 * (size_t)n * sizeof(vec));
      memset(W_mri, 0, N_G * (size_t)n_lower * sizeof(vec));
      if (is_piecewise(batch)) memset(work.force_bi, 0, 2 * (size_t)(batch->n_boundary + batch->n_inside) * sizeof(vec));
    }
    if (n_lower && !own) {
      to_polynomials(2, 2, n_2, n, work.second, work.u_ai, S_mxi);
      differentiate(second, batch, work.scale, S_mxi, V_mri);
    }
    for (int q = 0, end; q < n_q; q = end) {
      end = piece_end(batch, q);
      first_gradient(2, &work, batch, batch->piece_q[q], P_mxi);
      if (own) differentiate(second, batch, work.scale, P_mxi, V_mri);
      for (int q0 = q, q1; q0 < end; q0 = q1) {
        q1 = states_end(end, q0);
        product(0, 0, q1 - q0, N_F, n_1, first_values(&work, batch, q0), f_stride, P_mxi, N_F, states->x, STEP);
        if (N_ROWS > N_FIRST_ROWS) product(0, 0, q1 - q0, N_G, n_lower, work.m_mq + q0, n_q, V_mri, N_G, states->x + N_F, STEP);
        for (int p = 0; p < q1 - q0; ++p) {
          state *at = states + p;
          const vec w = work.weights[q0 + p];
          lower(&min_j, at->x);
          if (friction) clear_first((lanes)at->g, NULL);
          if (residual_ni)
            point_gradient((const_lanes)at->x, values, (double *)&at->psi, (lanes)at->g);
          else
            point_energy((const_lanes)at->x, values, (double *)&at->psi);
          if (friction && has_friction(friction + (q0 + p) * TMC_N_FRICTION))
            add_friction(friction + (q0 + p) * TMC_N_FRICTION, 0.0, (const_lanes)at->x, (double *)&at->psi,
                         residual_ni ? (lanes)at->g : NULL, NULL);
          energy += w * at->psi;
        }
        if (residual_ni) {
          product(0, q0 > q, n_1, N_F, q1 - q0, work.wf_qm + q0 * n_1, n_1, states->g, STEP, T_mxi, N_F);
          if (N_ROWS > N_FIRST_ROWS) product(0, 1, n_lower, N_G, q1 - q0, work.wm_qm + q0 * n_lower, n_lower, states->g + N_F, STEP, W_mri, N_G);
        }
      }
      if (residual_ni) {
        if (own) add_differentiated(second, batch, work.scale, W_mri, T_mxi);
        first_forces(&work, batch, batch->piece_q[q], T_mxi);
      }
    }
    if (residual_ni && n_lower && !own) {
      memset(S_mxi, 0, N_F * (size_t)n_2 * sizeof(vec));
      add_differentiated(second, batch, work.scale, W_mri, S_mxi);
      to_nodes(2, n_2, n, work.second, S_mxi, work.R_ai);
    }
    if (residual_ni) piecewise_forces(&work, batch);
    store_energies(batch, c0, &energy, &min_j, energy_c, min_j_c, &inadmissible);
    if (residual_ni) add_to_nodes(batch, c0, work.R_ai, residual_ni);
  }
  free(work.allocated);
  return inadmissible;
}
