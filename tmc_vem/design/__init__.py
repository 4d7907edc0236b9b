"""Designs: densities on polygons, what they are worth, the optimisers that change them, and problems made of them."""
