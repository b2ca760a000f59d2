"""MCAP files of flights."""
