"""Divergence models."""
