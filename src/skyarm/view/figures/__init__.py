"""Matplotlib figures from logs, without simulation, file output or global state."""
