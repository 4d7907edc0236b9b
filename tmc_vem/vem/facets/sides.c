/* ---- Driver for sides -------------------------------------------------------------------------------------------
 * A lane is a side. At every point of a face, the rows of the face's own cell and those of the jump stand below each
 * other, on the basis functions of all faces: B_ra. The tangent is built from its component blocks xx, xy and yy.
 */

enum { N_JUMP = DIMENSION };

typedef struct {
  void *allocated;
  vec *u_ai, *R_ai;
  vec *B_qra;    /* rows of one face at all points */
  vec *D_kqra;   /* the material's answer to them, for the blocks xx, xy, yy */
  vec *K_kab;
} side_workspace;

static int allocate_sides(side_workspace *work, const tmc_sides *sides, int level) {
  const size_t n = sides->n_basis, rows = (size_t)sides->n_points * (sides->n_own + N_JUMP);
  const size_t tangent = level >= TMC_TANGENT ? 3 * rows * n + 3 * n * n : 0;
  work->allocated = allocate_vectors(4 * n + rows * n + tangent, &work->u_ai);
  if (!work->allocated) return 0;
  work->R_ai = work->u_ai + 2 * n;
  work->B_qra = work->R_ai + 2 * n;
  work->D_kqra = work->B_qra + rows * n;
  work->K_kab = work->D_kqra + 3 * rows * n;
  return 1;
}

static void gather_sides(const tmc_sides *sides, int64_t s0, const double *u_ni, vec *u_ai) {
  const int n = sides->n_basis;
  for (int v = 0; v < LANES; ++v) {
    const int64_t s = s0 + v < sides->n_sides ? s0 + v : sides->n_sides - 1;
    for (int a = 0; a < n; ++a)
      for (int i = 0; i < 2; ++i) ((double *)(u_ai + 2 * a + i))[v] = u_ni[2 * (int64_t)sides->nodes_sa[s * n + a] + i];
  }
}

/* Rows of a face at all points: its own, which other faces do not contribute to, and those of the jump. */
static void take_rows(const tmc_sides *sides, int64_t pack, int face, vec *B_qra) {
  const int n = sides->n_basis, n_own = sides->n_own, n_a = sides->n_a[face], first = sides->first_a[face];
  const vec *own = (const vec *)sides->rows_spqra[face] + pack * sides->n_points * n_own * n_a;
  const vec *jump = (const vec *)sides->jump_spqxa + pack * sides->n_points * N_JUMP * n;
  for (int q = 0; q < sides->n_points; ++q) {
    vec *B_ra = B_qra + (size_t)q * (n_own + N_JUMP) * n;
    memset(B_ra, 0, (size_t)n_own * n * sizeof(vec));
    for (int r = 0; r < n_own; ++r)
      memcpy(B_ra + r * n + first, own + ((size_t)q * n_own + r) * n_a, (size_t)n_a * sizeof(vec));
    memcpy(B_ra + n_own * n, jump + (size_t)q * N_JUMP * n, (size_t)N_JUMP * n * sizeof(vec));
  }
}

/* D_ra of one point for the blocks xx, xy and yy, ``block`` apart: the Hessian, pulled back to the rows, times B. */
static void side_material(int n_own, int n, vec w, const vec *c_e, const vec *h, const vec *B_ra, vec *D_ra,
                          size_t block) {
  static const int components[3][2] = {{0, 0}, {0, 1}, {1, 1}};
  const int n_rows = n_own + N_JUMP;
  for (int k = 0; k < 3; ++k) {
    vec D_sr[(N_ROWS + N_JUMP) * (N_ROWS + N_JUMP)];
    memset(D_sr, 0, (size_t)n_rows * n_rows * sizeof(vec));
    for (int s = 0; s < N_ROWS; ++s) {
      const int to_s = s < n_own ? s : n_own + (s - n_own) % N_JUMP;
      vec ws = w;
      if (s >= n_own) ws *= c_e[s - n_own];
      for (int r = 0; r < N_ROWS; ++r) {
        const int to_r = r < n_own ? r : n_own + (r - n_own) % N_JUMP;
        vec entry = ws * h[hessian_index(2 * r + components[k][0], 2 * s + components[k][1])];
        if (r >= n_own) entry *= c_e[r - n_own];
        D_sr[to_s * n_rows + to_r] += entry;
      }
    }
    product(0, 0, n_rows, n, n_rows, D_sr, n_rows, B_ra, n, D_ra + k * block, n);
  }
}

