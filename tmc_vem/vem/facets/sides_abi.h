/* The interface of the driver for sides: what a kernel of the interior penalty exports besides that of points.h.
 *
 * Arrays are dense and row-major; the suffix names the axes:
 *   s  side                         f  face: the cell on one side of it
 *   q  quadrature point             a, b  scalar basis function of all faces, one face after the other
 *   r  derivative row               e  row that is made of the jump
 *   i, j  displacement component    n  node
 * Sides come in packs of eight: the suffix sp means [side / 8] first and [side % 8] as the last axis.
 */

/* Sides with equally many faces and basis functions.
 *
 * A point of a face reads n_own rows of its own cell's polynomials and the rows e = 0, 1, ... of the jump: coefficient_e
 * times the jump of the derivative with respect to direction e % 2.
 */
typedef struct {
  int64_t n_sides;
  int32_t n_faces, n_points, n_basis;
  int32_t n_own;                    /* rows of the face's own cell: 2 or 6 */
  int32_t first_a[2], n_a[2];       /* basis functions of each face: the first one, and how many */
  const int32_t *nodes_sa;          /* [n_sides][n_basis] */
  const double *w_spq;              /* weights (length), for each face */
  const double *coefficient_spe;
  const double *rows_spqra[2];      /* of each face, on its own basis functions */
  const double *jump_spqxa;         /* derivatives x of the jump, on all basis functions */
  const double *factor_fsk;         /* [n_faces][n_sides][N_VARYING] of parameters that vary from cell to cell */
} tmc_sides;

/* Energy, residual and tangent of sides.
 *   u_ni          [n_nodes][2]           displacement degrees of freedom
 *   parameters    [n_parameters]         in the declared order
 *   energy_s      [n_sides]              out
 *   min_j_s       [n_sides]              out: smallest J at the points of all faces
 *   residual_ni   [n_nodes][2]           added to if it is not NULL, which takes level 1
 *   dense_saibj   [n_sides][a][2][b][2]  from level 2; or NULL, then the tangents are added to
 *   values                               those of a matrix in compressed rows, as in tmc_tangents of cells, with
 *   position_sab  [n_sides][a][b]        the positions of the entries (2 a, 2 b) and
 *   row_length_n                         the number of entries of row 2 n, and of row 2 n + 1
 * Returns -1, or -2 if memory ran out.
 */
int64_t tmc_side_terms(int level, const tmc_sides *sides, const double *u_ni, const double *parameters,
                       double *energy_s, double *min_j_s, double *residual_ni, double *dense_saibj, double *values,
                       const int32_t *position_sab, const int32_t *row_length_n);

/* Largest step s with J(u + t du) > 0 at every point of the faces for all t in [0, s): exact, as J is a quadratic of t.
 *   step_s        [n_sides]              out: infinity where J stays positive
 * Returns -1, or -2 if memory ran out.
 */
int64_t tmc_side_limits(const tmc_sides *sides, const double *u_ni, const double *du_ni, double *step_s);
