/* ---- What LANES cells are made of: coefficients, weights, monomials, degrees of freedom ---- */

enum { POINTS_AT_ONCE = 4 }; /* points whose products w D B are kept in the cache before they are contracted */

typedef struct {
  const vec *weights, *gradient, *second, *scale, *corners; /* in the shapes' packs, or gathered: */
  vec *w_q, *xi_qx, *stored_gradient, *second_xma, *inverse_h, *corners_dx;
  vec *m_mq;              /* monomials at the points */
  int32_t shape_v[LANES]; /* whose all of this is */
  int any;                /* whether it is anybody's yet */
  vec *u_ai, *R_ai;
  /* Piecewise polynomials, see polynomials.c. */
  vec *slope_tpx;      /* (k + 1) grad lambda_p of the second and third corner */
  vec *bernstein_mq;   /* the same in all lanes */
  vec *coefficient_bi; /* of the displacement */
  /* Below the tangent, see residual.c. */
  vec *polynomials;     /* of the displacement gradient, and of its forces */
  vec *wf_qm, *wm_qm;   /* weights times the polynomials of the first and of the second gradient */
  vec *force_bi;        /* on the coefficients of piecewise polynomials */
  /* For tangents. */
  vec *boundary_ba;    /* coefficients of the basis on the boundary */
  vec *gradient_xma;   /* of piecewise polynomials on one piece */
  vec *B_qra;          /* derivative rows */
  vec *Z_krb;          /* sums of products with second gradients, see smooth.c */
  vec *D_kqra;         /* w D B of the blocks k = xx, xy, yy for POINTS_AT_ONCE points, or SMOOTH_POINTS of smooth.c */
  vec *K_kab;          /* the tangent's blocks */
  vec *derivative_xma; /* coefficients of the four second derivatives */
  void *allocated;     /* all of the above that is not where the shapes have it */
} workspace;

/* Whether gradients are those of piecewise polynomials. */
static inline int is_piecewise(const tmc_batch *batch) { return batch->corners_spdx != NULL; }

/* Coefficients of the projected gradients of a shape. */
static inline size_t n_stored(const tmc_batch *batch) {
  if (is_piecewise(batch)) return (size_t)batch->n_inside * batch->n_basis;
  return 2 * (size_t)batch->n_first * batch->n_pieces * batch->n_basis;
}

/* How many monomials are needed at the points. */
static inline int n_monomials(const tmc_batch *batch) {
  const int n_lower = N_ROWS > N_FIRST_ROWS ? batch->n_lower : 0;
  return is_piecewise(batch) || n_lower > batch->n_first ? n_lower : batch->n_first;
}

static int allocate(workspace *work, const tmc_batch *batch, int tangent) {
  const int pieces = is_piecewise(batch);
  const size_t n = batch->n_basis, n_q = batch->n_points, n_1 = batch->n_first, n_m = n_monomials(batch);
  const size_t n_2 = batch->n_second, n_lower = N_ROWS > N_FIRST_ROWS ? batch->n_lower : 0;
  const size_t n_b = (size_t)batch->n_boundary + batch->n_inside;
  const struct {
    vec **part;
    size_t size;
    int wanted;
  } parts[] = {
      {&work->w_q, n_q, 1},
      {&work->xi_qx, 2 * n_q, 1},
      {&work->stored_gradient, n_stored(batch), 1},
      {&work->second_xma, 2 * n_2 * n, 1},
      {&work->inverse_h, 1, 1},
      {&work->corners_dx, 2 * (size_t)batch->n_corners, pieces},
      {&work->m_mq, n_m * n_q, 1},
      {&work->u_ai, 4 * n, 1}, /* two displacements side by side for the largest step */
      {&work->R_ai, 2 * n, 1},
      {&work->slope_tpx, 4 * (size_t)batch->n_pieces, pieces},
      {&work->bernstein_mq, n_1 * batch->n_piece_points, pieces},
      {&work->coefficient_bi, 4 * n_b, pieces},
      {&work->polynomials, 2 * N_F * n_1 + N_F * n_2 + 2 * N_G * n_lower, !tangent},
      {&work->wf_qm, n_1 * n_q, !tangent},
      {&work->wm_qm, n_lower * n_q, !tangent},
      {&work->force_bi, 2 * n_b, !tangent && pieces},
      {&work->boundary_ba, batch->n_boundary * n, tangent && pieces},
      {&work->gradient_xma, 2 * n_1 * n, tangent && pieces},
      {&work->B_qra, n_q * N_ROWS * n, tangent},
      {&work->Z_krb, 4 * 4 * n_lower * n, tangent && pieces},
      {&work->D_kqra, 3 * POINTS_AT_ONCE * N_ROWS * n, tangent},
      {&work->K_kab, 3 * n * n, tangent},
      {&work->derivative_xma, 4 * n_lower * n, tangent},
  };
  size_t total = 0;
  for (size_t p = 0; p < sizeof parts / sizeof *parts; ++p) total += parts[p].wanted ? parts[p].size : 0;
  vec *next;
  work->allocated = allocate_vectors(total, &next);
  if (!work->allocated) return 0;
  for (size_t p = 0; p < sizeof parts / sizeof *parts; ++p) {
    *parts[p].part = parts[p].wanted ? next : NULL;
    if (parts[p].wanted) next += parts[p].size;
  }
  work->any = 0;
  if (!pieces) return 1;
  for (size_t i = 0; i < n_1 * batch->n_piece_points; ++i) work->bernstein_mq[i] = (vec){0.0} + batch->bernstein_mq[i];
  if (!tangent) return 1;
  memset(work->boundary_ba, 0, batch->n_boundary * n * sizeof(vec));
  for (int b = 0; b < batch->n_boundary; ++b)
    for (int j = 0, at = b * batch->n_trace; j < batch->n_trace; ++j, ++at)
      work->boundary_ba[b * n + batch->trace_bj[at]] += batch->trace_value_bj[at];
  return 1;
}