static void store_side(const tmc_sides *sides, int64_t s, int lane, const vec *K_kab, double *dense_saibj,
                       double *values, const int32_t *position_sab, const int32_t *row_length_n) {
  const int n = sides->n_basis;
  const_lanes xx = (const_lanes)K_kab, xy = xx + n * n, yy = xy + n * n;
  for (int a = 0; a < n; ++a) {
    const int64_t below = dense_saibj ? 2 * n : row_length_n[sides->nodes_sa[s * n + a]];
    for (int b = 0; b < n; ++b) {
      /* the blocks xx and yy are symmetric and known on and above the diagonal */
      const int ab = a <= b ? a * n + b : b * n + a;
      const double K11 = xx[ab][lane], K12 = xy[a * n + b][lane], K21 = xy[b * n + a][lane], K22 = yy[ab][lane];
      if (dense_saibj) {
        double *entry = dense_saibj + s * 4 * n * n + 4 * a * n + 2 * b;
        entry[0] = K11, entry[1] = K12, entry[below] = K21, entry[below + 1] = K22;
      } else {
        double *entry = values + position_sab[(s * n + a) * n + b];
        entry[0] += K11, entry[1] += K12, entry[below] += K21, entry[below + 1] += K22;
      }
    }
  }
}

int64_t tmc_side_terms(int level, const tmc_sides *sides, const double *u_ni, const double *parameters,
                       double *energy_s, double *min_j_s, double *residual_ni, double *dense_saibj, double *values,
                       const int32_t *position_sab, const int32_t *row_length_n) {
  side_workspace work;
  if (!allocate_sides(&work, sides, level)) return -2;
  const int n = sides->n_basis, n_own = sides->n_own, n_rows = n_own + N_JUMP, n_q = sides->n_points;
  const int n_extra = N_ROWS - n_own;
  const size_t block = (size_t)n_q * n_rows * n;
  vec x[N_X], psi, g[N_X], h[N_H];
  double read[N_READ];
  memset(g, 0, sizeof g); /* entries that vanish identically are never written */
  memset(h, 0, sizeof h);

  for (int64_t s0 = 0; s0 < sides->n_sides; s0 += LANES) {
    const int64_t pack = s0 / LANES;
    const vec *c_e = (const vec *)sides->coefficient_spe + pack * n_extra;
    gather_sides(sides, s0, u_ni, work.u_ai);
    vec energy = {0.0}, min_j = (vec){0.0} + INFINITY;
    memset(work.R_ai, 0, 2 * (size_t)n * sizeof(vec));
    if (level >= TMC_TANGENT) memset(work.K_kab, 0, 3 * (size_t)n * n * sizeof(vec));
    for (int face = 0; face < sides->n_faces; ++face) {
      const double *factor_sk = sides->factor_fsk + (size_t)face * sides->n_sides * N_VARYING;
      const double *of_face = parameters_read(s0, sides->n_sides, parameters, factor_sk, read);
      take_rows(sides, pack, face, work.B_qra);
      for (int q = 0; q < n_q; ++q) {
        const vec *B_ra = work.B_qra + (size_t)q * n_rows * n;
        const vec w = ((const vec *)sides->w_spq)[pack * n_q + q];
        vec y[2 * (N_ROWS + N_JUMP)];
        for (int r = 0; r < n_rows; ++r) {
          vec y0 = {0.0}, y1 = {0.0};
          for (int a = 0; a < n; ++a) y0 += B_ra[r * n + a] * work.u_ai[2 * a], y1 += B_ra[r * n + a] * work.u_ai[2 * a + 1];
          y[2 * r] = y0, y[2 * r + 1] = y1;
        }
        memcpy(x, y, 2 * (size_t)n_own * sizeof(vec));
        lower(&min_j, x);
        for (int e = 0; e < n_extra; ++e)
          for (int i = 0; i < 2; ++i) x[2 * (n_own + e) + i] = c_e[e] * y[2 * (n_own + e % N_JUMP) + i];

        if (level == TMC_ENERGY)
          point_energy((const_lanes)x, of_face, (double *)&psi);
        else if (level == TMC_GRADIENT)
          point_gradient((const_lanes)x, of_face, (double *)&psi, (lanes)g);
        else
          point_tangent((const_lanes)x, of_face, (double *)&psi, (lanes)g, (lanes)h);
        energy += w * psi;
        if (residual_ni && level >= TMC_GRADIENT) {
          vec f[2 * (N_ROWS + N_JUMP)];
          memset(f, 0, 2 * (size_t)n_rows * sizeof(vec));
          for (int r = 0; r < N_ROWS; ++r) {
            const int to = r < n_own ? r : n_own + (r - n_own) % N_JUMP;
            vec c = w;
            if (r >= n_own) c *= c_e[r - n_own];
            for (int i = 0; i < 2; ++i) f[2 * to + i] += c * g[2 * r + i];
          }
          for (int r = 0; r < n_rows; ++r)
            for (int a = 0; a < n; ++a)
              for (int i = 0; i < 2; ++i) work.R_ai[2 * a + i] += f[2 * r + i] * B_ra[r * n + a];
        }
        if (level >= TMC_TANGENT)
          side_material(n_own, n, w, c_e, h, B_ra, work.D_kqra + (size_t)q * n_rows * n, block);
      }
      if (level >= TMC_TANGENT)
        for (int k = 0; k < 3; ++k)
          product(k != 1, 1, n, n, n_q * n_rows, work.B_qra, n, work.D_kqra + k * block, n,
                  work.K_kab + (size_t)k * n * n, n);
    }
    for (int v = 0; v < LANES && s0 + v < sides->n_sides; ++v) {
      const int64_t s = s0 + v;
      energy_s[s] = ((double *)&energy)[v];
      min_j_s[s] = ((double *)&min_j)[v];
      if (residual_ni && level >= TMC_GRADIENT)
        for (int a = 0; a < n; ++a)
          for (int i = 0; i < 2; ++i)
            residual_ni[2 * (int64_t)sides->nodes_sa[s * n + a] + i] += ((double *)(work.R_ai + 2 * a + i))[v];
      if (level >= TMC_TANGENT)
        store_side(sides, s, v, work.K_kab, dense_saibj, values, position_sab, row_length_n);
    }
  }
  free(work.allocated);
  return -1;
}

