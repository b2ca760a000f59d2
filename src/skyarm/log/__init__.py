"""Log of an episode, its files and metrics."""
