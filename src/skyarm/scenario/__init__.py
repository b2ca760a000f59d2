"""Scenarios: one experiment, read from a file or made in Python, and its numbers by path."""
