/* What every generated kernel exports. */

/* What to compute; each level includes the ones before it. */
enum { TMC_ENERGY = 0, TMC_GRADIENT = 1, TMC_TANGENT = 2 };

/* Number of derivative rows that the energy uses: 2 (F only) or 6 (F and G). */
extern const int tmc_n_rows;

/* Energy density and its derivatives at single states, in the order of Appendix C.
 *   x_nx   [n_states][12]  F - I and G: [H11 H21 H12 H22 G111 G211 G121 G221 G112 G212 G122 G222]
 *   psi_n  [n_states]      out
 *   g_nx   [n_states][12]  out from level 1, else may be NULL
 *   h_nk   [n_states][78]  out at level 2, else may be NULL: upper triangle of the Hessian, row by row
 */
void tmc_points(int level, int64_t n_states, const double *x_nx, const double *parameters,
                double *psi_n, double *g_nx, double *h_nk);
