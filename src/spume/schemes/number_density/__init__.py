"""Particle number density."""
