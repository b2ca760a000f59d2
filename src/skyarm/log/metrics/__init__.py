"""Metrics of an episode, accumulated during the flight or computed from its log."""