int64_t tmc_side_limits(const tmc_sides *sides, const double *u_ni, const double *du_ni, double *step_s) {
  const int n = sides->n_basis, n_own = sides->n_own, n_q = sides->n_points;
  vec *u_ai;
  void *allocated = allocate_vectors(4 * (size_t)n, &u_ai);
  if (!allocated) return -2;
  vec *du_ai = u_ai + 2 * n;
  for (int64_t s0 = 0; s0 < sides->n_sides; s0 += LANES) {
    gather_sides(sides, s0, u_ni, u_ai);
    gather_sides(sides, s0, du_ni, du_ai);
    vec step = (vec){0.0} + INFINITY;
    for (int face = 0; face < sides->n_faces; ++face) {
      const int n_a = sides->n_a[face], first = sides->first_a[face];
      const vec *rows = (const vec *)sides->rows_spqra[face] + s0 / LANES * n_q * n_own * n_a;
      for (int q = 0; q < n_q; ++q, rows += n_own * n_a) {
        vec gradients[8]; /* [x][i], i of u and of du */
        for (int x = 0; x < 2; ++x)
          for (int i = 0; i < 2; ++i) {
            vec of_u = {0.0}, of_du = {0.0};
            for (int a = 0; a < n_a; ++a) {
              of_u += rows[x * n_a + a] * u_ai[2 * (first + a) + i];
              of_du += rows[x * n_a + a] * du_ai[2 * (first + a) + i];
            }
            gradients[4 * x + i] = of_u;
            gradients[4 * x + 2 + i] = of_du;
          }
        limit(&step, gradients);
      }
    }
    for (int v = 0; v < LANES && s0 + v < sides->n_sides; ++v) step_s[s0 + v] = ((double *)&step)[v];
  }
  free(allocated);
  return -1;
}
