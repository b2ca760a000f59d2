"""System identification: scenario parameters from measurements, delays and lags from a log.

Parameters by path, cells by metric, a loss, a search, profiles; inverse dynamics, lagged commands, a whitened fit.
"""
