"""Viscosity."""
