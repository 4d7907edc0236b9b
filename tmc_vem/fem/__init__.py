"""Reference solutions with quadratic finite elements in dolfinx, from the same energy densities as the VEM."""
