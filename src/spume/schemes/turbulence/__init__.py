"""Turbulence below the size of a particle."""
