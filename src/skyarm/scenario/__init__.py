"""Scenarios: complete definitions of experiments, read from files or made in Python."""
