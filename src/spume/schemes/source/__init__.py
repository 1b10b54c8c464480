"""Right sides of the pressure Poisson equation."""
