"""Stabilization-free virtual elements: monomials, quadrature, projectors, elements and the assembled system."""
