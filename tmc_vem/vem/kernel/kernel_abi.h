/* The interface of the cell driver: what a kernel of virtual elements exports besides that of points.h.
 *
 * Arrays are dense and row-major; the suffix names the axes:
 *   c  cell of the batch            s  shape: cells with equal projectors share one
 *   q  quadrature point             t  piece: where the projected gradient is piecewise polynomial
 *   a, b  scalar basis function     i, j  displacement component, 0 or 1
 *   m  scaled monomial              x  direction, 0 or 1
 *   n  node, which carries both displacement components
 *   b  coefficient of a piecewise polynomial, those on the boundary first        p  corner of a piece, 0 to 2
 * Shapes come in packs of eight: the suffix sp means [shape / 8] first and [shape % 8] as the last axis, so that
 * sp_ma is [n_packs][m][a][8].
 */

/* Cells with equally many basis functions, pieces and quadrature points.
 *
 * The projected gradient of a basis function is, on piece t, sum_m gradient_txma m(xi); the second gradient is the
 * derivative of sum_m second_xma m(xi), one polynomial on the whole cell. Both are derivatives with respect to the
 * original coordinates. Which monomials of the scaled coordinates there are is told by a table: of every monomial m and
 * coordinate xi_x, where xi_x m stands among them, and its power of xi_x, so that d(xi_x m)/dxi_x is power_mx m. The first
 * monomial is 1, and every other is one of these products.
 *
 * Continuous piecewise polynomials of degree k + 1 on sub-triangles are stored as Bernstein coefficients of the basis:
 * those inside the cell by shape, those on its boundary as combinations of a few degrees of freedom, the same for all
 * cells of the batch. With the barycentric coordinates lambda of a piece and the Bernstein polynomials B_m of degree k,
 * its gradient is (k + 1) sum_m B_m sum_p grad lambda_p c_(m + e_p). Corners of the pieces say where points are and how
 * much they weigh.
 */
typedef struct {
  int64_t n_cells;
  int32_t n_basis, n_points, n_pieces;
  int32_t n_first;            /* polynomials that make the first gradient */
  int32_t n_second, n_lower;  /* monomials of second_xma, and of its derivatives, the first of them */
  int32_t n_translated; /* a translation by 1 is 1 in so many degrees of freedom, the first, and 0 in the others; or 0 */
  int32_t n_corners, n_boundary, n_inside; /* of piecewise polynomials: corners of pieces, coefficients b, or 0 */
  int32_t n_trace;        /* degrees of freedom j of a side, k + 1, which is also the factor of the gradient */
  int32_t n_piece_points; /* points on every piece */
  const int32_t *raised_mx;               /* positions of xi m and eta m, for the monomials of both gradients */
  const double *power_mx;                 /* powers of xi in the one, of eta in the other */
  const int32_t *shape_c;                 /* [n_cells] */
  const int32_t *nodes_ca;                /* [n_cells][n_basis] */
  const int32_t *piece_q;                 /* [n_points] the piece on which a point lies */
  const double *w_spq;                    /* weights (area); NULL for piecewise polynomials */
  const double *xi_spqx;                  /* points in scaled coordinates; NULL for piecewise polynomials */
  const double *inverse_h_sp;             /* 1 / h, the scale of the coordinates */
  const double *gradient_sptxma;          /* coefficients of the projected gradient; or inside_spba */
  const double *second_spxma;             /* of the second gradient's potential; only read if tmc_n_rows is 6 */
  const double *corners_spdx;             /* corners of the pieces in scaled coordinates; NULL if there is no such thing */
  const int32_t *corner_tp;               /* [n_pieces][3] corner 0, 1 and 2 of a piece */
  const int32_t *raised_tmp;              /* [n_pieces][n_first][3] which coefficient is m + e_p on a piece */
  const int32_t *trace_bj;                /* [n_boundary][n_trace] basis functions that a coefficient depends on */
  const double *trace_value_bj;           /* and by how much */
  const double *barycentric_qp;           /* [n_piece_points][3] points of every piece */
  const double *piece_w_q;                /* [n_piece_points] their weights, of sum 1 */
  const double *bernstein_mq;             /* [n_first][n_piece_points] the polynomials at these points */
  const double *factor_ck;                /* [n_cells][N_VARYING] of parameters that vary; not read if there are none */
  const double *friction_cpqk;            /* [n_cells / 8][n_points][TMC_N_FRICTION][cell % 8]; NULL for no friction */
  const double *slip_damping;             /* [1] fraction of kt in the tangent of points that slip; read with friction */
} tmc_batch;

/* Friction of a load step at a point: A in the order of F - I, A : (F_n - I), the bound c, the stiffness kt and the shear
 * at the beginning of the step. With trial = tau_n + kt (A : F - A : F_n) and tau = clip(trial, -c, c),
 *   psi += tau dg - (tau - tau_n)^2 / (2 kt),   g += tau A,   h += (|trial| < c ? kt : slip_damping kt) A (x) A;
 * nothing where kt is 0. The second derivative is that without damping; with it Newton's method takes shorter steps. */
enum { TMC_FRICTION_A = 0, TMC_FRICTION_AH = 4, TMC_FRICTION_BOUND, TMC_FRICTION_STIFFNESS, TMC_FRICTION_TAU, TMC_N_FRICTION };

/* Where element tangents go: the values of a matrix in compressed rows whose row and column 2 n + i belong to
 * component i of a node, or, if dense_caibj is not NULL, an array of element matrices. */
typedef struct {
  double *dense_caibj;          /* [n_cells][n_basis][2][n_basis][2] */
  double *values;               /* added to */
  const int32_t *position_cab;  /* [n_cells][n_basis][n_basis] of entry (2 a, 2 b) in values */
  const int32_t *row_length_n;  /* entries of row 2 n, and of row 2 n + 1, whose pattern is the same */
} tmc_tangents;

/* Energy, residual (52) and tangent (56) of a batch of cells.
 *   u_ni        [n_nodes][2]   displacement degrees of freedom
 *   parameters  [n_parameters] in the declared order
 *   energy_c    [n_cells]      out
 *   min_j_c     [n_cells]      out: smallest J at the quadrature points
 *   residual_ni [n_nodes][2]   added to if it is not NULL, which takes level 1
 *   tangents                   from level 2, else may be NULL
 * Returns -1, or the first cell with J <= 0 or J not a number; values of that cell are then meaningless.
 *         -2 if memory ran out.
 */
int64_t tmc_cells(int level, const tmc_batch *batch, const double *u_ni, const double *parameters,
                  double *energy_c, double *min_j_c, double *residual_ni, const tmc_tangents *tangents);

/* Largest step s with J(u + t du) > 0 at every quadrature point for all t in [0, s): exact, as J is a quadratic of t.
 *   step_c      [n_cells]  out: infinity where J stays positive
 * Returns -1, or -2 if memory ran out.
 */
int64_t tmc_max_step(const tmc_batch *batch, const double *u_ni, const double *du_ni, double *step_c);

/* Positions for tmc_tangents in a matrix with sorted columns, both components of a node side by side.
 *   row_start_n [n_nodes]  position of the first entry of row 2 n in values and columns
 *   column_n    [n_nodes]  column of component 0 of a node
 *   columns     [.]        columns of all entries
 * Returns -1, or the first cell with an entry that the matrix does not have, or -2 if memory ran out.
 */
int64_t tmc_positions(int64_t n_cells, int n_basis, const int32_t *nodes_ca, const int64_t *row_start_n,
                      const int32_t *row_length_n, const int32_t *column_n, const int32_t *columns,
                      int32_t *position_cab);
