"""Making meshes: of outlines, of other meshes, by Voronoi cells or gmsh."""
