"""Algorithms of a time step, one file each."""
