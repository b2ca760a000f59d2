"""All laws on one bench: the same cases, the same noise, the same wrong plants, one table."""
