"""Learned compensator: the paper's law with a small network that estimates unmodelled forces."""
