"""Optimal design: densities on polygons, and what is made of them."""
