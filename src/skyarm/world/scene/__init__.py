"""Shapes of a vehicle and its world, and their poses, from the records alone."""
