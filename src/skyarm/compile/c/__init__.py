"""C99 source of a traced program."""
