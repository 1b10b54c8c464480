"""Shapes, filling them with particles on a common lattice, and walls made as layers around them."""

from spume.geometry.grid import Grid, fill
from spume.geometry.layers import Layers, wall_layers
from spume.geometry.shapes import Box, Cylinder, Polygon, Shape, Sphere, Tank

__all__ = ["Box", "Cylinder", "Grid", "Layers", "Polygon", "Shape", "Sphere", "Tank", "fill", "wall_layers"]
