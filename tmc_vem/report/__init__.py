"""From results to tables, figures and pages; solves nothing and imports no PETSc."""
