/* Cells with equally many basis functions, pieces and quadrature points, in memory of the device: arrays are dense, the last
 * axis is the fastest, and the axes are called as in kernel_abi.h. It is passed to kernels by value. */
struct cells {
  long long n_cells;
  int n_shapes, n_basis, n_points, n_pieces;
  int n_first, n_lower; /* polynomials of first and of second derivatives */
  int n_translated; /* a translation by 1 is 1 in so many degrees of freedom, the first, and 0 in the others; or 0 */
  const int *shape_c;          /* shape of a cell */
  const int *nodes_ca;         /* its nodes */
  const int *piece_q;          /* piece on which a point lies */
  const double *w_sq;          /* weights (area) */
  const double *first_sqm;     /* polynomials at the points, of first derivatives, */
  const double *second_sqm;    /* and of second derivatives; not read if there are none */
  const double *first_strma;   /* coefficients of first derivatives, [N_FIRST_ROWS] for r */
  const double *second_srma;   /* of second derivatives; not read if there are none */
};
