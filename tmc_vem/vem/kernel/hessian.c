/* ---- The packed Hessian of an energy at a point ---- */

/* Position of (row, column), row <= column, in the packed upper triangle of the Hessian. */
static inline int packed(int row, int column) { return row * N_X - row * (row - 1) / 2 + column - row; }

static inline int hessian_index(int a, int b) { return a <= b ? packed(a, b) : packed(b, a); }
