"""Measured flights: files of real flights read as channels in SI units and the axes of the library."""
