"""Numbers of a scenario found from measured ones, and delays and lags found in a log.

Parameters by path, cells by metric, a loss, a search, profiles; inverse dynamics, lagged commands, a whitened fit.
"""
