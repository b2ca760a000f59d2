"""JAX functions of a traced program."""
