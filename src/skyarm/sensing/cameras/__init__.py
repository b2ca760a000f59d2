"""Depth cameras and lidars, which see the shapes of contact by rays."""
