"""Contact of the solids alone, without a medium: a reference of its own, of which only meshes are those of tmc_vem.

Frictionless penalty contact of quadratic finite elements, in numpy and scipy: energy, elements, contact and Newton's
method are written out here once more, so that agreement says something. ``studies`` has the problems.
"""
