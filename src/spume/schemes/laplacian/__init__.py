"""Laplacian models, shared by the pressure matrix and by viscosity."""
