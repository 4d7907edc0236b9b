/* ---- Friction ----
 * The term that load steps add to the energy at a point, see kernel_abi.h. It is of rank one in F, and its second
 * derivative jumps where slip begins, so that it is written here and not generated.
 */

enum { AT_A_POINT = TMC_N_FRICTION * LANES };

/* Friction of LANES cells at their first point; NULL if they have none. */
static inline const_lanes friction_of(const tmc_batch *batch, int64_t first_cell) {
  if (!batch->friction_cpqk) return NULL;
  return (const_lanes)(batch->friction_cpqk + first_cell / LANES * batch->n_points * AT_A_POINT);
}

/* Whether any of the cells has friction at a point. */
ALWAYS_INLINE int has_friction(const_lanes k) {
  int any = 0;
  for (int v = 0; v < LANES; ++v) any |= k[TMC_FRICTION_STIFFNESS][v] > 0.0;
  return any;
}

/* Entries of the gradient and of the Hessian that vanish identically are never written, so that they would keep what was
 * added to them at the point before. */
ALWAYS_INLINE void clear_first(lanes g, lanes h) {
  for (int a = 0; a < N_F; ++a) {
    memset(g[a], 0, sizeof g[a]);
    for (int b = a; h && b < N_F; ++b) memset(h[packed(a, b)], 0, sizeof h[0]);
  }
}

/* Add to energy, gradient and Hessian of a point; what is NULL is left out. */
ALWAYS_INLINE void add_friction(const_lanes k, double damping, const_lanes x, double *psi, lanes g, lanes h) {
  double tau[LANES], stiffness[LANES];
  for (int v = 0; v < LANES; ++v) {
    const double bound = k[TMC_FRICTION_BOUND][v], kt = k[TMC_FRICTION_STIFFNESS][v], tau_n = k[TMC_FRICTION_TAU][v];
    double dg = -k[TMC_FRICTION_AH][v];
    for (int a = 0; a < N_F; ++a) dg += k[TMC_FRICTION_A + a][v] * x[a][v];
    const double trial = tau_n + kt * dg;
    const double below = trial < bound ? trial : bound;
    tau[v] = below > -bound ? below : -bound;
    stiffness[v] = trial < bound && trial > -bound ? kt : damping * kt;
    const double change = tau[v] - tau_n;
    psi[v] += kt > 0.0 ? tau[v] * dg - 0.5 * change * change / kt : 0.0;
  }
  for (int a = 0; g && a < N_F; ++a)
    for (int v = 0; v < LANES; ++v) g[a][v] += tau[v] * k[TMC_FRICTION_A + a][v];
  for (int a = 0; h && a < N_F; ++a)
    for (int b = a; b < N_F; ++b)
      for (int v = 0; v < LANES; ++v)
        h[packed(a, b)][v] += stiffness[v] * k[TMC_FRICTION_A + a][v] * k[TMC_FRICTION_A + b][v];
}
