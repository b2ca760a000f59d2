"""Metrics of an episode: counted while it flies, or computed from its log."""
