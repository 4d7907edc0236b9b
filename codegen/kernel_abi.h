/* The interface of a generated kernel. Every generated shared object exports exactly these names.
 *
 * Arrays are dense and row-major; the suffix names the axes:
 *   c  cell of the batch            s  shape: cells with equal projectors share one
 *   q  quadrature point             r  derivative row: d1, d2, d1d1, d2d1, d1d2, d2d2
 *   a, b  scalar basis function     i, j  displacement component, 0 or 1
 * All cells of a call have the same number of basis functions and of quadrature points. The last axis of B is padded
 * with zeros from n_basis to stride.
 */

/* What to compute; each level includes the ones before it. */
enum { TMC_ENERGY = 0, TMC_GRADIENT = 1, TMC_TANGENT = 2 };

/* Number of derivative rows that the energy uses: 2 (F only) or 6 (F and G). */
extern const int tmc_n_rows;

/* Energy, residual (52) and tangent (56) of a batch of cells.
 *   shape_c     [n_cells]                            index into the first axis of B and w
 *   B_sqra      [n_shapes][n_points][6][stride]      derivatives of the projected scalar basis
 *   w_sq        [n_shapes][n_points]                 quadrature weights
 *   u_cai       [n_cells][n_basis][2]                displacement degrees of freedom
 *   parameters  [n_parameters]                       in the declared order
 *   energy_c    [n_cells]                            out
 *   min_j_c     [n_cells]                            out: smallest J at the quadrature points
 *   residual_cai  [n_cells][n_basis][2]              out from level 1, else may be NULL
 *   tangent_caibj [n_cells][n_basis][2][n_basis][2]  out at level 2, else may be NULL
 * Returns -1, or the first cell with J <= 0 or J not a number; values of that cell are then meaningless.
 *         -2 if memory ran out.
 */
int64_t tmc_cells(int level, int64_t n_cells, int n_basis, int stride, int n_points,
                  const int32_t *shape_c, const double *B_sqra, const double *w_sq, const double *u_cai,
                  const double *parameters,
                  double *energy_c, double *min_j_c, double *residual_cai, double *tangent_caibj);

/* Largest step s with J(u + t du) > 0 at every quadrature point for all t in [0, s): exact, as J is a quadratic of t.
 *   step_c      [n_cells]  out: infinity where J stays positive
 */
void tmc_max_step(int64_t n_cells, int n_basis, int stride, int n_points,
                  const int32_t *shape_c, const double *B_sqra, const double *u_cai, const double *du_cai,
                  double *step_c);

/* Energy density and its derivatives at single states, in the order of Appendix C.
 *   x_nx   [n_states][12]  F - I and G: [H11 H21 H12 H22 G111 G211 G121 G221 G112 G212 G122 G222]
 *   psi_n  [n_states]      out
 *   g_nx   [n_states][12]  out from level 1, else may be NULL
 *   h_nk   [n_states][78]  out at level 2, else may be NULL: upper triangle of the Hessian, row by row
 */
void tmc_points(int level, int64_t n_states, const double *x_nx, const double *parameters,
                double *psi_n, double *g_nx, double *h_nk);
