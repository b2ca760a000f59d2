"""Scenarios: definition of one experiment, read from a file or made in Python, and access to its numbers by path."""
