"""Shapes, filling them with particles on a common lattice, and walls made as layers around them."""

from spume.geometry.combined import Difference, Intersection, Union
from spume.geometry.extrusion import Extrusion
from spume.geometry.grid import Grid, fill
from spume.geometry.layers import Layers, wall_layers
from spume.geometry.shapes import Box, Cylinder, Polygon, Shape, Sphere, Tank
from spume.geometry.stl import Stl

__all__ = [
    "Box",
    "Cylinder",
    "Difference",
    "Extrusion",
    "Grid",
    "Intersection",
    "Layers",
    "Polygon",
    "Shape",
    "Sphere",
    "Stl",
    "Tank",
    "Union",
    "fill",
    "wall_layers",
]
