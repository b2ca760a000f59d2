"""All laws compared: the same cases, the same noise, the same perturbed plants, one table."""
