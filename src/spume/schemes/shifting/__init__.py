"""Particle shifting."""
