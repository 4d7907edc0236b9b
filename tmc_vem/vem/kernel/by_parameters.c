/* ---- Derivatives with respect to parameters ----
 * At a point both the displacement and the adjoint field have gradients; the residual along the adjoint field is the rate
 * of the energy along it, and no residual is put together.
 */

typedef struct {
  vec x[N_X], y[N_X];
} pair; /* of the displacement and of the adjoint field */

enum { PAIR = sizeof(pair) / sizeof(vec) };

/* Polynomials V_mri of the second gradient of the field in ``work``. */
static void second_gradient(const workspace *work, const tmc_batch *batch, vec *S_mxi, vec *V_mri) {
  const derivatives second = {.width = N_F, .n_m = batch->n_lower, .from_m = N_F, .to_m = N_G, .to_x = N_F};
  to_polynomials(2, 2, batch->n_second, batch->n_basis, work->second, work->u_ai, S_mxi);
  differentiate(second, batch, work->scale, S_mxi, V_mri);
}

/* Gradients at the points q0 to q1, ``PAIR`` vectors apart. */
static void at_points(const workspace *work, const tmc_batch *batch, int q0, int q1, const vec *P_mxi, const vec *V_mri,
                      vec *x) {
  const int n_q = batch->n_points;
  product(0, 0, q1 - q0, N_F, batch->n_first, first_values(work, batch, q0), first_stride(batch), P_mxi, N_F, x, PAIR);
  if (N_ROWS > N_FIRST_ROWS)
    product(0, 0, q1 - q0, N_G, batch->n_lower, work->m_mq + q0, n_q, V_mri, N_G, x + N_F, PAIR);
}

int64_t tmc_cells_by_parameters(const tmc_batch *batch, const double *u_ni, const double *adjoint_ni,
                                const double *parameters, double *energy_ck, double *residual_ck) {
  workspace work;
  if (!allocate(&work, batch, 0)) return -2;
  const int n = batch->n_basis, n_q = batch->n_points, n_1 = batch->n_first;
  const int n_2 = batch->n_second, n_lower = N_ROWS > N_FIRST_ROWS ? batch->n_lower : 0;
  vec *P_mxi = work.polynomials, *T_mxi = P_mxi + N_F * n_1, *S_mxi = T_mxi + N_F * n_1;
  vec *V_mri = S_mxi + N_F * n_2, *W_mri = V_mri + N_G * n_lower;
  pair pairs[STATES];
  memset(pairs, 0, sizeof pairs);
  double e[AT_LEAST_1][LANES], r[AT_LEAST_1][LANES], sum_e[AT_LEAST_1][LANES], sum_r[AT_LEAST_1][LANES], read[N_READ];
  memset(e, 0, sizeof e); /* entries that vanish identically are never written */
  memset(r, 0, sizeof r);

  for (int64_t c0 = 0; c0 < batch->n_cells; c0 += LANES) {
    const double *values = parameters_read(c0, batch->n_cells, parameters, batch->factor_ck, read);
    take_shapes(&work, batch, c0);
    workspace along = work; /* the same cells with the adjoint field */
    along.u_ai = work.u_ai + 2 * n;
    along.coefficient_bi = work.coefficient_bi + 2 * (batch->n_boundary + batch->n_inside);
    gather_nodes(batch, c0, u_ni, 2, work.u_ai);
    if (adjoint_ni) gather_nodes(batch, c0, adjoint_ni, 2, along.u_ai);
    piecewise_coefficients(2, &work, batch);
    if (adjoint_ni) piecewise_coefficients(2, &along, batch);
    memset(sum_e, 0, sizeof sum_e);
    memset(sum_r, 0, sizeof sum_r);
    if (n_lower) second_gradient(&work, batch, S_mxi, V_mri);
    if (n_lower && adjoint_ni) second_gradient(&along, batch, S_mxi, W_mri);
    for (int q = 0, end; q < n_q; q = end) {
      end = piece_end(batch, q);
      first_gradient(2, &work, batch, batch->piece_q[q], P_mxi);
      if (adjoint_ni) first_gradient(2, &along, batch, batch->piece_q[q], T_mxi);
      for (int q0 = q, q1; q0 < end; q0 = q1) {
        q1 = states_end(end, q0);
        at_points(&work, batch, q0, q1, P_mxi, V_mri, pairs->x);
        if (adjoint_ni) at_points(&work, batch, q0, q1, T_mxi, W_mri, pairs->y);
        for (int p = 0; p < q1 - q0; ++p) {
          point_by_parameters((const_lanes)pairs[p].x, (const_lanes)pairs[p].y, values, e, r);
          const double *w = (const double *)(work.weights + q0 + p);
          for (int k = 0; k < N_P; ++k)
            for (int v = 0; v < LANES; ++v) {
              sum_e[k][v] += w[v] * e[k][v];
              sum_r[k][v] += w[v] * r[k][v];
            }
        }
      }
    }
    for (int v = 0; v < LANES && c0 + v < batch->n_cells; ++v)
      for (int k = 0; k < N_P; ++k) {
        energy_ck[(c0 + v) * N_P + k] = sum_e[k][v];
        residual_ck[(c0 + v) * N_P + k] = sum_r[k][v];
      }
  }
  free(work.allocated);
  return -1;
}
