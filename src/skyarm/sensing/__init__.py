"""Sensors: from the true state to a measurement."""
