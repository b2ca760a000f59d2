"""Estimators: from readings of the sensors to the measurement of a law."""
