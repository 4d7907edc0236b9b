"""Designs: densities on polygons, and the optimisers that change them; only what needs no equilibrium."""