/* ``n`` values of each of LANES shapes: where they are if the shapes are one aligned pack, else gathered. */
static const vec *of_shapes(const double *values_sp, size_t n, const int32_t *shape_v, vec *gathered) {
  int one_pack = shape_v[0] % LANES == 0;
  for (int v = 1; v < LANES; ++v) one_pack &= shape_v[v] == shape_v[0] + v;
  const double *pack = values_sp + (size_t)shape_v[0] * n;
  if (one_pack && (uintptr_t)pack % sizeof(vec) == 0) return (const vec *)pack;
  for (int v = 0; v < LANES; ++v) {
    const double *from = values_sp + (size_t)(shape_v[v] / LANES) * n * LANES + shape_v[v] % LANES;
    for (size_t i = 0; i < n; ++i) ((lanes)gathered)[i][v] = from[i * LANES];
  }
  return gathered;
}

/* The first n_m monomials at the points, each a product of one before it and a coordinate. */
static void monomials(const tmc_batch *batch, int n_m, const vec *xi_qx, vec *m_mq) {
  const int n_q = batch->n_points;
  for (int q = 0; q < n_q; ++q) m_mq[q] = (vec){0.0} + 1.0;
  for (int m = 0; m < n_m; ++m)
    for (int x = 0; x < 2; ++x) {
      const int product = batch->raised_mx[2 * m + x];
      if (product >= n_m || (x == 1 && batch->raised_mx[2 * m + 2] == product)) continue; /* left to the next one */
      const vec *from = m_mq + (size_t)m * n_q;
      vec *to = m_mq + (size_t)product * n_q;
      for (int q = 0; q < n_q; ++q) to[q] = from[q] * xi_qx[2 * q + x];
    }
}

/* Coefficients of polynomials whose monomials are from_m vectors apart, ``width`` of them side by side, and of their
 * derivatives [m][x], to_m and to_x apart. */
typedef struct {
  const int width;
  int n_m;
  size_t from_m, to_m, to_x;
} derivatives;

/* Derivatives with respect to the original coordinates, for the first n_m monomials. */
ALWAYS_INLINE void differentiate(const derivatives of, const tmc_batch *batch, const vec *inverse_h, const vec *from,
                                 vec *to) {
  for (int m = 0; m < of.n_m; ++m)
#pragma GCC unroll 2
    for (int x = 0; x < 2; ++x) {
      const vec factor = *inverse_h * batch->power_mx[2 * m + x];
      const vec *f = from + batch->raised_mx[2 * m + x] * of.from_m;
      vec *t = to + m * of.to_m + x * of.to_x;
      for (int k = 0; k < of.width; ++k) t[k] = factor * f[k];
    }
}

/* Slopes of the barycentric coordinates, weights and points of the pieces, from their corners. */
static void take_pieces(workspace *work, const tmc_batch *batch) {
  const int n = batch->n_piece_points;
  const vec slope_scale = *work->scale * (double)batch->n_trace, half_area = 0.5 / (*work->scale * *work->scale);
  for (int t = 0; t < batch->n_pieces; ++t) {
    const vec *corner[3];
    for (int p = 0; p < 3; ++p) corner[p] = work->corners + 2 * batch->corner_tp[3 * t + p];
    const vec e1x = corner[1][0] - corner[0][0], e1y = corner[1][1] - corner[0][1];
    const vec e2x = corner[2][0] - corner[0][0], e2y = corner[2][1] - corner[0][1];
    const vec twice = e1x * e2y - e1y * e2x, factor = slope_scale / twice, area = half_area * twice;
    vec *slope_px = work->slope_tpx + 4 * t;
    slope_px[0] = factor * e2y;
    slope_px[1] = -factor * e2x;
    slope_px[2] = -factor * e1y;
    slope_px[3] = factor * e1x;
    for (int q = 0; q < n; ++q) {
      const double s = batch->barycentric_qp[3 * q + 1], r = batch->barycentric_qp[3 * q + 2];
      work->w_q[t * n + q] = area * batch->piece_w_q[q];
      work->xi_qx[2 * (t * n + q)] = corner[0][0] + e1x * s + e2x * r;
      work->xi_qx[2 * (t * n + q) + 1] = corner[0][1] + e1y * s + e2y * r;
    }
  }
}

