"""Tracing of a function into a straight-line program."""
