"""Shapes of a vehicle and its world, and their poses, for pictures."""

from skyarm.world.scene.scene import Arrow, Instants, Line, Scene
from skyarm.world.scene.shapes import Shape, Solid

__all__ = ["Arrow", "Instants", "Line", "Scene", "Shape", "Solid"]
