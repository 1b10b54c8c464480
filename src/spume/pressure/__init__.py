"""The pressure Poisson equation: matrix, connected components, solvers."""