/* Coefficients, weights and monomials of the cells from first_cell on. Returns 0 and does nothing if their shapes are
 * those of the call before. */
static int take_shapes(workspace *work, const tmc_batch *batch, int64_t first_cell) {
  int32_t shape_v[LANES];
  for (int v = 0; v < LANES; ++v) {
    const int64_t c = first_cell + v;
    shape_v[v] = batch->shape_c[c < batch->n_cells ? c : batch->n_cells - 1]; /* lanes past the end repeat the last */
  }
  if (work->any && memcmp(shape_v, work->shape_v, sizeof shape_v) == 0) return 0;
  const int n_here = batch->n_cells - first_cell < LANES ? (int)(batch->n_cells - first_cell) : LANES;
  if (shape_v[n_here - 1] == shape_v[0] + n_here - 1) /* lanes past the end may as well have the rest of the pack */
    for (int v = n_here; v < LANES && shape_v[v - 1] % LANES < LANES - 1; ++v) shape_v[v] = shape_v[v - 1] + 1;
  memcpy(work->shape_v, shape_v, sizeof shape_v);
  work->any = 1;

  const size_t n = batch->n_basis, n_q = batch->n_points;
  work->gradient = of_shapes(batch->gradient_sptxma, n_stored(batch), shape_v, work->stored_gradient);
  work->scale = of_shapes(batch->inverse_h_sp, 1, shape_v, work->inverse_h);
  if (N_ROWS > N_FIRST_ROWS)
    work->second = of_shapes(batch->second_spxma, 2 * (size_t)batch->n_second * n, shape_v, work->second_xma);
  const vec *xi_qx = work->xi_qx;
  if (is_piecewise(batch)) {
    work->corners = of_shapes(batch->corners_spdx, 2 * (size_t)batch->n_corners, shape_v, work->corners_dx);
    work->weights = work->w_q;
    take_pieces(work, batch);
  } else {
    xi_qx = of_shapes(batch->xi_spqx, 2 * n_q, shape_v, work->xi_qx);
    work->weights = of_shapes(batch->w_spq, n_q, shape_v, work->w_q);
  }
  if (n_monomials(batch)) monomials(batch, n_monomials(batch), xi_qx, work->m_mq);
  return 1;
}

/* The polynomials of the first gradient at the points from q on, which are n_points apart, or those of a piece. */
static inline const vec *first_values(const workspace *work, const tmc_batch *batch, int q) {
  return is_piecewise(batch) ? work->bernstein_mq + q % batch->n_piece_points : work->m_mq + q;
}

static inline int first_stride(const tmc_batch *batch) {
  return is_piecewise(batch) ? batch->n_piece_points : batch->n_points;
}

/* End of the points that lie on the piece of point q. */
static inline int piece_end(const tmc_batch *batch, int q) {
  const int piece = batch->piece_q[q];
  while (++q < batch->n_points && batch->piece_q[q] == piece) {
  }
  return q;
}

/* Degrees of freedom, ``columns`` apart, without the translation of the cell's first node: it has no gradient, and a
 * stiff body that moves far would get forces from rounding by it. */
static void gather_nodes(const tmc_batch *batch, int64_t first_cell, const double *u_ni, int columns, vec *u_ai) {
  for (int v = 0; v < LANES; ++v) {
    const int64_t c = first_cell + v < batch->n_cells ? first_cell + v : batch->n_cells - 1;
    const int32_t *nodes_a = batch->nodes_ca + c * batch->n_basis;
    const double *first_i = u_ni + 2 * (int64_t)nodes_a[0];
    for (int a = 0; a < batch->n_basis; ++a)
      for (int i = 0; i < 2; ++i) {
        const double translation = a < batch->n_translated ? first_i[i] : 0.0;
        ((lanes)u_ai)[columns * a + i][v] = u_ni[2 * (int64_t)nodes_a[a] + i] - translation;
      }
  }
}

/* ---- States at points ---- */

typedef struct {
  vec x[N_X], psi, g[N_X];
} state;
