"""Gradient models."""
