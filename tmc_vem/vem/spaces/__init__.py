"""Spaces of projected gradients on polygons: polynomials, quadrature, projectors, and the choice of l."""
