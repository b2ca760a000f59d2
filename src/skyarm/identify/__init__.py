"""Numbers of a scenario found from measured ones: parameters by path, cells by metric, a loss, a search, profiles; delays and lags from a log."""
