"""Figures from logs: data in, Figure out. Nothing here simulates, saves or touches global state."""
