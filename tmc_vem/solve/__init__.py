"""Nonlinear solution of any discretisation that implements the protocol: Newton's method and load stepping."""
